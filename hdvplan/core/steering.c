#include "terms.h"

#include "sizes.h"
#include "standing.h"

/* What is steered until stage i: number 0 is the curvature held until there [1/m], the others are angles of wheels. */
HDV_INLINE double steered_at(const struct hdv_steering *own, const struct hdv_scene *scene, int64_t i, int64_t number) {
    int64_t n = scene->states;
    if (number > 0)
        return state_at(scene->motion, n, i)[n - own->wheels + number - 1];
    return i > 0 ? state_at(scene->motion, n, i - 1)[n] : scene->kappa_before;
}

/* The weight of a squared change until stage i. */
HDV_INLINE double weight_of(const struct hdv_steering *own, const struct hdv_scene *scene, int64_t i, int64_t number) {
    return change_weight(&scene->road[i - 1], number > 0 ? own->change_weight : own->smoothness);
}

/* How far wheels are from their wanted angle at stage i. */
HDV_INLINE double off_aim(const struct hdv_steering *own, const struct hdv_scene *scene, int64_t i, int64_t number) {
    return steered_at(own, scene, i, number) - own->aim[(scene->first + i) * own->wheels + number - 1];
}

/* Writes what a change until stage i costs, and the bounds of it and of where it leads. */
HDV_INLINE void write_change(const struct hdv_steering *own, const struct hdv_scene *scene, int64_t i, int64_t number) {
    struct stage stage = program_stage(&scene->program, i - 1), next = program_stage(&scene->program, i);
    double value = steered_at(own, scene, i, number), changed = value - steered_at(own, scene, i - 1, number);
    double weight = weight_of(own, scene, i, number), most = own->most[number];
    double change = change_from(&scene->road[i - 1], scene->step, own->change[number], most);
    int64_t bound = scene->program.shape.bounded + number;
    stage.R[number * (scene->program.shape.inputs + 1)] = 2.0 * weight;
    stage.r[number] = 2.0 * weight * changed;
    stage.low[bound] = -change - changed;
    stage.high[bound] = change - changed;
    next.low[number] = -most - value;
    next.high[number] = most - value;
}

/* Writes what is steered: costs of wheels' angles are added at stages i >= begin, changes and bounds are written at
 * all, as the first change depends on what was driven. */
int64_t hdv_linearise_steering(void *data, const struct hdv_scene *scene, int64_t begin, int64_t fresh) {
    const struct hdv_steering *own = data;
    (void)fresh;
    for (int64_t i = 1; i <= scene->program.shape.stages; i++) {
        struct stage stage = program_stage(&scene->program, i);
        for (int64_t number = 0; number <= own->wheels; number++) {
            write_change(own, scene, i, number);
            if (number > 0 && i >= begin) {
                int64_t state = scene->states - own->wheels + number - 1;
                stage.Q[state * (scene->program.shape.states + 1)] += 2.0 * own->angle_weight;
                stage.q[state] += 2.0 * own->angle_weight * off_aim(own, scene, i, number);
            }
        }
    }
    return -1;
}

/* Cost of a motion's changes of steering and of its wheels' angles. */
double hdv_price_steering(void *data, const struct hdv_scene *scene) {
    const struct hdv_steering *own = data;
    double total = 0.0;
    for (int64_t i = 1; i <= scene->program.shape.stages; i++) {
        for (int64_t number = 0; number <= own->wheels; number++) {
            double change = steered_at(own, scene, i, number) - steered_at(own, scene, i - 1, number);
            double off = number > 0 ? off_aim(own, scene, i, number) : 0.0;
            total += own->angle_weight * (off * off) + weight_of(own, scene, i, number) * (change * change);
        }
    }
    return total;
}
