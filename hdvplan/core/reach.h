/* The largest reach as an objective: an epigraph variable t >= |offset| of every watched point at every stage ([ART]
 * J4, J5). */
#ifndef HDVPLAN_REACH_H
#define HDVPLAN_REACH_H

#include "hdvplan.h"

/* A sampled point of a body's edge. */
struct hdv_edge_point {
    double ahead;     /* of the unit's axle [m] */
    int64_t overhang; /* 1 where it belongs to an overhang */
};

/* The term. t is one state more, which the first stage's last input sets and all others keep. */
struct hdv_reach {
    const struct hdv_curve *curve;
    const struct hdv_edge_point *points; /* (units, points), the watched ones */
    int64_t point_count;                 /* of a unit */
    const double *half_widths;           /* (units,), off its unit's axis where a point lies [m] */
    const double *ahead;                 /* (units, points), of the lead rear axle on a straight [m] */
    int64_t state;                       /* t's place among the states */
    int64_t input;                       /* of the input that sets it */
    int64_t row;                         /* the term's first row of a stage */
    double *feet;                        /* (stages, units, points, 2) [m], indexed by scene->at + i */
};

HDV_EXPORT hdv_linearise hdv_linearise_reach;
HDV_EXPORT hdv_price hdv_price_reach;

#endif
