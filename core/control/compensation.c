/*
 * How carriers move off their reference to help the tensions.
 *
 * The wrench of tensions t with the carriers at p is A(p) t. To first order a wanted change of it is
 *
 *     dw = A dt + G dp        G: moves or turns the cables of a carrier, with t_ref in them
 *
 * of which the solution of least norm is taken, each coordinate of a carrier measured by its reach and each tension by a
 * share of the weight. Carriers go there as a critically damped lag of second order does: their command is smooth.
 *
 * With as many cables as degrees of freedom or more, dw = -d, the disturbance: the carriers take over what is steady,
 * and the tensions correct errors. With fewer the carriers have to correct them too: dw = w - A t_ref where they are now,
 * and dp adds to the offset that they have.
 */
#include "control/equations.h"
#include "control/internal.h"

static const double SHARE = 0.05;  /* of the weight: the change of a tension that costs as much as all of a reach */
static const double DAMPED = 1e-4; /* of the largest entry of the gram matrix */

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
    for (int j = 0; j < 3; j++) {
        from[j] = run->carrier_arm[j] + length * run->pull[j];
    }
    anchor_by_coordinate(from, coordinate, moves);
    const double along = dot(run->pull, moves), stiffness = far * tension / length;
    for (int j = 0; j < 3; j++) {
        force[j] = stiffness * (moves[j] - along * run->pull[j]);
    }
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
static void least_effort(const towline_robot *robot, const double *A, const double *missing, double scale,
                         double columns[][6], double *x) {
    const int m = robot->cables;
    const double share = SHARE * robot->force_scale;
    double gram[6][7], largest = 0;
    for (int j = 0; j < 6; j++) {
        const double by = j < 3 ? 1 : scale;
        gram[j][6] = by * missing[j];
        for (int k = 0; k < 6; k++) {
            double sum = 0;
            for (int i = 0; i < m; i++) {
                sum += A[j * m + i] * A[k * m + i];
            }
            gram[j][k] = share * share * by * (k < 3 ? 1 : scale) * sum;
            for (int c = 0; c < 6 * robot->carriers; c++) {
                gram[j][k] += columns[c][j] * columns[c][k];
            }
        }
        largest = fmax(largest, gram[j][j]);
    }
    for (int j = 0; j < 6; j++) {
        gram[j][j] += DAMPED * largest + 1e-30;
    }
    solve_positive(gram);
    for (int j = 0; j < 6; j++) {
        x[j] = gram[j][6];
    }
}

/* Let an offset go towards where it is wanted, by a lag of second order, for `dt` [s]. */
static void follow(const towline_controller *controller, double dt, double wanted, double *offset, double *rate) {
    const double bandwidth = controller->carrier_bandwidth, most = controller->carrier_acceleration;
    const double bend = bandwidth * (bandwidth * (wanted - *offset) - 2 * *rate);
    if (dt > 0) {
        *rate += dt * fmin(fmax(bend, -most), most);
        *offset += dt * *rate;
    }
}

void towline_compensate(const towline_robot *robot, const towline_controller *controller, double dt,
                        const configuration *at, const double *A, const double *missing, towline_row *row) {
    const double scale = 1 / robot->length_scale;
    double columns[6 * CARRIERS][6], x[6];
    towline_carrier_columns(robot, controller, at, row->t_ref, scale, columns);
    least_effort(robot, A, missing, scale, columns, x);
    for (int c = 0; c < robot->carriers; c++) {
        towline_carrier_memory *memory = &row->carrier_memory[c];
        for (int k = 0; k < 6; k++) {
            const double reach = controller->reach[c][k];
            double change = 0;
            for (int j = 0; j < 6; j++) {
                change += columns[6 * c + k][j] * x[j];
            }
            const double wanted = (controller->corrects ? memory->offset[k] : 0) + change * reach;
            follow(controller, dt, fmin(fmax(wanted, -reach), reach), &memory->offset[k], &memory->offset_rate[k]);
        }
    }
    towline_add_offsets(robot, row);
}

/* Add an offset (6) to coordinates (6); small rotations of a carrier that is nearly level become angles. */
static void add_offset(const double *offset, double cosine, double sine, double *coordinates) {
    for (int k = 0; k < 3; k++) {
        coordinates[k] += offset[k];
    }
    coordinates[3] += cosine * offset[3] + sine * offset[4];
    coordinates[4] += cosine * offset[4] - sine * offset[3];
    coordinates[5] += offset[5];
}

void towline_add_offsets(const towline_robot *robot, towline_row *row) {
    for (int c = 0; c < robot->carriers; c++) {
        double *pose = row->carriers + 18 * c, sine, cosine;
        sine_and_cosine(pose[5], &sine, &cosine);
        add_offset(row->carrier_memory[c].offset, cosine, sine, pose);
        add_offset(row->carrier_memory[c].offset_rate, cosine, sine, pose + 6);
    }
}
