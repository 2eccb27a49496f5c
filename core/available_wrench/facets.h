/* Facets and margins of rows, a form for each kind of processor. */
#ifndef TOWLINE_FACETS_H
#define TOWLINE_FACETS_H

#include "available_wrench/available_wrench.h"
#include "numbers/processor.h"

#define FACETS_OF_ROWS(form)                                                                            \
    void facets_of_rows_##form(const towline_matrices *matrices, const double *low, const double *high, \
                               double *normals, double *least, double *most)

#define MARGINS_OF_ROWS(form)                                                                                          \
    void margins_of_rows_##form(const towline_matrices *matrices, const double *w, ptrdiff_t w_per, const double *low, \
                                const double *high, double *margins, double *reserves)

FACETS_OF_ROWS(plain);
FACETS_OF_ROWS(avx2);
FACETS_OF_ROWS(avx512);
MARGINS_OF_ROWS(plain);
MARGINS_OF_ROWS(avx2);
MARGINS_OF_ROWS(avx512);

#endif
