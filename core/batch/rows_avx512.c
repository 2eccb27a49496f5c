/* Rows in lanes for processors with AVX-512. */
#include "numbers/avx512.h"

#ifdef TOWLINE_X86
#include "batch/rows_in_lanes.h"
#endif
