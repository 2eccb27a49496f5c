/* Rows in lanes, a form for each kind of processor: those whose status is TOWLINE_UNSURE, as far as lanes can. */
#ifndef TOWLINE_BATCH_ROWS_H
#define TOWLINE_BATCH_ROWS_H

#include "batch/batch.h"
#include "numbers/processor.h"

#define SOLVE_IN_LANES(form) void solve_in_lanes_##form(const towline_batch *batch, ptrdiff_t rows)

SOLVE_IN_LANES(plain);
SOLVE_IN_LANES(avx2);
SOLVE_IN_LANES(avx512);

#endif
