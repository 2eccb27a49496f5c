/* Include this first in a file whose functions serve processors with AVX-512. */
#include "numbers/processor.h"

/* Clang makes instructions of vectors after inlining, GCC before. With Clang only pointers to vectors may be passed to
 * functions by one of `FORM`, since these functions are not compiled for the processor by themselves. */
#ifdef __clang__
#define FORM(name) __attribute__((target("avx512f,avx512dq"))) name##_avx512
#elif defined(TOWLINE_X86)
#pragma GCC target("avx512f,avx512dq,prefer-vector-width=512")
#define FORM(name) name##_avx512
#endif

#define VECTOR_BYTES 64
