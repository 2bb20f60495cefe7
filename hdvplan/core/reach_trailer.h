/* Everything that a vehicle with one trailer can reach along a road: for each cell of the leading unit's heading a
 * polygon. */
#ifndef HDVPLAN_REACH_TRAILER_H
#define HDVPLAN_REACH_TRAILER_H

#include "prove.h"

#define HDV_LEADING 0.04 /* cells of the leading heading in which the room that a trailer leaves is tabulated [rad] */

/* Tables over x = theta - W, from first in steps of step [rad]: hdvplan/proof/articulated.py. */
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

/* Follow everything that a vehicle can reach from any pose at the first station, until nothing is left. memory is two
 * sets of polygons; allowed (leading headings in steps of HDV_LEADING, trailer headings in steps of the grid, trailers
 * of them) begins with zeros. */
HDV_EXPORT void hdv_reachable_with_trailer(
    const struct hdv_coupled *pair, double kappa, const struct hdv_frame *frame, const struct hdv_grid *grid,
    struct hdv_around *around, struct hdv_polygons *memory, struct hdv_allowed *allowed, int64_t trailers,
    struct hdv_reached *reached
);

#endif
