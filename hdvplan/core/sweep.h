/* The swept envelope: how far left and right of the road's centre every body reaches at each arclength, as executed. */
#ifndef HDVPLAN_SWEEP_H
#define HDVPLAN_SWEEP_H

#include "hdvplan.h"

/* The foot of an outline's point on the road: at this pose, and where it was at the two before. */
struct track {
    double s, offset; /* [m] */
    double s_before, offset_before;
    double s_earlier;
};

/* Writes the lowest and highest offset of every unit at stations s_first, s_first + spacing, ... into low and high
 * (count, stations), which come in as infinity and minus infinity [m].
 *
 * A vehicle of count units was in states z (poses, n) at arclengths s (poses,). outlines (count, points, 2) are ahead
 * of a unit's axle and left of its axis; tracks (count, points) is memory, zero at first. */
HDV_EXPORT void hdv_sweep(
    const struct hdv_unit *units, int64_t count, int64_t n, const struct hdv_curve *curve, int64_t poses,
    const double *s, const double *z, int64_t points, const double *outlines, struct track *tracks, int64_t stations,
    double s_first, double spacing, double *low, double *high
);

#endif
