/*
 * What a controller is set to, and what it remembers, as plain records. SI units; {G} is the global frame.
 *
 * control/records.py has the same records as NumPy dtypes. A batch of robots is rows: each robot has a row of the
 * arrays below, with (m) cables and (c) carriers in it.
 */
#ifndef TOWLINE_CONTROLLER_H
#define TOWLINE_CONTROLLER_H

#include <stdint.h>

#include "robot.h"

typedef struct {
    double low, high; /* of a tension [N] */
    double rate;      /* with which it may change [N/s] */
} towline_limits;

/* The settings of a controller, which it keeps. */
typedef struct {
    double kp[6], kd[6], ki[6]; /* of errors, their rates and integrals, see step.c */
    double observer;            /* bandwidth of the estimated disturbance, and of forces on flying carriers [rad/s] */
    double learning;            /* bandwidth with which tensions are learned that differ from their commands [rad/s] */
    double patience;  /* how long a cable may report no tension where one is commanded until it is taken for cut [s] */
    int32_t reacts;   /* 1: carriers leave their reference to help the tensions, */
    int32_t corrects; /* 1: also to correct errors */
    int64_t lowers;   /* 1: bandwidths are lowered if the platform follows its commands too late, see step.c */
    double carrier_bandwidth, carrier_acceleration; /* of that motion [rad/s], and at most [m/s^2, rad/s^2] */
    double reach[TOWLINE_MOST_CARRIERS][6];         /* how far each coordinate may go [m, rad] */
    double place;                                   /* bandwidth with which flying carriers keep their place [rad/s] */
    double attitude;                                /* and with which they turn, unless that is too fast [rad/s] */
    double by_wrench[TOWLINE_MOST_CARRIERS][TOWLINE_MOST_ACTUATORS][6]; /* commands of actuators for units of force and
                                                                           moment in the carrier's axes */
    double lean[TOWLINE_MOST_CARRIERS]; /* largest tangent of the angle between a carrier's thrust and the vertical */
    towline_limits limits[TOWLINE_MOST_CABLES];
} towline_controller;

/* What is known of one cable; tensions in newtons. */
typedef struct {
    double measured;  /* until the state was measured, by a sensor or else as commanded */
    double last;      /* commanded last, */
    double given;     /* and what drives that lag made of it on average */
    double known;     /* what the observers know of the measured tension */
    double then;      /* commanded until the state was measured */
    double reported;  /* the measured tension, */
    double commanded; /* and the commanded one, both smoothed */
    double excess;    /* by how much the report exceeds the command in the long run */
    int64_t is_cut;   /* 1 for a cable that is taken for cut */
} towline_cable_memory;

/* How one coordinate follows orders: what is ordered, and what is measured; see lateness.c. */
typedef struct {
    double usual;            /* rate, in the mean of the last time */
    double order;            /* integral of the ordered acceleration, without what it was long ago */
    double late[2], rate[2]; /* x and r, after one low-pass filter and after two */
    double unseen[2]; /* time without a measured rate [s], and the integral of the ordered acceleration over it */
} towline_late_axis;

enum { TOWLINE_LATENESS_SUMS = 6 };

/* How late several coordinates are. Sums over recent time are of (x - r) r', (x - r) r'', r' r', r' r'', r'' r'' and
   (x - r)^2. */
typedef struct {
    double sums[TOWLINE_LATENESS_SUMS];
    double compared;   /* time since the comparison began [s] */
    int64_t has_begun; /* 1 after the first step */
} towline_lateness;

/* What is remembered of the platform's motion: forces [N] in {G}, and moments [N m] about the CoM. */
typedef struct {
    double integral[6];    /* of the error */
    double disturbance[6]; /* estimated: what acts beside cables and weight */
    double explained[6];   /* momentum less what the estimate explains */
    double unseen;         /* time without a usable state until now [s] */
    double attitude;       /* bandwidth with which flying carriers turn [rad/s] */
    int64_t integrates;    /* 1: the integral goes on */
    int64_t silent;        /* steps in which tensions were commanded and no sensor reported one; from 2 on it matters */
    towline_late_axis axis[6];
    towline_lateness lateness;
    double lag;      /* T + 2.4 C / T of step.c, if that is so long that bandwidths are lowered, else 0 [s] */
    double observer; /* bandwidth of the estimate [rad/s] */
} towline_platform_memory;

/* How a carrier turns, in its own axes: measured, or predicted while no state is measured. */
typedef struct {
    double steady[6]; /* force [N], and moment [N m] with which it turns as its reference does */
    double bent[3];   /* angular acceleration of its reference [rad/s^2] */
    double away[3];   /* e of thrusts.c [rad] */
    double rate[3];   /* rate of change of e [rad/s] */
} towline_turn;

/* What is remembered of a carrier. */
typedef struct {
    double offset[6], offset_rate[6]; /* off its reference, to help the tensions; small rotations in level axes */
    double force[3];                  /* estimated: what acts beside thrust, cables and weight, in {G} [N] */
    double explained[3];              /* momentum less what the estimate explains */
    double unseen;                    /* time without a usable state until now [s] */
    double ordered[3];                /* angular acceleration within the actuators' limits, in its own axes */
    double turning[3];                /* rate that is measured, in its own axes; nan while none is */
    double lacking;                   /* thrust that its actuators do not give, or give too much, by their limits [N] */
    double wanted[TOWLINE_MOST_ACTUATORS]; /* commands before limits, without noise */
    double limited;                        /* share of the last time in which one of these was beyond a limit */
    towline_turn turn;
} towline_carrier_memory;

/* How late the carriers of a robot turn; see turning.c. */
typedef struct {
    towline_late_axis axis[TOWLINE_MOST_CARRIERS][3];
    towline_lateness lateness;
    double lag; /* of carriers that turn too late, else 0 [s] */
} towline_turning;

enum { TOWLINE_MOST_TETHERS = 3 };

/* A carrier that one, two or three cables of fixed length hold; see tethers.h. */
typedef struct {
    int32_t carrier, cables;
    int32_t cable[TOWLINE_MOST_TETHERS]; /* which ones */
    double length[TOWLINE_MOST_TETHERS];
    double at_home[3]; /* its coordinates at home */
    double farthest;   /* how far those that are free may be from zero */
    double axes[3][3]; /* e1, e2, e3, a row each */
} towline_tether;

#endif
