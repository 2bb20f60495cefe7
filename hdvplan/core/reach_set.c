/* Everything that a rigid vehicle can reach along a road.
 *
 * A station is a normal of the road. Of the vehicle it is known that its rear axle crosses every normal, moving forward
 * along its heading theta, and that theta turns by at most kappa per metre. Between two stations the axle travels a
 * chord in the direction delta. Where theta is alpha at the first and beta at the second, and L is the length
 * travelled, theta lies below both alpha + kappa l and beta + kappa (L - l), so that its mean lies below
 *
 *     (alpha + beta) / 2 + kappa L / 4 (1 - ((beta - alpha) / (kappa L))^2),
 *
 * and above the mirror image; delta differs from the mean by less than the range's cube. The offset at the second
 * normal follows exactly from offset and delta, and rises with both: intervals go to intervals. Cells do not move with
 * the road, so that a vehicle that does not steer stays in its cell: no rounding lets the set turn or creep sideways
 * but for what is said above.
 */
#include "prove.h"

#include <stddef.h>

#define ITERATIONS 40
#define CONVERGED 1e-6 /* [rad] */
#define STEEPEST 1.5   /* where chords get so long, cells reach to WIDEST, and the station counts as unbounded [rad] */
#define MARGIN 0.05    /* from there on what is left counts as unbounded [rad] */
#define WIDEST 1.35    /* a heading off the road's beyond which nothing is bounded [rad] */
#define RIGHT_ANGLE 1.5707963267948966

/* By how much the heading can turn between two stations [rad]: the chord is longer, the steeper, and turns the more,
 * the longer. furthest is the chord's largest length along the new normal's direction [m], off the largest heading off
 * it at the first station, steepest the one that is never passed [rad]. */
double most_turned(double kappa, double furthest, double off, double steepest) {
    double turned = 0.0;
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        double before = turned, steep = smaller(off + turned, steepest);
        turned = kappa * furthest / cos(steep) / cos(smaller(turned, 0.5));
        if (turned - before < CONVERGED)
            break;
    }
    return 1.001 * turned;
}

struct chord_frame chord_at(const struct hdv_frame *frame, int64_t i) {
    double x = frame->x[i] - frame->x[i - 1], y = frame->y[i] - frame->y[i - 1],
           turn = frame->heading[i] - frame->heading[i - 1];
    double cosine = cos(frame->heading[i]), sine = sin(frame->heading[i]);
    return (struct chord_frame){x * cosine + y * sine, y * cosine - x * sine, turn, cos(turn), sin(turn)};
}

/* Write tan of the middle between two cells' right edges, and a bound of its slope around there. */
static void
write_slopes(const struct hdv_grid *grid, double heading, double most, const struct cell_span *span, double *slopes) {
    for (int64_t p = 2 * span->lowest; p < 2 * span->highest; p++) {
        double middle = grid->first + 0.5 * (double)p * grid->size - heading;
        double steepest = tan(smaller(fabs(middle) + most + grid->size, 1.55));
        slopes[2 * p] = tan(middle);
        slopes[2 * p + 1] = 1.0 + steepest * steepest;
    }
}

/* Add what the pieces of cell j lead to in cell k, where the direction's tangent lies between two bounds. */
static void add_pieces(
    const struct chord_frame *chord, const struct hdv_cells *before, int64_t j, struct interval tangent,
    struct hdv_cells *now, int64_t k
) {
    const struct interval *former = before->pieces + j * HDV_FREE_INTERVALS;
    struct interval *pieces = now->pieces + k * HDV_FREE_INTERVALS;
    for (int64_t p = 0; p < before->number[j]; p++) {
        double low = former[p].low, high = former[p].high;
        low = larger(chord->ahead - low * chord->sin, 0.0) * tangent.low + low * chord->cos - chord->across;
        high = larger(chord->ahead - high * chord->sin, 0.0) * tangent.high + high * chord->cos - chord->across;
        if (now->number[k] == 1 && low <= pieces[0].high && high >= pieces[0].low) { /* nearly always one grows */
            pieces[0] = (struct interval){smaller(low, pieces[0].low), larger(high, pieces[0].high)};
        } else {
            now->number[k] = join_interval(pieces, now->number[k], HDV_FREE_INTERVALS, low, high);
        }
    }
}

/* Add what cell j leads to; return how many cells its heading may change by, -1 where normals cross before it. */
static int64_t spread_cell(
    double kappa, const struct hdv_grid *grid, double heading, const struct chord_frame *chord, int64_t j,
    const struct hdv_cells *before, const struct cell_span *span, struct hdv_cells *now, const double *slopes
) {
    const struct interval *former = before->pieces + j * HDV_FREE_INTERVALS;
    double theta = grid->first + (double)j * grid->size - heading; /* of the cell's right edge, off the new normal */
    double most = 2.0 * kappa * chord->ahead + grid->size; /* more than headings change on this side of the centre */
    double lowest = former[0].low, highest = former[before->number[j] - 1].high;
    double furthest = larger(chord->ahead - lowest * chord->sin, chord->ahead - highest * chord->sin);
    if (furthest <= 0.0)
        return -1; /* beyond the centre of curvature */
    double turned = most_turned(kappa, furthest, larger(fabs(theta), fabs(theta + grid->size)), STEEPEST);
    double range = turned + grid->size, cubed = range * range * range / 6.0;
    int64_t cells = whole(ceil(turned / grid->size), 0, INT32_MAX);
    int64_t first = j - cells > span->lowest ? j - cells : span->lowest,
            end = j + cells + 1 < span->highest ? j + cells + 1 : span->highest;
    for (int64_t k = first; k < end; k++) {
        double ratio = (double)(k - j) * grid->size / turned,
               bulge = 0.25 * turned * larger(0.0, 1.0 - ratio * ratio) + cubed;
        double tangent = slopes[2 * (j + k)], slope = bulge > most ? 2000.0 : slopes[2 * (j + k) + 1];
        struct interval bounds = {tangent - slope * bulge, tangent + slope * (grid->size + bulge)};
        add_pieces(chord, before, j, bounds, now, k);
    }
    return cells;
}

/* Write what station i can be reached with from the last one; return how many cells a heading may have changed by. */
HDV_EXPORT int64_t hdv_reach_next(
    double kappa, const struct hdv_frame *frame, const struct hdv_grid *grid, int64_t i, const struct hdv_cells *before,
    const struct cell_span *span, struct hdv_cells *now, double *slopes
) {
    struct chord_frame chord = chord_at(frame, i);
    int64_t furthest = 0;
    for (int64_t j = 0; j < grid->cells; j++)
        now->number[j] = 0;
    write_slopes(grid, frame->heading[i], 2.0 * kappa * chord.ahead + grid->size, span, slopes);
    for (int64_t j = span->begin; j < span->end; j++) {
        int64_t cells = before->number[j] == 0
                            ? -1
                            : spread_cell(kappa, grid, frame->heading[i], &chord, j, before, span, now, slopes);
        furthest = cells > furthest ? cells : furthest;
    }
    return furthest;
}

/* Let cells hold all that the axle's normal allows. */
static void
fill_cells(const struct hdv_grid *grid, struct interval near, const struct cell_span *span, struct hdv_cells *cells) {
    for (int64_t j = 0; j < grid->cells; j++) {
        cells->number[j] = span->lowest <= j && j < span->highest;
        cells->pieces[j * HDV_FREE_INTERVALS] = near;
    }
}

/* Cut all cells down to where the body may fit, make the span what is left, and note the offsets' bounds. */
static void trim_cells(
    const struct hdv_outline *outline, const struct hdv_grid *grid, double heading, const struct hdv_around *around,
    struct hdv_cells *cells, struct cell_span *span, int64_t i, struct hdv_reached *reached
) {
    struct cell_span left = {span->highest, span->lowest, span->lowest, span->highest};
    for (int64_t j = span->lowest; j < span->highest; j++) {
        struct interval *pieces = cells->pieces + j * HDV_FREE_INTERVALS;
        struct loose_pose pose = {grid->first + ((double)j + 0.5) * grid->size - heading, 0.5 * grid->size, 0.0, 0.0};
        cells->number[j] = cells->number[j] > 0 ? trim(outline, pose, around, pieces, cells->number[j]) : 0;
        if (cells->number[j] > 0)
            note_cell(reached, i, j, pieces[0].low, pieces[cells->number[j] - 1].high, &left);
    }
    *span = left;
}

/* Copy what the cells hold at one station. */
static void keep_cells(
    const struct hdv_grid *grid, const struct hdv_cells *cells, const struct cell_span *span, int64_t *keep,
    struct interval *kept
) {
    for (int64_t j = 0; j < grid->cells; j++) {
        keep[j] = span->begin <= j && j < span->end ? cells->number[j] : 0;
        for (int64_t k = 0; k < keep[j]; k++)
            kept[j * HDV_FREE_INTERVALS + k] = cells->pieces[j * HDV_FREE_INTERVALS + k];
    }
}

/* Follow everything that a body can reach from any pose at the first station, until nothing is left. kappa is the
 * largest curvature [1/m], memory two sets of cells and slopes (2 cells, 2). keep (stations, cells) and kept (stations,
 * cells, HDV_FREE_INTERVALS) take the sets; NULL keeps nothing. */
HDV_EXPORT void hdv_reachable(
    const struct hdv_outline *outline, double kappa, const struct hdv_frame *frame, const struct hdv_grid *grid,
    struct hdv_around *around, struct hdv_cells *memory, double *slopes, int64_t *keep, struct interval *kept,
    struct hdv_reached *reached
) {
    struct cell_span span = {0, 0, 0, 0};
    int64_t wide = (int64_t)((WIDEST - MARGIN) / grid->size), cells = 0; /* how many cells a step has reached over */
    reached->empty = reached->open = -1;
    for (int64_t i = 0; i < frame->stations; i++) {
        struct hdv_cells *now = &memory[i % 2];
        struct interval former = around->near;
        around_at(around, frame, i);
        if (is_empty(around->near)) {
            reached->open = i;
            continue;
        }
        int fresh = reached->open == i - 1 || !follows(frame, i, former, around->near);
        double heading = frame->heading[i], widest = fresh ? RIGHT_ANGLE : WIDEST;
        int64_t middle = whole((heading - grid->first) / grid->size, 0, grid->cells);
        span.lowest = whole(floor((heading - widest - grid->first) / grid->size), 0, grid->cells);
        span.highest = whole(ceil((heading + widest - grid->first) / grid->size), 0, grid->cells);
        if (fresh)
            fill_cells(grid, around->near, &span, now);
        else
            cells = hdv_reach_next(kappa, frame, grid, i, &memory[(i + 1) % 2], &span, now, slopes);
        trim_cells(outline, grid, heading, around, now, &span, i, reached);
        if (reached->filled[i] == 0) {
            reached->empty = i;
            return;
        }
        reached->right[i] = grid->first + (double)span.begin * grid->size - heading;
        reached->left[i] = grid->first + (double)span.end * grid->size - heading;
        if (span.begin < middle - wide + cells || span.end > middle + wide - cells)
            reached->open = i; /* it may stand across the road: this station bounds nothing */
        if (keep != NULL)
            keep_cells(grid, now, &span, keep + i * grid->cells, kept + i * grid->cells * HDV_FREE_INTERVALS);
    }
}
