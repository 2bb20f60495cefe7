/* How far the bodies of a vehicle stray from their plan while its driver errs. docs/maths.md, Tracking error, has the
 * equations T1 to T5.
 *
 * Every unit is looked at where its own axle is beside its own planned track. Its axle is ``axle`` metres to the left
 * of that track there, its heading ``heading`` radians off, and its coupling ``offset`` metres to the left of the
 * coupling's planned track; of the lead unit the coupling is the front axle's midpoint, whose offset is the driver's
 * error.
 */
#ifndef HDVPLAN_TRACKING_H
#define HDVPLAN_TRACKING_H

#include "hdvplan.h"
#include "street.h"

enum { HDV_MOST_LEVELS = 512 }; /* of errors that the worst one is sought among */

/* One unit over one interval of a plan, to first order. Intervals are equally long on the front axle's track. */
struct hdv_link {
    double axle_speed;      /* metres of the axle's track a metre of the front axle's */
    double coupling_speed;  /* and of the coupling's */
    double coupling_off;    /* direction of the coupling's track off the body [rad] */
    double axle_off;        /* of the axle's track [rad] */
    double next_off;        /* of the track of the coupling behind [rad] */
    double course;          /* direction of the coupling's track, without jumps [rad] */
    double turning;         /* of the body, a metre of the front axle's track [rad/m] */
    double bend;            /* largest curvature of the axle's track here, without a sign [1/m] */
    double steered;         /* angle that steers the axle by a law: articulation, or that of the front wheels [rad] */
    double by_offset;       /* T1: heading error by the coupling's offset [rad/m] */
    double by_axle;         /* T1: and by the axle's, with its sign changed [rad/m] */
    double next_by_axle;    /* T3: offset of the coupling behind by the axle's */
    double next_by_heading; /* T3: and by the heading error [m/rad] */
    double law_by_axle;     /* T4: change of the wheels' angle by the axle's offset [rad/m] */
    double law_by_heading;  /* T4: by the heading error */
    double law_by_ahead;    /* T4: by the offset of the axle ahead [rad/m] */
    double law_by_turned;   /* T4: by the heading error of the unit ahead */
    double law_by_course;   /* T4: by the direction of the driver's error */
};

/* What one unit strays at most in one interval, and what the first order leaves out there. */
struct hdv_stray {
    double axle, heading; /* [m], [rad] */
    double offset;        /* of its coupling [m] */
    double residual;      /* of that offset, T1 and T3 [m] */
    double bow;           /* T1: what a body askew takes off that offset, signed [m] */
    double drift;         /* of the axle's rate, T2 [m/m] */
    double beyond;        /* of the axle, beyond the first order [m] */
};

/* The most that a unit strays to first order for a metre of the driver's error; INFINITY where nobody has looked. */
struct hdv_gain {
    double axle;       /* [m/m] */
    double heading;    /* [rad/m] */
    double next;       /* of the coupling behind, T3 [m/m] */
    double next_slope; /* and its change from the interval before, a metre of that coupling's track [1/m] */
};

/* A plan, and the errors that are looked at. */
struct hdv_tracked {
    const struct hdv_unit *units;
    const struct hdv_link *links; /* (intervals, count) */
    struct hdv_gain *gains;       /* (intervals, count) */
    struct hdv_stray *strays;     /* (intervals, count) */
    int64_t count, intervals;
    double spacing; /* length of an interval [m] */
    double error;   /* largest lateral error of the front axle E [m] */
    double slope;   /* and its largest rate, E / l [m/m] */
    double rest;    /* of the error: what counts less together is not followed further back */
    int64_t levels; /* steps from -E to E; the error changes by at most one an interval */
};

/* A point of a body near a kerb: to first order it approaches by by_axle * axle + by_heading * heading. */
struct hdv_brush {
    double gap;                 /* between the planned body and the kerb [m] */
    double at;                  /* of the pose on the front axle's track [m] */
    double by_axle, by_heading; /* T5 [1], [m/rad] */
    double second;              /* T5: and by 1 - cos of the heading error [m/rad] */
    double s, x, y;             /* of the place: the line's arclength, and in the plane [m] */
    double ahead;               /* of the body's axle, of its point [m] */
    int64_t unit, piece;
};

/* How far a brush comes at most: error * gain + remainder. */
struct hdv_approach {
    double gain;
    double remainder; /* [m] */
};

/* Poses of a plan, close together. */
struct hdv_posed {
    const struct hdv_pose *poses; /* (count, units) */
    const double *s;              /* (count,), the line's arclengths beside the lead axle [m] */
    const double *front;          /* (count,), the front axle's way until there [m] */
    const double *behind;         /* (units,), axles' distances behind the lead axle on a straight [m] */
    int64_t count;
};

/* Where a unit is in (intervals, count); before the first interval and beyond the last one these hold. */
HDV_INLINE int64_t place_of(const struct hdv_tracked *on, int64_t interval, int64_t unit) {
    int64_t at = interval < 0 ? 0 : interval < on->intervals ? interval : on->intervals - 1;
    return at * on->count + unit;
}

HDV_INLINE const struct hdv_link *link_at(const struct hdv_tracked *on, int64_t interval, int64_t unit) {
    return &on->links[place_of(on, interval, unit)];
}

HDV_INLINE const struct hdv_gain *gain_at(const struct hdv_tracked *on, int64_t interval, int64_t unit) {
    return &on->gains[place_of(on, interval, unit)];
}

#endif
