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

#define WINDOW_M 4.0    /* pieces beside the line so far before and beyond a point are looked at */
#define PASSING_M 0.035 /* before or behind a body a kerb's corner comes beside it between two poses of a plan */
#define ROUNDING_M 1e-6 /* of the last station */
#define MORE_M 1e-6     /* than rounding of a distance */
#define IN_FRONT 0.5    /* sine of the angle to a kerb, from which on a place is on its street's side */
#define ALIKE 0.05      /* of cosines: 18 degrees of a straight run */
#define SEEN_M 0.1      /* beyond a kerb: no wall's thickness alone */
#define SAME_M 1e-12    /* from a point to a corner of a kerb: no direction leads from one to the other */

/* The nearest place of a kerb to a corner of a body. */
struct nearest {
    double distance, gap; /* [m]; the gap has a sign */
    double x, y;          /* direction from the kerb into the street, in the plane */
    double part;          /* of the piece, from its beginning */
    int64_t piece;
};

static const struct nearest nothing = {INFINITY, INFINITY, 0.0, 0.0, 0.0, -1};
static const struct hdv_contact none = {INFINITY, 0.0, 0.0, 0.0, 0.0, 0.0, -1};

enum { ALL = -1 };        /* kerbs, of wheels and of bodies */
enum { REMEMBERED = 64 }; /* blocks whose distance is kept: those after them are looked at twice */

/* The part of a body that a kerb bounds: all of it, or its wheels and what lies between. */
struct outline {
    double rear, front, half_width; /* [m] */
    double x[4], y[4];              /* its corners in the plane: rear right, rear left, front right, front left [m] */
    int64_t wheels;                 /* of the pieces that count, or ALL */
};

/* What is looked at: the blocks of pieces beside a body. */
struct search {
    const struct hdv_street *street;
    enum hdv_look look;
    const struct hdv_unit *unit;
    const struct hdv_pose *pose;
    double axle;      /* the line's arclength beside it [m] */
    double low, high; /* pieces of other stretches of line are not beside it [m] */
    double last;      /* arclength beyond which nothing counts [m] */
    const struct hdv_block *blocks;
    int64_t count;
    double reach; /* that what is nearest is among the blocks up to [m] */
};

/* Whether pieces of a stretch of line may hold the place that is nearest to a point at arclength s [m]. */
static int is_beside(double s_low, double s_high, double s) {
    return s_low <= s + WINDOW_M && s_high >= s - WINDOW_M;
}

/* The same of a piece's first point, for a body from one arclength to another. */
static int begins_beside(const struct hdv_piece *piece, double rear, double front) {
    double further = piece->s_high - larger(piece->s_begin, piece->s_end) + WINDOW_M;
    return piece->s_begin - further <= front && piece->s_begin + further >= rear;
}

/* The nearest place of one piece to a point of the plane, which is at arclength s [m]. */
HDV_INLINE void meet(const struct hdv_piece *piece, double x, double y, double s, int64_t number, struct nearest *to) {
    double dx = x - piece->x, dy = y - piece->y, square = dx * dx + dy * dy, most = to->distance + piece->length;
    if (square > most * most || !is_beside(piece->s_low, piece->s_high, s))
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

/* The same for a point that is led back to a kerb's side: before and beyond a piece the way across it counts, too. */
static void meet_aside(const struct hdv_piece *piece, double x, double y, int64_t number, struct nearest *to) {
    double dx = x - piece->x, dy = y - piece->y;
    double along = dx * piece->cos + dy * piece->sin, across = dy * piece->cos - dx * piece->sin;
    if ((along < 0.0 && piece->ends) || (along > piece->length && piece->ends_after) || piece->length == 0.0)
        return;
    double on = clamped(along, 0.0, piece->length), distance = sqrt((along - on) * (along - on) + across * across);
    if (distance < to->distance)
        *to = (struct nearest){distance, across, -piece->sin, piece->cos, on / piece->length, number};
}

/* How far a place, so far from a piece's first corner, is on the street's side of the kerb's run to that corner, or of
 * the one from there, whichever is more [m]. */
static double ahead_of(const struct hdv_piece *piece, double x, double y) {
    return larger(y * piece->from_cos - x * piece->from_sin, y * piece->to_cos - x * piece->to_sin);
}

/* Whether a place so far from a piece's first corner, a protruding one, may lie behind it: the kerb there turns away
 * from what is seen on its street's side. */
static int is_behind(const struct hdv_piece *piece, double x, double y) {
    return ahead_of(piece, x, y) < IN_FRONT * hypot(x, y);
}

/* Whether a kerb that runs so to its corner and on from there faces the way that a body's side is to be led in, about
 * as much as its two runs face each other. On a run that is straight but for jitter, a corner of the body is further
 * beyond it, and a side would be led off as far as the kerb lies oblique to it. */
static int faces(const struct hdv_piece *piece, double x, double y) {
    double alike = piece->from_cos * piece->to_cos + piece->from_sin * piece->to_sin;
    return piece->ends || ahead_of(piece, x, y) > alike - ALIKE;
}

/* The gap between a kerb's corner, u ahead of the axle and v left of the axis, and the side of the outline that faces
 * it, the left one (sign 1) or the right one (-1). */
static double corner_gap(
    const struct search *in, const struct hdv_piece *piece, const struct outline *on, double u, double v, double sign
) {
    double room = sign * v - on->half_width, across = v + sign * on->half_width;
    if (in->look == HDV_TO_PLAN && room < 0.0 && !faces(piece, sign * in->pose->sin, -sign * in->pose->cos))
        return INFINITY;
    if (room < -2.0 * on->half_width) { /* it lies beyond the other side: a plan is led back, if from behind it */
        int behind = is_behind(piece, in->pose->sin * across, -in->pose->cos * across);
        int leads = !(piece->wall && piece->ends); /* the end of a wall leads nowhere */
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
    double sections = HDV_SECTIONS * (ahead + unit->rear_overhang), length = unit->front + unit->rear_overhang;
    int section = 0;
    while (section < HDV_SECTIONS - 1 && sections >= (section + 1) * length)
        section++;
    return section;
}

static double s_at(const struct hdv_piece *piece, double part) {
    return piece->s_begin + clamped(part, 0.0, 1.0) * (piece->s_end - piece->s_begin);
}

/* The first piece, or block, that may reach a place of the line. */
static int64_t first_at(const double *reach, int64_t count, double s) {
    int64_t low = 0, high = count;
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if (reach[middle] < s)
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

static void begin_outline(
    struct outline *on, const struct hdv_pose *pose, double rear, double front, double half_width, int64_t wheels
) {
    on->rear = rear;
    on->front = front;
    on->half_width = half_width;
    on->wheels = wheels;
    for (int corner = 0; corner < 4; corner++) {
        double u = corner_u(on, corner), v = corner_v(on, corner);
        on->x[corner] = pose->x + u * pose->cos - v * pose->sin;
        on->y[corner] = pose->y + u * pose->sin + v * pose->cos;
    }
}

/* The next block, from a number on, that is the first of a kerb that bounds an outline; their count without any. */
static int64_t next_kerb(const struct search *in, const struct outline *on, int64_t from) {
    for (int64_t known = 0; from < in->count; from++) {
        if (on->wheels != ALL && in->blocks[from].wheels != on->wheels)
            continue;
        for (known = 0; known < from && in->blocks[known].kerb != in->blocks[from].kerb; known++)
            continue;
        if (known == from)
            return from;
    }
    return from;
}

/* Whether the kerbs of a side count for a corner: in a plan those on its own side alone do. */
static int counts(const struct search *in, int side, int corner) {
    return in->look == HDV_TO_JUDGE || corner % 2 != side;
}

/* The squares of the distances from a point to the pieces of a block; returns the least. */
static double squares_to(const struct hdv_block *block, double x, double y, double *restrict square) {
    double least[4];
    for (int i = 0; i < HDV_TOGETHER; i++) {
        double dx = x - block->x[i], dy = y - block->y[i];
        double on = smaller(larger(dx * block->cos[i] + dy * block->sin[i], 0.0), block->length[i]);
        double across_x = dx - on * block->cos[i], across_y = dy - on * block->sin[i];
        square[i] = across_x * across_x + across_y * across_y;
    }
    for (int i = 0; i < HDV_TOGETHER; i++)
        least[i % 4] = i < 4 ? square[i] : smaller(least[i % 4], square[i]);
    return smaller(smaller(least[0], least[1]), smaller(least[2], least[3]));
}

/* The nearest place of a block to a point at arclength s, of its pieces within a square of a distance. */
static void meet_block(
    const struct search *in, const struct hdv_block *block, double x, double y, double s, double most,
    struct nearest *found
) {
    double square[HDV_TOGETHER];
    squares_to(block, x, y, square);
    for (int64_t i = 0; i < block->count; i++)
        if (square[i] < most)
            meet(&in->street->pieces[block->numbers[i]], x, y, s, block->numbers[i], found);
}

/* The nearest place of a kerb to a point at arclength s: that of the nearest piece, which alone is looked at closely.
 * Where that has none, for it is not beside the point, or what is nearest lies before it, all are. */
static struct nearest nearest_to(const struct search *in, int64_t kerb, double s, double x, double y) {
    double least[REMEMBERED], square[HDV_TOGETHER], of_all = INFINITY;
    struct nearest found = nothing;
    int64_t count = 0;
    for (; count < in->count && in->blocks[count].s_low <= s + WINDOW_M; count++) {
        const struct hdv_block *block = &in->blocks[count];
        int beside = block->kerb == kerb && block->s_high >= s - WINDOW_M;
        double own = beside ? squares_to(block, x, y, square) : INFINITY;
        of_all = smaller(of_all, own);
        if (count < REMEMBERED)
            least[count] = own;
    }
    for (int all = 0; all < 2 && found.piece < 0 && of_all < in->reach * in->reach; all++) {
        found.distance = all ? in->reach : sqrt(of_all) + MORE_M;
        double most = found.distance * found.distance;
        for (int64_t i = 0; i < count; i++)
            if (in->blocks[i].kerb == kerb && (i >= REMEMBERED || least[i] < most))
                meet_block(in, &in->blocks[i], x, y, s, most, &found);
    }
    return found;
}

/* The same of a corner of an outline. */
static struct nearest nearest_of(const struct search *in, const struct outline *on, int64_t kerb, int corner) {
    return nearest_to(in, kerb, in->axle + corner_u(on, corner), on->x[corner], on->y[corner]);
}

/* The nearest place of a kerb without its walls across the street. */
static struct nearest aside_of(const struct search *in, const struct outline *on, int64_t kerb, int corner) {
    struct nearest found = nothing;
    double s = in->axle + corner_u(on, corner);
    for (int64_t i = 0; i < in->count; i++) {
        const struct hdv_block *block = &in->blocks[i];
        for (int64_t place = 0; place < block->count && block->kerb == kerb; place++) {
            const struct hdv_piece *piece = &in->street->pieces[block->numbers[place]];
            if (is_beside(piece->s_low, piece->s_high, s) && !piece->wall)
                meet_aside(piece, on->x[corner], on->y[corner], block->numbers[place], &found);
        }
    }
    return found;
}

/* The place that counts for a corner: far before a wall across the street none does, for the vehicle is not led along
 * the line; near it, or behind it, that to which it is led back. */
static struct nearest
place_of(const struct search *in, const struct outline *on, int64_t kerb, int corner, const struct nearest *at) {
    if (in->look == HDV_TO_JUDGE || at->piece < 0 || at->part == 0.0 || !in->street->pieces[at->piece].wall)
        return *at;
    return at->gap > in->street->clearance ? nothing : aside_of(in, on, kerb, corner);
}

/* A protruding corner, u ahead of the axle and v left of the axis, that lies beyond the other side of an outline. What
 * is deepest behind it lies as far from the pieces on either side, or is a corner of the outline. */
static void meet_beyond(
    const struct search *in, int64_t number, const struct outline *on, double u, double v, struct hdv_contacts *found
) {
    const struct hdv_piece *piece = &in->street->pieces[number];
    const struct hdv_pose *pose = in->pose;
    double left = piece->left ? on->half_width : -on->half_width;
    double x = piece->sin + piece->before_sin, y = -piece->cos - piece->before_cos; /* away from the street */
    double part = (left - v) / (y * pose->cos - x * pose->sin);
    double ahead = u + part * (x * pose->cos + y * pose->sin);
    if (!(part > 0.0 && ahead >= on->rear && ahead <= on->front))
        return;
    struct nearest at = nearest_to(
        in, piece->kerb, in->axle + ahead, pose->x + ahead * pose->cos - left * pose->sin,
        pose->y + ahead * pose->sin + left * pose->cos
    );
    double s = at.piece < 0 ? INFINITY : s_at(&in->street->pieces[at.piece], at.part);
    if (s < in->last)
        keep(
            &found->at[piece->left ? 0 : 1][section_of(in->unit, ahead)],
            (struct hdv_contact){at.gap, ahead, left, at.x, at.y, s, at.piece}
        );
}

/* A piece's first corner, u ahead of the axle and v left of the axis, against the side of an outline: the gap grows as
 * that side moves away from it. */
static void meet_side(
    const struct search *in, int64_t number, const struct outline *on, double u, double v, struct hdv_contacts *found
) {
    const struct hdv_piece *piece = &in->street->pieces[number];
    if (!(piece->s_high >= in->low && piece->s_low <= in->high && piece->s_begin <= in->last) ||
        !begins_beside(piece, in->axle + on->rear, in->axle + on->front))
        return;
    double sign = piece->left ? 1.0 : -1.0;
    if (in->look == HDV_TO_JUDGE && sign * v < -on->half_width) {
        meet_beyond(in, number, on, u, v, found);
        return;
    }
    double gap = corner_gap(in, piece, on, u, v, sign);
    struct hdv_contact *to = &found->at[piece->left ? 0 : 1][section_of(in->unit, u)];
    int first = gap == to->gap && number < to->piece; /* of equals, in whatever order they come */
    if (gap < to->gap || first) {
        *to = (struct hdv_contact){
            gap, u, sign * on->half_width, sign * in->pose->sin, -sign * in->pose->cos, piece->s_begin, number
        };
    }
}

/* Where the pieces of a block begin, in the axes of a body [m]. */
static void
see_block(const struct hdv_block *block, const struct hdv_pose *pose, double *restrict u, double *restrict v) {
    for (int i = 0; i < HDV_TOGETHER; i++) {
        double x = block->x[i] - pose->x, y = block->y[i] - pose->y;
        u[i] = x * pose->cos + y * pose->sin;
        v[i] = y * pose->cos - x * pose->sin;
    }
}

/* Meet the sides of an outline with all corners of kerbs that are beside it, and nearer than others. */
static void meet_sides(const struct search *in, const struct outline *on, struct hdv_contacts *found) {
    double beyond = in->look == HDV_TO_PLAN ? PASSING_M : 0.0, u[HDV_TOGETHER], v[HDV_TOGETHER];
    double rear = on->rear - beyond, front = on->front + beyond;
    for (int64_t i = 0; i < in->count; i++) {
        const struct hdv_block *block = &in->blocks[i];
        if (block->corners == 0 || block->wheels != on->wheels)
            continue;
        const struct hdv_contact *side = found->at[block->left ? 0 : 1];
        double sign = block->left ? 1.0 : -1.0;
        see_block(block, in->pose, u, v);
        for (int64_t place = 0; place < block->count; place++) {
            if (!(block->corners >> place & 1) || u[place] < rear || u[place] > front)
                continue;
            double room = sign * v[place] - on->half_width; /* no gap is less */
            if (!(room > side[section_of(in->unit, u[place])].gap))
                meet_side(in, block->numbers[place], on, u[place], v[place], found);
        }
    }
}

/* The contact of a corner at its nearest place; none where that does not lie before the last arclength that counts. */
static struct hdv_contact corner_contact(
    const struct search *in, const struct outline *on, int64_t kerb, int corner, const struct nearest *nearest
) {
    struct nearest at = place_of(in, on, kerb, corner, nearest);
    if (at.piece < 0)
        return none;
    double s = s_at(&in->street->pieces[at.piece], at.part);
    if (!(s < in->last))
        return none;
    return (struct hdv_contact){at.gap, corner_u(on, corner), corner_v(on, corner), at.x, at.y, s, at.piece};
}

/* Take over what an outline's corners meet. */
static void take_corners(const struct search *in, const struct outline *on, struct hdv_contacts *found) {
    for (int64_t first = next_kerb(in, on, 0); first < in->count; first = next_kerb(in, on, first + 1)) {
        int64_t kerb = in->blocks[first].kerb;
        int side = in->blocks[first].left ? 0 : 1;
        double *near = &found->near[side];
        for (int corner = 0; corner < 4; corner++) {
            if (!counts(in, side, corner))
                continue;
            struct nearest at = nearest_of(in, on, kerb, corner);
            struct hdv_contact *to = &found->at[side][section_of(in->unit, corner_u(on, corner))];
            keep(to, corner_contact(in, on, kerb, corner, &at));
            *near = smaller(*near, smaller(to->gap, at.gap));
        }
    }
}

/* The same of the corners of overhangs with the kerbs that wheels must keep: each with those on its own side. */
static void take_overhangs(const struct search *in, const struct outline *on, struct hdv_contacts *found) {
    for (int64_t first = next_kerb(in, on, 0); first < in->count; first = next_kerb(in, on, first + 1)) {
        int64_t kerb = in->blocks[first].kerb;
        int side = in->blocks[first].left ? 0 : 1;
        for (int end = 0; end < 2; end++) {
            int corner = 2 * end + (side == 0);
            struct nearest at = nearest_of(in, on, kerb, corner);
            keep(&found->overhang[side][end], corner_contact(in, on, kerb, corner, &at));
        }
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

/* The stretch of line beside a body whose axle is so far behind the lead rear one, which is at arclength s [m]. */
static struct stretch_of_line line_beside(const struct hdv_unit *unit, double s, double behind) {
    double axle = s - behind;
    return (struct stretch_of_line){axle - unit->rear_overhang - WINDOW_M, axle + unit->front + WINDOW_M};
}

/* Look among the blocks of a stretch of line. */
static void range_over(struct search *in, struct stretch_of_line line) {
    const struct hdv_street *street = in->street;
    int64_t first = first_at(street->block_reach, street->block_count, line.low), beyond = first;
    in->low = line.low;
    in->high = line.high;
    while (beyond < street->block_count && street->blocks[beyond].s_low <= line.high)
        beyond++;
    in->blocks = &street->blocks[first];
    in->count = beyond - first;
    in->reach = INFINITY;
}

/* A piece in the axes of a body: where it begins, and how it leads on from there [m]. */
struct seen {
    double u, v, du, dv;
};

static struct seen seen_from(const struct hdv_pose *pose, const struct hdv_piece *piece) {
    double x = piece->x - pose->x, y = piece->y - pose->y;
    return (struct seen){
        x * pose->cos + y * pose->sin,
        y * pose->cos - x * pose->sin,
        piece->length * (piece->cos * pose->cos + piece->sin * pose->sin),
        piece->length * (piece->sin * pose->cos - piece->cos * pose->sin),
    };
}

/* Whether a piece lies in a box beside a stretch of line, as far as its ends tell. */
static int is_in(const struct hdv_piece *piece, const struct box_beside *in) {
    if (piece->s_high < in->line.low || piece->s_low > in->line.high)
        return 0;
    const struct seen at = seen_from(in->pose, piece);
    double to_u = at.u + at.du, to_v = at.v + at.dv;
    return !(
        larger(at.u, to_u) < in->rear || smaller(at.u, to_u) > in->front || larger(at.v, to_v) < -in->side ||
        smaller(at.v, to_v) > in->side
    );
}

/* The part within an outline of a piece whose own box meets that, as shares of it; 0 where there is none. */
static int clipped(const struct outline *on, const struct seen *piece, double share[2]) {
    const double at[2] = {piece->u, piece->v}, by[2] = {piece->du, piece->dv};
    const double low[2] = {on->rear, -on->half_width}, high[2] = {on->front, on->half_width};
    share[0] = 0.0;
    share[1] = 1.0;
    for (int axis = 0; axis < 2; axis++) {
        if (by[axis] == 0.0)
            continue;
        double one = (low[axis] - at[axis]) / by[axis], other = (high[axis] - at[axis]) / by[axis];
        share[0] = larger(share[0], smaller(one, other));
        share[1] = smaller(share[1], larger(one, other));
    }
    return share[0] < share[1];
}

/* How far a place is within an outline: from the side that faces the kerb, and from both ends. */
static double within(const struct outline *on, double u, double aside) {
    return smaller(aside, smaller(u - on->rear, on->front - u));
}

/* A piece against an outline that it may lie in: what is furthest within counts, be it of a wall of no width. Along a
 * piece the ways to a side and to the ends are linear: the least is largest where the part within begins or ends, or
 * where two of them are equal. */
static void meet_piece(const struct search *in, int64_t number, const struct outline *on, struct hdv_contacts *found) {
    const struct hdv_piece *piece = &in->street->pieces[number];
    const struct seen at = seen_from(in->pose, piece);
    double share[2], sign = piece->left ? 1.0 : -1.0, aside = on->half_width - sign * at.v, by = -sign * at.dv;
    if (!clipped(on, &at, share))
        return;
    const double equal[] = {
        0.0,
        1.0,
        (at.u - on->rear - aside) / (by - at.du),
        (on->front - at.u - aside) / (by + at.du),
        (0.5 * (on->front + on->rear) - at.u) / at.du,
    };
    double deepest = 0.0, part = share[0];
    for (int i = 0; i < 5; i++) {
        double here = clamped(equal[i], share[0], share[1]), depth = within(on, at.u + here * at.du, aside + here * by);
        if (depth > deepest) {
            deepest = depth;
            part = here;
        }
    }
    double ahead = at.u + part * at.du, s = s_at(piece, part);
    if (s < in->last)
        keep(
            &found->at[piece->left ? 0 : 1][section_of(in->unit, ahead)],
            (struct hdv_contact){
                -deepest, ahead, sign * on->half_width, sign * in->pose->sin, -sign * in->pose->cos, s, number
            }
        );
}

/* Meet an outline with all pieces that lie in it, beside a side where its own corners and the kerbs' have not seen that
 * it lacks much: to them a wall is as deep as half its thickness. */
static void
meet_pieces(const struct search *in, const struct outline *on, const double seen[2], struct hdv_contacts *found) {
    const struct box_beside box = {in->pose, on->rear, on->front, on->half_width, {in->low, in->high}};
    for (int64_t i = 0; i < in->count; i++) {
        const struct hdv_block *block = &in->blocks[i];
        if (block->wheels != on->wheels || seen[block->left ? 0 : 1] < -SEEN_M)
            continue;
        for (int64_t place = 0; place < block->count; place++)
            if (is_in(&in->street->pieces[block->numbers[place]], &box))
                meet_piece(in, block->numbers[place], on, found);
    }
}

/* The first piece, from a number on, that lies in a box beside a stretch of line; -1 where there is none. */
int64_t next_in(const struct hdv_street *street, const struct box_beside *in, int64_t from) {
    int64_t first = first_at(street->reach, street->count, in->line.low), number = from > first ? from : first;
    for (; number < street->count && street->pieces[number].s_low <= in->line.high; number++)
        if (is_in(&street->pieces[number], in))
            return number;
    return -1;
}

/* What is within ``reach`` [m] of a body, beside whose axle the line is at s - behind [m]. */
struct box_beside
box_around(const struct hdv_unit *unit, const struct hdv_pose *pose, double s, double behind, double reach) {
    return (struct box_beside){
        pose, -unit->rear_overhang - reach, unit->front + reach, unit->half_width + reach, line_beside(unit, s, behind),
    };
}

/* Add a place of another block to a block, and to all places after it. */
static void add_place(struct hdv_block *to, const struct hdv_block *block, int64_t place) {
    to->corners |= (block->corners >> place & 1) << to->count;
    for (int64_t i = to->count++; i < HDV_TOGETHER; i++) {
        to->x[i] = block->x[place];
        to->y[i] = block->y[place];
        to->cos[i] = block->cos[place];
        to->sin[i] = block->sin[place];
        to->length[i] = block->length[place];
        to->numbers[i] = block->numbers[place];
    }
}

/* List the pieces beside a body that are nearer to it than ``reach`` [m]; there may be too many. */
void pieces_near(
    const struct hdv_street *street, const struct hdv_unit *unit, const struct hdv_pose *pose, double s, double behind,
    double reach, struct hdv_near *found
) {
    struct box_beside box = box_around(unit, pose, s, behind, reach);
    struct search in = {.street = street};
    int64_t listed = 0;
    found->count = 0;
    found->reach = reach;
    range_over(&in, box.line);
    for (const struct hdv_block *block = in.blocks; block < in.blocks + in.count; block++) {
        struct hdv_block *to = &found->blocks[found->count];
        for (int64_t place = 0; place < block->count; place++) {
            if (!is_in(&street->pieces[block->numbers[place]], &box))
                continue;
            if (listed++ == HDV_SOME) {
                found->count = -1;
                return;
            }
            if (to == &found->blocks[found->count]) {
                found->count++;
                *to = *block;
                to->count = to->corners = 0;
            }
            add_place(to, block, place);
        }
    }
}

/* Write the tightest contacts of a body whose axle is ``behind`` [m] the lead rear one, on a straight, at s [m],
 * with some pieces, or all (NULL). */
void look_at_body(
    const struct hdv_street *street, const struct hdv_near *among, enum hdv_look look, const struct hdv_unit *unit,
    const struct hdv_pose *pose, double s, double behind, struct hdv_contacts *found
) {
    struct search in = {.street = street, .look = look, .unit = unit, .pose = pose, .axle = s - behind};
    in.last = s > street->end + ROUNDING_M ? street->end : INFINITY;
    if (among) {
        in.low = line_beside(unit, s, behind).low;
        in.high = INFINITY;
        in.blocks = among->blocks;
        in.count = among->count;
        in.reach = among->reach;
    } else {
        range_over(&in, line_beside(unit, s, behind));
    }
    struct outline body, wheels_of, overhangs;
    begin_outline(&body, pose, -unit->rear_overhang, unit->front, unit->half_width, 0);
    begin_outline(&overhangs, pose, -unit->rear_overhang, unit->front, unit->half_width, 1);
    begin_outline(&wheels_of, pose, 0.0, smaller(unit->wheelbase, unit->front), unit->half_width, 1);
    begin_contacts(found);
    meet_sides(&in, &body, found);
    meet_sides(&in, &wheels_of, found);
    take_corners(&in, &body, found);
    take_corners(&in, &wheels_of, found);
    take_overhangs(&in, &overhangs, found);
    if (look == HDV_TO_JUDGE) {
        const double seen[2] = {
            smaller(found->at[0][0].gap, found->at[0][1].gap), smaller(found->at[1][0].gap, found->at[1][1].gap)
        };
        meet_pieces(&in, &body, seen, found);
        meet_pieces(&in, &wheels_of, seen, found);
    }
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
    struct search in = {.street = street, .axle = s};
    range_over(&in, (struct stretch_of_line){s - WINDOW_M, s + WINDOW_M});
    rooms[0] = rooms[1] = INFINITY;
    for (int64_t first = next_kerb(&in, point, 0); first < in.count; first = next_kerb(&in, point, first + 1)) {
        double *room = &rooms[in.blocks[first].left ? 0 : 1];
        *room = smaller(*room, nearest_of(&in, point, in.blocks[first].kerb, 0).gap);
    }
}

/* Write the signed distance of points x, y of the line at arclengths s (points,) to the left and the right kerbs,
 * (points, 2) [m]; infinite without any. */
HDV_EXPORT void hdv_rooms(
    const struct hdv_street *street, int64_t points, const double *s, const double *x, const double *y, double *rooms
) {
    for (int64_t i = 0; i < points; i++) {
        const struct hdv_pose at = {.x = x[i], .y = y[i], .cos = 1.0};
        struct outline point;
        begin_outline(&point, &at, 0.0, 0.0, 0.0, ALL);
        rooms_at(street, &point, s[i], &rooms[2 * i]);
    }
}
