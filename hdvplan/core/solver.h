/* Our solver of stage QPs: screening, a warm active set, then an interior point, all around the Riccati recursion.
 *
 * A planning QP is a linear-quadratic control problem with few states. Without inequalities one backward and one
 * forward pass solve it; if that point breaks no inequality it is the optimum. Otherwise the active inequalities of the
 * last plan are tried, which are nearly always those of this plan; where they are not, Mehrotra's predictor-corrector
 * method runs.
 */
#ifndef HDVPLAN_SOLVER_H
#define HDVPLAN_SOLVER_H

#include "hdvplan.h"

/* How a solve ended, in the order of Python's statuses of this solver. */
enum hdv_ending { HDV_SOLVED, HDV_ITERATION_LIMIT, HDV_NUMERICAL, HDV_INACCURATE };

/* What an inequality is taken for; of a row that is violated, the penalty is a plain quadratic. */
enum hdv_status { HDV_INACTIVE, HDV_ACTIVE, HDV_VIOLATED };

struct hdv_inequality {
    int64_t status;
    double multiplier;
};

/* What an inequality g <= limit of the interior point bounds: a row's G x, or plus or minus what a bound bounds. */
enum hdv_kind { HDV_ROW, HDV_HIGH, HDV_LOW };

struct hdv_pair {
    int64_t kind, stage, index;      /* index of the row or the bound */
    double s, mu;                    /* slack and multiplier */
    double sigma, nu;                /* of a row: elastic variable, and the multiplier of sigma >= 0 */
    double limit, linear, quadratic; /* prices of sigma */
    double residual, w, v, per_s, per_sigma, per_both; /* of the iterate */
    double under, first, second, pushed;               /* of the Newton step's right-hand side */
    double d_s, d_mu, d_sigma, d_nu;                   /* Newton step */
};

/* The memory of a solver, laid out by hdv_solver_in. Inequalities of a stage: p rows, then upper and lower side of
 * every bound, those of states first. A bound of an input belongs to the stage that the input leaves, all others to
 * their own stage. */
struct hdv_solver {
    double *work;                        /* (N+1) records of the recursion, see riccati.h */
    double *weights;                     /* (N+1) records Q, q, R, r */
    double *steps;                       /* (N+1) records: Newton steps x, u */
    struct hdv_inequality *inequalities; /* (N+1, p + 2 (b + m)) */
    struct hdv_pair *pairs;              /* one for each inequality, and one to try the next inequality in */
    uint8_t *member;                     /* (N+1, p + 2 (b + m)): whether it has a pair */
    double tolerance;                    /* of products or slacks, and of broken inequalities [m] */
    int64_t budget;                      /* most factorisations of a solve */
    int64_t screens;                     /* 0: every inequality takes part from the start */
    int64_t warm;                        /* 0: no guess is used */
};

struct hdv_solved {
    int64_t ending;
    int64_t factorisations;
    int64_t binding; /* whether the point's inequalities are of use to the next solve; 0 where none has a multiplier */
};

/* No limit of a count. */
#define HDV_UNLIMITED INT64_MAX

HDV_INLINE int64_t inequalities_of(const struct hdv_shape *shape) {
    return shape->rows + 2 * (shape->bounded + shape->inputs);
}

HDV_EXPORT void hdv_solve(
    struct hdv_solver *solver, const struct hdv_program *program, const struct hdv_point *guess,
    const struct hdv_point *point, struct hdv_solved *solved
);

/* The methods by themselves; factorisations are counted in ``count``. */
int64_t hdv_settle(
    struct hdv_solver *solver, const struct hdv_program *program, const struct hdv_point *guess,
    const struct hdv_point *point, int64_t *count
);
int64_t hdv_interior(
    struct hdv_solver *solver, const struct hdv_program *program, const struct hdv_point *point, int64_t *count
);

#endif
