/* Balance the swept envelope itself: at every place of the road its left and right reach, over the whole manoeuvre.
 *
 * Each place's left and right reach belong to one point of one stage each, see tracks.c. A step of Gauss and Newton
 * that moves each of the two by half of the imbalance keeps the program's stages apart: with a + b the change of the
 * imbalance I, (I + a + b)^2 <= 2 (I/2 + a)^2 + 2 (I/2 + b)^2, with equality at a = b.
 */
#include "terms.h"

#include <math.h>

#include "kinematics.h"
#include "sizes.h"

/* Widen what was driven by the plan that was last measured, up to the present stage 0. */
static void note_driven(struct hdv_balance *own, int64_t first) {
    int64_t driven_to = (first - own->since < own->places ? first - own->since : own->places) + 1;
    if (own->since >= 0 && driven_to > 1) /* the tracks are still those of the last plan */
        cover(&own->bodies, &own->tracks, own->since, driven_to, own->driven);
    own->since = first;
}

/* Add Q, q of one side's share of the imbalance at place m, whose square has the given weight. */
static void add_imbalance(
    const struct hdv_balance *own, const struct hdv_scene *scene, int64_t m, int side, double wrong, double weight
) {
    int64_t places = own->bodies.station_count, n = scene->program.shape.states;
    const struct hdv_furthest *place = &own->reached[side * places + m],
                              *opposite = &own->reached[(1 - side) * places + m];
    int64_t i = place->stage - scene->first;
    if (i < 1 || i > own->stages)
        return;
    /* stages that no later program changes: the opposite side must make up for all that they sweep */
    double share = opposite->stage - scene->first > scene->fixed ? 0.5 : 1.0, sign = side == 0 ? 1.0 : -1.0;
    const struct hdv_station *at = &own->bodies.stations[m];
    const struct hdv_pose *poses = scene->poses + i * scene->unit_count;
    struct plane_point point =
        body_point(&poses[place->unit], place->ahead, sign * scene->units[place->unit].half_width);
    /* The place is fixed while the point's foot moves: by the track's slope that changes the reach there. */
    double rise = sign * place->slope / (1.0 - sign * place->reach * at->curvature), gradient[HDV_MOST_STATES];
    point_gradient(
        poses, place->unit, point, &scene->road[i], -at->sin - rise * at->cos, at->cos - rise * at->sin, scene->states,
        gradient
    );
    struct stage stage = program_stage(&scene->program, i);
    double curved = 2.0 / own->relaxation * weight / share;
    for (int64_t j = 0; j < scene->states; j++) {
        stage.q[j] += 2.0 * weight * wrong * gradient[j];
        for (int64_t k = 0; k < scene->states; k++)
            stage.Q[j * n + k] += curved * gradient[j] * gradient[k];
    }
}

/* Let the plan's reach begin with what was driven, and add what the plan sweeps. */
static void measure(struct hdv_balance *own, const struct hdv_scene *scene, int64_t lowest) {
    int64_t places = own->bodies.station_count, end = own->places + own->before + 1;
    int64_t highest = scene->first + end < places ? scene->first + end : places;
    trace(&own->bodies, scene->poses, scene->first, end, &own->tracks);
    for (int side = 0; side < 2; side++) {
        for (int64_t m = lowest; m < highest; m++) {
            own->reached[side * places + m].reach = own->driven[side * places + m].reach;
            own->reached[side * places + m].stage = -1;
        }
    }
    cover(&own->bodies, &own->tracks, scene->first, end, own->reached);
}

/* Measure the plan's envelope and add Q, q of the imbalance at its stages. */
static void balance(struct hdv_balance *own, const struct hdv_scene *scene) {
    int64_t places = own->bodies.station_count, first = scene->first;
    int64_t lowest = first > own->before ? first - own->before : 0;
    int64_t highest = first + own->places < places ? first + own->places : places;
    note_driven(own, first);
    measure(own, scene, lowest);
    own->value = 0.0;
    for (int64_t m = lowest; m < highest; m++) {
        double wrong = own->reached[m].reach - own->reached[places + m].reach - 2.0 * own->aim[m];
        if (!isfinite(wrong))
            continue;
        double relative = wrong / own->rounding, weight = 1.0 / sqrt(1.0 + relative * relative);
        own->value += 2.0 * own->rounding * own->rounding * (1.0 / weight - 1.0); /* its derivative is 2 weight wrong */
        add_imbalance(own, scene, m, 0, wrong, weight);
        add_imbalance(own, scene, m, 1, wrong, weight);
    }
}

/* Forget what was driven: a new motion begins a drive. */
static void begin_drive(struct hdv_balance *own) {
    for (int64_t place = 0; place < 2 * own->bodies.station_count; place++)
        own->driven[place].reach = -INFINITY;
    own->since = -1;
}

/* Stages by which a motion is extended were not measured yet: they are centred alone. */
HDV_EXPORT int64_t hdv_linearise_balance(void *data, const struct hdv_scene *scene, int64_t begin, int64_t fresh) {
    struct hdv_balance *own = data;
    int64_t lost = hdv_linearise_centring(begin == 1 ? own->beside : own->centring, scene, begin, fresh);
    if (begin == 1) {
        if (fresh)
            begin_drive(own);
        if (own->stages > 0)
            balance(own, scene);
    }
    return lost;
}

HDV_EXPORT double hdv_price_balance(void *data, const struct hdv_scene *scene) {
    const struct hdv_balance *own = data;
    return own->value + hdv_price_centring(own->beside, scene);
}
