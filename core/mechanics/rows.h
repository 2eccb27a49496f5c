/* The mechanics of rows in lanes, a form for each kind of processor. */
#ifndef TOWLINE_MECHANICS_ROWS_H
#define TOWLINE_MECHANICS_ROWS_H

#include "mechanics/mechanics.h"
#include "numbers/processor.h"

#define LINES_OF_ROWS(form)                                                                                            \
    void lines_of_rows_##form(const towline_robot *robot, ptrdiff_t rows, const double *poses, const double *carriers, \
                              ptrdiff_t carriers_per, towline_lines want)
#define REQUIRED_WRENCH_OF_ROWS(form)                                                                                  \
    void required_wrench_of_rows_##form(const towline_robot *robot, ptrdiff_t rows, towline_motion_of_platform motion, \
                                        ptrdiff_t wind_per, double *w)

LINES_OF_ROWS(plain);
LINES_OF_ROWS(avx2);
LINES_OF_ROWS(avx512);
REQUIRED_WRENCH_OF_ROWS(plain);
REQUIRED_WRENCH_OF_ROWS(avx2);
REQUIRED_WRENCH_OF_ROWS(avx512);

#endif
