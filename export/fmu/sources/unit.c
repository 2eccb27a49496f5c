/*
 * The steps of a unit. The controller is that of control/computed_torque.py: the problem of core/control/step.c, solved,
 * and a command in any case.
 */
#include "unit.h"

#include <math.h>
#include <string.h>

#include "distribution/towline_core.h"

enum { PLANNED = 0, SOFT = 2, HOLD = 3, MOST_STEPS = 1000000 };
static const double ROUNDING = 1e-9; /* of a step */
static const double SPARING = 1e3;   /* in place of TOWLINE_RHO, as in solvers/in_place.py */

static int are_finite(const double *x, ptrdiff_t count) {
    double sum = 0;
    for (ptrdiff_t i = 0; i < count; i++) { sum += x[i] - x[i]; }
    return sum == 0;
}

/* ---- The controller. ---- */

/*
 * Whether tensions give the wrench up to what is negligible. Of fewer cables than degrees of freedom, carriers give the
 * rest, so only what is missing along a cable counts, and `carried` in all.
 */
static int is_given(const towline_unit *unit, const towline_problem *problem, const towline_answer *answer) {
    const int m = problem->m;
    double missing[6], square = 0;
    for (int k = 0; k < 6; k++) {
        missing[k] = problem->w[k];
        for (int i = 0; i < m; i++) { missing[k] -= problem->A[k * m + i] * answer->tensions[i]; }
        missing[k] /= k < 3 ? 1 : unit->length;
        square += missing[k] * missing[k];
    }
    if (!unit->controller.corrects) { return square <= unit->negligible * unit->negligible; }
    for (int i = 0; i < m; i++) {
        double along = 0;
        for (int k = 0; k < 6; k++) { along += missing[k] / (k < 3 ? 1 : unit->length) * problem->A[k * m + i]; }
        if (!(fabs(along) <= unit->negligible)) { return 0; }
    }
    return square <= unit->carried * unit->carried;
}

/* Write tensions for a problem, and what they are: the last ones, towards the planned ones, if it is none. */
static int solve(const towline_unit *unit, const towline_problem *problem, double *tensions) {
    towline_answer answer;
    const towline_status status = towline_solve_always(problem, TOWLINE_RHO, &answer);
    if (unit->controller.corrects && status != TOWLINE_INVALID && (problem->m >= 6 || status != TOWLINE_OPTIMAL)) {
        towline_solve_soft(problem, SPARING, &answer);
    }
    for (int i = 0; i < problem->m; i++) {
        const double planned = problem->t_ref[i], wanted = isfinite(planned) ? planned : unit->cable[i].last;
        tensions[i] =
            status == TOWLINE_INVALID ? fmin(fmax(wanted, problem->t_min[i]), problem->t_max[i]) : answer.tensions[i];
    }
    if (status == TOWLINE_INVALID) { return HOLD; }
    return status == TOWLINE_OPTIMAL || is_given(unit, problem, &answer) ? PLANNED : SOFT;
}

/* Keep the ordered positions of carriers inside their boxes. */
static void stay_inside(towline_unit *unit) {
    for (int c = 0; c < unit->known.carriers; c++) {
        for (int k = 0; k < 3; k++) {
            double *order = unit->ordered + 18 * c + k;
            const double inside = fmin(fmax(order[0], unit->box[0][c][k]), unit->box[1][c][k]);
            if (inside != order[0]) {
                order[0] = inside;
                order[6] = order[12] = 0;
            }
        }
    }
}

/* Write the commands for what is measured, `dt` after the last ones [s]; 0 for the first. */
static void control(towline_unit *unit, double dt) {
    const towline_robot *robot = &unit->known;
    const int m = robot->cables;
    double w[6], low[UNIT_CABLES], high[UNIT_CABLES];
    for (int i = 0; i < m; i++) {
        unit->cable[i].then = unit->cable[i].last;
        unit->cable[i].measured = unit->mean_tension[i];
    }
    memcpy(unit->ordered, unit->carriers, sizeof unit->ordered);
    memcpy(unit->ordered_jerks, unit->jerks, sizeof unit->ordered_jerks);
    const towline_row row = {
        .measured = unit->measured,
        .reference = unit->reference,
        .t_ref = unit->t_ref,
        .carriers = unit->ordered,
        .cables = unit->cable,
        .platform = &unit->platform,
        .carrier_memory = unit->carrier,
        .A = unit->A,
        .w = w,
        .low = low,
        .high = high,
    };
    towline_write_problem(robot, &unit->controller, dt, dt, row);
    const towline_problem problem = {6, m, unit->A, w, low, high, unit->t_ref, NULL, unit->length, 0};
    int answered = solve(unit, &problem, unit->tensions);
    unit->platform.integrates = answered == PLANNED;
    for (int i = 0; i < m; i++) {
        unit->tensions[i] = unit->cable[i].is_cut ? unit->little[i] : unit->tensions[i];
        unit->cable[i].last = unit->tensions[i];
    }
    if (towline_most_actuators(robot) > 0) {
        const towline_flight flight = {
            .measured = unit->measured,
            .carriers = unit->ordered,
            .tensions = unit->tensions,
            .cables = unit->cable,
            .platform = &unit->platform,
            .memory = unit->carrier,
            .turning = &unit->turning,
            .actuation = unit->actuation,
        };
        const double lacking = towline_write_thrusts(robot, &unit->controller, dt, flight);
        answered = lacking > unit->negligible && answered == PLANNED ? SOFT : answered;
    }
    stay_inside(unit);
    unit->answered = unit->platform.silent > 1 && answered == PLANNED ? SOFT : answered;
}

/* ---- The plant. ---- */

/* Write a reference a time after it was ordered. */
static void move_order(const double *order, const double *jerk, double time, double *to) {
    for (int k = 0; k < 6; k++) {
        const double v = order[6 + k], a = order[12 + k], j = jerk[k];
        to[k] = order[k] + time * (v + 0.5 * time * a) + time * time * time * j / 6;
        to[6 + k] = v + time * a + 0.5 * time * time * j;
        to[12 + k] = a + time * j;
    }
}

/* Write the reference of a carrier at the beginning of a step and at its end, times after the order; return whether it
 * has a jerk. */
static int order_carrier(const towline_unit *unit, int carrier, const double *times, double *begin, double *end) {
    const int most = towline_most_actuators(&unit->robot);
    const double *order = unit->ordered + 18 * carrier, *jerk = unit->ordered_jerks + 6 * carrier;
    memcpy(begin, unit->actuation + most * carrier, (size_t)most * sizeof *begin);
    begin += TOWLINE_CARRIER_REFERENCE, end += TOWLINE_CARRIER_REFERENCE;
    memcpy(begin, order, 18 * sizeof *begin);
    if (times[0] > 0) { move_order(order, jerk, times[0], begin); }
    move_order(order, jerk, times[1], end);
    return !are_finite(jerk, 6) || memcmp(jerk, (const double[6]){0}, 6 * sizeof *jerk) != 0;
}

/* Move a state by a step between two times after the order [s]; return 0 if the motion diverges. */
static int move_state(towline_unit *unit, const double *times, int32_t substeps, double *state, double *tensions,
                      double *means) {
    const towline_robot *robot = &unit->robot;
    const ptrdiff_t m = robot->cables, size = towline_plant_state_size(robot);
    const ptrdiff_t width = towline_plant_command_size(robot);
    const double step = times[1] - times[0];
    double commands[2 * UNIT_COMMAND] = {0}, history[2 * UNIT_STATE], motions[UNIT_MOTIONS], lengths[2 * UNIT_CABLES];
    int leads = 0;
    commands[0] = robot->has_aero;
    memcpy(commands + 1, unit->wind, sizeof unit->wind);
    memcpy(commands + 4, unit->wrench, sizeof unit->wrench);
    double *cables = commands + TOWLINE_PLATFORM_COMMANDS, *carriers = cables + m;
    memcpy(cables, unit->cables == UNIT_WINCHES ? unit->winches : unit->tensions, (size_t)m * sizeof *cables);
    if (unit->cables == UNIT_BY_LENGTHS) {
        towline_plant_sense(robot, 1, state, motions, lengths);
        towline_plant_winch_lengths(robot, 1, step, state, lengths, unit->tensions, unit->last, commands, width);
    }
    for (int c = 0; c < robot->carriers; c++) {
        double *begin = carriers + TOWLINE_CARRIER_COMMANDS * c;
        leads |= order_carrier(unit, c, times, begin, begin + width);
    }
    if (unit->cables == UNIT_BY_FORCES) {
        towline_plant_winch_forces(robot, &unit->plant, 1, 1 + leads, step, state, commands);
    }
    const towline_run run = {1, 1 + leads, 1, 1, substeps, step};
    towline_plant_run(robot, &unit->plant, &run, state, commands, history, tensions, means);
    if (!are_finite(history, 2 * size) || !are_finite(tensions, 2 * m)) { return 0; }
    memcpy(state, history + size, (size_t)size * sizeof *history);
    return 1;
}

/* Move the plant by a step [s], in parts if winches wind; return 0, and leave its state, if the motion diverges. */
static int simulate(towline_unit *unit, double step) {
    const ptrdiff_t m = unit->robot.cables;
    const double all = fmax(ceil(step / unit->longest_step - ROUNDING), 1);
    const double parts = unit->cables >= UNIT_BY_LENGTHS ? fmax(floor(step / unit->winding_time + 0.5), 1) : 1;
    double state[UNIT_STATE], tensions[2 * UNIT_CABLES], means[UNIT_CABLES], sums[UNIT_CABLES] = {0};
    if (!(all <= MOST_STEPS && parts <= MOST_STEPS)) { return 0; }
    memcpy(state, unit->state, sizeof state);
    for (double part = 0; part < parts; part++) {
        const double times[2] = {part * step / parts, (part + 1) * step / parts};
        if (!move_state(unit, times, (int32_t)ceil(all / parts), state, tensions, means)) { return 0; }
        for (ptrdiff_t i = 0; i < m; i++) { sums[i] += means[i]; }
    }
    memcpy(unit->state, state, sizeof state);
    for (ptrdiff_t i = 0; i < m; i++) {
        unit->tension[i] = tensions[m + i];
        unit->mean_tension[i] = sums[i] / parts;
    }
    towline_unit_sense(unit);
    return 1;
}

void towline_unit_sense(towline_unit *unit) {
    if (unit->simulates) { towline_plant_sense(&unit->robot, 1, unit->state, unit->measured, unit->lengths); }
}

/* ---- Both. ---- */

/* Write what parameters say to where the core reads it. */
static void apply_parameters(towline_unit *unit) {
    towline_body *platform = &unit->robot.body[0];
    unit->robot.mass = unit->mass;
    for (int k = 0; k < 3; k++) {
        platform->mass[k] = unit->mass * unit->robot.freedom[k];
        platform->inverse_mass[k] = unit->robot.freedom[k] / unit->mass;
    }
    for (int k = 0; k < 6; k++) {
        unit->controller.kp[k] = unit->bandwidth * unit->bandwidth;
        unit->controller.kd[k] = 2 * unit->damping * unit->bandwidth;
        unit->controller.ki[k] = unit->integral;
    }
}

int towline_unit_step(towline_unit *unit, double time, double step) {
    const int both = unit->simulates && unit->controls;
    const double count = both ? fmax(1, floor(step / unit->period + 0.5)) : 1, part = step / count;
    if (!(step > 0 && count <= MOST_STEPS) || !are_finite(&time, 1) || !are_finite(&step, 1)) { return 0; }
    apply_parameters(unit);
    for (int k = 0; k < count; k++) {
        const double now = time + k * part, since = unit->has_begun ? now - unit->last_time : 0;
        if (unit->controls) {
            if (unit->has_begun && !(since > 0)) { return 0; }
            control(unit, since);
            unit->last_time = now;
            unit->has_begun = 1;
        }
        if (unit->simulates && !simulate(unit, part)) { return 0; }
    }
    unit->time = time + step;
    return 1;
}
