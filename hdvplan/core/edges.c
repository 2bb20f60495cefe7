/* The places of a body's edges that come nearest to a limit, and the rows that keep them from it.
 *
 * Of every edge the sampled points are looked at and, where limits change or the road bends, the tightest place between
 * them.
 */
#include "edges.h"

#include <math.h>

#include "kinematics.h"
#include "numbers.h"
#include "path.h"
#include "sizes.h"

#define WALL                                                                                                           \
    1.0 /* slope of a limit from which on it is a wall: turning away from one must not look better than passing it */

enum { LAST_POINT = HDV_POINTS_PER_EDGE - 1 };

/* A place on an edge: on the body, in the plane and on the road, and its limit. */
struct place {
    double ahead; /* of the axle [m] */
    struct plane_point at;
    struct foot foot;
    double slope; /* of its limit along s */
    double gap;   /* to its limit [m] */
};

/* One edge of one body at one stage, and what its rows need. */
struct edge_scene {
    const struct hdv_limits *own;
    const struct hdv_scene *scene;
    const struct hdv_edge_point *points;
    const struct hdv_pose *pose;
    int64_t stage, unit, side;
    double sign;   /* 1 left, -1 right */
    double margin; /* to keep from the limits [m] */
};

/* Linear between the table's entries, constant beyond them. */
struct limit limit_at(const struct hdv_limit_table *table, int64_t row, double s) {
    double at = (s - table->s_first) / table->spacing;
    int64_t index = whole(at, 0, table->count - 2);
    const double *values = table->values + row * table->count + index;
    double part = at - (double)index, slope = (values[1] - values[0]) / table->spacing;
    if (part <= 0.0) {
        return (struct limit){values[0], part < 0.0 ? 0.0 : slope};
    }
    if (part > 1.0) {
        return (struct limit){values[1], 0.0};
    }
    return (struct limit){values[0] + part * (values[1] - values[0]), slope};
}

/* The same for a caller outside: found receives the limit and its slope. */
void hdv_limit_at(const struct hdv_limit_table *table, int64_t row, double s, double *found) {
    struct limit limit = limit_at(table, row, s);
    found[0] = limit.value;
    found[1] = limit.slope;
}

/* Write all about the place of an edge so far ahead of the axle; 0 where it has no foot. */
static int look(const struct edge_scene *edge, double ahead, int64_t region, double near, struct place *place) {
    double left = edge->sign * edge->scene->units[edge->unit].half_width;
    struct plane_point at = body_point(edge->pose, ahead, left);
    place->foot = project(edge->own->curve, at.x, at.y, near, PLANNING_STEP_M);
    struct limit limit = limit_at(edge->own->table, edge->side + 2 * region, place->foot.s);
    place->ahead = ahead;
    place->at = at;
    place->slope = fabs(limit.slope) < WALL ? limit.slope : 0.0;
    place->gap = edge->sign * (limit.value - place->foot.offset);
    return !isnan(place->foot.offset);
}

/* 1 where the edge between a sampled point and the next belongs to an overhang. */
static int64_t overhang_between(const struct edge_scene *edge, int64_t number) {
    return edge->points[number].overhang | edge->points[number + 1].overhang;
}

/* Where an edge is tightest between two sampled points: behind which of them (-1: nowhere), and at which entry of the
 * table (-1: none). */
struct between {
    int64_t point, entry;
    double ahead; /* of the axle [m] */
    double gap;   /* [m] */
};

/* The edge between two sampled points, along their chord and, by the road's curvature, beside it:
 * offset + part rise + part (1 - part) bow, with part from 0 to 1. */
struct chord {
    const struct place *from, *to;
    double rise, bow, length; /* [m] */
    double ends;              /* the smaller gap of the two points [m] */
};

static struct chord chord_of(const struct place *from, const struct place *to) {
    double k = 0.5 * (from->foot.curvature + to->foot.curvature), length = to->ahead - from->ahead;
    double bow = 0.5 * k / (1.0 - k * from->foot.offset) * length * length;
    return (struct chord){from, to, to->foot.offset - from->foot.offset, bow, length, smaller(from->gap, to->gap)};
}

/* Steady limits leave the middle of the bow to look at. */
static void look_at_bow(const struct edge_scene *edge, struct chord chord, int64_t number, struct between *found) {
    if (!(edge->sign * chord.bow > fabs(chord.rise))) { /* the bow's summit does not lie between the points */
        return;
    }
    double part = 0.5 + 0.5 * chord.rise / chord.bow;
    double gap = chord.from->gap - edge->sign * (part * chord.rise + part * (1.0 - part) * chord.bow);
    if (gap < smaller(found->gap, chord.ends)) {
        *found = (struct between){number, -1, chord.from->ahead + part * chord.length, gap};
    }
}

/* Other limits are tightest at one of their entries. */
static void look_at_entries(const struct edge_scene *edge, struct chord chord, int64_t number, struct between *found) {
    const struct hdv_limit_table *table = edge->own->table;
    const struct foot *from = &chord.from->foot;
    const double *limits = table->values + (edge->side + 2 * overhang_between(edge, number)) * table->count;
    double along = chord.to->foot.s - from->s;
    int64_t first = whole(ceil((from->s - table->s_first) / table->spacing), 0, table->count);
    int64_t last = whole(floor((chord.to->foot.s - table->s_first) / table->spacing), -1, table->count - 1);
    for (int64_t entry = first; entry <= last; entry++) {
        double part = (table->s_first + (double)entry * table->spacing - from->s) / along;
        double gap = edge->sign * (limits[entry] - from->offset - part * chord.rise - part * (1.0 - part) * chord.bow);
        if (gap < smaller(found->gap, chord.ends)) {
            *found = (struct between){number, entry, chord.from->ahead + part * chord.length, gap};
        }
    }
}

/* The tightest place between two sampled points that is tighter than both. */
static struct between tightest_between(const struct edge_scene *edge, int steady, const struct place *places) {
    struct between found = {-1, -1, 0.0, INFINITY};
    for (int64_t number = 0; number < LAST_POINT; number++) {
        struct chord chord = chord_of(&places[number], &places[number + 1]);
        if (steady) {
            look_at_bow(edge, chord, number, &found);
        } else {
            look_at_entries(edge, chord, number, &found);
        }
    }
    return found;
}

/* Look at the place between, if there is one; 0 where it has no foot.
 * There edge and limit run alike, or the limit has a corner there that slides along the edge: either way the clearance
 * changes as if the limit had the edge's direction. */
static int look_between(const struct edge_scene *edge, struct between at, struct place *places) {
    struct place *place = &places[HDV_POINTS_PER_EDGE];
    const struct hdv_limit_table *table = edge->own->table;
    int64_t region = overhang_between(edge, at.point);
    if (!look(edge, at.ahead, region, places[at.point].foot.s, place)) {
        return 0;
    }
    double across_road = edge->pose->sin * place->foot.cos - edge->pose->cos * place->foot.sin;
    double along_road = edge->pose->cos * place->foot.cos + edge->pose->sin * place->foot.sin;
    place->slope = (1.0 - place->foot.curvature * place->foot.offset) * across_road / along_road;
    if (at.entry >=
        0) { /* the place was found by a parabola: its foot is centimetres off the entry, on a steep limit */
        double beyond = table->s_first + (double)at.entry * table->spacing - place->foot.s;
        double limit = table->values[(edge->side + 2 * region) * table->count + at.entry];
        place->gap = edge->sign * (limit - place->foot.offset - place->slope * beyond);
    }
    return 1;
}

/* Write the row that keeps a place at least gap inside its limit, which has the given slope along s there. */
static void
write_row(const struct edge_scene *edge, const struct place *place, double slope, double gap, struct row row) {
    double across[HDV_MOST_STATES], along[HDV_MOST_STATES], cosine = place->foot.cos, sine = place->foot.sin;
    const struct hdv_scene *scene = edge->scene;
    const struct hdv_pose *poses = scene->poses + edge->stage * scene->unit_count;
    const struct hdv_station *at = &scene->road[edge->stage];
    point_gradient(poses, edge->unit, place->at, at, -sine, cosine, scene->states, across);
    point_gradient(poses, edge->unit, place->at, at, cosine, sine, scene->states, along);
    double per_t = slope / (1.0 - place->foot.curvature * place->foot.offset);
    for (int64_t j = 0; j < scene->states; j++) {
        row.g[j] = edge->sign * (across[j] - per_t * along[j]);
    }
    *row.h = gap;
}

/* Write rows begin <= number < end of stage i that never bind: g = 0, h = clear > 0. */
void never_bind(const struct hdv_program *program, int64_t i, int64_t begin, int64_t end, double clear) {
    int64_t n = program->shape.states;
    for (int64_t number = begin; number < end; number++) {
        struct row row = row_at(program->rows, n, program->shape.rows, i, number);
        for (int64_t j = 0; j < n; j++) {
            row.g[j] = 0.0;
        }
        *row.h = clear;
    }
}

/* The tightest of the places on the edge's rear half (0) or front half (1). */
static const struct place *tightest_of(const struct place *places, int looked, int half, double middle) {
    const struct place *pick = &places[half * LAST_POINT];
    for (int other = 0; other < looked; other++) {
        if ((places[other].ahead > middle) == (half == 1) && places[other].gap < pick->gap) {
            pick = &places[other];
        }
    }
    return pick;
}

/* Write what the edge's corners reach beyond the wheels' limit, if they belong to overhangs; return the least room. */
static double write_corners(const struct edge_scene *edge, const struct place *places, int64_t row, double clear) {
    const struct hdv_program *program = &edge->scene->program;
    for (int end = 0; end < 2; end++) {
        int corner = end * LAST_POINT;
        int64_t number = row + HDV_ROWS_PER_EDGE + end;
        if (edge->points[corner].overhang == 0) {
            never_bind(program, edge->stage, number, number + 1, HDV_CLEAR_M);
            continue;
        }
        struct limit limit = limit_at(edge->own->table, edge->side, places[corner].foot.s);
        double room = edge->sign * (limit.value - places[corner].foot.offset);
        clear = smaller(clear, room);
        struct row to = row_at(program->rows, program->shape.states, program->shape.rows, edge->stage, number);
        write_row(edge, &places[corner], limit.slope, room, to);
    }
    return clear;
}

/* Look at all places of the edge; return how many there are, or 0 where one has no foot. */
static int look_at_edge(const struct edge_scene *edge, double *feet, struct place *places) {
    for (int point = 0; point < HDV_POINTS_PER_EDGE; point++) {
        double *near = &feet[2 * point + edge->side];
        if (!look(edge, edge->points[point].ahead, edge->points[point].overhang, *near, &places[point])) {
            return 0;
        }
        *near = places[point].foot.s;
    }
    struct between at = tightest_between(edge, edge->scene->road[edge->stage].varies == 0.0, places);
    if (at.point < 0) {
        return HDV_POINTS_PER_EDGE;
    }
    return look_between(edge, at, places) ? HDV_POINTS_PER_EDGE + 1 : 0;
}

void write_edge(
    const struct hdv_limits *own, const struct hdv_scene *scene, int64_t i, int64_t number, int64_t side,
    struct hdv_edge *edge
) {
    const struct hdv_edge_point *points = own->points + number * HDV_POINTS_PER_EDGE;
    const struct hdv_pose *pose = &scene->poses[i * scene->unit_count + number];
    double margin = scene->road[i].margin + own->clearance;
    struct edge_scene at = {own, scene, points, pose, i, number, side, side == 0 ? 1.0 : -1.0, margin};
    double *feet = own->feet + ((scene->at + i) * scene->unit_count + number) * HDV_POINTS_PER_EDGE * 2;
    struct place places[HDV_POINTS_PER_EDGE + 1];
    edge->gap = edge->clear = NAN;
    int looked = look_at_edge(&at, feet, places);
    if (looked == 0) {
        return;
    }
    double tightest = INFINITY, middle = 0.5 * (points[0].ahead + points[LAST_POINT].ahead);
    for (int place = 0; place < looked; place++) {
        tightest = smaller(tightest, places[place].gap);
    }
    const struct hdv_program *program = &scene->program;
    int64_t each = own->rows / (2 * scene->unit_count), row = own->row + (2 * number + side) * each;
    for (int half = 0; half < HDV_ROWS_PER_EDGE; half++) {
        const struct place *place = tightest_of(places, looked, half, middle);
        struct row to = row_at(program->rows, program->shape.states, program->shape.rows, i, row + half);
        write_row(&at, place, place->slope, place->gap - margin, to);
    }
    edge->gap = tightest;
    edge->clear = each > HDV_ROWS_PER_EDGE ? write_corners(&at, places, row, tightest) : tightest;
}
