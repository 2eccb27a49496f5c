/*
 * Carriers that one, two or three cables of fixed length hold, in the coordinates that these leave them.
 *
 *     position = mean of the attachments + Rz(yaw) (y1 e1 + y2 e2 + y3 e3)
 *
 * with the yaw of the platform, so that a team turns with its load. Of a carrier with k cables the first 3 - k of y are
 * coordinates, across the directions in which the cables hold it at home; the lengths determine the others, by Newton's
 * method.
 */
#ifndef TOWLINE_TETHERS_H
#define TOWLINE_TETHERS_H

#include "control/internal.h"

/* Where a tethered carrier is, and how. */
typedef struct {
    double position[3]; /* in {G} */
    double y[3];
    double cosine, sine; /* of the yaw */
} tethered;

/* How many coordinates a carrier has of its own. */
INLINE int coordinates_of(const towline_tether *tether) { return TOWLINE_MOST_TETHERS - tether->cables; }

/* The carrier at coordinates [m]; the attitudes of all bodies are those of a configuration. */
tethered towline_tethered_at(const towline_robot *robot, const towline_tether *tether, const configuration *at,
                             const double *coordinates);

/*
 * How its position changes: by each angle of the platform about its frame's origin, and by each coordinate. Where the
 * platform only moves, the carrier moves along.
 */
void towline_tethered_slopes(const towline_robot *robot, const towline_tether *tether, const configuration *at,
                             const double *coordinates, const tethered *carrier, double by_angle[3][3],
                             double by_coordinate[2][3]);

#endif
