/*
 * A robot at rest at one pose, for the page that computes: tensions or a certificate, and the capacity margin, by the
 * files of the core. `make live` compiles it to robot_at_rest.wasm. The page writes and reads the numbers of one record.
 */
#include <math.h>
#include <stddef.h>

#include "available_wrench/available_wrench.h"
#include "distribution/towline_core.h"
#include "mechanics/rows.h"
#include "numbers/one.h"

#define FORM(name) name##_one
/* This needs `num`. */
#include "mechanics/rows_in_lanes.h"

#define EXPORT(name) __attribute__((export_name(name)))

enum { MOST = TOWLINE_MOST_CABLES, ROWS = TOWLINE_ROWS };

/* Of a column's length: what is left of it beside others is rounding. */
#define DEPENDENT 1e-10

/* Of moving to where the platform rests: steps, and what counts as there, of force and of length scale. */
enum { MOST_STEPS = 100, UNKNOWNS = ROWS + MOST };
#define THERE 1e-9
#define LARGEST_TURN 0.2 /* [rad] of a step; of the robot's length for displacements */

/* live.js has the same names in the same order. */
static struct {
    double pose[6], carriers[6 * TOWLINE_MOST_CARRIERS];
    double t_min[MOST], t_max[MOST], length;
    double tensions[MOST], direction[ROWS], shortfall, support, margin;
    double anchors[3 * MOST], exits[3 * MOST], attachments[3 * MOST], lengths[MOST], A[ROWS * MOST], w[ROWS];
    double kept[MOST]; /* lengths of the cables on which it hangs */
} page;

static towline_robot robot;

EXPORT("robot") towline_robot *page_robot(void) { return &robot; }

EXPORT("numbers") double *page_numbers(void) { return page.pose; }

/* Moments divided by the length are forces. */
static double row_scale(int i) { return i < 3 ? 1 : 1 / page.length; }

static double dot6(const double *x, const double *y) {
    double total = 0;
    for (int i = 0; i < ROWS; i++) { total += x[i] * y[i]; }
    return total;
}

static void subtract6(double *x, double factor, const double *y) {
    for (int i = 0; i < ROWS; i++) { x[i] -= factor * y[i]; }
}

static void geometry(void) {
    const towline_places at = {1, page.pose, page.carriers, 0};
    const towline_lines want = {.lengths = page.lengths, .A = page.A, .anchors = page.exits};
    lines_of_rows_one(&robot, at, want);
    ends_of_rows_one(&robot, at, page.anchors, page.attachments);
}

/* The wrench of the robot at rest; rows of coordinates that do not move are 0 in it and in A. */
static void wrench(void) {
    const double still[6] = {0};
    const towline_motion_of_platform at_rest = {page.pose, still, still, NULL};
    required_wrench_of_rows_one(&robot, 1, at_rest, 0, page.w);
    for (int i = 0; i < ROWS; i++) {
        page.w[i] *= robot.freedom[i];
        for (int c = 0; c < robot.cables; c++) { page.A[i * robot.cables + c] *= robot.freedom[i]; }
    }
}

static towline_problem problem_of_pose(void) {
    return (towline_problem){
        .n = ROWS,
        .m = robot.cables,
        .A = page.A,
        .w = page.w,
        .t_min = page.t_min,
        .t_max = page.t_max,
        .length = page.length,
    };
}

static void column(int c, double *a) {
    for (int i = 0; i < ROWS; i++) { a[i] = row_scale(i) * page.A[i * robot.cables + c]; }
}

/*
 * Write the part of x (6) orthogonal to the columns of some cables, by Gram-Schmidt, each column twice against those
 * before it.
 */
static void orthogonal_part(double *x, const int *chosen) {
    double basis[ROWS][ROWS];
    int rank = 0;
    for (int c = 0; c < robot.cables && rank < ROWS; c++) {
        double a[ROWS];
        column(c, a);
        const double length = sqrt(dot6(a, a));
        for (int k = 0; chosen[c] && k < 2 * rank; k++) { subtract6(a, dot6(a, basis[k % rank]), basis[k % rank]); }
        const double left = sqrt(dot6(a, a));
        if (chosen[c] && left > DEPENDENT * length) {
            for (int i = 0; i < ROWS; i++) { basis[rank][i] = a[i] / left; }
            rank++;
        }
    }
    for (int k = 0; k < 2 * rank; k++) { subtract6(x, dot6(x, basis[k % rank]), basis[k % rank]); }
}

/* Set direction, support and shortfall to those along x (6), if the shortfall grows. */
static void offer(const double *x) {
    double direction[ROWS], support = 0, demand = 0;
    const double size = sqrt(dot6(x, x));
    if (!(size > 0)) { return; }
    for (int i = 0; i < ROWS; i++) {
        direction[i] = row_scale(i) * x[i] / size;
        demand += direction[i] * page.w[i];
    }
    for (int c = 0; c < robot.cables; c++) {
        double pull = 0;
        for (int i = 0; i < ROWS; i++) { pull += direction[i] * page.A[i * robot.cables + c]; }
        support += pull * (pull > 0 ? page.t_max[c] : page.t_min[c]);
    }
    if (demand - support > page.shortfall) {
        page.shortfall = demand - support;
        page.support = support;
        for (int i = 0; i < ROWS; i++) { page.direction[i] = direction[i]; }
    }
}

/*
 * The sharpest certificate is along what is missing from the nearest wrench that tensions inside the limits give: it is
 * orthogonal to the columns of the cables that are at no limit there. Where no tensions of either sign give the wrench,
 * it is orthogonal to all columns.
 */
static void sharpen(const towline_problem *problem, int singular) {
    towline_answer nearest;
    double missing[ROWS];
    int inside[MOST];
    towline_solve_soft(problem, 1e12, &nearest);
    for (int i = 0; i < ROWS; i++) { missing[i] = row_scale(i) * page.w[i]; }
    for (int c = 0; c < robot.cables; c++) {
        const double t = nearest.tensions[c];
        inside[c] = singular || (page.t_min[c] < t && t < page.t_max[c]);
        if (!inside[c]) {
            double a[ROWS];
            column(c, a);
            subtract6(missing, t, a);
        }
    }
    orthogonal_part(missing, inside);
    offer(missing);
}

static void capacity_margin(void) {
    double A[ROWS * MOST], w[ROWS];
    const int m = robot.cables;
    int n = 0;
    for (int i = 0; i < ROWS; i++) {
        if (robot.freedom[i] != 0) {
            for (int c = 0; c < m; c++) { A[n * m + c] = row_scale(i) * page.A[i * m + c]; }
            w[n++] = row_scale(i) * page.w[i];
        }
    }
    page.margin = NAN;
    if (n > 0 && n <= m && m <= TOWLINE_MARGIN_CABLES) {
        const towline_matrices one = {n, m, 1, A};
        towline_margins(&one, w, n, page.t_min, page.t_max, &page.margin, NULL);
    }
}

/* Compute all that depends on pose, carriers and limits; return the status of the tensions. */
EXPORT("solve") int page_solve(void) {
    geometry();
    wrench();
    const towline_problem problem = problem_of_pose();
    towline_answer answer;
    const towline_status status = towline_solve(&problem, &answer);
    for (int c = 0; c < robot.cables; c++) { page.tensions[c] = answer.tensions[c]; }
    page.shortfall = 0;
    if (status == TOWLINE_INFEASIBLE || status == TOWLINE_SINGULAR) {
        double proven[ROWS];
        for (int i = 0; i < ROWS; i++) { proven[i] = answer.direction[i] / row_scale(i); }
        offer(proven);
        sharpen(&problem, status == TOWLINE_SINGULAR);
    }
    capacity_margin();
    return (int)status;
}

/* Solve M x = b by elimination with row pivoting, x in b; return 0 if M is singular. */
static int solve(double M[][UNKNOWNS], double *b, int n) {
    for (int k = 0; k < n; k++) {
        int best = k;
        for (int i = k + 1; i < n; i++) { best = fabs(M[i][k]) > fabs(M[best][k]) ? i : best; }
        if (!(fabs(M[best][k]) > 0)) { return 0; }
        for (int j = 0; j < n; j++) {
            const double x = M[k][j];
            M[k][j] = M[best][j];
            M[best][j] = x;
        }
        const double x = b[k];
        b[k] = b[best];
        b[best] = x;
        for (int i = k + 1; i < n; i++) {
            const double factor = M[i][k] / M[k][k];
            for (int j = k; j < n; j++) { M[i][j] -= factor * M[k][j]; }
            b[i] -= factor * b[k];
        }
    }
    for (int k = n - 1; k >= 0; k--) {
        for (int j = k + 1; j < n; j++) { b[k] -= M[k][j] * b[j]; }
        b[k] /= M[k][k];
    }
    return 1;
}

/*
 * Move the pose to where the platform rests on cables of the kept lengths, all of them taut: Newton's method on
 * A t = w and lengths = kept, in the pose's free coordinates and in t. Return 1 if it is there.
 */
EXPORT("hang") int page_hang(void) {
    const int m = robot.cables;
    double pull[MOST], J[6 * MOST], D[36];
    towline_answer start;
    geometry();
    wrench();
    const towline_problem problem = problem_of_pose();
    towline_solve_soft(&problem, 1e8, &start);
    for (int c = 0; c < m; c++) { pull[c] = start.tensions[c]; }
    for (int step = 0; step < MOST_STEPS; step++) {
        const towline_places at = {1, page.pose, page.carriers, 0};
        const towline_lines want = {.lengths = page.lengths, .A = page.A, .J = J};
        lines_of_rows_one(&robot, at, want);
        wrench_by_pose_of_rows_one(&robot, at, pull, 0, D);
        wrench();
        double M[UNKNOWNS][UNKNOWNS] = {{0}}, b[UNKNOWNS], missing = 0, apart = 0, longest = 0;
        int place[ROWS], n = 0;
        for (int i = 0; i < ROWS; i++) {
            if (robot.freedom[i] != 0) { place[n++] = i; }
        }
        for (int r = 0; r < n; r++) {
            const int i = place[r];
            b[r] = row_scale(i) * page.w[i];
            for (int c = 0; c < m; c++) {
                M[r][n + c] = row_scale(i) * page.A[i * m + c];
                b[r] -= M[r][n + c] * pull[c];
            }
            for (int k = 0; k < n; k++) { M[r][k] = row_scale(i) * D[6 * i + place[k]]; }
            missing = fmax(missing, fabs(b[r]));
        }
        for (int c = 0; c < m; c++) {
            b[n + c] = page.kept[c] - page.lengths[c];
            for (int k = 0; k < n; k++) { M[n + c][k] = J[6 * c + place[k]]; }
            apart = fmax(apart, fabs(b[n + c]));
        }
        if (missing < THERE * robot.force_scale && apart < THERE * page.length) {
            int taut = 1;
            for (int c = 0; c < m; c++) { taut = taut && pull[c] >= -THERE * robot.force_scale; }
            return taut;
        }
        if (!solve(M, b, n + m)) { return 0; }
        for (int k = 0; k < n; k++) { longest = fmax(longest, fabs(b[k]) / (place[k] < 3 ? page.length : 1)); }
        const double share = longest > LARGEST_TURN ? LARGEST_TURN / longest : 1;
        for (int k = 0; k < n; k++) { page.pose[place[k]] += share * b[k]; }
        for (int c = 0; c < m; c++) { pull[c] += share * b[n + c]; }
    }
    return 0;
}
