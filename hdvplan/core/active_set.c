/* A warm start for stage QPs: the active inequalities of the last plan are nearly always those of this plan.
 *
 * A primal-dual active set method (Hintermueller, Ito, Kunisch 2003): active inequalities are equalities, kept by a
 * stiff quadratic whose centre moves by their multipliers (augmented Lagrangian), so that a Riccati pass solves for
 * everything at once; then every inequality is looked at, and those of the wrong status change it. Elastic rows have a
 * third status, violated, where their penalty is a plain quadratic. With the right guess one or two passes do what an
 * interior point method needs twenty for. Of a run of broken rows only the deepest becomes active: rows of neighbouring
 * stages are nearly parallel, and all of them at once make the method chatter. Where a pass changes many statuses it
 * chatters all the same; then it says that it has not settled.
 */
#include "numbers.h"
#include "riccati.h"
#include "solver.h"

#include <math.h>

enum { PASSES = 12, CHANGES = 20 }; /* at most, and of statuses in a pass; few cases settle beyond either */

static const double stiff = 1e7;     /* of an active inequality [1/m^2]: more turns rounding into multipliers */
static const double kept = 1e-7;     /* of an active or inactive inequality [m, 1/m] */
static const double balanced = 1e-6; /* of the Lagrangian's gradient by the inputs, relative */
static const double carried = 1e-4;  /* a guess's multiplier beyond this means that its inequality was active */

/* What a look at all inequalities has found. */
struct verdict {
    int64_t changed; /* statuses that were wrong */
    int settled;     /* all statuses were right and are kept */
};

/* The inequalities of stage i. */
HDV_INLINE struct hdv_inequality *
inequalities_at(const struct hdv_solver *solver, const struct hdv_shape *shape, int64_t i) {
    return solver->inequalities + i * inequalities_of(shape);
}

static void take_for(struct hdv_inequality *one, int64_t status, double multiplier) {
    one->status = status;
    one->multiplier = multiplier;
}

/* Guess the status of a bound's two sides, upper and lower. */
static void guess_bound(struct hdv_inequality *sides, double multiplier) {
    take_for(sides, multiplier > carried ? HDV_ACTIVE : HDV_INACTIVE, multiplier > carried ? multiplier : 0.0);
    take_for(sides + 1, -multiplier > carried ? HDV_ACTIVE : HDV_INACTIVE, -multiplier > carried ? -multiplier : 0.0);
}

/* Guess the statuses of stage i. A row without a linear price is never active: it begins at no cost. */
static void
guess_stage(const struct hdv_program *program, const struct hdv_point *guess, struct hdv_inequality *own, int64_t i) {
    const struct hdv_shape *shape = &program->shape;
    int64_t n = shape->states, m = shape->inputs, p = shape->rows;
    struct point point = point_at(program, guess, n, m, i);
    struct range bounds = bounds_at(shape, i);
    double live = *stage_at(program, n, m, i).live;
    for (int64_t row = 0; row < p && i > 0; ++row) {
        const double *of_row = guess->rows + 2 * (i * p + row);
        int violated = of_row[0] > kept || !(*row_at(program, n, i, row).linear > 0.0);
        take_for(own + row, HDV_INACTIVE, 0.0);
        if (of_row[1] > carried && live > 0.0)
            take_for(own + row, violated ? HDV_VIOLATED : HDV_ACTIVE, of_row[1]);
    }
    for (int64_t number = bounds.begin; number < bounds.end; ++number)
        guess_bound(own + p + 2 * number, point.bounds[number]);
}

/* Write the guessed status and multiplier of every inequality; return whether any is not inactive. */
static int guess_statuses(struct hdv_solver *solver, const struct hdv_program *program, const struct hdv_point *guess) {
    int64_t p = program->shape.rows;
    int any = 0;
    for (int64_t i = 0; i <= program->shape.stages; ++i) {
        struct hdv_inequality *own = inequalities_at(solver, &program->shape, i);
        struct range bounds = bounds_at(&program->shape, i);
        guess_stage(program, guess, own, i);
        for (int64_t number = i > 0 ? 0 : p + 2 * bounds.begin; number < p + 2 * bounds.end; ++number)
            any |= own[number].status != HDV_INACTIVE; /* only those that are written: what counts */
    }
    return any;
}

/* Add the quadratic of a row that is not inactive: of weight stiff around its multiplier, or its own penalty. */
HDV_INLINE void weigh_row(struct row row, const struct hdv_inequality *own, struct weights to, int64_t n) {
    double weight = own->status == HDV_ACTIVE ? stiff : *row.quadratic;
    double slope = (own->status == HDV_ACTIVE ? own->multiplier : *row.linear) - weight * *row.h;
    for (int64_t j = 0; j < n; ++j) {
        to.q[j] += slope * row.g[j];
        for (int64_t k = 0; k < n; ++k)
            to.Q[j * n + k] += weight * (row.g[j] * row.g[k]);
    }
}

/* Add the quadratics of a bound's active sides to one gradient and one Hessian entry. */
HDV_INLINE void
weigh_bound(const struct hdv_inequality *sides, double low, double high, double *gradient, double *hessian) {
    if (sides[0].status == HDV_ACTIVE) {
        *gradient += sides[0].multiplier - stiff * high;
        *hessian += stiff;
    }
    if (sides[1].status == HDV_ACTIVE) {
        *gradient += -sides[1].multiplier - stiff * low;
        *hessian += stiff;
    }
}

/* Write the objective with the quadratics of all inequalities that are not inactive. */
HDV_INLINE void weigh(struct hdv_solver *solver, const struct hdv_program *program, int64_t n, int64_t m) {
    const struct hdv_shape *shape = &program->shape;
    int64_t p = shape->rows, size = weights_size(n, m);
    for (int64_t i = 0; i <= shape->stages; ++i) {
        const struct hdv_inequality *own = inequalities_at(solver, shape, i);
        struct stage stage = stage_at(program, n, m, i);
        struct range bounds = bounds_at(shape, i);
        struct hdv_series all = {solver->weights, size};
        struct weights to = weights_at(&all, n, m, i);
        for (int64_t j = 0; j < size; ++j)
            to.Q[j] = stage.Q[j];
        for (int64_t row = 0; row < p && i > 0 && *stage.live > 0.0; ++row)
            if (own[row].status != HDV_INACTIVE)
                weigh_row(row_at(program, n, i, row), own + row, to, n);
        for (int64_t number = bounds.begin; number < bounds.end; ++number)
            weigh_bound(
                own + p + 2 * number, stage.low[number], stage.high[number], bounded_of(program, to.q, to.r, number),
                hessian_of(program, to, n, m, number)
            );
    }
}

/* Move an active inequality's multiplier by what it lacks, change a wrong status; a bound's price is infinite. */
static void review(struct hdv_inequality *own, double price, double over, int deepest, struct verdict *to) {
    int64_t status = own->status;
    if (status == HDV_INACTIVE) {
        to->settled &= !(over > kept);
        if (over > kept && deepest)
            take_for(own, price > 0.0 ? HDV_ACTIVE : HDV_VIOLATED, 0.0);
    } else if (status == HDV_ACTIVE) {
        to->settled &= fabs(over) <= kept;
        own->multiplier += stiff * over;
        if (own->multiplier < 0.0)
            take_for(own, HDV_INACTIVE, 0.0);
        else if (own->multiplier > price)
            own->status = HDV_VIOLATED;
    } else if (over < 0.0) {
        take_for(own, price > 0.0 ? HDV_ACTIVE : HDV_INACTIVE, price);
    }
    to->changed += own->status != status;
}

/* Return whether a row, broken by ``over``, is not broken deeper at the stages beside its own. */
static int
is_deepest(const struct hdv_program *program, const struct hdv_point *at, double over, int64_t i, int64_t row) {
    const struct hdv_shape *shape = &program->shape;
    int64_t n = shape->states, m = shape->inputs;
    double before = -INFINITY, behind = -INFINITY;
    if (i > 1)
        before = breach(row_at(program, n, i - 1, row), point_at(program, at, n, m, i - 1).x, n);
    if (i < shape->stages)
        behind = breach(row_at(program, n, i + 1, row), point_at(program, at, n, m, i + 1).x, n);
    return over >= before && over > behind;
}

/* Look at all inequalities. */
HDV_INLINE struct verdict review_all(
    struct hdv_solver *solver, const struct hdv_program *program, const struct hdv_point *at, int64_t n, int64_t m
) {
    const struct hdv_shape *shape = &program->shape;
    int64_t p = shape->rows;
    struct verdict verdict = {0, 1};
    for (int64_t i = 0; i <= shape->stages; ++i) {
        struct hdv_inequality *own = inequalities_at(solver, shape, i);
        struct stage stage = stage_at(program, n, m, i);
        struct point point = point_at(program, at, n, m, i);
        struct range bounds = bounds_at(shape, i);
        for (int64_t row = 0; row < p && i > 0 && *stage.live > 0.0; ++row) {
            struct row one = row_at(program, n, i, row);
            double over = breach(one, point.x, n);
            if (over > kept || own[row].status != HDV_INACTIVE)
                review(own + row, *one.linear, over, is_deepest(program, at, over, i, row), &verdict);
        }
        for (int64_t number = bounds.begin; number < bounds.end; ++number) {
            double v = *bounded_of(program, point.x, point.u, number);
            review(own + p + 2 * number, INFINITY, v - stage.high[number], 1, &verdict);
            review(own + p + 2 * number + 1, INFINITY, stage.low[number] - v, 1, &verdict);
        }
    }
    verdict.settled &= verdict.changed == 0;
    return verdict;
}

/* Write elastic variables and multipliers to where the program has them. */
HDV_INLINE void publish(
    const struct hdv_solver *solver, const struct hdv_program *program, const struct hdv_point *to, int64_t n, int64_t m
) {
    const struct hdv_shape *shape = &program->shape;
    int64_t p = shape->rows;
    for (int64_t i = 0; i <= shape->stages; ++i) {
        const struct hdv_inequality *own = inequalities_at(solver, shape, i);
        struct point point = point_at(program, to, n, m, i);
        struct range bounds = bounds_at(shape, i);
        for (int64_t row = 0; row < p && i > 0; ++row) {
            struct row one = row_at(program, n, i, row);
            int violated = own[row].status == HDV_VIOLATED;
            double sigma = violated ? breach(one, point.x, n) : 0.0;
            to->rows[2 * (i * p + row)] = sigma;
            to->rows[2 * (i * p + row) + 1] = violated ? *one.linear + *one.quadratic * sigma : own[row].multiplier;
        }
        for (int64_t number = bounds.begin; number < bounds.end; ++number)
            point.bounds[number] = own[p + 2 * number].multiplier - own[p + 2 * number + 1].multiplier;
    }
}

HDV_INLINE int64_t settle(
    struct hdv_solver *solver, const struct hdv_program *program, const struct hdv_point *point, int64_t *count,
    int64_t n, int64_t m
) {
    int64_t last = program->shape.stages;
    struct hdv_series weights = {solver->weights, weights_size(n, m)}, motion = motion_of(program, point);
    struct verdict verdict = {0, 0};
    for (int64_t pass = 0; pass < PASSES && verdict.changed <= CHANGES && *count < solver->budget; ++pass) {
        weigh(solver, program, n, m);
        *count += 1;
        if (!hdv_factorise(program, &weights, solver->work, last, 1))
            return 0;
        hdv_sweep_ahead(program, solver->work, &motion, 0, last, 1);
        verdict = review_all(solver, program, point, n, m);
        if (!verdict.settled)
            continue;
        publish(solver, program, point, n, m);
        if (hdv_adjoint(program, point) < balanced)
            return 1;
    }
    return 0;
}

/* Solve a program from the active inequalities of ``guess``, if there are any; return whether that has settled. Only
 * then are multipliers and elastic variables of any meaning. The first state of ``point`` is given. */
int64_t hdv_settle(
    struct hdv_solver *solver, const struct hdv_program *program, const struct hdv_point *guess,
    const struct hdv_point *point, int64_t *count
) {
    int64_t n = program->shape.states, m = program->shape.inputs;
    if (!guess_statuses(solver, program, guess))
        return 0;
    return HDV_UNROLLED(n, m, settle, solver, program, point, count);
}
