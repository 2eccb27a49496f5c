/*
 * The problem of tension distribution that one step of a controller solves.
 *
 *     a*     = a_ref + Kd (v_ref - v) + Kp (x_ref - x) + Ki integral        of the frame, in {G}
 *     alpha* = Q alpha_ref + Kd (Q Omega_ref - Omega) + Kp e + Ki integral  in the platform's axes, Q = R' R_ref
 *     w      = (m (a_c* - g), R (J alpha* + Omega x J Omega)) - d           about the CoM
 *     d      = K (p - p_0 - integral of (A t + m g + d))                    the estimated disturbance, p the momentum
 *
 * with e the vector of the rotation Q. It is the difference of the angles to first order at small angles, and defined at
 * any attitude, as its gains are: roll, pitch and yaw have no rates at a pitch of 90 degrees. Source: F. Bullo and R. M.
 * Murray, "Proportional derivative (PD) control on the Euclidean group", ECC 1995.
 *
 * Carriers take part by their positions alone: what they do moves the anchors, not the platform.
 *
 * With winches that lag, or states that are late without being known to be, the platform follows the commanded tensions
 * late (lateness.c). With K and a critically damped bandwidth w both equal to b the loop is, for small errors,
 *
 *     C s^5 + T s^4 + s^3 + 3 b s^2 + 3 b^2 s + b^3 = 0
 *
 * It is stable up to b T = 0.89 for a lag (Routh), and up to b D = 0.407 for a delay (its phase where the gain is 1), so
 * up to b (T + 2.4 C / T) = 0.89. Bandwidths that leave no margin of 1.3 are lowered until it is 2.
 */
#include "control/internal.h"
#include "control/observer.h"
#include "control/usable.h"

static const double UNSTABLE = 0.89;         /* of b (T + 2.4 C / T) */
static const double SECOND = 2.4;            /* times C / T */
static const double LEAST = 1.3, MARGIN = 2; /* margin without which bandwidths are lowered, and until it is this */
static const double SEEN = 0.3;              /* [m/s^2], of an oscillation that shows the lag */
static const double COMPARED = 1.5;          /* over b, for an attitude loop and this one to be as fast */

/* Return b, the bandwidth of a loop with three poles there that is damped as this one. */
static double bandwidth_of(const towline_controller *controller) {
    double most = 0;
    for (int k = 0; k < 6; k++) { most = fmax(most, controller->kd[k]); }
    return (most + controller->observer) / 3;
}

/* Return the factor of all bandwidths with which the loop is stable in spite of the measured lag. */
static double part_of(const towline_controller *controller, const towline_platform_memory *memory) {
    const double late = MARGIN / UNSTABLE * bandwidth_of(controller) * memory->lag;
    return late > 1 ? 1 / late : 1;
}

/* Write the wrench of tensions that were commanded until the state was measured, and of the weight (6). */
static void commanded_wrench(const towline_robot *robot, const towline_row *row, double *wrench) {
    double tensions[TOWLINE_MOST_CABLES];
    for (int i = 0; i < robot->cables; i++) { tensions[i] = row->cables[i].then; }
    wrench_of(robot, row->A, tensions, wrench);
    for (int k = 0; k < 3; k++) { wrench[k] += robot->mass * robot->gravity[k]; }
}

/* Measure how late the platform follows the commands, by its momentum (6); NULL: it is not known. */
static void compare_with_commands(const towline_robot *robot, const towline_controller *controller, double since,
                                  const double *momentum, const towline_row *row) {
    towline_platform_memory *memory = row->platform;
    const double *J = robot->body[0].inertia, b = bandwidth_of(controller), before = part_of(controller, memory);
    double ordered[6], measured[6];
    if (!controller->lowers || !(b > 0)) { return; }
    commanded_wrench(robot, row, ordered);
    for (int k = 0; k < 6; k++) {
        const double mass = k < 3 ? robot->mass : sqrt(robot->mass * (J[0] + J[4] + J[8]) / 3);
        const double per = mass > 0 ? robot->freedom[k] / mass : 0;
        ordered[k] *= per;
        measured[k] = momentum ? per * momentum[k] : NAN;
    }
    const towline_lag lag =
        towline_measure_lag(COMPARED * b, since, 6, ordered, measured, SEEN, memory->axis, &memory->lateness);
    const double late = lag.first + SECOND * lag.second;
    if (!(b * late > UNSTABLE / LEAST)) { return; }
    memory->lag = late;
    const double more = before / part_of(controller, memory);
    for (int k = 0; k < 6; k++) {
        memory->integral[k] *= more * more * more; /* so that neither integral nor estimate jumps */
        if (momentum) { memory->explained[k] = momentum[k] - more * (momentum[k] - memory->explained[k]); }
    }
}

/* Write what weight and cables do to the platform (6); a cable whose sensor reports nothing pulls as commanded. */
static void known_wrench(const towline_robot *robot, const towline_row *row, double *known) {
    double tensions[TOWLINE_MOST_CABLES];
    for (int i = 0; i < robot->cables; i++) {
        const towline_cable_memory *cable = &row->cables[i];
        tensions[i] = are_numbers(&cable->measured, 1) ? cable->known : cable->then;
    }
    wrench_of(robot, row->A, tensions, known);
    for (int k = 0; k < 3; k++) { known[k] += robot->mass * robot->gravity[k]; }
}

/* Update the estimated disturbance, by the momentum that A t + m g + d does not explain. */
static void observe_platform(const towline_robot *robot, const towline_controller *controller, double since,
                             const configuration *at, const double *velocity, const towline_row *row) {
    double momentum[6], known[6];
    towline_platform_memory *memory = row->platform;
    known_wrench(robot, row, known);
    momentum_of(robot, &at->platform, at->com, velocity, momentum);
    compare_with_commands(robot, controller, since, momentum, row);
    memory->observer = part_of(controller, memory) * controller->observer;
    for (int k = 0; k < 6; k++) {
        double *estimate = &memory->disturbance[k];
        observe(memory->observer, since, memory->unseen, momentum[k], known[k], estimate, &memory->explained[k]);
        *estimate *= robot->freedom[k];
    }
    memory->unseen = 0;
}

/* Let A t + m g + d, with the last known A, act for a step without a usable state. */
static void observe_unseen(const towline_robot *robot, const towline_controller *controller, double since,
                           const towline_row *row) {
    double known[6];
    towline_platform_memory *memory = row->platform;
    observe_nothing(since, &memory->unseen);
    compare_with_commands(robot, controller, since, NULL, row);
    known_wrench(robot, row, known);
    for (int k = 0; k < 6; k++) { memory->explained[k] += since * (known[k] + memory->disturbance[k]); }
}

/* Write the error of the pose and that of its rate (6), and the accelerations of the reference; angular ones as e. */
static void compare(const attitude *at, const double *rate, const towline_row *row, double *error, double *slower,
                    double *wanted) {
    const double *reference = row->reference, *measured = row->measured;
    const attitude planned = attitude_of(reference + 3);
    double Q[9], omega[3], alpha[3], column[3];
    for (int k = 0; k < 3; k++) {
        const double axis[3] = {planned.R[k], planned.R[3 + k], planned.R[6 + k]};
        turn_back(at->R, axis, column);
        for (int i = 0; i < 3; i++) { Q[3 * i + k] = column[i]; }
    }
    body_rate(&planned, reference + 9, omega);
    body_acceleration(&planned, reference + 9, reference + 15, alpha);
    rotation_vector(Q, error + 3);
    turn(Q, omega, slower + 3);
    turn(Q, alpha, wanted + 3);
    for (int k = 0; k < 3; k++) {
        error[k] = reference[k] - measured[k];
        slower[k] = reference[6 + k] - measured[6 + k];
        slower[3 + k] -= rate[k];
        wanted[k] = reference[12 + k];
    }
}

/* Write the wrench of the acceleration that is wanted. */
static void wanted_wrench(const towline_robot *robot, const towline_controller *controller, double dt,
                          const attitude *at, const towline_row *row) {
    towline_platform_memory *memory = row->platform;
    const double part = part_of(controller, memory);
    double rate[3], error[6], slower[6], wanted[6];
    body_rate(at, row->measured + 9, rate);
    compare(at, rate, row, error, slower, wanted);
    for (int k = 0; k < 6; k++) {
        if (memory->integrates) { memory->integral[k] += dt * error[k]; }
        const double integral = part * controller->ki[k] * memory->integral[k];
        wanted[k] += part * (controller->kd[k] * slower[k] + part * (controller->kp[k] * error[k] + integral));
    }
    wrench_of_motion(robot, at->R, row->measured + 6, rate, wanted, wanted + 3, NULL, row->w);
}

/*
 * Write the wrench that the planned motion needs less the one of its tensions, or zeros where none are planned.
 *
 * It is what the plan knows of wind, and what the tensions of a plan that has none in their limits miss.
 */
static void planned_disturbance(const towline_robot *robot, const towline_row *row, double *missing) {
    double motions[MOTION * (1 + TOWLINE_MOST_CARRIERS)], A[6 * TOWLINE_MOST_CABLES], given[6];
    int planned = 0;
    configuration at;
    for (int i = 0; i < robot->cables; i++) { planned |= row->t_ref[i] != 0; }
    memset(missing, 0, 6 * sizeof *missing);
    if (!planned) { return; }
    memcpy(motions, row->reference, MOTION * sizeof *motions);
    for (int c = 0; c < robot->carriers; c++) {
        memcpy(motions + MOTION * (1 + c), row->carriers + 18 * c, MOTION * sizeof *motions);
    }
    configuration_at(robot, motions, &at);
    wrench_matrix(robot, &at, A);
    wrench_of(robot, A, row->t_ref, given);
    required_wrench(robot, row->reference, row->reference + 6, row->reference + 12, NULL, missing);
    for (int k = 0; k < 6; k++) { missing[k] -= given[k]; }
}

/* Order carriers to help the tensions. */
static void move_carriers(const towline_robot *robot, const towline_controller *controller, double dt,
                          const configuration *at, towline_row *row) {
    double missing[6];
    if (controller->corrects) {
        double given[6];
        wrench_of(robot, row->A, row->t_ref, given);
        for (int k = 0; k < 6; k++) { missing[k] = row->w[k] - given[k]; }
    } else {
        planned_disturbance(robot, row, missing);
        for (int k = 0; k < 6; k++) { missing[k] = robot->freedom[k] * (missing[k] - row->platform->disturbance[k]); }
    }
    towline_compensate(robot, controller, dt, at, row->A, missing, row);
}

void towline_write_problem(const towline_robot *robot, const towline_controller *controller, double dt, double since,
                           towline_row row) {
    configuration at;
    const int silent = towline_write_bounds(robot, controller, dt, row.cables, row.low, row.high);
    row.platform->silent = silent ? row.platform->silent + 1 : 0;
    if (!is_usable(robot, &row)) {
        for (int k = 0; k < 6; k++) { row.w[k] = NAN; }
        if (since > 0 || dt == 0) { observe_unseen(robot, controller, since, &row); }
        if (controller->reacts) { towline_add_offsets(robot, &row); }
        return;
    }
    if (row.late && (since > 0 || dt == 0)) {
        configuration_at(robot, row.late, &at);
        wrench_matrix(robot, &at, row.A);
        observe_platform(robot, controller, since, &at, row.late + 6, &row);
    }
    configuration_at(robot, row.measured, &at);
    wrench_matrix(robot, &at, row.A);
    wanted_wrench(robot, controller, dt, &at.platform, &row);
    if (!row.late) { observe_platform(robot, controller, since, &at, row.measured + 6, &row); }
    for (int k = 0; k < 6; k++) { row.w[k] = robot->freedom[k] * (row.w[k] - row.platform->disturbance[k]); }
    if (controller->reacts) { move_carriers(robot, controller, dt, &at, &row); }
}
