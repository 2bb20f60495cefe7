/* What a plan sweeps: the tracks of the few points that trace the envelope of a moving body, and each place's furthest
 * reach. */
#ifndef HDVPLAN_TRACKS_H
#define HDVPLAN_TRACKS_H

#include "hdvplan.h"

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

#endif
