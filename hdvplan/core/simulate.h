/* Drive planned steering exactly: the independent judge of every plan. Nothing of the planner's discretisation or
 * linearisation enters. */
#ifndef HDVPLAN_SIMULATE_H
#define HDVPLAN_SIMULATE_H

#include "hdvplan.h"

/* Drives kappa (intervals,) [1/m] from states[0] at arclength s_start [m], each value held over step metres of road.
 *
 * wheels (intervals + 1, n - 1 - count) are the angles of wheels that the plan steers at the ends of the intervals,
 * which turn evenly [rad]. Writes keep states (n,) of every interval into states (intervals * keep + 1, n), with
 * substeps Runge-Kutta steps from one to the next. Stops where the model leaves its domain: 1 - e_y k <= 0, or the lead
 * rear axle no longer moves forward along the road. */
HDV_EXPORT void hdv_simulate(
    const struct hdv_unit *units, int64_t count, int64_t n, const struct hdv_curve *curve, double s_start,
    int64_t intervals, double step, const double *kappa, const double *wheels, int64_t keep, int64_t substeps,
    double *states
);

/* Writes the states (count_at, n) at arclengths at (count_at,), in ascending order, of a vehicle that was driven from
 * states z (poses, n) at arclengths s (poses,), each with the curvature kappa (poses - 1,) to the next [1/m]. */
HDV_EXPORT void hdv_states_between(
    const struct hdv_unit *units, int64_t count, int64_t n, const struct hdv_curve *curve, int64_t poses,
    const double *s, const double *z, const double *kappa, int64_t count_at, const double *at, double *states
);

#endif
