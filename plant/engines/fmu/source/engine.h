/* One engine as it moves through a communication step: the equations of docs/model.md. */
#ifndef ENGINE_H
#define ENGINE_H

#include "variables.h"

#ifdef DETAILED
#include "arrays.h"

/* The arrays of plant/engines/detailed/layout.py; times in them count from `origin`. */
typedef struct {
    double t, origin, lit;
    double last_spark[2];
    double y[N_Y], d[N_D];
} State;
#else
/* A path from one event to the next: an exact solution, or the coefficients of the gas force. */
typedef struct {
    double start, decay, omega_d, y, y_sine, w, w_sine, centre, omega, g, h, omega_sq;
    double left, right, exponent, damping, push;
    int regime;
} Path;

typedef struct {
    double t, x, v, tau, energy, force, load;
    Path path;
    int moving, direction, latched;
} State;

#endif

/* Everything about an instance that a copy of it must hold; no pointers. */
typedef struct {
    double reals[N_REALS];
    int ints[N_INTS];
    State state;
} Engine;

void engine_defaults(Engine *e);
void engine_begin(Engine *e, double t);
/* Returns 0, or 1 when the motion cannot be followed. */
int engine_step(Engine *e, double t, double h);

#endif
