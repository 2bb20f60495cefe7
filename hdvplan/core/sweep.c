/* The swept envelope: how far left and right of the road's centre every body reaches at each arclength, as executed. */
#include "kinematics.h"
#include "numbers.h"
#include "path.h"

static const double TRUSTED = 0.9;   /* curvature times offset up to which two Newton steps can be trusted */
static const double ROUNDING = 1e-6; /* of feet, as a part of the spacing: a body without overhang begins at s = 0 */

/* The foot of an outline's point on the road: at this pose, and at the one before. */
struct track {
    double s, offset; /* [m] */
    double s_before, offset_before;
};

/* Envelope of one unit. */
struct envelope {
    int64_t stations;
    double s_first;     /* of the stations [m] */
    double spacing;     /* [m] */
    double *low, *high; /* (stations,) [m] */
};

/* Moves the feet of an outline's points (points, 2) to their next pose, from where their last two places lead; the
 * offset is NaN where that is too far off. Two Newton steps do but for sudden turns, and until two places are known. */
HDV_INLINE void move_feet(
    const struct hdv_curve *curve, const struct hdv_pose *pose, int64_t points, const double *outline,
    struct track *tracks, int known
) {
    for (int64_t i = 0; i < points; i++) {
        struct track *track = tracks + i;
        double s = 2.0 * track->s - track->s_before;
        struct plane_point point = body_point(pose, outline[2 * i], outline[2 * i + 1]);
        double step = 0.0, turned = 0.0, offset = 0.0;
        for (int attempt = 0; attempt < 2; attempt++) {
            struct path_point at = evaluate(curve, s);
            double ahead = (point.x - at.x) * at.cos + (point.y - at.y) * at.sin;
            double across = (point.y - at.y) * at.cos - (point.x - at.x) * at.sin;
            turned = at.curvature * across;
            step = ahead / (1.0 - turned);
            s += step;
            offset = across - 0.5 * ahead * at.curvature * step;
            if (fabs(step) < LAST_STEP_M)
                break;
        }
        track->s_before = track->s;
        track->offset_before = track->offset;
        track->s = s;
        track->offset = known && fabs(step) < LAST_STEP_M && turned < TRUSTED ? offset : NAN;
    }
}

/* Finds the feet that are still missing, each from its neighbour, the first from arclength near. Where a point lies
 * beyond the road's centre of curvature, no foot of that body tells: offsets are NaN, which widen nothing. */
HDV_INLINE void search(
    const struct hdv_curve *curve, const struct hdv_pose *pose, int64_t points, const double *outline,
    struct track *tracks, double near
) {
    double last = near;
    for (int64_t i = 0; i < points && !isnan(last); i++) {
        if (isnan(tracks[i].offset)) {
            struct plane_point point = body_point(pose, outline[2 * i], outline[2 * i + 1]);
            struct foot foot = project(curve, point.x, point.y, last, LAST_STEP_M);
            tracks[i].s = foot.s;
            tracks[i].offset = foot.offset;
        }
        last = isnan(tracks[i].offset) ? NAN : tracks[i].s;
    }
    for (int64_t i = 0; i < points && isnan(last); i++) {
        tracks[i].s = near;
        tracks[i].offset = NAN;
    }
}

/* Widens an envelope by a straight piece in the (s, offset) plane, whose first end has the lower s. */
HDV_INLINE void
cover_ordered(const struct envelope *envelope, double s_low, double e_low, double s_high, double e_high) {
    int64_t first = whole(ceil((s_low - envelope->s_first) / envelope->spacing - ROUNDING), 0, envelope->stations);
    int64_t last =
        whole(floor((s_high - envelope->s_first) / envelope->spacing + ROUNDING), -1, envelope->stations - 1);
    for (int64_t j = first; j <= last; j++) {
        double ahead = envelope->s_first + (double)j * envelope->spacing - s_low;
        double part = s_high > s_low ? clamped(ahead / (s_high - s_low), 0.0, 1.0) : 0.0;
        double offset = e_low + part * (e_high - e_low);
        double highest = s_high == s_low ? e_high : offset;
        envelope->low[j] = offset < envelope->low[j] ? offset : envelope->low[j];
        envelope->high[j] = highest > envelope->high[j] ? highest : envelope->high[j];
    }
}

HDV_INLINE void cover(const struct envelope *envelope, double s_from, double e_from, double s_to, double e_to) {
    if (s_to < s_from || (s_to == s_from && e_to < e_from))
        cover_ordered(envelope, s_to, e_to, s_from, e_from);
    else
        cover_ordered(envelope, s_from, e_from, s_to, e_to);
}

/* Widens an envelope by an outline, and if it was seen before by every point's way from the last pose. */
HDV_INLINE void widen(const struct envelope *envelope, int64_t points, const struct track *tracks, int seen) {
    for (int64_t i = 0; i < points; i++) {
        const struct track *here = tracks + i;
        if (i > 0)
            cover(envelope, here[-1].s, here[-1].offset, here->s, here->offset);
        if (seen)
            cover(envelope, here->s_before, here->offset_before, here->s, here->offset);
    }
}

/* Writes the lowest and highest offset of every unit at stations s_first, s_first + spacing, ... into low and high
 * (count, stations), which come in as infinity and minus infinity [m].
 *
 * A vehicle of count units was in states z (poses, n) at arclengths s (poses,). outlines (count, points, 2) are ahead
 * of a unit's axle and left of its axis; tracks (count, points) is memory, zero at first. */
HDV_EXPORT void hdv_sweep(
    const struct hdv_unit *units, int64_t count, int64_t n, const struct hdv_curve *curve, int64_t poses,
    const double *s, const double *z, int64_t points, const double *outlines, struct track *tracks, int64_t stations,
    double s_first, double spacing, double *low, double *high
) {
    struct hdv_pose placed[HDV_MOST_UNITS];
    for (int64_t i = 0; i < poses; i++) {
        struct path_point road = evaluate(curve, s[i]);
        place(units, count, road.x, road.y, road.cos, road.sin, z + i * n, placed);
        double behind = 0.0; /* of the unit's axle behind the lead unit's, in line */
        for (int64_t unit = 0; unit < count; unit++) {
            if (unit > 0)
                behind += units[unit - 1].hitch_offset + units[unit].wheelbase;
            const double *outline = outlines + unit * points * 2;
            struct track *own = tracks + unit * points;
            move_feet(curve, placed + unit, points, outline, own, i > 1);
            search(curve, placed + unit, points, outline, own, s[i] - behind + outline[0]);
            struct envelope envelope = {stations, s_first, spacing, low + unit * stations, high + unit * stations};
            widen(&envelope, points, own, i > 0);
        }
    }
}
