/*
 * The unstrained lengths that winches without a model reach within a period, so that mean tensions are as ordered.
 *
 *     L0 + dt (mean - (t L0 - E A (l - L0 - dt (mean - dl/dt) / 6)) / (C L0 + E A dt))
 *
 * which is the rate v = mean - dL0/dt of t = E A (l - L0 - ...) / L0 + (C + E A dt / L0) v, with the lengths at its
 * beginning and the mean of dl/dt in the period. The mean differs from dl/dt at the beginning as it did in the last
 * period, in proportion to their durations: with dl/dt at the beginning, a damper would pull too much by about C dt/2
 * times the acceleration, as if the platform were heavier. In a period as long as dampers take to slow the platform,
 * dl/dt changes most at the beginning. The elongation is a parabola, whose mean is below that of its ends by dt^2/12
 * times the acceleration.
 */
#include "plant/state.h"

static const double LEAST_SHARE = 0.1; /* of a period, that the last one lasted: in less the lengths hardly change */

void towline_plant_winch_lengths(const towline_robot *robot, ptrdiff_t rows, double period, const double *states,
                                 const double *lengths, const double *tensions, double *last, double *commands,
                                 ptrdiff_t commands_per) {
    const ptrdiff_t m = robot->cables, size = towline_plant_state_size(robot);
    for (ptrdiff_t row = 0; row < rows; row++) {
        const double *unstrained = states + row * size + TOWLINE_BODY_NUMBERS * (1 + robot->carriers);
        double *commanded = commands + row * commands_per + TOWLINE_PLATFORM_COMMANDS;
        for (ptrdiff_t i = 0; i < m; i++) {
            const double EA = robot->cable[i].stiffness, C = robot->cable[i].damping, own = unstrained[i];
            double *evenly = last + 2 * row * m + i, *lasted = evenly + m;
            const double length = lengths[2 * row * m + i], rate = lengths[2 * row * m + m + i];
            double mean = rate + (length - *evenly) / *lasted * (period / *lasted);
            if (!(*lasted >= LEAST_SHARE * period)) { /* or in the first period */
                mean = rate;
            }
            *evenly = length + period * rate, *lasted = period;
            const double bend = period * (mean - rate) / 6;
            const double missing = tensions[row * m + i] * own - EA * (length - own - bend);
            commanded[i] = larger(own + period * (mean - missing / (C * own + EA * period)), SHORTEST);
        }
    }
}
