/* Rows in lanes for every processor of its kind. */
#include "numbers/plain.h"

#ifndef TOWLINE_NO_LANES
#include "batch/rows_in_lanes.h"
#endif
