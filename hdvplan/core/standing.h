/* Where the vehicle stands and turns about, between two legs of a drive: it turns its wheels, and moves no further. */
#ifndef HDVPLAN_STANDING_H
#define HDVPLAN_STANDING_H

#include <math.h>

#include "hdvplan.h"

static const double STANDING_COST = 1e-3; /* share of a change's cost while standing: none would leave it undecided */

/* Whether the vehicle does not move from a station to the next. */
HDV_INLINE int stands(const struct hdv_station *at) {
    return at->step == 0.0;
}

/* How much something steered may change from a station to the next, of which change is the most over step metres and
 * most what it reaches to either side: all of that while the vehicle stands. */
HDV_INLINE double change_from(const struct hdv_station *at, double step, double change, double most) {
    return stands(at) ? 2.0 * most : change * (fabs(at->step) / step);
}

/* What a squared change from a station to the next costs, where it has a weight. */
HDV_INLINE double change_weight(const struct hdv_station *at, double weight) {
    return stands(at) ? STANDING_COST * weight : weight;
}

#endif
