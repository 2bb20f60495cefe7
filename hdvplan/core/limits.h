/* Limits: the rows that keep every body within the road's limits ([GEO] eq. 9d, [BUS] sec. IV; docs/maths.md, Limits).
 */
#ifndef HDVPLAN_LIMITS_H
#define HDVPLAN_LIMITS_H

#include "hdvplan.h"

enum { HDV_ROWS_PER_EDGE = 2 }; /* the tightest places of each edge that enter the program */
#define HDV_CLEAR_M 0.25        /* a body that stays this far inside the limits by a safe bound needs no rows */

/* Signed limits on a uniform grid of arclengths: rows left, right, left_sweep, right_sweep. */
struct hdv_limit_table {
    const double *values; /* (4, count) [m] */
    int64_t count;
    double s_first; /* [m] */
    double spacing; /* [m] */
};

/* A sampled point of a body's edge. */
struct hdv_edge_point {
    double ahead;     /* of the unit's axle [m] */
    int64_t overhang; /* 1 where it belongs to an overhang */
};

/* What is known of one edge of one body at one stage. */
struct hdv_edge {
    double clear;  /* a lower bound of its clearance to all limits, the wheels' for overhangs too [m] */
    double gap;    /* a lower bound of its clearance to the limits that it must keep [m] */
    double looked; /* 1 where that was found by looking at the edge, 0 where a bound says it */
    double never;  /* 1 while the edge's rows never bind */
};

/* The term. Memory of stages is indexed by scene->at + i. */
struct hdv_limits {
    const struct hdv_curve *curve;
    const struct hdv_limit_table *table;
    const struct hdv_edge_point *points; /* (units, HDV_POINTS_PER_EDGE) */
    const double *axis;                  /* (units, HDV_AXIS_POINTS), points that screen a body's axis [m] */
    const double *behind;                /* (units,), of every axle behind the lead rear axle on a straight [m] */
    double reach;                        /* furthest from the lead axle that any point of a body can be [m] */
    double clearance;                    /* to keep from every limit, beyond what sampling needs [m] */
    int64_t row;                         /* the term's first row of a stage */
    int64_t rows;                        /* how many it has */
    double *seen_z;                      /* (stages, states), the state when the stage was last looked at */
    struct hdv_edge *edges;              /* (stages, units, 2), left and right */
    double *axis_feet;                   /* (stages, units, HDV_AXIS_POINTS) [m] */
    double *feet;                        /* (stages, units, HDV_POINTS_PER_EDGE, 2), of the points of both edges [m] */
    double violation; /* deepest breach by the motion that was last linearised at [m]; 0 when all limits are kept */
};

HDV_EXPORT hdv_linearise hdv_linearise_limits;
HDV_EXPORT hdv_price hdv_price_limits;

#endif
