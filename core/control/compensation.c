/*
 * How carriers move off their reference to help the tensions.
 *
 * The wrench of tensions t with the carriers at p is A(p) t. To first order a wanted change of it is
 *
 *     dw = A dt + G dp        G: moves or turns the cables of a carrier, with t_ref in them
 *
 * of which the solution of least norm is taken, each coordinate of a carrier relative to its reach and each tension
 * relative to a share of the weight. A critically damped filter of second order smooths the carriers' command, which
 * includes its acceleration. Without this feedforward the carriers would lag by the time of their own loops, whose
 * bandwidth is no larger than that of the filter; with fewer cables than degrees of freedom, the loop over errors of
 * the platform would then be unstable.
 *
 * With at least as many cables as degrees of freedom, dw = -d, where d is the disturbance: the carriers balance its
 * steady part, and the tensions correct errors. With fewer cables the carriers have to correct errors too: then
 * dw = w - A t_ref at their current positions, and dp is added to their current offset. Of this offset only the part of
 * least norm with the same effect on the wrench is kept, because an offset along a single cable of constant length
 * would leave the platform too high.
 */
#include "control/equations.h"
#include "control/internal.h"

/* Of the weight: the change of a tension that costs as much as all of a reach, for carriers that spare the tensions, */
static const double SHARE = 0.05;
/* and for those that correct errors, which leave to the tensions what tensions can give. */
static const double ALONG = 1;
/* Added to the Gram matrix, as a share of its largest entry: for a change of the wrench, and for the kept offset. */
static const double DAMPED = 1e-4, NEARLY_NONE = 1e-9;

enum { CARRIERS = TOWLINE_MOST_CARRIERS };

/* How an anchor at `from` its carrier's frame moves with a unit of a coordinate of a carrier that is nearly level. */
static void anchor_by_coordinate(const double *from, int coordinate, double *moves) {
    double axis[3] = {0, 0, 0};
    axis[coordinate % 3] = 1;
    if (coordinate < 3) {
        memcpy(moves, axis, sizeof axis);
    } else {
        cross(axis, from, moves);
    }
}

/* Add the change of the wrench (6), moments times `scale`, that `far` along a coordinate makes by one cable. */
static void add_column(const cable_run *run, double tension, int coordinate, double far, double scale, double *column) {
    const double length = run->length;
    double from[3], moves[3], force[3], moment[3];
    for (int j = 0; j < 3; j++) { from[j] = run->carrier_arm[j] + length * run->pull[j]; }
    anchor_by_coordinate(from, coordinate, moves);
    const double along = dot(run->pull, moves), stiffness = far * tension / length;
    for (int j = 0; j < 3; j++) { force[j] = stiffness * (moves[j] - along * run->pull[j]); }
    cross(run->arm, force, moment);
    for (int j = 0; j < 3; j++) {
        column[j] += force[j];
        column[3 + j] += scale * moment[j];
    }
}

void towline_carrier_columns(const towline_robot *robot, const towline_controller *controller, const configuration *at,
                             const double *t_ref, double scale, double columns[][6]) {
    memset(columns, 0, (size_t)(6 * robot->carriers) * sizeof columns[0]);
    for (int i = 0; i < robot->cables; i++) {
        const int c = robot->cable[i].carrier;
        for (int k = 0; k < 6; k++) {
            const double far = controller->reach[c][k];
            if (far != 0 && t_ref[i] > 0 && at->cable[i].length > 0) {
                add_column(&at->cable[i], t_ref[i], k, far, scale, columns[6 * c + k]);
            }
        }
    }
}

/* Solve (share^2 A A' + G G') x = dw for what makes dw with least effort, dp = G' x; moments times `scale`. */
static void least_effort(const towline_robot *robot, double share, double damped, const double *A,
                         const double *missing, double scale, double columns[][6], double *x) {
    const int m = robot->cables;
    double gram[6][7], largest = 0;
    for (int j = 0; j < 6; j++) {
        const double by = j < 3 ? 1 : scale;
        gram[j][6] = by * missing[j];
        for (int k = 0; k < 6; k++) {
            double sum = 0;
            for (int i = 0; i < m; i++) { sum += A[j * m + i] * A[k * m + i]; }
            gram[j][k] = share * share * by * (k < 3 ? 1 : scale) * sum;
            for (int c = 0; c < 6 * robot->carriers; c++) { gram[j][k] += columns[c][j] * columns[c][k]; }
        }
        largest = fmax(largest, gram[j][j]);
    }
    for (int j = 0; j < 6; j++) { gram[j][j] += damped * largest + 1e-30; }
    solve_positive(gram);
    for (int j = 0; j < 6; j++) { x[j] = gram[j][6]; }
}

/* Write the change of the wrench (6) that the carriers' offsets make. */
static void wrench_of_offsets(const towline_robot *robot, const towline_controller *controller, double scale,
                              const towline_carrier_memory *memory, double columns[][6], double *wrench) {
    memset(wrench, 0, 6 * sizeof *wrench);
    for (int c = 0; c < robot->carriers; c++) {
        for (int k = 0; k < 6; k++) {
            const double reach = controller->reach[c][k], share = reach > 0 ? memory[c].offset[k] / reach : 0;
            for (int j = 0; j < 6; j++) { wrench[j] += columns[6 * c + k][j] * share / (j < 3 ? 1 : scale); }
        }
    }
}

/* Let an offset go towards where it is wanted, by a lag of second order, for `dt` [s]; return its acceleration. */
static double follow(double bandwidth, double most, double dt, double wanted, double *offset, double *rate) {
    if (!(dt > 0)) { return 0; }
    const double bend = fmin(fmax(bandwidth * (bandwidth * (wanted - *offset) - 2 * *rate), -most), most);
    *rate += dt * bend;
    *offset += dt * *rate;
    return bend;
}

/* Add an offset (6) to coordinates (6) of a carrier turned by `turn`; its small rotations become angles. */
static void add_offset(double turn, const double *offset, double *coordinates) {
    double sine, cosine;
    sine_and_cosine(turn, &sine, &cosine);
    for (int k = 0; k < 3; k++) { coordinates[k] += offset[k]; }
    coordinates[3] += cosine * offset[3] + sine * offset[4];
    coordinates[4] += cosine * offset[4] - sine * offset[3];
    coordinates[5] += offset[5];
}

void towline_compensate(const towline_robot *robot, const towline_controller *controller, double dt,
                        const configuration *at, const double *A, const double *missing, towline_row *row) {
    const double scale = 1 / robot->length_scale, share = controller->corrects ? ALONG : SHARE;
    /* Carriers that turn late also move late. */
    const double bandwidth = controller->carrier_bandwidth * row->platform->attitude / controller->attitude;
    double columns[6 * CARRIERS][6], x[6], given[6], kept[6] = {0, 0, 0, 0, 0, 0};
    towline_carrier_columns(robot, controller, at, row->t_ref, scale, columns);
    least_effort(robot, share * robot->force_scale, DAMPED, A, missing, scale, columns, x);
    if (controller->corrects) {
        wrench_of_offsets(robot, controller, scale, row->carrier_memory, columns, given);
        least_effort(robot, 0, NEARLY_NONE, A, given, scale, columns, kept);
    }
    for (int c = 0; c < robot->carriers; c++) {
        towline_carrier_memory *memory = &row->carrier_memory[c];
        double *carrier = row->carriers + 18 * c, bends[6];
        for (int k = 0; k < 6; k++) {
            const double reach = controller->reach[c][k];
            double wanted = 0;
            for (int j = 0; j < 6; j++) { wanted += columns[6 * c + k][j] * (x[j] + kept[j]) * reach; }
            wanted = fmin(fmax(wanted, -reach), reach);
            bends[k] = follow(bandwidth, controller->carrier_acceleration, dt, wanted, &memory->offset[k],
                              &memory->offset_rate[k]);
        }
        add_offset(carrier[5], bends, carrier + 12);
    }
    towline_add_offsets(robot, row);
}

void towline_add_offsets(const towline_robot *robot, towline_row *row) {
    for (int c = 0; c < robot->carriers; c++) {
        const towline_carrier_memory *memory = &row->carrier_memory[c];
        double *carrier = row->carriers + 18 * c;
        const double turn = carrier[5];
        add_offset(turn, memory->offset, carrier);
        add_offset(turn, memory->offset_rate, carrier + 6);
    }
}
