#include "terms.h"

#include "kinematics.h"
#include "path.h"
#include "sizes.h"
#include "standing.h"

/* Adds Q, q of weight * residual^2 to a stage of n states; gradient (count,) is the residual's by the first states. */
HDV_INLINE void
add_square(struct stage stage, int64_t n, int64_t count, const double *gradient, double residual, double weight) {
    for (int64_t j = 0; j < count; j++) {
        double slope = 2.0 * weight * gradient[j];
        stage.q[j] += slope * residual;
        for (int64_t k = 0; k < count; k++)
            stage.Q[j * n + k] += slope * gradient[k];
    }
}

/* The weight of stage i: where the vehicle stands, one stage of two counts. */
HDV_INLINE double weight_at(const struct hdv_centring *own, const struct hdv_scene *scene, int64_t i) {
    return stands(&scene->road[i - 1]) ? 0.0 : own->weights[i];
}

/* Where the auxiliary axle is beside the road, and how its offset changes with the first states, gradient (n,). */
HDV_INLINE struct foot offset_at(
    const struct hdv_centring *own, const struct hdv_scene *scene, int64_t i, int64_t n, double near, double *gradient
) {
    const struct hdv_pose *poses = scene->poses + i * scene->unit_count;
    struct plane_point axle = body_point(poses + own->unit, own->ahead, 0.0);
    struct foot foot = planned_foot(own->curve, axle.x, axle.y, near);
    point_gradient(poses, own->unit, axle, scene->road + i, -foot.sin, foot.cos, n, gradient);
    return foot;
}

/* Adds Q, q of one stage's squared residual for a vehicle of n states, and notes foot and residual. */
HDV_INLINE void
centre(const struct hdv_centring *own, const struct hdv_scene *scene, int64_t i, int64_t n, double near) {
    const struct hdv_residual *weigh = own->residuals + scene->first + i;
    struct foot foot = {near, 0.0, 1.0, 0.0, 0.0};
    double gradient[HDV_MOST_STATES] = {0.0};
    if (weigh->aux != 0.0)
        foot = offset_at(own, scene, i, n, near, gradient);
    for (int64_t j = 0; j < n; j++)
        gradient[j] *= weigh->aux;
    gradient[0] += weigh->lead;
    double e_y = state_at(scene->motion, scene->states, i)[0];
    struct hdv_centred centred = {foot.s, weigh->lead * e_y + weigh->aux * foot.offset - weigh->target};
    own->memory[scene->at + i] = centred;
    if (weigh->lead != 0.0 || weigh->aux != 0.0)
        add_square(
            program_stage(&scene->program, i), scene->program.shape.states, n, gradient, centred.residual,
            weight_at(own, scene, i)
        );
}

/* The same for all stages from begin on. Feet are searched from the last ones, or from where they are on a straight. */
HDV_INLINE void centre_all(
    const struct hdv_centring *own, const struct hdv_scene *scene, int64_t begin, int64_t fresh, int64_t n, int64_t m
) {
    (void)m;
    for (int64_t i = begin; i <= scene->program.shape.stages; i++)
        centre(own, scene, i, n - 1, fresh ? scene->road[i].s + own->beside : own->memory[scene->at + i].foot);
}

/* Adds Q, q of the squared residuals. */
int64_t hdv_linearise_centring(void *data, const struct hdv_scene *scene, int64_t begin, int64_t fresh) {
    HDV_UNROLLED(scene->states + 1, 1, centre_all, data, scene, begin, fresh);
    return -1;
}

/* Sum of the weighted squares of the last linearisation. */
double hdv_price_centring(void *data, const struct hdv_scene *scene) {
    const struct hdv_centring *own = data;
    double total = 0.0;
    for (int64_t i = 1; i <= scene->program.shape.stages; i++) {
        double residual = own->memory[scene->at + i].residual;
        total += weight_at(own, scene, i) * (residual * residual);
    }
    return total;
}
