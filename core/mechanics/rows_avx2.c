/* The mechanics of rows for processors with AVX2. */
#include "numbers/avx2.h"

#ifdef TOWLINE_X86
#include "numbers/lanes.h"
/* This needs `num`. */
#include "mechanics/rows_in_lanes.h"
#endif
