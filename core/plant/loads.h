/* The forces and moments on free bodies, in {G} and about their CoMs. */
#ifndef TOWLINE_PLANT_LOADS_H
#define TOWLINE_PLANT_LOADS_H

#include "plant/state.h"

/* Add the actuators of each carrier up, inside their limits, in its axes. */
static void set_thrusts(plant *p, const carrier_command *command) {
    for (int k = 0; k < p->robot->carriers; k++) {
        const towline_body *body = &p->robot->body[1 + k];
        memset(p->thrust[k], 0, sizeof p->thrust[k]);
        for (int a = 0; a < TOWLINE_MOST_ACTUATORS; a++) {
            const towline_actuator *actuator = &body->actuator[a];
            const double value = between(actuator->low, command[k].actuation[a], actuator->high);
            for (int i = 0; i < 6; i++) { p->thrust[k][i] += value * actuator->wrench[i]; }
        }
    }
}

static void add_air(const plant *p, const double *velocity, double *force) {
    const towline_robot *robot = p->robot;
    const double x = p->on_platform->wind[0] - velocity[0], y = p->on_platform->wind[1] - velocity[1];
    force[0] += robot->drag * (x * (robot->printed_aero ? x : fabs(x)));
    force[1] += robot->drag * (y * (robot->printed_aero ? y : fabs(y)));
    force[2] += robot->lift * (x * x + y * y);
}

/* Write what acts beside cables: gravity, actuators, air and disturbance. */
static void load_bodies(plant *p, const motion *now) {
    const towline_robot *robot = p->robot;
    for (int b = 0; b < p->bodies; b++) {
        body_now *on = &p->body[b];
        if (!is_free(p, b)) { continue; }
        const double *wrench = b > 0 ? p->on_carriers[b - 1].wrench : p->on_platform->wrench;
        memcpy(on->force, wrench, sizeof on->force);
        memcpy(on->moment, wrench + 3, sizeof on->moment);
        if (b > 0) {
            double force[3], moment[3];
            turn(on->R, p->thrust[b - 1], force);
            turn(on->R, p->thrust[b - 1] + 3, moment);
            for (int i = 0; i < 3; i++) {
                on->force[i] += force[i];
                on->moment[i] += moment[i];
            }
        }
        for (int i = 0; i < 3; i++) { on->force[i] += robot->body[b].mass[i] * robot->gravity[i]; }
    }
    if (p->on_platform->air != 0) { add_air(p, now->body[0].velocity, p->body[0].force); }
}

/* Add the pull of the cables that are chosen, 1, or of all (NULL), to the bodies that feel it. */
static void pull_bodies(plant *p, const int *chosen) {
    body_now *platform = &p->body[0];
    for (int i = 0; i < p->cables; i++) {
        const cable_now *on = &p->cable[i];
        double pull[3], moment[3];
        if (on->tension == 0 || (chosen && !chosen[i])) { continue; }
        for (int j = 0; j < 3; j++) { pull[j] = on->tension * on->pull[j]; }
        cross(on->arm, pull, moment);
        for (int j = 0; j < 3; j++) {
            platform->force[j] += pull[j];
            platform->moment[j] += moment[j];
        }
        if (is_free(p, owner_of(p, i))) {
            body_now *carrier = &p->body[owner_of(p, i)];
            cross(on->carrier_arm, pull, moment);
            for (int j = 0; j < 3; j++) {
                carrier->force[j] -= pull[j];
                carrier->moment[j] -= moment[j];
            }
        }
    }
}

#endif
