/* How states are predicted from a planned curvature, z_next = z + step * F(z, z_next, kappa), and linearised so. */
#ifndef HDVPLAN_DYNAMICS_H
#define HDVPLAN_DYNAMICS_H

#include "hdvplan.h"

/* The rules, in the order of Discretisation in planning/discretisation.py. */
enum { HDV_MIDPOINT, HDV_EULER, HDV_GAUSS };

struct hdv_dynamics {
    int64_t rule;
};

HDV_EXPORT void hdv_advance(
    int64_t rule, const struct hdv_unit *units, int64_t count, double k, double k_between, double step, int64_t n,
    const double *z, double kappa, double *z_next
);

HDV_EXPORT hdv_linearise hdv_linearise_dynamics;
HDV_EXPORT hdv_price hdv_price_dynamics;

#endif
