/*
 * One control step of the robot @name@: the tensions for a desired acceleration of its platform, in C99.
 *
 * @generated@
 * @source@
 * Copyright (c) 2026, The towline developers. SPDX-License-Identifier: BSD-3-Clause
 *
 * It maps a state and a desired acceleration to tensions. If no tensions inside the limits give this acceleration, it
 * returns those with the smallest wrench error, and a certificate. No allocation, no globals, bounded iterations. SI
 * units: m, kg, s, N, rad. A pose is (x, y, z, roll, pitch, yaw) in the world frame {G}, with R = Rz(yaw) Ry(pitch) Rx(roll);
 * velocities and accelerations are its time derivatives.
 *
 * Upper bounds of iterations. With m cables and n degrees of freedom, m - n at most two, each limit is processed once
 * (outer) and intersected with those before it (inner): m and m (m - 1) / 2. With more cables, where the rank is lower,
 * and for a soft solution, whose problem has 6 more columns, a dual active-set method stops after 10 (columns) + 20
 * outer iterations. Each limit that leaves its set has entered it before, and takes one more inner iteration.
 *
@iterations@
 *
 * Floating-point operations: +, -, *, / and square roots count one each, moves and comparisons none. Those of the
 * mechanics are counted in the code; the others are bounds from the lengths of its loops:
 *
@operations@
 */
#ifndef TOWLINE_STEP_H
#define TOWLINE_STEP_H

@precision@#define TOWLINE_CABLES @cables@
#define TOWLINE_CARRIERS @carriers@ /* carriers that move: @carrier_names@ */
#define TOWLINE_WIND @wind@     /* 1 if the air pushes the platform */

#ifdef __cplusplus
extern "C" {
#endif

@types@

/* The measured state and the desired acceleration. Set all to zero ({0}) before filling in what you have. */
typedef struct {
    towline_real pose[6]; /* of the platform */
    towline_real velocity[6];
    towline_real acceleration[6]; /* desired; see towline_computed_torque */
#if TOWLINE_CARRIERS > 0
    towline_real carrier_pose[6 * TOWLINE_CARRIERS]; /* one after the other. In {G} their motion does not enter the wrench */
#endif
#if TOWLINE_WIND
    towline_real wind[3]; /* velocity of the air in {G} */
#endif
    towline_real disturbance[6]; /* other force [N] and moment [N m] on the platform about its CoM, in {G} */
    towline_real t_ref[TOWLINE_CABLES]; /* preferred tensions */
} towline_input;

/* The memory between steps. towline_start sets it; rate_max may be changed at any time. */
typedef struct {
    int has_command;
    towline_real tensions[TOWLINE_CABLES]; /* the last command */
    towline_real rate_max[TOWLINE_CABLES]; /* largest change of a tension from one step to the next [N]; INFINITY = any */
} towline_state;

typedef struct {
    towline_real pose[6];
    towline_real velocity[6];
    towline_real acceleration[6];
} towline_reference;

typedef struct {
    towline_real position[6]; /* Kp [1/s^2], of each coordinate */
    towline_real velocity[6]; /* Kd [1/s] */
} towline_gains;

/* Begin without a last command and without rate limits. */
void towline_start(towline_state *state);

/* Fill in the carriers at home. A carrier that does not move is always there. */
void towline_carriers_home(towline_input *input);

/*
 * Set input->acceleration to a_ref + Kd (v_ref - v) + Kp (x_ref - x). Differences of angles are not wrapped: let the
 * reference run on beyond pi as the measured angles do. They are differences of roll, pitch and yaw: for attitudes 3
 * degrees apart the moment is within 5 % of that for the rotation between them up to a pitch of 80 degrees, twice as
 * large at 89 degrees, and grows without bound beyond. Use platform axes that are never so steep.
 */
void towline_computed_torque(const towline_gains *gains, const towline_reference *reference, towline_input *input);

/*
 * Compute a step. Whatever the input is, answer->tensions are a command within the limits of the cables:
 *
 * TOWLINE_OPTIMAL     they give the desired acceleration, as close to t_ref as possible.
 * TOWLINE_INFEASIBLE  none do: soft solution, the tensions with the smallest wrench error. `direction` is
 * TOWLINE_SINGULAR    the certificate: no tensions within the limits reach the required wrench along it, by `shortfall`
 *                     newtons. Its first three entries have no unit, the others 1/m. Singular: tensions outside the limits
 *                     do not reach it either.
 * TOWLINE_INACCURATE  rounding prevents a proof of any of these: soft solution.
 * TOWLINE_INVALID     the input is invalid (NaN, infinite, a cable of zero length), or the last command is not finite, or
 *                     rate_max is NaN or negative: the last command, held.
 *
 * With rate limits the limits are those that can be reached from the last command, and optimal, infeasible and the
 * certificate refer to them. A last command outside the limits of the cables moves towards them as fast as its rate
 * permits. Before the first command, TOWLINE_INVALID gives t_min.
 */
towline_status towline_step(const towline_input *input, towline_state *state, towline_answer *answer);

/* Return "optimal", "infeasible", "singular", "inaccurate" or "invalid". */
const char *towline_status_name(towline_status status);

#ifdef __cplusplus
}
#endif

#endif
