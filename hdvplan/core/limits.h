/* Limits: the rows that keep every body within the street ([GEO] eq. 9d, [BUS] sec. IV; docs/maths.md, Limits). */
#ifndef HDVPLAN_LIMITS_H
#define HDVPLAN_LIMITS_H

#include "street.h"

enum {
    HDV_ROWS_PER_SIDE = HDV_SECTIONS, /* the tightest contacts to each side that enter the program */
    HDV_BETWEEN = 8
}; /* poses of an interval that are looked at where a body is at a kerb */
#define HDV_CLEAR_M 0.25 /* a body that stays this far inside the street by a safe bound needs no rows */

/* What is known of one side of one body at one stage. */
struct hdv_edge {
    double clear; /* its clearance to all kerbs, the wheels' for overhangs too, or a lower bound of it, when seen [m] */
    double gap;   /* a lower bound of its clearance to the kerbs that it must keep [m] */
    double looked; /* 1 where it was found by looking at the body, 2 where between stations, too; 0 where a bound says
                      it */
    double never;  /* 1 while its rows never bind */
    double moved;  /* a bound of how far any point has moved since it was looked at [m] */
};

/* The term. Memory of stages is indexed by scene->at + i. */
struct hdv_limits {
    const struct hdv_curve *curve;
    const struct hdv_street *street;
    const double *behind;   /* (units,), of every axle behind the lead rear axle on a straight [m] */
    double reach;           /* furthest from the lead axle that any point of a body can be [m] */
    double clearance;       /* to keep from every kerb, beyond what sampling needs [m] */
    int64_t row;            /* the term's first row of a stage */
    int64_t rows;           /* how many it has */
    double *seen;           /* (stages, states + 1), state, and the curvature until it, at the last linearisation */
    struct hdv_edge *edges; /* (stages, units, 2), left and right */
    double violation;       /* deepest breach by the motion that was last linearised at [m]; 0 when all is kept */
};

HDV_EXPORT hdv_linearise hdv_linearise_limits;
HDV_EXPORT hdv_price hdv_price_limits;

#endif
