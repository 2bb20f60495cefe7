/* The records of all terms, and of what they share. */
#ifndef HDVPLAN_TERMS_H
#define HDVPLAN_TERMS_H

#include "street.h"

/* The rules, in the order of Discretisation in planning/discretisation.py. */
enum { HDV_MIDPOINT, HDV_EULER, HDV_GAUSS };

struct hdv_dynamics {
    int64_t rule;
};

/* Writes the state a station ahead, wheels held; k and k_between are the road's curvature here and half-way [1/m]. */
HDV_EXPORT void hdv_advance(
    int64_t rule, const struct hdv_unit *units, int64_t count, double k, double k_between, double step, int64_t n,
    const double *z, double kappa, double *z_next
);

/* What is steered: the lead unit's curvature, smoothly, at (kappa_i - kappa_{i-1})^2 ([GEO] eq. 20), then wheels of
 * axles that the plan steers itself, as wanted; with all limits. */
struct hdv_steering {
    int64_t wheels;       /* axles that the plan steers: the last of the vehicle's states */
    const double *aim;    /* (stations, wheels), the wanted angles, left positive [rad] */
    const double *most;   /* (1 + wheels,) [1/m, rad] */
    const double *change; /* (1 + wheels,), largest, from station to station [1/m, rad] */
    double smoothness;    /* weight of the square of a change of curvature [m^2] */
    double angle_weight;  /* of the squared difference from the wanted angle [m^2] */
    double change_weight; /* of the square of an angle's change [m^2] */
};

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

/* Centring: the squared residual (lead e_y + aux e_aux - target)^2 of two axles' offsets ([GEO] eq. 20). */
struct hdv_centring {
    int64_t unit;                  /* whose axle is the auxiliary one */
    double ahead;                  /* where it is, ahead of its unit's axle [m] */
    double beside;                 /* how far ahead of the lead rear axle it is beside the road on a straight [m] */
    const struct hdv_curve *curve; /* what its offset is measured from */
    const struct hdv_residual *residuals; /* (stations,) */
    const double *weights;                /* (N+1,), of the squared residuals */
    struct hdv_centred *memory;           /* by stage, stage 0 at scene->at */
};

/* The functions of the terms that every planner may have. */
HDV_EXPORT hdv_linearise hdv_linearise_dynamics, hdv_linearise_steering, hdv_linearise_centring, hdv_linearise_limits;
HDV_EXPORT hdv_price hdv_price_dynamics, hdv_price_steering, hdv_price_centring, hdv_price_limits;

/* A sampled point of a body's edge. */
struct hdv_edge_point {
    double ahead;     /* of the unit's axle [m] */
    int64_t overhang; /* 1 where it belongs to an overhang */
};

/* The largest reach ([ART] J4, J5). t is a state that the first stage's last input sets and all others keep. */
struct hdv_reach {
    const struct hdv_curve *curve;
    const struct hdv_edge_point *points; /* (units, points), the watched ones */
    int64_t point_count;                 /* of a unit */
    const double *half_widths;           /* (units,), off its unit's axis where a point lies [m] */
    const double *ahead;                 /* (units, points), of the lead rear axle on a straight [m] */
    int64_t state;                       /* t's place among the states */
    int64_t input;                       /* of the input that sets it */
    int64_t row;                         /* the term's first row of a stage */
    double *feet;                        /* (stages, units, points, 2) [m], indexed by scene->at + i */
};

enum { HDV_ROWS_PER_SIDE = HDV_SECTIONS }; /* the tightest contacts to each side that enter the program */
enum { HDV_BETWEEN = 8 };                  /* poses of an interval that are looked at where a body is at a kerb */
#define HDV_CLEAR_M 0.25 /* a body that stays this far inside the street by a safe bound needs no rows */

/* What is known of one side of one body at one stage. */
struct hdv_edge {
    double clear; /* its clearance to all kerbs, the wheels' for overhangs too, or a lower bound of it, when seen [m] */
    double gap;   /* a lower bound of its clearance to the kerbs that it must keep [m] */
    double looked; /* 1 where it was found by looking, 2 where between stations, too; 0 where a bound says it */
    double never;  /* 1 while its rows never bind */
    double moved;  /* a bound of how far any point has moved since it was looked at [m] */
};

/* Limits ([GEO] eq. 9d, [BUS] sec. IV). Memory of stages is indexed by scene->at + i. */
struct hdv_limits {
    const struct hdv_curve *curve;
    const struct hdv_street *street;
    const double *behind;   /* (units,), of every axle behind the lead rear axle on a straight [m] */
    double reach;           /* furthest from the lead axle that any point of a body can be [m] */
    double clearance;       /* to keep from every kerb, beyond what sampling needs [m] */
    int64_t row;            /* the term's first row of a stage */
    int64_t rows;           /* how many it has */
    double *seen;           /* (stages, states + 2), state, and the curvature until it, as a stage was last looked
                               through; how far all bodies are clear there [m], 0 where one has rows */
    struct hdv_edge *edges; /* (stages, units, 2), left and right */
    struct hdv_near *near;  /* what is near the body that is looked at: 0.1 MB, too much for a small stack */
    double violation;       /* deepest breach by the motion that was last linearised at [m]; 0 when all is kept */
};

/* A bound by which all bodies are clear of the kerbs, without looking at them; see screening.c. */
double clear_by_state(const struct hdv_unit *units, int64_t count, const struct hdv_station *at, const double *z);

enum { HDV_TRACING_POINTS = 6 }; /* of a body: front, axle and rear, left and right of each */

struct hdv_tracing_point {
    double ahead;  /* of its unit's axle [m] */
    double left;   /* of its axis [m] */
    int64_t start; /* how many places it lies ahead of the lead rear axle on a straight */
};

/* One point at one stage. */
struct hdv_track {
    double foot;   /* arclength, NaN where there is none [m] */
    double offset; /* [m] */
};

/* What reaches furthest at one place of the road to one side. */
struct hdv_furthest {
    double reach;  /* outwards [m] */
    double slope;  /* of the track or edge that reaches furthest, outwards over s */
    double ahead;  /* of its unit's axle, of the point that reaches furthest [m] */
    int64_t stage; /* station of its stage; -1: driven */
    int64_t unit;
};

/* What is traced, and along which road. */
struct hdv_bodies {
    const struct hdv_unit *units;
    int64_t unit_count;
    const struct hdv_tracing_point *points; /* (units, HDV_TRACING_POINTS) */
    const struct hdv_curve *curve;
    const struct hdv_station *stations; /* of the whole drive */
    int64_t station_count;
    double step; /* [m] */
};

/* Where one plan puts the bodies and their points, and what it reaches. */
struct hdv_tracks {
    struct hdv_pose *poses;   /* (N+1, units) */
    struct hdv_track *points; /* (N+1, units, HDV_TRACING_POINTS) */
};

void trace(
    const struct hdv_bodies *bodies, const struct hdv_pose *poses, int64_t first, int64_t end,
    const struct hdv_tracks *tracks
);
void cover(
    const struct hdv_bodies *bodies, const struct hdv_tracks *tracks, int64_t first, int64_t end,
    struct hdv_furthest *reached
);

/* The balance of the swept envelope: docs/balanced.md. */
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

#endif
