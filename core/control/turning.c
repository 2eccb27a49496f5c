/*
 * How late flying carriers turn after their commanded angular accelerations, see lateness.c.
 *
 * A critically damped attitude loop, C phi'''' + T phi''' + phi'' + 2 h phi' + h^2 phi = 0, is stable for
 *
 *     h (T + 4 C / T) < 2
 *
 * (Routh): h tau < 2 for a lag alone, h D < 2/3 for a delay alone, where 0.647 is exact.
 *
 * The lag that is returned is the larger one of T and (T + 4 C / T) / 1.5, so that a loop with the inverse of it as its
 * bandwidth has the margins of control/bandwidths.py: 2 to where a lag makes it unstable, 1.5 or less for a delay.
 */
#include <string.h>

#include "control/internal.h"

static const double LATE = 1.5;   /* over the bandwidth: a lag of 2 is where the loop gets unstable, */
static const double UNSTABLE = 2; /* over the bandwidth, of T + 4 C / T, of which C is known less well */
static const double MARGIN = 1.5; /* of a delay */
static const double SEEN = 0.006; /* [rad]: what the lag makes of a carrier's attitude until it is believed */

void towline_measure_turning(const towline_robot *robot, double bandwidth, double dt, const double ordered[][3],
                             const towline_carrier_memory *carriers, towline_turning *it) {
    double measured[TOWLINE_MOST_CARRIERS][3];
    for (int c = 0; c < robot->carriers; c++) { memcpy(measured[c], carriers[c].turning, sizeof measured[c]); }
    const double least = SEEN * TOWLINE_LATE_WINDOW * bandwidth * bandwidth / LATE;
    const towline_lag lag = towline_measure_lag(bandwidth, dt, 3 * robot->carriers, ordered[0], measured[0], least,
                                                it->axis[0], &it->lateness);
    const double late = lag.first + 4 * lag.second;
    const int too_late = lag.first * bandwidth > LATE || late * bandwidth > UNSTABLE;
    it->lag = too_late ? fmax(lag.first, late / MARGIN) : 0;
}
