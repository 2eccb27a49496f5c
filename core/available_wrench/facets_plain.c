/* Facets and margins of rows for every processor of its kind; without vectors one matrix after another. */
#include "numbers/plain.h"

#ifdef TOWLINE_NO_LANES
#include "numbers/one.h"
#else
#include "numbers/lanes.h"
#endif
/* These need `num`. */
#include "available_wrench/facets_in_lanes.h"

#include "available_wrench/margins_in_lanes.h"
