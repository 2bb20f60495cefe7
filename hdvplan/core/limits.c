/* Limits: the rows that keep every body within the road's limits, linearised at a given motion ([GEO] eq. 9d, [BUS]
 * sec. IV).
 *
 * Bodies far from their limits are screened out by bounds that need no projection, or few, and once found clear they
 * are not looked at again before they have moved. Of every other edge the tightest places enter, see edges.c.
 *
 * Row order within a stage: unit, left then right edge; then the tightest place of the edge's rear half and of its
 * front half; then, where there are rows for them, what its rear and its front corner reach beyond the wheels' limit,
 * if they belong to overhangs.
 */
#include "limits.h"

#include <math.h>

#include "edges.h"
#include "numbers.h"
#include "screening.h"
#include "sizes.h"

/* What the rows' breaches cost at the motion at which they were linearised. */
double hdv_price_limits(void *data, const struct hdv_scene *scene) {
    const struct hdv_limits *own = data;
    const struct hdv_program *program = &scene->program;
    struct hdv_shape shape = program->shape;
    double total = 0.0;
    for (int64_t i = 1; i <= shape.stages; i++) {
        if (*stage_at(program->stages, shape.states, shape.inputs, shape.bounded, i).live > 0.0) {
            for (int64_t number = own->row; number < own->row + own->rows; number++) {
                struct row row = row_at(program->rows, shape.states, shape.rows, i, number);
                double over = larger(0.0, -*row.h);
                total += (*row.linear + 0.5 * *row.quadratic * over) * over;
            }
        }
    }
    return total;
}

/* Whether an edge needs no rows. While limits bind, every edge that no bound clears has its rows: large steps need
 * them. */
static int is_clear(const struct hdv_edge *edge, double margin, int64_t binding) {
    return edge->clear - margin > HDV_CLEAR_M && !(binding && edge->looked > 0.0);
}

/* Write what is known of a stage that nothing has been seen of: feet as on a straight, clearances by a bound from the
 * state. */
static void begin_stage(const struct hdv_limits *own, const struct hdv_scene *scene, int64_t i, const double *z) {
    int64_t units = scene->unit_count, at = (scene->at + i) * units;
    double clear = clear_by_state(scene->units, units, &scene->road[i], z);
    for (int64_t unit = 0; unit < units; unit++) {
        double axle = scene->road[i].s - own->behind[unit];
        for (int point = 0; point < HDV_AXIS_POINTS; point++) {
            own->axis_feet[(at + unit) * HDV_AXIS_POINTS + point] = axle + own->axis[unit * HDV_AXIS_POINTS + point];
        }
        for (int point = 0; point < HDV_POINTS_PER_EDGE; point++) {
            double *feet = own->feet + ((at + unit) * HDV_POINTS_PER_EDGE + point) * 2;
            feet[0] = feet[1] = axle + own->points[unit * HDV_POINTS_PER_EDGE + point].ahead;
        }
        for (int side = 0; side < 2; side++) {
            struct hdv_edge *edge = &own->edges[2 * (at + unit) + side];
            edge->clear = clear;
            edge->looked = edge->never = 0.0; /* the rows in this memory are another stage's */
        }
    }
    for (int64_t j = 0; j < scene->states; j++) {
        own->seen_z[(scene->at + i) * scene->states + j] = z[j];
    }
}

/* Return a bound of how far any point's offset has changed since the stage was last looked at [m], and note the state.
 */
static double moved_since(const struct hdv_limits *own, const struct hdv_scene *scene, int64_t i, const double *z) {
    double *seen = own->seen_z + (scene->at + i) * scene->states, moved = fabs(z[0] - seen[0]);
    for (int64_t j = 1; j < 1 + scene->unit_count; j++) {
        moved += own->reach * fabs(z[j] - seen[j]);
    }
    for (int64_t j = 0; j < scene->states; j++) {
        seen[j] = z[j];
    }
    return moved;
}

/* Look at a body's axis where a bound may clear one of its edges. */
static void screen_unit(
    const struct hdv_limits *own, const struct hdv_scene *scene, int64_t i, int64_t unit, struct hdv_edge *edges,
    double margin
) {
    int64_t at = (scene->at + i) * scene->unit_count + unit;
    const struct hdv_pose *pose = &scene->poses[i * scene->unit_count + unit];
    struct clearance found = clear_by_axis(
        &scene->units[unit], own->axis + unit * HDV_AXIS_POINTS, own->curve, &scene->road[i], pose,
        own->axis_feet + at * HDV_AXIS_POINTS
    );
    double clear[2] = {found.left, found.right};
    for (int side = 0; side < 2; side++) {
        if (clear[side] - margin > HDV_CLEAR_M) {
            edges[side].clear = clear[side];
            edges[side].looked = 0.0;
        }
    }
}

/* Bring what is known of both edges of one body up to date, and write their rows; 0 where a point has no foot. */
static int write_unit(
    const struct hdv_limits *own, const struct hdv_scene *scene, int64_t i, int64_t unit, double moved, double slid,
    double *live
) {
    struct hdv_edge *edges = own->edges + 2 * ((scene->at + i) * scene->unit_count + unit);
    const struct hdv_program *program = &scene->program;
    double margin = scene->road[i].margin + own->clearance;
    int64_t each = own->rows / (2 * scene->unit_count), binding = scene->binding;
    for (int side = 0; side < 2; side++) {
        edges[side].clear -= edges[side].looked > 0.0 ? slid : moved;
    }
    if (!(is_clear(&edges[0], margin, binding) && is_clear(&edges[1], margin, binding))) {
        screen_unit(own, scene, i, unit, edges, margin);
    }
    for (int side = 0; side < 2; side++) {
        struct hdv_edge *edge = &edges[side];
        edge->gap = edge->clear;
        if (!is_clear(edge, margin, binding)) {
            write_edge(own, scene, i, unit, side, edge);
            if (isnan(edge->gap)) {
                return 0;
            }
            edge->looked = 1.0;
            edge->never = 0.0;
        }
        if (!is_clear(edge, margin, binding)) {
            *live = 1.0;
        } else if (edge->never == 0.0) {
            int64_t row = own->row + (2 * unit + side) * each;
            never_bind(program, i, row, row + each, edge->clear - margin);
            edge->never = 1.0;
        }
    }
    return 1;
}

/* Write the rows g dz <= h of the tightest places of every edge at stages i >= begin >= 1; the first state is given. */
int64_t hdv_linearise_limits(void *data, const struct hdv_scene *scene, int64_t begin, int64_t fresh) {
    struct hdv_limits *own = data;
    struct hdv_shape shape = scene->program.shape;
    int64_t edges = 2 * scene->unit_count;
    for (int64_t i = begin; i <= shape.stages; i++) {
        const double *z = state_at(scene->motion, scene->states, i);
        if (fresh) {
            begin_stage(own, scene, i, z);
        }
        double moved = moved_since(own, scene, i, z);
        /* the feet of an edge that was looked at have met other limits */
        double slid = moved > 0.0 && scene->road[i].varies > 0.0 ? INFINITY : moved;
        double *live = stage_at(scene->program.stages, shape.states, shape.inputs, shape.bounded, i).live;
        for (int64_t unit = 0; unit < scene->unit_count; unit++) {
            if (!write_unit(own, scene, i, unit, moved, slid, live)) {
                return i;
            }
        }
    }
    own->violation = 0.0;
    const struct hdv_edge *seen = own->edges + (scene->at + 1) * edges;
    for (int64_t edge = 0; edge < shape.stages * edges; edge++) {
        own->violation = larger(own->violation, -seen[edge].gap);
    }
    return -1;
}
