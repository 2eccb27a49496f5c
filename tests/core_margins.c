/* Compute margins and reserves from standard input and write them, for tests/test_margins.py. */
#include <stdio.h>
#include <stdlib.h>

#include "available_wrench/available_wrench.h"
#include "numbers/processor.h"

/* As the test says, in place of the core's function. */
static int processor;

int towline_processor(void) { return processor; }

/* Memory is exactly as large as it must be, so that sanitizers see the end. */
static double *numbers(ptrdiff_t count, int given) {
    double *to = malloc((size_t)count * sizeof *to);
    if (!to || (given && fread(to, sizeof *to, (size_t)count, stdin) != (size_t)count)) {
        exit(1);
    }
    return to;
}

int main(int argc, char **argv) {
    if (argc != 5) {
        return 1;
    }
    const int n = atoi(argv[1]), m = atoi(argv[2]);
    const ptrdiff_t rows = atol(argv[3]), facets = towline_facets_of(n, m);
    processor = atoi(argv[4]);
    double *A = numbers(rows * n * m, 1), *w = numbers(rows * n, 1), *low = numbers(m, 1), *high = numbers(m, 1);
    double *margins = numbers(rows, 0), *reserves = numbers(rows * facets, 0);
    const towline_matrices matrices = {n, m, rows, A};
    towline_margins(&matrices, w, n, low, high, margins, reserves);
    fwrite(margins, sizeof *margins, (size_t)rows, stdout);
    fwrite(reserves, sizeof *reserves, (size_t)(rows * facets), stdout);
    towline_margins(&matrices, w, 0, low, high, margins, NULL);
    free(A), free(w), free(low), free(high), free(margins), free(reserves);
    return 0;
}
