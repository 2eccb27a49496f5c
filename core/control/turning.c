/*
 * How late flying carriers turn after their commanded angular accelerations.
 *
 * With rotors that follow their commands with a lag tau, a critically damped attitude loop of bandwidth h,
 *
 *     tau phi''' + phi'' + 2 h phi' + h^2 phi = 0,
 *
 * is stable for h tau < 2 (Routh). Let r be the angular rate and x the integral of the commanded acceleration, both
 * without their slow parts (a high-pass filter with the time constant 2 / h). They obey tau dr/dt = x - r. A delay D
 * looks like a lag of at most D. So
 *
 *     tau = <x - r, dr/dt> / <dr/dt, dr/dt>
 *
 * over all carriers and axes of a robot. A low-pass filter with the time constant 1 / h, applied to x and r first,
 * gives the derivative dr/dt, and removes vibrations.
 */
#include <string.h>

#include "control/internal.h"

static const double LATE = 1.5;    /* over the bandwidth: a lag of 2 is where the loop gets unstable */
static const double WINDOW = 2;    /* over the bandwidth: in which orders and rates are compared */
static const double FASTEST = 1e4; /* [rad/s]: nothing turns faster */
static const double SEEN = 0.01;   /* [rad]: what the lag makes of a carrier's attitude until it is believed */

/* Update one axis, whose comparison starts again where a number is none, and return dr/dt. */
static double follow(double bandwidth, double dt, double order, double rate, towline_turning_axis *it) {
    const double share = 1 - exp(-bandwidth * dt), slow = dt * bandwidth / WINDOW;
    it->order += dt * order - slow * it->order;
    it->usual += slow * (rate - it->usual);
    const double change = rate - it->usual - it->late_rate;
    it->late_order += share * (it->order - it->late_order);
    it->late_rate += share * change;
    if (!isfinite(it->late_order + it->late_rate)) {
        *it = (towline_turning_axis){.usual = rate};
        return 0;
    }
    return bandwidth * change;
}

void towline_measure_lag(const towline_robot *robot, double bandwidth, double dt, const double ordered[][3],
                         const towline_carrier_memory *carriers, towline_turning *it) {
    const double window = WINDOW / bandwidth;
    const int again = !it->has_begun || dt > window;
    double along = 0, square = 0;
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
                const double change = follow(bandwidth, dt, ordered[c][k], rate, axis);
                along += (axis->late_order - axis->late_rate) * change;
                square += change * change;
            }
        }
    }
    const double slow = dt / window, late = LATE / bandwidth, rate = SEEN * WINDOW * bandwidth / late;
    if (!again) {
        it->along += slow * (along - it->along);
        it->square += slow * (square - it->square);
    }
    it->lag = it->along > late * it->square && it->square > rate * rate ? it->along / it->square : 0;
}
