/* How far a primal-dual point is from optimal. */
#ifndef HDVPLAN_RESIDUALS_H
#define HDVPLAN_RESIDUALS_H

#include "hdvplan.h"

/* A point whose primal residual exceeds this is refused, and not driven [m]. */
#define HDV_USABLE_RESIDUAL 1e-3
/* Bounds this near to each other [m, rad, 1/m]: a point is refused that breaks them by a fortieth of that and more. */
#define HDV_NEAR_BOUNDS 0.04
#define HDV_ONE_BOUND 1e-3 /* nearer ones count as if they were so far from each other */
/* Dual residual beside the largest multiplier, from which a point is no optimum: others have 6e-4, or 1 and more. */
#define HDV_WRONG 1e-2

struct hdv_residuals {
    double primal; /* largest violation of dynamics, rows and bounds [m, rad, 1/m] */
    double dual;   /* largest entry of the Lagrangian's gradient */
    double gap;    /* |complementarity| summed over all inequalities */
};

HDV_EXPORT void
hdv_residuals(const struct hdv_program *program, const struct hdv_point *point, struct hdv_residuals *found);

#endif
