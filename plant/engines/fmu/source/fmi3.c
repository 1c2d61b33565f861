/* The engine behind FMI 3.0 for co-simulation; what it does not offer is in refused.c. */
#include <stdlib.h>
#include <string.h>

#include "engine.h"
#include "fmi3Functions.h"

#define ENGINE ((Engine *)c)

static int is_real(fmi3ValueReference vr) { return vr < N_REALS; }
static int is_int(fmi3ValueReference vr) { return vr >= FIRST_INT && vr < FIRST_INT + N_INTS; }

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n,
                               const fmi3String categories[]) {
    (void)c, (void)on, (void)n, (void)categories;
    return fmi3OK;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    (void)environment, (void)log;
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock,
    fmi3UnlockPreemptionCallback unlock) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    (void)environment, (void)log, (void)clock, (void)lock, (void)unlock;
    return NULL;
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
    const fmi3ValueReference intermediate[], size_t n, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    Engine *e;
    (void)name, (void)resources, (void)visible, (void)logging, (void)event_mode;
    (void)early_return, (void)intermediate, (void)n, (void)environment, (void)log, (void)update;
    if (token == NULL || strcmp(token, TOKEN) != 0) {
        return NULL;
    }
    e = malloc(sizeof *e);
    if (e != NULL) {
        engine_defaults(e);
    }
    return e;
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined,
                                       fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean stop_defined, fmi3Float64 stop) {
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    engine_begin(ENGINE, start);
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    engine_begin(ENGINE, ENGINE->state.t);
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance c) {
    (void)c;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance c) {
    (void)c;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance c) {
    engine_defaults(ENGINE);
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                          fmi3Float64 value[], size_t n_values) {
    for (size_t i = 0; i < n; i++) {
        if (n_values != n || !is_real(vr[i])) {
            return fmi3Error;
        }
        value[i] = vr[i] == TIME ? ENGINE->state.t : ENGINE->reals[vr[i]];
    }
    return fmi3OK;
}

fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                        fmi3Int32 value[], size_t n_values) {
    for (size_t i = 0; i < n; i++) {
        if (n_values != n || !is_int(vr[i])) {
            return fmi3Error;
        }
        value[i] = ENGINE->ints[vr[i] - FIRST_INT];
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                          const fmi3Float64 value[], size_t n_values) {
    for (size_t i = 0; i < n; i++) {
        if (n_values != n || vr[i] == TIME || vr[i] >= FIRST_OUTPUT) {
            return fmi3Error;
        }
        ENGINE->reals[vr[i]] = value[i];
    }
    return fmi3OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
    if (*state == NULL && (*state = malloc(sizeof(Engine))) == NULL) {
        return fmi3Error;
    }
    memcpy(*state, c, sizeof(Engine));
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
    memcpy(c, state, sizeof(Engine));
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    (void)c, (void)state;
    *size = sizeof(Engine);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[],
                                 size_t size) {
    (void)c;
    if (size < sizeof(Engine)) {
        return fmi3Error;
    }
    memcpy(bytes, state, sizeof(Engine));
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size,
                                   fmi3FMUState *state) {
    (void)c;
    if (size != sizeof(Engine) || (*state == NULL && (*state = malloc(size)) == NULL)) {
        return fmi3Error;
    }
    memcpy(*state, bytes, size);
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_rollback,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early,
                      fmi3Float64 *last) {
    (void)no_rollback;
    *event = *terminate = *early = fmi3False;
    if (!(h > 0.0)) {
        *last = t;
        return fmi3Error;
    }
    *last = t + h;
    return engine_step(ENGINE, t, h) ? fmi3Error : fmi3OK;
}
