/* The reference path gamma(s): position, heading and curvature at an arclength, and the foot of a point. */
#ifndef HDVPLAN_PATH_H
#define HDVPLAN_PATH_H

#include <math.h>

#include "numbers.h"

static const double LAST_STEP_M = 2e-5;     /* a Newton step this small leaves errors of its square */
static const double PLANNING_STEP_M = 1e-3; /* the same for plans: offsets are then good to 1e-10 m, feet to 1e-7 m */
static const double LOCAL_M = 15.0;         /* a foot further from where the search began is another part of the road */
static const double LONGEST_STEP_M = 5.0;   /* of a search */
static const double BEYOND = 0.05;          /* 1 - curvature * offset below which Newton steps would overshoot */

struct path_point {
    double x, y;      /* [m] */
    double cos, sin;  /* of the heading psi */
    double curvature; /* [1/m] */
};

/* Foot of a point: where on the path, and how far to the left of it the point is; NaN without a foot. */
struct foot {
    double s, offset; /* [m] */
    double cos, sin;  /* of the heading psi at the foot */
    double curvature; /* [1/m] */
};

/* A value held between two bounds. */
HDV_INLINE double clamped(double value, double low, double high) {
    double above = value > low ? value : low;
    return above < high ? above : high;
}

/* Number of the segment at arclength s [m]; beyond the table its first or last. */
HDV_INLINE int64_t segment_at(const struct hdv_curve *curve, double s) {
    return whole((s - curve->s_first) / curve->spacing, 0, curve->segments - 1);
}

/* The path's point at arclength s [m]; beyond the table its last segment goes on. */
HDV_INLINE struct path_point evaluate(const struct hdv_curve *curve, double s) {
    int64_t index = segment_at(curve, s);
    const double *x = curve->coefficients + 12 * index;
    const double *y = x + 6;
    double u = s - curve->s_first - (double)index * curve->spacing;
    double dx = x[1] + u * (2.0 * x[2] + u * (3.0 * x[3] + u * (4.0 * x[4] + u * 5.0 * x[5])));
    double dy = y[1] + u * (2.0 * y[2] + u * (3.0 * y[3] + u * (4.0 * y[4] + u * 5.0 * y[5])));
    double ddx = 2.0 * x[2] + u * (6.0 * x[3] + u * (12.0 * x[4] + u * 20.0 * x[5]));
    double ddy = 2.0 * y[2] + u * (6.0 * y[3] + u * (12.0 * y[4] + u * 20.0 * y[5]));
    /* Knots are equal arclengths apart: |gamma'| is 1 to 1e-5, and two terms of 1/sqrt(1 + over) exact to 1e-13. */
    double over = dx * dx + dy * dy - 1.0;
    double unit = 1.0 - over * (0.5 - 0.375 * over);
    return (struct path_point){
        x[0] + u * (x[1] + u * (x[2] + u * (x[3] + u * (x[4] + u * x[5])))),
        y[0] + u * (y[1] + u * (y[2] + u * (y[3] + u * (y[4] + u * y[5])))),
        unit * dx,
        unit * dy,
        unit * unit * unit * (dx * ddy - dy * ddx),
    };
}

/* Foot of (x, y) [m], searched from arclength near; [GEO] eqs. 3 and 7. Its offset is NaN without a foot within
 * LOCAL_M.
 *
 * Newton on the tangential distance, whose derivative along s is -(1 - curvature * offset). The step that is shorter
 * than last_step is not looked up again: its effect on offset and heading is added to second and first order, exact to
 * 1e-12 m for LAST_STEP_M. */
HDV_INLINE struct foot project(const struct hdv_curve *curve, double x, double y, double near, double last_step) {
    double s = near;
    double s_last = curve->s_first + curve->spacing * (double)curve->segments;
    for (int attempt = 0; attempt < 30; attempt++) {
        struct path_point at = evaluate(curve, s);
        double ahead = (x - at.x) * at.cos + (y - at.y) * at.sin;
        double offset = (y - at.y) * at.cos - (x - at.x) * at.sin;
        double slope = 1.0 - at.curvature * offset;
        /* At or beyond the centre of curvature: creep along the tangent instead. */
        double step = clamped(slope < BEYOND ? ahead : ahead / slope, -LONGEST_STEP_M, LONGEST_STEP_M);
        s += step;
        if (fabs(s - near) > LOCAL_M || !(curve->s_first - 1e-9 <= s && s <= s_last + 1e-9))
            break;
        if (fabs(step) < last_step) {
            if (slope <= 0.0)
                break;
            double turned = at.curvature * step;
            return (struct foot){
                s, offset - 0.5 * ahead * turned, at.cos - at.sin * turned, at.sin + at.cos * turned, at.curvature,
            };
        }
    }
    return (struct foot){s, NAN, 1.0, 0.0, 0.0};
}

/* The same of a plan's point: beyond the road's centre of curvature its offset is that across the line at ``near``. */
HDV_INLINE struct foot planned_foot(const struct hdv_curve *curve, double x, double y, double near) {
    struct foot foot = project(curve, x, y, near, PLANNING_STEP_M);
    if (!isnan(foot.offset))
        return foot;
    struct path_point at = evaluate(curve, near);
    double across = (y - at.y) * at.cos - (x - at.x) * at.sin;
    return (struct foot){near, across, at.cos, at.sin, at.curvature};
}

#endif
