"""Template of the functions of FMI 2.0 around the functions of a model in C."""

TYPES = """
// ---- FMI 2.0 for co-simulation around the functions above (https://fmi-standard.org) ----
#include <stdlib.h>
#include <string.h>

#if defined _WIN32
#define FMI2_EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define FMI2_EXPORT __attribute__((visibility("default")))
#else
#define FMI2_EXPORT
#endif

typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean;
typedef char fmi2Char, fmi2Byte;
typedef const fmi2Char *fmi2String;
typedef enum {
    fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending
} fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum {
    fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated
} fmi2StatusKind;
typedef struct {
    void (*logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

#define GUID "@guid@"
#define LONGEST_STEP_S @step@

enum {
@numbers@
};
enum {
@flags@
};
"""
STATE = """
[delay]#define ORDERS 4096 // that the delay remembers

typedef struct {
    double number[NUMBERS];
    int flag[FLAGS];
    double x[4], place[2], start_s;
    memory servo;
[delay]    double order[ORDERS], span[ORDERS];
[delay]    size_t orders;
    int begun;
    const fmi2CallbackFunctions *callbacks;
    fmi2ComponentEnvironment environment;
} fmu;

static const int STATES[4] = {@states@};
static const int SHOWN_STATES[4] = {@outputs@};
static const int PLACES[2] = {@places@};
static const int SHOWN_PLACES[2] = {@shown@};

static void show(fmu *f)
{
    int i;
    for (i = 0; i < 4; i++) f->number[SHOWN_STATES[i]] = f->x[i];
    for (i = 0; i < 2; i++) f->number[SHOWN_PLACES[i]] = f->place[i];
}

// The state at the start, as the parameters have it.
static void begin(fmu *f)
{
    static const memory nothing;
    int i;
    for (i = 0; i < 4; i++) f->x[i] = f->number[STATES[i]];
    for (i = 0; i < 2; i++) f->place[i] = f->number[PLACES[i]];
    f->servo = nothing;
    f->servo.fin = f->number[INITIAL_FIN_RAD];
    f->servo.fin_given = f->flag[FIN_GIVEN];
[delay]    f->orders = 0;
    show(f);
}

// Velocity over ground of the two coordinates of the place.
static void velocity(const fmu *f, double out[2])
{
    const double u = f->x[0], a = f->x[1], c = cos(f->x[3]), s = sin(f->x[3]);
[horizontal]    out[0] = u * c - a * s + f->number[WATER_NORTH_MPS];
[horizontal]    out[1] = u * s + a * c + f->number[WATER_EAST_MPS];
[vertical]    const double course = f->number[COURSE_RAD];
[vertical]    out[0] = u * c + a * s + f->number[WATER_NORTH_MPS] * cos(course) +
[vertical]             f->number[WATER_EAST_MPS] * sin(course);
[vertical]    out[1] = a * c - u * s + f->number[WATER_DOWN_MPS];
}
"""
DELAY = """
// Mean angle of the fin over a step that begins now, in which orders arrive the delay later.
static double arriving(fmu *f, double order, double dt_s)
{
    double wait = fmax(FIN_DELAY_S, 0.0), left = dt_s, angle = 0.0, oldest = order;
    double told[ORDERS + 1], lasts[ORDERS + 1];
    size_t parts = 0;
    const size_t at = f->orders++ % ORDERS, kept = f->orders < ORDERS ? f->orders : ORDERS;
    size_t k;
    f->order[at] = order;
    f->span[at] = dt_s;
    for (k = 0; k < kept && left > 0.0; k++) {
        const size_t i = (f->orders - 1 - k) % ORDERS;
        double part;
        oldest = f->order[i];
        if (wait >= f->span[i]) {
            wait -= f->span[i];
            continue;
        }
        part = fmin(f->span[i] - wait, left);
        told[parts] = oldest;
        lasts[parts++] = part;
        left -= part;
        wait = 0.0;
    }
    if (left > 0.0) {
        told[parts] = oldest;
        lasts[parts++] = left;
    }
    while (parts-- > 0)
        angle += lasts[parts] / dt_s * laid(&f->servo, told[parts], lasts[parts]);
    return angle;
}
"""
STEP = """
// One step of the integration with inputs that are held.
static void advance(fmu *f, double time_s, double dt_s)
{
    const double row[3] = {@inputs@};
    surroundings s = {0.0, 0.0, 0.0, 0.0, 0.0};
    double acting[@columns@], before[2], after[2], next[4];
    int i;
    s.time_s = time_s;
    s.speed_mps = f->x[0];
[vertical]    s.depth_m = f->place[1];
[roll_rad]    s.roll_rad = f->number[ROLL_RAD];
[pitch_rad]    s.pitch_rad = f->number[PITCH_RAD];
[speed_mps]    if (f->flag[LOG_GIVEN]) s.speed_mps = f->number[LOG_SPEED_MPS];
[depth_m]    if (f->flag[LOG_GIVEN]) s.depth_m = f->number[LOG_DEPTH_M];
[!delay]    act(&f->servo, laid(&f->servo, row[0], dt_s), row, dt_s, &s, acting);
[delay]    act(&f->servo, arriving(f, row[0], dt_s), row, dt_s, &s, acting);
    velocity(f, before);
    auvident_step(f->x, acting, dt_s, next);
    for (i = 0; i < 4; i++) f->x[i] = next[i];
    velocity(f, after);
    for (i = 0; i < 2; i++) f->place[i] += 0.5 * dt_s * (before[i] + after[i]);
}

static fmi2Status refuse(const fmu *f, const char *text)
{
    if (f->callbacks && f->callbacks->logger)
        f->callbacks->logger(f->environment, "auvident", fmi2Error, "logStatusError", "%s", text);
    return fmi2Error;
}
"""
FUNCTIONS = """
FMI2_EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI2_EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

FMI2_EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n,
                                           const fmi2String names[])
{
    (void)c; (void)on; (void)n; (void)names;
    return fmi2OK;
}

FMI2_EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid,
                                          fmi2String resources,
                                          const fmi2CallbackFunctions *callbacks,
                                          fmi2Boolean visible, fmi2Boolean logging)
{
    fmu *f;
    (void)name; (void)resources; (void)visible; (void)logging;
    if (type != fmi2CoSimulation || guid == NULL || strcmp(guid, GUID) != 0) return NULL;
    f = calloc(1, sizeof(fmu));
    if (f == NULL) return NULL;
    f->callbacks = callbacks;
    f->environment = callbacks ? callbacks->componentEnvironment : NULL;
    begin(f);
    return f;
}

FMI2_EXPORT void fmi2FreeInstance(fmi2Component c) { free(c); }

FMI2_EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean bounded, fmi2Real tolerance,
                                           fmi2Real start, fmi2Boolean ends, fmi2Real stop)
{
    (void)bounded; (void)tolerance; (void)ends; (void)stop;
    ((fmu *)c)->start_s = start;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    begin(c);
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    begin(c);
    ((fmu *)c)->begun = 1;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2Terminate(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2Reset(fmi2Component c)
{
    fmu *f = c;
    memset(f->number, 0, sizeof f->number);
    memset(f->flag, 0, sizeof f->flag);
    f->begun = 0;
    f->start_s = 0.0;
    begin(f);
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                   fmi2Real value[])
{
    const fmu *f = c;
    size_t i;
    for (i = 0; i < n; i++) {
        if (vr[i] >= NUMBERS) return refuse(f, "no such real variable");
        value[i] = f->number[vr[i]];
    }
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                   const fmi2Real value[])
{
    fmu *f = c;
    size_t i;
    for (i = 0; i < n; i++) {
        if (vr[i] >= NUMBERS) return refuse(f, "no such real variable");
        f->number[vr[i]] = value[i];
    }
    if (!f->begun) begin(f);
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                      fmi2Boolean value[])
{
    const fmu *f = c;
    size_t i;
    for (i = 0; i < n; i++) {
        if (vr[i] >= FLAGS) return refuse(f, "no such boolean variable");
        value[i] = f->flag[vr[i]];
    }
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                      const fmi2Boolean value[])
{
    fmu *f = c;
    size_t i;
    for (i = 0; i < n; i++) {
        if (vr[i] >= FLAGS) return refuse(f, "no such boolean variable");
        f->flag[vr[i]] = value[i] != 0;
    }
    if (!f->begun) begin(f);
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real now, fmi2Real size, fmi2Boolean fixed)
{
    fmu *f = c;
    const double parts = fmax(ceil(size / LONGEST_STEP_S - 1e-6), 1.0);
    double time_s = now - f->start_s;
    size_t k;
    int i;
    (void)fixed;
[timed]    time_s += f->number[ELAPSED_S];
    if (!(size > 0.0) || !(parts < 1e9)) return refuse(f, "the step is not above zero");
    for (k = 0; k < (size_t)parts; k++)
        advance(f, time_s + (double)k * size / parts, size / parts);
    show(f);
    for (i = 0; i < 4; i++)
        if (!(fabs(f->x[i]) < 1e6))
            return refuse(f, "the simulation diverges: the inputs lie outside the range that the "
                             "model was identified from");
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    if (*state == NULL) *state = malloc(sizeof(fmu));
    if (*state == NULL) return refuse(c, "there is no memory");
    memcpy(*state, c, sizeof(fmu));
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    memcpy(c, state, sizeof(fmu));
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}
"""
ABSENT = """
// What the capabilities of the description leave out.
#define NO_VALUES(NAME, TYPE) \\
    FMI2_EXPORT fmi2Status NAME(fmi2Component c, const fmi2ValueReference vr[], size_t n, \\
                                TYPE value[]) \\
    { \\
        (void)vr; (void)value; \\
        return n ? refuse(c, #NAME ": there is no such variable") : fmi2OK; \\
    }
NO_VALUES(fmi2GetInteger, fmi2Integer)
NO_VALUES(fmi2SetInteger, const fmi2Integer)
NO_VALUES(fmi2GetString, fmi2String)
NO_VALUES(fmi2SetString, const fmi2String)

#define NO_STATUS(NAME, TYPE) \\
    FMI2_EXPORT fmi2Status NAME(fmi2Component c, const fmi2StatusKind kind, TYPE *value) \\
    { \\
        (void)c; (void)kind; (void)value; \\
        return fmi2Discard; \\
    }
NO_STATUS(fmi2GetStatus, fmi2Status)
NO_STATUS(fmi2GetRealStatus, fmi2Real)
NO_STATUS(fmi2GetIntegerStatus, fmi2Integer)
NO_STATUS(fmi2GetBooleanStatus, fmi2Boolean)
NO_STATUS(fmi2GetStringStatus, fmi2String)

FMI2_EXPORT fmi2Status fmi2CancelStep(fmi2Component c)
{
    return refuse(c, "no step is under way");
}

FMI2_EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[],
                                                   size_t n, const fmi2Integer order[],
                                                   const fmi2Real value[])
{
    (void)vr; (void)n; (void)order; (void)value;
    return refuse(c, "inputs are held");
}

FMI2_EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[],
                                                    size_t n, const fmi2Integer order[],
                                                    fmi2Real value[])
{
    (void)vr; (void)n; (void)order; (void)value;
    return refuse(c, "outputs have no derivatives");
}

FMI2_EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c,
                                                    const fmi2ValueReference unknown[], size_t n,
                                                    const fmi2ValueReference known[], size_t m,
                                                    const fmi2Real along[], fmi2Real value[])
{
    (void)unknown; (void)n; (void)known; (void)m; (void)along; (void)value;
    return refuse(c, "there are no derivatives");
}

FMI2_EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)state; (void)size;
    return refuse(c, "states are not serialized");
}

FMI2_EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte to[],
                                             size_t size)
{
    (void)state; (void)to; (void)size;
    return refuse(c, "states are not serialized");
}

FMI2_EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte from[], size_t size,
                                               fmi2FMUstate *state)
{
    (void)from; (void)size; (void)state;
    return refuse(c, "states are not serialized");
}
"""
PARTS = (
    ("", TYPES),
    ("", STATE),
    ("delay", DELAY),
    ("", STEP),
    ("", FUNCTIONS),
    ("", ABSENT),
)
