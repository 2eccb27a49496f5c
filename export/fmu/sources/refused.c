/* The functions of FMI 3.0 that an importer looks for, but this unit does not have: other types, other modes, clocks. */
#include "fmi3.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

typedef fmi3ValueReference reference;
#define SOME const reference v[], size_t n

#define REFUSE(name, ...) \
    FMI3_FUNCTION fmi3Status fmi3##name(fmi3Instance it, __VA_ARGS__) { return fmi3Error; }
#define REFUSE_MODE(name) \
    FMI3_FUNCTION fmi3Status fmi3##name(fmi3Instance it) { return fmi3Error; }
#define NO_VARIABLES_OF(type)                                                                       \
    FMI3_FUNCTION fmi3Status fmi3Get##type(fmi3Instance it, SOME, fmi3##type x[], size_t m) {       \
        return n ? fmi3Error : fmi3OK;                                                              \
    }                                                                                               \
    FMI3_FUNCTION fmi3Status fmi3Set##type(fmi3Instance it, SOME, const fmi3##type x[], size_t m) { \
        return n ? fmi3Error : fmi3OK;                                                              \
    }

FMI3_FUNCTION fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                                        fmi3Boolean visible, fmi3Boolean logs,
                                                        fmi3InstanceEnvironment environment,
                                                        fmi3LogMessageCallback log) {
    return NULL;
}
FMI3_FUNCTION fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                                             fmi3Boolean visible, fmi3Boolean logs,
                                                             fmi3InstanceEnvironment environment,
                                                             fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
                                                             fmi3LockPreemptionCallback lock,
                                                             fmi3UnlockPreemptionCallback unlock) {
    return NULL;
}

NO_VARIABLES_OF(Float32)
NO_VARIABLES_OF(Int8)
NO_VARIABLES_OF(UInt8)
NO_VARIABLES_OF(Int16)
NO_VARIABLES_OF(UInt16)
NO_VARIABLES_OF(Int32)
NO_VARIABLES_OF(UInt32)
NO_VARIABLES_OF(Int64)
NO_VARIABLES_OF(UInt64)
NO_VARIABLES_OF(Boolean)
NO_VARIABLES_OF(String)
REFUSE(GetBinary, SOME, size_t sizes[], fmi3Binary x[], size_t m)
REFUSE(SetBinary, SOME, const size_t sizes[], const fmi3Binary x[], size_t m)
REFUSE(GetClock, SOME, fmi3Clock x[])
REFUSE(SetClock, SOME, const fmi3Clock x[])

REFUSE(GetNumberOfVariableDependencies, reference v, size_t *n)
REFUSE(GetVariableDependencies, reference v, size_t of_it[], reference others[], size_t of_others[],
       fmi3DependencyKind kinds[], size_t n)
REFUSE(GetDirectionalDerivative, const reference y[], size_t n, const reference x[], size_t m, const fmi3Float64 seed[],
       size_t s, fmi3Float64 slopes[], size_t k)
REFUSE(GetAdjointDerivative, const reference y[], size_t n, const reference x[], size_t m, const fmi3Float64 seed[],
       size_t s, fmi3Float64 slopes[], size_t k)
REFUSE(GetOutputDerivatives, SOME, const fmi3Int32 orders[], fmi3Float64 x[], size_t m)

REFUSE_MODE(EnterConfigurationMode)
REFUSE_MODE(ExitConfigurationMode)
REFUSE_MODE(EnterEventMode)
REFUSE_MODE(EnterStepMode)
REFUSE_MODE(EnterContinuousTimeMode)
REFUSE_MODE(EvaluateDiscreteStates)
REFUSE(UpdateDiscreteStates, fmi3Boolean *more, fmi3Boolean *ends, fmi3Boolean *nominals, fmi3Boolean *states,
       fmi3Boolean *has_next, fmi3Float64 *next)

REFUSE(GetIntervalDecimal, SOME, fmi3Float64 x[], fmi3IntervalQualifier how[])
REFUSE(GetIntervalFraction, SOME, fmi3UInt64 x[], fmi3UInt64 of[], fmi3IntervalQualifier how[])
REFUSE(GetShiftDecimal, SOME, fmi3Float64 x[])
REFUSE(GetShiftFraction, SOME, fmi3UInt64 x[], fmi3UInt64 of[])
REFUSE(SetIntervalDecimal, SOME, const fmi3Float64 x[])
REFUSE(SetIntervalFraction, SOME, const fmi3UInt64 x[], const fmi3UInt64 of[])
REFUSE(SetShiftDecimal, SOME, const fmi3Float64 x[])
REFUSE(SetShiftFraction, SOME, const fmi3UInt64 x[], const fmi3UInt64 of[])
REFUSE(ActivateModelPartition, reference clock, fmi3Float64 time)

REFUSE(CompletedIntegratorStep, fmi3Boolean never_returns, fmi3Boolean *enters, fmi3Boolean *ends)
REFUSE(SetTime, fmi3Float64 time)
REFUSE(SetContinuousStates, const fmi3Float64 x[], size_t n)
REFUSE(GetContinuousStates, fmi3Float64 x[], size_t n)
REFUSE(GetContinuousStateDerivatives, fmi3Float64 x[], size_t n)
REFUSE(GetNominalsOfContinuousStates, fmi3Float64 x[], size_t n)
REFUSE(GetEventIndicators, fmi3Float64 x[], size_t n)
REFUSE(GetNumberOfEventIndicators, size_t *n)
REFUSE(GetNumberOfContinuousStates, size_t *n)
