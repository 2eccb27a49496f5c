/*
 * The plant: many steps of many states, and what sensors measure of them, each row on its own.
 *
 * All of it is one source for the compiler, because functions such as `cross` are worth nothing unless they are inlined.
 * GCC would compute pairs of their numbers as vectors, write these to memory and read the numbers one by one, which
 * stalls: a step then takes a third longer.
 */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("no-tree-vectorize")
#endif

#include "plant/sensors.h"
#include "plant/state_rows.h"
#include "plant/step.h"
#include "plant/winch_forces.h"

ptrdiff_t towline_plant_state_size(const towline_robot *robot) {
    return TOWLINE_BODY_NUMBERS * (1 + robot->carriers) + TOWLINE_CABLE_BLOCKS * robot->cables;
}

ptrdiff_t towline_plant_command_size(const towline_robot *robot) {
    return TOWLINE_PLATFORM_COMMANDS + robot->cables + TOWLINE_CARRIER_COMMANDS * robot->carriers;
}

/* Begin a command, `row`; carriers move on to that of the next, `after`, which may be NULL. */
static void begin_command(plant *p, motion *now, const double *row, const double *after, double period) {
    const ptrdiff_t of_carriers = TOWLINE_PLATFORM_COMMANDS + p->cables;
    const carrier_command *carriers = (const carrier_command *)(row + of_carriers);
    p->on_platform = (const platform_command *)row;
    p->on_carriers = carriers;
    memcpy(p->commanded, row + TOWLINE_PLATFORM_COMMANDS, (size_t)p->cables * sizeof p->commanded[0]);
    set_thrusts(p, carriers);
    set_paths(p, now, carriers, after ? (const carrier_command *)(after + of_carriers) : NULL, period);
    take_command(p, now, period);
}

/* Return whether no pose has the lengths: a cable without stiffness is longer than its own after all impacts. */
static int is_torn(const plant *p) {
    for (int i = 0; i < p->cables && p->kind == CONSTRAINED; i++) {
        if (is_intact(p, i) && p->cable[i].stretch > TORN_LENGTH * p->robot->length_scale) { return 1; }
    }
    return 0;
}

/* Run one row: its state, commands, and places in the history. */
static void run_row(plant *p, const towline_run *run, const double *state, const double *commands, double *history,
                    double *tensions, double *means) {
    const ptrdiff_t size = towline_plant_state_size(p->robot), width = towline_plant_command_size(p->robot);
    const double step = run->period / run->substeps;
    motion now;
    step_memory memory;
    take_state(p, state, &now);
    for (int k = 0; k < SLOPES; k++) { clear(p, &memory.slope[k]); }
    memset(memory.impulse, 0, sizeof memory.impulse);
    for (ptrdiff_t k = 0; k < run->steps; k++) {
        const double *row = commands + k * width;
        begin_command(p, &now, row, k + 1 < run->commands ? row + width : NULL, run->period);
        for (int32_t s = 0; s < run->substeps; s++) {
            begin_contacts(p, &now, &memory.slope[0], step * s);
            if (is_torn(p)) { now.body[0].position[0] = NAN; }
            if (s == 0 && k % run->keep == 0) {
                record_state(p, &now, history + k / run->keep * size);
                record_tensions(p, tensions + k / run->keep * p->cables);
            }
            advance(p, &now, &memory, step * s, step);
            limit_winches(p, &now);
        }
        memcpy(p->reference, p->commanded, (size_t)p->cables * sizeof p->reference[0]);
    }
    for (int i = 0; means && i < p->cables; i++) { means[i] = memory.impulse[i] / (run->period * (double)run->steps); }
    if (run->steps % run->keep == 0) {
        set_geometry(p, &now, &memory.slope[0], run->period); /* puts imposed carriers where they are */
        record_state(p, &now, history + run->steps / run->keep * size);
        begin_contacts(p, &now, &memory.slope[0], run->period);
        record_tensions(p, tensions + run->steps / run->keep * p->cables);
        if (is_torn(p)) { history[run->steps / run->keep * size] = NAN; }
    }
}

void towline_plant_run(const towline_robot *robot, const towline_plant *settings, const towline_run *run,
                       const double *states, const double *commands, double *history, double *tensions, double *means) {
    const ptrdiff_t kept = 1 + run->steps / run->keep, size = towline_plant_state_size(robot);
    plant p;
    set_plant(&p, robot, settings);
    for (ptrdiff_t row = 0; row < run->rows; row++) {
        run_row(&p, run, states + row * size, commands + row * run->commands * towline_plant_command_size(robot),
                history + row * kept * size, tensions + row * kept * robot->cables,
                means ? means + row * robot->cables : NULL);
    }
}

void towline_plant_sense(const towline_robot *robot, ptrdiff_t rows, const double *states, double *motions,
                         double *lengths) {
    static const double at_the_frame[3] = {0, 0, 0};
    static const towline_plant settings = {TOWLINE_LENGTHS, 0, 0, 0, 0};
    const ptrdiff_t size = towline_plant_state_size(robot);
    motion now;
    plant p;
    set_plant(&p, robot, &settings);
    for (ptrdiff_t row = 0; row < rows; row++) {
        take_motion(&p, states + row * size, &now);
        for (int b = 0; b < p.bodies; b++) {
            set_attitude(&now.body[b], &p.body[b]);
            p.body[b].turned = 1;
            write_motion(&now.body[b], &p.body[b], b ? at_the_frame : robot->com, motions + 12 * (row * p.bodies + b));
        }
        set_lines(&p, &now);
        for (int i = 0; i < p.cables; i++) {
            double *of_row = lengths + 2 * row * p.cables;
            of_row[i] = p.cable[i].length;
            of_row[p.cables + i] = p.cable[i].length_rate;
        }
    }
}

void towline_plant_winch_forces(const towline_robot *robot, const towline_plant *plant_settings, ptrdiff_t rows,
                                ptrdiff_t commands_of_row, double period, const double *states, double *commands) {
    const towline_plant settings = {TOWLINE_TENSIONS, 0, plant_settings->carrier_bandwidth, 1, 0};
    const ptrdiff_t size = towline_plant_state_size(robot), width = towline_plant_command_size(robot);
    motion now;
    plant p;
    set_plant(&p, robot, &settings);
    p.has_winches = 0;
    for (ptrdiff_t row = 0; row < rows; row++) {
        const double *state = states + row * size;
        double *command = commands + row * commands_of_row * width;
        take_state(&p, state, &now);
        begin_command(&p, &now, command, commands_of_row > 1 ? command + width : NULL, period);
        write_winch_forces(&p, &now, state, period, command + TOWLINE_PLATFORM_COMMANDS);
    }
}
