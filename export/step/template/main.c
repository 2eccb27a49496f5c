/*
 * Compute steps from standard input, one per line, and print the status and the tensions of each.
 *
 * A line contains pose, velocity and desired acceleration of the platform (6 numbers each), then, if the robot has them, the
 * pose of each moving carrier (6 each) and the wind (3), then the disturbance (6). Numbers are separated by spaces;
 * disturbance, wind and carriers may be left out, in this order: no disturbance, still air, carriers at home.
 *
 * --certificate adds, after the tensions, the shortfall and the six numbers of its direction, zero where there is none.
 * --rate NEWTONS limits the change of each tension from one line to the next.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "towline_step.h"

enum {
    PLATFORM = 18,
    CARRIERS = PLATFORM + 6 * TOWLINE_CARRIERS,
    WIND = CARRIERS + 3 * TOWLINE_WIND,
    MOST = WIND + 6,
    LONGEST = 4096 /* characters in a line */
};

static int is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

/* Read the numbers of a line; return how many, MOST + 1 if there are more, or -1 if a word is no number. */
static int read_numbers(const char *text, double *numbers) {
    int count = 0;
    for (;;) {
        while (is_blank(*text)) {
            text++;
        }
        if (*text == '\0') {
            return count;
        }
        char *end;
        const double number = strtod(text, &end);
        if (end == text || (*end != '\0' && !is_blank(*end))) {
            return -1;
        }
        if (count == MOST) {
            return MOST + 1;
        }
        numbers[count++] = number;
        text = end;
    }
}

static const double *copy(towline_real *to, const double *from, int count) {
    for (int i = 0; i < count; i++) {
        to[i] = (towline_real)from[i];
    }
    return from + count;
}

static void fill(towline_input *input, const double *numbers, int count) {
    const double *next = copy(input->pose, numbers, 6);
    next = copy(input->velocity, next, 6);
    next = copy(input->acceleration, next, 6);
    towline_carriers_home(input);
#if TOWLINE_CARRIERS > 0
    if (count > PLATFORM) {
        next = copy(input->carrier_pose, next, 6 * TOWLINE_CARRIERS);
    }
#endif
#if TOWLINE_WIND
    if (count > CARRIERS) {
        next = copy(input->wind, next, 3);
    }
#endif
    if (count == MOST) {
        copy(input->disturbance, next, 6);
    }
}

static void print(const towline_answer *answer, int with_certificate) {
    printf("%s", towline_status_name(answer->status));
    for (int c = 0; c < TOWLINE_CABLES; c++) {
        printf(" %.17g", (double)answer->tensions[c]);
    }
    if (with_certificate) {
        printf(" %.17g", (double)answer->shortfall);
        for (int i = 0; i < 6; i++) {
            printf(" %.17g", (double)answer->direction[i]);
        }
    }
    printf("\n");
}

int main(int argc, char **argv) {
    int with_certificate = 0;
    double rate = (double)INFINITY;
    for (int i = 1; i < argc; i++) {
        char *end = NULL;
        if (strcmp(argv[i], "--certificate") == 0) {
            with_certificate = 1;
        } else if (strcmp(argv[i], "--rate") == 0 && i + 1 < argc && (rate = strtod(argv[i + 1], &end)) >= 0 &&
                   end != argv[i + 1] && *end == '\0') {
            i++;
        } else {
            fprintf(stderr, "usage: %s [--certificate] [--rate NEWTONS] < steps\n", argv[0]);
            return 2;
        }
    }
    towline_state state;
    towline_start(&state);
    for (int c = 0; c < TOWLINE_CABLES; c++) {
        state.rate_max[c] = (towline_real)rate;
    }
    char line[LONGEST + 2];
    for (long number = 1; fgets(line, (int)sizeof line, stdin) != NULL; number++) {
        double numbers[MOST];
        if (strlen(line) > LONGEST && line[LONGEST] != '\n') {
            fprintf(stderr, "line %ld: must have at most %d characters\n", number, LONGEST);
            return 1;
        }
        const int count = read_numbers(line, numbers);
        if (count < 0) {
            fprintf(stderr, "line %ld: must have only numbers, separated by spaces\n", number);
            return 1;
        }
        if (count != PLATFORM && count != CARRIERS && count != WIND && count != MOST) {
            fprintf(stderr, "line %ld: must have %s numbers, got %s%d\n", number, "@counts@", count > MOST ? "more than " : "",
                    count > MOST ? MOST : count);
            return 1;
        }
        towline_input input;
        memset(&input, 0, sizeof input);
        fill(&input, numbers, count);
        towline_answer answer;
        towline_step(&input, &state, &answer);
        print(&answer, with_certificate);
    }
    if (ferror(stdin) || fflush(stdout) != 0 || ferror(stdout)) {
        fprintf(stderr, "input or output failed\n");
        return 1;
    }
    return 0;
}
