/*
 * Numbers for some problems at once: `num` is a vector of GCC and Clang with one lane for each of them, `mask` one
 * whose lanes have all bits set (yes) or none (no). Comparisons of two `num` give a mask.
 *
 * A file that uses lanes is compiled once for each kind of processor, by files such as rows_avx2.c: a compiler turns
 * vectors into instructions in the function that it compiles, before that function is inlined into another. Neither
 * compiler has a square root of a vector, or chooses between two vectors by `?:` in C.
 */
#ifndef TOWLINE_LANES_H
#define TOWLINE_LANES_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#define INLINE static inline __attribute__((always_inline, unused))

/* GCC keeps vectors that are larger than the processor's in memory; Clang makes registers of them, four in turn. */
#ifdef __clang__
enum { LANES = 8 };
#else
enum { LANES = VECTOR_BYTES / 8 };
#endif

typedef double num __attribute__((vector_size(8 * LANES)));
typedef int64_t mask __attribute__((vector_size(8 * LANES)));
typedef uint64_t bits __attribute__((vector_size(8 * LANES)));

INLINE num number(double x) { return x - (num){0}; }

INLINE num where(mask chosen, num yes, num no) { return (num)((chosen & (mask)yes) | (~chosen & (mask)no)); }

INLINE num magnitude(num x) { return (num)((mask)x & INT64_MAX); }

INLINE num smaller(num x, num y) { return where(x < y, x, y); }

INLINE num larger(num x, num y) { return where(x > y, x, y); }

INLINE num between(num low, num x, num high) { return smaller(larger(low, x), high); }

/* Through a pointer: compilers make one instruction of this, and slow code of `x[lane] = sqrt(x[lane])`. */
INLINE num square_root(num x) {
    for (int lane = 0; lane < LANES; lane++) { ((double *)&x)[lane] = sqrt(((const double *)&x)[lane]); }
    return x;
}

INLINE int any(mask chosen) {
    int64_t all = 0;
    for (int lane = 0; lane < LANES; lane++) { all |= chosen[lane]; }
    return all != 0;
}

INLINE bits bits_of(num x) { return (bits)x; }

INLINE num from_bits(bits b) { return (num)b; }

/* Put `size` numbers of each row into lanes: from[row * per + i] for row = first, first + 1, ... The last row is repeated. */
INLINE void gather(num *to, const double *from, ptrdiff_t per, ptrdiff_t first, ptrdiff_t rows, int size) {
    for (int lane = 0; lane < LANES; lane++) {
        const ptrdiff_t row = first + lane < rows ? first + lane : rows - 1;
        for (int i = 0; i < size; i++) { ((double *)to)[LANES * i + lane] = from[row * per + i]; }
    }
}

/* Write `size` numbers of each lane to its row, `size` from one to the next; NULL: they are not wanted. */
INLINE void scatter(double *to, const num *from, ptrdiff_t first, ptrdiff_t rows, int size) {
    for (int lane = 0; to && lane < LANES && first + lane < rows; lane++) {
        for (int i = 0; i < size; i++) { to[(first + lane) * size + i] = ((const double *)from)[LANES * i + lane]; }
    }
}

/* These need `num`. */
#include "angle.h"
#include "sine.h"

#endif
