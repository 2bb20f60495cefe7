#include "terms.h"

#include "sizes.h"
#include "standing.h"

/* Wheel angles of stage i (wheels,) [rad]. */
HDV_INLINE const double *angles_at(const struct hdv_steering *own, const struct hdv_scene *scene, int64_t i) {
    return state_at(scene->motion, scene->states, i) + scene->states - own->wheels;
}

/* Writes what a change of one wheel's angle costs, and its bounds: an input of stage i behind that of the curvature. */
HDV_INLINE void write_change(const struct hdv_steering *own, const struct hdv_scene *scene, int64_t i, int64_t wheel) {
    struct stage stage = program_stage(&scene->program, i);
    double change = angles_at(own, scene, i + 1)[wheel] - angles_at(own, scene, i)[wheel];
    int64_t input = 1 + wheel, bound = scene->program.shape.bounded + input;
    double weight = change_weight(&scene->road[i], own->change_weight);
    double most = change_from(&scene->road[i], scene->step, own->change[wheel], own->most[wheel]);
    stage.R[input * scene->program.shape.inputs + input] = 2.0 * weight;
    stage.r[input] = 2.0 * weight * change;
    stage.low[bound] = -most - change;
    stage.high[bound] = most - change;
}

/* Writes the bounds of one wheel's angle at stage i, behind those of the curvature; adds its cost where wanted. */
HDV_INLINE void
write_angle(const struct hdv_steering *own, const struct hdv_scene *scene, int64_t i, int64_t wheel, int costs) {
    struct stage stage = program_stage(&scene->program, i);
    double angle = angles_at(own, scene, i)[wheel];
    int64_t state = scene->states - own->wheels + wheel;
    stage.low[1 + wheel] = -own->most[wheel] - angle;
    stage.high[1 + wheel] = own->most[wheel] - angle;
    if (costs) {
        stage.Q[state * scene->program.shape.states + state] += 2.0 * own->angle_weight;
        stage.q[state] += 2.0 * own->angle_weight * (angle - own->aim[(scene->first + i) * own->wheels + wheel]);
    }
}

/* Writes the wheels' part of a program: costs of angles are added at stages i >= begin, changes and bounds are written
 * at all. */
int64_t hdv_linearise_steering(void *data, const struct hdv_scene *scene, int64_t begin, int64_t fresh) {
    const struct hdv_steering *own = data;
    (void)fresh;
    for (int64_t i = 1; i <= scene->program.shape.stages; i++) {
        for (int64_t wheel = 0; wheel < own->wheels; wheel++) {
            write_change(own, scene, i - 1, wheel);
            write_angle(own, scene, i, wheel, i >= begin);
        }
    }
    return -1;
}

/* Cost of a motion's wheel angles and of their changes. */
double hdv_price_steering(void *data, const struct hdv_scene *scene) {
    const struct hdv_steering *own = data;
    double total = 0.0;
    for (int64_t i = 1; i <= scene->program.shape.stages; i++) {
        const double *angles = angles_at(own, scene, i), *before = angles_at(own, scene, i - 1);
        for (int64_t wheel = 0; wheel < own->wheels; wheel++) {
            double off = angles[wheel] - own->aim[(scene->first + i) * own->wheels + wheel],
                   change = angles[wheel] - before[wheel];
            total += own->angle_weight * (off * off) +
                     change_weight(&scene->road[i - 1], own->change_weight) * (change * change);
        }
    }
    return total;
}
