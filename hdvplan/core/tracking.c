/* The worst that a driver's errors can do to a plan: a bound in three parts.
 *
 * Forwards along the plan: how far each unit strays at most, by comparison, and with it all that the first order leaves
 * out. Backwards from a place: the adjoint, which says how much the error of every metre before counts there. And over
 * its nodes: a dynamic programme for the error that counts most.
 */
#include "tracking.h"

#include <math.h>
#include <stddef.h>

#include "numbers.h"

static const double BEFORE_M = 150.0;  /* of driving like at the start, until errors are what they would always be */
static const double LEFT = 1e-5;       /* of the error: what lies further back counts less together */
static const int64_t FURTHEST = 20000; /* intervals back at most */
static const int ROUNDS = 3;           /* of what depends on itself: each leaves its square */
static const int64_t LOOK = 8;         /* intervals back after which it is looked whether a gap can still be closed */

/* The errors of a coupling against its planned track. */
struct coupling {
    double offset;   /* [m] */
    double slope;    /* its change a metre of that track */
    double residual; /* of the offset, that the unit ahead leaves [m] */
    double shift;    /* along the track, from beside the unit ahead [m] */
};

/* Where a coupling is along its planned track, seen from its unit's axle. */
struct aside {
    double shift; /* [m] */
    double bend;  /* largest curvature of the track on the way [1/m] */
};

HDV_INLINE const struct hdv_link *link_at(const struct hdv_tracked *on, int64_t interval, int64_t unit) {
    int64_t at = interval < 0 ? 0 : interval < on->intervals ? interval : on->intervals - 1;
    return &on->links[at * on->count + unit];
}

/* Largest curvature of a coupling's track within so many metres [1/m]. */
static double bend_within(const struct hdv_tracked *on, int64_t interval, int64_t unit, double metres) {
    double each = on->spacing * link_at(on, interval, unit)->coupling_speed, largest = 0.0;
    int64_t around = 1 + whole(metres / each, 0, 1000);
    for (int64_t i = interval - around; i < interval + around; i++) {
        double turned = link_at(on, i + 1, unit)->course - link_at(on, i, unit)->course;
        largest = larger(largest, fabs(turned) / each);
    }
    return largest;
}

/* How far along its planned track a coupling can be, that is so far off it and within ``along`` ahead or behind, seen
 * along the track; ``skew`` more for every metre off it. */
static struct aside
aside_of(const struct hdv_tracked *on, int64_t interval, int64_t unit, double offset, double along, double skew) {
    struct aside at = {along + offset * skew, 0.0};
    for (int round = 0; round < ROUNDS; round++) {
        at.bend = bend_within(on, interval, unit, at.shift);
        double turned = at.bend * at.shift, bow = 0.5 * turned * (at.shift + offset * turned);
        at.shift = (along + (offset + bow) * skew + offset * turned) / larger(1.0 - 0.5 * turned * turned, 0.5);
    }
    return at;
}

/* What offsets seen from the axle, and at the own place of the coupling, differ by at most [m]. */
static double seen_aside(struct aside at, double offset, double slope) {
    double turned = at.bend * at.shift;
    return at.shift * slope + 0.5 * turned * (at.shift + offset * turned);
}

/* By how much a law turns an axle's wheels otherwise than planned [rad]. The unit's own heading error turns them so
 * that it falls: at least ``damping``, at most ``own`` times as much. */
struct off_law {
    double angle;    /* all of it */
    double other;    /* without that of the own heading */
    double residual; /* what of it the first order leaves out */
    double own, damping;
};

/* What of the unit ahead a law depends on. */
struct ahead {
    double heading;      /* error [rad] */
    double heading_rate; /* its change a metre of the front axle's track [rad/m] */
};

/* Largest change of a body's rate of turning within so many metres of the front axle's track [rad/m]. */
static double uneven(const struct hdv_tracked *on, int64_t interval, int64_t unit, double metres) {
    int64_t around = 1 + whole(metres / on->spacing, 0, 1000);
    double here = link_at(on, interval, unit)->turning, largest = 0.0;
    for (int64_t i = interval - around; i <= interval + around; i++)
        largest = larger(largest, fabs(link_at(on, i, unit)->turning - here));
    return largest;
}

/* T4 for a lead unit, whose rear wheels follow the front ones, and for a trailer, whose wheels follow its articulation.
 */
static struct off_law off_law_of(
    const struct hdv_tracked *on, int64_t interval, int64_t unit, struct aside at, struct coupling coupling,
    struct ahead ahead, double heading
) {
    const struct hdv_unit *own = &on->units[unit];
    const struct hdv_link *link = link_at(on, interval, unit);
    double ratio = fabs(own->steering_ratio), angle, missing, turned = at.bend * at.shift;
    if (ratio == 0.0 || own->steered_by != 1 + unit)
        return (struct off_law){0.0, 0.0, 0.0, 0.0, 0.0};
    double second = own->wheelbase * (heading - sin(heading) + 1.0 - cos(heading)) + coupling.offset * turned +
                    0.5 * at.shift * turned * turned;
    if (unit == 0) {
        double course = atan(coupling.slope / (1.0 - at.bend * coupling.offset));
        angle = course + turned + heading;
        missing = coupling.slope * (coupling.slope * coupling.slope + at.bend * coupling.offset) +
                  2.0 * at.bend * (second + at.shift);
    } else {
        double metres = (at.shift + coupling.shift) / link->coupling_speed;
        double turning = fabs(link_at(on, interval, unit - 1)->turning),
               change = uneven(on, interval, unit - 1, metres);
        angle = ahead.heading + heading + (turning + change) * metres;
        missing = ahead.heading_rate * metres + change * metres + turning * 2.0 * second / link->coupling_speed;
    }
    double other = ratio * (angle - heading), stop = own->max_steering_angle, planned = ratio * fabs(link->steered);
    if (fabs(planned - stop) < ratio * angle) /* where the wheels reach their stop, or leave it */
        return (struct off_law){ratio * angle, other, ratio * (missing + angle), ratio, 0.0};
    if (planned >= stop)
        return (struct off_law){0.0, 0.0, 0.0, 0.0, 0.0};
    return (struct off_law){ratio * angle, other, ratio * missing, ratio, ratio};
}

/* What moves a heading error, T1 along the way: its coupling's course, and by how much the unit turns otherwise. */
struct turning {
    double rate;    /* of the bound's growth [rad/m] */
    double damping; /* by which it falls with the bound [1/m] */
    double most;    /* of the error's own rate [rad/m] */
};

static struct turning turning_of(
    const struct hdv_unit *unit, const struct hdv_link *link, const struct hdv_stray *stray, double course,
    struct off_law off
) {
    double omega = fabs(link->coupling_off), per_metre = link->axle_speed / unit->wheelbase,
           along = cos(link->axle_off);
    double widest = tan(smaller(omega + course + stray->heading, 1.5)), slant = tan(omega);
    double otherwise = (widest + fabs(tan(link->axle_off))) *
                       (link->bend * stray->axle + 1.0 / cos(smaller(stray->heading, 1.4)) - 1.0);
    double pull = tan(smaller(omega + course - stray->heading, 1.5)) - slant;
    return (struct turning){
        per_metre * (along * pull + otherwise + (1.0 + otherwise) * off.other / along),
        per_metre * along * (1.0 + slant * slant),
        per_metre * (along * (widest - slant) + otherwise + (1.0 + otherwise) * off.angle / along),
    };
}

/* What a unit passes on to the coupling behind it, T3. */
static struct coupling passed_on(
    const struct hdv_tracked *on, int64_t interval, int64_t unit, const struct hdv_stray *stray, double course,
    double off
) {
    const struct hdv_link *link = link_at(on, interval, unit);
    double hitch = fabs(on->units[unit].hitch_offset), share = hitch / on->units[unit].wheelbase;
    double bow = hitch * (1.0 - cos(stray->heading)), sideways = sin(link->next_off);
    double third = hitch * (stray->heading - sin(stray->heading));
    double offset =
        stray->axle * fabs(link->next_by_axle) + stray->heading * fabs(link->next_by_heading) + bow * fabs(sideways);
    double along =
        stray->axle * fabs(sin(link->next_off - link->axle_off)) + hitch * stray->heading * fabs(sideways) + bow;
    struct aside at = aside_of(on, interval, unit + 1, offset, along, 0.0);
    double omega = fabs(link->coupling_off);
    double swing = share * (tan(smaller(omega + course + stray->heading, 1.5)) - tan(omega));
    double direction = smaller(stray->heading + off * (2.0 + share) + swing + at.bend * at.shift, 1.5);
    double slope = tan(direction) * (1.0 + at.bend * offset);
    double residual = seen_aside(at, offset, slope);
    return (struct coupling){offset + residual, slope, residual + bow * fabs(sideways) + third, at.shift};
}

/* Bounds of one unit at one interval, from those an interval before, and of the coupling behind it. */
static struct coupling stray_on(
    const struct hdv_tracked *on, int64_t interval, int64_t unit, struct coupling coupling, struct ahead *ahead,
    struct hdv_stray *stray
) {
    const struct hdv_unit *own = &on->units[unit];
    const struct hdv_link *link = link_at(on, interval, unit);
    double cosine = cos(link->coupling_off), slant = fabs(tan(link->coupling_off)), length = own->wheelbase;
    double course = 0.0;
    struct hdv_stray before = *stray;
    struct off_law off = {0.0, 0.0, 0.0, 0.0, 0.0};
    struct turning turning = {0.0, 0.0, 0.0};
    stray->offset = coupling.offset;
    for (int round = 0; round < ROUNDS; round++) {
        double bow = length * (1.0 - cos(stray->heading)), third = stray->heading - sin(stray->heading);
        double along = (stray->axle * fabs(sin(link->axle_off)) + bow) / cosine;
        struct aside at = aside_of(on, interval, unit, coupling.offset, along, slant);
        off = off_law_of(on, interval, unit, at, coupling, *ahead, stray->heading);
        course = atan(coupling.slope / (1.0 - smaller(at.bend * coupling.offset, 0.5))) + at.bend * at.shift;
        stray->residual = coupling.residual + seen_aside(at, coupling.offset, coupling.slope) + length * cosine * third;
        stray->bow = bow * sin(link->coupling_off);
        double offset = coupling.offset + stray->residual + fabs(stray->bow);
        double turned = smaller(stray->heading + off.angle, 1.5);
        stray->drift =
            link->axle_speed * (tan(turned) - turned + link->bend * stray->axle * tan(turned) + off.residual);
        double source = link->axle_speed * ((1.0 + off.own) * offset * link->by_offset + off.other);
        double rate = link->axle_speed * (1.0 + off.damping) * link->by_axle;
        stray->axle = (before.axle + on->spacing * (source + stray->drift)) / (1.0 + on->spacing * rate);
        turning = turning_of(own, link, &before, course, off);
        double most = offset * link->by_offset + stray->axle * link->by_axle;
        stray->heading = before.heading + on->spacing * turning.rate / (1.0 + on->spacing * turning.damping);
        stray->heading = smaller(stray->heading, asin(smaller(most, 1.0)));
    }
    *ahead = (struct ahead){stray->heading, turning.most};
    if (unit + 1 == on->count)
        return coupling;
    return passed_on(on, interval, unit, stray, course, off.angle);
}

/* Write how far each unit strays at most, (intervals, count). */
HDV_EXPORT void hdv_stray(const struct hdv_tracked *on) {
    struct hdv_stray now[HDV_MOST_UNITS];
    for (int64_t unit = 0; unit < on->count; unit++)
        now[unit] = (struct hdv_stray){0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    int64_t before = (int64_t)(BEFORE_M / on->spacing);
    for (int64_t i = -before; i < on->intervals; i++) {
        struct coupling coupling = {on->error, on->slope, 0.0, 0.0};
        struct ahead ahead = {0.0, 0.0};
        for (int64_t unit = 0; unit < on->count; unit++) {
            coupling = stray_on(on, i, unit, coupling, &ahead, &now[unit]);
            if (i >= 0)
                on->strays[i * on->count + unit] = now[unit];
        }
    }
}

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

#define MIXED(field) (first->field + part * (last->field - first->field))

/* Return the adjoint's rates into axle, from what counts for axles (count,), and for a unit's heading; ``moving``: with
 * what rates of axles count. */
static struct adjoint
pulled(const struct hdv_tracked *on, struct between at, const double *axle, int64_t unit, double heading) {
    struct adjoint found = {{0.0}, {0.0}, {0.0}, 0.0};
    double part = at.part;
    if (unit >= 0)
        found.heading[unit] = heading;
    for (int64_t i = on->count - 1; i >= 0; i--) {
        const struct hdv_link *first = at.first + i, *last = at.last + i;
        double pull = axle ? axle[i] * MIXED(axle_speed) : 0.0;
        found.heading[i] += pull * (1.0 + MIXED(law_by_heading));
        found.axle[i] += pull * MIXED(law_by_axle) - MIXED(by_axle) * found.heading[i];
        found.offset[i] = MIXED(by_offset) * found.heading[i];
        if (i == 0) {
            found.course = pull * MIXED(law_by_course);
            break;
        }
        const struct hdv_link *ahead_first = first - 1, *ahead_last = last - 1;
        double by_axle = ahead_first->next_by_axle + part * (ahead_last->next_by_axle - ahead_first->next_by_axle);
        double by_heading =
            ahead_first->next_by_heading + part * (ahead_last->next_by_heading - ahead_first->next_by_heading);
        found.axle[i - 1] += pull * MIXED(law_by_ahead) + by_axle * found.offset[i];
        found.heading[i - 1] += pull * MIXED(law_by_turned) + by_heading * found.offset[i];
    }
    return found;
}

/* What the first order leaves out in one interval, as much as it counts. */
static double left_out(
    const struct hdv_tracked *on, struct between at, const struct adjoint *adjoint, const double *axle, double metres
) {
    const struct hdv_stray *first = on->strays + (at.first - on->links), *last = on->strays + (at.last - on->links);
    double total = 0.0;
    for (int64_t i = 0; i < on->count; i++) {
        total += fabs(adjoint->offset[i]) * larger(first[i].residual, last[i].residual);
        total += larger(0.0, -adjoint->offset[i] * (first[i].bow + at.part * (last[i].bow - first[i].bow)));
        total += axle ? fabs(axle[i]) * larger(first[i].drift, last[i].drift) : 0.0;
    }
    return metres * total;
}

/* What all axles' offsets count for together [m]. */
static double outstanding(const struct hdv_tracked *on, struct between at, const double *axle) {
    const struct hdv_stray *first = on->strays + (at.first - on->links), *last = on->strays + (at.last - on->links);
    double total = 0.0;
    for (int64_t i = 0; i < on->count; i++)
        total += fabs(axle[i]) * larger(first[i].axle, last[i].axle);
    return total;
}

/* The dynamic programme: what is reached at most from every level of the error, and the weights of one sign in a row.
 */
struct programme {
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
    for (int64_t a = 0; a <= levels; a++)
        on->reached[0][a] = 0.0;
}

static void add_node(struct programme *on, double weight) {
    double *reached = on->reached[on->now], each = 2.0 / (double)on->levels;
    for (int64_t a = 0; a <= on->levels; a++)
        reached[a] += weight * ((double)a * each - 1.0);
}

/* To the node before: the error may have been one level lower or higher there. */
static void step_back(struct programme *on) {
    const double *from = on->reached[on->now];
    double *to = on->reached[1 - on->now];
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
    double most = reached[0];
    for (int64_t a = 1; a <= on->levels; a++)
        most = larger(most, reached[a]);
    return most + on->slack + 0.5 * on->largest / (double)on->levels;
}

/* How far one brush comes at most; whatever lies further back, bodies stray no more than ``outstanding``, so that it
 * ends where the gap cannot be closed any more. Weights of the nodes, from the brush backwards, go to ``weights``
 * (room,) unless it is NULL; returned is their number. */
static int64_t approach_of(
    const struct hdv_tracked *on, const struct hdv_brush *brush, double *weights, int64_t room,
    struct hdv_approach *found
) {
    struct programme programme;
    double place = brush->at / on->spacing - 0.5, axle[HDV_MOST_UNITS], half[HDV_MOST_UNITS], weight, left;
    struct between at = between_at(on, place);
    struct adjoint pull = pulled(on, at, NULL, brush->unit, brush->by_heading);
    double heading = larger(
        (on->strays + (at.first - on->links))[brush->unit].heading,
        (on->strays + (at.last - on->links))[brush->unit].heading
    );
    left = left_out(on, at, &pull, NULL, 1.0) + brush->second * (1.0 - cos(heading)) +
           fabs(brush->by_heading) * (heading - sin(heading));
    begin_programme(&programme, on->levels);
    for (int64_t i = 0; i < on->count; i++)
        axle[i] = pull.axle[i];
    axle[brush->unit] += brush->by_axle;
    weight = pull.offset[0];
    int64_t node = 0;
    for (; node < FURTHEST; node++) {
        at = between_at(on, place - 0.5 - (double)node);
        double rest = outstanding(on, at, axle);
        if (!(rest >= LEFT * on->error)) /* or a bound that is none */
            break;
        if (node % LOOK == 0 && on->error * (most_of(&programme) + fabs(weight)) + left + rest < brush->gap)
            break;
        pull = pulled(on, at, axle, -1, 0.0);
        for (int64_t i = 0; i < on->count; i++)
            half[i] = axle[i] + 0.5 * on->spacing * pull.axle[i];
        pull = pulled(on, at, half, -1, 0.0);
        for (int64_t i = 0; i < on->count; i++)
            axle[i] += on->spacing * pull.axle[i];
        double own = on->spacing * pull.offset[0];
        left += left_out(on, at, &pull, half, on->spacing);
        allow_for_turns(&programme, own);
        weight += 0.5 * own + pull.course;
        add_node(&programme, weight);
        step_back(&programme);
        if (weights && node < room)
            weights[node] = weight;
        weight = 0.5 * own - pull.course;
    }
    add_node(&programme, weight);
    if (weights && node < room)
        weights[node] = weight;
    *found = (struct hdv_approach){most_of(&programme), left + outstanding(on, at, axle)};
    return node + 1;
}

/* Write how far brushes (count,) come at most. */
HDV_EXPORT void
hdv_approach(const struct hdv_tracked *on, const struct hdv_brush *brushes, int64_t count, struct hdv_approach *found) {
    for (int64_t number = 0; number < count; number++)
        approach_of(on, &brushes[number], NULL, 0, &found[number]);
}

/* Write what the error counts for at one brush, on nodes from there backwards, into weights (room,); return how many.
 */
HDV_EXPORT int64_t
hdv_weights(const struct hdv_tracked *on, const struct hdv_brush *brush, double *weights, int64_t room) {
    struct hdv_approach found;
    int64_t count = approach_of(on, brush, weights, room, &found);
    return count < room ? count : room;
}
