/* Facets and margins of rows for processors with AVX-512. */
#include "numbers/avx512.h"

#ifdef TOWLINE_X86
#include "numbers/lanes.h"
/* These need `num`. */
#include "available_wrench/facets_in_lanes.h"

#include "available_wrench/margins_in_lanes.h"
#endif
