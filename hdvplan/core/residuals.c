/* How far a point is from optimal, recomputed from the program: the judge of every solver alike. */
#include "residuals.h"
#include "numbers.h"
#include "riccati.h"

#include <math.h>
#include <string.h>

/* larger() drops a NaN, the sum of all that was looked at keeps it. */
struct judged {
    double primal, dual, gap, sum;
};

/* Complementarity of a bound of v, whose multiplier is that of the upper side less that of the lower. Beside bounds as
 * near to each other as those of a slow steering a violation counts by its share of them. */
HDV_INLINE void judge_bound(double v, double low, double high, double multiplier, struct judged *to) {
    double over = v - high, under = low - v, near = larger(1.0, HDV_NEAR_BOUNDS / larger(high - low, HDV_ONE_BOUND));
    to->primal = larger(larger(to->primal, near * over), near * under);
    to->gap += fabs(larger(multiplier, 0.0) * over) + fabs(larger(-multiplier, 0.0) * under);
}

/* Whether numbers are all zero: the first is, and each has the bits of the next. */
static int all_zero(const double *numbers, int64_t count) {
    return count == 0 || (numbers[0] == 0.0 && memcmp(numbers, numbers + 1, (size_t)(count - 1) * sizeof(double)) == 0);
}

/* Row g'x - sigma <= h with sigma >= 0, whose multiplier is linear + quadratic sigma - multiplier. Most rows never
 * bind, and nothing holds them: they break nothing. */
HDV_INLINE void
judge_row(const double *x, struct row own, const double *of_row, int live, int64_t n, struct judged *to) {
    double sigma = of_row[0], multiplier = of_row[1], value = -*own.h - sigma;
    if (!live && sigma == 0.0 && multiplier == 0.0 && *own.h >= 0.0)
        return;
    for (int64_t k = 0; k < n && live; ++k)
        value += own.g[k] * x[k];
    double of_sigma = *own.linear + *own.quadratic * sigma - multiplier;
    to->primal = larger(larger(to->primal, value), -sigma);
    to->dual = larger(larger(to->dual, -multiplier), -of_sigma);
    to->gap += fabs(larger(multiplier, 0.0) * value) + fabs(larger(of_sigma, 0.0) * sigma);
    to->sum += value + of_sigma;
}

/* What belongs to the state of stage i, and all bounds. */
HDV_INLINE void judge_state(
    const struct hdv_program *program, const struct hdv_point *point, int64_t n, int64_t m, int64_t i, struct judged *to
) {
    int64_t p = program->shape.rows;
    struct stage stage = stage_at(program, n, m, i);
    struct point own = point_at(program, point, n, m, i), ahead = point_at(program, point, n, m, i + 1);
    struct range bounds = bounds_at(&program->shape, i);
    double slope[HDV_MOST_STATES];
    slope_of_state(program, point, stage, own, ahead.dynamics, slope, n, i);
    for (int64_t j = 0; j < n; ++j) {
        double with_own = slope[j] + own.dynamics[j];
        to->dual = larger(to->dual, fabs(with_own));
        to->sum += with_own;
    }
    int live = *stage.live > 0.0;
    const double *rows = point->rows + 2 * i * p;
    for (int64_t row = 0; row < p && i > 0 && (live || !all_zero(rows, 2 * p)); ++row)
        judge_row(own.x, row_at(program, n, i, row), rows + 2 * row, live, n, to);
    for (int64_t number = bounds.begin; number < bounds.end; ++number) {
        double v = *bounded_of(program, own.x, own.u, number);
        judge_bound(v, stage.low[number], stage.high[number], own.bounds[number], to);
    }
}

/* What belongs to the interval behind stage i: dynamics and inputs. */
HDV_INLINE void judge_interval(
    const struct hdv_program *program, const struct hdv_point *point, int64_t n, int64_t m, int64_t i, struct judged *to
) {
    int64_t b = program->shape.bounded;
    struct stage stage = stage_at(program, n, m, i);
    struct point own = point_at(program, point, n, m, i), ahead = point_at(program, point, n, m, i + 1);
    double reached[HDV_MOST_STATES];
    next_state(stage, own.x, own.u, reached, n, m, 1);
    for (int64_t j = 0; j < n; ++j) {
        double missed = reached[j] - ahead.x[j];
        to->primal = larger(to->primal, fabs(missed));
        to->sum += missed;
    }
    for (int64_t j = 0; j < m; ++j) {
        double slope = slope_of_input(stage, own.u, own.bounds[b + j], ahead.dynamics, n, m, j);
        to->dual = larger(to->dual, fabs(slope));
        to->sum += slope;
    }
}

HDV_INLINE void judge(
    const struct hdv_program *program, const struct hdv_point *point, struct hdv_residuals *found, int64_t n, int64_t m
) {
    struct judged to = {0.0, 0.0, 0.0, 0.0};
    for (int64_t j = 0; j < n; ++j)
        to.primal = larger(to.primal, fabs(point->stages[j] - program->x_first[j]));
    for (int64_t i = 0; i <= program->shape.stages; ++i) {
        judge_state(program, point, n, m, i, &to);
        if (i < program->shape.stages)
            judge_interval(program, point, n, m, i, &to);
    }
    int finite = fabs(to.sum) < INFINITY;
    found->primal = finite ? to.primal : NAN;
    found->dual = finite ? to.dual : NAN;
    found->gap = finite ? to.gap : NAN;
}

/* Write the residuals of a point; NaN where anything in it is not finite. */
void hdv_residuals(const struct hdv_program *program, const struct hdv_point *point, struct hdv_residuals *found) {
    int64_t n = program->shape.states, m = program->shape.inputs;
    HDV_UNROLLED(n, m, judge, program, point, found);
}
