/* Rows in lanes for processors with AVX2. */
#include "numbers/avx2.h"

#ifdef TOWLINE_X86
#include "batch/rows_in_lanes.h"
#endif
