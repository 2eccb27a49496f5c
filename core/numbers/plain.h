/* Include this first in a file whose functions serve every processor of its kind. */
#include "numbers/processor.h"

#define FORM(name) name##_plain

#define VECTOR_BYTES 16
