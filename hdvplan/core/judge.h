/* How near a driven vehicle came to the kerbs of its street: the judge of every plan. */
#ifndef HDVPLAN_JUDGE_H
#define HDVPLAN_JUDGE_H

#include "street.h"

/* The tightest contact of one section of a body with one side's kerbs, while the vehicle moves from a pose to the next.
 */
struct hdv_touch {
    double gap;    /* negative beyond the kerb; infinite where there is none [m] */
    double s;      /* of the kerb there [m] */
    double x, y;   /* of the body's point [m] */
    double ahead;  /* of the body's axle, of that point [m] */
    int64_t piece; /* of the kerb, -1: none */
};

/* Writes touches (poses, count, 2, HDV_SECTIONS) of a vehicle that was driven from states z (poses, n) at arclengths
 * s (poses,), each with the curvature kappa (poses - 1,) to the next [1/m]. */
HDV_EXPORT void hdv_touch_many(
    const struct hdv_street *street, const struct hdv_unit *units, int64_t count, int64_t n,
    const struct hdv_curve *curve, const double *behind, int64_t poses, const double *s, const double *z,
    const double *kappa, struct hdv_touch *touches
);

#endif
