/* The step of plant/engines/fast in C, operation for operation, so that both give the same numbers.

   linear.py: evaluate, segment; nonlinear.py: rk4; model.py: end_stroke, engine_step. Every number
   that both need comes from there, in constants.h. */
#include <math.h>
#include <string.h>

#include "constants.h"
#include "engine.h"

#define P(name) (e->reals[name])

static const double PI = 3.141592653589793;

/* --- what a charge does ------------------------------------------------------------------- */

static double rest_stiffness(const Engine *e) {
    return 2.0 * P(GAMMA) * P(P0_PA) * P(AREA_M2) / P(HALF_STROKE_M);
}

static double stiffness(const Engine *e, double energy) {
    return rest_stiffness(e) + P(GAMMA) * energy / pow(P(HALF_STROKE_M), 2.0);
}

static double sine_force(const Engine *e, double energy) {
    return 4.0 / PI * energy / P(HALF_STROKE_M);
}

/* --- linear engine: exact between two events ---------------------------------------------- */

static int regime_of(double decay, double omega_sq, double *omega_d) {
    double rest = omega_sq - decay * decay;
    *omega_d = 0.0;
    if (rest > CRITICAL_BAND * omega_sq) {
        *omega_d = sqrt(rest);
        return UNDERDAMPED;
    }
    if (rest < -CRITICAL_BAND * omega_sq) {
        *omega_d = sqrt(-rest);
        return OVERDAMPED;
    }
    return CRITICAL;
}

static Path segment(double m, double c, double k, double force, double sine, double x, double v,
                    double tau) {
    Path p = {0};
    double omega_sq = k / m, omega = sqrt(omega_sq);
    int damped = c > UNDAMPED_BELOW_N_S_M;
    double g = damped ? sine / (c * omega) : 0.0;
    double h = damped ? 0.0 : sine / (2.0 * m * omega);
    double cosine = cos(omega * tau), sinus = sin(omega * tau);
    double grown = g + h * tau;
    double y = x - force / k + grown * cosine;
    double w = v - grown * omega * sinus + h * cosine;
    double decay = c / (2.0 * m), scale;
    p.regime = regime_of(decay, omega_sq, &p.omega_d);
    scale = p.omega_d > 0.0 ? p.omega_d : 1.0;
    p.start = tau;
    p.decay = decay;
    p.y = y;
    p.y_sine = (w + decay * y) / scale;
    p.w = w;
    p.w_sine = (decay * w + omega_sq * y) / scale;
    p.centre = force / k;
    p.omega = omega;
    p.g = g;
    p.h = h;
    p.omega_sq = omega_sq;
    return p;
}

static Path half_cosine(double omega, double x, double x_end) {
    Path p = {0};
    p.centre = 0.5 * (x + x_end);
    p.omega_d = omega;
    p.regime = UNDERDAMPED;
    p.y = x - p.centre;
    p.w_sine = omega * p.y;
    p.omega = omega;
    p.omega_sq = omega * omega;
    return p;
}

static void evaluate(const Path *p, double tau, double *x, double *v) {
    double s = tau - p->start, cosine, sinus;
    if (p->regime == UNDERDAMPED) {
        double phase = p->omega_d * s, fade = exp(-p->decay * s);
        cosine = fade * cos(phase);
        sinus = fade * sin(phase);
    } else if (p->regime == CRITICAL) {
        cosine = exp(-p->decay * s);
        sinus = cosine * s;
    } else {
        double slow = exp((p->omega_d - p->decay) * s);
        double fast = exp(-(p->omega_d + p->decay) * s);
        cosine = 0.5 * (slow + fast);
        sinus = 0.5 * (slow - fast);
    }
    *x = p->centre + p->y * cosine + p->y_sine * sinus;
    *v = p->w * cosine - p->w_sine * sinus;
    if (p->g != 0.0 || p->h != 0.0) {
        double phase = p->omega * tau, grown = p->g + p->h * tau;
        cosine = cos(phase);
        *x -= grown * cosine;
        *v += grown * p->omega * sin(phase) - p->h * cosine;
    }
}

static double linear_acceleration(const Path *p, double tau, double x, double v) {
    double push = 2.0 * p->omega * (p->decay * p->g + p->h);
    double forced = push != 0.0 ? push * sin(p->omega * tau) : 0.0;
    return p->omega_sq * (p->centre - x) - 2.0 * p->decay * v + forced;
}

/* Value and slope that fall through zero: the speed along the stroke, or the gap to the head. */
static void falling(const Path *p, int of_gap, double limit, int direction, double tau,
                    double *value, double *slope) {
    double x, v;
    evaluate(p, tau, &x, &v);
    if (of_gap) {
        *value = limit - x * direction;
        *slope = -v * direction;
    } else {
        *value = v * direction;
        *slope = linear_acceleration(p, tau, x, v) * direction;
    }
}

static double falling_zero(const Path *p, int of_gap, double limit, int direction, double low,
                           double high) {
    double t = high;
    for (int n = 0; n < MOST_ITERATIONS; n++) {
        double value, slope, newton, following;
        falling(p, of_gap, limit, direction, t, &value, &slope);
        if (value > 0.0) {
            low = t;
        } else {
            high = t;
        }
        newton = slope < 0.0 ? t - value / slope : low;
        following = low < newton && newton < high ? newton : 0.5 * (low + high);
        if (fabs(following - t) <= TIME_TOLERANCE_S) {
            return following > low ? following : high;
        }
        t = following;
    }
    return high;
}

static int advance_linear(const Path *p, double tau, double dt, int direction, double limit,
                          double *x, double *v, double *used) {
    double end = tau + dt;
    int stop = NO_STOP;
    evaluate(p, end, x, v);
    if (*v * direction <= 0.0) {
        end = falling_zero(p, 0, limit, direction, tau, end);
        evaluate(p, end, x, v);
        stop = DEAD_CENTRE;
    }
    if (*x * direction >= limit) {
        double there;
        end = falling_zero(p, 1, limit, direction, tau, end);
        evaluate(p, end, &there, v);
        *x = limit * direction;
        *used = end - tau;
        return CONTACT;
    }
    if (stop != NO_STOP) {
        *v = 0.0;
    }
    *used = end - tau;
    return stop;
}

/* --- full gas force: Runge-Kutta with located stops --------------------------------------- */

static double gas_acceleration(const Path *p, double size, double x, double v) {
    double a = p->left * pow(size + x, p->exponent) - p->right * pow(size - x, p->exponent);
    return a - p->damping * v + p->push;
}

static void rk4(const Path *p, double size, double x, double v, double h, double *x1, double *v1) {
    double half = 0.5 * h, sixth = h / 6.0;
    double a1 = gas_acceleration(p, size, x, v);
    double x2 = x + half * v, v2 = v + half * a1;
    double a2 = gas_acceleration(p, size, x2, v2);
    double x3 = x + half * v2, v3 = v + half * a2;
    double a3 = gas_acceleration(p, size, x3, v3);
    double x4 = x + h * v3, v4 = v + h * a3;
    double a4 = gas_acceleration(p, size, x4, v4);
    *x1 = x + sixth * (v + 2.0 * (v2 + v3) + v4);
    *v1 = v + sixth * (a1 + 2.0 * (a2 + a3) + a4);
}

static double gas_step(double size, double x, double v, double left) {
    double gap = size - fabs(x);
    double h = fmin(STEP_PER_GAP_S_M * gap, MAX_STEP_S);
    if (fabs(v) * h > GAP_SHARE * gap) {
        h = fmax(GAP_SHARE * gap / fabs(v), MIN_STEP_S);
    }
    if (h >= left) {
        return left;
    }
    return 2.0 * h > left ? 0.5 * left : h;
}

/* The part of a step after which the speed vanishes, or the head is reached. */
static double gas_stop(const Path *p, double size, double x, double v, double high, int direction,
                       int of_gap, double limit) {
    double low = 0.0, h = high;
    for (int n = 0; n < MOST_ITERATIONS; n++) {
        double x1, v1, newton, following;
        rk4(p, size, x, v, h, &x1, &v1);
        if ((of_gap ? (limit - x1) * direction : v1 * direction) > 0.0) {
            low = h;
        } else {
            high = h;
        }
        if (of_gap) {
            newton = v1 * direction > 0.0 ? h + (limit - x1) / v1 : low;
        } else {
            double a1 = gas_acceleration(p, size, x1, v1);
            newton = a1 * direction < 0.0 ? h - v1 / a1 : low;
        }
        following = low < newton && newton < high ? newton : 0.5 * (low + high);
        if (fabs(following - h) <= STEP_TOLERANCE_S) {
            return following;
        }
        h = following;
    }
    return h;
}

static int advance_gas(const Path *p, double size, double limit, double dt, int direction,
                       double *x, double *v, double *used) {
    double spent = 0.0;
    while (spent < dt) {
        double left = dt - spent, x1, v1;
        double h = gas_step(size, *x, *v, left);
        rk4(p, size, *x, *v, h, &x1, &v1);
        if (v1 * direction <= 0.0) {
            h = gas_stop(p, size, *x, *v, h, direction, 0, limit);
            rk4(p, size, *x, *v, h, &x1, &v1);
            if (x1 * direction < limit) {
                *x = x1;
                *v = 0.0;
                *used = spent + h;
                return DEAD_CENTRE;
            }
        }
        if (x1 * direction >= limit) {
            h = gas_stop(p, size, *x, *v, h, direction, 1, limit * direction);
            rk4(p, size, *x, *v, h, &x1, &v1);
            *x = limit * direction;
            *v = v1;
            *used = spent + h;
            return CONTACT;
        }
        *x = x1;
        *v = v1;
        spent = h == left ? dt : spent + h;
    }
    *used = dt;
    return NO_STOP;
}

/* --- the model: path, acceleration, net force --------------------------------------------- */

static Path gas_path(const Engine *e) {
    const State *s = &e->state;
    Path p = {0};
    double size = P(HALF_STROKE_M), m = P(MOVING_MASS_KG);
    double spring = P(AREA_M2) * P(P0_PA) * pow(size, P(GAMMA)) / m;
    double burnt = s->energy * pow(size, P(GAMMA) - 1.0) / m;
    p.left = spring + (s->direction > 0 ? burnt : 0.0);
    p.right = spring + (s->direction < 0 ? burnt : 0.0);
    p.exponent = -P(GAMMA);
    p.damping = s->load / m;
    p.push = s->force / m;
    return p;
}

static void make_path(Engine *e) {
    State *s = &e->state;
    double k = stiffness(e, s->energy), force = s->force, sine = 0.0;
    if (MODEL == NONLINEAR) {
        s->path = gas_path(e);
        return;
    }
    if (s->latched) {
        double omega = sqrt(k / P(MOVING_MASS_KG));
        double x_end = s->direction * sine_force(e, s->energy) / (s->load * omega);
        s->path = half_cosine(omega, s->x, x_end);
        return;
    }
    if (MODEL == RECTANGULAR) {
        force += s->direction * (s->energy / P(HALF_STROKE_M));
    } else {
        sine = s->direction * sine_force(e, s->energy);
    }
    s->path = segment(P(MOVING_MASS_KG), s->load, k, force, sine, s->x, s->v, s->tau);
}

static double acceleration(const Engine *e) {
    const State *s = &e->state;
    if (MODEL == NONLINEAR) {
        return gas_acceleration(&s->path, P(HALF_STROKE_M), s->x, s->v);
    }
    return linear_acceleration(&s->path, s->tau, s->x, s->v);
}

static double net_force(const Engine *e) {
    const State *s = &e->state;
    double size = P(HALF_STROKE_M), spring;
    if (MODEL != NONLINEAR) {
        return s->force - rest_stiffness(e) * s->x;
    }
    spring = P(AREA_M2) * P(P0_PA) * pow(size, P(GAMMA));
    return spring * (pow(size + s->x, -P(GAMMA)) - pow(size - s->x, -P(GAMMA))) + s->force;
}

static int move(Engine *e, double span, double *used) {
    State *s = &e->state;
    int stop = NO_STOP;
    *used = span;
    if (!s->moving) {
        s->tau = s->tau + span;
        return NO_STOP;
    }
    if (MODEL == NONLINEAR) {
        stop = advance_gas(&s->path, P(HALF_STROKE_M), P(CONTACT_M), span, s->direction, &s->x,
                           &s->v, used);
    } else {
        stop = advance_linear(&s->path, s->tau, span, s->direction, P(CONTACT_M), &s->x, &s->v,
                              used);
    }
    s->tau = s->tau + *used;
    return stop;
}

/* --- strokes ------------------------------------------------------------------------------- */

static void come_to_rest(Engine *e) {
    e->state.v = 0.0;
    e->state.moving = 0;
    e->state.energy = 0.0;
    e->state.latched = 0;
}

/* Fuel that burns at this dead centre: what the inputs hold for its side, if it was lit in time. */
static double burning(const Engine *e, double t) {
    const State *s = &e->state;
    int left = s->direction < 0;
    double fuel = P(left ? FUEL_LEFT_KG : FUEL_RIGHT_KG);
    double spark = P(left ? SPARK_LEFT_S : SPARK_RIGHT_S);
    if (fuel <= 0.0 || s->x * s->direction <= 0.0) {
        return 0.0;
    }
    if (spark < 0.0 || spark > t || t - spark > P(SPARK_WINDOW_S)) {
        return 0.0;
    }
    return fuel;
}

static void start_stroke(Engine *e, int direction, double t, double fuel) {
    State *s = &e->state;
    s->tau = 0.0;
    s->direction = direction;
    s->energy = 1.0 * fuel * P(ENERGY_J_KG);
    s->latched = MODEL == CLOSED_FORM && s->energy > 0.0 && s->load > UNDAMPED_BELOW_N_S_M &&
                 s->force == 0.0;
    if (s->latched) {
        s->v = 0.0;
    }
    e->ints[DEAD_CENTRES] += 1;
    P(DC_T_S) = t;
    P(DC_X_M) = s->x;
    P(FUEL_BURNT_KG) = fuel;
}

static void end_stroke(Engine *e, double t, int stop) {
    State *s = &e->state;
    double slack = rest_stiffness(e) * REST_M, net, onward, fuel;
    int pinned;
    if (stop == CONTACT) {
        s->v = -P(RESTITUTION) * s->v;
        e->ints[CONTACTS] += 1;
    }
    net = net_force(e);
    onward = net * s->direction;
    if (stop != CONTACT && onward > slack) {
        s->energy = 0.0;
        s->latched = 0;
        make_path(e);
        return;
    }
    fuel = burning(e, t);
    start_stroke(e, -s->direction, t, fuel);
    pinned = stop == CONTACT ? onward > 0.0 : fabs(net) <= slack;
    if (s->energy == 0.0 && pinned && fabs(s->v) <= REST_M_S) {
        come_to_rest(e);
    }
    make_path(e);
}

/* A changed machine acts from here on; a resting piston that is pushed sets off. */
static void obey(Engine *e) {
    State *s = &e->state;
    double net;
    if (s->force == P(MACHINE_FORCE_N) && s->load == P(LOAD_COEFFICIENT_N_S_M)) {
        return;
    }
    s->force = P(MACHINE_FORCE_N);
    s->load = P(LOAD_COEFFICIENT_N_S_M);
    if (s->moving) {
        if (!s->latched) {
            make_path(e);
        }
        return;
    }
    net = net_force(e);
    if (fabs(net) <= rest_stiffness(e) * REST_M) {
        return;
    }
    if (fabs(s->x) >= P(CONTACT_M) && net * s->x >= 0.0) {
        return;
    }
    s->direction = net > 0.0 ? 1 : -1;
    s->moving = 1;
    s->tau = 0.0;
    s->energy = 0.0;
    s->latched = 0;
    make_path(e);
}

static int creeps_no_more(const Engine *e) {
    const State *s = &e->state;
    double inertia, damping;
    if (!s->moving || fabs(s->v) > REST_M_S) {
        return 0;
    }
    if (MODEL != NONLINEAR && s->path.regime == UNDERDAMPED) {
        return 0;
    }
    inertia = P(MOVING_MASS_KG) * fabs(acceleration(e));
    damping = s->load * fabs(s->v);
    return inertia + damping <= rest_stiffness(e) * REST_M;
}

static void tell(Engine *e) {
    const State *s = &e->state;
    double size = P(HALF_STROKE_M), burnt = s->energy / (P(AREA_M2) * size);
    double left = pow(size / fmax(size + s->x, NEAREST_M), P(GAMMA));
    double right = pow(size / fmax(size - s->x, NEAREST_M), P(GAMMA));
    P(X_M) = s->x;
    P(V_M_S) = s->v;
    P(P_LEFT_PA) = (P(P0_PA) + (s->direction > 0 ? burnt : 0.0)) * left;
    P(P_RIGHT_PA) = (P(P0_PA) + (s->direction < 0 ? burnt : 0.0)) * right;
    P(ELECTRIC_POWER_W) = s->load * s->v * s->v - s->force * s->v;
}

/* --- what the interface calls --------------------------------------------------------------- */

void engine_defaults(Engine *e) {
    static const double reals[N_REALS] = REAL_STARTS;
    memset(e, 0, sizeof *e);
    memcpy(e->reals, reals, sizeof reals);
}

/* At rest, or at a dead centre with `start_fuel_kg` burning there. */
void engine_begin(Engine *e, double t) {
    State *s = &e->state;
    memset(s, 0, sizeof *s);
    memset(e->ints, 0, sizeof e->ints);
    s->t = t;
    s->x = P(START_X_M);
    s->direction = 1;
    P(DC_T_S) = t;
    P(DC_X_M) = P(FUEL_BURNT_KG) = 0.0;
    if (P(START_FUEL_KG) > 0.0) {
        s->force = P(MACHINE_FORCE_N);
        s->load = P(LOAD_COEFFICIENT_N_S_M);
        s->moving = 1;
        start_stroke(e, s->x > 0.0 ? -1 : 1, t, P(START_FUEL_KG));
    }
    make_path(e);
    tell(e);
}

int engine_step(Engine *e, double t, double h) {
    State *s = &e->state;
    double used = 0.0;
    int stops;
    obey(e);
    for (stops = 0; stops < MOST_PARTS && used < h; stops++) {
        double left = h - used, spent;
        int stop = move(e, left, &spent);
        used = stop == NO_STOP ? h : used + spent;
        if (stop != NO_STOP) {
            end_stroke(e, t + used, stop);
        }
    }
    if (used < h) {
        s->tau = s->tau + h - used;
        come_to_rest(e);
    }
    if (creeps_no_more(e)) {
        if (s->energy == 0.0) {
            come_to_rest(e);
        } else {
            end_stroke(e, t + h, DEAD_CENTRE);
        }
    }
    s->t = t + h;
    tell(e);
    return 0;
}
