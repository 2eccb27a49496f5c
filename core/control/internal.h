/* What the files of core/control share; none of it is for users. */
#ifndef TOWLINE_CONTROL_INTERNAL_H
#define TOWLINE_CONTROL_INTERNAL_H

#include "control/configuration.h"
#include "control/control.h"

/*
 * heard.c: update what is known of all cables, write the bounds of their tensions, and return whether tensions are
 * commanded and no sensor reports one.
 */
int towline_write_bounds(const towline_robot *robot, const towline_controller *controller, double dt,
                         towline_cable_memory *cables, double *low, double *high);

/* compensation.c: update how far carriers are off their reference to give a `missing` wrench (6), and order it. */
void towline_compensate(const towline_robot *robot, const towline_controller *controller, double dt,
                        const configuration *at, const double *A, const double *missing, towline_row *row);

/* A lag, T and C / T of lateness.c [s]; zeros if none is known. */
typedef struct {
    double first, second;
} towline_lag;

enum { TOWLINE_LATE_WINDOW = 2 }; /* over the bandwidth: in which orders and rates are compared */

/*
 * lateness.c: measure how late `count` coordinates follow, `dt` after the last step [s], with what they were `ordered`
 * in it and their measured rates. Orders that are not numbers start the comparison of that axis again; accelerations
 * of less than `least` show no lag.
 */
towline_lag towline_measure_lag(double bandwidth, double dt, int count, const double *ordered, const double *measured,
                                double least, towline_late_axis *axes, towline_lateness *it);

/* turning.c: measure how late carriers turn, with what they were `ordered` in the last step (c, 3). */
void towline_measure_turning(const towline_robot *robot, double bandwidth, double dt, const double ordered[][3],
                             const towline_carrier_memory *carriers, towline_turning *it);

/* Add the offsets of all carriers, and their rates, to the poses and velocities that are ordered. */
void towline_add_offsets(const towline_robot *robot, towline_row *row);

#endif
