/* Exact derivatives, see slopes.h. They are taken in the axes of the body, in which vectors fixed to it are constant. */
#include "control/slopes.h"

/* How the rate Omega and its derivative alpha change with an angle or its rate, and the axis of that angle (or zero). */
typedef struct {
    double axis[3], omega[3], alpha[3];
} body_slope;

/*
 * Columns for roll, pitch, yaw, and their rates, of
 *
 *     Omega = P dTheta,    alpha = P ddTheta + dP dTheta.
 *
 * A roll turns both back as it turns the axes.
 */
static void body_slopes(const attitude *at, const double *rates, const double *bends, body_slope slope[6]) {
    const double sr = at->sin_roll, cr = at->cos_roll, sp = at->sin_pitch, cp = at->cos_pitch;
    const double roll = rates[0], pitch = rates[1], yaw = rates[2];
    double omega[3], alpha[3];
    body_rate(at, rates, omega);
    body_acceleration(at, rates, bends, alpha);
    const body_slope columns[6] = {
        {{1, 0, 0}, {0, omega[2], -omega[1]}, {0, alpha[2], -alpha[1]}},
        {{0, cr, -sr},
         {-cp * yaw, -sr * sp * yaw, -cr * sp * yaw},
         {sp * pitch * yaw - cp * bends[2], -sr * sp * bends[2] - (cr * sp * roll + sr * cp * pitch) * yaw,
          -cr * sp * bends[2] + (sr * sp * roll - cr * cp * pitch) * yaw}},
        {{-sp, sr * cp, cr * cp}, {0, 0, 0}, {0, 0, 0}},
        {{0, 0, 0}, {1, 0, 0}, {0, omega[2], -omega[1]}},
        {{0, 0, 0}, {0, cr, -sr}, {-cp * yaw, -sr * (sp * yaw + roll), -cr * (sp * yaw + roll)}},
        {{0, 0, 0},
         {-sp, sr * cp, cr * cp},
         {-cp * pitch, cr * cp * roll - sr * sp * pitch, -(sr * cp * roll + cr * sp * pitch)}},
    };
    memcpy(slope, columns, sizeof columns);
}

/* c += a x b */
static void add_cross(const double *a, const double *b, double *c) {
    double product[3];
    cross(a, b, product);
    for (int i = 0; i < 3; i++) { c[i] += product[i]; }
}

void towline_wrench_slopes(const towline_robot *robot, const attitude *at, const double *velocity,
                           const double *acceleration, double slopes[6][6]) {
    const double *com = robot->com, *inertia = robot->body[0].inertia;
    double omega[3], alpha[3], around[3], spin[3], pulled[3], moment[3];
    body_slope slope[6];
    body_slopes(at, velocity + 3, acceleration + 3, slope);
    body_rate(at, velocity + 3, omega);
    body_acceleration(at, velocity + 3, acceleration + 3, alpha);
    /* In the body's axes: acceleration of the CoM about the frame's origin, and moment. */
    cross(omega, com, around);
    cross(alpha, com, pulled);
    add_cross(omega, around, pulled);
    constant_times(inertia, omega, spin);
    constant_times(inertia, alpha, moment);
    add_cross(omega, spin, moment);
    for (int k = 0; k < 6; k++) {
        double force[3], torque[3], turned[3];
        cross(slope[k].omega, com, turned);
        cross(slope[k].alpha, com, force);
        add_cross(slope[k].omega, around, force);
        add_cross(omega, turned, force);
        add_cross(slope[k].axis, pulled, force);
        constant_times(inertia, slope[k].omega, turned);
        constant_times(inertia, slope[k].alpha, torque);
        add_cross(slope[k].omega, spin, torque);
        add_cross(omega, turned, torque);
        add_cross(slope[k].axis, moment, torque);
        turn(at->R, force, slopes[k]);
        turn(at->R, torque, slopes[k] + 3);
        for (int i = 0; i < 3; i++) { slopes[k][i] *= robot->mass; }
    }
}

/* The second derivative of a straight cable's length, (1 - u u') / l. */
static void straight_curvature(const cable_run *run, double curvature[3][3]) {
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) { curvature[i][j] = ((i == j) - run->pull[i] * run->pull[j]) / run->length; }
    }
}

/*
 * The same over a sheave: n n' / s + (sine / a) y y', with s the free part, n across it in the sheave's plane, y across
 * that plane, and a the distance from the swivel axis.
 */
static void sheave_curvature(double r, const double *d, const double *axis, const cable_run *run,
                             double curvature[3][3]) {
    const double up = dot(d, axis);
    double out[3], n[3], y[3];
    for (int i = 0; i < 3; i++) { out[i] = d[i] - up * axis[i]; }
    const double a = sqrt(dot(out, out)), s = sqrt(a * a - 2 * r * a + up * up);
    for (int i = 0; i < 3; i++) { out[i] /= a; }
    const double sine = -dot(run->pull, out), cosine = -dot(run->pull, axis);
    cross(axis, out, y);
    for (int i = 0; i < 3; i++) { n[i] = cosine * out[i] - sine * axis[i]; }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) { curvature[i][j] = n[i] * n[j] / s + sine / a * y[i] * y[j]; }
    }
}

tensioned towline_tensioned(const towline_robot *robot, const configuration *at, int cable, double tension) {
    const towline_cable *given = &robot->cable[cable];
    const cable_run *run = &at->cable[cable];
    tensioned result;
    if (run->length == 0) {
        memset(result.stiffness, 0, sizeof result.stiffness);
    } else if (given->radius == 0) {
        straight_curvature(run, result.stiffness);
    } else {
        double d[3], axis[3];
        turn_constant(at->carrier[given->carrier].R, given->anchor, d);
        turn_constant(at->carrier[given->carrier].R, given->axis, axis);
        for (int i = 0; i < 3; i++) { d[i] = run->carrier_arm[i] - d[i]; }
        sheave_curvature(given->radius, d, axis, run, result.stiffness);
    }
    for (int i = 0; i < 3; i++) {
        result.force[i] = tension * run->pull[i];
        for (int j = 0; j < 3; j++) { result.stiffness[i][j] *= tension; }
    }
    return result;
}
