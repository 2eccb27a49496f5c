/*
 * A functional mock-up unit: the plant of a robot, its controller, or both, with all that they remember in one record.
 *
 * The record has no pointers, so that its bytes are the state of the unit. SI units; motions, references and orders are
 * laid out as in control/control.h, the state as in plant/plant.h.
 */
#ifndef TOWLINE_UNIT_H
#define TOWLINE_UNIT_H

#include "control/control.h"
#include "plant/plant.h"

enum {
    UNIT_CARRIERS = TOWLINE_MOST_CARRIERS,
    UNIT_CABLES = TOWLINE_MOST_CABLES,
    UNIT_MOTIONS = 12 * (1 + UNIT_CARRIERS),
    UNIT_STATE = TOWLINE_BODY_NUMBERS * (1 + UNIT_CARRIERS) + TOWLINE_CABLE_BLOCKS * UNIT_CABLES,
    UNIT_COMMAND = TOWLINE_PLATFORM_COMMANDS + UNIT_CABLES + TOWLINE_CARRIER_COMMANDS * UNIT_CARRIERS
};

/* Commands of the plant's cables: those of `winches`; tensions; lengths or motor forces that give the tensions. */
typedef enum { UNIT_WINCHES = 0, UNIT_TENSIONS = 1, UNIT_BY_LENGTHS = 2, UNIT_BY_FORCES = 3 } unit_cables;

/* What an importer may do, by the mode that it has brought the unit to. */
typedef enum { UNIT_INSTANTIATED = 0, UNIT_INITIALISING = 1, UNIT_STEPPING = 2, UNIT_TERMINATED = 3 } unit_mode;

typedef struct {
    char token[40]; /* of the description that belongs to it */
    int32_t mode, simulates, controls, cables;
    /* The plant. */
    towline_robot robot;
    towline_plant plant;
    double longest_step; /* of Runge-Kutta [s] */
    double winding_time; /* how long winches keep a rate or force on the way to a tension [s] */
    double mass;         /* of the platform [kg] */
    double state[UNIT_STATE], last[2 * UNIT_CABLES]; /* see towline_plant_winch_lengths */
    /* The controller, and what it knows of the robot. */
    towline_robot known;
    towline_controller controller;
    double period;                       /* where it is with its plant [s] */
    double bandwidth, damping, integral; /* of all coordinates: kp = bandwidth^2, kd = 2 damping bandwidth, ki */
    double length;                       /* brings moments to newtons [m] */
    double negligible, carried;          /* missing wrenches [N] that count as given, see `is_given` */
    double little[UNIT_CABLES];          /* tensions of cables that are taken for cut [N] */
    double box[2][UNIT_CARRIERS][3];     /* lowest and highest positions of carriers [m] */
    towline_cable_memory cable[UNIT_CABLES];
    towline_platform_memory platform;
    double A[6 * UNIT_CABLES]; /* of the last usable state */
    towline_carrier_memory carrier[UNIT_CARRIERS];
    towline_turning turning;
    double last_time; /* of its last step [s] */
    int64_t has_begun;
    double answered; /* 0: as planned, 2: soft wrench, 3: hold, as in control/controller.py */
    /* What both share. */
    double time;
    double measured[UNIT_MOTIONS], lengths[2 * UNIT_CABLES];
    double tension[UNIT_CABLES], mean_tension[UNIT_CABLES]; /* now, and in the last step [N] */
    double reference[18], carriers[18 * UNIT_CARRIERS], jerks[6 * UNIT_CARRIERS], t_ref[UNIT_CABLES];
    double ordered[18 * UNIT_CARRIERS], ordered_jerks[6 * UNIT_CARRIERS]; /* of carriers */
    double tensions[UNIT_CABLES], winches[UNIT_CABLES];                   /* ordered */
    double actuation[TOWLINE_MOST_ACTUATORS * UNIT_CARRIERS];             /* as many a carrier as any has */
    double wind[3], wrench[6];
} towline_unit;

/* A number of the record that has a value reference, which is its place among these. */
typedef struct {
    size_t place;
    enum { UNIT_READ = 0, UNIT_FINITE = 1, UNIT_ANY = 2 } set; /* not; to finite numbers; to any, as sensors without */
    double least;
} unit_variable;

/* The data of the robot, in robot.c. */
extern const towline_unit towline_unit_at_start;
extern const unit_variable towline_unit_variables[];
extern const size_t towline_unit_variable_count;

/* Write what the plant's sensors measure. */
void towline_unit_sense(towline_unit *unit);

/* Go on from `time` by `step` [s]; return 0 if a motion diverges, or time does not go on. */
int towline_unit_step(towline_unit *unit, double time, double step);

#endif
