#include "numbers/processor.h"

#ifdef TOWLINE_X86

#include <cpuid.h>
#include <stdint.h>

/* What the operating system saves of a thread's registers when it takes turns. */
static uint64_t saved_registers(void) {
    uint32_t low, high;
    __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return ((uint64_t)high << 32) | low;
}

/* By cpuid: `__builtin_cpu_supports` answers no where Clang links without its run-time library. */
static int kind_of_processor(void) {
    enum { OSXSAVE = 1 << 27, AVX = 1 << 28, AVX2 = 1 << 5, AVX512F = 1 << 16, AVX512DQ = 1 << 17 };
    enum { YMM = 0x6, ZMM = 0xe6 };
    uint32_t a, b, c, d;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & OSXSAVE) || !(c & AVX)) { return 0; }
    const uint64_t saved = saved_registers();
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d) || !(b & AVX2) || (saved & YMM) != YMM) { return 0; }
    return (b & AVX512F) && (b & AVX512DQ) && (saved & ZMM) == ZMM ? 2 : 1;
}

/*
 * The core's only variable, for something that never changes: in a virtual machine each cpuid costs a microsecond, more
 * than many a call. Threads may look at the same time, and see the same.
 */
static int known = -1;

int towline_processor(void) {
    int kind = __atomic_load_n(&known, __ATOMIC_RELAXED);
    if (kind < 0) {
        kind = kind_of_processor();
        __atomic_store_n(&known, kind, __ATOMIC_RELAXED);
    }
    return kind;
}

#else

int towline_processor(void) { return 0; }

#endif
