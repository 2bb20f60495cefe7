/* The Riccati recursion, the sweeps that use it, and the multipliers of the dynamics: see riccati.h. */
#include "riccati.h"
#include "numbers.h"

#include <math.h>

/* Share of an input's curvature below which what the inputs after it leave is rounding. */
static const double rounding = 1e-14;

/* Cost of a stage and of all that follows by x and u: 1/2 x'xx x + u'ux x + 1/2 u'uu u + x'x + u'u. */
struct cost {
    vector xx[HDV_MOST_STATES], ux[HDV_MOST_INPUTS], x;
    double uu[HDV_MOST_INPUTS][HDV_MOST_INPUTS], u[HDV_MOST_INPUTS];
};

/* Write Q + A'P+ A and B'P+ A. Only the lower triangle of P+ is used: its rounding is not handed on. */
HDV_INLINE void carry_states(struct stage stage, const double *Q, vector *P, struct cost *to, int64_t n, int64_t m) {
    vector A[HDV_MOST_STATES], PA[HDV_MOST_STATES];
    for (int64_t t = 0; t < n; ++t)
        load(A[t], stage.A + t * n, n);
    for (int64_t j = 0; j < n; ++j) {
        scale(PA[j], entry(P[j], 0), A[0], n);
        for (int64_t t = 1; t < n; ++t)
            add(PA[j], t < j ? entry(P[j], t) : entry(P[t], j), A[t], n);
    }
    for (int64_t j = 0; j < n; ++j) {
        load(to->xx[j], Q + j * n, n);
        for (int64_t t = 0; t < n; ++t)
            add(to->xx[j], stage.A[t * n + j], PA[t], n);
    }
    for (int64_t j = 0; j < m; ++j) {
        scale(to->ux[j], stage.B[j], PA[0], n);
        for (int64_t t = 1; t < n; ++t)
            add(to->ux[j], stage.B[t * m + j], PA[t], n);
    }
}

/* Write the inputs' Hessian R + B'P+ B. */
HDV_INLINE void carry_inputs(struct stage stage, const double *R, vector *P, struct cost *to, int64_t n, int64_t m) {
    vector PB;
    for (int64_t j = 0; j < m; ++j) {
        scale(PB, stage.B[j], P[0], n);
        for (int64_t t = 1; t < n; ++t)
            add(PB, stage.B[t * m + j], P[t], n);
        for (int64_t k = 0; k <= j; ++k) {
            to->uu[j][k] = R[j * m + k];
            for (int64_t t = 0; t < n; ++t)
                to->uu[j][k] += stage.B[t * m + k] * entry(PB, t);
        }
    }
}

/* Write the gradient (q, r) + (A, B)'v, where v = p+ + P+ c is the cost-to-go's gradient at x = 0, u = 0. */
HDV_INLINE void
carry_gradient(struct stage stage, struct weights weights, const four *v, struct cost *to, int64_t n, int64_t m) {
    vector A;
    load(to->x, weights.q, n);
    for (int64_t t = 0; t < n; ++t) {
        load(A, stage.A + t * n, n);
        add(to->x, entry(v, t), A, n);
    }
    for (int64_t j = 0; j < m; ++j) {
        to->u[j] = weights.r[j];
        for (int64_t t = 0; t < n; ++t)
            to->u[j] += stage.B[t * m + j] * entry(v, t);
    }
}

/* Minimise over the inputs, the last first: write K, L, k; leave the cost by x. Returns 0 if one has no curvature. */
HDV_INLINE int eliminate_inputs(struct cost *cost, struct recursion own, int64_t n, int64_t m) {
    double whole[HDV_MOST_INPUTS];
    for (int64_t j = 0; j < m; ++j)
        whole[j] = cost->uu[j][j];
    for (int64_t j = m - 1; j >= 0; --j) {
        if (!(whole[j] > 0.0))
            return 0;
        double per = 1.0 / larger(cost->uu[j][j], rounding * whole[j]);
        vector K;
        scale(K, per, cost->ux[j], n);
        for (int64_t k = 0; k < n; ++k)
            add(cost->xx[k], -entry(cost->ux[j], k), K, n);
        add(cost->x, -cost->u[j], K, n);
        for (int64_t k = 0; k < j; ++k) {
            double L = own.L[j * m + k] = per * cost->uu[j][k];
            add(cost->ux[k], -cost->uu[j][k], K, n);
            cost->u[k] -= L * cost->u[j];
            for (int64_t t = 0; t <= k; ++t)
                cost->uu[k][t] -= L * cost->uu[j][t];
        }
        store(own.K + j * n, K, n);
        own.k[j] = per * cost->u[j];
        own.L[j * m + j] = per;
    }
    return 1;
}

/* Keep a cost-to-go in the record of its stage. */
HDV_INLINE void keep(struct recursion own, vector *P, const four *p, int64_t n) {
    for (int64_t j = 0; j < n; ++j)
        store(own.P + j * n, P[j], n);
    store(own.p, p, n);
}

HDV_INLINE int64_t factorise(
    const struct hdv_program *program, const struct hdv_series *weights, double *work, int64_t end, int64_t affine,
    int64_t n, int64_t m
) {
    vector P[HDV_MOST_STATES], p;
    struct cost cost;
    for (int64_t j = 0; j < n; ++j)
        load(P[j], weights_at(weights, n, m, end).Q + j * n, n);
    load(p, weights_at(weights, n, m, end).q, n);
    keep(recursion_at(work, n, m, end), P, p, n);
    for (int64_t i = end - 1; i >= 0; --i) {
        struct stage stage = stage_at(program, n, m, i);
        struct weights weight = weights_at(weights, n, m, i);
        struct recursion own = recursion_at(work, n, m, i);
        for (int64_t t = 0; t < n && affine; ++t)
            add(p, stage.c[t], P[t], n);
        carry_inputs(stage, weight.R, P, &cost, n, m);
        carry_gradient(stage, weight, p, &cost, n, m);
        carry_states(stage, weight.Q, P, &cost, n, m);
        if (!eliminate_inputs(&cost, own, n, m))
            return 0;
        for (int64_t j = 0; j < n; ++j)
            copy(P[j], cost.xx[j], n);
        copy(p, cost.x, n);
        keep(own, P, p, n);
    }
    return 1;
}

/* Run the recursion from stage ``end`` down, whose cost-to-go are its own weights; return 0 where an input has no
 * curvature, else 1. Where it is not ``affine`` the dynamics are homogeneous. */
int64_t hdv_factorise(
    const struct hdv_program *program, const struct hdv_series *weights, double *work, int64_t end, int64_t affine
) {
    int64_t n = program->shape.states, m = program->shape.inputs;
    return HDV_UNROLLED(n, m, factorise, program, weights, work, end, affine);
}

/* p and k from those of the stage ahead, with the K and L that are there. */
HDV_INLINE void sweep_back(
    const struct hdv_program *program, const struct hdv_series *weights, double *work, int64_t end, int64_t n, int64_t m
) {
    vector p, K;
    struct cost cost;
    load(p, weights_at(weights, n, m, end).q, n);
    store(recursion_at(work, n, m, end).p, p, n);
    for (int64_t i = end - 1; i >= 0; --i) {
        struct recursion own = recursion_at(work, n, m, i);
        carry_gradient(stage_at(program, n, m, i), weights_at(weights, n, m, i), p, &cost, n, m);
        for (int64_t j = m - 1; j >= 0; --j) {
            load(K, own.K + j * n, n);
            add(cost.x, -cost.u[j], K, n);
            for (int64_t k = 0; k < j; ++k)
                cost.u[k] -= own.L[j * m + k] * cost.u[j];
            own.k[j] = own.L[j * m + j] * cost.u[j];
        }
        copy(p, cost.x, n);
        store(own.p, p, n);
    }
}

/* Write p and k once more for other q and r, of homogeneous dynamics. */
void hdv_sweep_back(const struct hdv_program *program, const struct hdv_series *weights, double *work, int64_t end) {
    int64_t n = program->shape.states, m = program->shape.inputs;
    HDV_UNROLLED(n, m, sweep_back, program, weights, work, end);
}

HDV_INLINE void sweep_ahead(
    const struct hdv_program *program, double *work, const struct hdv_series *motion, int64_t begin, int64_t end,
    int64_t affine, int64_t n, int64_t m
) {
    double x[HDV_MOST_STATES], u[HDV_MOST_INPUTS], ahead[HDV_MOST_STATES];
    for (int64_t j = 0; j < n; ++j)
        x[j] = motion->first[begin * motion->stride + j];
    for (int64_t i = begin; i < end; ++i) {
        double *to = motion->first + i * motion->stride;
        roll(stage_at(program, n, m, i), recursion_at(work, n, m, i), x, u, ahead, n, m, affine);
        for (int64_t j = 0; j < m; ++j)
            to[n + j] = u[j];
        for (int64_t j = 0; j < n; ++j)
            to[motion->stride + j] = x[j] = ahead[j];
    }
}

/* Roll the feedback out over the intervals begin <= i < end: write x and u of ``motion`` from its x at ``begin``.
 * Where it is not ``affine`` the dynamics are homogeneous. */
void hdv_sweep_ahead(
    const struct hdv_program *program, double *work, const struct hdv_series *motion, int64_t begin, int64_t end,
    int64_t affine
) {
    int64_t n = program->shape.states, m = program->shape.inputs;
    HDV_UNROLLED(n, m, sweep_ahead, program, work, motion, begin, end, affine);
}

HDV_INLINE double adjoint(const struct hdv_program *program, const struct hdv_point *point, int64_t n, int64_t m) {
    int64_t b = program->shape.bounded, last = program->shape.stages;
    double largest = 0.0, most = 1.0;
    for (int64_t i = last; i >= 0; --i) {
        struct stage stage = stage_at(program, n, m, i);
        struct point own = point_at(program, point, n, m, i);
        const double *ahead = point_at(program, point, n, m, i + 1).dynamics;
        slope_of_state(program, point, stage, own, ahead, own.dynamics, n, i);
        for (int64_t j = 0; j < n; ++j)
            own.dynamics[j] = -own.dynamics[j];
        for (int64_t j = 0; j < m && i < last; ++j) {
            largest = larger(largest, fabs(slope_of_input(stage, own.u, own.bounds[b + j], ahead, n, m, j)));
            most = larger(most, fabs(own.bounds[b + j]));
        }
        for (int64_t j = 0; j < n && i > 0; ++j)
            most = larger(most, fabs(own.dynamics[j]));
    }
    return largest / most;
}

/* Write the multipliers of the dynamics that make the Lagrangian stationary in every state. Returns the largest entry
 * of its gradient by the inputs, relative to the largest multiplier, or to 1. */
double hdv_adjoint(const struct hdv_program *program, const struct hdv_point *point) {
    int64_t n = program->shape.states, m = program->shape.inputs;
    return HDV_UNROLLED(n, m, adjoint, program, point);
}
