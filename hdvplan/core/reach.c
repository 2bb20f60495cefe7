/* The largest reach as an objective: an epigraph variable t >= |offset| of every watched point at every stage of the
 * horizon.
 *
 * Its rows look like those of any limit, so that every solver takes the program as it is.
 */
#include "terms.h"

#include "kinematics.h"
#include "numbers.h"
#include "path.h"
#include "sizes.h"

/* Let the first stage's last input set t, all others keep it, and the last stage cost N t^2. */
static void write_epigraph(const struct hdv_reach *own, const struct hdv_program *program) {
    struct hdv_shape shape = program->shape;
    int64_t n = shape.states, m = shape.inputs, t = own->state;
    for (int64_t i = 0; i <= shape.stages; i++) {
        struct stage stage = stage_at(program, n, m, i);
        stage.A[t * n + t] = i == 0 ? 0.0 : 1.0;
        stage.B[t * m + own->input] = i == 0 ? 1.0 : 0.0;
        stage.Q[t * n + t] = i == shape.stages ? 2.0 * (double)shape.stages : 0.0;
    }
}

/* Write rows of an edge's watched points: offset <= 0 on the left (side 0), >= 0 on the right; return the next row. */
static int64_t write_points(
    const struct hdv_reach *own, const struct hdv_scene *scene, int64_t i, int64_t unit, int side, int64_t number
) {
    const struct hdv_pose *poses = scene->poses + i * scene->unit_count;
    double across[HDV_MOST_STATES], sign = side == 0 ? 1.0 : -1.0;
    for (int64_t point = 0; point < own->point_count; point++, number++) {
        int64_t place = unit * own->point_count + point;
        double *near = &own->feet[((scene->at + i) * scene->unit_count * own->point_count + place) * 2 + side];
        struct plane_point at = body_point(&poses[unit], own->points[place].ahead, sign * own->half_widths[unit]);
        struct foot foot = planned_foot(own->curve, at.x, at.y, *near);
        *near = foot.s;
        point_gradient(poses, unit, at, &scene->road[i], -foot.sin, foot.cos, scene->states, across);
        struct row row = program_row(&scene->program, i, number);
        for (int64_t j = 0; j < scene->states; j++)
            row.g[j] = sign * across[j];
        *row.h = -sign * foot.offset;
    }
    return number;
}

/* Feet as on a straight, at a stage of which nothing is known. */
static void begin_feet(const struct hdv_reach *own, const struct hdv_scene *scene, int64_t i) {
    int64_t count = scene->unit_count * own->point_count;
    double *feet = own->feet + (scene->at + i) * count * 2;
    for (int64_t place = 0; place < count; place++)
        feet[2 * place] = feet[2 * place + 1] = scene->road[i].s + own->ahead[place];
}

HDV_EXPORT int64_t hdv_linearise_reach(void *data, const struct hdv_scene *scene, int64_t begin, int64_t fresh) {
    const struct hdv_reach *own = data;
    struct hdv_shape shape = scene->program.shape;
    write_epigraph(own, &scene->program);
    for (int64_t i = begin; i <= shape.stages; i++) {
        int64_t number = own->row;
        if (fresh)
            begin_feet(own, scene, i);
        *program_stage(&scene->program, i).live = 1.0;
        for (int64_t unit = 0; unit < scene->unit_count; unit++)
            for (int side = 0; side < 2; side++)
                number = write_points(own, scene, i, unit, side, number);
    }
    return -1;
}

/* N t^2 of the largest offset. */
HDV_EXPORT double hdv_price_reach(void *data, const struct hdv_scene *scene) {
    const struct hdv_reach *own = data;
    struct hdv_shape shape = scene->program.shape;
    int64_t rows = 2 * scene->unit_count * own->point_count;
    double furthest = 0.0;
    for (int64_t i = 1; i <= shape.stages; i++)
        for (int64_t number = own->row; number < own->row + rows; number++)
            furthest = larger(furthest, -*program_row(&scene->program, i, number).h);
    return (double)shape.stages * furthest * furthest;
}
