/* The mechanics of rows for processors with AVX2. */
#include "numbers/avx2.h"

#ifdef TOWLINE_X86
#include "mechanics/rows_in_lanes.h"
#endif
