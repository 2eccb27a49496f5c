/* Products and factors of small matrices, some columns at a time; included by matrices_plain.c and its like. */
#include "horizon/matrices.h"

#include <math.h>

#ifdef __GNUC__
#define INLINE static inline __attribute__((always_inline, unused))
#else
#define INLINE static inline
#endif

#ifdef TOWLINE_NO_LANES
typedef double columns;
enum { WIDTH = 1 };
#else
typedef double columns __attribute__((vector_size(VECTOR_BYTES), aligned(8), may_alias));
enum { WIDTH = VECTOR_BYTES / 8 };
#endif

enum { FOUR = 4, ROWS = 4, VECTORS = 2, PARTS = FOUR / WIDTH };

INLINE columns load(const double *at) { return *(const columns *)at; }

INLINE void store(double *at, columns x) { *(columns *)at = x; }

INLINE columns all(double x) { return x - (columns){0}; }

/* A few rows and vectors of a product, whose sums stay in registers. */
INLINE void multiply_tile(const product *of, int row, int column, const int rows, const int vectors) {
    columns sum[ROWS][VECTORS];
    const double *x = of->x.at + row, *y = of->y.at + column;
    for (int r = 0; r < rows; r++) {
        for (int v = 0; v < vectors; v++) { sum[r][v] = all(0); }
    }
    for (int i = 0; i < of->x.rows; i++) {
        for (int v = 0; v < vectors; v++) {
            const columns right = load(y + WIDTH * v);
            for (int r = 0; r < rows; r++) { sum[r][v] += x[r] * right; }
        }
        x += of->x.step;
        y += of->y.step;
    }
    for (int r = 0; r < rows; r++) {
        for (int v = 0; v < vectors; v++) {
            const int at = column + WIDTH * v;
            const columns base = of->base.at ? load(entry(of->base, row + r, at)) : all(0);
            store(entry(of->out, row + r, at), base + of->sign * sum[r][v]);
        }
    }
}

INLINE void multiply_rows(const product *of, int row, const int rows) {
    int column = of->upper ? row - row % FOUR : 0;
    for (; column + VECTORS * WIDTH <= (of->out.columns + FOUR - 1) / FOUR * FOUR; column += VECTORS * WIDTH) {
        multiply_tile(of, row, column, rows, VECTORS);
    }
    for (; column < of->out.columns; column += WIDTH) { multiply_tile(of, row, column, rows, 1); }
}

static void FORM(multiply)(const product *of) {
    int row = 0;
    for (; row + ROWS <= of->out.rows; row += ROWS) { multiply_rows(of, row, ROWS); }
    switch (of->out.rows - row) {
        case 3:
            multiply_rows(of, row, 3);
            break;
        case 2:
            multiply_rows(of, row, 2);
            break;
        case 1:
            multiply_rows(of, row, 1);
            break;
        default:
            break;
    }
}

/* Add a few rows times a vector, each in four sums, of which the first is that of columns 0, 4, 8, ... */
INLINE void add_dots(double *out, matrix x, const double *v, const int rows) {
    columns sum[ROWS][PARTS];
    double four[FOUR];
    for (int r = 0; r < rows; r++) {
        for (int part = 0; part < PARTS; part++) { sum[r][part] = all(0); }
    }
    for (int i = 0; i < x.columns; i += FOUR) {
        for (int part = 0; part < PARTS; part++) {
            const int at = i + WIDTH * part;
            for (int r = 0; r < rows; r++) { sum[r][part] += load(entry(x, r, at)) * load(v + at); }
        }
    }
    for (int r = 0; r < rows; r++) {
        for (int part = 0; part < PARTS; part++) { store(four + WIDTH * part, sum[r][part]); }
        out[r] += (four[0] + four[2]) + (four[1] + four[3]);
    }
}

static void FORM(add_product)(double *out, matrix x, const double *v) {
    for (; x.rows >= ROWS; x.rows -= ROWS, x.at += ROWS * x.step, out += ROWS) { add_dots(out, x, v, ROWS); }
    for (; x.rows > 0; x.rows--, x.at += x.step, out++) { add_dots(out, x, v, 1); }
}

INLINE void add_rows(double *out, const double *x, matrix of, const double *v, const int vectors) {
    columns sum[2 * VECTORS];
    for (int j = 0; j < vectors; j++) { sum[j] = load(out + WIDTH * j); }
    for (int i = 0; i < of.rows; i++) {
        for (int j = 0; j < vectors; j++) { sum[j] += v[i] * load(x + WIDTH * j); }
        x += of.step;
    }
    for (int j = 0; j < vectors; j++) { store(out + WIDTH * j, sum[j]); }
}

static void FORM(add_transposed_product)(double *out, matrix x, const double *v) {
    const int columns_of_x = (x.columns + FOUR - 1) / FOUR * FOUR;
    int column = 0;
    for (; column + 2 * VECTORS * WIDTH <= columns_of_x; column += 2 * VECTORS * WIDTH) {
        add_rows(out + column, x.at + column, x, v, 2 * VECTORS);
    }
    for (; column < columns_of_x; column += WIDTH) { add_rows(out + column, x.at + column, x, v, 1); }
}

/* Row i of U from column `column` on: that of the matrix less what the rows above have of it. */
INLINE void eliminate(matrix U, matrix symmetric, int i, int column, const int vectors) {
    columns sum[VECTORS];
    for (int v = 0; v < vectors; v++) { sum[v] = load(entry(symmetric, i, column + WIDTH * v)); }
    for (int j = 0; j < i; j++) {
        for (int v = 0; v < vectors; v++) { sum[v] -= *entry(U, j, i) * load(entry(U, j, column + WIDTH * v)); }
    }
    for (int v = 0; v < vectors; v++) { store(entry(U, i, column + WIDTH * v), sum[v]); }
}

/* Columns from `first` on; functions of a FORM call nothing with vectors as arguments, which Clang refuses. */
INLINE void scale(double *row, int first, int end, double by) {
    for (int j = first; j < end; j += WIDTH) { store(row + j, by * load(row + j)); }
}

INLINE void subtract(double *v, const double *row, int first, int end, double times) {
    for (int j = first; j < end; j += WIDTH) { store(v + j, load(v + j) - times * load(row + j)); }
}

static void FORM(factorise)(matrix U, double *inverse, matrix symmetric) {
    const int wide = (U.columns + FOUR - 1) / FOUR * FOUR;
    for (int i = 0; i < U.rows; i++) {
        const double before = *entry(symmetric, i, i);
        int column = i - i % FOUR;
        for (; column + VECTORS * WIDTH <= wide; column += VECTORS * WIDTH) {
            eliminate(U, symmetric, i, column, VECTORS);
        }
        for (; column < wide; column += WIDTH) { eliminate(U, symmetric, i, column, 1); }
        const double pivot = *entry(U, i, i);
        inverse[i] = 1.0 / sqrt(pivot > TOWLINE_FLAT * before ? pivot : TOWLINE_HUGE);
        scale(row_of(U, i), i - i % FOUR, wide, inverse[i]);
        for (int j = i - i % FOUR; j < i; j++) { *entry(U, i, j) = 0; }
    }
}

static void FORM(solve_lower)(double *v, double *zeta, matrix U, const double *inverse) {
    for (int i = 0; i < U.rows; i++) {
        zeta[i] = v[i] * inverse[i];
        subtract(v, row_of(U, i), i - i % FOUR, U.columns, zeta[i]);
    }
}

const towline_algebra NAMED(towline_algebra) = {
    NAMED(multiply), NAMED(add_product), NAMED(add_transposed_product), NAMED(factorise), NAMED(solve_lower),
};
