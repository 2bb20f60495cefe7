/* Riccati recursion for the equality part of a stage QP: one pass back and one ahead solve it.
 *
 * The cost-to-go of stage i is 1/2 x'P_i x + p_i'x. Its inputs are eliminated one by one, the last first: input j is
 * u_j = -K_j x - sum_{t < j} L_jt u_t - k_j, and L_jj is the inverse of its curvature. What is kept of a stage is one
 * record: P, p, K, k, L. Weights are those of any records in which Q, q, R, r follow each other: the program's own, or
 * with what inequalities add. Memory that fits into the processor's first cache is what makes this fast.
 */
#ifndef HDVPLAN_RICCATI_H
#define HDVPLAN_RICCATI_H

#include "sizes.h"
#include "vectors.h"

struct recursion {
    double *P, *p, *K, *k, *L;
};

HDV_INLINE int64_t recursion_size(int64_t n, int64_t m) {
    return n * n + n + m * n + m + m * m;
}

HDV_INLINE struct recursion recursion_at(double *work, int64_t n, int64_t m, int64_t i) {
    double *P = work + i * recursion_size(n, m), *p = P + n * n, *K = p + n, *k = K + m * n;
    return (struct recursion){P, p, K, k, k + m};
}

/* Records with Q, q, R, r in a row, or with x, u: the first such number, and how many lie from stage to stage. */
struct hdv_series {
    double *first;
    int64_t stride;
};

struct weights {
    double *Q, *q, *R, *r;
};

HDV_INLINE int64_t weights_size(int64_t n, int64_t m) {
    return n * n + n + m * m + m;
}

HDV_INLINE struct weights weights_at(const struct hdv_series *weights, int64_t n, int64_t m, int64_t i) {
    double *Q = weights->first + i * weights->stride, *q = Q + n * n, *R = q + n;
    return (struct weights){Q, q, R, R + m * m};
}

/* The entry of the Hessian that belongs to what a bound bounds. */
HDV_INLINE double *
hessian_of(const struct hdv_program *program, struct weights weights, int64_t n, int64_t m, int64_t number) {
    int64_t b = program->shape.bounded;
    return number < b ? weights.Q + program->bounded[number] * (n + 1) : weights.R + (number - b) * (m + 1);
}

/* The program's own weights. */
HDV_INLINE struct hdv_series own_weights(const struct hdv_program *program) {
    int64_t n = program->shape.states, m = program->shape.inputs, b = program->shape.bounded;
    return (struct hdv_series){stage_at(program, n, m, 0).Q, stage_size(n, m, b)};
}

/* x and u of a point. */
HDV_INLINE struct hdv_series motion_of(const struct hdv_program *program, const struct hdv_point *point) {
    const struct hdv_shape *shape = &program->shape;
    return (struct hdv_series){point->stages, point_size(shape->states, shape->inputs, shape->bounded)};
}

/* x+ = A x + B u + c; without c where it is not ``affine``. */
HDV_INLINE void
next_state(struct stage stage, const double *x, const double *u, double *ahead, int64_t n, int64_t m, int affine) {
    for (int64_t j = 0; j < n; ++j) {
        ahead[j] = affine ? stage.c[j] : 0.0;
        for (int64_t t = 0; t < n; ++t)
            ahead[j] += stage.A[j * n + t] * x[t];
        for (int64_t t = 0; t < m; ++t)
            ahead[j] += stage.B[j * m + t] * u[t];
    }
}

/* u = -K x - L u - k, and x+. */
HDV_INLINE void roll(
    struct stage stage, struct recursion own, const double *x, double *u, double *ahead, int64_t n, int64_t m,
    int affine
) {
    for (int64_t j = 0; j < m; ++j) {
        u[j] = -own.k[j];
        for (int64_t t = 0; t < n; ++t)
            u[j] -= own.K[j * n + t] * x[t];
        for (int64_t t = 0; t < j; ++t)
            u[j] -= own.L[j * m + t] * u[t];
    }
    next_state(stage, x, u, ahead, n, m, affine);
}

/* Gradient of the Lagrangian by the state of stage i, but for the multipliers of the dynamics that lead to it;
 * ``ahead`` are those of the dynamics behind it. */
HDV_INLINE void slope_of_state(
    const struct hdv_program *program, const struct hdv_point *point, struct stage stage, struct point own,
    const double *ahead, double *slope, int64_t n, int64_t i
) {
    int64_t b = program->shape.bounded, p = program->shape.rows;
    vector sum, row;
    load(sum, stage.q, n);
    for (int64_t t = 0; t < n; ++t) {
        load(row, stage.Q + t * n, n);
        add(sum, own.x[t], row, n);
    }
    for (int64_t t = 0; t < n && i < program->shape.stages; ++t) {
        load(row, stage.A + t * n, n);
        add(sum, -ahead[t], row, n);
    }
    for (int64_t number = 0; number < p && i > 0 && *stage.live > 0.0; ++number) {
        load(row, row_at(program, n, i, number).g, n);
        add(sum, point->rows[2 * (i * p + number) + 1], row, n);
    }
    store(slope, sum, n);
    for (int64_t bound = 0; bound < b && i > 0; ++bound)
        slope[program->bounded[bound]] += own.bounds[bound];
}

int64_t hdv_factorise(
    const struct hdv_program *program, const struct hdv_series *weights, double *work, int64_t end, int64_t affine
);
void hdv_sweep_back(const struct hdv_program *program, const struct hdv_series *weights, double *work, int64_t end);
void hdv_sweep_ahead(
    const struct hdv_program *program, double *work, const struct hdv_series *motion, int64_t begin, int64_t end,
    int64_t affine
);
HDV_EXPORT double hdv_adjoint(const struct hdv_program *program, const struct hdv_point *point);

#endif
