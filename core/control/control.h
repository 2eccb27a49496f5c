/*
 * The step of a controller: the problem of tension distribution that it solves, the commands of flying carriers, and
 * the stages of predictive control. No allocation, no globals; every number is accepted, NaN too.
 */
#ifndef TOWLINE_CONTROL_H
#define TOWLINE_CONTROL_H

#include <stddef.h>

#include "control/controller.h"

/*
 * Motions are poses and velocities (12), the platform's first and then one for each carrier; orders to carriers are
 * (c, 3, 6): pose, velocity and acceleration.
 */
typedef struct {
    const double *measured;  /* (1 + c, 12), now */
    const double *late;      /* the same when it was measured, which observers compare; NULL: now */
    const double *reference; /* (18), pose, velocity and acceleration of the platform */
    const double *t_ref;     /* (m), tensions to stay near [N] */
    double *carriers;        /* (c, 3, 6), the reference, and what is ordered afterwards; NULL: they follow it */
    towline_cable_memory *cables;
    towline_platform_memory *platform;
    towline_carrier_memory *carrier_memory; /* NULL if they follow their reference */
    double *A;                              /* (6, m): the problem's wrench matrix, kept between steps, */
    double *w;                              /* (6): wrench, */
    double *low, *high;                     /* (m): and bounds of tensions */
} towline_row;

/*
 * Update the memory of a row, and write the problem of this step, `dt` after the last one and `since` after the last
 * state was measured [s]; both 0 in the first step, which starts the memory and has no bounds by rates.
 *
 * A row with a number that is not finite or beyond any sensor keeps its memory and gets a wrench of nan.
 */
void towline_write_problem(const towline_robot *robot, const towline_controller *controller, double dt, double since,
                           towline_row row);

/* What flying carriers are ordered, and what they are known to do. */
typedef struct {
    const double *measured; /* (1 + c, 12) */
    const double *carriers; /* (c, 3, 6), how they should move */
    const double *tensions; /* (m), commanded [N] */
    const towline_cable_memory *cables;
    towline_platform_memory *platform;
    towline_carrier_memory *memory;
    towline_turning *turning; /* NULL: whether they turn too late is not of interest */
    double *actuation; /* (c, a), commands of the last step and then of this one; a: as many as any carrier has */
} towline_flight;

/*
 * Write the commands of all actuators inside their limits; if the state is missing, those with which carriers finish their
 * turn. Carriers that turn too late turn more slowly from the next step on. Return the most that the thrust of a carrier
 * lacks [N].
 */
double towline_write_thrusts(const towline_robot *robot, const towline_controller *controller, double dt,
                             towline_flight flight);

/* Return how many actuators the carrier with the most has. */
int towline_most_actuators(const towline_robot *robot);

/* What was commanded in each of some parts of a time, so many numbers apart from part to part. */
typedef struct {
    const double *tensions; /* (m) [N] */
    ptrdiff_t per_tensions;
    const double *actuation; /* (c, a), as in `towline_flight`; zeros, or NULL: of no carrier, or not known */
    ptrdiff_t per_actuation;
    const double *accelerations; /* (c, 6), of all parts, of carriers whose actuation is none */
} towline_commanded;

/*
 * Move a measured motion (1 + c, 12) on by `dt` [s], `parts` times, with a disturbance (6): platform and flying carriers
 * by their equations, other carriers by constant accelerations.
 */
void towline_move_on(const towline_robot *robot, double dt, int parts, towline_commanded commanded,
                     const double *disturbance, double *motion);

/* Coordinates of carriers that a predictive controller moves: some of their poses, or those that tethers leave. */
typedef struct {
    int freed;                  /* coordinates of poses, */
    const int64_t *coordinates; /* (freed, 2): carrier and coordinate of each */
    int tethered;               /* carriers */
    const towline_tether *tethers;
} towline_moved;

/* How many coordinates those are. */
int towline_moved_count(towline_moved moved);

/* The rows of a matrix for each stage, with steps of so many numbers from stage to stage and from row to row. */
typedef struct {
    double *at;
    ptrdiff_t stage, row;
} towline_matrices;

/* The dynamics of N stages, x' = A x + B u + c with n states and u controls. */
typedef struct {
    int count;           /* N */
    const double *steps; /* (N), how long each stage lasts [s] */
    towline_matrices A;  /* (n, n) */
    towline_matrices B;  /* (n, u) */
    towline_matrices c;  /* (n), its row is 1 */
} towline_stages;

/*
 * Write the dynamics to first order about states (N, n) and controls (N, u), with a disturbance (6) on the platform and
 * carriers that move as (N, c, 12) where they do not leave their reference; see stages.c.
 */
void towline_write_stages(const towline_robot *robot, towline_moved moved, const double *disturbance,
                          const double *carriers, const double *states, const double *controls, towline_stages stages);

/*
 * Change tensions and moved places of a reference, states (N + 1, n) and controls (N + 1, u), so that the platform's
 * rate obeys the dynamics of all stages; `efforts` (u) is what squares of changes cost, `length` [m] the robot's.
 */
void towline_aim(towline_stages stages, int cables, int moved, double length, const double *efforts, double *wanted,
                 double *planned);

/* Write the coordinates that tethers leave carriers as these move, (1 + c, 3, 6), and two derivatives: (3, f). */
void towline_tethered_coordinates(const towline_robot *robot, int count, const towline_tether *tethers,
                                  const double *motions, double *coordinates);

/*
 * Write the motion of carriers, (c, 3, 6), from that of the platform and the coordinates, (3, 6 + f). Attitudes are read,
 * and stay.
 */
void towline_tethered_carriers(const towline_robot *robot, int count, const towline_tether *tethers,
                               const double *motion, double *carriers);

#endif
