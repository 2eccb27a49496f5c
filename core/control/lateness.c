/*
 * How late motions follow what is ordered: attitudes of carriers (turning.c), or the platform (step.c).
 *
 * Let r be a measured rate and x the integral of the ordered acceleration, both without their slow parts (a high-pass
 * filter with the time constant 2 / h, h a bandwidth of the loop). A first-order lag tau of drives and a delay D of the
 * measurement give, to second order in time,
 *
 *     x = r + T dr/dt + C d2r/dt2,     T = tau + D,  C = tau D + D^2 / 2
 *
 * T and C are those of least squares over all axes of a robot, and recent time. Low-pass filters with the time constant
 * 1 / h, applied twice to x and r first, give the derivatives, and remove vibrations.
 *
 * T and C are believed if they explain nine tenths of the squares of x - r: forces that nobody ordered, or drives
 * that were not at rest when the comparison began, can look like a long lag. With three axes, and two independent
 * values of each (a memory of 8 / h, and filters that correlate values over 4 / h), this is an F-test at the level of
 * 1 %: 18.0 for 2 and 4 degrees of freedom. In less than 4 / h there are no two independent values.
 *
 * An oscillation of frequency w shows a delay as T = sin(w D) / w and C = (1 - cos(w D)) / w^2. So C / T^2 is between
 * 1/2, of a slow one, and 1 / (1 + cos(w D)) = 0.81 at h D = 0.647, where w = 2.06 h.
 */
#include <string.h>

#include "control/internal.h"

static const double MOST = 0.81;     /* C / T^2 of a delay with which an attitude loop is just unstable */
static const double MEMORY = 4;      /* windows that count, so that what is small after a turn changes nothing */
static const double FASTEST = 1e4;   /* [rad/s, m/s]: nothing turns or moves faster */
static const double EXPLAINED = 0.9; /* of the squares of x - r */
static const double SOME = 2;        /* windows that sums are of until they are believed */
static const double ALIKE = 1e-3;    /* of the product of their squares: derivatives that cannot be told apart */

enum { SUMS = TOWLINE_LATENESS_SUMS };

/*
 * Add one axis to the integrals. What is ordered until a rate is measured counts as one longer step. The comparison
 * starts again after a window without a rate, and where a number is none.
 */
static void follow(double bandwidth, double step, double ordered, double rate, towline_late_axis *it, double *sums) {
    it->unseen[0] += step;
    it->unseen[1] += step * ordered;
    if (!isfinite(rate)) { return; }
    const double dt = it->unseen[0], turned = it->unseen[1];
    it->unseen[0] = it->unseen[1] = 0;
    if (dt * bandwidth > TOWLINE_LATE_WINDOW) {
        *it = (towline_late_axis){.usual = rate};
        return;
    }
    const double share = 1 - exp(-bandwidth * dt), slow = dt * bandwidth / TOWLINE_LATE_WINDOW;
    const double per = dt > 0 ? share / dt : 0;
    it->order += turned - slow * it->order;
    it->usual += slow * (rate - it->usual);
    const double change = rate - it->usual - it->rate[0], change_of_late = it->rate[0] - it->rate[1];
    const double before = it->late[1] - it->rate[1];
    it->late[1] += share * (it->late[0] - it->late[1]);
    it->rate[1] += share * change_of_late;
    it->late[0] += share * (it->order - it->late[0]);
    it->rate[0] += share * change;
    if (!isfinite(it->late[0] + it->rate[0])) {
        *it = (towline_late_axis){.usual = rate};
        return;
    }
    const double first = per * change_of_late, second = per * per * (change - change_of_late);
    const double off = (before + it->late[1] - it->rate[1]) / 2; /* when the derivatives are these */
    const double products[] = {off * first, off * second, first * first, first * second, second * second, off * off};
    for (int k = 0; k < SUMS; k++) { sums[k] += dt * products[k]; }
}

towline_lag towline_measure_lag(double bandwidth, double dt, int count, const double *ordered, const double *measured,
                                double least, towline_late_axis *axes, towline_lateness *it) {
    const double window = TOWLINE_LATE_WINDOW / bandwidth;
    const int again = !it->has_begun || dt > window;
    double now[SUMS] = {0};
    for (int k = 0; k < count; k++) {
        const double rate = fabs(measured[k]) <= FASTEST ? measured[k] : NAN;
        if (again) {
            axes[k] = (towline_late_axis){.usual = rate};
        } else {
            follow(bandwidth, dt, ordered[k], rate, &axes[k], now);
        }
    }
    if (again) { *it = (towline_lateness){.has_begun = 1}; }
    double *sums = it->sums;
    for (int k = 0; k < SUMS && !again; k++) { sums[k] += (now[k] - dt * sums[k] / MEMORY) / window; }
    it->compared += dt;
    towline_lag lag = {0};
    if (!(it->compared > SOME * window && sums[2] > least * least)) { return lag; }
    const double size = sums[2] * sums[4] - sums[3] * sums[3];
    double T = sums[0] / sums[2], C = 0;
    if (size > ALIKE * sums[2] * sums[4]) {
        T = (sums[0] * sums[4] - sums[1] * sums[3]) / size;
        C = (sums[1] * sums[2] - sums[0] * sums[3]) / size;
    }
    if (T > 0 && T * sums[0] + C * sums[1] > EXPLAINED * sums[5]) {
        lag = (towline_lag){T, fmin(fmax(C / T, 0), MOST * T)};
    }
    return lag;
}
