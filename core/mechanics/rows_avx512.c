/* The mechanics of rows for processors with AVX-512. */
#include "numbers/avx512.h"

#ifdef TOWLINE_X86
#include "numbers/lanes.h"
/* This needs `num`. */
#include "mechanics/rows_in_lanes.h"
#endif
