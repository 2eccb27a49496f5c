/* Products and factors of small matrices for every processor of its kind. */
#include "numbers/plain.h"

#define NAMED(name) name##_plain /* as FORM has it, without attributes of functions */

#include "horizon/matrices_in_columns.h"
