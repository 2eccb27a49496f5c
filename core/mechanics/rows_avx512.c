/* The mechanics of rows for processors with AVX-512. */
#include "numbers/avx512.h"

#ifdef TOWLINE_X86
#include "mechanics/rows_in_lanes.h"
#endif
