/* Products and factors of small matrices for processors with AVX2. */
#include "numbers/avx2.h"

#define NAMED(name) name##_avx2 /* as FORM has it, without attributes of functions */

#ifdef TOWLINE_X86
#include "horizon/matrices_in_columns.h"
#endif
