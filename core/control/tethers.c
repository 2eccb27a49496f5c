/* Tethered carriers, see tethers.h. Derivatives over time are quotients of differences along p + s v + s^2 a / 2. */
#include "control/tethers.h"

#include "control/equations.h"

enum { ROUNDS = 20 };                    /* of Newton's method, */
static const double EXACT = 1e-14;       /* and the change relative to the length at which it ends */
static const double STEP_OF_TIME = 1e-3; /* [s], of a difference quotient */

enum { CARRIERS = TOWLINE_MOST_CARRIERS, MOST_MOVED = 2 * TOWLINE_MOST_CARRIERS };

/* Set cosine and sine of the platform's yaw; where it has none, those of zero. */
static void set_heading(const configuration *at, tethered *carrier) {
    const double x = at->platform.R[0], y = at->platform.R[3], size = sqrt(x * x + y * y);
    carrier->cosine = size > 1e-12 ? x / size : 1;
    carrier->sine = size > 1e-12 ? y / size : 0;
}

/* v = Rz(yaw) (y1 e1 + y2 e2 + y3 e3) */
static void from_axes(const towline_tether *tether, const tethered *carrier, const double *y, double *v) {
    double level[3];
    for (int i = 0; i < 3; i++) {
        level[i] = tether->axes[0][i] * y[0] + tether->axes[1][i] * y[1] + tether->axes[2][i] * y[2];
    }
    v[0] = carrier->cosine * level[0] - carrier->sine * level[1];
    v[1] = carrier->sine * level[0] + carrier->cosine * level[1];
    v[2] = level[2];
}

/* The inverse: y of a vector v in {G}. */
static void to_axes(const towline_tether *tether, const tethered *carrier, const double *v, double *y) {
    const double level[3] = {
        carrier->cosine * v[0] + carrier->sine * v[1],
        carrier->cosine * v[1] - carrier->sine * v[0],
        v[2],
    };
    for (int i = 0; i < 3; i++) { y[i] = dot(tether->axes[i], level); }
}

/* The mean of the arms of a carrier's cables. */
static void middle_of(const towline_robot *robot, const towline_tether *tether, const configuration *at,
                      double *middle) {
    double arm[3];
    memset(middle, 0, 3 * sizeof *middle);
    for (int j = 0; j < tether->cables; j++) {
        arm_of(robot, at, tether->cable[j], arm);
        for (int i = 0; i < 3; i++) { middle[i] += arm[i] / tether->cables; }
    }
}

/* Write a cable from its attachment to its anchor. */
static void cable_vector(const towline_robot *robot, const configuration *at, const double *position, int cable,
                         double *to_anchor) {
    double arm[3], anchor[3];
    arm_of(robot, at, cable, arm);
    turn_constant(at->carrier[robot->cable[cable].carrier].R, robot->cable[cable].anchor, anchor);
    for (int i = 0; i < 3; i++) { to_anchor[i] = position[i] + anchor[i] - at->position[i] - arm[i]; }
}

/*
 * The equations of changes of y: those of the coordinates first, and half the squared length of each cable. Cables of
 * which one row depends on the others leave the position as it is.
 */
typedef struct {
    double inverse[3][3];
} equations;

static equations equations_at(const towline_robot *robot, const towline_tether *tether, const configuration *at,
                              const tethered *carrier, double *missing) {
    const int free = coordinates_of(tether);
    double rows[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, to_anchor[3];
    equations of;
    memset(missing, 0, 3 * sizeof *missing);
    for (int j = 0; j < tether->cables; j++) {
        cable_vector(robot, at, carrier->position, tether->cable[j], to_anchor);
        to_axes(tether, carrier, to_anchor, rows[free + j]);
        missing[free + j] = 0.5 * (tether->length[j] * tether->length[j] - dot(to_anchor, to_anchor));
    }
    const double determinant = adjugate((const double (*)[3])rows, of.inverse);
    const double inverse = fabs(determinant) < 1e-300 ? 0 : 1 / determinant;
    for (int i = 0; i < 9; i++) { of.inverse[i / 3][i % 3] *= inverse; }
    return of;
}

/* Let the free coordinates end at the farthest; return how far they are asked to be. */
static double limit(const towline_tether *tether, double *y) {
    const int free = coordinates_of(tether);
    double square = 0;
    for (int i = 0; i < free; i++) { square += y[i] * y[i]; }
    const double far = sqrt(square);
    for (int i = 0; i < free && far > tether->farthest; i++) { y[i] *= tether->farthest / far; }
    return far;
}

tethered towline_tethered_at(const towline_robot *robot, const towline_tether *tether, const configuration *at,
                             const double *coordinates) {
    const int free = coordinates_of(tether);
    double middle[3], off[3], missing[3];
    tethered carrier;
    double *y = carrier.y;
    set_heading(at, &carrier);
    memcpy(y, tether->at_home, sizeof carrier.y);
    memcpy(y, coordinates, (size_t)free * sizeof *y);
    limit(tether, y);
    if (free == 2) { y[2] = copysign(sqrt(tether->length[0] * tether->length[0] - y[0] * y[0] - y[1] * y[1]), y[2]); }
    middle_of(robot, tether, at, middle);
    for (int round = 0; round < ROUNDS; round++) {
        double change = 0;
        from_axes(tether, &carrier, y, off);
        for (int i = 0; i < 3; i++) { carrier.position[i] = at->position[i] + middle[i] + off[i]; }
        const equations of = equations_at(robot, tether, at, &carrier, missing);
        for (int i = 0; i < 3; i++) {
            const double step = dot(of.inverse[i], missing);
            y[i] += step;
            change += fabs(step);
        }
        if (change <= EXACT * tether->length[0]) { break; }
    }
    return carrier;
}

/* How the free coordinates, where they are limited, change with coordinate `j` that is asked for. */
static void limit_slope(const towline_tether *tether, const double *coordinates, int j, double *slope) {
    const int free = coordinates_of(tether);
    double y[3] = {0, 0, 0};
    memcpy(y, coordinates, (size_t)free * sizeof *y);
    const double far = limit(tether, y);
    memset(slope, 0, 3 * sizeof *slope);
    slope[j] = 1;
    for (int i = 0; i < free && far > tether->farthest; i++) {
        slope[i] = tether->farthest / far * ((i == j) - coordinates[i] * coordinates[j] / (far * far));
    }
}

void towline_tethered_slopes(const towline_robot *robot, const towline_tether *tether, const configuration *at,
                             const double *coordinates, const tethered *carrier, double by_angle[3][3],
                             double by_coordinate[2][3]) {
    const int free = coordinates_of(tether);
    double axes[3][3], middle[3], off[3], missing[3], y[3];
    const equations of = equations_at(robot, tether, at, carrier, missing);
    turning_axes(&at->platform, axes);
    middle_of(robot, tether, at, middle);
    from_axes(tether, carrier, carrier->y, off);
    for (int angle = 0; angle < 3; angle++) {
        double moved[3], turned[3], arm[3], to_anchor[3], rows[3] = {0, 0, 0};
        cross(axes[angle], middle, moved);
        if (angle == 2) { /* it turns with the yaw */
            moved[0] -= off[1], moved[1] += off[0];
        }
        for (int j = 0; j < tether->cables; j++) {
            arm_of(robot, at, tether->cable[j], arm);
            cross(axes[angle], arm, turned);
            cable_vector(robot, at, carrier->position, tether->cable[j], to_anchor);
            rows[free + j] = dot(to_anchor, turned) - dot(to_anchor, moved);
        }
        for (int i = 0; i < 3; i++) { y[i] = dot(of.inverse[i], rows); }
        double own[3], by_com[3];
        from_axes(tether, carrier, y, own);
        cross(axes[angle], at->com, by_com);
        for (int i = 0; i < 3; i++) { by_angle[angle][i] = by_com[i] + moved[i] + own[i]; }
    }
    for (int j = 0; j < free; j++) {
        double slope[3];
        limit_slope(tether, coordinates, j, slope);
        for (int i = 0; i < 3; i++) { y[i] = dot(of.inverse[i], slope); }
        from_axes(tether, carrier, y, by_coordinate[j]);
    }
}

static int count_of(int tethered, const towline_tether *tethers) {
    int count = 0;
    for (int k = 0; k < tethered; k++) { count += coordinates_of(&tethers[k]); }
    return count;
}

int towline_moved_count(towline_moved moved) { return moved.freed + count_of(moved.tethered, moved.tethers); }

/* x + s v + s^2 a / 2 of one that has (3, per), from coordinate `i` on. */
static double after(double s, const double *motion, int per, int i) {
    return motion[i] + s * (motion[per + i] + s / 2 * motion[2 * per + i]);
}

/* Put the bodies of motions (3, 6), of which the platform's is apart, where they are after s. */
static void put_after(const towline_robot *robot, double s, const double *platform, int per, const double *carriers,
                      double *motions, configuration *at) {
    for (int i = 0; i < 6; i++) {
        motions[i] = after(s, platform, per, i);
        for (int c = 0; c < robot->carriers; c++) { motions[MOTION * (1 + c) + i] = after(s, carriers + 18 * c, 6, i); }
    }
    put_bodies(robot, motions, at);
}

/* Write value and two derivatives from values one step of time before, now, and after. */
static void derivatives(const double *before, const double *now, const double *later, int count, double *to,
                        ptrdiff_t order) {
    const double h = STEP_OF_TIME;
    for (int i = 0; i < count; i++) {
        to[i] = now[i];
        to[order + i] = (later[i] - before[i]) / (2 * h);
        to[2 * order + i] = (later[i] - 2 * now[i] + before[i]) / (h * h);
    }
}

void towline_tethered_coordinates(const towline_robot *robot, int count, const towline_tether *tethers,
                                  const double *motions, double *coordinates) {
    double found[3][MOST_MOVED], put[MOTION * (1 + CARRIERS)];
    const int free = count_of(count, tethers);
    configuration at;
    for (int s = 0; s < 3; s++) {
        double *next = found[s];
        put_after(robot, (s - 1) * STEP_OF_TIME, motions, 6, motions + 18, put, &at);
        for (int k = 0; k < count; k++) {
            const towline_tether *tether = &tethers[k];
            const double *position = put + MOTION * (1 + tether->carrier);
            double off[3], y[3];
            tethered carrier;
            set_heading(&at, &carrier);
            middle_of(robot, tether, &at, off);
            for (int i = 0; i < 3; i++) { off[i] = position[i] - at.position[i] - off[i]; }
            to_axes(tether, &carrier, off, y);
            memcpy(next, y, (size_t)coordinates_of(tether) * sizeof *y);
            next += coordinates_of(tether);
        }
    }
    derivatives(found[0], found[1], found[2], free, coordinates, free);
}

void towline_tethered_carriers(const towline_robot *robot, int count, const towline_tether *tethers,
                               const double *motion, double *carriers) {
    double found[3][CARRIERS][3], put[MOTION * (1 + CARRIERS)], coordinates[MOST_MOVED];
    const int free = count_of(count, tethers);
    configuration at;
    for (int s = 0; s < 3; s++) {
        const double *next = coordinates;
        put_after(robot, (s - 1) * STEP_OF_TIME, motion, 6 + free, carriers, put, &at);
        for (int i = 0; i < free; i++) { coordinates[i] = after((s - 1) * STEP_OF_TIME, motion, 6 + free, 6 + i); }
        for (int k = 0; k < count; k++) {
            const tethered carrier = towline_tethered_at(robot, &tethers[k], &at, next);
            memcpy(found[s][k], carrier.position, sizeof carrier.position);
            next += coordinates_of(&tethers[k]);
        }
    }
    for (int k = 0; k < count; k++) {
        derivatives(found[0][k], found[1][k], found[2][k], 3, carriers + 18 * tethers[k].carrier, 6);
    }
}
