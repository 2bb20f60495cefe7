/* The worst that a driver's errors can do to a plan at one place: backwards from there the adjoint, which says how much
 * the error of every metre before counts; over its nodes a dynamic programme for the error that counts most; and what
 * the first order leaves out, by how far units stray at most (stray.c).
 */
#include "tracking.h"

#include <math.h>
#include <stddef.h>

#include "numbers.h"

static const int64_t FURTHEST = 20000; /* intervals back at most */
static const int64_t LOOK = 8;         /* intervals back after which it is looked whether a gap can still be closed */

/* The adjoint at one place: what an error of each kind counts for at the brush. */
struct adjoint {
    double axle[HDV_MOST_UNITS];    /* of the axle's offset */
    double heading[HDV_MOST_UNITS]; /* of the heading, as it stands [m/rad] */
    double offset[HDV_MOST_UNITS];  /* of the coupling's offset */
    double course;                  /* of the direction of the driver's error [m] */
};

/* Links and strays between two intervals. */
struct between {
    const struct hdv_link *first, *last;
    double part;
};

static struct between between_at(const struct hdv_tracked *on, double place) {
    double low = floor(place);
    int64_t interval = whole(low, -1, on->intervals);
    return (struct between){link_at(on, interval, 0), link_at(on, interval + 1, 0), place - low};
}

#define MIXED(field) .field = first->field + part * (last->field - first->field)

/* Write the links (count,) between two intervals, as far as the adjoint looks at them. */
HDV_INLINE void mix(int64_t count, struct between at, struct hdv_link *links) {
    double part = at.part;
    for (int64_t i = 0; i < count; i++) {
        const struct hdv_link *first = at.first + i, *last = at.last + i;
        links[i] = (struct hdv_link){
            MIXED(axle_speed),      MIXED(by_offset),     MIXED(by_axle),        MIXED(next_by_axle),
            MIXED(next_by_heading), MIXED(law_by_axle),   MIXED(law_by_heading), MIXED(law_by_ahead),
            MIXED(law_by_turned),   MIXED(law_by_course),
        };
    }
}

/* Write the adjoint's rates into axle, from what counts for axles (count,) and for a unit's heading. */
HDV_INLINE void pulled(
    int64_t count, const struct hdv_link *links, const double *axle, int64_t unit, double heading, struct adjoint *found
) {
    found->course = 0.0;
    for (int64_t i = 0; i < count; i++)
        found->heading[i] = found->axle[i] = 0.0;
    if (unit >= 0)
        found->heading[unit] = heading;
    for (int64_t i = count - 1; i >= 0; i--) {
        double pull = axle ? axle[i] * links[i].axle_speed : 0.0;
        found->heading[i] += pull * (1.0 + links[i].law_by_heading);
        found->axle[i] += pull * links[i].law_by_axle - links[i].by_axle * found->heading[i];
        found->offset[i] = links[i].by_offset * found->heading[i];
        if (i == 0) {
            found->course = pull * links[0].law_by_course;
            break;
        }
        const struct hdv_link *ahead = &links[i - 1];
        found->axle[i - 1] += pull * links[i].law_by_ahead + ahead->next_by_axle * found->offset[i];
        found->heading[i - 1] += pull * links[i].law_by_turned + ahead->next_by_heading * found->offset[i];
    }
}

/* What the first order leaves out in one interval, as much as it counts. */
HDV_INLINE double left_out(
    const struct hdv_tracked *on, int64_t count, struct between at, const struct adjoint *adjoint, const double *axle,
    double metres
) {
    const struct hdv_stray *first = on->strays + (at.first - on->links), *last = on->strays + (at.last - on->links);
    double total = 0.0;
    for (int64_t i = 0; i < count; i++) {
        total += fabs(adjoint->offset[i]) * larger(first[i].residual, last[i].residual);
        total += larger(0.0, -adjoint->offset[i] * (first[i].bow + at.part * (last[i].bow - first[i].bow)));
        total += axle ? fabs(axle[i]) * larger(first[i].drift, last[i].drift) : 0.0;
    }
    return metres * total;
}

/* What all axles' offsets count for together [m]. */
HDV_INLINE double outstanding(const struct hdv_tracked *on, int64_t count, struct between at, const double *axle) {
    const struct hdv_stray *first = on->strays + (at.first - on->links), *last = on->strays + (at.last - on->links);
    double total = 0.0;
    for (int64_t i = 0; i < count; i++)
        total += fabs(axle[i]) * larger(first[i].axle, last[i].axle);
    return total;
}

/* The dynamic programme: what is reached at most from every level of the error; weights of one sign in a row. */
struct programme {
    double level[HDV_MOST_LEVELS + 1]; /* of the error, from -1 to 1 */
    double reached[2][HDV_MOST_LEVELS + 2];
    int64_t levels;
    int now;
    double largest, slack;
    int sign;
};

static void begin_programme(struct programme *on, int64_t levels) {
    on->levels = levels;
    on->now = on->sign = 0;
    on->largest = on->slack = 0.0;
    for (int64_t a = 0; a <= levels; a++) {
        on->level[a] = (double)a * (2.0 / (double)levels) - 1.0;
        on->reached[0][a] = 0.0;
    }
}

static void add_node(struct programme *on, double weight) {
    double *restrict reached = on->reached[on->now];
    const double *restrict level = on->level;
    int64_t levels = on->levels;
    for (int64_t a = 0; a <= levels; a++)
        reached[a] += weight * level[a];
}

/* To the node before: the error may have been one level lower or higher there. */
static void step_back(struct programme *on) {
    const double *restrict from = on->reached[on->now];
    double *restrict to = on->reached[1 - on->now];
    int64_t last = on->levels;
    to[0] = larger(from[0], from[1]);
    to[last] = larger(from[last], from[last - 1]);
    for (int64_t a = 1; a < last; a++)
        to[a] = larger(larger(from[a - 1], from[a]), from[a + 1]);
    on->now = 1 - on->now;
}

/* Between nodes an error may turn back: where weights have one sign, it does so twice at most. */
static void allow_for_turns(struct programme *on, double weight) {
    int sign = weight < 0.0 ? -1 : 1;
    if (sign != on->sign) {
        on->slack += 0.5 * on->largest / (double)on->levels;
        on->largest = 0.0;
        on->sign = sign;
    }
    on->largest = larger(on->largest, fabs(weight));
}

static double most_of(const struct programme *on) {
    const double *reached = on->reached[on->now];
    double most = reached[0], other = reached[0]; /* two at a time: each waits for the one before */
    for (int64_t a = 1; a < on->levels; a += 2) {
        most = larger(most, reached[a]);
        other = larger(other, reached[a + 1]);
    }
    return larger(larger(most, other), reached[on->levels]) + on->slack + 0.5 * on->largest / (double)on->levels;
}

/* Take off what a brush an interval before counts for; return what the error there does. */
HDV_INLINE double take_off(
    const struct hdv_tracked *on, int64_t count, struct between at, const struct hdv_brush *less, double *axle,
    double *left
) {
    struct hdv_link links[HDV_MOST_UNITS];
    struct adjoint pull;
    mix(count, at, links);
    pulled(count, links, NULL, less->unit, -less->by_heading, &pull);
    *left += left_out(on, count, at, &pull, NULL, 1.0);
    for (int64_t i = 0; i < count; i++)
        axle[i] += pull.axle[i];
    axle[less->unit] -= less->by_axle;
    return pull.offset[0];
}

/* How far one brush comes at most, or how much further than ``less`` an interval before, unless that is NULL; whatever
 * lies further back, bodies stray no more than ``outstanding``, so that it ends where the gap cannot be closed any
 * more. Weights of the nodes, from the brush backwards, go to ``weights`` (room,) unless it is NULL; returned is their
 * number. */
HDV_INLINE int64_t approach(
    const struct hdv_tracked *on, int64_t count, const struct hdv_brush *brush, const struct hdv_brush *less,
    double *weights, int64_t room, struct hdv_approach *found
) {
    struct programme programme;
    struct hdv_link links[HDV_MOST_UNITS];
    struct adjoint pull;
    double place = brush->at / on->spacing - 0.5, axle[HDV_MOST_UNITS], half[HDV_MOST_UNITS], weight, left;
    struct between at = between_at(on, place);
    mix(count, at, links);
    pulled(count, links, NULL, brush->unit, brush->by_heading, &pull);
    double heading = larger(
        (on->strays + (at.first - on->links))[brush->unit].heading,
        (on->strays + (at.last - on->links))[brush->unit].heading
    );
    left = left_out(on, count, at, &pull, NULL, 1.0) + brush->second * (1.0 - cos(heading)) +
           fabs(brush->by_heading) * (heading - sin(heading));
    begin_programme(&programme, on->levels);
    for (int64_t i = 0; i < count; i++)
        axle[i] = pull.axle[i];
    axle[brush->unit] += brush->by_axle;
    weight = pull.offset[0];
    int64_t node = 0;
    for (; node < FURTHEST; node++) {
        at = between_at(on, place - 0.5 - (double)node);
        double rest = outstanding(on, count, at, axle);
        if (!(rest >= on->rest * on->error)) /* or a bound that is none */
            break;
        if (node % LOOK == 0 && on->error * (most_of(&programme) + fabs(weight)) + left + rest < brush->gap)
            break;
        mix(count, at, links);
        pulled(count, links, axle, -1, 0.0, &pull);
        for (int64_t i = 0; i < count; i++)
            half[i] = axle[i] + 0.5 * on->spacing * pull.axle[i];
        pulled(count, links, half, -1, 0.0, &pull);
        for (int64_t i = 0; i < count; i++)
            axle[i] += on->spacing * pull.axle[i];
        double own = on->spacing * pull.offset[0];
        left += left_out(on, count, at, &pull, half, on->spacing);
        allow_for_turns(&programme, own);
        weight += 0.5 * own + pull.course;
        add_node(&programme, weight);
        step_back(&programme);
        if (weights && node < room)
            weights[node] = weight;
        weight = 0.5 * own - pull.course;
        if (less && node == 0)
            weight += take_off(on, count, between_at(on, place - 1.0), less, axle, &left);
    }
    add_node(&programme, weight);
    if (weights && node < room)
        weights[node] = weight;
    *found = (struct hdv_approach){most_of(&programme), left + outstanding(on, count, at, axle)};
    return node + 1;
}

/* The same, compiled for one unit, for two, and for any number of them; those behind move no body ahead. */
static int64_t approach_of(
    const struct hdv_tracked *on, const struct hdv_brush *brush, const struct hdv_brush *less, double *weights,
    int64_t room, struct hdv_approach *found
) {
    int64_t count = brush->unit + 1;
    if (count == 1)
        return approach(on, 1, brush, less, weights, room, found);
    if (count == 2)
        return approach(on, 2, brush, less, weights, room, found);
    return approach(on, count, brush, less, weights, room, found);
}

/* Write how far brushes (count,) come at most. */
HDV_EXPORT void
hdv_approach(const struct hdv_tracked *on, const struct hdv_brush *brushes, int64_t count, struct hdv_approach *found) {
    for (int64_t number = 0; number < count; number++)
        approach_of(on, &brushes[number], NULL, NULL, 0, &found[number]);
}

/* Write what the error counts for, from a brush backwards, at nodes into weights (room,); return how many. */
HDV_EXPORT int64_t
hdv_weights(const struct hdv_tracked *on, const struct hdv_brush *brush, double *weights, int64_t room) {
    struct hdv_approach found;
    int64_t count = approach_of(on, brush, NULL, weights, room, &found);
    return count < room ? count : room;
}

/* What depends on a unit's axle and heading in the middle of an interval; its gap is never closed. */
static struct hdv_brush
brush_at(const struct hdv_tracked *on, int64_t interval, int64_t unit, double by_axle, double by_heading) {
    double at = ((double)interval + 0.5) * on->spacing;
    return (struct hdv_brush){.gap = -1.0, .at = at, .by_axle = by_axle, .by_heading = by_heading, .unit = unit};
}

/* The coupling behind a unit, T3. */
static struct hdv_brush next_at(const struct hdv_tracked *on, int64_t interval, int64_t unit) {
    const struct hdv_link *link = link_at(on, interval, unit);
    return brush_at(on, interval, unit, link->next_by_axle, link->next_by_heading);
}

/* All of how far a brush comes, for every metre of the error. */
static double gain_of(const struct hdv_tracked *on, struct hdv_brush brush, const struct hdv_brush *less) {
    struct hdv_approach found;
    approach_of(on, &brush, less, NULL, 0, &found);
    return found.gain + found.remainder / on->error;
}

/* Write the gains of intervals first <= i < beyond, by strays of an error too small for any second order. */
HDV_EXPORT void hdv_gains(const struct hdv_tracked *on, int64_t first, int64_t beyond) {
    for (int64_t i = first; i < beyond; i++) {
        for (int64_t unit = 0; unit < on->count; unit++) {
            struct hdv_gain *gain = &on->gains[i * on->count + unit];
            struct hdv_brush next = next_at(on, i, unit), before = next_at(on, i - 1, unit);
            gain->axle = gain_of(on, brush_at(on, i, unit, 1.0, 0.0), NULL);
            gain->heading = gain_of(on, brush_at(on, i, unit, 0.0, 1.0), NULL);
            if (unit + 1 == on->count)
                continue;
            gain->next = gain_of(on, next, NULL);
            gain->next_slope = gain_of(on, next, &before) / (on->spacing * link_at(on, i, unit + 1)->coupling_speed);
        }
    }
}
