/* A detailed engine around the compiled step of plant/engines/detailed/solver.py.

   What plant/engines/detailed/model.py does with machine, sparks and dead centres. The step itself
   comes as an object file, made by the same compiler from the same source as the plant's own. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define ENGINE_ARRAYS
#include "engine.h"

#define P(name) (e->reals[name])
#define CYLINDER(side) (AT_CYL + (side) * AT_CYL_STRIDE)

enum { RECORDS = 8, TELL_POWER = -1 };
static const double SECOND_NS = 1.0e9;

int64_t fpeg_advance(const double *p, double *d, double *y, const double *programme, intptr_t rows,
                     intptr_t columns, double *work, double *record, intptr_t records,
                     double t_end, int64_t stop);

/* --- what the compiled step refers to where it would raise an exception; it raises none ------ */

#define NEVER_CALLED(name) void name(void) { abort(); }
NEVER_CALLED(NRT_Free)
NEVER_CALLED(NRT_MemInfo_call_dtor)
NEVER_CALLED(PyBytes_FromStringAndSize)
NEVER_CALLED(PyErr_Clear)
NEVER_CALLED(PyErr_SetNone)
NEVER_CALLED(PyErr_SetString)
NEVER_CALLED(PyErr_WriteUnraisable)
NEVER_CALLED(PyUnicode_FromString)
NEVER_CALLED(Py_DecRef)
NEVER_CALLED(numba_do_raise)
NEVER_CALLED(numba_gil_ensure)
NEVER_CALLED(numba_gil_release)
NEVER_CALLED(numba_runtime_build_excinfo_struct)
NEVER_CALLED(numba_unpickle)
void *PyExc_RuntimeError, *PyExc_StopIteration, *PyExc_SystemError;

/* --- the engine ------------------------------------------------------------------------------ */

static double pressure(const State *s, int side) {
    const double *c = CONSTANTS + AT_CYL_P + side * AT_CYL_P_STRIDE;
    double volume = c[AT_AREA] * (c[AT_LENGTH] + c[AT_SIGN] * s->y[AT_X]);
    return (CONSTANTS[AT_GAMMA] - 1.0) * s->y[AT_U + AT_GAS_STRIDE * side] / volume;
}

/* Asked to stop at TELL_POWER, the step moves nothing and puts the power into the record. */
static double electric_power(State *s) {
    double work[WORK] = {0}, record[N_RECORD] = {0};
    fpeg_advance(CONSTANTS, s->d, s->y, PROGRAMME, PROGRAMME_ROWS, PROGRAMME_COLUMNS, work, record,
                 1, 0.0, TELL_POWER);
    return record[0];
}

static void tell(Engine *e) {
    State *s = &e->state;
    P(X_M) = s->y[AT_X];
    P(V_M_S) = s->y[AT_V];
    P(P_LEFT_PA) = pressure(s, 0);
    P(P_RIGHT_PA) = pressure(s, 1);
    P(ELECTRIC_POWER_W) = electric_power(s);
}

/* A drive with a programme of its own keeps it; the load scales what it generates. */
static void obey(Engine *e) {
    double *d = e->state.d;
    double load = P(LOAD_COEFFICIENT_N_S_M);
    if (!PROGRAMMED_DRIVE) {
        d[AT_LOAD] = load;
        d[AT_FORCE] = P(MACHINE_FORCE_N);
    } else if (load > 0.0) {
        d[AT_LOAD_SCALE] = load / NOMINAL_LOAD;
    } else {
        d[AT_LOAD] = 0.0;
        d[AT_FORCE] = P(MACHINE_FORCE_N);
    }
}

/* Light the charge of a side, if it can burn. */
static void light(Engine *e, int side, double t) {
    State *s = &e->state;
    double fuel = P(side ? FUEL_RIGHT_KG : FUEL_LEFT_KG);
    int approaches = (s->d[AT_DIRECTION] > 0.0) == (side == 1);
    if (fuel <= 0.0 || !approaches || pressure(s, side) < LEAST_PRESSURE) {
        return;
    }
    s->d[CYLINDER(side) + AT_SPARK_T] = t;
    s->d[CYLINDER(side) + AT_Q_IN] = fuel * HEATING_VALUE;
    s->lit = fuel;
}

static void pass_dead_centre(Engine *e) {
    State *s = &e->state;
    e->ints[DEAD_CENTRES] += 1;
    e->ints[CONTACTS] = (int)s->d[AT_CONTACTS];
    P(DC_T_S) = s->origin + s->d[AT_DC_T];
    P(DC_X_M) = s->d[AT_DC_X];
    P(FUEL_BURNT_KG) = s->lit;
    s->lit = 0.0;
}

static int move(Engine *e, double until) {
    State *s = &e->state;
    double work[WORK] = {0}, record[RECORDS * N_RECORD] = {0};
    for (;;) {
        int64_t what = fpeg_advance(CONSTANTS, s->d, s->y, PROGRAMME, PROGRAMME_ROWS,
                                    PROGRAMME_COLUMNS, work, record, RECORDS, until, 1);
        if (what == AT_FAILED) {
            return 1;
        }
        if (what == AT_TIME_UP) {
            return 0;
        }
        pass_dead_centre(e);
    }
}

/* Instants lie on whole nanoseconds, so that a step ends where the next one begins. */
static double whole_ns(double t) { return round(t * SECOND_NS) / SECOND_NS; }

void engine_defaults(Engine *e) {
    static const double reals[N_REALS] = REAL_STARTS;
    memset(e, 0, sizeof *e);
    memcpy(e->reals, reals, sizeof reals);
}

/* At rest, or in settled running at the left dead centre with `start_fuel_kg` alight. */
void engine_begin(Engine *e, double t) {
    State *s = &e->state;
    int settled = P(START_FUEL_KG) > 0.0;
    memset(s, 0, sizeof *s);
    memset(e->ints, 0, sizeof e->ints);
    s->t = s->origin = t;
    memcpy(s->y, settled ? SETTLED_Y : REST_Y, sizeof s->y);
    memcpy(s->d, settled ? SETTLED_D : REST_D, sizeof s->d);
    s->last_spark[0] = s->last_spark[1] = -1.0;
    P(DC_T_S) = t;
    P(DC_X_M) = P(FUEL_BURNT_KG) = 0.0;
    if (settled) {
        s->d[CYLINDER(0) + AT_Q_IN] = P(START_FUEL_KG) * HEATING_VALUE;
        e->ints[DEAD_CENTRES] = 1;
        P(DC_X_M) = s->y[AT_X];
        P(FUEL_BURNT_KG) = P(START_FUEL_KG);
    }
    obey(e);
    tell(e);
}

int engine_step(Engine *e, double t, double h) {
    State *s = &e->state;
    double from = whole_ns(t - s->origin), end = whole_ns(t + h - s->origin);
    obey(e);
    for (;;) {
        double until = end, spark[2];
        int side;
        spark[0] = P(SPARK_LEFT_S) - s->origin;
        spark[1] = P(SPARK_RIGHT_S) - s->origin;
        for (side = 0; side < 2; side++) {
            if (spark[side] >= from && spark[side] > s->last_spark[side] && spark[side] < until) {
                until = spark[side];
            }
        }
        if (move(e, until)) {
            return 1;
        }
        for (side = 0; side < 2; side++) {
            if (spark[side] >= from && spark[side] > s->last_spark[side] && spark[side] <= until) {
                s->last_spark[side] = spark[side];
                light(e, side, spark[side]);
            }
        }
        if (until >= end) {
            break;
        }
    }
    s->t = t + h;
    tell(e);
    return 0;
}
