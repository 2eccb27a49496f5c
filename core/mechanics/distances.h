/* Distances of cables, as segments from anchor to attachment; this needs `num`, and vectors.h. */
#ifndef TOWLINE_DISTANCES_H
#define TOWLINE_DISTANCES_H

INLINE num share(num x) { return smaller(larger(x, number(0)), number(1)); }

/* The distance of segments p to p_end and q to q_end (Ericson, Real-Time Collision Detection, 5.1.9). */
INLINE num segment_distance(const num *p, const num *p_end, const num *q, const num *q_end) {
    num along[3], across[3], between[3], gap[3];
    for (int i = 0; i < 3; i++) {
        along[i] = p_end[i] - p[i];
        across[i] = q_end[i] - q[i];
        between[i] = p[i] - q[i];
    }
    const num a = dot(along, along), e = dot(across, across), f = dot(across, between);
    const num b = dot(along, across), c = dot(along, between), beside = a * e - b * b;
    /* On parallel lines every s serves, so 0 does; a segment of no length has all of it at its start. */
    num s = where(beside > 1e-14 * a * e, share((b * f - c * e) / beside), number(0));
    const num t = where(e > 0.0, share((b * s + f) / e), number(0));
    s = where(a > 0.0, share((b * t - c) / a), number(0));
    for (int i = 0; i < 3; i++) { gap[i] = between[i] + s * along[i] - t * across[i]; }
    return square_root(dot(gap, gap));
}

/* The distances of all pairs of m cables from starts to ends, (m, 3) each, from the first and second to the last two. */
INLINE void distances_of_pairs(int m, const num *starts, const num *ends, num *distance) {
    for (int i = 0; i < m; i++) {
        for (int j = i + 1; j < m; j++) {
            *distance++ = segment_distance(ends + 3 * i, starts + 3 * i, ends + 3 * j, starts + 3 * j);
        }
    }
}

#endif
