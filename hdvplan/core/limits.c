/* Limits: the rows that keep every body within the street, linearised at a given motion ([GEO] eq. 9d, [BUS] sec. IV).
 *
 * Bodies far from the kerbs are screened out by a bound of the state, and once found clear they are not looked at again
 * before they have moved. A body that is near is looked at in poses between stations, too: they follow from a stage's
 * state and the curvature held until it, both columns of the program.
 *
 * Row order within a stage: unit, left then right kerbs; then the tightest contact of each section of the body; then,
 * where there are rows for them, what its rear and its front corner reach beyond the kerbs that wheels must keep.
 */
#include "terms.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "kinematics.h"
#include "numbers.h"
#include "sizes.h"
#include "standing.h"

#define NEAR_M 0.2    /* nearer to a kerb a body is looked at before a station: corners close in by less meanwhile */
#define AMONG_M 1.0   /* from a body before a stage, kerbs further away than a step more are not looked at */
#define ALONG 0.7     /* cosine to a body's axis: a gap in a direction nearer to it changes with the way */
#define FAR_M 1e3     /* of a body from a side without any kerb */
#define NEARER_M 0.05 /* nearer still, it is looked at in every pose of the interval */
#define FINE_M 30.0   /* as far ahead poses between stations are looked at: the rest moves a plan by centimetres */
#define DRIFT_M 2e-3  /* rows are good for so small a motion, and for a part of the gap: */
#define DRIFT 0.1

/* The vehicle before a stage: its poses, and how its state there changes with the stage's. */
struct before {
    int known, derived;
    double back, middle[HDV_MOST_STATES]; /* how far [m], and the state half-way */
    struct hdv_station road;
    struct hdv_pose poses[HDV_MOST_UNITS];
    double by_z[HDV_MOST_STATES * HDV_MOST_STATES], by_kappa[HDV_MOST_STATES];
};

/* One stage that is looked at. */
struct stage_scene {
    const struct hdv_limits *own;
    const struct hdv_scene *scene;
    int64_t stage;
    struct before before[HDV_BETWEEN]; /* the first is the stage itself */
};

/* How a side was looked at. */
#define LOOKED 1.0
#define LOOKED_FINELY 2.0

static int is_fine(const struct stage_scene *at) {
    return (double)at->stage * at->scene->step <= FINE_M;
}

/* A side's tightest contact in one section, and in which pose. */
struct tightest {
    struct hdv_contact contact;
    int pose;
};

/* What the rows' breaches cost at the motion at which they were linearised. */
double hdv_price_limits(void *data, const struct hdv_scene *scene) {
    const struct hdv_limits *own = data;
    const struct hdv_program *program = &scene->program;
    struct hdv_shape shape = program->shape;
    double total = 0.0;
    for (int64_t i = 1; i <= shape.stages; i++) {
        if (*program_stage(program, i).live > 0.0) {
            for (int64_t number = own->row; number < own->row + own->rows; number++) {
                struct row row = program_row(program, i, number);
                double over = larger(0.0, -*row.h);
                total += (*row.linear + 0.5 * *row.quadratic * over) * over;
            }
        }
    }
    return total;
}

/* Whether a side needs no rows. While limits bind, large steps need those of every side that no bound clears. */
static int is_clear(const struct hdv_edge *edge, double margin, int64_t binding) {
    return edge->clear - margin > HDV_CLEAR_M && !(binding && edge->looked > 0.0);
}

/* What was seen of a stage: its state, and the curvature until it; then clear_at. */
static double *seen_at(const struct hdv_limits *own, const struct hdv_scene *scene, int64_t i) {
    return own->seen + (scene->at + i) * (scene->states + 2);
}

/* How far all bodies of a stage are clear, where it has no rows [m]; 0 where it has some, or nobody has looked. */
static double *clear_at(const struct hdv_limits *own, const struct hdv_scene *scene, int64_t i) {
    return seen_at(own, scene, i) + scene->states + 1;
}

/* See a stage as its motion is now, before its rows are written. */
static void see(const struct hdv_limits *own, const struct hdv_scene *scene, int64_t i) {
    int64_t n = scene->states;
    double *seen = seen_at(own, scene, i);
    memcpy(seen, state_at(scene->motion, n, i), (size_t)n * sizeof(double));
    seen[n] = state_at(scene->motion, n, i - 1)[n];
    *clear_at(own, scene, i) = 0.0;
}

/* Write what is known of a stage that nothing has been seen of: clearances by a bound from the state. Where the vehicle
 * has not moved since the stage before, the rows of that one are enough; some stations have no limits. */
static void begin_stage(const struct hdv_limits *own, const struct hdv_scene *scene, int64_t i) {
    int64_t units = scene->unit_count, at = (scene->at + i) * units;
    const struct hdv_station *road = &scene->road[i];
    int free = stands(road - 1) || road->room_left == INFINITY;
    double clear = free ? FAR_M : clear_by_state(scene->units, units, road, state_at(scene->motion, scene->states, i));
    for (int64_t edge = 2 * at; edge < 2 * (at + units); edge++)
        own->edges[edge] = (struct hdv_edge){clear, clear, 0.0, 0.0, INFINITY};
    see(own, scene, i);
}

/* Write by how much a stage's state and curvature differ from what was seen; return how far any point has moved [m]. */
static double moved_by(const struct hdv_limits *own, const struct hdv_scene *scene, int64_t i, double *by) {
    int64_t n = scene->states, units = scene->unit_count;
    const double *z = state_at(scene->motion, n, i), *seen = seen_at(own, scene, i);
    for (int64_t j = 0; j < n; j++)
        by[j] = z[j] - seen[j];
    by[n] = state_at(scene->motion, n, i - 1)[n] - seen[n];
    double turned = scene->step * fabs(by[n]); /* wheels turn poses before the stage */
    for (int64_t j = 1; j < n; j++)
        turned += fabs(by[j]) * (j < 1 + units ? 1.0 : scene->step);
    return fabs(by[0]) + own->reach * turned;
}

/* Bring a stage's rows to its motion, straight as far as it has moved. Return whether it has none and needs none. */
static int follow(const struct hdv_limits *own, const struct hdv_scene *scene, int64_t i) {
    const struct hdv_program *program = &scene->program;
    int64_t n = scene->states, units = scene->unit_count;
    double by[HDV_MOST_STATES + 1], moved = moved_by(own, scene, i, by);
    if (!scene->binding && *clear_at(own, scene, i) - moved > HDV_CLEAR_M)
        return 1;
    see(own, scene, i);
    if (moved == 0.0)
        return 0;
    struct hdv_edge *edges = own->edges + 2 * (scene->at + i) * units;
    int64_t each = own->rows / (2 * units);
    for (int64_t edge = 0; edge < 2 * units; edge++) {
        edges[edge].clear -= moved;
        edges[edge].gap -= moved;
        edges[edge].moved += moved;
        int64_t rows = edges[edge].looked > 0.0 && edges[edge].never == 0.0 ? each : 0; /* others never bind */
        for (int64_t number = own->row + edge * each; number < own->row + edge * each + rows; number++) {
            struct row row = program_row(program, i, number);
            for (int64_t j = 0; j <= n; j++)
                *row.h -= row.g[j] * by[j];
        }
    }
    return 0;
}

/* The road's curvature half-way to a place so far before the stage. */
static double bend_at(const struct stage_scene *at, double back) {
    return evaluate(at->own->curve, at->scene->road[at->stage].s - 0.5 * back).curvature;
}

/* The stage's own pose: its state is the program's. */
static void see_stage(struct stage_scene *at) {
    const struct hdv_scene *scene = at->scene;
    int64_t n = scene->states, units = scene->unit_count;
    struct before *to = &at->before[0];
    to->known = to->derived = 1;
    to->road = scene->road[at->stage];
    for (int64_t unit = 0; unit < units; unit++)
        to->poses[unit] = scene->poses[at->stage * units + unit];
    for (int64_t j = 0; j < n; j++) {
        to->by_kappa[j] = 0.0;
        for (int64_t t = 0; t < n; t++)
            to->by_z[j * n + t] = j == t ? 1.0 : 0.0;
    }
}

/* The vehicle so far before the stage (or ahead, if driven rear first), by the explicit midpoint rule, wheels held. */
static void see_before(struct stage_scene *at, int number) {
    const struct hdv_scene *scene = at->scene;
    int64_t n = scene->states, count = scene->unit_count;
    double back = scene->road[at->stage - 1].step * (double)number / HDV_BETWEEN, z_before[HDV_MOST_STATES],
           f[HDV_MOST_STATES];
    const struct hdv_station *road = &scene->road[at->stage];
    const double *z = state_at(scene->motion, n, at->stage);
    double kappa = state_at(scene->motion, n, at->stage - 1)[n];
    struct before *to = &at->before[number];
    to->known = 1;
    to->derived = 0;
    to->back = back;
    derivative(scene->units, count, road->curvature, n, z, kappa, f);
    for (int64_t j = 0; j < n; j++)
        to->middle[j] = z[j] - 0.5 * back * f[j];
    derivative(scene->units, count, bend_at(at, back), n, to->middle, kappa, f);
    for (int64_t j = 0; j < n; j++)
        z_before[j] = z[j] - back * f[j];
    struct path_point point = evaluate(at->own->curve, road->s - back);
    to->road =
        (struct hdv_station){.s = road->s - back, .x = point.x, .y = point.y, .cos = point.cos, .sin = point.sin};
    place(scene->units, count, point.x, point.y, point.cos, point.sin, z_before, to->poses);
}

/* How the state before the stage changes with the stage's, and with the curvature until it. */
static void derive_before(const struct stage_scene *at, struct before *to) {
    const struct hdv_scene *scene = at->scene;
    int64_t n = scene->states, count = scene->unit_count;
    double f[HDV_MOST_STATES], a[HDV_MOST_STATES * HDV_MOST_STATES], b[HDV_MOST_STATES], back = to->back;
    double a_mid[HDV_MOST_STATES * HDV_MOST_STATES], b_mid[HDV_MOST_STATES];
    const double *z = state_at(scene->motion, n, at->stage);
    double kappa = state_at(scene->motion, n, at->stage - 1)[n];
    struct hdv_pose turned[HDV_MOST_UNITS];
    to->derived = 1;
    jacobian(scene->units, count, scene->road[at->stage].curvature, n, z, kappa, at->before[0].poses, f, a, b);
    turn(count, to->middle, turned);
    jacobian(scene->units, count, bend_at(at, back), n, to->middle, kappa, turned, f, a_mid, b_mid);
    for (int64_t j = 0; j < n; j++) {
        to->by_kappa[j] = -back * b_mid[j];
        for (int64_t t = 0; t < n; t++)
            to->by_z[j * n + t] = (j == t ? 1.0 : 0.0) - back * a_mid[j * n + t];
        for (int64_t i = 0; i < n; i++) {
            double share = 0.5 * back * back * a_mid[j * n + i];
            to->by_kappa[j] += share * b[i];
            for (int64_t t = 0; t < n; t++)
                to->by_z[j * n + t] += share * a[i * n + t];
        }
    }
}

/* Write the row that keeps a contact's gap at least margin. */
static void
write_row(struct stage_scene *at, int64_t unit, const struct tightest *found, double margin, int64_t number) {
    const struct hdv_program *program = &at->scene->program;
    struct before *pose = &at->before[found->pose];
    const struct hdv_contact *contact = &found->contact;
    int64_t n = at->scene->states;
    double gradient[HDV_MOST_STATES];
    if (!pose->derived)
        derive_before(at, pose);
    struct row row = program_row(program, at->stage, number);
    struct plane_point point = body_point(&pose->poses[unit], contact->ahead, contact->left);
    point_gradient(pose->poses, unit, point, &pose->road, contact->along_x, contact->along_y, n, gradient);
    for (int64_t t = 0; t < n; t++) {
        row.g[t] = 0.0;
        for (int64_t j = 0; j <= 1 + unit; j++)
            row.g[t] -= gradient[j] * pose->by_z[j * n + t];
    }
    row.g[n] = 0.0;
    for (int64_t j = 0; j <= 1 + unit; j++)
        row.g[n] -= gradient[j] * pose->by_kappa[j];
    *row.h = contact->gap - margin;
}

/* Write rows begin <= number < end of stage i that never bind: g = 0, h = clear > 0. */
static void never_bind(const struct hdv_program *program, int64_t i, int64_t begin, int64_t end, double clear) {
    int64_t n = program->shape.states;
    for (int64_t number = begin; number < end; number++) {
        struct row row = row_at(program, n, i, number);
        for (int64_t j = 0; j < n; j++)
            row.g[j] = 0.0;
        *row.h = clear;
    }
}

/* A gap as it may have been a step before: smaller by that step where it lies along the body's way. */
static double gap_before(const struct hdv_contact *contact, const struct hdv_pose *pose, double step) {
    double along = contact->along_x * pose->cos + contact->along_y * pose->sin;
    return fabs(along) > ALONG ? contact->gap - step : contact->gap;
}

/* The smallest gap among contacts, and to walls across the street, as they may have been a step before. */
static double least_of(const struct hdv_contacts *found, const struct hdv_pose *pose, double step) {
    double least = INFINITY;
    for (int side = 0; side < 2; side++) {
        double own = smaller(found->at[side][0].gap, found->at[side][HDV_SECTIONS - 1].gap);
        for (int section = 0; section < HDV_SECTIONS; section++)
            least = smaller(least, gap_before(&found->at[side][section], pose, step));
        least = found->near[side] < own ? smaller(least, found->near[side] - step) : least;
    }
    return least;
}

/* What is tightest of a body at a stage, and before it; its overhangs at the stage. */
struct looked {
    struct tightest at[2][HDV_SECTIONS], overhang[2][2];
    double near[2]; /* walls across the street included [m] */
};

/* Look at a body before a stage, and keep what is tighter; return the least gap. */
static double
look_before(struct stage_scene *at, int64_t unit, int number, const struct hdv_near *among, struct looked *found) {
    struct hdv_contacts seen;
    if (!at->before[number].known)
        see_before(at, number);
    const struct before *before = &at->before[number];
    const struct hdv_unit *body = &at->scene->units[unit];
    look_at_body(
        at->own->street, among, HDV_TO_PLAN, body, &before->poses[unit], before->road.s, at->own->behind[unit], &seen
    );
    for (int side = 0; side < 2; side++) {
        for (int section = 0; section < HDV_SECTIONS; section++)
            if (seen.at[side][section].gap < found->at[side][section].contact.gap)
                found->at[side][section] = (struct tightest){seen.at[side][section], number};
        found->near[side] = smaller(found->near[side], seen.near[side]);
    }
    return least_of(&seen, &before->poses[unit], 0.0);
}

/* What the plan is to keep from every kerb at a stage, beyond what sampling needs [m]. */
static double wanted(const struct hdv_limits *own, const struct hdv_scene *scene, int64_t stage) {
    return own->clearance - scene->road[stage].give_way;
}

/* Look at a body at a stage and, where it is near a kerb, before it; the tightest contacts of both sides. */
static void look_at_unit(struct stage_scene *at, int64_t unit, struct looked *found) {
    const struct hdv_limits *own = at->own;
    const struct hdv_unit *body = &at->scene->units[unit];
    struct hdv_contacts seen;
    const struct hdv_pose *pose = &at->before[0].poses[unit];
    double clearance = wanted(own, at->scene, at->stage);
    double s = at->before[0].road.s, end = own->street->end;
    look_at_body(own->street, NULL, HDV_TO_PLAN, body, pose, s, own->behind[unit], &seen);
    for (int side = 0; side < 2; side++) {
        for (int section = 0; section < HDV_SECTIONS; section++)
            found->at[side][section] = (struct tightest){seen.at[side][section], 0};
        for (int end = 0; end < 2; end++)
            found->overhang[side][end] = (struct tightest){seen.overhang[side][end], 0};
        found->near[side] = seen.near[side];
    }
    if (!is_fine(at))
        return;
    double least = least_of(&seen, pose, at->scene->step) - clearance;
    if (s > end && s - at->scene->step < end) /* before the road's end more counts than beyond it */
        least = 0.0;
    if (least > NEAR_M)
        return;
    const struct hdv_near *among = own->near;
    pieces_near(own->street, body, pose, s, own->behind[unit], clearance + AMONG_M + at->scene->step, own->near);
    if (among->count < 0 || least < -AMONG_M) /* far beyond a kerb, all */
        among = NULL;
    for (int round = 0; round < 2 && least <= (round == 0 ? NEAR_M : NEARER_M);
         round++) { /* every other one, the others */
        for (int number = 2 - round; number < HDV_BETWEEN; number += 2)
            least = smaller(least, look_before(at, unit, number, among, found) - clearance);
    }
}

/* The least gap of several contacts [m]. */
static double least_gap(const struct tightest *found, int count) {
    double least = FAR_M;
    for (int number = 0; number < count; number++)
        least = smaller(least, found[number].contact.gap);
    return least;
}

/* Write the rows of several contacts. */
static void
write_rows(struct stage_scene *at, int64_t unit, const struct tightest *found, int count, double margin, int64_t row) {
    for (int number = 0; number < count; number++) {
        if (found[number].contact.piece < 0)
            never_bind(&at->scene->program, at->stage, row + number, row + number + 1, HDV_CLEAR_M);
        else
            write_row(at, unit, &found[number], margin, row + number);
    }
}

/* Write what is known of one side of a body, and its rows where it is not clear. */
static void write_side(
    struct stage_scene *at, int64_t unit, const struct looked *found, int side, int64_t row, struct hdv_edge *edge
) {
    double margin = at->scene->road[at->stage].margin + wanted(at->own, at->scene, at->stage);
    int overhangs = at->own->rows > 2 * HDV_ROWS_PER_SIDE * at->scene->unit_count ? 2 : 0;
    edge->gap = smaller(least_gap(found->at[side], HDV_ROWS_PER_SIDE), found->near[side]);
    edge->clear = smaller(edge->gap, least_gap(found->overhang[side], overhangs));
    edge->looked = is_fine(at) ? LOOKED_FINELY : LOOKED;
    edge->never = edge->moved = 0.0;
    if (is_clear(edge, margin, at->scene->binding))
        return;
    write_rows(at, unit, found->at[side], HDV_ROWS_PER_SIDE, margin, row);
    write_rows(at, unit, found->overhang[side], overhangs, 0.0, row + HDV_ROWS_PER_SIDE);
}

/* Whether a side's rows are none, or those of another motion, or of stations alone. */
static int is_stale(const struct hdv_edge *edge, double clearance, int fine) {
    return edge->looked < (fine ? LOOKED_FINELY : LOOKED) || edge->never > 0.0 ||
           edge->moved > larger(DRIFT_M, DRIFT * fabs(edge->gap - clearance));
}

/* Bring what is known of a body's sides, and rows, up to date; return how far it is clear [m], 0 if it has rows. */
static double write_unit(struct stage_scene *at, int64_t unit) {
    const struct hdv_limits *own = at->own;
    const struct hdv_scene *scene = at->scene;
    struct hdv_edge *edges = own->edges + 2 * ((scene->at + at->stage) * scene->unit_count + unit);
    double clearance = wanted(own, scene, at->stage), margin = scene->road[at->stage].margin + clearance;
    int64_t each = own->rows / (2 * scene->unit_count), row = own->row + 2 * unit * each, binding = scene->binding;
    int stale = 0;
    for (int side = 0; side < 2; side++) {
        stale = stale || (!is_clear(&edges[side], margin, binding) && is_stale(&edges[side], clearance, is_fine(at)));
    }
    if (stale) {
        struct looked found;
        if (!at->before[0].known)
            see_stage(at);
        look_at_unit(at, unit, &found);
        for (int side = 0; side < 2; side++)
            write_side(at, unit, &found, side, row + side * each, &edges[side]);
    }
    double least = INFINITY;
    for (int side = 0; side < 2; side++) {
        double clear = is_clear(&edges[side], margin, binding) ? edges[side].clear - margin : 0.0;
        least = smaller(least, clear);
        if (clear > 0.0 && edges[side].never == 0.0) {
            never_bind(&scene->program, at->stage, row + side * each, row + (side + 1) * each, clear);
            edges[side].never = 1.0;
        }
    }
    return least;
}

/* The gap of one side of a body: as its rows say, which follow the motion; without rows, what is known at least. */
static double gap_of(const struct hdv_limits *own, const struct hdv_scene *scene, int64_t i, int64_t number) {
    const struct hdv_program *program = &scene->program;
    const struct hdv_edge *edge = own->edges + 2 * (scene->at + i) * scene->unit_count + number;
    int64_t each = own->rows / (2 * scene->unit_count);
    if (edge->looked == 0.0 || edge->never > 0.0)
        return edge->gap;
    double least = INFINITY;
    for (int64_t row = own->row + number * each; row < own->row + number * each + HDV_ROWS_PER_SIDE; row++)
        least = smaller(least, *program_row(program, i, row).h);
    return least + scene->road[i].margin + wanted(own, scene, i);
}

/* Write the rows of a stage that may need some. */
static void write_stage(struct stage_scene *at, int64_t i) {
    const struct hdv_scene *scene = at->scene;
    double clear = INFINITY;
    at->stage = i;
    for (int number = 0; number < HDV_BETWEEN; number++)
        at->before[number].known = 0;
    for (int64_t unit = 0; unit < scene->unit_count; unit++)
        clear = smaller(clear, write_unit(at, unit));
    *clear_at(at->own, scene, i) = clear;
    if (!(clear > 0.0))
        *program_stage(&scene->program, i).live = 1.0;
}

/* Write the rows g dx <= h of all bodies' tightest contacts at stages i >= begin >= 1; the first state is given. */
int64_t hdv_linearise_limits(void *data, const struct hdv_scene *scene, int64_t begin, int64_t fresh) {
    struct hdv_limits *own = data;
    int64_t last = scene->program.shape.stages;
    struct stage_scene at; /* its 0.1 MB are not set to zero first: that took longer than some plans' limits */
    at.own = own;
    at.scene = scene;
    for (int64_t i = begin; i <= last; i++) {
        if (fresh)
            begin_stage(own, scene, i);
        if (fresh || !follow(own, scene, i))
            write_stage(&at, i);
    }
    own->violation = 0.0;
    for (int64_t i = 1; i <= last; i++) {
        int64_t edges = *clear_at(own, scene, i) > 0.0 ? 0 : 2 * scene->unit_count;
        for (int64_t edge = 0; edge < edges; edge++)
            own->violation = larger(own->violation, -gap_of(own, scene, i, edge));
    }
    return -1;
}
