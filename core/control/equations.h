/* Small systems of linear equations. */
#ifndef TOWLINE_EQUATIONS_H
#define TOWLINE_EQUATIONS_H

#include "numbers/one.h"

/* Replace the last column of a positive definite system of six equations by their solution. */
INLINE void solve_positive(double gram[6][7]) {
    for (int k = 0; k < 6; k++) {
        for (int j = k + 1; j < 6; j++) {
            const double factor = gram[j][k] / gram[k][k];
            for (int i = k; i < 7; i++) { gram[j][i] -= factor * gram[k][i]; }
        }
    }
    for (int k = 5; k >= 0; k--) {
        for (int i = k + 1; i < 6; i++) { gram[k][6] -= gram[k][i] * gram[i][6]; }
        gram[k][6] /= gram[k][k];
    }
}

/* Write the adjugate of M, whose product with M is its determinant times the unit matrix; return the determinant. */
INLINE double adjugate(const double M[3][3], double adj[3][3]) {
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        for (int row = 0; row < 3; row++) {
            const int p = (row + 1) % 3, q = (row + 2) % 3;
            adj[i][row] = M[p][j] * M[q][k] - M[p][k] * M[q][j];
        }
    }
    return M[0][0] * adj[0][0] + M[0][1] * adj[1][0] + M[0][2] * adj[2][0];
}

#endif
