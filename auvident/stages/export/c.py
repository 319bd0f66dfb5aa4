"""The model as C: a header, and a source file that needs no other.

C99 in doubles, without allocation. The source file begins with the text of the header, so that
neither has to know the other's name.
"""

import re

from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.quoting import comment
from auvident.stages.export.contents import (
    EXPRESSIONS,
    Contents,
    comment_lines,
    contents_of,
    title,
)
from auvident.stages.export.expressions import force_expressions, mass_expressions
from auvident.stages.export.template import assembled, filled

WIDTH = 95
HEADER = """// @title@
// C99, link with -lm; no allocation. Units SI, angles in radians. A positive rudder has its
// trailing edge to port (the bow turns to port), a positive elevator its trailing edge down; the
// propeller rate is in rev/s.
// States: @states@.
// Inputs as ordered, for auvident_simulate: @inputs@.
// Inputs as they act, for auvident_derivative and auvident_step: @acting@.
@remarks@
#ifndef AUVIDENT_MODEL_H
#define AUVIDENT_MODEL_H
#include <stddef.h>

// What a simulation takes beside the inputs; all zero is the default. Series have a value a row.
typedef struct {
    int fin_given;            // whether the angle of the servo at the start is given ...
    double fin;               // ... and it; by default what the first row orders
    size_t before;            // rows of inputs before the start, which servo, delay and play
                              // remember; "auvident simulate" takes those of 20 s, and before
                              // them, for a play, the angles at which the fin was turned back
    double elapsed_s;         // time of the first row after these since the start of the trial
    const double *speed_mps;  // surge velocity as logged, for the thrust that meets the fin; NULL
                              // for that of the start, as where no speed was logged
    const double *roll_rad;   // as logged; NULL for zero
    const double *pitch_rad;  // as logged; NULL for zero
    const double *depth_m;    // as logged; NULL for zero
} auvident_options;

// Time derivative of the state.
void auvident_derivative(const double x[4], const double inputs[@columns@], double dx[4]);

// State after one step of the classical Runge-Kutta method with constant inputs.
void auvident_step(const double x[4], const double inputs[@columns@], double dt_s, double out[4]);

// States at the start of every step, as "auvident simulate" predicts them, 4 a row; inputs, 3 a
// row: those before the start, then `rows` others. options may be NULL.
void auvident_simulate(const double x[4], const double *inputs, size_t rows, double dt_s,
                       const auvident_options *options, double *states);
[water]
[water]// Adds the velocity of the water to a state. @water@
[water_horizontal]void auvident_over_ground(double x[4], double north_mps, double east_mps);
[water_vertical]void auvident_over_ground(double x[4], double heading, double north_mps,
[water_vertical]                          double east_mps, double down_mps);
#endif
"""
MOTION = """
#include <math.h>

@parameters@

void auvident_derivative(const double x[4], const double inputs[@columns@], double dx[4])
{
@unpack@
    const double f0 = @f0@;
    const double f1 = @f1@;
    const double f2 = @f2@;
@mass@
    const double c0 = m11 * m22 - m12 * m21, c1 = m12 * m20 - m10 * m22;
    const double c2 = m10 * m21 - m11 * m20;
    const double determinant = m00 * c0 + m01 * c1 + m02 * c2;
    dx[0] = (f0 * c0 + f1 * (m02 * m21 - m01 * m22) + f2 * (m01 * m12 - m02 * m11)) / determinant;
    dx[1] = (f0 * c1 + f1 * (m00 * m22 - m02 * m20) + f2 * (m02 * m10 - m00 * m12)) / determinant;
    dx[2] = (f0 * c2 + f1 * (m01 * m20 - m00 * m21) + f2 * (m00 * m11 - m01 * m10)) / determinant;
    dx[3] = x[2];
}

void auvident_step(const double x[4], const double inputs[@columns@], double dt_s, double out[4])
{
    double k1[4], k2[4], k3[4], k4[4], y[4];
    int i;
    auvident_derivative(x, inputs, k1);
    for (i = 0; i < 4; i++) y[i] = x[i] + 0.5 * dt_s * k1[i];
    auvident_derivative(y, inputs, k2);
    for (i = 0; i < 4; i++) y[i] = x[i] + 0.5 * dt_s * k2[i];
    auvident_derivative(y, inputs, k3);
    for (i = 0; i < 4; i++) y[i] = x[i] + dt_s * k3[i];
    auvident_derivative(y, inputs, k4);
    for (i = 0; i < 4; i++)
        out[i] = x[i] + dt_s / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
}
"""
DELAYED = """
static size_t within(double row, size_t rows)
{
    return row < 0.0 ? 0 : row > (double)(rows - 1) ? rows - 1 : (size_t)row;
}

// Mean angle of the fin over step k, in which an order arrives the delay later.
static double delayed(memory *m, const double *orders, size_t rows, size_t k, double dt_s)
{
    const double whole = floor(FIN_DELAY_S / dt_s), share = FIN_DELAY_S / dt_s - whole;
    const size_t first = within((double)k - whole, rows);
    const size_t before = within((double)k - whole - 1.0, rows);
    const double early = share > 0.0 ? share * laid(m, orders[3 * before], share * dt_s) : 0.0;
    return early + (1.0 - share) * laid(m, orders[3 * first], (1.0 - share) * dt_s);
}
"""
SERVO = """
// Mean angle of the fin over a step, from its angle at the start, which becomes that at the end.
static double servo(double *fin, double ordered, double dt_s)
{
[!servo]    (void)dt_s;
[!servo]    *fin = ordered;
[!servo]    return ordered;
[servo]    const double h = dt_s / 5;
[lag]    const double keep = exp(-h / SERVO_LAG_S), trailing = SERVO_LAG_S / h * (1.0 - keep);
[slew]    const double most = SERVO_SLEW_RADPS * h;
[servo]    double by_end = 0.0;
[servo]    int substep;
[servo]    for (substep = 0; substep < 5; substep++) {
[servo]        const double distance = ordered - *fin;
[slew]        const double turning = fabs(distance) / most;
[slew]        const double limited = turning <= 1.0 ? 0.5 * turning : 1.0 - 0.5 / turning;
[lag_alone]        by_end += trailing * distance;
[lag_alone]        *fin += distance * (1.0 - keep);
[slew_alone]        by_end += limited * distance;
[slew_alone]        *fin += fmin(fmax(distance, -most), most);
[both]        by_end += fmax(trailing, limited) * distance;
[both]        *fin += fmin(fmax(distance * (1.0 - keep), -most), most);
[servo]    }
[servo]    return ordered - by_end / 5;
}
"""
PROPELLER = """
// Mean rate of the propeller over a step, from that at the start, which becomes that at the end.
static double propeller(double *rate, double ordered, double dt_s)
{
    const double keep = exp(-dt_s / PROPELLER_LAG_S);
    const double mean = ordered + (*rate - ordered) * (1.0 - keep) * PROPELLER_LAG_S / dt_s;
    *rate = ordered + (*rate - ordered) * keep;
    return mean;
}
"""
FALLEN = """
// Part of a change that has been made; where only an interval is known, it rises along it.
static double fallen(double since_s, double over_s)
{
    since_s += 0.5 * over_s;
    return since_s < 0.0 ? 0.0 : since_s < over_s ? since_s / over_s : 1.0;
}
"""
MEMORY = """
// What servo and propeller remember from one step to the next; zero before the first one.
typedef struct {
    double fin;     // angle of the servo
[backlash]    double taken;   // order behind the play
[motor]    double turning; // rate of the propeller
    int fin_given;  // whether the angle of the servo before the first step is given
    int begun;
} memory;
"""
LAID = """
// Mean angle of the fin while an order stands.
static double laid(memory *m, double order, double lasts_s)
{
[deadband]    order = copysign(fmax(fabs(order) - FIN_DEADBAND_RAD, 0.0), order);
[backlash]    if (m->begun)
[backlash]        order = fmin(fmax(m->taken, order - FIN_BACKLASH_RAD), order + FIN_BACKLASH_RAD);
[backlash]    m->taken = order;
[asymmetry]    order *= order > 0.0 ? 1.0 + FIN_ASYMMETRY : 1.0 - FIN_ASYMMETRY;
    if (!m->fin_given) m->fin = order;
    m->fin_given = 1;
    return servo(&m->fin, order, lasts_s);
}
"""
ACTING = """
// What else the inputs depend on.
typedef struct {
    double time_s; // since the start of the trial
    double speed_mps, roll_rad, pitch_rad, depth_m;
} surroundings;

// Inputs as they act over a step; angle is the mean of the servo, see laid.
static void act(memory *m, double angle, const double row[3], double dt_s, const surroundings *s,
                double acting[@columns@])
{
    double rate = row[2];
[drive]    double thrust;
[race]    double race, flow;
[factor]    double factor = 1.0;
[changed]    const double weight =
[changed]        fallen(s->time_s - WEIGHT_CHANGE_TIME_S, WEIGHT_CHANGE_OVER_S);
    (void)s;
[!motor]    (void)dt_s;
[motor]    if (!m->begun) m->turning = rate;
[motor]    rate = propeller(&m->turning, rate, dt_s);
    m->begun = 1;
[drive]    thrust = T_nn * rate * fabs(rate) + T_nu * fabs(rate) * s->speed_mps;
[sag]    factor -= THRUST_SAG * s->time_s / 1000.0;
[thrust_step]    factor -=
[thrust_step]        THRUST_STEP * fallen(s->time_s - THRUST_STEP_TIME_S, THRUST_STEP_OVER_S);
[drive_factor]    thrust *= factor;
[offset]    angle += FIN_OFFSET_RAD;
[stall]    angle /= sqrt(1.0 + (angle / FIN_STALL_RAD) * (angle / FIN_STALL_RAD));
[race]    race = RACE_M2PS2PN * thrust;
[race]    flow = sqrt(fmax(s->speed_mps * s->speed_mps + race, 0.0)) - fabs(s->speed_mps);
@row@
}
"""
SIMULATE = """
void auvident_simulate(const double x[4], const double *inputs, size_t rows, double dt_s,
                       const auvident_options *options, double *states)
{
    static const auvident_options defaults = {0, 0.0, 0, 0.0, NULL, NULL, NULL, NULL};
    const auvident_options *o = options ? options : &defaults;
    static const memory nothing;
    memory m = nothing;
    size_t i, k;
    m.fin = o->fin;
    m.fin_given = o->fin_given;
    for (i = 0; i < 4 && rows > 0; i++) states[i] = x[i];
    for (k = 0; k + 1 < o->before + rows; k++) {
[!delay]        const double angle = laid(&m, inputs[3 * k], dt_s);
[delay]        const double angle = delayed(&m, inputs, o->before + rows, k, dt_s);
        surroundings s = {0.0, 0.0, 0.0, 0.0, 0.0};
        double acting[@columns@];
        if (k >= o->before) {
            i = k - o->before;
            s.time_s = o->elapsed_s + (double)i * dt_s;
            s.speed_mps = o->speed_mps ? o->speed_mps[i] : x[0];
            s.roll_rad = o->roll_rad ? o->roll_rad[i] : 0.0;
            s.pitch_rad = o->pitch_rad ? o->pitch_rad[i] : 0.0;
            s.depth_m = o->depth_m ? o->depth_m[i] : 0.0;
        }
        act(&m, angle, inputs + 3 * k, dt_s, &s, acting);
        if (k < o->before) continue;
        i = k - o->before;
        auvident_step(states + 4 * i, acting, dt_s, states + 4 * (i + 1));
    }
}
"""
WATER = """
[horizontal]void auvident_over_ground(double x[4], double north_mps, double east_mps)
[vertical]void auvident_over_ground(double x[4], double heading, double north_mps,
[vertical]                          double east_mps, double down_mps)
{
    const double c = cos(x[3]), s = sin(x[3]);
[horizontal]    x[0] += north_mps * c + east_mps * s;
[horizontal]    x[1] += east_mps * c - north_mps * s;
[vertical]    const double ahead = north_mps * cos(heading) + east_mps * sin(heading);
[vertical]    x[0] += ahead * c - down_mps * s;
[vertical]    x[1] += ahead * s + down_mps * c;
}
"""
# feature without which a part is left out, and the part
PARTS = (
    ("", MOTION),
    ("", MEMORY),
    ("", SERVO),
    ("", LAID),
    ("delay", DELAYED),
    ("motor", PROPELLER),
    ("fallen", FALLEN),
    ("", ACTING),
    ("", SIMULATE),
    ("water", WATER),
)


def as_c(model: IdentifiedModel) -> str:
    """The model as one C file, which begins with its header."""
    contents = contents_of(model)
    features = contents.features
    template = assembled(PARTS, features)
    late = {"parameters": "@parameters@", "unpack": "@unpack@"}
    body = filled(template, features, _values(contents) | late)
    numbers = contents.parameters | contents.actuation
    constants = [f"static const double {k} = {v!r};" for k, v in numbers.items() if _in(body, k)]
    states = {name: f"x[{i}]" for i, name in enumerate(contents.states)}
    places = states | {name: f"inputs[{i}]" for i, name in enumerate(contents.acting)}
    motion, _, _ = body.partition("auvident_step")
    unpack = [f"    const double {k} = {v};" for k, v in places.items() if _in(motion, k)]
    last = {"parameters": "\n".join(constants), "unpack": "\n".join(unpack)}
    return header_of(model) + filled(body, (), last)


def header_of(model: IdentifiedModel) -> str:
    """The header of `as_c`."""
    contents = contents_of(model)
    features = contents.features
    if "water" in features:
        features |= {f"water_{model.plane}"}
    return filled(HEADER, features, _values(contents) | {"title": title(model, comment)})


def _in(text: str, name: str) -> bool:
    return re.search(rf"\b{name}\b", text) is not None


def _values(contents: Contents) -> dict[str, str]:
    """What stands at the places of the template."""
    model, structure = contents.model, contents.structure
    forces = [force.replace("abs(", "fabs(") for force in force_expressions(structure)]
    mass = [
        f"    const double m{i}{j} = {element};"
        for i, row in enumerate(mass_expressions(structure))
        for j, element in enumerate(row)
    ]
    row = [f"    acting[{i}] = {_expression(n, i)};" for i, n in enumerate(contents.acting)]
    return {f"f{i}": force for i, force in enumerate(forces)} | {
        "states": ", ".join(contents.states),
        "inputs": ", ".join(contents.inputs),
        "acting": ", ".join(contents.acting),
        "remarks": comment_lines(model, "// ", WIDTH),
        "water": _water(contents),
        "mass": "\n".join(mass),
        "columns": str(len(contents.acting)),
        "row": "\n".join(row),
    }


def _expression(name: str, place: int) -> str:
    """An acting input in the loop over the rows."""
    of_row = ("angle", "row[1]", "rate")
    if place < len(of_row):
        return of_row[place]
    return EXPRESSIONS.get(name, f"s->{name}")


def _water(contents: Contents) -> str:
    """The water as identified, in words."""
    texts = {k: ", ".join(map(repr, v)) for k, v in contents.water.items()}
    told = f"As identified: {texts.get('WATER', '')}"
    if "DRIFT" not in texts:
        return f"{told}."
    return (
        f"{told},\n// changing by {texts['DRIFT']} per s (north and east before\n"
        "// the middle of the trial, then north and east after it)."
    )
