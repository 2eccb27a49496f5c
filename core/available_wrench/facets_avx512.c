/* Facets of rows for processors with AVX-512. */
#include "numbers/avx512.h"

#ifdef TOWLINE_X86
#include "numbers/lanes.h"
/* This needs `num`. */
#include "available_wrench/facets_in_lanes.h"
#endif
