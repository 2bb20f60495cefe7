/* Records whose sizes depend on a program's shape, as views: pointers to the parts of one record.
 *
 * A function that is written over these views takes n, m as arguments and is always inlined; its callers pass literals
 * for the common chains of 1 to 4 units (n = 3..6, m = 1), so that loops unroll and offsets are constants, and
 * variables for all others.
 */
#ifndef HDVPLAN_SIZES_H
#define HDVPLAN_SIZES_H

#include "hdvplan.h"

/* Stage i: x_{i+1} = A x_i + B u_i + c, cost Q, q, R, r, bounds of u_i and of the bounded states of x_i. Matrices by
 * rows. */
struct stage {
    double *A, *B, *c, *Q, *q, *R, *r, *u_low, *u_high;
    double *live; /* 1 where any row of the stage may bind */
    double *x_low, *x_high;
};

HDV_INLINE int64_t stage_size(int64_t n, int64_t m, int64_t b) {
    return 2 * n * n + n * m + 2 * n + m * m + 3 * m + 1 + 2 * b;
}

HDV_INLINE struct stage stage_at(double *stages, int64_t n, int64_t m, int64_t b, int64_t i) {
    double *A = stages + i * stage_size(n, m, b), *B = A + n * n, *c = B + n * m, *Q = c + n, *q = Q + n * n,
           *R = q + n, *r = R + m * m;
    struct stage view = {A, B, c, Q, q, R, r, r + m, r + 2 * m, r + 3 * m, r + 3 * m + 1, r + 3 * m + 1 + b};
    return view;
}

/* Stage i of a program. */
HDV_INLINE struct stage program_stage(const struct hdv_program *program, int64_t i) {
    const struct hdv_shape *shape = &program->shape;
    return stage_at(program->stages, shape->states, shape->inputs, shape->bounded, i);
}

/* Row of a stage: g'x - sigma <= h. */
struct row {
    double *g, *h, *linear, *quadratic;
};

HDV_INLINE struct row row_at(double *rows, int64_t n, int64_t p, int64_t i, int64_t number) {
    double *g = rows + (i * p + number) * (n + 3);
    struct row view = {g, g + n, g + n + 1, g + n + 2};
    return view;
}

/* g'x - h. */
HDV_INLINE double breach(struct row row, const double *x, int64_t n) {
    double over = -*row.h;
    for (int64_t j = 0; j < n; ++j)
        over += row.g[j] * x[j];
    return over;
}

/* Stage i of a primal-dual point. */
struct point {
    double *x, *u, *dynamics, *x_bounds, *u_bounds;
};

HDV_INLINE int64_t point_size(int64_t n, int64_t m, int64_t b) {
    return 2 * n + 2 * m + b;
}

HDV_INLINE struct point point_at(double *points, int64_t n, int64_t m, int64_t b, int64_t i) {
    double *x = points + i * point_size(n, m, b);
    struct point view = {x, x + n, x + n + m, x + 2 * n + m, x + 2 * n + m + b};
    return view;
}

/* State of the vehicle at stage i of a motion, whose record is z (n,), kappa. */
HDV_INLINE double *state_at(double *motion, int64_t n, int64_t i) {
    return motion + i * (n + 1);
}

#endif
