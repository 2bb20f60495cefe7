/* The motion that a planning step linearises at: the last plan, extended and moved by each program's solution; and its
 * merit, by which the step of a program is taken in full or shortened.
 *
 * The l1 merit function of sequential quadratic programming (Han 1977; Nocedal, Wright 2006, sec. 18.4): the prices of
 * all terms, which hold what broken limits cost, and every gap between a predicted state and the dynamics at a weight
 * no smaller than its multiplier. A step that does not lower it is halved: where limits cannot be kept, full steps
 * swing from side to side.
 */
#include "step.h"

#include <math.h>
#include <string.h>

#include "numbers.h"
#include "sizes.h"
#include "standing.h"

static const double STEEPEST = 1.3; /* largest heading error a plan may reach: the model's domain ends at pi/2 [rad] */
static const double INSIDE = 0.05;  /* smallest 1 - e_y k a plan may reach */
static const double BOUNDS_KEPT = 1e-6; /* of a program, by a solver [1/m, rad] */
static const double SHORTEST = 1e-3;    /* share of a step below which it is not taken at all */

/* Brings a value within what can be steered, a known one only from beyond a solver's tolerance; whether that was so. */
static int bring(double *value, int known, double before, double change, double most) {
    double highest = smaller(smaller(*value, before + change), most);
    double within = larger(larger(highest, before - change), -most);
    if (known && fabs(within - *value) <= BOUNDS_KEPT)
        return 0;
    *value = within;
    return known;
}

/* Extends a motion of which kept stages are known, and lets it begin at start (states,). Returns whether it has changed
 * the steering of known stages: the vehicle is not where the last plan has led it.
 *
 * From stage kept on, and for the curvature that leads there, it takes the road's stationary geometry, states (N+1,
 * states) and curvatures (N+1,) [1/m]. All steering is brought within what the vehicle can do: at most most, changing
 * by at most change a station; of the curvature first, then of the wheels that the plan steers. A motion that keeps
 * these bounds keeps them after any share of a program's step. */
int64_t hdv_guess_motion(
    const struct hdv_scene *scene, const double *start, const double *states, const double *curvatures, int64_t kept,
    const double *most, const double *change, int64_t wheels
) {
    int64_t n = scene->states, last = scene->program.shape.stages, brought = 0;
    memcpy(state_at(scene->motion, n, 0), start, (size_t)n * sizeof(double));
    for (int64_t i = kept > 1 ? kept : 1; i <= last; i++)
        memcpy(state_at(scene->motion, n, i), states + i * n, (size_t)n * sizeof(double));
    for (int64_t i = 1; i <= last; i++)
        for (int64_t wheel = 1; wheel <= wheels; wheel++) {
            int64_t j = n - wheels + wheel - 1;
            double within = change_from(&scene->road[i - 1], scene->step, change[wheel], most[wheel]);
            double before = state_at(scene->motion, n, i - 1)[j];
            brought |= bring(state_at(scene->motion, n, i) + j, i < kept, before, within, most[wheel]);
        }
    for (int64_t i = 0; i <= last; i++) {
        double *kappa = state_at(scene->motion, n, i) + n, before = i > 0 ? kappa[-n - 1] : scene->kappa_before;
        double within = change_from(&scene->road[i], scene->step, change[0], most[0]);
        int known = i < kept - 1;
        if (!known)
            *kappa = curvatures[i];
        brought |= bring(kappa, known, before, within, most[0]);
    }
    return brought;
}

/* Whether a motion, moved by so much of a solution, stays in the model's domain. */
static int stays_inside(const struct hdv_scene *scene, const struct hdv_point *solution, double length) {
    const struct hdv_shape *shape = &scene->program.shape;
    for (int64_t i = 1; i <= shape->stages; i++) {
        const double *z = state_at(scene->motion, scene->states, i);
        const double *x = program_point(&scene->program, solution, i).x;
        double e_y = z[0] + length * x[0], e_psi = z[1] + length * x[1];
        if (!(fabs(e_psi) < STEEPEST && 1.0 - e_y * scene->road[i].curvature > INSIDE))
            return 0;
    }
    return 1;
}

/* Moves a motion by a share of a program's solution, halved as long as it would leave the model's domain.
 *
 * The first state is given: a solver's residual must not move it. Returns the largest change of a state [m, rad], or
 * infinity where no part of the step could be taken. */
double hdv_take_step(const struct hdv_scene *scene, const struct hdv_point *solution, double share) {
    const struct hdv_shape *shape = &scene->program.shape;
    int64_t n = scene->states;
    double length = share, largest = 0.0;
    while (!stays_inside(scene, solution, length)) {
        if (!(length > SHORTEST))
            return INFINITY;
        length *= 0.5;
    }
    for (int64_t i = 1; i <= shape->stages; i++) {
        double *z = state_at(scene->motion, n, i);
        const double *x = program_point(&scene->program, solution, i).x;
        for (int64_t j = 0; j < n; j++) {
            z[j] += length * x[j];
            largest = larger(largest, length * fabs(x[j]));
        }
        state_at(scene->motion, n, i - 1)[n] += length * x[n];
    }
    return largest;
}

static const double BINDING = 1e-6; /* multiplier from which on a row binds; solvers leave less on the others */

/* Whether any row of a stage that is live has a multiplier. */
static int binds(const struct hdv_program *program, const struct hdv_point *solution) {
    const struct hdv_shape *shape = &program->shape;
    for (int64_t i = 1; i <= shape->stages; i++) {
        if (!(*program_stage(program, i).live > 0.0))
            continue;
        const double *rows = solution->rows + 2 * i * shape->rows; /* of each sigma, multiplier */
        for (int64_t row = 0; row < shape->rows; row++)
            if (rows[2 * row + 1] > BINDING)
                return 1;
    }
    return 0;
}

/* Writes the largest multiplier of the dynamics of each of the first states, which say where the bodies are, into
 * weights (count,). Returns whether any limit binds in the solution. */
int64_t
hdv_l1_weights(const struct hdv_program *program, const struct hdv_point *solution, int64_t count, double *weights) {
    const struct hdv_shape *shape = &program->shape;
    for (int64_t j = 0; j < count; j++)
        weights[j] = 0.0;
    for (int64_t i = 1; i <= shape->stages; i++) {
        const double *multipliers = program_point(program, solution, i).dynamics;
        for (int64_t j = 0; j < count; j++)
            weights[j] = larger(weights[j], fabs(multipliers[j]));
    }
    return binds(program, solution);
}

/* Cost of the dynamics' gaps at given weights (count,) of the first states; no other's dynamics are ever broken. */
double hdv_defect_price(const struct hdv_program *program, int64_t count, const double *weights) {
    double total = 0.0;
    for (int64_t i = 0; i < program->shape.stages; i++) {
        const double *gaps = program_stage(program, i).c;
        for (int64_t j = 0; j < count; j++)
            total += weights[j] * fabs(gaps[j]);
    }
    return total;
}
