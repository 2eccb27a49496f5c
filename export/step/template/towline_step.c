/*
 * One control step of the robot @name@; see towline_step.h.
 *
 * @generated@
 * Copyright (c) 2026, The towline developers. SPDX-License-Identifier: BSD-3-Clause
 *
 * In this order: the solver, which is the C core of towline; the robot's mechanics, from the instructions of its CasADi
 * functions; the step.
 */
#include "towline_step.h"

#define TOWLINE_STEP

@core@

/* ---- The robot. ---- */

#define C(x) ((real)(x))
#ifdef TOWLINE_FLOAT
#define MATH(name) name##f
#else
#define MATH(name) name
#endif

static const real LENGTH = C(@length@); /* brings moments to newtons [m] */
#ifdef TOWLINE_FLOAT
static const real MASS = C(@mass@);
static const real GRAVITY = C(@gravity@);
static const real TURNING = C(@turning@); /* force for each unit of angular acceleration [N s^2] */
static const real DRAG = C(@drag@);       /* force for each squared unit of air speed [N s^2/m^2] */
#endif
static const real T_MIN[CABLES] = {@t_min@};
static const real T_MAX[CABLES] = {@t_max@};
@home@
/* The wrench matrix and the wrench that the wanted acceleration requires, less wind and disturbance. */
NOT_INLINE @mechanics@
/* ---- The step. ---- */

void towline_start(towline_state *state) {
    state->has_command = 0;
    for (int c = 0; c < CABLES; c++) {
        state->tensions[c] = T_MIN[c];
        state->rate_max[c] = (real)INFINITY;
    }
}

void towline_carriers_home(towline_input *input) {
#if TOWLINE_CARRIERS > 0
    for (int i = 0; i < 6 * TOWLINE_CARRIERS; i++) {
        input->carrier_pose[i] = CARRIER_HOME[i];
    }
#else
    (void)input;
#endif
}

void towline_computed_torque(const towline_gains *gains, const towline_reference *reference, towline_input *input) {
    for (int i = 0; i < 6; i++) {
        input->acceleration[i] = reference->acceleration[i] +
                                 gains->velocity[i] * (reference->velocity[i] - input->velocity[i]) +
                                 gains->position[i] * (reference->pose[i] - input->pose[i]);
    }
}

static int are_finite(const real *x, int count) {
    real sum = 0;
    for (int i = 0; i < count; i++) {
        sum += x[i] - x[i]; /* NaN if it is infinite or NaN */
    }
    return sum == 0;
}

/* Return whether the input is a state, also in numbers that do not enter the wrench. */
static int is_state(const towline_input *input) {
    return are_finite(input->pose, 6) && are_finite(input->velocity, 6) && are_finite(input->acceleration, 6) &&
#if TOWLINE_CARRIERS > 0
           are_finite(input->carrier_pose, 6 * TOWLINE_CARRIERS) &&
#endif
#if TOWLINE_WIND
           are_finite(input->wind, 3) &&
#endif
           are_finite(input->disturbance, 6);
}

/*
 * Return the size of the terms that the required wrench is a sum of [N], moments divided by the length. In float its
 * rounding is a part of them: near free fall, where they cancel, smaller wrenches prove nothing. In double it is 0, as
 * in Python.
 */
static real terms_of_wrench(const towline_input *input) {
#ifdef TOWLINE_FLOAT
    const real *v = input->velocity, *a = input->acceleration, *d = input->disturbance;
    real linear = GRAVITY, angular = 0, other = 0, speed = 0;
    for (int i = 0; i < 3; i++) {
        linear += magnitude(a[i]);
        angular += magnitude(a[i + 3]) + 3 * v[i + 3] * v[i + 3];
        other += magnitude(d[i]) + magnitude(d[i + 3]) / LENGTH;
        speed += 2 * v[i] * v[i];
    }
#if TOWLINE_WIND
    for (int i = 0; i < 3; i++) {
        speed += 2 * input->wind[i] * input->wind[i];
    }
#endif
    return MASS * linear + TURNING * angular + DRAG * speed + other;
#else
    (void)input;
    return 0;
#endif
}

/* Hold the last command, inside the limits. */
static void hold(const towline_state *state, towline_answer *answer) {
    for (int c = 0; c < CABLES; c++) {
        const real last = state->tensions[c];
        const int is_finite = last - last == 0;
        answer->tensions[c] = state->has_command && is_finite ? between(T_MIN[c], last, T_MAX[c]) : T_MIN[c];
    }
}

towline_status towline_step(const towline_input *input, towline_state *state, towline_answer *answer) {
    real A[6 * CABLES], w[6], low[CABLES], high[CABLES];
    const towline_problem problem = {6,      CABLES, A, w, low, high, input->t_ref, 0,
                                     LENGTH,
                                     terms_of_wrench(input)};
    for (int c = 0; c < CABLES; c++) {
        low[c] = T_MIN[c];
        high[c] = T_MAX[c];
        if (state->has_command) {
            const real rate = state->rate_max[c] >= 0 ? state->rate_max[c] : (real)NAN; /* the solver rejects NaN */
            const real least = state->tensions[c] - rate, most = state->tensions[c] + rate;
            low[c] = between(least, low[c], most);
            high[c] = between(least, high[c], most);
        }
    }
    mechanics(@arguments@, A, w);
    if (!is_state(input)) {
        w[0] = (real)NAN;
    }
    towline_solve_always(&problem, TOWLINE_RHO, answer);
    if (answer->status == TOWLINE_INVALID) {
        hold(state, answer);
    }
    if (answer->status != TOWLINE_INFEASIBLE && answer->status != TOWLINE_SINGULAR) {
        answer->support = answer->shortfall = 0;
        for (int i = 0; i < ROWS; i++) {
            answer->direction[i] = 0;
        }
    }
    for (int c = 0; c < CABLES; c++) {
        state->tensions[c] = answer->tensions[c];
    }
    state->has_command = 1;
    return answer->status;
}

const char *towline_status_name(towline_status status) {
    switch (status) {
        case TOWLINE_OPTIMAL:
            return "optimal";
        case TOWLINE_INFEASIBLE:
            return "infeasible";
        case TOWLINE_SINGULAR:
            return "singular";
        case TOWLINE_INACCURATE:
            return "inaccurate";
        case TOWLINE_INVALID:
            break;
    }
    return "invalid";
}
