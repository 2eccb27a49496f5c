/* The functions of the plant, by the files that have them. */
#ifndef TOWLINE_PLANT_INTERNAL_H
#define TOWLINE_PLANT_INTERNAL_H

#include "plant/state.h"

/* state.c */
void plant_set_plant(plant* p, const towline_robot* robot, const towline_plant* settings);
void plant_take_motion(const plant* p, const double* row, motion* now);
void plant_take_state(plant* p, const double* row, motion* now);
void plant_clear(const plant* p, motion* change);
void plant_record_state(const plant* p, const motion* now, double* row);
void plant_record_tensions(const plant* p, double* row);

/* carrier_paths.c: `after` is the next command of the carriers, or NULL. */
void plant_set_paths(plant* p, const motion* now, const carrier_command* command, const carrier_command* after,
                     double period);
double plant_position_on(const double* coefficient, double time);
double plant_velocity_on(const double* coefficient, double time);
double plant_acceleration_on(const double* coefficient, double time);

/* bodies.c: `change` is the time derivative of `now`, `time` that since the command began. */
void plant_place_bodies(plant* p, motion* now, motion* change, double time);
void plant_move_bodies(const plant* p, const motion* now, motion* change);
void plant_accelerate_bodies(const plant* p, const motion* now, motion* change);
void plant_set_attitude(const body_motion* now, body_now* body);
void plant_normalise(const plant* p, motion* now);

/* loads.c */
void plant_set_thrusts(plant* p, const carrier_command* command);
void plant_load_bodies(plant* p, const motion* now);
void plant_pull_bodies(plant* p, const int* chosen);

/* cables.c */
void plant_set_lines(plant* p, const motion* now);

/* winches.c */
double plant_winch_yielding(const plant* p, int i);
double plant_drive_force(const plant* p, int i);
void plant_move_winches(const plant* p, const motion* now, motion* change, double time);
void plant_take_command(plant* p, motion* now, double period);
void plant_limit_winches(const plant* p, motion* now);

/* forces.c */
void plant_set_geometry(plant* p, motion* now, motion* change, double time);
void plant_set_modes(plant* p);
void plant_set_forces(plant* p, const motion* now, motion* change, double time);
void plant_evaluate(plant* p, motion* now, motion* change, double time);

/* constraints.c */
double plant_free_stretch_acceleration(const plant* p, const motion* now, const motion* change, int i);
void plant_set_gram(plant* p);
void plant_factor_pulling(plant* p);
void plant_solve_pulling(plant* p);
void plant_solve_non_negative(plant* p);

/* impacts.c */
void plant_resolve(plant* p, motion* now, motion* change, double time, double parting);
void plant_hold(plant* p, motion* now, motion* change, double time);

/* contacts.c */
double plant_largest_violation(plant* p, const motion* now);
double plant_graze_of(const plant* p, const double* stretch, const double* rate, double step);
int plant_caught_of(const plant* p, double most);
double plant_rise_of(double e0, double d0, double e1, double d1);
void plant_begin_contacts(plant* p, motion* now, motion* change, double time);
void plant_change_contacts(plant* p, motion* now, motion* change, double time, double parting);

/* step.c: memory of a step, of which slope[0] is the derivative at its beginning. */
enum { SLOPES = 5 };

typedef struct {
    motion slope[SLOPES], trial;
    double stretch[CABLES], stretch_rate[CABLES]; /* at the low end of the bracket of a change */
} step_memory;

void plant_advance(plant* p, motion* now, step_memory* memory, double time, double step);

#endif
