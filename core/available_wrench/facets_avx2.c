/* Facets of rows for processors with AVX2. */
#include "numbers/avx2.h"

#ifdef TOWLINE_X86
#include "numbers/lanes.h"
/* This needs `num`. */
#include "available_wrench/facets_in_lanes.h"
#endif
