/* How near a body is to the street's kerbs: body corners against pieces of kerb, and corners of kerbs against body
 * sides. Between the two nothing of a rectangle and a polygon line can be nearer.
 *
 * A kerb's pieces belong to a stretch of the line: where a road crosses itself, its other arm is no neighbour.
 */
#include "street.h"

#include <math.h>
#include <stddef.h>

#include "kinematics.h"
#include "numbers.h"

#define WINDOW_M 4.0 /* pieces beside the line so far before and beyond a point are looked at */
#define PASSING_M                                                                                                      \
    0.035 /* a kerb's corner so far before a body, or behind it, comes beside it between two poses of a plan */
#define ROUNDING_M 1e-6 /* of the last station */
#define IN_FRONT                                                                                                       \
    0.5 /* sine of the angle to a kerb from which on a place is on its street's side, however a body stands there */
#define SAME_M 1e-12 /* from a point to a corner of a kerb: no direction leads from one to the other */

/* The nearest place of a kerb to a corner of a body. */
struct nearest {
    double distance, gap; /* [m]; the gap has a sign */
    double x, y;          /* direction from the kerb into the street, in the plane */
    double part;          /* of the piece, from its beginning */
    int64_t piece;
};

static const struct nearest nothing = {INFINITY, INFINITY, 0.0, 0.0, 0.0, -1};
static const struct hdv_contact none = {INFINITY, 0.0, 0.0, 0.0, 0.0, 0.0, -1};

enum { MOST_KERBS = 8 }; /* that are looked at together: of more near a body, those of the least numbers first */

/* What a kerb is to the corners of an outline: rear right, rear left, front right, front left. */
struct beside {
    int64_t kerb;
    int side;                  /* 0: a left kerb, 1: a right one */
    struct nearest corners[4]; /* its nearest places */
};

/* The part of a body that a kerb bounds: all of it, or its wheels and what lies between. */
struct outline {
    double rear, front, half_width; /* [m] */
    double x[4], y[4];              /* its corners in the plane [m] */
    int64_t from;                   /* kerbs of lesser numbers were looked at before */
    int more;                       /* 1: there are others */
    int kerbs;
    struct beside beside[MOST_KERBS];
};

/* What is looked at: the pieces beside a body. */
struct search {
    const struct hdv_street *street;
    enum hdv_look look;
    const struct hdv_unit *unit;
    const struct hdv_pose *pose;
    double axle;            /* the line's arclength beside it [m] */
    double low;             /* pieces that end before this arclength are not beside it [m] */
    double last;            /* arclength beyond which nothing counts [m] */
    const int64_t *numbers; /* of the pieces, or NULL: all from the first to the one before ``beyond`` */
    int64_t first, beyond;
};

/* The nearest place of one piece to a point of the plane. */
static void meet(const struct hdv_piece *piece, double x, double y, int64_t number, struct nearest *to) {
    double dx = x - piece->x, dy = y - piece->y, square = dx * dx + dy * dy, most = to->distance + piece->length;
    if (square > most * most)
        return;
    double along = dx * piece->cos + dy * piece->sin, across = dy * piece->cos - dx * piece->sin;
    if (along < 0.0 || piece->length == 0.0) { /* its beginning, unless the piece before is nearer */
        int nearer = piece->ends || dx * piece->before_cos + dy * piece->before_sin >= 0.0;
        if (nearer && square < to->distance * to->distance && square > SAME_M * SAME_M) {
            double normal_x = -piece->sin - piece->before_sin, normal_y = piece->cos + piece->before_cos;
            double sign = !piece->ends && dx * normal_x + dy * normal_y < 0.0 ? -1.0 : 1.0, distance = sqrt(square);
            double scale = sign / distance;
            *to = (struct nearest){distance, sign * distance, scale * dx, scale * dy, 0.0, number};
        }
    } else if (along <= piece->length && fabs(across) < to->distance) {
        *to = (struct nearest){fabs(across), across, -piece->sin, piece->cos, along / piece->length, number};
    }
}

/* The same for a point that is led back to a kerb's own side: before and beyond a piece, too, the way across it counts.
 */
static void meet_aside(const struct hdv_piece *piece, double x, double y, int64_t number, struct nearest *to) {
    double dx = x - piece->x, dy = y - piece->y;
    double along = dx * piece->cos + dy * piece->sin, across = dy * piece->cos - dx * piece->sin;
    if ((along < 0.0 && piece->ends) || (along > piece->length && piece->ends_after) || piece->length == 0.0)
        return;
    double on = clamped(along, 0.0, piece->length), distance = sqrt((along - on) * (along - on) + across * across);
    if (distance < to->distance)
        *to = (struct nearest){distance, across, -piece->sin, piece->cos, on / piece->length, number};
}

/* Whether a place so far from a piece's first corner, a protruding one, may lie behind it: the kerb there turns away
 * from what is seen on its street's side. */
static int is_behind(const struct hdv_piece *piece, double x, double y) {
    double before = y * piece->before_cos - x * piece->before_sin, after = y * piece->cos - x * piece->sin;
    return larger(before, after) < IN_FRONT * hypot(x, y);
}

/* The gap between a kerb's corner, u ahead of the axle and v left of the axis, and the side of the outline that faces
 * it, the left one (sign 1) or the right one (-1). */
static double corner_gap(
    const struct search *in, const struct hdv_piece *piece, const struct outline *on, double u, double v, double sign
) {
    double room = sign * v - on->half_width, across = v + sign * on->half_width;
    if (room < -2.0 * on->half_width) { /* it lies beyond the other side: a plan is led back, if from behind it */
        int behind = is_behind(piece, in->pose->sin * across, -in->pose->cos * across);
        int leads = in->look == HDV_TO_PLAN && !(piece->wall && piece->ends); /* the end of a wall leads nowhere */
        return leads && behind ? room : INFINITY;
    }
    if (in->look == HDV_TO_PLAN || room >= 0.0)
        return room;
    return larger(room, larger(on->rear - u, u - on->front));
}

/* Keep the tighter of two contacts. */
static void keep(struct hdv_contact *to, struct hdv_contact contact) {
    if (contact.gap < to->gap)
        *to = contact;
}

static int section_of(const struct hdv_unit *unit, double ahead) {
    double part = (ahead + unit->rear_overhang) / (unit->front + unit->rear_overhang);
    return (int)whole(part * HDV_SECTIONS, 0, HDV_SECTIONS - 1);
}

static double s_at(const struct hdv_piece *piece, double part) {
    return piece->s_begin + clamped(part, 0.0, 1.0) * (piece->s_end - piece->s_begin);
}

/* The first piece that may reach a place of the line. */
static int64_t first_at(const struct hdv_street *street, double s) {
    int64_t low = 0, high = street->count;
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if (street->reach[middle] < s)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* A corner of an outline: rear or front, right or left. */
static double corner_u(const struct outline *on, int corner) {
    return corner < 2 ? on->rear : on->front;
}

static double corner_v(const struct outline *on, int corner) {
    return corner % 2 ? on->half_width : -on->half_width;
}

static void
begin_outline(struct outline *on, const struct hdv_pose *pose, double rear, double front, double half_width) {
    on->rear = rear;
    on->front = front;
    on->half_width = half_width;
    on->from = 0;
    on->more = 0;
    on->kerbs = 0;
    for (int corner = 0; corner < 4; corner++) {
        double u = corner_u(on, corner), v = corner_v(on, corner);
        on->x[corner] = pose->x + u * pose->cos - v * pose->sin;
        on->y[corner] = pose->y + u * pose->sin + v * pose->cos;
    }
}

/* The place of the kerb with the greatest number. */
static struct beside *last_kerb(struct outline *on) {
    struct beside *last = on->beside;
    for (int number = 1; number < on->kerbs; number++)
        last = on->beside[number].kerb > last->kerb ? &on->beside[number] : last;
    return last;
}

/* What is known of a piece's kerb; NULL of one that was looked at before, or comes later. */
static struct beside *beside_kerb(struct outline *on, const struct hdv_piece *piece) {
    for (int number = on->kerbs - 1; number >= 0; number--)
        if (on->beside[number].kerb == piece->kerb)
            return &on->beside[number];
    if (piece->kerb < on->from)
        return NULL;
    struct beside *to = &on->beside[on->kerbs];
    if (on->kerbs < MOST_KERBS) {
        on->kerbs++;
    } else { /* the kerb with the greatest number comes later, with all of its pieces */
        to = last_kerb(on);
        on->more = 1;
        if (to->kerb < piece->kerb)
            return NULL;
    }
    to->kerb = piece->kerb;
    to->side = piece->left ? 0 : 1;
    for (int corner = 0; corner < 4; corner++)
        to->corners[corner] = nothing;
    return to;
}

/* Go on to the kerbs that an outline had no place for; 0 where there are none. */
static int next_kerbs(struct outline *on) {
    int more = on->more;
    if (on->kerbs > 0)
        on->from = last_kerb(on)->kerb + 1;
    on->more = 0;
    on->kerbs = 0;
    return more;
}

/* Whether a piece may hold the place that is nearest to a point at arclength s [m]. */
static int is_beside(const struct hdv_piece *piece, double s) {
    return piece->s_low <= s + WINDOW_M && piece->s_high >= s - WINDOW_M;
}

/* The same of a piece's first point, for a body from one arclength to another. */
static int begins_beside(const struct hdv_piece *piece, double rear, double front) {
    double further = piece->s_high - larger(piece->s_begin, piece->s_end) + WINDOW_M;
    return piece->s_begin - further <= front && piece->s_begin + further >= rear;
}

/* The nearest places of one piece to the corners of an outline at one end, in a plan to that on the kerb's own side. */
static void meet_end(const struct hdv_piece *piece, enum hdv_look look, int64_t number, int end, struct outline *on) {
    struct beside *beside = beside_kerb(on, piece);
    for (int corner = 2 * end; beside != NULL && corner < 2 * end + 2; corner++)
        if (look == HDV_TO_JUDGE || corner % 2 != beside->side)
            meet(piece, on->x[corner], on->y[corner], number, &beside->corners[corner]);
}

/* The nearest place of a kerb without its walls across the street. */
static struct nearest aside_of(const struct search *in, const struct outline *on, int64_t kerb, int corner) {
    struct nearest found = nothing;
    for (int64_t i = in->first; i < in->beyond; i++) {
        int64_t number = in->numbers ? in->numbers[i] : i;
        const struct hdv_piece *piece = &in->street->pieces[number];
        if (piece->kerb == kerb && is_beside(piece, in->axle + corner_u(on, corner)) && !piece->wall)
            meet_aside(piece, on->x[corner], on->y[corner], number, &found);
    }
    return found;
}

/* The place that counts for a corner: far before a wall across the street none does, for the vehicle is not led along
 * the line; near it, or behind it, that to which it is led back. */
static struct nearest
place_of(const struct search *in, const struct outline *on, const struct beside *beside, int corner) {
    const struct nearest *at = &beside->corners[corner];
    if (in->look == HDV_TO_JUDGE || at->piece < 0 || at->part == 0.0 || !in->street->pieces[at->piece].wall)
        return *at;
    return at->gap > in->street->clearance ? nothing : aside_of(in, on, beside->kerb, corner);
}

/* A piece's first corner against the side of an outline: the gap grows as that side moves away from it. */
static void meet_side(
    const struct search *in, const struct hdv_piece *piece, int64_t number, const struct outline *on,
    struct hdv_contacts *found
) {
    const struct hdv_pose *pose = in->pose;
    double x = piece->x - pose->x, y = piece->y - pose->y, u = x * pose->cos + y * pose->sin;
    double beyond = in->look == HDV_TO_PLAN ? PASSING_M : 0.0;
    if (u < on->rear - beyond || u > on->front + beyond)
        return;
    double sign = piece->left ? 1.0 : -1.0, gap = corner_gap(in, piece, on, u, y * pose->cos - x * pose->sin, sign);
    struct hdv_contact *to = &found->at[piece->left ? 0 : 1][section_of(in->unit, u)];
    if (gap < to->gap) {
        double v = sign * on->half_width;
        *to = (struct hdv_contact){gap, u, v, sign * pose->sin, -sign * pose->cos, piece->s_begin, number};
    }
}

/* The contact of a corner at its nearest place; none where that does not lie before the last arclength that counts. */
static struct hdv_contact
corner_contact(const struct search *in, const struct outline *on, const struct beside *beside, int corner) {
    struct nearest at = place_of(in, on, beside, corner);
    if (at.piece < 0)
        return none;
    double s = s_at(&in->street->pieces[at.piece], at.part);
    if (!(s < in->last))
        return none;
    return (struct hdv_contact){at.gap, corner_u(on, corner), corner_v(on, corner), at.x, at.y, s, at.piece};
}

/* Take over what an outline's corners have met. */
static void take_corners(const struct search *in, const struct outline *on, struct hdv_contacts *found) {
    for (int number = 0; number < on->kerbs; number++) {
        const struct beside *beside = &on->beside[number];
        double *near = &found->near[beside->side];
        for (int corner = 0; corner < 4; corner++) {
            struct hdv_contact *to = &found->at[beside->side][section_of(in->unit, corner_u(on, corner))];
            keep(to, corner_contact(in, on, beside, corner));
            *near = smaller(*near, smaller(to->gap, beside->corners[corner].gap));
        }
    }
}

/* The same of the corners of overhangs with the kerbs that wheels must keep: each with those on its own side. */
static void take_overhangs(const struct search *in, const struct outline *on, struct hdv_contacts *found) {
    for (int number = 0; number < on->kerbs; number++) {
        const struct beside *beside = &on->beside[number];
        for (int end = 0; end < 2; end++)
            keep(&found->overhang[beside->side][end], corner_contact(in, on, beside, 2 * end + (beside->side == 0)));
    }
}

static void begin_contacts(struct hdv_contacts *found) {
    for (int side = 0; side < 2; side++) {
        for (int section = 0; section < HDV_SECTIONS; section++)
            found->at[side][section] = none;
        found->overhang[side][0] = found->overhang[side][1] = none;
        found->near[side] = INFINITY;
    }
}

/* The first piece after those that may be beside arclengths up to ``high``. */
static int64_t first_beyond(const struct hdv_street *street, int64_t from, double high) {
    int64_t low = from, beyond = street->count;
    while (low < beyond) {
        int64_t middle = low + (beyond - low) / 2;
        if (street->pieces[middle].s_low <= high)
            low = middle + 1;
        else
            beyond = middle;
    }
    return low;
}

/* The stretch of line beside which pieces are looked at for a body whose axle is so far behind the lead rear axle,
 * which is at arclength s [m]. */
struct stretch_of_line line_beside(const struct hdv_unit *unit, double s, double behind) {
    double axle = s - behind;
    return (struct stretch_of_line){axle - unit->rear_overhang - WINDOW_M, axle + unit->front + WINDOW_M};
}

/* The pieces that may be beside a body whose axle is so far behind the lead rear axle, which is at arclength s [m]. */
static void range_beside(struct search *in, double s, double behind) {
    const struct hdv_unit *unit = in->unit;
    in->axle = s - behind;
    in->last = s > in->street->end + ROUNDING_M ? in->street->end : INFINITY;
    in->numbers = NULL;
    struct stretch_of_line beside = line_beside(unit, s, behind);
    in->low = beside.low;
    in->first = first_at(in->street, in->low);
    in->beyond = first_beyond(in->street, in->first, beside.high);
}

/* List the pieces of a box beside a stretch of line, from a number on; return the number from which on there may be
 * more, or -1. */
int64_t
pieces_from(int64_t from, const struct hdv_street *street, const struct box_beside *in, struct some_pieces *found) {
    const struct hdv_pose *pose = in->pose;
    int64_t first = first_at(street, in->line.low), beyond = first_beyond(street, first, in->line.high);
    found->count = 0;
    for (int64_t number = from > first ? from : first; number < beyond; number++) {
        const struct hdv_piece *piece = &street->pieces[number];
        if (piece->s_high < in->line.low)
            continue;
        double x = piece->x - pose->x, y = piece->y - pose->y;
        double u = x * pose->cos + y * pose->sin, v = y * pose->cos - x * pose->sin;
        double to_u = u + piece->length * (piece->cos * pose->cos + piece->sin * pose->sin);
        double to_v = v + piece->length * (piece->sin * pose->cos - piece->cos * pose->sin);
        if (larger(u, to_u) < in->rear || smaller(u, to_u) > in->front || larger(v, to_v) < -in->side ||
            smaller(v, to_v) > in->side)
            continue;
        if (found->count == HDV_SOME)
            return number;
        found->numbers[found->count++] = number;
    }
    return -1;
}

/* List the pieces beside a body that are nearer to it than ``reach`` [m]; there may be too many. */
void pieces_near(
    const struct hdv_street *street, const struct hdv_unit *unit, const struct hdv_pose *pose, double s, double behind,
    double reach, struct some_pieces *found
) {
    struct box_beside in = {
        pose, -unit->rear_overhang - reach, unit->front + reach, unit->half_width + reach, line_beside(unit, s, behind),
    };
    if (pieces_from(0, street, &in, found) >= 0)
        found->count = -1;
}

/* Write the tightest contacts of a body whose axle is so far behind the lead rear axle, on a straight, which is at
 * arclength s [m], with some pieces, or all (NULL). */
void look_at_body(
    const struct hdv_street *street, const struct some_pieces *among, enum hdv_look look, const struct hdv_unit *unit,
    const struct hdv_pose *pose, double s, double behind, struct hdv_contacts *found
) {
    struct search in = {.street = street, .look = look, .unit = unit, .pose = pose};
    range_beside(&in, s, behind);
    if (among) {
        in.numbers = among->numbers;
        in.first = 0;
        in.beyond = among->count;
    }
    struct outline body, wheels_of, overhangs;
    begin_outline(&body, pose, -unit->rear_overhang, unit->front, unit->half_width);
    begin_outline(&overhangs, pose, -unit->rear_overhang, unit->front, unit->half_width);
    begin_outline(&wheels_of, pose, 0.0, smaller(unit->wheelbase, unit->front), unit->half_width);
    begin_contacts(found);
    int more;
    do {
        for (int64_t i = in.first; i < in.beyond; i++) {
            int64_t number = in.numbers ? in.numbers[i] : i;
            const struct hdv_piece *piece = &street->pieces[number];
            if (piece->s_high < in.low)
                continue;
            struct outline *on = piece->wheels ? &wheels_of : &body;
            if (piece->corner && piece->s_begin <= in.last &&
                begins_beside(piece, in.axle + on->rear, in.axle + on->front))
                meet_side(&in, piece, number, on, found);
            for (int end = 0; end < 2; end++) {
                if (is_beside(piece, in.axle + (end ? on->front : on->rear)))
                    meet_end(piece, look, number, end, on);
                if (piece->wheels && is_beside(piece, in.axle + (end ? body.front : body.rear)))
                    meet_end(piece, look, number, end, &overhangs);
            }
        }
        take_corners(&in, &body, found);
        take_corners(&in, &wheels_of, found);
        take_overhangs(&in, &overhangs, found);
        more = next_kerbs(&body) + next_kerbs(&wheels_of) + next_kerbs(&overhangs);
    } while (more > 0);
}

/* Write the contacts of all bodies of a vehicle, (poses, count), whose lead rear axle is at arclengths s (poses,). */
HDV_EXPORT void hdv_look_many(
    const struct hdv_street *street, int64_t look, const struct hdv_unit *units, int64_t count, int64_t poses,
    const double *behind, const double *s, const struct hdv_pose *placed, struct hdv_contacts *found
) {
    for (int64_t i = 0; i < poses; i++) {
        for (int64_t unit = 0; unit < count; unit++) {
            int64_t at = i * count + unit;
            look_at_body(street, NULL, (enum hdv_look)look, &units[unit], &placed[at], s[i], behind[unit], &found[at]);
        }
    }
}

/* Write the signed distance of a point, at an arclength of the line, to the left and the right kerbs. */
static void rooms_at(const struct hdv_street *street, struct outline *point, double s, double *rooms) {
    int64_t first = first_at(street, s - WINDOW_M), beyond = first_beyond(street, first, s + WINDOW_M);
    rooms[0] = rooms[1] = INFINITY;
    do {
        for (int64_t number = first; number < beyond; number++) {
            const struct hdv_piece *piece = &street->pieces[number];
            struct beside *beside = piece->s_high < s - WINDOW_M ? NULL : beside_kerb(point, piece);
            if (beside != NULL)
                meet(piece, point->x[0], point->y[0], number, &beside->corners[0]);
        }
        for (int number = 0; number < point->kerbs; number++) {
            double *room = &rooms[point->beside[number].side];
            *room = smaller(*room, point->beside[number].corners[0].gap);
        }
    } while (next_kerbs(point));
}

/* Write the signed distance of points x, y of the line at arclengths s (points,) to the left and the right kerbs,
 * (points, 2) [m]; infinite without any. */
HDV_EXPORT void hdv_rooms(
    const struct hdv_street *street, int64_t points, const double *s, const double *x, const double *y, double *rooms
) {
    for (int64_t i = 0; i < points; i++) {
        const struct hdv_pose at = {.x = x[i], .y = y[i], .cos = 1.0};
        struct outline point;
        begin_outline(&point, &at, 0.0, 0.0, 0.0);
        rooms_at(street, &point, s[i], &rooms[2 * i]);
    }
}
