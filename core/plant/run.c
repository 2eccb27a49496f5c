/* Many steps of many states, each row on its own. */
#include "plant/internal.h"

/* Begin a command, `row`; carriers move on to that of the next, `after`, which may be NULL. */
static void begin_command(plant* p, motion* now, const double* row, const double* after, double period) {
    const ptrdiff_t of_carriers = TOWLINE_PLATFORM_COMMANDS + p->cables;
    const carrier_command* carriers = (const carrier_command*)(row + of_carriers);
    p->on_platform = (const platform_command*)row;
    memcpy(p->commanded, row + TOWLINE_PLATFORM_COMMANDS, (size_t)p->cables * sizeof p->commanded[0]);
    plant_set_thrusts(p, carriers);
    plant_set_paths(p, now, carriers, after ? (const carrier_command*)(after + of_carriers) : NULL, period);
    plant_take_command(p, now, period);
}

/* Run one row: its state, commands, and places in the history. */
static void run_row(plant* p, const towline_run* run, const double* state, const double* commands, double* history,
                    double* tensions) {
    const ptrdiff_t size = towline_plant_state_size(p->robot), width = towline_plant_command_size(p->robot);
    const double step = run->period / run->substeps;
    motion now;
    step_memory memory;
    plant_take_state(p, state, &now);
    for (int k = 0; k < SLOPES; k++) {
        plant_clear(p, &memory.slope[k]);
    }
    for (ptrdiff_t k = 0; k < run->steps; k++) {
        const double* row = commands + k * width;
        begin_command(p, &now, row, k + 1 < run->commands ? row + width : NULL, run->period);
        for (int32_t s = 0; s < run->substeps; s++) {
            plant_begin_contacts(p, &now, &memory.slope[0], step * s);
            if (s == 0 && k % run->keep == 0) {
                plant_record_state(p, &now, history + k / run->keep * size);
                plant_record_tensions(p, tensions + k / run->keep * p->cables);
            }
            plant_advance(p, &now, &memory, step * s, step);
            plant_limit_winches(p, &now);
        }
        memcpy(p->reference, p->commanded, (size_t)p->cables * sizeof p->reference[0]);
    }
    if (run->steps % run->keep == 0) {
        plant_set_geometry(p, &now, &memory.slope[0], run->period); /* puts imposed carriers where they are */
        plant_record_state(p, &now, history + run->steps / run->keep * size);
        plant_begin_contacts(p, &now, &memory.slope[0], run->period);
        plant_record_tensions(p, tensions + run->steps / run->keep * p->cables);
    }
}

void towline_plant_run(const towline_robot* robot, const towline_plant* settings, const towline_run* run,
                       const double* states, const double* commands, double* history, double* tensions) {
    const ptrdiff_t kept = 1 + run->steps / run->keep, size = towline_plant_state_size(robot);
    plant p;
    plant_set_plant(&p, robot, settings);
    for (ptrdiff_t row = 0; row < run->rows; row++) {
        run_row(&p, run, states + row * size, commands + row * run->commands * towline_plant_command_size(robot),
                history + row * kept * size, tensions + row * kept * robot->cables);
    }
}
