/* Convex polygons with edges in fixed directions, held by their supports h: all points q have d . q <= h for every
 * direction d. */
#ifndef HDVPLAN_POLYGONS_H
#define HDVPLAN_POLYGONS_H

#include "prove.h"

enum { HALF_TURN = HDV_SIDES / 2, QUARTER_TURN = HDV_SIDES / 4 };

struct direction {
    double x, y;
};

void write_directions(struct direction *directions);
void box(const struct direction *directions, struct interval e, struct interval w, double *h);
double support(const struct direction *directions, const double *h, double x, double y);
int tighten(const struct direction *directions, double *h);

#endif
