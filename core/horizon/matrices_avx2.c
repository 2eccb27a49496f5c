/* Products and factors of small matrices for processors with AVX2. */
#include "numbers/avx2.h"

#ifdef TOWLINE_X86
#include "horizon/matrices_in_columns.h"
#endif
