/* Products and factors of small matrices for every processor of its kind. */
#include "numbers/plain.h"

#include "horizon/matrices_in_columns.h"
