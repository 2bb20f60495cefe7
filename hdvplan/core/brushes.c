/* Where bodies that stray from their plan may come upon a kerb: pairs of a body's corner and a piece of kerb, and of a
 * kerb's corner and a side of a body. To first order each pair's gap falls as the body strays, whatever its direction;
 * of a kerb's corner the distance is convex, so that no pair falls faster. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>

#include "kinematics.h"
#include "numbers.h"
#include "tracking.h"

#define REACH_M 0.5                 /* more than a body moves between two poses */
#define HALF 0.5                    /* of the way to the next pose: from there on that one counts */
static const double NEVER_M = 1e-9; /* a corner of a body so near to a corner of a kerb has no direction from there */

enum { CORNERS = 4 }; /* of a body */

/* A corner of a body: rear right, rear left, front right, front left. */
struct corner {
    double ahead, left; /* [m] */
    double x, y;        /* in the plane [m] */
    double far;         /* what it comes at most, in any direction, and REACH_M [m] */
};

/* One body at one pose. */
struct body {
    const struct hdv_tracked *on;
    const struct hdv_street *street;
    const struct hdv_unit *unit;
    const struct hdv_pose *pose, *before, *after; /* half-way to its neighbours the body is looked at */
    const struct hdv_link *link, *next_link;      /* around it */
    struct hdv_stray stray;                       /* the most it strays here */
    struct corner corners[2][CORNERS];            /* of all of it, and of its wheels and what lies between */
    double axle_off, at, last, reach;
    int64_t number;
};

/* What is found. */
struct found {
    struct hdv_brush *brushes;
    int64_t room, count;
};

/* A point of a body and a kerb. */
struct pair {
    double gap;         /* [m] */
    double ahead, left; /* the point [m] */
    double x, y;        /* the direction away from the kerb, in the plane */
    double s;           /* the line's arclength beside the kerb there [m] */
    int64_t piece;
    double past, next; /* shares of the way to the poses before and after at which they are a pair, too */
};

/* How far a brush comes at most, by its body's axle and heading (T5), or by its axle and coupling (T1). */
static double reached(const struct hdv_brush *brush, const struct body *body) {
    const struct hdv_stray *stray = &body->stray;
    double heading = fabs(brush->by_heading), third = stray->heading - sin(stray->heading);
    double apart = fabs(brush->by_axle) * stray->axle + heading * stray->heading;
    double here = brush->by_axle - brush->by_heading * body->link->by_axle;
    double next = brush->by_axle - brush->by_heading * body->next_link->by_axle;
    double by_offset = larger(body->link->by_offset, body->next_link->by_offset);
    double offset = stray->offset + stray->residual + stray->bow;
    double together = larger(fabs(here), fabs(next)) * stray->axle + heading * (by_offset * offset + third);
    return smaller(apart, together) + brush->second * (1.0 - cos(stray->heading));
}

/* What a pair is to the driver's errors. */
static struct hdv_brush brush_of(const struct body *body, const struct pair *pair) {
    double ahead = pair->ahead, left = pair->left, x = pair->x, y = pair->y;
    const struct hdv_pose *pose = body->pose;
    struct plane_point point = body_point(pose, ahead, left), next = body_point(body->after, ahead, left),
                       past = body_point(body->before, ahead, left);
    double cosine = cos(body->axle_off), sine = sin(body->axle_off);
    double along = x * pose->cos + y * pose->sin, across = y * pose->cos - x * pose->sin; /* of the normal */
    double forth = (next.x - point.x) * x + (next.y - point.y) * y,
           back = (past.x - point.x) * x + (past.y - point.y) * y;
    double between = smaller(smaller(pair->next * forth, pair->past * back), 0.0);
    return (struct hdv_brush){
        .gap = pair->gap + between,
        .at = body->at,
        .by_axle = along * sine - across * cosine,
        .by_heading = left * along - ahead * across,
        .second = fabs(ahead * along + left * across),
        .s = pair->s,
        .x = point.x,
        .y = point.y,
        .ahead = ahead,
        .unit = body->number,
        .piece = pair->piece,
    };
}

/* Keep a pair whose gap the body may close. */
static void keep(struct found *found, const struct body *body, const struct hdv_brush *brush) {
    if (brush->gap >= reached(brush, body) || !(brush->s < body->last))
        return;
    if (found->count < found->room)
        found->brushes[found->count] = *brush;
    found->count++;
}

/* A corner of the body and a piece of kerb. Any line that leaves the corner on one side and the piece on the other
 * keeps them apart: the piece's own, or, from beyond an end, the one across the way from there; that of the larger gap
 * to what may be reached is kept. What is kept apart from every piece stays in the street. */
static void meet_piece(struct found *found, const struct body *body, int64_t number, const struct corner *corner) {
    const struct hdv_piece *piece = &body->street->pieces[number];
    double dx = corner->x - piece->x, dy = corner->y - piece->y, length = piece->length;
    double along = dx * piece->cos + dy * piece->sin, across = dy * piece->cos - dx * piece->sin;
    double end = clamped(along, 0.0, length), share = length > 0.0 ? end / length : 0.0;
    if ((along - end) * (along - end) + across * across > corner->far * corner->far)
        return;
    struct pair pair = {across,         corner->ahead, corner->left, -piece->sin, piece->cos,
                        piece->s_begin, number,        HALF,         HALF};
    pair.s += share * (piece->s_end - piece->s_begin);
    struct hdv_brush own = brush_of(body, &pair);
    if (along == end) {
        if (across >= 0.0 && length > 0.0)
            keep(found, body, &own);
        return;
    }
    dx -= end * piece->cos;
    dy -= end * piece->sin;
    pair.gap = sqrt(dx * dx + dy * dy);
    if (pair.gap <= NEVER_M)
        return;
    pair.x = dx / pair.gap;
    pair.y = dy / pair.gap;
    struct hdv_brush slanting = brush_of(body, &pair);
    bool better = across > 0.0 && own.gap * reached(&slanting, body) > slanting.gap * reached(&own, body);
    keep(found, body, better ? &own : &slanting);
}

/* The share of the way between two poses on which a corner of a kerb stays beside a body of which so much is left. */
static double beside_for(double left, const struct hdv_pose *from, const struct hdv_pose *to) {
    double way = (to->x - from->x) * from->cos + (to->y - from->y) * from->sin;
    return left < way ? left / way : HALF;
}

/* A corner of a kerb and the side of the body that faces it, from rear to front. */
static void meet_side(struct found *found, const struct body *body, int64_t number, double rear, double front) {
    const struct hdv_piece *piece = &body->street->pieces[number];
    const struct hdv_pose *pose = body->pose;
    double x = piece->x - pose->x, y = piece->y - pose->y, u = x * pose->cos + y * pose->sin;
    double sign = piece->left ? 1.0 : -1.0, room = sign * (y * pose->cos - x * pose->sin) - body->unit->half_width;
    if (u < rear || u > front || room < -2.0 * body->unit->half_width || room > body->reach)
        return;
    double next = beside_for(u - rear, pose, body->after), past = beside_for(front - u, body->before, pose);
    struct pair pair = {
        room, u, sign * body->unit->half_width, sign * pose->sin, -sign * pose->cos, piece->s_begin, number, past, next,
    };
    struct hdv_brush brush = brush_of(body, &pair);
    keep(found, body, &brush);
}

static void meet_body(struct found *found, const struct body *body, int64_t number) {
    const struct hdv_piece *piece = &body->street->pieces[number];
    const struct corner *corners = body->corners[piece->wheels ? 1 : 0];
    for (int corner = 0; corner < CORNERS; corner++)
        meet_piece(found, body, number, &corners[corner]);
    if (piece->corner)
        meet_side(found, body, number, corners[0].ahead, corners[CORNERS - 1].ahead);
}

/* The most that a unit strays around a place of the front axle's track. */
static struct hdv_stray stray_at(const struct hdv_tracked *on, double at, int64_t unit) {
    int64_t interval = whole(at / on->spacing - 0.5, 0, on->intervals - 1);
    const struct hdv_stray *here = &on->strays[interval * on->count + unit];
    const struct hdv_stray *next = interval + 1 < on->intervals ? here + on->count : here;
    struct hdv_stray most = *here;
    most.axle = larger(here->axle, next->axle);
    most.heading = larger(here->heading, next->heading);
    most.offset = larger(here->offset, next->offset);
    most.residual = larger(here->residual, next->residual);
    most.bow = larger(fabs(here->bow), fabs(next->bow));
    return most;
}

/* What a point of a body, so far from its axle, comes at most, in any direction [m]. */
static double moved(const struct hdv_stray *stray, double ahead, double left) {
    return stray->axle + hypot(ahead, left) * stray->heading + REACH_M;
}

/* A body as it is looked at in one pose. */
static void begin_body(
    struct body *body, const struct hdv_tracked *on, const struct hdv_street *street, const struct hdv_posed *posed,
    int64_t i, int64_t number
) {
    const struct hdv_unit *unit = &on->units[number];
    const struct hdv_pose *pose = &posed->poses[i * on->count + number];
    double at = posed->front[i];
    int64_t interval = whole(at / on->spacing, 0, on->intervals - 1);
    body->on = on;
    body->street = street;
    body->unit = unit;
    body->pose = pose;
    body->number = number;
    body->at = at;
    body->before = i > 0 ? pose - on->count : pose;
    body->after = i + 1 < posed->count ? pose + on->count : pose;
    body->stray = stray_at(on, at, number);
    body->axle_off = on->links[interval * on->count + number].axle_off;
    interval = whole(at / on->spacing - 0.5, 0, on->intervals - 1);
    body->link = &on->links[interval * on->count + number];
    body->next_link = interval + 1 < on->intervals ? body->link + on->count : body->link;
    body->last = posed->s[i] > street->end ? street->end : INFINITY;
    body->reach = moved(&body->stray, larger(unit->front, unit->rear_overhang), unit->half_width);
    double ends[2][2] = {{-unit->rear_overhang, unit->front}, {0.0, smaller(unit->wheelbase, unit->front)}};
    for (int part = 0; part < 2; part++) {
        for (int corner = 0; corner < CORNERS; corner++) {
            double ahead = ends[part][corner / 2], left = corner % 2 ? unit->half_width : -unit->half_width;
            struct plane_point point = body_point(pose, ahead, left);
            body->corners[part][corner] =
                (struct corner){ahead, left, point.x, point.y, moved(&body->stray, ahead, left)};
        }
    }
}

/* Write the pairs that bodies may close, as far as there is room; return how many there are. */
HDV_EXPORT int64_t hdv_brushes(
    const struct hdv_tracked *on, const struct hdv_street *street, const struct hdv_posed *posed,
    struct hdv_brush *brushes, int64_t room
) {
    struct found found = {brushes, room, 0};
    struct body body;
    for (int64_t i = 0; i < posed->count; i++) {
        for (int64_t number = 0; number < on->count; number++) {
            begin_body(&body, on, street, posed, i, number);
            struct box_beside in = box_around(body.unit, body.pose, posed->s[i], posed->behind[number], body.reach);
            for (int64_t piece = next_in(street, &in, 0); piece >= 0; piece = next_in(street, &in, piece + 1))
                meet_body(&found, &body, piece);
        }
    }
    return found.count;
}
