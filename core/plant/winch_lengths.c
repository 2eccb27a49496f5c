/*
 * The unstrained lengths that winches without a model reach within a period, so that tensions are as ordered.
 *
 *     L0 + dt (dl/dt - (t L0 - E A (l - L0)) / (C L0 + E A dt))
 *
 * which is the rate v = dl/dt - dL0/dt of t = E A (l - L0) / L0 + (C + E A dt / L0) v, with the lengths at its beginning
 * and the mean of dl/dt in the period, extrapolated from the last one: with dl/dt at the beginning, a damper would pull
 * too much by C dt/2 times the acceleration, as if the platform were heavier.
 */
#include "plant/state.h"

void towline_plant_winch_lengths(const towline_robot *robot, ptrdiff_t rows, double period, const double *states,
                                 const double *lengths, const double *tensions, double *last_rates, double *commands,
                                 ptrdiff_t commands_per) {
    const ptrdiff_t m = robot->cables, size = towline_plant_state_size(robot);
    for (ptrdiff_t row = 0; row < rows; row++) {
        const double *unstrained = states + row * size + TOWLINE_BODY_NUMBERS * (1 + robot->carriers);
        double *commanded = commands + row * commands_per + TOWLINE_PLATFORM_COMMANDS;
        for (ptrdiff_t i = 0; i < m; i++) {
            const double EA = robot->cable[i].stiffness, C = robot->cable[i].damping, own = unstrained[i];
            const double rate = lengths[2 * row * m + m + i];
            const double missing = tensions[row * m + i] * own - EA * (lengths[2 * row * m + i] - own);
            double mean = 1.5 * rate - 0.5 * last_rates[row * m + i];
            last_rates[row * m + i] = rate;
            if (isnan(mean)) { /* in the first period */
                mean = rate;
            }
            commanded[i] = larger(own + period * (mean - missing / (C * own + EA * period)), SHORTEST);
        }
    }
}
