/* The functions of FMI 3.0 that a unit for co-simulation has; refused.c has those that it has not. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3.h"
#include "unit.h"

typedef struct {
    towline_unit unit;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3Boolean logs;
} instance;

static fmi3Status refuse(const instance *it, fmi3String reason) {
    if (it->logs && it->log) { it->log(it->environment, fmi3Error, "logStatusError", reason); }
    return fmi3Error;
}

static fmi3Status enter(instance *it, unit_mode from, unit_mode to) {
    if (it->unit.mode != (int32_t)from) { return refuse(it, "the function is not allowed in this mode"); }
    it->unit.mode = to;
    return fmi3OK;
}

FMI3_FUNCTION fmi3String fmi3GetVersion(void) { return "3.0"; }

FMI3_FUNCTION fmi3Status fmi3SetDebugLogging(fmi3Instance it, fmi3Boolean on, size_t count, const fmi3String names[]) {
    (void)count, (void)names;
    ((instance *)it)->logs = on;
    return fmi3OK;
}

FMI3_FUNCTION fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                                       fmi3Boolean visible, fmi3Boolean logs, fmi3Boolean event_mode,
                                                       fmi3Boolean early_return, const fmi3ValueReference required[],
                                                       size_t count, fmi3InstanceEnvironment environment,
                                                       fmi3LogMessageCallback log,
                                                       fmi3IntermediateUpdateCallback update) {
    (void)name, (void)resources, (void)visible, (void)early_return, (void)required, (void)update;
    const instance here = {.environment = environment, .log = log, .logs = logs};
    if (!token || strcmp(token, towline_unit_at_start.token) != 0) {
        refuse(&here, "the instantiation token is not that of this unit");
        return NULL;
    }
    if (event_mode || count) {
        refuse(&here, "there are neither event mode nor intermediate variables");
        return NULL;
    }
    instance *it = malloc(sizeof *it);
    if (it) {
        *it = here;
        it->unit = towline_unit_at_start;
    }
    return it;
}

FMI3_FUNCTION void fmi3FreeInstance(fmi3Instance it) { free(it); }

FMI3_FUNCTION fmi3Status fmi3EnterInitializationMode(fmi3Instance it, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                                     fmi3Float64 start, fmi3Boolean has_end, fmi3Float64 end) {
    (void)has_tolerance, (void)tolerance, (void)has_end, (void)end;
    ((instance *)it)->unit.time = start;
    return enter(it, UNIT_INSTANTIATED, UNIT_INITIALISING);
}

FMI3_FUNCTION fmi3Status fmi3ExitInitializationMode(fmi3Instance it) {
    return enter(it, UNIT_INITIALISING, UNIT_STEPPING);
}

FMI3_FUNCTION fmi3Status fmi3Terminate(fmi3Instance it) { return enter(it, UNIT_STEPPING, UNIT_TERMINATED); }

FMI3_FUNCTION fmi3Status fmi3Reset(fmi3Instance it) {
    ((instance *)it)->unit = towline_unit_at_start;
    return fmi3OK;
}

FMI3_FUNCTION fmi3Status fmi3GetFloat64(fmi3Instance it, const fmi3ValueReference references[], size_t count,
                                        fmi3Float64 values[], size_t numbers) {
    const char *unit = (const char *)&((instance *)it)->unit;
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= towline_unit_variable_count || numbers != count) {
            return refuse(it, "there is no variable of this reference, or not one number for each");
        }
        memcpy(&values[i], unit + towline_unit_variables[references[i]].place, sizeof values[i]);
    }
    return fmi3OK;
}

FMI3_FUNCTION fmi3Status fmi3SetFloat64(fmi3Instance it, const fmi3ValueReference references[], size_t count,
                                        const fmi3Float64 values[], size_t numbers) {
    char *unit = (char *)&((instance *)it)->unit;
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= towline_unit_variable_count || numbers != count) {
            return refuse(it, "there is no variable of this reference, or not one number for each");
        }
        const unit_variable *variable = &towline_unit_variables[references[i]];
        if (variable->set == UNIT_READ) { return refuse(it, "outputs and time cannot be set"); }
        if (variable->set == UNIT_FINITE && !(isfinite(values[i]) && values[i] >= variable->least)) {
            return refuse(it, "a value is not finite, or less than the smallest allowed one");
        }
        memcpy(unit + variable->place, &values[i], sizeof values[i]);
    }
    return fmi3OK;
}

FMI3_FUNCTION fmi3Status fmi3DoStep(fmi3Instance it, fmi3Float64 time, fmi3Float64 step, fmi3Boolean never_returns,
                                    fmi3Boolean *needs_event, fmi3Boolean *ends, fmi3Boolean *early,
                                    fmi3Float64 *last_time) {
    instance *self = it;
    (void)never_returns;
    *needs_event = *ends = *early = false;
    *last_time = time;
    if (self->unit.mode != UNIT_STEPPING) { return refuse(self, "steps are allowed in step mode only"); }
    if (!towline_unit_step(&self->unit, time, step)) {
        return refuse(self,
                      "the motion diverges, use smaller steps; or no pose has the commanded lengths of cables "
                      "without stiffness; or the step is not a positive time");
    }
    *last_time = self->unit.time;
    return fmi3OK;
}

FMI3_FUNCTION fmi3Status fmi3GetFMUState(fmi3Instance it, fmi3FMUState *state) {
    *state = *state ? *state : malloc(sizeof(towline_unit));
    if (!*state) { return refuse(it, "no memory is left"); }
    memcpy(*state, &((instance *)it)->unit, sizeof(towline_unit));
    return fmi3OK;
}

FMI3_FUNCTION fmi3Status fmi3SetFMUState(fmi3Instance it, fmi3FMUState state) {
    const towline_unit *given = state;
    if (!given || strcmp(given->token, towline_unit_at_start.token) != 0) {
        return refuse(it, "the state is not one of this unit");
    }
    ((instance *)it)->unit = *given;
    return fmi3OK;
}

FMI3_FUNCTION fmi3Status fmi3FreeFMUState(fmi3Instance it, fmi3FMUState *state) {
    (void)it;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

FMI3_FUNCTION fmi3Status fmi3SerializedFMUStateSize(fmi3Instance it, fmi3FMUState state, size_t *size) {
    (void)it, (void)state;
    *size = sizeof(towline_unit);
    return fmi3OK;
}

FMI3_FUNCTION fmi3Status fmi3SerializeFMUState(fmi3Instance it, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    if (size != sizeof(towline_unit)) { return refuse(it, "the size is not that of a state"); }
    memcpy(bytes, state, size);
    return fmi3OK;
}

FMI3_FUNCTION fmi3Status fmi3DeserializeFMUState(fmi3Instance it, const fmi3Byte bytes[], size_t size,
                                                 fmi3FMUState *state) {
    const char *token = towline_unit_at_start.token;
    if (size != sizeof(towline_unit) || memcmp(bytes, token, sizeof towline_unit_at_start.token) != 0) {
        return refuse(it, "the bytes are not a state of this unit");
    }
    *state = *state ? *state : malloc(size);
    if (!*state) { return refuse(it, "no memory is left"); }
    memcpy(*state, bytes, size);
    return fmi3OK;
}
