/* The reference of a predictive controller, changed the least so that its motion obeys the model. */
#include "control/equations.h"
#include "control/internal.h"

static const double ALMOST = 1e-4; /* of the largest entry of the gram matrix: wrenches that cost more are left */

enum { MOST_EFFORTS = TOWLINE_MOST_CABLES + 6 * TOWLINE_MOST_CARRIERS };

/* What each effort changes of the platform's accelerations in a stage, all of them in m/s^2, and what is missing. */
typedef struct {
    double gain[6][MOST_EFFORTS];
    double missing[6];
} lack;

static double entry(towline_matrices matrices, int k, int row, int column) {
    return matrices.at[matrices.stage * k + matrices.row * row + column];
}

static void write_lack(const towline_stages *stages, int k, int m, int moved, double length, const double *wanted,
                       const double *planned, lack *of) {
    const int n = MOTION + 2 * moved, count = m + moved;
    for (int i = 0; i < 6; i++) {
        const double by = (i < 3 ? 1 : length) / stages->steps[k];
        double missing = wanted[n * (k + 1) + 6 + i] - entry(stages->c, k, 0, 6 + i);
        for (int j = 0; j < n; j++) { missing -= entry(stages->A, k, 6 + i, j) * wanted[n * k + j]; }
        for (int j = 0; j < count; j++) {
            missing -= entry(stages->B, k, 6 + i, j) * planned[count * k + j];
            of->gain[i][j] = by * (j < m ? entry(stages->B, k, 6 + i, j) : entry(stages->A, k, 6 + i, MOTION + j - m));
        }
        of->missing[i] = by * missing;
    }
}

/* Write the forces of which the efforts, in proportion to their gains, give what is missing. */
static void least_squares(const lack *of, int count, const double *efforts, double *forces) {
    double gram[6][7], largest = 0;
    for (int i = 0; i < 6; i++) {
        for (int other = 0; other < 6; other++) {
            gram[i][other] = 0;
            for (int j = 0; j < count; j++) { gram[i][other] += of->gain[i][j] * of->gain[other][j] / efforts[j]; }
        }
        gram[i][6] = of->missing[i];
        largest = fmax(largest, gram[i][i]);
    }
    for (int i = 0; i < 6; i++) { gram[i][i] += fmax(ALMOST * largest, 1e-200); }
    solve_positive(gram);
    for (int i = 0; i < 6; i++) { forces[i] = gram[i][6]; }
}

void towline_aim(towline_stages stages, int cables, int moved, double length, const double *efforts, double *wanted,
                 double *planned) {
    const int m = cables, n = MOTION + 2 * moved, count = m + moved;
    lack of;
    double forces[6];
    for (int k = 0; k < stages.count; k++) {
        write_lack(&stages, k, m, moved, length, wanted, planned, &of);
        least_squares(&of, count, efforts, forces);
        for (int j = 0; j < count; j++) {
            double change = 0;
            for (int i = 0; i < 6; i++) { change += of.gain[i][j] * forces[i] / efforts[j]; }
            if (j < m) {
                planned[count * k + j] += change;
                continue;
            }
            wanted[n * k + MOTION + j - m] += change;
            if (k == stages.count - 1) { wanted[n * (k + 1) + MOTION + j - m] += change; }
        }
    }
}
