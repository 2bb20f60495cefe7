/* What a plan wants from axles that it steers itself, and what their wheels can do. */
#ifndef HDVPLAN_STEERING_H
#define HDVPLAN_STEERING_H

#include "hdvplan.h"

struct hdv_steering {
    int64_t wheels;       /* axles that the plan steers: the last of the vehicle's states */
    const double *aim;    /* (stations, wheels), the wanted angles, left positive [rad] */
    const double *most;   /* (wheels,), angle [rad] */
    const double *change; /* (wheels,), largest, from station to station [rad] */
    double angle_weight;  /* of the squared difference from the wanted angle [m^2] */
    double change_weight; /* of the square of a change [m^2] */
};

HDV_EXPORT hdv_linearise hdv_linearise_steering;
HDV_EXPORT hdv_price hdv_price_steering;

#endif
