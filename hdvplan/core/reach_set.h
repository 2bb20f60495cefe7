/* Everything that a rigid vehicle can reach along a road: headings in cells, and for each cell intervals of the lateral
 * offset. */
#ifndef HDVPLAN_REACH_SET_H
#define HDVPLAN_REACH_SET_H

#include "prove.h"

/* What cells hold: how many intervals of the offset (cells,), and these (cells, HDV_FREE_INTERVALS) [m]. */
struct hdv_cells {
    int64_t *number;
    struct interval *pieces;
};

/* Follow everything that a body can reach from any pose at the first station, until nothing is left. kappa is the
 * largest curvature [1/m], memory two sets of cells and slopes (2 cells, 2). keep (stations, cells) and kept (stations,
 * cells, HDV_FREE_INTERVALS) take the sets; NULL keeps nothing. */
HDV_EXPORT void hdv_reachable(
    const struct hdv_outline *outline, double kappa, const struct hdv_frame *frame, const struct hdv_grid *grid,
    struct hdv_around *around, struct hdv_cells *memory, double *slopes, int64_t *keep, struct interval *kept,
    struct hdv_reached *reached
);

/* Write what station i can be reached with, from what was reached at the last one; change the span to the cells that
 * may hold anything, and return how many cells a heading may have changed by. */
HDV_EXPORT int64_t hdv_reach_next(
    double kappa, const struct hdv_frame *frame, const struct hdv_grid *grid, int64_t i, const struct hdv_cells *before,
    struct cell_span *span, struct hdv_cells *now, double *slopes
);

#endif
