/*
 * The robot's motion over the stages of a predictive controller, to first order about a guess.
 *
 * A state consists of the pose and its rate, and of value and rate of each free coordinate of a carrier: one in which
 * it may leave its reference or, of a carrier on cables of fixed length, one in which they let it move. A control
 * consists of the tensions and the accelerations of these coordinates. With the tensions t, the disturbance d and
 * H ddx + h = w(x, dx, ddx),
 *
 *     ddx = H^-1 (A(x) t + d - h(x, dx))
 *
 * which is constant during a stage, so that x moves by dt dx + dt^2 ddx / 2. Its derivatives are H^-1 times those of
 * A(x) t - w(x, dx, ddx) at constant ddx.
 */
#include "control/internal.h"
#include "control/mobility.h"
#include "control/slopes.h"
#include "control/tethers.h"

enum { CABLES = TOWLINE_MOST_CABLES, CARRIERS = TOWLINE_MOST_CARRIERS, MOST_MOVED = 6 * TOWLINE_MOST_CARRIERS };

/* A stage: the robot where the guess has it, and how its accelerations change. */
typedef struct {
    configuration at;
    double motions[MOTION * (1 + CARRIERS)];
    double positions[CARRIERS][3];
    double A[6 * CABLES];
    mobility by;
    double acceleration[6];
    /* Derivatives of A(x) t - w, (6) each: by the pose, by its rate, and by the coordinates of carriers. */
    double slope[MOTION + MOST_MOVED][6];
    /* How carriers move with each angle of the platform, and with the coordinates that tethers leave them. */
    double by_angle[CARRIERS][3][3];
    double by_coordinate[CARRIERS][2][3];
} stage;

/* Put the robot where a state (n) has it; carriers are where they should be, (c, 12), but for their coordinates. */
static void put_stage(const towline_robot *robot, towline_moved moved, const double *carriers, const double *x,
                      stage *it) {
    memcpy(it->motions, x, MOTION * sizeof *x);
    memcpy(it->motions + MOTION, carriers, (size_t)(MOTION * robot->carriers) * sizeof *x);
    for (int f = 0; f < moved.freed; f++) {
        it->motions[MOTION * (1 + moved.coordinates[2 * f]) + moved.coordinates[2 * f + 1]] = x[MOTION + f];
    }
    put_bodies(robot, it->motions, &it->at);
    for (int c = 0; c < robot->carriers; c++) {
        memcpy(it->positions[c], it->motions + MOTION * (1 + c), sizeof it->positions[c]);
    }
    memset(it->by_angle, 0, sizeof it->by_angle);
    const double *coordinates = x + MOTION + moved.freed;
    for (int k = 0; k < moved.tethered; k++) {
        const towline_tether *tether = &moved.tethers[k];
        const int c = tether->carrier;
        const tethered carrier = towline_tethered_at(robot, tether, &it->at, coordinates);
        memcpy(it->positions[c], carrier.position, sizeof it->positions[c]);
        towline_tethered_slopes(robot, tether, &it->at, coordinates, &carrier, it->by_angle[c], it->by_coordinate[c]);
        coordinates += coordinates_of(tether);
    }
    run_cables(robot, it->positions[0], 3, &it->at);
    wrench_matrix(robot, &it->at, it->A);
}

/* Add what a cable gives the platform with its position, where carriers do not move along, and with its angles. */
static void add_platform_slopes(const stage *it, int carrier, int along, const tensioned *cable, const cable_run *run,
                                const double axes[3][3], double slope[6][6]) {
    double from_origin[3], displacement[3], turned[3];
    for (int i = 0; i < 3; i++) { from_origin[i] = it->at.com[i] + run->arm[i]; }
    for (int k = 0; k < 3; k++) {
        const double unit[3] = {k == 0, k == 1, k == 2};
        if (!along) { add_displacement(cable, run->arm, unit, slope[k]); }
        cross(axes[k], from_origin, displacement);
        for (int i = 0; i < 3; i++) { displacement[i] -= it->by_angle[carrier][k][i]; }
        add_displacement(cable, run->arm, displacement, slope[3 + k]);
        cross(axes[k], run->arm, displacement); /* the arm turns */
        cross(displacement, cable->force, turned);
        for (int i = 0; i < 3; i++) { slope[3 + k][3 + i] += turned[i]; }
    }
}

/* Add what a cable gives the platform with a coordinate of its carrier's pose. */
static void add_carrier_slope(const stage *it, int carrier, int coordinate, const tensioned *cable,
                              const cable_run *run, double *slope) {
    double displacement[3] = {0, 0, 0};
    if (coordinate < 3) {
        displacement[coordinate] = -1;
        add_displacement(cable, run->arm, displacement, slope);
        return;
    }
    double axes[3][3], turned[3], moment[3];
    turning_axes(&it->at.carrier[carrier], axes);
    cross(run->carrier_arm, axes[coordinate - 3], displacement); /* of the attachment, as the carrier has it */
    add_displacement(cable, run->arm, displacement, slope);
    cross(axes[coordinate - 3], cable->force, turned);
    cross(run->arm, turned, moment);
    for (int i = 0; i < 3; i++) {
        slope[i] += turned[i];
        slope[3 + i] += moment[i];
    }
}

/* Add what a cable gives the platform with the coordinates that carriers have. */
static void add_moved_slopes(const towline_moved *moved, const stage *it, int carrier, const tensioned *cable,
                             const cable_run *run, double (*slope)[6]) {
    for (int f = 0; f < moved->freed; f++) {
        if (moved->coordinates[2 * f] == carrier) {
            add_carrier_slope(it, carrier, (int)moved->coordinates[2 * f + 1], cable, run, slope[f]);
        }
    }
    slope += moved->freed;
    for (int k = 0; k < moved->tethered; k++) {
        const towline_tether *tether = &moved->tethers[k];
        for (int j = 0; tether->carrier == carrier && j < coordinates_of(tether); j++) {
            const double *moves = it->by_coordinate[carrier][j];
            const double displacement[3] = {-moves[0], -moves[1], -moves[2]};
            add_displacement(cable, run->arm, displacement, slope[j]);
        }
        slope += coordinates_of(tether);
    }
}

/* Write how A(x) t - w changes with each coordinate, with zeros where the platform has no freedom. */
static void write_slopes(const towline_robot *robot, towline_moved moved, const double *tensions, stage *it) {
    const int count = MOTION + towline_moved_count(moved);
    double axes[3][3], needed[6][6];
    memset(it->slope, 0, (size_t)count * sizeof it->slope[0]);
    turning_axes(&it->at.platform, axes);
    for (int i = 0; i < robot->cables; i++) {
        const int carrier = robot->cable[i].carrier;
        const cable_run *run = &it->at.cable[i];
        const tensioned cable = towline_tensioned(robot, &it->at, i, tensions[i]);
        add_platform_slopes(it, carrier, moved.tethered > 0, &cable, run, (const double (*)[3])axes, it->slope);
        add_moved_slopes(&moved, it, carrier, &cable, run, it->slope + MOTION);
    }
    towline_wrench_slopes(robot, &it->at.platform, it->motions + 6, it->acceleration, needed);
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 6; i++) {
            it->slope[3 + k][i] -= needed[k][i];
            it->slope[9 + k][i] -= needed[3 + k][i];
        }
    }
    for (int j = 0; j < count; j++) {
        for (int i = 0; i < 6; i++) { it->slope[j][i] *= robot->freedom[i] * (j < MOTION ? robot->freedom[j % 6] : 1); }
    }
}

/* Write the rows of a position and its rate for an acceleration that changes by `gain`, in a column of A or B. */
static void write_column(double dt, const double *gain, double *matrix, ptrdiff_t row, int column) {
    for (int i = 0; i < 6; i++) {
        matrix[row * i + column] = 0.5 * dt * dt * gain[i];
        matrix[row * (6 + i) + column] = dt * gain[i];
    }
}

/* Write A, B and c: `left` of the acceleration is what is not in A x + B u. */
static void write_stage(const towline_robot *robot, int moved, double dt, const stage *it, const double *x,
                        const double *u, double *A, ptrdiff_t A_row, double *B, ptrdiff_t B_row, double *c) {
    const int m = robot->cables;
    double left[6], gain[6];
    memcpy(left, it->acceleration, sizeof left);
    for (int j = 0; j < MOTION + moved; j++) {
        accelerate(&it->by, it->slope[j], gain);
        write_column(dt, gain, A, A_row, j);
        for (int i = 0; i < 6; i++) { left[i] -= gain[i] * x[j]; }
    }
    for (int j = 0; j < m; j++) {
        const double w[6] = {it->A[j],         it->A[m + j],     it->A[2 * m + j],
                             it->A[3 * m + j], it->A[4 * m + j], it->A[5 * m + j]};
        accelerate(&it->by, w, gain);
        write_column(dt, gain, B, B_row, j);
        for (int i = 0; i < 6; i++) { left[i] -= gain[i] * u[j]; }
    }
    write_column(dt, left, c, 1, 0);
    for (int i = 0; i < 6; i++) {
        A[A_row * i + i] += 1;
        A[A_row * i + 6 + i] += dt;
        A[A_row * (6 + i) + 6 + i] += 1;
    }
    for (int f = 0; f < moved; f++) {
        const int position = MOTION + f, rate = MOTION + moved + f;
        A[A_row * position + position] = A[A_row * rate + rate] = 1;
        A[A_row * position + rate] = B[B_row * rate + m + f] = dt;
        B[B_row * position + m + f] = 0.5 * dt * dt;
        c[position] = c[rate] = 0;
    }
}

void towline_write_stages(const towline_robot *robot, towline_moved moved, const double *disturbance,
                          const double *carriers, const double *states, const double *controls, towline_stages stages) {
    const int count = towline_moved_count(moved), n = MOTION + 2 * count, m = robot->cables;
    const double rest[6] = {0, 0, 0, 0, 0, 0};
    double axes[3][3], needed[6];
    stage it;
    for (int k = 0; k < stages.count; k++) {
        const double *x = states + n * k, *u = controls + (m + count) * k;
        put_stage(robot, moved, carriers + MOTION * robot->carriers * k, x, &it);
        turning_axes(&it.at.platform, axes);
        it.by = mobility_at(robot, &it.at, (const double (*)[3])axes);
        required_wrench(robot, it.motions, it.motions + 6, rest, NULL, needed);
        acceleration_by(robot, &it.by, it.A, u, disturbance, needed, it.acceleration);
        write_slopes(robot, moved, u, &it);
        write_stage(robot, count, stages.steps[k], &it, x, u, stages.A.at + stages.A.stage * k, stages.A.row,
                    stages.B.at + stages.B.stage * k, stages.B.row, stages.c.at + stages.c.stage * k);
    }
}
