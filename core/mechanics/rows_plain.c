/* The mechanics of rows for every processor of its kind. */
#include "numbers/plain.h"

#ifndef TOWLINE_NO_LANES
#include "mechanics/rows_in_lanes.h"
#endif
