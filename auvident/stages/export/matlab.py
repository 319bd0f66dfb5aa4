"""The model as a MATLAB (or Octave) function file."""

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

WIDTH = 96
HEAD = """function out = auvident_model(x, inputs, dt_s, options)
% @title@
% Units SI, angles in radians. A positive rudder has its trailing edge to port (the bow turns to
% port), a positive elevator its trailing edge down; the propeller rate is in rev/s.
% x = [@states@].
%
% dx = auvident_model(x, inputs)
%   Time derivative, a column. inputs as they act: [@acting@].
%   Example: [t, x] = ode45(@(t, x) auvident_model(x, @example@), [0 60], [1.4 0 0 0]);
% states = auvident_model(x, inputs, dt_s)
% states = auvident_model(x, inputs, dt_s, options)
%   States at the start of every step, one a row, as "auvident simulate" predicts them.
%   inputs: one row [@inputs@] a step, as ordered.
%   options.fin: angle of the servo at the start of the first row; by default what that row orders.
%   options.before: rows of inputs before the start, which servo, delay and play remember;
%   "auvident simulate" takes those of 20 s, and before them, for a play, the angles at which the
%   fin was turned back. options.fin is then the angle before them.
[timed]%   options.elapsed_s: time of the first row since the start of the trial; by default 0.
[drive]%   options.speed_mps: surge velocity as logged, one a row, for the thrust that meets the
[drive]%   fin; by default that of the start, as "auvident simulate" has it where none was logged.
[roll_rad]%   options.roll_rad: roll as logged, one a row; by default zero.
[pitch_rad]%   options.pitch_rad: pitch as logged, one a row; by default zero.
[depth_m]%   options.depth_m: depth as logged, one a row; by default zero.
[water]%   options.water_mps: velocity of the water, [@directions@] for all steps or one row each;
[water]%   states are then over ground. @water@
[heading]%   options.heading: heading for that, one a row; by default zero.
%
@remarks@
if nargin < 3
    out = derivative(x(:), inputs);
    return
end
if nargin < 4
    options = struct();
end
acting = acting_inputs(x, inputs, dt_s, options);
out = zeros(size(inputs, 1), 4);
out(1, :) = x(:).';
for k = 1:size(inputs, 1) - 1
    out(k + 1, :) = step(out(k, :).', acting(k, :), dt_s).';
end
[water]out = over_ground(out, options);
end

function dx = derivative(x, inputs)
@parameters@
@unpack@
force = [@forces@];
mass_matrix = [@mass@];
dx = [mass_matrix \\ force; @rate@];
end

function x = step(x, inputs, dt_s)
% classical Runge-Kutta method with constant inputs
k1 = derivative(x, inputs);
k2 = derivative(x + 0.5*dt_s*k1, inputs);
k3 = derivative(x + 0.5*dt_s*k2, inputs);
k4 = derivative(x + dt_s*k3, inputs);
x = x + dt_s/6.0*(k1 + 2.0*k2 + 2.0*k3 + k4);
end

function value = given(options, name, default)
value = default;
if isfield(options, name)
    value = options.(name);
end
end
"""
DELAYED = """
function [told, lasts_s] = delayed(orders, k, dt_s)
% orders of the fin that arrive in step k, the delay later, and how long each one stands
FIN_DELAY_S = @FIN_DELAY_S@;
whole = floor(FIN_DELAY_S / dt_s);
share = FIN_DELAY_S / dt_s - whole;
last = size(orders, 1);
first = min(max(k - whole, 1), last);
before = min(max(k - whole - 1, 1), last);
told = [orders(before, 1), orders(first, 1)];
lasts_s = [share, 1.0 - share]*dt_s;
if share <= 0.0
    told = told(2);
    lasts_s = lasts_s(2);
end
end
"""
SERVO = """
function [angle, fin] = servo(fin, ordered, dt_s)
% mean angle of the fin over a step, from its angle at the start, and its angle at the end
[!servo]angle = ordered;
[!servo]fin = ordered;
[servo]h = dt_s / 5;
[servo]short = 0.0;
[lag]SERVO_LAG_S = @SERVO_LAG_S@;
[lag]keep = exp(-h / SERVO_LAG_S);
[lag]trailing = SERVO_LAG_S / h*(1.0 - keep);
[slew]SERVO_SLEW_RADPS = @SERVO_SLEW_RADPS@;
[slew]most = SERVO_SLEW_RADPS*h;
[servo]for substep = 1:5
[servo]    distance = ordered - fin;
[slew]    turning = abs(distance) / most;
[slew]    limited = 0.5*turning;
[slew]    if turning > 1.0
[slew]        limited = 1.0 - 0.5 / turning;
[slew]    end
[lag_alone]    short = short + trailing*distance;
[lag_alone]    fin = fin + distance*(1.0 - keep);
[slew_alone]    short = short + limited*distance;
[slew_alone]    fin = fin + min(max(distance, -most), most);
[both]    short = short + max(trailing, limited)*distance;
[both]    fin = fin + min(max(distance*(1.0 - keep), -most), most);
[servo]end
[servo]angle = ordered - short / 5;
end
"""
PROPELLER = """
function [mean_rate, rate] = propeller(rate, ordered, dt_s)
% mean rate of the propeller over a step, from its rate at the start, and that at the end
PROPELLER_LAG_S = @PROPELLER_LAG_S@;
keep = exp(-dt_s / PROPELLER_LAG_S);
mean_rate = ordered + (rate - ordered)*(1.0 - keep)*PROPELLER_LAG_S / dt_s;
rate = ordered + (rate - ordered)*keep;
end
"""
FALLEN = """
function part = fallen(since_s, over_s)
% part of a change that has been made; where only an interval is known, it rises along it
since_s = since_s + 0.5*over_s;
part = 1.0;
if since_s < 0.0
    part = 0.0;
elseif since_s < over_s
    part = since_s / over_s;
end
end
"""
ACTUATORS = """
function [angle, fin, taken] = laid(fin, taken, order, lasts_s)
% mean angle of the fin while an order stands; then its angle and the order behind the play
[deadband]FIN_DEADBAND_RAD = @FIN_DEADBAND_RAD@;
[backlash]FIN_BACKLASH_RAD = @FIN_BACKLASH_RAD@;
[asymmetry]FIN_ASYMMETRY = @FIN_ASYMMETRY@;
[deadband]order = (1 - 2*(order < 0))*max(abs(order) - FIN_DEADBAND_RAD, 0.0);
[backlash]if ~isempty(taken)
[backlash]    order = min(max(taken, order - FIN_BACKLASH_RAD), order + FIN_BACKLASH_RAD);
[backlash]end
taken = order;
[asymmetry]if order > 0.0
[asymmetry]    order = order*(1.0 + FIN_ASYMMETRY);
[asymmetry]else
[asymmetry]    order = order*(1.0 - FIN_ASYMMETRY);
[asymmetry]end
if isempty(fin)
    fin = order;
end
[angle, fin] = servo(fin, order, lasts_s);
end

function moved = actuators(orders, dt_s, fin)
% mean angle of the fin and mean rate of the propeller over every step of the orders
moved = zeros(size(orders, 1), 2);
taken = [];
[motor]rate = orders(1, 3);
for k = 1:size(orders, 1)
[!delay]    [moved(k, 1), fin, taken] = laid(fin, taken, orders(k, 1), dt_s);
[delay]    [told, lasts_s] = delayed(orders, k, dt_s);
[delay]    play = taken;
[delay]    for part = 1:numel(told)
[delay]        [mean_angle, fin, taken] = laid(fin, play, told(part), lasts_s(part));
[delay]        moved(k, 1) = moved(k, 1) + lasts_s(part) / dt_s*mean_angle;
[delay]        if k > 1
[delay]            play = taken;
[delay]        end
[delay]    end
[!motor]    moved(k, 2) = orders(k, 3);
[motor]    [moved(k, 2), rate] = propeller(rate, orders(k, 3), dt_s);
end
end
"""
ACTING = """
function acting = acting_inputs(x, inputs, dt_s, options)
% inputs as they act over every step, one row each
[drive]T_nn = @T_nn@;
[drive]T_nu = @T_nu@;
[sag]THRUST_SAG = @THRUST_SAG@;
[thrust_step]THRUST_STEP = @THRUST_STEP@;
[thrust_step]THRUST_STEP_TIME_S = @THRUST_STEP_TIME_S@;
[thrust_step]THRUST_STEP_OVER_S = @THRUST_STEP_OVER_S@;
[offset]FIN_OFFSET_RAD = @FIN_OFFSET_RAD@;
[stall]FIN_STALL_RAD = @FIN_STALL_RAD@;
[race]RACE_M2PS2PN = @RACE_M2PS2PN@;
[race]FIN_STATION_M = @FIN_STATION_M@;
[changed]WEIGHT_CHANGE_TIME_S = @WEIGHT_CHANGE_TIME_S@;
[changed]WEIGHT_CHANGE_OVER_S = @WEIGHT_CHANGE_OVER_S@;
size_ = size(inputs, 1);
before = given(options, 'before', zeros(0, 3));
moved = actuators([before; inputs(:, 1:3)], dt_s, given(options, 'fin', []));
moved = moved(size(before, 1) + 1:end, :);
[timed]elapsed_s = given(options, 'elapsed_s', 0.0);
[drive]speed_mps = given(options, 'speed_mps', repmat(x(1), size_, 1));
[roll_rad]roll_rad = given(options, 'roll_rad', zeros(size_, 1));
[pitch_rad]pitch_rad = given(options, 'pitch_rad', zeros(size_, 1));
[depth_m]depth_m = given(options, 'depth_m', zeros(size_, 1));
acting = zeros(size_, @columns@);
for k = 1:size_
    angle = moved(k, 1);
    rate = moved(k, 2);
[timed]    time_s = elapsed_s + (k - 1)*dt_s;
[factor]    factor = 1.0;
[sag]    factor = factor - THRUST_SAG*time_s / 1000.0;
[thrust_step]    since_s = time_s - THRUST_STEP_TIME_S;
[thrust_step]    factor = factor - THRUST_STEP*fallen(since_s, THRUST_STEP_OVER_S);
[drive]    thrust = T_nn*rate*abs(rate) + T_nu*abs(rate)*speed_mps(k);
[drive_factor]    thrust = thrust*factor;
[offset]    angle = angle + FIN_OFFSET_RAD;
[stall]    angle = angle / sqrt(1.0 + (angle / FIN_STALL_RAD)^2);
[race]    race = RACE_M2PS2PN*thrust;
[race]    flow = sqrt(max(speed_mps(k)^2 + race, 0.0)) - abs(speed_mps(k));
[changed]    weight = fallen(time_s - WEIGHT_CHANGE_TIME_S, WEIGHT_CHANGE_OVER_S);
    acting(k, :) = [@row@];
end
end
"""
WATER = """
function states = over_ground(states, options)
% the states with the velocity of the water added, where it is given
water = given(options, 'water_mps', zeros(1, @directions_count@));
for k = 1:size(states, 1)
    here = water(min(k, size(water, 1)), :);
[horizontal]    c = cos(states(k, 4));
[horizontal]    s = sin(states(k, 4));
[horizontal]    states(k, 1) = states(k, 1) + here(1)*c + here(2)*s;
[horizontal]    states(k, 2) = states(k, 2) + here(2)*c - here(1)*s;
[vertical]    heading = given(options, 'heading', 0.0);
[vertical]    heading = heading(min(k, numel(heading)));
[vertical]    ahead = here(1)*cos(heading) + here(2)*sin(heading);
[vertical]    c = cos(states(k, 4));
[vertical]    s = sin(states(k, 4));
[vertical]    states(k, 1) = states(k, 1) + ahead*c - here(3)*s;
[vertical]    states(k, 2) = states(k, 2) + ahead*s + here(3)*c;
end
end
"""
# feature without which a part is left out, and the part
PARTS = (
    ("", HEAD),
    ("delay", DELAYED),
    ("", SERVO),
    ("motor", PROPELLER),
    ("fallen", FALLEN),
    ("", ACTUATORS),
    ("", ACTING),
    ("water", WATER),
)
USUAL = {"rate_rps": "14", "thrust_factor": "1"}  # of an example; the others are zero


def as_matlab(model: IdentifiedModel) -> str:
    """The model as a MATLAB function file, ``auvident_model.m``; it runs in Octave as well."""
    contents = contents_of(model)
    features = contents.features | set(contents.logged)
    features |= {"heading"} if {"water", "vertical"} <= features else set()
    template = assembled(PARTS, features)
    return filled(template, features, _values(contents))


def _values(contents: Contents) -> dict[str, str]:
    """What stands at the places of the template."""
    model, structure = contents.model, contents.structure
    numbers = contents.parameters | contents.actuation
    unpack = [f"{name} = x({i});" for i, name in enumerate(contents.states, start=1)]
    unpack += [f"{name} = inputs({i});" for i, name in enumerate(contents.acting, start=1)]
    example = [USUAL.get(name, "0") for name in contents.acting]
    example[0] = "0.1"
    directions = ("north", "east", "down")[: 2 if model.plane == "horizontal" else 3]
    return {name: repr(value) for name, value in numbers.items()} | {
        "title": title(model, comment),
        "states": " ".join(contents.states),
        "inputs": " ".join(contents.inputs),
        "acting": " ".join(contents.acting),
        "example": f"[{' '.join(example)}]",
        "remarks": comment_lines(model, "% ", WIDTH),
        "water": _water(contents),
        "directions": " ".join(directions),
        "directions_count": str(len(directions)),
        "parameters": "\n".join(f"{k} = {v!r};" for k, v in contents.parameters.items()),
        "unpack": "\n".join(unpack),
        "forces": "; ...\n    ".join(force_expressions(structure)),
        "mass": "; ...\n    ".join(", ".join(row) for row in mass_expressions(structure)),
        "rate": contents.states[2],
        "columns": str(len(contents.acting)),
        "row": ", ".join(_expression(name, contents) for name in contents.acting),
    }


def _expression(name: str, contents: Contents) -> str:
    """An acting input in the loop over the rows."""
    own, other, rate = contents.inputs
    at_work = {own: "angle", other: "inputs(k, 2)", rate: "rate"} | EXPRESSIONS
    return at_work.get(name, f"{name}(k)")


def _water(contents: Contents) -> str:
    """The water as identified, in words."""
    texts = {k: f"[{' '.join(map(repr, v))}]" for k, v in contents.water.items()}
    told = f"WATER as identified: {texts.get('WATER', '')}"
    if "DRIFT" not in texts:
        return f"{told}."
    return (
        f"{told},\n%   changing by {texts['DRIFT']} per s\n"
        "%   (north and east before the middle of the trial, then north and east after it)."
    )
