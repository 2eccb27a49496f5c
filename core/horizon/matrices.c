#include "horizon/matrices.h"

#include "numbers/processor.h"

extern const towline_algebra towline_algebra_plain;
#ifdef TOWLINE_X86
extern const towline_algebra towline_algebra_avx2;
#endif

const towline_algebra *towline_algebra_for(int processor) {
#ifdef TOWLINE_X86
    if (processor > 0) { return &towline_algebra_avx2; }
#endif
    (void)processor;
    return &towline_algebra_plain;
}
