/* The engine behind FMI 2.0 for co-simulation; what it does not offer is in refused.c. */
#include <stdlib.h>
#include <string.h>

#include "engine.h"
#include "fmi2Functions.h"

#define ENGINE ((Engine *)c)

static int is_real(fmi2ValueReference vr) { return vr < N_REALS; }
static int is_int(fmi2ValueReference vr) { return vr >= FIRST_INT && vr < FIRST_INT + N_INTS; }

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n,
                               const fmi2String categories[]) {
    (void)c, (void)on, (void)n, (void)categories;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid,
                              fmi2String resources, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean logging) {
    Engine *e;
    (void)name, (void)resources, (void)functions, (void)visible, (void)logging;
    if (type != fmi2CoSimulation || guid == NULL || strcmp(guid, TOKEN) != 0) {
        return NULL;
    }
    e = malloc(sizeof *e);
    if (e != NULL) {
        engine_defaults(e);
    }
    return e;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop) {
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    ENGINE->state.t = start;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    engine_begin(ENGINE, ENGINE->state.t);
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    engine_begin(ENGINE, ENGINE->state.t);
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    engine_defaults(ENGINE);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                       fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) {
        if (!is_real(vr[i])) {
            return fmi2Error;
        }
        value[i] = ENGINE->reals[vr[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                          fmi2Integer value[]) {
    for (size_t i = 0; i < n; i++) {
        if (!is_int(vr[i])) {
            return fmi2Error;
        }
        value[i] = ENGINE->ints[vr[i] - FIRST_INT];
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                       const fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) {
        if (!is_real(vr[i]) || vr[i] >= FIRST_OUTPUT) {
            return fmi2Error;
        }
        ENGINE->reals[vr[i]] = value[i];
    }
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (*state == NULL && (*state = malloc(sizeof(Engine))) == NULL) {
        return fmi2Error;
    }
    memcpy(*state, c, sizeof(Engine));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    memcpy(c, state, sizeof(Engine));
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)c, (void)state;
    *size = sizeof(Engine);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[],
                                 size_t size) {
    (void)c;
    if (size < sizeof(Engine)) {
        return fmi2Error;
    }
    memcpy(bytes, state, sizeof(Engine));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                   fmi2FMUstate *state) {
    (void)c;
    if (size != sizeof(Engine) || (*state == NULL && (*state = malloc(size)) == NULL)) {
        return fmi2Error;
    }
    memcpy(*state, bytes, size);
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_rollback) {
    (void)no_rollback;
    if (!(h > 0.0)) {
        return fmi2Error;
    }
    return engine_step(ENGINE, t, h) ? fmi2Error : fmi2OK;
}
