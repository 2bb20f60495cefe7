#include "merit.h"

#include <math.h>

#include "numbers.h"
#include "sizes.h"

static const double BINDING = 1e-6; /* multiplier from which on a row binds; solvers leave less on the others */

/* Whether any row of a stage that is live has a multiplier. */
static int binds(const struct hdv_program *program, const struct hdv_point *solution) {
    const struct hdv_shape *shape = &program->shape;
    for (int64_t i = 1; i <= shape->stages; i++) {
        if (!(*program_stage(program, i).live > 0.0)) {
            continue;
        }
        const double *rows = solution->rows + 2 * i * shape->rows; /* of each sigma, multiplier */
        for (int64_t row = 0; row < shape->rows; row++) {
            if (rows[2 * row + 1] > BINDING) {
                return 1;
            }
        }
    }
    return 0;
}

/* Writes the largest multiplier of the dynamics of each of the first states, which say where the bodies are, into
 * weights (count,). Returns whether any limit binds in the solution. */
int64_t
hdv_l1_weights(const struct hdv_program *program, const struct hdv_point *solution, int64_t count, double *weights) {
    const struct hdv_shape *shape = &program->shape;
    for (int64_t j = 0; j < count; j++) {
        weights[j] = 0.0;
    }
    for (int64_t i = 1; i <= shape->stages; i++) {
        const double *multipliers =
            point_at(solution->stages, shape->states, shape->inputs, shape->bounded, i).dynamics;
        for (int64_t j = 0; j < count; j++) {
            weights[j] = larger(weights[j], fabs(multipliers[j]));
        }
    }
    return binds(program, solution);
}

/* Cost of the dynamics' gaps at given weights (count,) of the first states; no other's dynamics are ever broken. */
double hdv_defect_price(const struct hdv_program *program, int64_t count, const double *weights) {
    double total = 0.0;
    for (int64_t i = 0; i < program->shape.stages; i++) {
        const double *gaps = program_stage(program, i).c;
        for (int64_t j = 0; j < count; j++) {
            total += weights[j] * fabs(gaps[j]);
        }
    }
    return total;
}
