/* The objective that balances the swept envelope itself: docs/balanced.md has its derivation. */
#ifndef HDVPLAN_BALANCE_H
#define HDVPLAN_BALANCE_H

#include "hdvplan.h"
#include "tracks.h"

/* The term. */
struct hdv_balance {
    struct hdv_bodies bodies;
    const double *aim;        /* (stations,), where the envelope's middle should lie [m] */
    double rounding;          /* an imbalance counts with its square up to about this, with its magnitude beyond [m] */
    double relaxation;        /* of the step that is safe on its own */
    int64_t stages;           /* last stage whose objective is the balance */
    int64_t places;           /* last place, counted from the first stage, that the plan sweeps from end to end */
    int64_t before;           /* places behind the first stage that the vehicle can still sweep */
    void *centring;           /* struct hdv_centring of stages that were not measured yet */
    void *beside;             /* the same, with a share where the plan is measured */
    struct hdv_tracks tracks; /* of the last plan */
    struct hdv_furthest *reached; /* (2, stations), with the plan */
    struct hdv_furthest *driven;  /* (2, stations), without */
    int64_t since;                /* station of the plan that was last measured, driven from there on; -1: none */
    double value;                 /* what the imbalance cost when it was last measured [m^2] */
};

HDV_EXPORT hdv_linearise hdv_linearise_balance;
HDV_EXPORT hdv_price hdv_price_balance;

#endif
