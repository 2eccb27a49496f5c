/* Facets of rows for every processor of its kind; without vectors one matrix after another. */
#include "numbers/plain.h"

#ifdef TOWLINE_NO_LANES
#include "numbers/one.h"
#else
#include "numbers/lanes.h"
#endif
/* This needs `num`. */
#include "available_wrench/facets_in_lanes.h"
