/* Vectors (3) and rotation matrices (3 x 3, row by row) of `num`: one number, or one for each lane. */
#ifndef TOWLINE_VECTORS_H
#define TOWLINE_VECTORS_H

INLINE num dot(const num *a, const num *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* c = a x b; c is another array than a and b. */
INLINE void cross(const num *a, const num *b, num *c) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

/* y = R x; y is another array than x. */
INLINE void turn(const num *R, const num *x, num *y) {
    for (int i = 0; i < 3; i++) { y[i] = R[3 * i] * x[0] + R[3 * i + 1] * x[1] + R[3 * i + 2] * x[2]; }
}

/* y = R x for the same x in all lanes. */
INLINE void turn_constant(const num *R, const double *x, num *y) {
    for (int i = 0; i < 3; i++) { y[i] = R[3 * i] * x[0] + R[3 * i + 1] * x[1] + R[3 * i + 2] * x[2]; }
}

/* y = R^T x */
INLINE void turn_back(const num *R, const num *x, num *y) {
    for (int i = 0; i < 3; i++) { y[i] = R[i] * x[0] + R[3 + i] * x[1] + R[6 + i] * x[2]; }
}

/* y = M x for a matrix that is the same in all lanes. */
INLINE void constant_times(const double *M, const num *x, num *y) {
    for (int i = 0; i < 3; i++) { y[i] = M[3 * i] * x[0] + M[3 * i + 1] * x[1] + M[3 * i + 2] * x[2]; }
}

#endif
