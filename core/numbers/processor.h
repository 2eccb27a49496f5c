/*
 * Forms of a function in lanes for the processors that it may run on: plain, AVX2 and AVX-512.
 *
 * A file rows_avx2.c includes numbers/avx2.h and then the code in lanes; FORM(name) is name_avx2 there. On other
 * processors than x86, and there by other compilers than GCC and Clang, only the plain form exists; where a compiler has
 * no vectors, TOWLINE_NO_LANES, not even that, and rows are computed one after another.
 */
#ifndef TOWLINE_PROCESSOR_H
#define TOWLINE_PROCESSOR_H

#ifndef __GNUC__
#define TOWLINE_NO_LANES
#elif defined(__x86_64__)
#define TOWLINE_X86
#endif

/* The best form for this processor: 0 plain, 1 AVX2, 2 AVX-512. */
int towline_processor(void);

/* Call the best form of a function. */
#ifdef TOWLINE_X86
#define BEST_FORM(name, ...)            \
    switch (towline_processor()) {      \
        case 2:                         \
            name##_avx512(__VA_ARGS__); \
            break;                      \
        case 1:                         \
            name##_avx2(__VA_ARGS__);   \
            break;                      \
        default:                        \
            name##_plain(__VA_ARGS__);  \
    }
#else
#define BEST_FORM(name, ...) name##_plain(__VA_ARGS__)
#endif

#endif
