/* Mehrotra's predictor-corrector method, with one Riccati factorisation an iteration: inequalities only add to a
 * stage's Hessian (Rao, Wright, Rawlings 1998; Frison, Diehl 2020). All iterates keep the dynamics, so only
 * inequalities have residuals.
 *
 * Only inequalities that come near the point take part, each a row value <= limit of one interval, with a slack and a
 * multiplier (s, mu) and, for elastic rows, a second pair (sigma, nu) that is eliminated by hand:
 *
 *     W = w v / (w + v),   w = mu / s,   v = nu / sigma + quadratic,
 *
 * which stays exact however large the weights grow. The Newton system that is left is a linear-quadratic control
 * problem. All others are looked at after every step and join as soon as they come near. The horizon behind the last of
 * them is left out: the cost-to-go that was there before replaces it exactly.
 */
#include "numbers.h"
#include "riccati.h"
#include "solver.h"

#include <math.h>
#include <string.h>

enum { ITERATIONS = 100, EXTRA = 3 }; /* EXTRA may go into balancing the inputs once all inequalities are settled */

static const double near_rows = 0.3;   /* rows closer than this are chosen [m] */
static const double near_bounds = 0.3; /* bounds closer than this share of their range are */
static const double start_slack = 0.1; /* least slack at the start, for rows [m] and as a share of a bound's range */
static const double least_price = 0.1; /* least multiplier of an elastic variable at the start */
static const double start = 100.0;     /* complementarity at the start; rows cost 1e4, so less starts too near a wall */
static const double balanced = 1e-7;   /* of the gradient by the inputs, relative to the largest multiplier */

/* An iterate: where it stands, and which inequalities take part. */
struct iterate {
    struct hdv_solver *solver;
    const struct hdv_program *program;
    const struct hdv_point *point;
    struct hdv_series weights, steps; /* of steps x, u */
    int64_t count;                    /* of the chosen inequalities */
    int64_t end;           /* the last stage that one of them touches; beyond it stands the first pass's cost-to-go */
    double products, mean; /* of slack and multiplier: how many, and their mean */
    double slope, bend;    /* of their sum, by the share of the Newton step that is taken */
};

struct step {
    double *x, *u;
};

HDV_INLINE struct step step_at(const struct iterate *now, int64_t n, int64_t i) {
    double *x = now->steps.first + i * now->steps.stride;
    return (struct step){x, x + n};
}

/* Write a row's pair; it starts where the row is, its elastic variable taking up what it lacks. gap = h - g'x. */
static void start_row(struct hdv_pair *pair, struct row row, double gap, double product) {
    double s = larger(gap, start_slack), price = *row.linear;
    double mu = price > 0.0 ? smaller(product / s, 0.5 * price) : product / s;
    double nu = larger(price - mu, least_price);
    pair->s = s;
    pair->mu = mu;
    pair->sigma = larger(product / nu, s - gap);
    pair->nu = nu;
    pair->limit = *row.h;
    pair->linear = price;
    pair->quadratic = *row.quadratic;
}

/* Write the pair of a bound's side; return whether v is near it, or need not be. A broken one's slack is the breach. */
static int
start_bound(struct hdv_pair *pair, double v, double low, double high, int lower, double product, int everything) {
    double width = smaller(high - low, 1.0), gap = lower ? v - low : high - v;
    if (gap > near_bounds * width && !(everything && gap < INFINITY))
        return 0;
    pair->s = larger(larger(fabs(gap), start_slack * width), 1e-6);
    pair->mu = product / pair->s;
    pair->limit = lower ? -low : high;
    return 1;
}

/* Let the next pair, which has been written, take part. */
static void choose(struct iterate *now, uint8_t *member, int64_t kind, int64_t stage, int64_t index) {
    struct hdv_pair *pair = now->solver->pairs + now->count;
    pair->kind = kind;
    pair->stage = stage;
    pair->index = index;
    *member = 1;
    now->count += 1;
}

/* Let the sides of a bound take part that have come near; return how many. */
static int64_t
join_bound(struct iterate *now, uint8_t *member, double v, double low, double high, int64_t stage, int64_t number) {
    int64_t before = now->count;
    for (int lower = 0; lower < 2; ++lower) {
        struct hdv_pair *pair = now->solver->pairs + now->count;
        if (!member[lower] && start_bound(pair, v, low, high, lower, now->mean, !now->solver->screens))
            choose(now, member + lower, lower ? HDV_LOW : HDV_HIGH, stage, number);
    }
    return now->count - before;
}

/* Let the rows of stage i take part that have come near. */
HDV_INLINE void join_rows(struct iterate *now, uint8_t *member, const double *x, int64_t n, int64_t i) {
    for (int64_t number = 0; number < now->program->shape.rows; ++number) {
        struct row row = row_at(now->program, n, i, number);
        double gap = *row.h;
        for (int64_t j = 0; j < n; ++j)
            gap -= row.g[j] * x[j];
        if ((gap <= near_rows || !now->solver->screens) && !member[number]) {
            start_row(now->solver->pairs + now->count, row, gap, now->mean);
            choose(now, member + number, HDV_ROW, i, number);
        }
    }
}

/* Choose the inequalities that have come near the point, or all, in addition to those already chosen; each starts with
 * complementarity ``mean``. Returns the last stage whose state has an inequality that joined, or whose input is
 * followed by such a state; or 0. */
HDV_INLINE int64_t join(struct iterate *now, int64_t n, int64_t m) {
    const struct hdv_program *program = now->program;
    const struct hdv_shape *shape = &program->shape;
    int64_t b = shape->bounded, p = shape->rows, end = 0;
    for (int64_t i = 0; i <= shape->stages; ++i) {
        uint8_t *member = now->solver->member + i * inequalities_of(shape);
        struct stage stage = stage_at(program, n, m, i);
        struct point point = point_at(program, now->point, n, m, i);
        struct range bounds = bounds_at(shape, i);
        int64_t before = now->count;
        if (i > 0 && (*stage.live > 0.0 || !now->solver->screens))
            join_rows(now, member, point.x, n, i);
        end = now->count > before ? i : end;
        for (int64_t number = bounds.begin; number < bounds.end; ++number) {
            double v = *bounded_of(program, point.x, point.u, number);
            if (join_bound(now, member + p + 2 * number, v, stage.low[number], stage.high[number], i, number))
                end = number < b ? i : i + 1;
        }
    }
    return end;
}

/* Write the derivatives of 1/2 v'Hv + g'v at v. */
HDV_INLINE void
derive(const double *H, const double *g, const double *v, int64_t size, double *hessian, double *gradient) {
    for (int64_t j = 0; j < size; ++j) {
        double sum = g[j];
        for (int64_t k = 0; k < size; ++k) {
            hessian[j * size + k] = H[j * size + k];
            sum += H[j * size + k] * v[k];
        }
        gradient[j] = sum;
    }
}

/* Write the objective's derivatives at the point, up to ``end``, where ``tail`` is the cost-to-go (P, p). */
HDV_INLINE void objective(const struct iterate *now, const double *tail, int64_t n, int64_t m) {
    const struct hdv_program *program = now->program;
    for (int64_t i = 0; i < now->end; ++i) {
        struct stage stage = stage_at(program, n, m, i);
        struct point point = point_at(program, now->point, n, m, i);
        struct weights to = weights_at(&now->weights, n, m, i);
        derive(stage.Q, stage.q, point.x, n, to.Q, to.q);
        derive(stage.R, stage.r, point.u, m, to.R, to.r);
    }
    struct weights to = weights_at(&now->weights, n, m, now->end);
    derive(tail, tail + n * n, point_at(program, now->point, n, m, now->end).x, n, to.Q, to.q);
    memset(to.r, 0, (size_t)m * sizeof(double));
}

/* The sign with which a bound's value counts. */
static double sign_of(const struct hdv_pair *pair) {
    return pair->kind == HDV_LOW ? -1.0 : 1.0;
}

/* An inequality's value at x, u: g'x of a row, or +-x or +-u. */
HDV_INLINE double
value_of(const struct hdv_program *program, const struct hdv_pair *pair, double *x, double *u, int64_t n) {
    if (pair->kind != HDV_ROW)
        return sign_of(pair) * *bounded_of(program, x, u, pair->index);
    struct row row = row_at(program, n, pair->stage, pair->index);
    double sum = 0.0;
    for (int64_t j = 0; j < n; ++j)
        sum += row.g[j] * x[j];
    return sum;
}

/* Eliminate a row's elastic variable, whose slack and multiplier have weight ``pair->w``; return the weight of both. */
static double weight_of_row(struct hdv_pair *pair) {
    pair->per_sigma = 1.0 / pair->sigma;
    pair->v = pair->nu * pair->per_sigma + pair->quadratic;
    pair->per_both = 1.0 / (pair->w + pair->v);
    return pair->w * (pair->v * pair->per_both);
}

/* Write an inequality's part of the Newton step's right-hand side towards complementarity ``target``; return what it
 * pushes against its value with. With ``second_order`` the last step's products are made up for. */
static double push(struct hdv_pair *pair, double target, int second_order) {
    double over = pair->mu * pair->s - target + (second_order ? pair->d_mu * pair->d_s : 0.0);
    pair->first = pair->w * pair->residual - over * pair->per_s;
    if (pair->kind != HDV_ROW)
        return pair->mu + pair->first;
    pair->under = pair->nu * pair->sigma - target + (second_order ? pair->d_nu * pair->d_sigma : 0.0);
    pair->second = pair->mu + pair->nu - pair->linear - pair->quadratic * pair->sigma - pair->under * pair->per_sigma;
    return pair->mu + (pair->v * pair->first - pair->w * pair->second) * pair->per_both;
}

/* Add an inequality's push to the gradient, and its weight to the Hessian unless that is 0. */
HDV_INLINE void
add_pair(const struct iterate *now, const struct hdv_pair *pair, double pushed, double weight, int64_t n, int64_t m) {
    struct weights to = weights_at(&now->weights, n, m, pair->stage);
    if (pair->kind != HDV_ROW) {
        *bounded_of(now->program, to.q, to.r, pair->index) += sign_of(pair) * pushed;
        *hessian_of(now->program, to, n, m, pair->index) += weight;
        return;
    }
    const double *g = row_at(now->program, n, pair->stage, pair->index).g;
    for (int64_t j = 0; j < n; ++j)
        to.q[j] += g[j] * pushed;
    for (int64_t j = 0; j < n && weight > 0.0; ++j)
        for (int64_t k = 0; k < n; ++k)
            to.Q[j * n + k] += weight * g[j] * g[k];
}

/* Add the chosen inequalities to the objective's derivatives, for the predictor, which aims at complementarity 0; write
 * the mean product, return the largest error. A pair's error is its product or, where its multiplier is large, its
 * slack: both vanish at the optimum. */
HDV_INLINE double weigh(struct iterate *now, int64_t n, int64_t m) {
    double total = 0.0, largest = 0.0;
    now->products = 0.0;
    for (int64_t item = 0; item < now->count; ++item) {
        struct hdv_pair *pair = now->solver->pairs + item;
        struct point point = point_at(now->program, now->point, n, m, pair->stage);
        now->products += 1.0;
        total += pair->mu * pair->s;
        largest = larger(largest, smaller(pair->mu, 1.0) * pair->s);
        pair->per_s = 1.0 / pair->s;
        pair->w = pair->mu * pair->per_s;
        pair->residual = pair->s - pair->limit + value_of(now->program, pair, point.x, point.u, n);
        double weight = pair->w;
        if (pair->kind == HDV_ROW) {
            pair->residual -= pair->sigma;
            now->products += 1.0;
            total += pair->nu * pair->sigma;
            largest = larger(largest, smaller(pair->nu, 1.0) * pair->sigma);
            weight = weight_of_row(pair);
        }
        pair->pushed = push(pair, 0.0, 0);
        add_pair(now, pair, pair->pushed, weight, n, m);
        largest = larger(largest, fabs(pair->residual));
    }
    now->mean = total / now->products;
    return largest;
}

/* Change the gradient for the corrector, which aims at complementarity ``target``. */
HDV_INLINE void correct(const struct iterate *now, double target, int64_t n, int64_t m) {
    for (int64_t item = 0; item < now->count; ++item) {
        struct hdv_pair *pair = now->solver->pairs + item;
        add_pair(now, pair, push(pair, target, 1) - pair->pushed, 0.0, n, m);
    }
}

/* How far v may go along d, if no further than ``length``, until it vanishes. */
HDV_INLINE double shortened(double length, double v, double d) {
    return v + length * d < 0.0 ? -v / d : length;
}

/* Write a pair's step where the value moves by ``along``; return how far it may go. */
static double step_pair(struct hdv_pair *pair, double along, double length) {
    double d_s = -pair->residual - along, d_mu = pair->w * along + pair->first;
    if (pair->kind == HDV_ROW) {
        pair->d_sigma = (d_mu + pair->second) * pair->per_both;
        d_s += pair->d_sigma;
        d_mu = (pair->v * d_mu - pair->w * pair->second) * pair->per_both;
        pair->d_nu = -(pair->under + pair->nu * pair->d_sigma) * pair->per_sigma;
        length = shortened(length, pair->sigma, pair->d_sigma);
        length = shortened(length, pair->nu, pair->d_nu);
    }
    pair->d_s = d_s;
    pair->d_mu = d_mu;
    return shortened(shortened(length, pair->s, d_s), pair->mu, d_mu);
}

/* Write the Newton step in the intervals before ``end`` from the recursion's K and k; return how far it may go. */
HDV_INLINE double newton_step(struct iterate *now, int64_t n) {
    struct hdv_solver *solver = now->solver;
    memset(step_at(now, n, 0).x, 0, (size_t)n * sizeof(double));
    hdv_sweep_ahead(now->program, solver->work, &now->steps, 0, now->end, 0);
    double length = 1.0; /* divisions only where it shrinks */
    now->slope = now->bend = 0.0;
    for (int64_t item = 0; item < now->count; ++item) {
        struct hdv_pair *pair = solver->pairs + item;
        struct step step = step_at(now, n, pair->stage);
        length = step_pair(pair, value_of(now->program, pair, step.x, step.u, n), length);
        now->slope += pair->s * pair->d_mu + pair->mu * pair->d_s;
        now->bend += pair->d_s * pair->d_mu;
        if (pair->kind == HDV_ROW) {
            now->slope += pair->sigma * pair->d_nu + pair->nu * pair->d_sigma;
            now->bend += pair->d_sigma * pair->d_nu;
        }
    }
    return length;
}

/* The predictor aims at complementarity 0; the corrector at a target that the predictor's success tells, with its
 * second-order term. Returns how far to go, or -1 where an input has no curvature. */
HDV_INLINE double predict_and_correct(struct iterate *now, int64_t n, int64_t m) {
    if (!hdv_factorise(now->program, &now->weights, now->solver->work, now->end, 0))
        return -1.0;
    double length = newton_step(now, n);
    double left = now->mean + length * (now->slope + length * now->bend) / now->products, share = left / now->mean;
    double target = larger(
        now->mean * (share * share * share), 0.01 * now->solver->tolerance
    ); /* no pair may run far ahead of the others */
    correct(now, target, n, m);
    hdv_sweep_back(now->program, &now->weights, now->solver->work, now->end);
    return smaller(1.0, 0.995 * newton_step(now, n));
}

/* Take ``length`` of the step. States are computed again: the rounding of iterates far away must not stay. */
HDV_INLINE void move(struct iterate *now, double length, int64_t n, int64_t m) {
    const struct hdv_program *program = now->program;
    for (int64_t item = 0; item < now->count; ++item) {
        struct hdv_pair *pair = now->solver->pairs + item;
        pair->s += length * pair->d_s;
        pair->mu += length * pair->d_mu;
        if (pair->kind == HDV_ROW) {
            pair->sigma += length * pair->d_sigma;
            pair->nu += length * pair->d_nu;
        }
    }
    for (int64_t i = 0; i < now->end; ++i) {
        struct stage stage = stage_at(program, n, m, i);
        struct point point = point_at(program, now->point, n, m, i);
        for (int64_t j = 0; j < m; ++j)
            point.u[j] += length * step_at(now, n, i).u[j];
        next_state(stage, point.x, point.u, point_at(program, now->point, n, m, i + 1).x, n, m, 1);
    }
    struct hdv_series motion = motion_of(program, now->point);
    hdv_sweep_ahead(program, now->solver->work, &motion, now->end, program->shape.stages, 1);
}

/* Write zeros for elastic variables and multipliers of inequalities. */
static void clear(const struct hdv_program *program, const struct hdv_point *point) {
    const struct hdv_shape *shape = &program->shape;
    int64_t n = shape->states, m = shape->inputs, b = shape->bounded;
    memset(point->rows, 0, (size_t)((shape->stages + 1) * shape->rows * 2) * sizeof(double));
    for (int64_t i = 0; i <= shape->stages; ++i)
        memset(point_at(program, point, n, m, i).bounds, 0, (size_t)(b + m) * sizeof(double));
}

/* Write elastic variables and all multipliers to where the program has them; what was never chosen is zero. */
static double publish(const struct iterate *now) {
    const struct hdv_shape *shape = &now->program->shape;
    int64_t n = shape->states, m = shape->inputs;
    clear(now->program, now->point);
    for (int64_t item = 0; item < now->count; ++item) {
        const struct hdv_pair *pair = now->solver->pairs + item;
        struct point point = point_at(now->program, now->point, n, m, pair->stage);
        double *of_row = now->point->rows + 2 * (pair->stage * shape->rows + pair->index);
        if (pair->kind == HDV_ROW) {
            of_row[0] = pair->sigma;
            of_row[1] = pair->mu;
        } else {
            point.bounds[pair->index] += sign_of(pair) * pair->mu;
        }
    }
    return hdv_adjoint(now->program, now->point);
}

/* Weigh the objective at the point and all that has come near it; return the largest error. ``tail`` keeps (P, p) of
 * the stage ``end`` as they were before anything took part. */
HDV_INLINE double linearise(struct iterate *now, double *tail, int64_t n, int64_t m) {
    int64_t joined = join(now, n, m);
    if (joined > now->end) { /* beyond the old end P and p are still the first pass's */
        now->end = joined;
        memcpy(tail, recursion_at(now->solver->work, n, m, joined).P, (size_t)(n * n + n) * sizeof(double));
    }
    objective(now, tail, n, m);
    return weigh(now, n, m);
}

/* The interior point from the first pass's point, whose cost-to-go is in ``work``. */
HDV_INLINE int64_t interior(struct iterate *now, int64_t *count, int64_t n, int64_t m) {
    double tail[HDV_MOST_STATES * (HDV_MOST_STATES + 1)];
    int64_t refined = 0;
    for (int64_t iteration = 0; iteration < ITERATIONS && *count < now->solver->budget; ++iteration) {
        *count += 1;
        double error = linearise(now, tail, n, m);
        if (error < now->solver->tolerance && isfinite(now->mean)) {
            int settled = publish(now) < balanced;
            if (settled || ++refined > EXTRA)
                return settled ? HDV_SOLVED : HDV_INACCURATE;
        }
        double length = isfinite(now->mean) ? predict_and_correct(now, n, m) : -1.0;
        if (length < 0.0) {
            publish(now);
            return HDV_NUMERICAL;
        }
        move(now, length, n, m);
    }
    publish(now);
    return HDV_ITERATION_LIMIT;
}

/* Solve a program whose first pass is in ``point`` and in the solver's work; return how that ended. */
int64_t hdv_interior(
    struct hdv_solver *solver, const struct hdv_program *program, const struct hdv_point *point, int64_t *count
) {
    const struct hdv_shape *shape = &program->shape;
    int64_t n = shape->states, m = shape->inputs;
    struct hdv_series weights = {solver->weights, weights_size(n, m)}, steps = {solver->steps, n + m};
    struct iterate now = {solver, program, point, weights, steps, 0, 0, 0.0, start, 0.0, 0.0};
    memset(solver->member, 0, (size_t)((shape->stages + 1) * inequalities_of(shape)));
    return HDV_UNROLLED(n, m, interior, &now, count);
}
