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
 */
#include "control/internal.h"
#include "control/observer.h"
#include "control/usable.h"

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
    for (int k = 0; k < 6; k++) {
        double *estimate = &memory->disturbance[k];
        observe(controller->observer, since, memory->unseen, momentum[k], known[k], estimate, &memory->explained[k]);
        *estimate *= robot->freedom[k];
    }
    memory->unseen = 0;
}

/* Let A t + m g + d, with the last known A, act for a step without a usable state. */
static void observe_unseen(const towline_robot *robot, double since, const towline_row *row) {
    double known[6];
    towline_platform_memory *memory = row->platform;
    observe_nothing(since, &memory->unseen);
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
    double rate[3], error[6], slower[6], wanted[6];
    body_rate(at, row->measured + 9, rate);
    compare(at, rate, row, error, slower, wanted);
    for (int k = 0; k < 6; k++) {
        if (memory->integrates) { memory->integral[k] += dt * error[k]; }
        wanted[k] +=
            controller->kp[k] * error[k] + controller->ki[k] * memory->integral[k] + controller->kd[k] * slower[k];
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
        if (since > 0 || dt == 0) { observe_unseen(robot, since, &row); }
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
