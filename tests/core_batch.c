/* Solve a batch from standard input and write what each row gets, for tests/test_core_batch.py. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "batch/batch.h"
#include "batch/rows.h"

/* Return `count` numbers: those of standard input, or UNSURE for results. */
static double *numbers(size_t count, int are_given) {
    double *to = malloc((count ? count : 1) * sizeof *to);
    for (size_t i = 0; to && i < count; i++) {
        to[i] = TOWLINE_UNSURE;
    }
    if (!to || (are_given && fread(to, sizeof *to, count, stdin) != count)) {
        exit(1);
    }
    return to;
}

int main(int argc, char **argv) {
    if (argc != 6) {
        return 1;
    }
    const int n = atoi(argv[1]), m = atoi(argv[2]);
    const size_t rows = (size_t)atol(argv[3]), sizes[] = {(size_t)(n * m), (size_t)n, (size_t)m, (size_t)m, (size_t)m,
                                                          (size_t)m,       1,         (size_t)m, (size_t)n, 2,
                                                          1,               1};
    double *of[12];
    towline_column given[7];
    for (int i = 0; i < 12; i++) {
        of[i] = numbers(rows * sizes[i], i < 7);
    }
    for (int i = 0; i < 7; i++) {
        given[i] = (towline_column){of[i], (ptrdiff_t)sizes[i]};
    }
    const towline_batch batch = {n,        m,        atof(argv[4]), given[0], given[1], given[2], given[3], given[4],
                                 given[5], given[6], of[7],         of[8],    of[9],    of[10],   of[11]};
#ifndef TOWLINE_NO_LANES
    if (!strcmp(argv[5], "plain") && (m >= n || batch.rho > 0)) { /* as few lanes as a compiler has */
        solve_in_lanes_plain(&batch, (ptrdiff_t)rows);
    }
#endif
    towline_solve_batch(&batch, (ptrdiff_t)rows, strcmp(argv[5], "one") != 0);
    for (int i = 7; i < 12; i++) {
        fwrite(of[i], sizeof(double), rows * sizes[i], stdout);
        free(of[i]);
    }
    for (int i = 0; i < 7; i++) {
        free(of[i]);
    }
    return 0;
}
