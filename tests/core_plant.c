/* Run states of a plant from standard input and write what they become, for tests/test_core_plant.py. */
#include <stdio.h>
#include <stdlib.h>

#include "plant/plant.h"

/* Return as many bytes of standard input; memory is exactly as large as it must be, so that sanitizers see the end. */
static void *given(size_t bytes) {
    void *to = malloc(bytes ? bytes : 1);
    if (!to || fread(to, 1, bytes, stdin) != bytes) {
        exit(1);
    }
    return to;
}

static double *numbers(ptrdiff_t count) {
    double *to = calloc(count ? (size_t)count : 1, sizeof *to);
    if (!to) {
        exit(1);
    }
    return to;
}

int main(int argc, char **argv) {
    if (argc != 6) {
        return 1;
    }
    const ptrdiff_t rows = atol(argv[1]), steps = atol(argv[2]), keep = atol(argv[3]), kept = 1 + steps / keep;
    towline_robot *robot = given(sizeof *robot);
    towline_plant *plant = given(sizeof *plant);
    const ptrdiff_t size = towline_plant_state_size(robot), width = towline_plant_command_size(robot);
    const ptrdiff_t m = robot->cables, bodies = 1 + robot->carriers;
    double *states = given((size_t)(rows * size) * sizeof *states);
    double *commands = given((size_t)(rows * steps * width) * sizeof *commands);
    double *history = numbers(rows * kept * size), *tensions = numbers(rows * kept * m);
    double *motions = numbers(rows * kept * bodies * 12), *lengths = numbers(rows * kept * 2 * m);
    const towline_run run = {rows, steps, steps, keep, atoi(argv[4]), atof(argv[5])};
    towline_plant_run(robot, plant, &run, states, commands, history, tensions, NULL);
    towline_plant_sense(robot, rows * kept, history, motions, lengths);
    fwrite(history, sizeof *history, (size_t)(rows * kept * size), stdout);
    fwrite(tensions, sizeof *tensions, (size_t)(rows * kept * m), stdout);
    fwrite(lengths, sizeof *lengths, (size_t)(rows * kept * 2 * m), stdout);
    free(robot), free(plant), free(states), free(commands);
    free(history), free(tensions), free(motions), free(lengths);
    return 0;
}
