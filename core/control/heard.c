/*
 * What the tension sensors show: which cables are cut, the tensions for the observers, and the bounds of the next ones.
 *
 * A cable is treated as cut once its filtered reading is less than the share LITTLE of its filtered command. If the
 * sensor reads zero, this takes the time `patience`. The cable is used again once its sensor reads the share ENOUGH of
 * the small tension that is commanded to cut cables.
 *
 * If no sensor reads a tension, the sensors are treated as failed rather than all cables as cut, because without cables
 * nothing could be controlled: the commands replace the readings.
 */
#include "control/internal.h"
#include "control/usable.h"

static const double LITTLE = 0.1, ENOUGH = 0.5;
static const double MINUS_LOG_LITTLE = 2.302585092994046;
static const double SOMETHING = 1e-3;     /* of its upper limit: what a cable must be commanded to be taken for cut */
static const double LONGEST_SHARE = 0.25; /* a step after a long pause is no more than one report */

/* Update what is heard of a cable, with the time since the last step in units of the patience. */
static void hear(double elapsed, double little, double highest, towline_cable_memory *cable) {
    const double share = fmin(MINUS_LOG_LITTLE * elapsed, LONGEST_SHARE);
    if (elapsed > 0 && cable->commanded == 0) {
        cable->reported = cable->commanded = cable->then; /* it is taken to pull when it is commanded first */
    }
    cable->reported += share * (cable->measured - cable->reported);
    if (cable->is_cut) {
        if (cable->reported >= ENOUGH * little) { cable->is_cut = 0, cable->commanded = cable->reported; }
        return;
    }
    cable->commanded += share * (cable->then - cable->commanded);
    if (cable->commanded >= SOMETHING * highest && cable->reported <= LITTLE * cable->commanded) {
        cable->is_cut = 1, cable->reported = 0;
    }
}

/*
 * Update what the observers know of a cable's tension: the report without its excess over the command.
 *
 * They so follow a winch that is late, and find the force that a winch or a sensor takes away all the time. With the
 * report as it is they would take this force for explained, and nothing would make up for it.
 */
static void learn(double share, towline_cable_memory *cable) {
    const double excess = cable->measured - cable->then;
    cable->excess = cable->is_cut ? 0 : cable->excess + fmin(share, 1) * (excess - cable->excess);
    cable->known = cable->measured - cable->excess;
}

/* Return whether tensions are commanded and no sensor reports one. */
static int are_silent(const towline_robot *robot, const towline_controller *controller,
                      const towline_cable_memory *cables) {
    int commanded = 0;
    for (int i = 0; i < robot->cables; i++) {
        const towline_cable_memory *cable = &cables[i];
        if (!(cable->measured <= LITTLE * fmax(cable->then, 0))) { return 0; /* also where a report is no number */ }
        commanded |= cable->then >= SOMETHING * controller->limits[i].high;
    }
    return commanded;
}

int towline_write_bounds(const towline_robot *robot, const towline_controller *controller, double dt,
                         towline_cable_memory *cables, double *low, double *high) {
    const int silent = are_silent(robot, controller, cables);
    for (int i = 0; silent && i < robot->cables; i++) { cables[i].measured = cables[i].then; }
    for (int i = 0; i < robot->cables; i++) {
        const towline_limits *limits = &controller->limits[i];
        towline_cable_memory *cable = &cables[i];
        if (are_numbers(&cable->measured, 1)) {
            const double little = fmax(limits->low, SOMETHING * limits->high);
            hear(dt / controller->patience, little, limits->high, cable);
            learn(controller->learning * dt, cable);
        }
        low[i] = limits->low, high[i] = limits->high;
        if (cable->is_cut) {
            low[i] = high[i] = 0;
        } else if (dt > 0) {
            const double step = limits->rate * dt;
            low[i] = fmin(fmax(limits->low, cable->last - step), limits->high);
            high[i] = fmax(fmin(limits->high, cable->last + step), limits->low);
        }
    }
    return silent;
}
