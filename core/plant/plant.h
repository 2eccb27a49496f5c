/*
 * The simulation of a robot, step by step: the response of platform, carriers and cables to commands and wind.
 *
 * A state is one array, and a plant keeps no other memory. It has 13 for each body, the platform first: position
 * [m] (of the platform's CoM, of a carrier's frame), quaternion (w, x, y, z), velocity in {G} [m/s], rate in the body's
 * own axes [rad/s]. Then it has for all cables the unstrained lengths [m] (tensions [N] where these are commanded),
 * their rates, the lengths last commanded, and the conditions.
 *
 * A command is a row too: whether there is air, its velocity in {G} (3), force and moment about the CoM on the platform
 * (6), a number for each cable, and 30 for each carrier: commands of its actuators (6), force and moment about the CoM
 * on it (6), and pose, velocity and acceleration of its reference (6 each) as the command begins.
 */
#ifndef TOWLINE_PLANT_H
#define TOWLINE_PLANT_H

#include <stddef.h>
#include <stdint.h>

#include "robot.h"

enum {
    TOWLINE_BODY_NUMBERS = 13,
    TOWLINE_CABLE_BLOCKS = 4,
    TOWLINE_PLATFORM_COMMANDS = 10,
    TOWLINE_CARRIER_REFERENCE = 12, /* where it begins among the commands of a carrier */
    TOWLINE_CARRIER_COMMANDS = 30
};

/* What the cables are commanded. */
typedef enum { TOWLINE_LENGTHS = 0, TOWLINE_RATES = 1, TOWLINE_FORCES = 2, TOWLINE_TENSIONS = 3 } towline_drive;

/* The condition of a cable: its winch works, is stuck, or the cable is cut. */
typedef enum { TOWLINE_WORKS = 0, TOWLINE_STUCK = 1, TOWLINE_CUT = 2 } towline_condition;

typedef struct {
    int32_t drive;   /* a `towline_drive` */
    int32_t located; /* 1: steps end where a contact changes; 0: Runge-Kutta over the kinks, for elastic cables alone */
    double carrier_bandwidth, winch_bandwidth; /* of the servo loops [rad/s] */
    double tension_lag;                        /* time constant of commanded tensions [s]; 0: none */
} towline_plant;

typedef struct {
    ptrdiff_t rows;     /* states, each with commands of its own */
    ptrdiff_t commands; /* of a row: `steps`, or one more, which says where carriers move in the last step */
    ptrdiff_t steps;    /* commands that are held for a period each */
    ptrdiff_t keep;     /* every so manieth state is written to the history */
    int32_t substeps;   /* Runge-Kutta steps in a period */
    double period;      /* [s] */
} towline_run;

/* How many numbers a state and a command have. */
ptrdiff_t towline_plant_state_size(const towline_robot *robot);
ptrdiff_t towline_plant_command_size(const towline_robot *robot);

/*
 * Run each row. The history (rows, 1 + steps / keep, state) gets every state of which the number is a multiple of
 * `keep`, after the impacts of the command that begins there, and `tensions` (.., m) those there under that command
 * [N]; at the end, the state that the last command leaves and the tensions under it. `means` (rows, m) gets the mean
 * tensions of all steps, with which the momentum of each body changes; it may be NULL.
 */
void towline_plant_run(const towline_robot *robot, const towline_plant *plant, const towline_run *run,
                       const double *states, const double *commands, double *history, double *tensions, double *means);

/*
 * What perfect sensors measure of states: `motions` (rows, 1 + carriers, 12), pose and its time derivative of platform
 * frame and carriers, and `lengths` (rows, 2, m), distances along the cables and their rates. At a pitch of 90 degrees
 * the derivatives of roll and yaw are nan.
 */
void towline_plant_sense(const towline_robot *robot, ptrdiff_t rows, const double *states, double *motions,
                         double *lengths);

/*
 * The unstrained lengths that winches without a model reach within a period, so that tensions are as ordered; see
 * winch_lengths.c. All arrays are rows of m numbers, but `states`, whole states, `lengths`, rows of 2 m as from
 * `towline_plant_sense`, and `commands`, `commands_per` numbers from one row's command to the next, of which those of
 * the cables are written. `last`, rows of 2 m numbers, has the lengths that cables would have now at the rates of one
 * period before, and how long this one lasted [s], nan if there was none; it gets those of the period that begins.
 */
void towline_plant_winch_lengths(const towline_robot *robot, ptrdiff_t rows, double period, const double *states,
                                 const double *lengths, const double *tensions, double *last, double *commands,
                                 ptrdiff_t commands_per);

/*
 * The forces with which the motors of winches give the commanded tensions, see winch_forces.h: they replace these in
 * `commands`, (rows, commands_of_row, command), of which the first of each row is held for `period` [s].
 */
void towline_plant_winch_forces(const towline_robot *robot, const towline_plant *plant_settings, ptrdiff_t rows,
                                ptrdiff_t commands_of_row, double period, const double *states, double *commands);

#endif
