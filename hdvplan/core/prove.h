/* Proofs that nothing fits: what bodies can reach at all in the free space beside a road. docs/proof.md has the
 * reasoning.
 *
 * Every rounding goes outwards: what is called occupied is occupied, and what is called out of reach is out of reach.
 */
#ifndef HDVPLAN_PROVE_H
#define HDVPLAN_PROVE_H

#include <math.h>

#include "numbers.h"
#include "street.h"

enum { HDV_FREE_INTERVALS = 6, HDV_SIDES = 16 }; /* free intervals stored for one place; sides of a polygon */
#define HDV_BIN_M 0.1                            /* of u, ahead of the axle */
#define HDV_ROUNDING 1e-9                        /* of coordinates [m] */

/* Intervals in arrays are disjoint and rise; where there are too many, some are joined: what is wider is safe. */
struct interval {
    double low, high;
};

static const struct interval NOTHING = {INFINITY, -INFINITY};

/* The street along a stretch of road in the plane: a row of areas between its kerbs, each from one cap to the next. */
struct hdv_beside {
    const double *areas;            /* (begin[2 stretches], 3, 2), triangles of the areas [m] */
    const int64_t *begin;           /* (2 stretches + 1,), the first triangle of every area: for wheels, for bodies */
    const double *caps;             /* (2, stretches + 1, 2, 2), where caps end on the left and on the right kerb [m] */
    const struct hdv_street *kerbs; /* those of bodies */
    const double *blocked;          /* (blocked_count, 3, 2), triangles of obstacles [m] */
    const double *corners; /* (corner_count, 2), of obstacles, and of kerbs that protrude into the street [m] */
    double first, stretch; /* the line's arclength at the first cap, and from cap to cap [m] */
    int64_t stretches, blocked_count, corner_count;
};

/* The road's points at the stations of a proof. */
struct hdv_frame {
    const double *s, *x, *y; /* (stations,) [m] */
    const double *heading;   /* (stations,), unwrapped [rad] */
    int64_t stations;
};

/* Points of one body that must lie in free space. */
struct hdv_outline {
    const double *points;  /* (point_count, 2), ahead of its point of reference and left of its middle [m] */
    const int64_t *region; /* (point_count,) 0: the drivable one, 1: the one for overhangs */
    int64_t point_count;
    double rear, front, half; /* of the body, ahead of the point of reference, and half its width [m] */
    double reach;             /* of the furthest point [m] */
};

/* A free interval of v over a bin of u: between two straight lines, at the bin's first u, and their slopes. */
struct hdv_line {
    double low, high;       /* [m] */
    double of_low, of_high; /* slopes */
};

/* A triangle in the road's frame; where it meets a bin: all of it, its first line, its last. Empty ones are infinite.
 */
struct hdv_shape_near {
    double u[3], v[3];
    struct interval extent; /* of u */
    struct interval whole, first, last;
};

/* What lies around a leading axle on one of the road's normals, in the road's frame there (u ahead, v to the left). */
struct hdv_around {
    const struct hdv_beside *beside;
    double reach;           /* of the bodies, from the axle [m] */
    int64_t two_regions;    /* 1: wheels have less room than bodies */
    int64_t bins;           /* of u: bin n begins at (n - bins / 2) HDV_BIN_M */
    int64_t *free;          /* (2, bins), how many intervals a bin has, by regions */
    struct hdv_line *lines; /* (2, bins, HDV_FREE_INTERVALS) */
    double *corners;        /* (corner_count, 2), those near by; corners_near of them */
    int64_t corners_near;
    struct interval near; /* offsets between which the axle crosses the normal [m]; empty where nothing is known */
    struct hdv_shape_near *areas;      /* (begin[2 stretches],) memory */
    struct hdv_shape_near *triangles;  /* (blocked_count,) memory */
    const struct hdv_shape_near **met; /* (begin[2 stretches],) memory: the triangles that meet one bin */
};

/* A body's poses in the road's frame but for its offset e: its heading is turned off the road's within spread, its
 * point of reference lies at (u, e) within give. */
struct loose_pose {
    double turned, spread; /* [rad] */
    double u, give;        /* [m] */
};

/* Cells of the heading: cell j holds first + j size <= theta < first + (j + 1) size. */
struct hdv_grid {
    double first, size; /* [rad] */
    int64_t cells;
};

/* Cells from begin to before end that may hold anything, of those from lowest to before highest that are followed. */
struct cell_span {
    int64_t begin, end, lowest, highest;
};

/* The road's frame at a station. */
struct axes {
    double x, y, cos, sin;
};

/* Where the axle crosses a normal: how far left, and which stretch of line the ends belong to. */
struct gate {
    struct interval v, s;
};

/* Areas from begin to before end. */
struct areas {
    int64_t begin, end;
};

/* What was reached at every station, arrays (stations,). */
struct hdv_reached {
    int64_t empty;        /* the first station with nothing, or -1 */
    int64_t open;         /* the last that bounds nothing, or -1 */
    double *low, *high;   /* of the offset [m] */
    double *right, *left; /* of the heading off the road's [rad] */
    int64_t *filled;      /* cells */
};

/* A road's normal at a station, seen from the one before. */
struct chord_frame {
    double ahead, across; /* of the new point, along the new normal's direction and across it [m] */
    double turn;          /* of the heading [rad] */
    double cos, sin;      /* of the turn */
};

/* What cells hold: how many intervals of the offset (cells,), and these (cells, HDV_FREE_INTERVALS) [m]. */
struct hdv_cells {
    int64_t *number;
    struct interval *pieces;
};

#define HDV_LEADING 0.04 /* cells of |leading heading| in which the room that a trailer leaves is tabulated [rad] */

/* Tables over x = theta - W, from first in steps of step [rad]: hdvplan/proof/reach.py. */
struct hdv_coupling {
    double hitch_offset; /* of the leading unit [m] */
    double offset_share; /* |hitch offset| / wheelbase */
    double first, step;  /* [rad] */
    const double *angle; /* (entries,), articulation angle [rad] */
    const double *rate;  /* (entries,), of W [1/m] */
    int64_t entries;
};

/* A leading unit and its trailer, whose outline is seen from the coupling. */
struct hdv_coupled {
    const struct hdv_outline *lead;
    const struct hdv_outline *trailer;
    const struct hdv_coupling *coupling;
};

/* What cells hold: whether anything (cells,), and the supports of its polygon (cells, HDV_SIDES) [m]. */
struct hdv_polygons {
    int64_t *full;
    double *h;
};

/* Between which offsets the coupling can lie, and the station for which that was found (from 1). */
struct hdv_allowed {
    double low, high; /* [m] */
    double station;
};

/* Convex polygons with edges in fixed directions, held by their supports h: d . q <= h for points q, directions d. */
enum { HALF_TURN = HDV_SIDES / 2, QUARTER_TURN = HDV_SIDES / 4 };

struct direction {
    double x, y;
};

void write_directions(struct direction *directions);
void box(const struct direction *directions, struct interval e, struct interval w, double *h);
double support(const struct direction *directions, const double *h, double x, double y);
int tighten(const struct direction *directions, double *h);

HDV_INLINE int is_empty(struct interval one) {
    return one.low > one.high;
}

HDV_INLINE void widen(struct interval *on, double value) {
    on->low = smaller(on->low, value);
    on->high = larger(on->high, value);
}

HDV_INLINE int touches(struct interval one, struct interval other) {
    return one.low <= other.high && one.high >= other.low;
}

HDV_INLINE double ahead_of(struct axes at, const double *point) {
    return (point[0] - at.x) * at.cos + (point[1] - at.y) * at.sin;
}

HDV_INLINE double left_of(struct axes at, const double *point) {
    return (point[1] - at.y) * at.cos - (point[0] - at.x) * at.sin;
}

/* Note that cell j holds something between two offsets at station i, and is left. */
HDV_INLINE void
note_cell(struct hdv_reached *reached, int64_t i, int64_t j, double low, double high, struct cell_span *left) {
    left->begin = j < left->begin ? j : left->begin;
    left->end = j + 1;
    reached->low[i] = reached->filled[i] > 0 ? smaller(low, reached->low[i]) : low;
    reached->high[i] = reached->filled[i] > 0 ? larger(high, reached->high[i]) : high;
    reached->filled[i]++;
}

int64_t join_interval(struct interval *pieces, int64_t total, int64_t most, double low, double high);
int64_t keep_intervals(struct interval *found, int64_t number, struct interval *pieces, int64_t most);
struct gate gate_at(const struct hdv_street *kerbs, struct axes at, double s);
struct areas areas_at(const struct hdv_around *around, struct axes at, struct gate gate);
int follows(const struct hdv_frame *frame, int64_t i, struct interval former, struct interval near);
void around_at(struct hdv_around *around, const struct hdv_frame *frame, int64_t i);
int64_t trim(
    const struct hdv_outline *outline, struct loose_pose pose, const struct hdv_around *around, struct interval *pieces,
    int64_t number
);
struct chord_frame chord_at(const struct hdv_frame *frame, int64_t i);
double most_turned(double kappa, double furthest, double off, double steepest);

#endif
