/* A term of a user's own in C, the twin of the one in docs/extending.md: weight beta_j^2 for every articulation angle. */
#include "sizes.h"

struct articulation {
    double weight; /* [m^2] */
};

HDV_EXPORT hdv_linearise hdv_linearise_articulation;
HDV_EXPORT hdv_price hdv_price_articulation;

/* Adds Q, q at stages from begin on; no point can be without a foot. The angles are the states behind e_y and e_psi. */
int64_t hdv_linearise_articulation(void *data, const struct hdv_scene *scene, int64_t begin, int64_t fresh) {
    const struct articulation *own = data;
    int64_t n = scene->program.shape.states;
    (void)fresh;
    for (int64_t i = begin; i <= scene->program.shape.stages; i++) {
        struct stage stage = program_stage(&scene->program, i);
        const double *z = state_at(scene->motion, scene->states, i);
        for (int64_t j = 2; j <= scene->unit_count; j++) {
            stage.Q[j * n + j] += 2.0 * own->weight;
            stage.q[j] += 2.0 * own->weight * z[j];
        }
    }
    return -1;
}

/* What the angles cost. */
double hdv_price_articulation(void *data, const struct hdv_scene *scene) {
    const struct articulation *own = data;
    double sum = 0.0;
    for (int64_t i = 1; i <= scene->program.shape.stages; i++) {
        const double *z = state_at(scene->motion, scene->states, i);
        for (int64_t j = 2; j <= scene->unit_count; j++) {
            sum += z[j] * z[j];
        }
    }
    return own->weight * sum;
}
