/* What the files of the plant share: the motion that is integrated, and what is computed from it. */
#ifndef TOWLINE_PLANT_STATE_H
#define TOWLINE_PLANT_STATE_H

#include "numbers/one.h"
#include "plant/plant.h"
/* These need `num`. */
#include "mechanics/attitude.h"

enum { CABLES = TOWLINE_MOST_CABLES, CARRIERS = TOWLINE_MOST_CARRIERS, BODIES = 1 + CARRIERS };

/* Motion of a body, or its time derivative; see plant.h for frames. */
typedef struct {
    double position[3], quaternion[4], velocity[3], rate[3];
} body_motion;

/* What is integrated, or its time derivative. */
typedef struct {
    body_motion body[BODIES]; /* the platform, then the carriers */
    double length[CABLES];    /* unstrained; the tension where that is commanded */
    double rate[CABLES];      /* of the unstrained length */
} motion;

/* The parts of a command. */
typedef struct {
    double air, wind[3], wrench[6];
} platform_command;

typedef struct {
    double actuation[TOWLINE_MOST_ACTUATORS], wrench[6], pose[6], velocity[6], acceleration[6];
} carrier_command;

/* How the reference of a carrier moves during a command: a polynomial of time for each coordinate of its pose. */
typedef struct {
    double coefficient[6][6]; /* for each coordinate, from the constant on */
    int moves, turns;
} carrier_path;

/* A body at a motion, in {G}. */
typedef struct {
    double R[9], omega[3];
    double force[3], moment[3]; /* about the CoM */
    /* For cables without stiffness: the angular acceleration by a moment, and that which other forces give. */
    double inverse_inertia[9], turning[3];
    int turned; /* since the lines of the cables were last computed */
} body_now;

/* Limp: longer than unstrained, with a damper that outweighs it. */
typedef enum { SLACK, PULLS, LIMP } contact;

/* How a body yields to a newton of a cable's tension: the moment, and the accelerations that it gives. */
typedef struct {
    double moment[3], moved[3], turned[3];
} yielding;

/* A cable at a motion, vectors in {G}. */
typedef struct {
    double anchor[3], axis[3]; /* from the carrier's position to the anchor; swivel axis of the pulley */
    double pull[3];            /* unit vector in which it pulls the platform */
    double arm[3];             /* from the platform's CoM to the attachment */
    double carrier_arm[3];     /* from the carrier's position to the attachment, on the line along which it pulls */
    double drift[3];           /* velocity of the attachment in the carrier's frame */
    double length, length_rate;
    double curvature; /* d2 length / dt2 for an attachment that does not accelerate in the carrier's frame */
    double stretch, stretch_rate; /* beyond the unstrained length */
    double spring;                /* E A e / L0 + C de/dt of an elastic cable, whether or not it pulls [N] */
    double tension;
    double reference_rate;  /* of the commanded length */
    double beyond, sliding; /* by how much cable and winch are beyond their modes [m]; negative: inside */
    contact mode;
    int slip;                   /* 1: pays out, -1: hauls in, 0: friction holds the winch */
    yielding platform, carrier; /* without stiffness; the carrier counts along -pull */
} cable_now;

/* Equations of the cables without stiffness, see constraints.c. Arrays have a place for each cable of the robot. */
typedef struct {
    double gram[CABLES][CABLES];     /* among the candidates */
    double give[CABLES];             /* added to its diagonal */
    double right[CABLES];            /* right-hand side */
    double solution[CABLES];         /* 0 for those that are not picked */
    int candidate[CABLES];           /* 1: may pull */
    int count, picked[CABLES];       /* cables in the factor, in its order */
    double factor[CABLES][CABLES];   /* Cholesky's of the picked rows and columns, in that order */
    double inverse_diagonal[CABLES]; /* of the factor */
    int holds; /* 1: the factor is that of the pulling cables at this motion, or at one that is hardly another */
} constraints;

/* What the end of a step is checked for. */
typedef enum { ELASTIC, WITH_FRICTION, CONSTRAINED } kind;

typedef struct {
    const towline_robot *robot;
    const towline_plant *settings;
    int bodies, cables;
    int locates; /* 1: steps end where a contact changes */
    int has_winches, air;
    kind kind;
    double attachment[CABLES][3]; /* from the CoM, in the platform's axes */
    /* of the command */
    const platform_command *on_platform;
    const carrier_command *on_carriers;
    double commanded[CABLES];
    double thrust[CARRIERS][6];  /* force and moment of a carrier's actuators, in its axes */
    carrier_path path[CARRIERS]; /* of those that are imposed or lagged */
    body_motion lead[CARRIERS];  /* reference of a lagged carrier at the time, its acceleration as `rate` */
    /* of the state, beside its motion */
    double reference[CABLES]; /* lengths last commanded */
    int condition[CABLES];
    /* at a motion */
    body_now body[BODIES];
    cable_now cable[CABLES];
    constraints taut;
} plant;

static const double SHORTEST = 1e-3;   /* cable that a winch leaves out [m] */
static const double NO_LENGTH = 1e-12; /* [m] of a cable that has no direction, and so does not pull */

/* Cables without stiffness. Those with `length` are multiples of the robot's length scale. */
static const double CAUGHT_LENGTH = 1e-13;   /* by which one is longer when its impact is located */
static const double TOUCHING_LENGTH = 1e-12; /* by which one may be short of taut to be treated as taut */
static const double RESTING_LENGTH = 1e-9;   /* the same for one that hardly moves: its tension's sign decides */
static const double TORN_LENGTH = 1e-5;      /* by which none is longer if its length is possible */
static const double STILL = 1e-12; /* [m/s] with which a taut one stretches without an impact: what rounding leaves */
/* [m/s] with which a taut one gets slack; a slower one is held, which ends trains of ever smaller impacts. */
static const double PARTING = 1e-6;

INLINE double between(double low, double x, double high) { return smaller(larger(low, x), high); }

/* Which body a cable hangs from. */
INLINE int owner_of(const plant *p, int i) { return 1 + p->robot->cable[i].carrier; }

INLINE int is_free(const plant *p, int b) { return p->robot->body[b].motion == TOWLINE_FREE; }

INLINE int never_stretches(const plant *p, int i) { return p->robot->cable[i].stiffness == 0; }

#endif
