/* One planning step; see step.h. */
#include "step.h"

#include <math.h>
#include <string.h>

#include "numbers.h"
#include "sizes.h"

/* A step is halved no further: some of it must be taken, as the vehicle has moved on. */
static const double shortest_step = 1.0 / 32.0;
/* A motion that leaps by more from station to station is none: its steps are too short to reach its start [m]. */
static const double leap = 0.5;
/* RTI leaves a smaller predicted violation to the next step [m]. A program more may lift a larger one before the next
 * ends it, so that none is left out for that. */
static const double repaired = 0.01;
/* SQP ends when a shortened step lowers the merit by a smaller share than this. */
static const double stalled = 1e-3;

/* An array's record of the window's stage 0. */
static void *window_of(const struct hdv_planner *planner, int number) {
    return (char *)planner->arrays[number].base + planner->scene->at * planner->arrays[number].size;
}

/* Move the window to a station; kept stages of the last plan are known there. */
static void move_window(struct hdv_planner *planner, int64_t first, int64_t kept) {
    struct hdv_scene *scene = planner->scene;
    int64_t at = first - planner->origin, stages = scene->program.shape.stages + 1;
    if (kept == 0) {
        at = 0;
    } else if (at + stages > planner->capacity) {
        for (int64_t number = 0; number < planner->array_count; number++) {
            char *base = planner->arrays[number].base;
            int64_t size = planner->arrays[number].size;
            memmove(base, base + at * size, (size_t)(kept * size));
        }
        at = 0;
    }
    planner->origin = first - at;
    scene->at = at;
    scene->program.stages = window_of(planner, HDV_STAGES);
    scene->program.rows = window_of(planner, HDV_ROWS);
    scene->motion = window_of(planner, HDV_MOTION);
    scene->poses = window_of(planner, HDV_POSES);
}

/* Guess the multipliers of stages that the last plan does not reach: those of its last stages, or none. */
static void extend_guess(const struct hdv_planner *planner, int64_t kept) {
    int64_t stages = planner->scene->program.shape.stages + 1, by = stages - kept;
    for (int number = HDV_POINTS; number <= HDV_ROW_POINTS; number++) {
        char *base = window_of(planner, number);
        size_t size = (size_t)planner->arrays[number].size;
        for (int64_t i = kept; i < stages; i++)
            if (i < by || kept == 0)
                memset(base + i * (int64_t)size, 0, size);
            else
                memcpy(base + i * (int64_t)size, base + (i - by) * (int64_t)size, size);
    }
}

/* Linearise all terms at stages from begin on, known ones unless they are fresh; 0 where a point has no foot. */
static int linearise(struct hdv_planner *planner, int64_t begin, int64_t fresh) {
    planner->linearisations++;
    for (int64_t number = 0; number < planner->term_count; number++) {
        const struct hdv_term *term = &planner->terms[number];
        planner->lost = term->linearise(term->data, planner->scene, begin, fresh);
        if (planner->lost >= 0)
            return 0;
    }
    return 1;
}

/* Deepest breach of a limit by the motion of the last linearisation [m]. */
static double violation(const struct hdv_planner *planner) {
    double deepest = 0.0;
    for (int64_t number = 0; number < planner->term_count; number++) {
        const double *own = planner->terms[number].violation;
        deepest = own != NULL ? larger(deepest, *own) : deepest;
    }
    return deepest;
}

/* What the motion costs: the prices of all terms, and every gap in the dynamics at its weight. */
static double merit(const struct hdv_planner *planner) {
    double total = hdv_defect_price(&planner->scene->program, 1 + planner->scene->unit_count, planner->weights);
    for (int64_t number = 0; number < planner->term_count; number++) {
        const struct hdv_term *term = &planner->terms[number];
        total += term->price(term->data, planner->scene);
    }
    return total;
}

/* Begin a plan at a station, from the state in planner->start: take over the last plan along the road, extend it by the
 * road's stationary geometry, and linearise at what is new. */
HDV_EXPORT int64_t hdv_begin(struct hdv_planner *planner, int64_t first, double kappa_before) {
    double began = seconds();
    struct hdv_scene *scene = planner->scene;
    int64_t stages = scene->program.shape.stages + 1, known = planner->last >= 0 && first >= planner->last;
    int64_t kept = known && first - planner->last < stages ? stages - (first - planner->last) : 0;
    planner->iterates = planner->converges || !known;
    planner->last = -1; /* until this plan has succeeded */
    scene->road = planner->stations + first;
    scene->first = first;
    scene->kappa_before = kappa_before;
    scene->fixed = planner->iterates ? 0 : planner->executed;
    scene->binding = !known || planner->binding;
    move_window(planner, first, kept);
    extend_guess(planner, kept);
    int64_t brought = hdv_guess_motion(
        scene, planner->start, planner->states + first * scene->states, planner->curvatures + first, kept,
        planner->most, planner->change, planner->wheels
    );
    planner->programs = planner->iterations = planner->halvings = planner->usable = planner->priced = 0;
    planner->linearisations = planner->spent = 0;
    planner->violation = 0.0;
    planner->moved = INFINITY;
    planner->seconds_solve = planner->seconds_check = 0.0;
    int found = linearise(planner, brought || kept < 1 ? 1 : kept, 1);
    planner->seconds_linearise = seconds() - began;
    return found ? HDV_SOLVE : HDV_LOST;
}

/* What ends a move: it may go on; it hardly improved the motion; a point has no foot. */
enum moved { MOVED, MOVED_HARDLY, MOVED_OFF };

/* A solution's largest multiplier: the first state has no rows and bounds, and no input leaves the last. */
static double largest_multiplier(const struct hdv_program *program, const struct hdv_point *at) {
    struct hdv_shape shape = program->shape;
    double largest = 0.0;
    for (int64_t i = 0; i <= shape.stages; i++) {
        struct point point = program_point(program, at, i);
        struct range bounds = bounds_at(&shape, i);
        for (int64_t j = 0; j < shape.states; j++)
            largest = larger(largest, fabs(point.dynamics[j]));
        for (int64_t number = bounds.begin; number < bounds.end; number++)
            largest = larger(largest, fabs(point.bounds[number]));
        for (int64_t row = 0; row < shape.rows && i > 0; row++)
            largest = larger(largest, fabs(at->rows[2 * (i * shape.rows + row) + 1]));
    }
    return largest;
}

/* Move by a solution, or by a share of it, halved until the merit is no larger than before.
 * Where no limit binds the whole of it is taken, and nothing is judged by the merit. */
static enum moved move(struct hdv_planner *planner, const struct hdv_point *point, double share) {
    struct hdv_scene *scene = planner->scene;
    if (!planner->binding) {
        planner->moved = hdv_take_step(scene, point, share);
        planner->priced = 0;
        return linearise(planner, 1, 0) ? MOVED : MOVED_OFF;
    }
    size_t size = (size_t)((scene->program.shape.stages + 1) * (scene->states + 1)) * sizeof(double);
    double worth = merit(planner);
    int halved = 0;
    memcpy(planner->before, scene->motion, size);
    for (;;) {
        planner->moved = hdv_take_step(scene, point, share);
        if (!linearise(planner, 1, 0))
            return MOVED_OFF;
        planner->merit = merit(planner);
        if (planner->merit <= worth || planner->moved < planner->tolerance || share <= shortest_step)
            break;
        memcpy(scene->motion, planner->before, size);
        share = planner->linearisations + 1 < planner->most_linearisations ? 0.5 * share : shortest_step;
        halved++;
    }
    planner->halvings += halved;
    planner->priced = 1;
    return halved && worth - planner->merit < stalled * worth ? MOVED_HARDLY : MOVED;
}

/* The plan is made: note what it covers. */
static int64_t finish(struct hdv_planner *planner) {
    planner->last = planner->scene->first;
    if (planner->usable || planner->programs > 1)
        planner->reaches = planner->scene->first + planner->scene->program.shape.stages;
    return HDV_PLANNED;
}

/* Judge a solution by residuals, recomputed from the program that no solver can write to. */
HDV_EXPORT int64_t hdv_judge(struct hdv_planner *planner, const struct hdv_point *point) {
    double mark = seconds();
    struct hdv_residuals *found = &planner->residuals;
    hdv_residuals(&planner->scene->program, point, found);
    planner->seconds_check += seconds() - mark;
    if (!(found->primal <= HDV_USABLE_RESIDUAL)) /* NaN too */
        return HDV_BROKEN;
    int far = found->dual > HDV_WRONG && found->dual > HDV_WRONG * largest_multiplier(&planner->scene->program, point);
    return far ? HDV_FAR : HDV_FINE;
}

/* Move by a solution that was judged, where it may be driven; HDV_SOLVE where the plan iterates on. */
HDV_EXPORT int64_t hdv_accept(struct hdv_planner *planner, const struct hdv_point *point, int64_t leaves_guess) {
    struct hdv_scene *scene = planner->scene;
    double began = seconds();
    planner->programs++;
    planner->usable = planner->residuals.primal <= HDV_USABLE_RESIDUAL;
    if (!planner->usable) {
        planner->violation = violation(planner);
        return finish(planner);
    }
    planner->binding = scene->binding = hdv_l1_weights(&scene->program, point, 1 + scene->unit_count, planner->weights);
    enum moved moved = move(planner, point, 1.0);
    planner->violation = violation(planner);
    planner->guessed = leaves_guess;
    planner->seconds_linearise += seconds() - began;
    if (moved == MOVED_OFF)
        return HDV_LOST;
    int repairing = planner->programs <= planner->repairs && planner->violation > repaired;
    int settled = moved == MOVED_HARDLY || planner->moved < planner->tolerance || planner->programs >= planner->rounds;
    return settled || !(planner->iterates || repairing) ? finish(planner) : HDV_SOLVE;
}

/* Whether the budget has room for one more program: for the move, and another one if that makes the plan worse. */
static int affords_more(const struct hdv_planner *planner) {
    return planner->iterations < planner->most_factorisations &&
           planner->linearisations + 2 <= planner->most_linearisations;
}

/* The share of a point that keeps all bounds: its motion keeps them, so that any share does that is small enough. */
static double share_within(const struct hdv_program *program, const struct hdv_point *at) {
    double share = 1.0;
    for (int64_t i = 0; i <= program->shape.stages; i++) {
        struct stage stage = program_stage(program, i);
        struct point point = program_point(program, at, i);
        struct range bounds = bounds_at(&program->shape, i);
        for (int64_t number = bounds.begin; number < bounds.end; number++) {
            double v = *bounded_of(program, point.x, point.u, number),
                   most = v > 0.0 ? stage.high[number] : stage.low[number];
            if (fabs(v) > fabs(most))
                share = smaller(share, most / v);
        }
    }
    return larger(share, 0.0);
}

/* The budget was spent within a solve. Its iterate keeps the dynamics: move by as much of it as keeps the bounds. */
static int64_t salvage(struct hdv_planner *planner, const struct hdv_point *point) {
    struct hdv_scene *scene = planner->scene;
    double share = share_within(&scene->program, point);
    planner->binding = scene->binding = 1;
    planner->guessed = 0;
    if (share > shortest_step && move(planner, point, share) == MOVED_OFF)
        return HDV_LOST;
    planner->violation = violation(planner);
    planner->usable = share > shortest_step;
    return finish(planner);
}

/* Solve, judge and move, until the plan is made, with our solver: it begins at, and writes, the planner's own point. */
HDV_EXPORT int64_t hdv_iterate(struct hdv_planner *planner) {
    int64_t stop = HDV_SOLVE;
    const struct hdv_point point = {window_of(planner, HDV_POINTS), window_of(planner, HDV_ROW_POINTS)};
    while (stop == HDV_SOLVE) {
        struct hdv_solved solved;
        double began = seconds();
        planner->spent = !affords_more(planner);
        if (planner->spent)
            return finish(planner);
        planner->solver->budget = planner->most_factorisations - planner->iterations;
        hdv_solve(planner->solver, &planner->scene->program, planner->guessed ? &point : NULL, &point, &solved);
        planner->seconds_solve += seconds() - began;
        planner->iterations += solved.factorisations;
        planner->ending = solved.ending;
        planner->spent = solved.ending == HDV_ITERATION_LIMIT && planner->iterations >= planner->most_factorisations;
        if (planner->spent)
            return salvage(planner, &point);
        if (hdv_judge(planner, &point) != HDV_FINE)
            return HDV_REFUSED;
        stop = hdv_accept(planner, &point, solved.binding);
    }
    return stop;
}

int64_t hdv_step(struct hdv_planner *planner, int64_t first, double kappa_before) {
    int64_t stop = hdv_begin(planner, first, kappa_before);
    return stop == HDV_SOLVE ? hdv_iterate(planner) : stop;
}

/* Against de_y/ds = (1 - curvature e_y) tan(e_psi), half-way between two stations. */
int64_t hdv_leaps(struct hdv_planner *planner) {
    const struct hdv_scene *scene = planner->scene;
    for (int64_t i = 0; i < planner->executed; i++) {
        const double *z = scene->motion + i * (scene->states + 1), *next = z + scene->states + 1;
        double along = 1.0 - 0.5 * (z[0] + next[0]) * scene->road[i].curvature_between;
        if (!(fabs(next[0] - z[0] - scene->road[i].step * along * tan(0.5 * (z[1] + next[1]))) <= leap)) {
            planner->last = -1;
            return 1;
        }
    }
    return 0;
}
