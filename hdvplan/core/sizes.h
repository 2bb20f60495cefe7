/* Records whose sizes depend on a program's shape, as views: pointers to the parts of one record. */
#ifndef HDVPLAN_SIZES_H
#define HDVPLAN_SIZES_H

#include "hdvplan.h"

/* Calls a function that is always inlined, and whose last arguments are n and m: with literals for the common chains of
 * 1 to 4 units, so that its loops unroll and its offsets are constants. */
#define HDV_UNROLLED(n, m, function, ...)                                                                              \
    ((m) != 1   ? function(__VA_ARGS__, n, m)                                                                          \
     : (n) == 3 ? function(__VA_ARGS__, 3, 1)                                                                          \
     : (n) == 4 ? function(__VA_ARGS__, 4, 1)                                                                          \
     : (n) == 5 ? function(__VA_ARGS__, 5, 1)                                                                          \
     : (n) == 6 ? function(__VA_ARGS__, 6, 1)                                                                          \
                : function(__VA_ARGS__, n, 1))

/* Stage i: x_{i+1} = A x_i + B u_i + c, cost Q, q, R, r. Matrices by rows. */
struct stage {
    double *A, *B, *c, *Q, *q, *R, *r;
    double *live;       /* 1 where any row of the stage may bind */
    double *low, *high; /* (b + m,), bounds of the bounded states of x_i, then of u_i */
};

HDV_INLINE int64_t stage_size(int64_t n, int64_t m, int64_t b) {
    return 2 * n * n + n * m + 2 * n + m * m + 3 * m + 1 + 2 * b;
}

HDV_INLINE struct stage stage_at(const struct hdv_program *program, int64_t n, int64_t m, int64_t i) {
    int64_t b = program->shape.bounded;
    double *A = program->stages + i * stage_size(n, m, b), *B = A + n * n, *c = B + n * m, *Q = c + n, *q = Q + n * n,
           *R = q + n, *r = R + m * m;
    return (struct stage){A, B, c, Q, q, R, r, r + m, r + m + 1, r + 2 * m + 1 + b};
}

/* Stage i of a program. */
HDV_INLINE struct stage program_stage(const struct hdv_program *program, int64_t i) {
    return stage_at(program, program->shape.states, program->shape.inputs, i);
}

/* The bounds of stage i that count, begin <= number < end: the first state is given, and no input leaves the last. */
struct range {
    int64_t begin, end;
};

HDV_INLINE struct range bounds_at(const struct hdv_shape *shape, int64_t i) {
    return (struct range){i > 0 ? 0 : shape->bounded, shape->bounded + (i < shape->stages ? shape->inputs : 0)};
}

/* What a bound bounds: of the states x, or of the inputs u; and the same of what belongs to them. */
HDV_INLINE double *bounded_of(const struct hdv_program *program, double *x, double *u, int64_t number) {
    int64_t b = program->shape.bounded;
    return number < b ? &x[program->bounded[number]] : &u[number - b];
}

/* Row of a stage: g'x - sigma <= h. */
struct row {
    double *g, *h, *linear, *quadratic;
};

HDV_INLINE struct row row_at(const struct hdv_program *program, int64_t n, int64_t i, int64_t number) {
    double *g = program->rows + (i * program->shape.rows + number) * (n + 3);
    return (struct row){g, g + n, g + n + 1, g + n + 2};
}

HDV_INLINE struct row program_row(const struct hdv_program *program, int64_t i, int64_t number) {
    return row_at(program, program->shape.states, i, number);
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
    double *x, *u, *dynamics, *bounds; /* multipliers: of a bound's upper side less that of the lower */
};

HDV_INLINE int64_t point_size(int64_t n, int64_t m, int64_t b) {
    return 2 * n + 2 * m + b;
}

HDV_INLINE struct point
point_at(const struct hdv_program *program, const struct hdv_point *points, int64_t n, int64_t m, int64_t i) {
    double *x = points->stages + i * point_size(n, m, program->shape.bounded);
    return (struct point){x, x + n, x + n + m, x + 2 * n + m};
}

HDV_INLINE struct point program_point(const struct hdv_program *program, const struct hdv_point *points, int64_t i) {
    return point_at(program, points, program->shape.states, program->shape.inputs, i);
}

/* Gradient of the Lagrangian by input j; multipliers are its bound's, and ``ahead`` those of the dynamics behind it. */
HDV_INLINE double slope_of_input(
    struct stage stage, const double *u, double bound, const double *ahead, int64_t n, int64_t m, int64_t j
) {
    double slope = stage.r[j] + bound;
    for (int64_t k = 0; k < m; ++k)
        slope += stage.R[j * m + k] * u[k];
    for (int64_t k = 0; k < n; ++k)
        slope -= stage.B[k * m + j] * ahead[k];
    return slope;
}

/* State of the vehicle at stage i of a motion, whose record is z (n,), kappa. */
HDV_INLINE double *state_at(double *motion, int64_t n, int64_t i) {
    return motion + i * (n + 1);
}

#endif
