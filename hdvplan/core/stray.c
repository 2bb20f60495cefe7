/* How far each unit strays at most from a plan while its driver errs, forwards along it, by comparison; and with it all
 * that the first order leaves out. */
#include <math.h>
#include <stddef.h>

#include "numbers.h"
#include "tracking.h"

static const double BEFORE_M = 150.0; /* of driving like at the start, until errors are what they would always be */
static const int ROUNDS = 3;          /* of what depends on itself at most: each leaves its square */
static const double ARCTAN = 0.33;    /* half the largest second derivative of the arctangent, and more */
static const double LOST = 0.7;       /* of a heading error [rad], beyond which no bound stays finite */
static const double SETTLED = 1e-9;   /* [m], [rad]: what changes by less needs no further round */

/* The errors of a coupling against its planned track. */
struct coupling {
    double offset;   /* [m] */
    double slope;    /* its change a metre of that track */
    double residual; /* of the offset, that the unit ahead leaves [m] */
    double shift;    /* along the track, from beside the unit ahead [m] */
    double beyond;   /* of the offset, beyond the first order [m] */
    double steeper;  /* of the slope, beyond the first order [m/m] */
};

/* What a unit strays beyond the first order. */
struct beyond {
    double axle, heading; /* [m], [rad] */
    double next;          /* of its coupling behind, without what T3 leaves out [m] */
};

/* Where a coupling is along its planned track, seen from its unit's axle. */
struct aside {
    double shift; /* [m] */
    double bend;  /* largest curvature of the track on the way [1/m] */
};

/* Largest curvature of a coupling's track within so many intervals, each of so many metres [1/m]. */
static double bend_within(const struct hdv_tracked *on, int64_t interval, int64_t unit, int64_t around, double each) {
    double largest = 0.0, before = link_at(on, interval - around, unit)->course;
    for (int64_t i = interval - around; i < interval + around; i++) {
        double course = link_at(on, i + 1, unit)->course;
        largest = larger(largest, fabs(course - before));
        before = course;
    }
    return largest / each;
}

/* How far along its planned track a coupling can be, that is so far off it and within ``along`` ahead or behind, seen
 * along the track; ``skew`` more for every metre off it. */
static struct aside
aside_of(const struct hdv_tracked *on, int64_t interval, int64_t unit, double offset, double along, double skew) {
    struct aside at = {along + offset * skew, 0.0};
    double each = on->spacing * link_at(on, interval, unit)->coupling_speed;
    int64_t around = 0;
    for (int round = 0; round < ROUNDS; round++) {
        int64_t wanted = 1 + whole(at.shift / each, 0, 1000);
        if (wanted != around)
            at.bend = bend_within(on, interval, unit, wanted, each);
        around = wanted;
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
    struct beyond beyond;
};

/* Largest change of a body's rate of turning within so many metres of the front axle's track [rad/m]. */
static double uneven(const struct hdv_tracked *on, int64_t interval, int64_t unit, double metres) {
    int64_t around = 1 + whole(metres / on->spacing, 0, 1000);
    double here = link_at(on, interval, unit)->turning, largest = 0.0;
    for (int64_t i = interval - around; i <= interval + around; i++)
        largest = larger(largest, fabs(link_at(on, i, unit)->turning - here));
    return largest;
}

/* T4 for a lead unit's rear wheels, which follow the front ones, and a trailer's, which follow its articulation. */
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

/* Angles of a planned unit, and of one that strays, as they are used. */
struct posture {
    double theta_cos, theta_sin, theta_tan; /* of the coupling's track off the body; the tangent without its sign */
    double alpha_cos, alpha_sin, alpha_tan; /* of the axle's track; sine and tangent without their signs */
    double omega;                           /* theta without its sign [rad] */
    double before_tan;                      /* of the heading error an interval before */
    double before_askew;                    /* by what it and the axle's offset there lengthen the axle's way */
};

static struct posture posture_of(const struct hdv_link *link, const struct hdv_stray *before) {
    struct posture at = {.theta_cos = cos(link->coupling_off), .theta_sin = sin(link->coupling_off), .alpha_cos = 1.0};
    at.theta_tan = fabs(at.theta_sin) / at.theta_cos;
    at.omega = fabs(link->coupling_off);
    if (link->axle_off != 0.0) {
        at.alpha_cos = cos(link->axle_off);
        at.alpha_sin = fabs(sin(link->axle_off));
        at.alpha_tan = at.alpha_sin / fabs(at.alpha_cos);
    }
    double heading_cos = cos(before->heading);
    at.before_tan = sin(before->heading) / heading_cos;
    if (before->heading > 1.4)
        heading_cos = cos(1.4);
    at.before_askew = link->bend * before->axle + 1.0 / heading_cos - 1.0;
    return at;
}

/* Tangent of what is at most 1.5 rad. */
static double tan_of(double angle) {
    return tan(smaller(angle, 1.5));
}

/* What moves a heading error, T1 along the way: its coupling's course, and by how much the unit turns otherwise. */
struct turning {
    double rate;    /* of the bound's growth [rad/m] */
    double damping; /* by which it falls with the bound [1/m] */
    double most;    /* of the error's own rate [rad/m] */
};

static struct turning turning_of(
    const struct hdv_unit *unit, const struct hdv_link *link, const struct posture *at, double before, double course,
    struct off_law off
) {
    double per_metre = link->axle_speed / unit->wheelbase, along = at->alpha_cos, slant = at->theta_tan;
    double towards = at->omega + course, widest, narrowest;
    if (towards + before < 1.5) { /* sums of angles, by their tangents */
        double straight = tan(towards), turned = at->before_tan;
        widest = (straight + turned) / (1.0 - straight * turned);
        narrowest = (straight - turned) / (1.0 + straight * turned);
    } else {
        widest = tan_of(towards + before);
        narrowest = tan_of(towards - before);
    }
    double otherwise = (widest + at->alpha_tan) * at->before_askew, pull = narrowest - slant;
    return (struct turning){
        per_metre * (along * pull + otherwise + (1.0 + otherwise) * off.other / along),
        per_metre * along * (1.0 + slant * slant),
        per_metre * (along * (widest - slant) + otherwise + (1.0 + otherwise) * off.angle / along),
    };
}

/* What residuals, bow and drift add to the first order at most: T1 to T4 compared, with them alone as errors. */
static struct beyond beyond_of(
    const struct hdv_tracked *on, const struct hdv_link *link, const struct beyond *ahead, double coupling,
    const struct hdv_stray *stray, double before
) {
    double offset = coupling + stray->residual + fabs(stray->bow), followed = 1.0 + link->law_by_heading;
    double source = fabs(followed) * link->by_offset * offset + fabs(link->law_by_ahead) * ahead->axle +
                    fabs(link->law_by_turned) * ahead->heading;
    double rate = link->axle_speed * (followed * link->by_axle - link->law_by_axle);
    double axle = (before + on->spacing * (link->axle_speed * source + stray->drift)) / (1.0 + on->spacing * rate);
    return (struct beyond){
        axle,
        link->by_offset * offset + link->by_axle * axle,
        fabs(link->next_by_axle - link->next_by_heading * link->by_axle) * axle +
            fabs(link->next_by_heading) * link->by_offset * offset,
    };
}

/* How a unit is led: its coupling, where this is, and the course of that. */
struct lead {
    struct coupling coupling;
    struct aside aside;
    double course, off; /* by how much its wheels are turned otherwise [rad] */
};

/* What the slope of the coupling behind is at most beyond the first order: what is left of the slope without its linear
 * part, with all that its parts are beyond theirs. Curvature may change on the way along a track: it counts twice. */
static double steeper_of(
    const struct hdv_link *link, const struct posture *posture, const struct lead *lead, const struct beyond *beyond,
    double hitch, double share, double heading, struct aside at, double offset
) {
    double slope = lead->coupling.slope, bend = lead->aside.bend, tangent = posture->theta_tan;
    double course = tan_of(slope / (1.0 - smaller(bend * lead->coupling.offset, 0.5))) + 2.0 * bend * lead->aside.shift;
    double swing = share * (tan_of(posture->omega + course + heading) - tangent);
    double turned = heading + swing + ARCTAN * swing * swing + 2.0 * at.bend * at.shift;
    double by_course = share * (1.0 + tangent * tangent);
    double linear = heading + by_course * (slope + heading);
    double shift = beyond->axle * posture->alpha_sin / posture->theta_cos + lead->coupling.beyond * tangent;
    double along =
        beyond->axle * fabs(sin(link->next_off - link->axle_off)) + beyond->heading * hitch * fabs(sin(link->next_off));
    double parts = beyond->heading + by_course * (lead->coupling.steeper + bend * shift + beyond->heading);
    return tan_of(turned) * (1.0 + at.bend * offset) - linear + parts + at.bend * along;
}

/* What a unit passes on to the coupling behind it, T3. */
static struct coupling passed_on(
    const struct hdv_tracked *on, int64_t interval, int64_t unit, const struct hdv_stray *stray,
    const struct posture *posture, const struct lead *lead, const struct beyond *beyond
) {
    const struct hdv_link *link = link_at(on, interval, unit);
    const struct hdv_gain *gain = gain_at(on, interval, unit), *after = gain_at(on, interval + 1, unit);
    double hitch = fabs(on->units[unit].hitch_offset), share = hitch / on->units[unit].wheelbase;
    double bow = hitch * (1.0 - cos(stray->heading)), sideways = fabs(sin(link->next_off));
    double third = hitch * (stray->heading - sin(stray->heading));
    double straight = smaller(
        stray->axle * fabs(link->next_by_axle) + stray->heading * fabs(link->next_by_heading),
        on->error * gain->next + beyond->next + third
    );
    double offset = straight + bow * sideways;
    double along = smaller(
        stray->axle * fabs(sin(link->next_off - link->axle_off)) + hitch * stray->heading * sideways,
        (straight * sideways + stray->axle * posture->alpha_sin) / cos(link->next_off)
    );
    struct aside at = aside_of(on, interval, unit + 1, offset, along + bow, 0.0);
    double swing = share * (tan_of(posture->omega + lead->course + stray->heading) - posture->theta_tan);
    double turned = stray->heading + lead->off * (2.0 + share) + swing + at.bend * at.shift;
    double slope = tan_of(turned) * (1.0 + at.bend * offset), steeper = INFINITY;
    if (lead->off == 0.0) {
        steeper = steeper_of(link, posture, lead, beyond, hitch, share, stray->heading, at, offset);
        slope = smaller(slope, on->error * larger(gain->next_slope, after->next_slope) + steeper);
    }
    double residual = seen_aside(at, offset, slope);
    return (struct coupling){
        offset + residual, slope, residual + bow * sideways + third, at.shift, beyond->next, steeper,
    };
}

/* Bounds of one unit at one interval, from those an interval before, and of the coupling behind it. */
static struct coupling stray_on(
    const struct hdv_tracked *on, int64_t interval, int64_t unit, struct coupling coupling, struct ahead *ahead,
    struct hdv_stray *stray
) {
    const struct hdv_unit *own = &on->units[unit];
    const struct hdv_link *link = link_at(on, interval, unit);
    const struct hdv_gain *gain = gain_at(on, interval, unit);
    double length = own->wheelbase;
    struct hdv_stray before = *stray;
    struct lead lead = {.coupling = coupling};
    struct beyond beyond = {0.0, 0.0, 0.0};
    struct posture at = posture_of(link, &before);
    struct off_law off = {0.0, 0.0, 0.0, 0.0, 0.0};
    struct turning turning = {0.0, 0.0, 0.0};
    stray->offset = coupling.offset;
    for (int round = 0; round < ROUNDS; round++) {
        double sine = sin(stray->heading), cosine = cos(stray->heading), bow = length * (1.0 - cosine);
        double along = (stray->axle * at.alpha_sin + bow) / at.theta_cos;
        struct aside aside = lead.aside = aside_of(on, interval, unit, coupling.offset, along, at.theta_tan);
        off = off_law_of(on, interval, unit, aside, coupling, *ahead, stray->heading);
        lead.course =
            atan(coupling.slope / (1.0 - smaller(aside.bend * coupling.offset, 0.5))) + aside.bend * aside.shift;
        stray->residual = coupling.residual + seen_aside(aside, coupling.offset, coupling.slope) +
                          length * at.theta_cos * (stray->heading - sine);
        stray->bow = bow * at.theta_sin;
        double offset = coupling.offset + stray->residual + fabs(stray->bow);
        double turned = smaller(stray->heading + off.angle, 1.5);
        double tangent = turned == stray->heading ? sine / cosine : tan(turned);
        stray->drift = link->axle_speed * (tangent - turned + link->bend * stray->axle * tangent + off.residual);
        double source = link->axle_speed * ((1.0 + off.own) * offset * link->by_offset + off.other);
        double rate = link->axle_speed * (1.0 + off.damping) * link->by_axle;
        double axle = stray->axle, heading = stray->heading;
        stray->axle = (before.axle + on->spacing * (source + stray->drift)) / (1.0 + on->spacing * rate);
        beyond = beyond_of(on, link, &ahead->beyond, coupling.beyond, stray, before.beyond);
        stray->axle = smaller(stray->axle, on->error * gain->axle + beyond.axle);
        turning = turning_of(own, link, &at, before.heading, lead.course, off);
        double most = offset * link->by_offset + stray->axle * link->by_axle;
        stray->heading = before.heading + on->spacing * turning.rate / (1.0 + on->spacing * turning.damping);
        if (stray->heading > most) /* as the angle is more than its sine */
            stray->heading = smaller(stray->heading, asin(smaller(most, 1.0)));
        stray->heading = smaller(stray->heading, on->error * gain->heading + beyond.heading);
        if (fabs(stray->axle - axle) < SETTLED && fabs(stray->heading - heading) < SETTLED)
            break;
    }
    stray->beyond = beyond.axle;
    lead.off = off.angle;
    *ahead = (struct ahead){stray->heading, turning.most, beyond};
    if (unit + 1 == on->count)
        return coupling;
    return passed_on(on, interval, unit, stray, &at, &lead, &beyond);
}

/* Go on by one interval; return whether the bounds there are as they were. */
static int stray_within(const struct hdv_tracked *on, int64_t interval, struct hdv_stray *now) {
    struct coupling coupling = {on->error, on->slope, 0.0, 0.0, 0.0, 0.0};
    struct ahead ahead = {0.0, 0.0, {0.0, 0.0, 0.0}};
    int same = interval >= 0;
    for (int64_t unit = 0; unit < on->count; unit++) {
        coupling = stray_on(on, interval, unit, coupling, &ahead, &now[unit]);
        if (interval < 0)
            continue;
        struct hdv_stray *before = &on->strays[interval * on->count + unit];
        same &= fabs(before->axle - now[unit].axle) < SETTLED && fabs(before->heading - now[unit].heading) < SETTLED &&
                fabs(before->beyond - now[unit].beyond) < SETTLED;
        *before = now[unit];
    }
    return same;
}

static int are_lost(const struct hdv_tracked *on, const struct hdv_stray *now) {
    for (int64_t unit = 0; unit < on->count; unit++)
        if (!(now[unit].heading < LOST))
            return 1;
    return 0;
}

/* Whatever comes after a heading error without a bound has none. */
static void lose(const struct hdv_tracked *on, int64_t interval) {
    for (int64_t i = (interval > 0 ? interval : 0) * on->count; i < on->intervals * on->count; i++)
        on->strays[i] = (struct hdv_stray){INFINITY, INFINITY, INFINITY, INFINITY, INFINITY, INFINITY, INFINITY};
}

/* Write how far each unit strays at most, (intervals, count): from interval ``first`` on, where those before it are
 * known, to where from ``beyond`` on nothing changes. */
HDV_EXPORT void hdv_stray(const struct hdv_tracked *on, int64_t first, int64_t beyond) {
    struct hdv_stray now[HDV_MOST_UNITS];
    for (int64_t unit = 0; unit < on->count; unit++)
        now[unit] = first > 0 ? on->strays[(first - 1) * on->count + unit]
                              : (struct hdv_stray){0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    for (int64_t i = first > 0 ? first : -(int64_t)(BEFORE_M / on->spacing); i < on->intervals; i++) {
        if (stray_within(on, i, now) && i >= beyond)
            return;
        if (are_lost(on, now)) {
            lose(on, i);
            return;
        }
    }
}
