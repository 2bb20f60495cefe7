/* Smooth steering: weight (kappa_i - kappa_{i-1})^2 ([GEO] eq. 20), with the limits of curvature and of its change. */
#ifndef HDVPLAN_SMOOTHNESS_H
#define HDVPLAN_SMOOTHNESS_H

#include "hdvplan.h"

struct hdv_smoothness {
    double weight; /* [m^2] */
    double most;   /* curvature [1/m] */
    double change; /* largest, from station to station [1/m] */
};

HDV_EXPORT hdv_linearise hdv_linearise_smoothness;
HDV_EXPORT hdv_price hdv_price_smoothness;

#endif
