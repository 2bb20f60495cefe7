/* Bounds by which a body is clear of all limits without looking at its edges. */
#ifndef HDVPLAN_SCREENING_H
#define HDVPLAN_SCREENING_H

#include "hdvplan.h"

/* Lower bounds of a body's clearance left and right [m]; NaN where a point of its axis has no foot. */
struct clearance {
    double left, right;
};

double clear_by_state(const struct hdv_unit *units, int64_t count, const struct hdv_station *at, const double *z);
struct clearance clear_by_axis(
    const struct hdv_unit *unit, const double *axis, const struct hdv_curve *curve, const struct hdv_station *at,
    const struct hdv_pose *pose, double *feet
);

#endif
