/* What a plan sweeps.
 *
 * The envelope of a moving body is traced by few of its points: its corners, and the points of its edges beside its
 * axle, because the axle does not slide and the body turns about a point of the axle's line; where it begins to turn
 * the other way, also by its edges. Each place's left and right reach thus belong to one point of one stage each.
 */
#include "terms.h"

#include <math.h>

#include "kinematics.h"
#include "numbers.h"
#include "path.h"

#define TIE_M 1e-4    /* a point takes a place over from another one when it reaches this much further */
#define SWING 1e-4    /* change of a body's turning per stage, from which its edges count where it turns back [rad] */
#define EDGE_M 1.0    /* length of the straight pieces of such an edge */
#define NOWHERE_M 1e9 /* beyond the end of any road: the first point of an edge has no piece behind it */
#define FOOTLESS 0.95 /* curvature times offset from which on a point counts as without a foot */

/* A point in the frame of the station nearest to it. */
struct seen_from {
    const struct hdv_station *station;
    int64_t number;       /* of the station */
    double ahead, beside; /* [m] */
};

static struct seen_from nearest_station(const struct hdv_bodies *bodies, double x, double y, int64_t near) {
    struct seen_from seen = {0};
    int64_t last = bodies->station_count - 1;
    for (int round = 0; round < 4; round++) {
        near = near < 0 ? 0 : near > last ? last : near;
        const struct hdv_station *at = &bodies->stations[near];
        double dx = x - at->x, dy = y - at->y;
        seen = (struct seen_from){at, near, dx * at->cos + dy * at->sin, dy * at->cos - dx * at->sin};
        double inside = 1.0 - at->curvature * seen.beside;
        if (!(at->curvature * seen.beside < FOOTLESS) || fabs(seen.ahead) <= 0.75 * bodies->step * inside)
            break;
        near += whole(floor(seen.ahead / (bodies->step * inside) + 0.5), -last, last);
    }
    return seen;
}

/* Write the tracks of a place's left and right points, with feet on the road's circle of curvature there. */
static void trace_pair(
    const struct hdv_bodies *bodies, const struct hdv_pose *pose, const struct hdv_tracing_point *point,
    int64_t station, struct hdv_track *tracks
) {
    struct plane_point axis = body_point(pose, point->ahead, 0.0);
    struct seen_from seen = nearest_station(bodies, axis.x, axis.y, station + point->start);
    double cosine = seen.station->cos, sine = seen.station->sin, k = seen.station->curvature, half = point->left;
    double askew = half * (cosine * pose->sin - sine * pose->cos),
           along = half * (cosine * pose->cos + sine * pose->sin);
    for (int side = 0; side < 2; side++) {
        double offset = seen.beside + (side == 0 ? along : -along);
        double inside = 1.0 - k * offset;
        double moved = (seen.ahead + (side == 0 ? -askew : askew)) / inside;
        tracks[side].foot = k * offset < FOOTLESS ? (double)seen.number * bodies->step + moved : NAN;
        tracks[side].offset = offset - 0.5 * k * moved * moved * inside;
    }
}

/* Write the tracks of stages 0 <= i < end, which begin at station first, from their poses (N+1, units). */
void trace(
    const struct hdv_bodies *bodies, const struct hdv_pose *poses, int64_t first, int64_t end,
    const struct hdv_tracks *tracks
) {
    int64_t units = bodies->unit_count;
    for (int64_t i = 0; i < end; i++) {
        for (int64_t unit = 0; unit < units; unit++) {
            const struct hdv_tracing_point *points = bodies->points + unit * HDV_TRACING_POINTS;
            struct hdv_track *own = tracks->points + (i * units + unit) * HDV_TRACING_POINTS;
            tracks->poses[i * units + unit] = poses[i * units + unit];
            for (int point = 0; point < HDV_TRACING_POINTS; point += 2)
                trace_pair(bodies, &poses[i * units + unit], &points[point], first + i, &own[point]);
        }
    }
}

/* A straight piece in the (s, offset) plane, outwards positive, and who draws it. */
struct piece {
    double s_from, e_from, s_to, e_to; /* [m] */
    int64_t unit;
};

/* Widen the reach of one side by what a point ahead of its axle draws from station stage - 1 to station stage; or, at a
 * stage, by a straight piece of an edge, whose far end lies so far ahead. */
static void cover_piece(
    const struct hdv_bodies *bodies, struct piece piece, double ahead, int edge, int64_t stage,
    struct hdv_furthest *reached
) {
    double rise = piece.s_to > piece.s_from ? (piece.e_to - piece.e_from) / (piece.s_to - piece.s_from) : NAN;
    int64_t count = bodies->station_count, low = whole(ceil(piece.s_from / bodies->step), 0, count);
    int64_t high = whole(floor(piece.s_to / bodies->step), -1, count - 1);
    for (int64_t m = low; m <= high; m++) {
        double s = (double)m * bodies->step, e = piece.e_from + rise * (s - piece.s_from);
        if (e > reached[m].reach + TIE_M) {
            int64_t nearer = edge || 2.0 * s > piece.s_from + piece.s_to ? stage : stage - 1;
            reached[m] = (struct hdv_furthest){e, rise, edge ? ahead - (piece.s_to - s) : ahead, nearer, piece.unit};
        }
    }
}

/* Widen one side's reach by the edge of a body that turns back: ahead of the axle the edge to which it has turned,
 * behind it the other. */
static void cover_turning(
    const struct hdv_bodies *bodies, const struct hdv_pose *pose, double near, int64_t unit, int left, int side,
    int64_t stage, struct hdv_furthest *reached
) {
    const struct hdv_unit *own = &bodies->units[unit];
    int ahead = left == (side == 0);
    double sign = side == 0 ? 1.0 : -1.0, begin = ahead ? 0.0 : -own->rear_overhang,
           length = ahead ? own->front : own->rear_overhang;
    int pieces = (int)ceil(length / EDGE_M);
    struct piece piece = {NOWHERE_M, NAN, 0.0, 0.0, unit};
    near += begin;
    for (int number = 0; number <= pieces; number++) {
        double u = begin + length * number / (pieces > 1 ? pieces : 1);
        struct plane_point at = body_point(pose, u, sign * own->half_width);
        struct foot foot = project(bodies->curve, at.x, at.y, near, LAST_STEP_M);
        if (isnan(foot.offset))
            return;
        near = piece.s_to = foot.s;
        piece.e_to = sign * foot.offset;
        cover_piece(bodies, piece, u, 1, stage, reached);
        piece.s_from = piece.s_to;
        piece.e_from = piece.e_to;
    }
}

/* Widen what is reached by the tracks of all points up to stage end - 1. */
static void cover_tracks(
    const struct hdv_bodies *bodies, const struct hdv_tracks *tracks, int64_t first, int64_t end,
    struct hdv_furthest *reached
) {
    int64_t count = bodies->unit_count * HDV_TRACING_POINTS;
    for (int64_t i = 1; i < end; i++) {
        for (int64_t point = 0; point < count; point++) {
            const struct hdv_track *before = &tracks->points[(i - 1) * count + point],
                                   *now = &tracks->points[i * count + point];
            int64_t side = point % 2;
            double sign = side == 0 ? 1.0 : -1.0;
            if (now->foot > before->foot) { /* neither NaN, nor a point that swings backwards */
                struct piece piece = {
                    before->foot, sign * before->offset, now->foot, sign * now->offset, point / HDV_TRACING_POINTS
                };
                cover_piece(
                    bodies, piece, bodies->points[point].ahead, 0, first + i, reached + side * bodies->station_count
                );
            }
        }
    }
}

/* Widen reached (2, places) by what is swept up to stage end - 1: each place has the point that reaches furthest. */
void cover(
    const struct hdv_bodies *bodies, const struct hdv_tracks *tracks, int64_t first, int64_t end,
    struct hdv_furthest *reached
) {
    int64_t units = bodies->unit_count;
    cover_tracks(bodies, tracks, first, end, reached);
    for (int64_t unit = 0; unit < units; unit++) {
        double turned = 0.0;
        for (int64_t i = 1; i < end; i++) {
            const struct hdv_pose *pose = &tracks->poses[(i - 1) * units + unit], *ahead = pose + units;
            double former = turned, axle = tracks->points[((i - 1) * units + unit) * HDV_TRACING_POINTS + 2].foot;
            turned = pose->cos * ahead->sin - pose->sin * ahead->cos;
            if (former * turned < 0.0 && fabs(turned - former) > SWING) {
                for (int side = 0; side < 2; side++) {
                    struct hdv_furthest *own = reached + side * bodies->station_count;
                    cover_turning(bodies, pose, axle, unit, former > 0.0, side, first + i - 1, own);
                }
            }
        }
    }
}
