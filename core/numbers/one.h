/* Numbers for one pose at a time: the type `num` and its functions, as lanes.h has them for eight. */
#ifndef TOWLINE_ONE_H
#define TOWLINE_ONE_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __GNUC__
#define INLINE static inline __attribute__((always_inline, unused))
#else
#define INLINE static inline
#endif

enum { LANES = 1 };

typedef double num;
typedef int mask;
typedef uint64_t bits;

INLINE num number(double x) { return x; }

INLINE num where(mask chosen, num yes, num no) { return chosen ? yes : no; }

INLINE num square_root(num x) { return sqrt(x); }

INLINE num magnitude(num x) { return fabs(x); }

INLINE num smaller(num x, num y) { return x < y ? x : y; }

INLINE num larger(num x, num y) { return x > y ? x : y; }

INLINE int any(mask chosen) { return chosen; }

/* These read and write the numbers of a row, as those of lanes.h do. */
INLINE void gather(num *to, const double *from, ptrdiff_t per, ptrdiff_t first, ptrdiff_t rows, int size) {
    (void)rows;
    memcpy(to, from + first * per, (size_t)size * sizeof *to);
}

INLINE void scatter(double *to, const num *from, ptrdiff_t first, ptrdiff_t rows, int size) {
    (void)rows;
    if (to) { memcpy(to + first * size, from, (size_t)size * sizeof *to); }
}

INLINE bits bits_of(num x) {
    bits b;
    memcpy(&b, &x, sizeof b);
    return b;
}

INLINE num from_bits(bits b) {
    num x;
    memcpy(&x, &b, sizeof x);
    return x;
}

/* These need `num`. */
#include "angle.h"
#include "sine.h"

#endif
