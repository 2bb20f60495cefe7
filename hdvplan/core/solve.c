/* One solve of a stage QP, and the memory for it: see solver.h. */
#include "riccati.h"
#include "solver.h"

#include <string.h>

/* Lay a solver of such programs out in ``memory``, which begins with its struct hdv_solver; return how many bytes it
 * takes. Where there is no memory yet, only that. */
HDV_EXPORT int64_t
hdv_solver_in(void *memory, const struct hdv_shape *shape, double tolerance, int64_t screens, int64_t warm) {
    int64_t n = shape->states, m = shape->inputs, count = shape->stages + 1, sides = count * inequalities_of(shape);
    int64_t work = count * recursion_size(n, m), weights = count * weights_size(n, m), steps = count * (n + m);
    struct hdv_solver *solver = memory;
    if (solver != NULL) {
        solver->work = (double *)(solver + 1);
        solver->weights = solver->work + work;
        solver->steps = solver->weights + weights;
        solver->inequalities = (struct hdv_inequality *)(solver->steps + steps);
        solver->pairs = (struct hdv_pair *)(solver->inequalities + sides);
        solver->member = (uint8_t *)(solver->pairs + sides + 1);
        solver->tolerance = tolerance;
        solver->budget = HDV_UNLIMITED;
        solver->screens = screens;
        solver->warm = warm;
    }
    int64_t records = sides * (int64_t)sizeof(struct hdv_inequality) + (sides + 1) * (int64_t)sizeof(struct hdv_pair);
    return (int64_t)sizeof(struct hdv_solver) + (work + weights + steps) * (int64_t)sizeof(double) + records + sides;
}

/* Return whether stage i breaks an inequality. States and inputs apart, as gcc 12 warns of bounded_of's choice here
 * where it may use AVX2: of inputs that are not there. */
HDV_INLINE int
breaks(const struct hdv_program *program, struct stage stage, double *x, double *u, int64_t n, int64_t m, int64_t i) {
    int64_t p = program->shape.rows, b = program->shape.bounded;
    int any = 0;
    for (int64_t row = 0; row < p && i > 0 && *stage.live > 0.0; ++row)
        any |= breach(row_at(program, n, i, row), x, n) > 0.0;
    for (int64_t number = 0; number < b && i > 0; ++number) {
        double v = x[program->bounded[number]];
        any |= v > stage.high[number] || v < stage.low[number];
    }
    for (int64_t j = 0; j < m && i < program->shape.stages; ++j)
        any |= u[j] > stage.high[b + j] || u[j] < stage.low[b + j];
    return any;
}

/* The multipliers of the dynamics, -(P x + p): without inequalities this rounds less than an adjoint pass. */
HDV_INLINE void multiply_out(struct recursion own, const double *x, double *dynamics, int64_t n) {
    vector gradient, P;
    load(gradient, own.p, n);
    for (int64_t t = 0; t < n; ++t) {
        load(P, own.P + t * n, n);
        add(gradient, x[t], P, n);
    }
    for (int64_t j = 0; j < n; ++j)
        dynamics[j] = -entry(gradient, j);
}

/* Roll the feedback out from the first state; write the primal-dual point, return whether it breaks an inequality. */
HDV_INLINE int roll_out(
    const struct hdv_solver *solver, const struct hdv_program *program, const struct hdv_point *to, int64_t n, int64_t m
) {
    int64_t b = program->shape.bounded;
    double x[HDV_MOST_STATES], u[HDV_MOST_INPUTS] = {0.0}, ahead[HDV_MOST_STATES];
    int any = 0;
    for (int64_t j = 0; j < n; ++j)
        x[j] = program->x_first[j];
    for (int64_t i = 0; i <= program->shape.stages; ++i) {
        struct stage stage = stage_at(program, n, m, i);
        struct recursion own = recursion_at(solver->work, n, m, i);
        struct point point = point_at(program, to, n, m, i);
        roll(stage, own, x, u, ahead, n, m, 1);
        any |= breaks(program, stage, x, u, n, m, i);
        multiply_out(own, x, point.dynamics, n);
        for (int64_t j = 0; j < m; ++j)
            point.u[j] = u[j];
        for (int64_t j = 0; j < n; ++j) {
            point.x[j] = x[j];
            x[j] = ahead[j];
        }
        for (int64_t number = 0; number < b + m; ++number)
            point.bounds[number] = 0.0;
    }
    memset(to->rows, 0, (size_t)((program->shape.stages + 1) * program->shape.rows * 2) * sizeof(double));
    return any;
}

/* Solve a program without its inequalities; return whether that has worked, and write whether the point breaks one. */
static int screen(struct hdv_solver *solver, const struct hdv_program *program, const struct hdv_point *to, int *any) {
    struct hdv_series weights = own_weights(program);
    int64_t n = program->shape.states, m = program->shape.inputs;
    if (!hdv_factorise(program, &weights, solver->work, program->shape.stages, 1))
        return 0;
    *any = HDV_UNROLLED(n, m, roll_out, solver, program, to);
    return 1;
}

/* Solve a program. Of ``guess``, which may be null, only multipliers and elastic variables matter. */
void hdv_solve(
    struct hdv_solver *solver, const struct hdv_program *program, const struct hdv_point *guess,
    const struct hdv_point *point, struct hdv_solved *solved
) {
    struct hdv_solved found = {HDV_SOLVED, 0, 1};
    int any = 0;
    memcpy(point->stages, program->x_first, (size_t)program->shape.states * sizeof(double));
    int guessed = guess != NULL && solver->warm;
    if (!guessed || !hdv_settle(solver, program, guess, point, &found.factorisations)) {
        int spent = found.factorisations >= solver->budget, passed = !spent && screen(solver, program, point, &any);
        found.ending = passed ? HDV_SOLVED : spent ? HDV_ITERATION_LIMIT : HDV_NUMERICAL;
        found.factorisations += passed;
        found.binding = any || !solver->screens;
        if (passed && found.binding)
            found.ending = hdv_interior(solver, program, point, &found.factorisations);
    }
    *solved = found;
}
