/* An engine by another hand: a damped spring that is pushed after each spark. Millimetres. */
#include <math.h>
#include <string.h>

#include "engine.h"

#define R(name) (e->reals[name])

static const double MASS = 7.0, SPRING = 26.5e3, PUSH_N_KG = 5.0e8, TICK = 1.0e-6;

void engine_defaults(Engine *e) {
    static const double reals[N_REALS] = REAL_STARTS;
    memset(e, 0, sizeof *e);
    memcpy(e->reals, reals, sizeof reals);
}

void engine_begin(Engine *e, double t) {
    State *s = &e->state;
    memset(s, 0, sizeof *s);
    s->t = t;
    R(PISTON_POSITION) = R(PISTON_SPEED) = 0.0;
}

static void turn(Engine *e, double v) {
    State *s = &e->state;
    double fuel = R(v < 0.0 ? FUEL_A : FUEL_B), spark = R(v < 0.0 ? SPARK_A : SPARK_B);
    s->energy = spark >= 0.0 ? fuel * PUSH_N_KG * (v < 0.0 ? 1.0 : -1.0) : 0.0;
}

int engine_step(Engine *e, double t, double h) {
    State *s = &e->state;
    int steps = (int)round(h / TICK);
    (void)t;
    for (int n = 0; n < steps; n++) {
        double old = s->v;
        double force = R(MOTOR_FORCE) + s->energy - SPRING * s->x - R(BRAKE) * s->v;
        s->v += TICK * force / MASS;
        s->x += TICK * s->v;
        if (old * s->v < 0.0) {
            turn(e, old);
        }
    }
    R(PISTON_POSITION) = 1.0e3 * s->x;
    R(PISTON_SPEED) = 1.0e3 * s->v;
    return 0;
}
