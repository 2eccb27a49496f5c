/*
 * How late flying carriers turn after their commanded angular accelerations.
 *
 * Let r be the angular rate and x the integral of the commanded acceleration, both without their slow parts (a
 * high-pass filter with the time constant 2 / h, h the bandwidth of the attitude loop). A first-order lag tau of rotors
 * and a delay D of the measurement give, to second order in time,
 *
 *     x = r + T dr/dt + C d2r/dt2,     T = tau + D,  C = tau D + D^2 / 2
 *
 * so that a critically damped attitude loop, C phi'''' + T phi''' + phi'' + 2 h phi' + h^2 phi = 0, is stable for
 *
 *     h (T + 4 C / T) < 2
 *
 * (Routh): h tau < 2 for a lag alone, h D < 2/3 for a delay alone, where 0.647 is exact. T and C are those of least
 * squares over all carriers and axes of a robot, and recent time. Low-pass filters with the time constant 1 / h,
 * applied twice to x and r first, give the derivatives, and remove vibrations.
 *
 * T and C are believed if they explain nine tenths of the squares of x - r: moments that nobody ordered, or rotors
 * that were not at rest when the comparison began, can look like a long lag. With the three axes of one carrier, and two
 * independent values of each (a memory of 8 / h, and filters that correlate values over 4 / h), this is an F-test at the
 * level of 1 %: 18.0 for 2 and 4 degrees of freedom. In less than 4 / h there are no two independent values.
 *
 * An oscillation of frequency w shows a delay as T = sin(w D) / w and C = (1 - cos(w D)) / w^2. So C / T^2 is between
 * 1/2, of a slow one, and 1 / (1 + cos(w D)) = 0.81 at h D = 0.647, where w = 2.06 h.
 *
 * The lag that is returned is the larger one of T and (T + 4 C / T) / 1.5, so that a loop with the inverse of it as its
 * bandwidth has the margins of control/bandwidths.py: 2 to where a lag makes it unstable, 1.5 or less for a delay.
 */
#include <string.h>

#include "control/internal.h"

static const double LATE = 1.5;      /* over the bandwidth: a lag of 2 is where the loop gets unstable, */
static const double UNSTABLE = 2;    /* over the bandwidth, of T + 4 C / T, of which C is known less well */
static const double MARGIN = 1.5;    /* of a delay */
static const double MOST = 0.81;     /* C / T^2 of a delay with which the loop is just unstable */
static const double WINDOW = 2;      /* over the bandwidth: in which orders and rates are compared */
static const double MEMORY = 4;      /* windows that count, so that what is small after a turn changes nothing */
static const double FASTEST = 1e4;   /* [rad/s]: nothing turns faster */
static const double SEEN = 0.006;    /* [rad]: what the lag makes of a carrier's attitude until it is believed */
static const double EXPLAINED = 0.9; /* of the squares of x - r */
static const double SOME = 2;        /* windows that sums are of until they are believed */
static const double ALIKE = 1e-3;    /* of the product of their squares: derivatives that cannot be told apart */

enum { SUMS = TOWLINE_TURNING_SUMS };

/*
 * Add one axis to the integrals. What is ordered until a rate is measured counts as one longer step. The comparison
 * starts again after a window without a rate, and where a number is none.
 */
static void follow(double bandwidth, double step, double ordered, double rate, towline_turning_axis *it, double *sums) {
    it->unseen[0] += step;
    it->unseen[1] += step * ordered;
    if (!isfinite(rate)) { return; }
    const double dt = it->unseen[0], turned = it->unseen[1];
    it->unseen[0] = it->unseen[1] = 0;
    if (dt * bandwidth > WINDOW) {
        *it = (towline_turning_axis){.usual = rate};
        return;
    }
    const double share = 1 - exp(-bandwidth * dt), slow = dt * bandwidth / WINDOW, per = dt > 0 ? share / dt : 0;
    it->order += turned - slow * it->order;
    it->usual += slow * (rate - it->usual);
    const double change = rate - it->usual - it->rate[0], change_of_late = it->rate[0] - it->rate[1];
    const double before = it->late[1] - it->rate[1];
    it->late[1] += share * (it->late[0] - it->late[1]);
    it->rate[1] += share * change_of_late;
    it->late[0] += share * (it->order - it->late[0]);
    it->rate[0] += share * change;
    if (!isfinite(it->late[0] + it->rate[0])) {
        *it = (towline_turning_axis){.usual = rate};
        return;
    }
    const double first = per * change_of_late, second = per * per * (change - change_of_late);
    const double off = (before + it->late[1] - it->rate[1]) / 2; /* when the derivatives are these */
    const double products[] = {off * first, off * second, first * first, first * second, second * second, off * off};
    for (int k = 0; k < SUMS; k++) { sums[k] += dt * products[k]; }
}

/* Return T + 4 C / T of sums, 0 if it is not positive or not believed, and write T. */
static double lateness(const double *sums, double *T) {
    const double size = sums[2] * sums[4] - sums[3] * sums[3];
    double C = 0;
    *T = sums[0] / sums[2];
    if (size > ALIKE * sums[2] * sums[4]) {
        *T = (sums[0] * sums[4] - sums[1] * sums[3]) / size;
        C = (sums[1] * sums[2] - sums[0] * sums[3]) / size;
    }
    return *T > 0 && *T * sums[0] + C * sums[1] > EXPLAINED * sums[5] ? *T + 4 * fmin(fmax(C / *T, 0), MOST * *T) : 0;
}

void towline_measure_lag(const towline_robot *robot, double bandwidth, double dt, const double ordered[][3],
                         const towline_carrier_memory *carriers, towline_turning *it) {
    const double window = WINDOW / bandwidth;
    const int again = !it->has_begun || dt > window;
    double now[SUMS] = {0};
    if (again) {
        memset(it, 0, sizeof *it);
        it->has_begun = 1;
    }
    for (int c = 0; c < robot->carriers; c++) {
        for (int k = 0; k < 3; k++) {
            const double measured = carriers[c].turning[k], rate = fabs(measured) <= FASTEST ? measured : NAN;
            towline_turning_axis *axis = &it->axis[c][k];
            if (again) {
                axis->usual = rate;
            } else {
                follow(bandwidth, dt, ordered[c][k], rate, axis, now);
            }
        }
    }
    if (!again) {
        for (int k = 0; k < SUMS; k++) { it->sums[k] += (now[k] - dt * it->sums[k] / MEMORY) / window; }
    }
    it->compared += dt;
    const double rate = SEEN * WINDOW * bandwidth * bandwidth / LATE;
    double T = 0;
    const int known = it->compared > SOME * window && it->sums[2] > rate * rate;
    const double late = known ? lateness(it->sums, &T) : 0;
    const int too_late = late > 0 && (T * bandwidth > LATE || late * bandwidth > UNSTABLE);
    it->lag = too_late ? fmax(T, late / MARGIN) : 0;
}
