/*
 * A robot as one plain record, which models/record.py fills from a robot file. SI units; {G} is the global frame.
 *
 * A pose is x, y, z, roll, pitch, yaw with R = Rz(yaw) Ry(pitch) Rx(roll). Matrices lie row by row.
 */
#ifndef TOWLINE_ROBOT_H
#define TOWLINE_ROBOT_H

#include <stdint.h>

enum { TOWLINE_MOST_CABLES = 32, TOWLINE_MOST_CARRIERS = 8, TOWLINE_MOST_ACTUATORS = 6 };

typedef enum {
    TOWLINE_RESTS = 0,
    TOWLINE_FREE = 1,    /* moved by forces: the platform, a quadrotor */
    TOWLINE_LAGGED = 2,  /* follows its reference inside limits of speed and acceleration */
    TOWLINE_IMPOSED = 3, /* is where its reference is, whatever the forces */
} towline_motion;

typedef struct {
    double wrench[6]; /* force and moment for each unit of the command, in the body's axes, about its CoM */
    double low, high; /* limits of the command */
} towline_actuator;

/* The platform or a carrier. The frame of a carrier is at its CoM; that of the platform need not be, see `com`. */
typedef struct {
    int32_t motion, actuators;
    double mass[3], inverse_mass[3];    /* along the axes of {G}; both 0 where it cannot move */
    double inertia[9];                  /* about the CoM, in the body's axes */
    double inverse_inertia[9];          /* 0 about axes about which it cannot turn */
    double speed_max, acceleration_max; /* of a lagged carrier */
    towline_actuator actuator[TOWLINE_MOST_ACTUATORS];
} towline_body;

typedef struct {
    int32_t carrier, has_winch;
    double anchor[3];     /* in the carrier's frame */
    double attachment[3]; /* in the platform's frame */
    double axis[3];   /* swivel axis of the pulley in the carrier's frame, of unit length, as the cable comes up it */
    double radius;    /* of the pulley's sheave; 0: the anchor is a point */
    double stiffness; /* E A [N]; 0: the cable does not stretch */
    double damping;   /* [N s/m] */
    double winch_inertia; /* as the mass that the cable feels [kg] */
    double winch_friction, winch_speed_max, winch_force_max;
} towline_cable;

typedef struct {
    int32_t carriers, cables;
    int32_t printed_aero; /* 1: drag by the formula as paper F prints it, without the sign of the velocity */
    int32_t has_aero;
    double mass;
    double com[3]; /* of the platform, in its frame */
    double gravity[3];
    double drag, lift;                            /* 1/2 rho S times the coefficients */
    double freedom[6];                            /* 1 for each coordinate in which the platform moves, else 0 */
    double force_scale;                           /* newtons that matter: the weight, or what the limits permit */
    double length_scale;                          /* metres that matter */
    towline_body body[1 + TOWLINE_MOST_CARRIERS]; /* the platform, then the carriers */
    towline_cable cable[TOWLINE_MOST_CABLES];
} towline_robot;

#endif
