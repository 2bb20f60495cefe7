#include "terms.h"

#include "sizes.h"
#include "standing.h"

/* Curvature held from stage i to the next [1/m]; i = -1 is what was held before. */
HDV_INLINE double curvature(const struct hdv_scene *scene, int64_t i) {
    return i < 0 ? scene->kappa_before : state_at(scene->motion, scene->states, i)[scene->states];
}

/* Writes what a change of curvature costs, and the bounds of kappa_{i-1} (the vehicle's last state) and of its change,
 * at all stages: the first change depends on what was driven. */
int64_t hdv_linearise_smoothness(void *data, const struct hdv_scene *scene, int64_t begin, int64_t fresh) {
    const struct hdv_smoothness *own = data;
    int64_t input = scene->program.shape.bounded; /* its bound's number */
    (void)begin;
    (void)fresh;
    for (int64_t i = 0; i < scene->program.shape.stages; i++) {
        struct stage stage = program_stage(&scene->program, i), next = program_stage(&scene->program, i + 1);
        double kappa = curvature(scene, i), changed = kappa - curvature(scene, i - 1);
        double weight = change_weight(&scene->road[i], own->weight);
        double change = change_from(&scene->road[i], scene->step, own->change, own->most);
        stage.R[0] = 2.0 * weight;
        stage.r[0] = 2.0 * weight * changed;
        stage.low[input] = -change - changed;
        stage.high[input] = change - changed;
        next.low[0] = -own->most - kappa;
        next.high[0] = own->most - kappa;
    }
    return -1;
}

/* Cost of a motion's changes of curvature. */
double hdv_price_smoothness(void *data, const struct hdv_scene *scene) {
    const struct hdv_smoothness *own = data;
    double total = 0.0;
    for (int64_t i = 0; i < scene->program.shape.stages; i++) {
        double changed = curvature(scene, i) - curvature(scene, i - 1);
        total += change_weight(&scene->road[i], own->weight) * (changed * changed);
    }
    return total;
}
