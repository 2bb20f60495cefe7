/* Centring: the squared residual (lead e_y + aux e_aux - target)^2 of two axles' offsets ([GEO] eq. 20). */
#ifndef HDVPLAN_CENTRING_H
#define HDVPLAN_CENTRING_H

#include "hdvplan.h"

/* Coefficients of the residual at one station. */
struct hdv_residual {
    double lead, aux;
    double target; /* [m] */
};

/* What is known of one stage. */
struct hdv_centred {
    double foot;     /* of the auxiliary axle [m] */
    double residual; /* [m] */
};

struct hdv_centring {
    int64_t unit;                  /* whose axle is the auxiliary one */
    double ahead;                  /* where it is, ahead of its unit's axle [m] */
    double beside;                 /* how far ahead of the lead rear axle it is beside the road on a straight [m] */
    const struct hdv_curve *curve; /* what its offset is measured from */
    const struct hdv_residual *residuals; /* (stations,) */
    const double *weights;                /* (N+1,), of the squared residuals */
    struct hdv_centred *memory;           /* by stage, stage 0 at scene->at */
};

HDV_EXPORT hdv_linearise hdv_linearise_centring;
HDV_EXPORT hdv_price hdv_price_centring;

#endif
