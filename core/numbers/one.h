/* Numbers for one pose at a time: the type `num` and its functions, as lanes.h has them for eight. */
#ifndef TOWLINE_ONE_H
#define TOWLINE_ONE_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#ifdef __GNUC__
#define INLINE static inline __attribute__((always_inline, unused))
#else
#define INLINE static inline
#endif

typedef double num;
typedef uint64_t bits;

INLINE num number(double x) { return x; }

INLINE num square_root(num x) { return sqrt(x); }

INLINE num magnitude(num x) { return fabs(x); }

INLINE num angle_of(num y, num x) { return atan2(y, x); }

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

#include "sine.h"

#endif
