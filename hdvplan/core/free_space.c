/* The free space beside a road, for a body whose axle is on one of the road's normals.
 *
 * In the frame of the road's point at an arclength (u ahead, v to the left), the axle lies at (0, e). A body that keeps
 * its heading and is moved along the normal moves in v alone: all its points keep their u. So the free space is wanted
 * as the free intervals of v at every u, and then each point of the body says at once which e it allows.
 *
 * The road is a row of quadrilaterals between neighbouring normals, cut off at the limits; their union, less the
 * obstacles, is free. Over a bin of u a free interval lies between two straight lines, which are moved outwards until
 * they hold every quadrilateral of the bin. Quadrilaterals that are near in the plane, but are not connected with the
 * axle's place through free space, such as the other leg of a hairpin, are left out: a body is connected.
 */
#include <math.h>

#include "numbers.h"
#include "prove.h"

#define SLIVER_M 1e-6 /* what is less wide between two triangles of an obstacle is rounding */

static const struct interval NOTHING = {INFINITY, -INFINITY};

static void widen(struct interval *on, double value) {
    on->low = smaller(on->low, value);
    on->high = larger(on->high, value);
}

/* The road's frame at a station. */
struct axes {
    double x, y, cos, sin;
};

static struct axes axes_at(const struct hdv_frame *frame, int64_t i) {
    return (struct axes){frame->x[i], frame->y[i], cos(frame->heading[i]), sin(frame->heading[i])};
}

/* Write count corners (count, 2) in the road's frame, and their extent ahead. */
static void see(struct axes at, const double *corners, int count, struct hdv_shape_near *seen) {
    seen->extent = NOTHING;
    for (int c = 0; c < count; c++) {
        double x = corners[2 * c] - at.x, y = corners[2 * c + 1] - at.y;
        seen->u[c] = x * at.cos + y * at.sin;
        seen->v[c] = y * at.cos - x * at.sin;
        widen(&seen->extent, seen->u[c]);
    }
}

/* v where the side from corner c of count meets the line of u; only where it does. */
static double meeting(const struct hdv_shape_near *shape, int c, int next, double u) {
    return shape->v[c] + (u - shape->u[c]) / (shape->u[next] - shape->u[c]) * (shape->v[next] - shape->v[c]);
}

static int meets(const struct hdv_shape_near *shape, int c, int next, double u) {
    return (shape->u[c] - u) * (shape->u[next] - u) <= 0.0 && shape->u[c] != shape->u[next];
}

/* Write where a quadrilateral meets the bin from u0 to u1. */
static void meet_bin(struct hdv_shape_near *quad, double u0, double u1) {
    struct interval corners = NOTHING;
    quad->first = quad->last = NOTHING;
    for (int c = 0; c < 4; c++) {
        int next = (c + 1) % 4;
        if (u0 <= quad->u[c] && quad->u[c] <= u1) {
            widen(&corners, quad->v[c]);
        }
        if (meets(quad, c, next, u0)) {
            widen(&quad->first, meeting(quad, c, next, u0));
        }
        if (meets(quad, c, next, u1)) {
            widen(&quad->last, meeting(quad, c, next, u1));
        }
    }
    quad->whole.low = smaller(smaller(corners.low, quad->first.low), quad->last.low);
    quad->whole.high = larger(larger(corners.high, quad->first.high), quad->last.high);
}

static int touches(struct interval one, struct interval other) {
    return one.low <= other.high && one.high >= other.low;
}

/* The slope between two ends of a line over a bin, 0 where one is not known. */
static double slope_of(double first, double last) {
    return fabs(first) < INFINITY && fabs(last) < INFINITY ? (last - first) / HDV_BIN_M : 0.0;
}

/* The lines around all quadrilaterals of a bin that touch one free piece of it. */
static struct hdv_line
line_around(const struct hdv_shape_near *const *met, int64_t found, struct interval piece, double u0, double u1) {
    struct interval first = NOTHING, last = NOTHING;
    for (int64_t f = 0; f < found; f++) {
        if (touches(met[f]->whole, piece)) {
            first = (struct interval){smaller(first.low, met[f]->first.low), larger(first.high, met[f]->first.high)};
            last = (struct interval){smaller(last.low, met[f]->last.low), larger(last.high, met[f]->last.high)};
        }
    }
    struct hdv_line line = {0.0, 0.0, slope_of(first.low, last.low), slope_of(first.high, last.high)};
    line.low = smaller(first.low, last.low - line.of_low * HDV_BIN_M);
    line.high = larger(first.high, last.high - line.of_high * HDV_BIN_M);
    for (int64_t f = 0; f < found; f++) {
        for (int c = 0; touches(met[f]->whole, piece) && c < 4; c++) {
            double u = met[f]->u[c], v = met[f]->v[c];
            if (u0 <= u && u <= u1) {
                line.low = smaller(line.low, v - line.of_low * (u - u0));
                line.high = larger(line.high, v - line.of_high * (u - u0));
            }
        }
    }
    return line;
}

/* All v that a line's interval holds anywhere over its bin. */
static struct interval span_of(struct hdv_line line) {
    return (struct interval){
        smaller(line.low, line.low + HDV_BIN_M * line.of_low), larger(line.high, line.high + HDV_BIN_M * line.of_high)
    };
}

/* Widen one free interval until it holds another. */
static void take_in(struct hdv_line *line, struct hdv_line other) {
    struct interval one = span_of(*line), two = span_of(other);
    *line = (struct hdv_line){smaller(one.low, two.low), larger(one.high, two.high), 0.0, 0.0};
}

/* Write where a triangle, which reaches over all of a bin, meets the bin's first and last line. */
static void meet_lines(struct hdv_shape_near *triangle, double u0, double u1) {
    const double line[2] = {u0, u1};
    struct interval *at[2] = {&triangle->first, &triangle->last};
    for (int end = 0; end < 2; end++) {
        *at[end] = NOTHING;
        for (int c = 0; c < 3; c++) {
            int next = (c + 1) % 3;
            if (triangle->u[c] == triangle->u[next] && triangle->u[c] == line[end]) {
                widen(at[end], triangle->v[c]);
                widen(at[end], triangle->v[next]);
            } else if (meets(triangle, c, next, line[end])) {
                widen(at[end], meeting(triangle, c, next, line[end]));
            }
        }
    }
}

/* Write what is left of one free interval beside a triangle, at most two; return how many. Where lines cross, all that
 * was free stays. */
static int64_t beside_triangle(struct hdv_line line, const struct hdv_shape_near *triangle, struct hdv_line *out) {
    struct interval first = triangle->first, last = triangle->last;
    double low1 = line.low + HDV_BIN_M * line.of_low, high1 = line.high + HDV_BIN_M * line.of_high;
    int64_t number = 0;
    if ((first.high <= line.low && last.high <= low1) || (first.low >= line.high && last.low >= high1)) {
        out[0] = line;
        return 1;
    }
    if (larger(first.low - line.low, last.low - low1) > SLIVER_M) { /* what is free right of the obstacle */
        out[number] = line;
        if (!(first.low > line.high || last.low > high1)) {
            out[number].high = first.low;
            out[number].of_high = (last.low - first.low) / HDV_BIN_M;
        }
        number++;
    }
    if (larger(line.high - first.high, high1 - last.high) > SLIVER_M) {
        out[number] = line;
        if (!(first.high < line.low || last.high < low1)) {
            out[number].low = first.high;
            out[number].of_low = (last.high - first.high) / HDV_BIN_M;
        }
        number++;
    }
    return number;
}

/* Cut a triangle out of a bin's free intervals; return how many are left. */
static int64_t without(struct hdv_line *lines, int64_t kept, struct hdv_shape_near *triangle, double u0, double u1) {
    struct hdv_line out[2 * HDV_FREE_INTERVALS];
    int64_t number = 0;
    meet_lines(triangle, u0, u1);
    for (int64_t p = 0; p < kept; p++) {
        number += beside_triangle(lines[p], triangle, &out[number]);
    }
    while (number > HDV_FREE_INTERVALS) { /* the last two become one */
        take_in(&out[number - 2], out[number - 1]);
        number--;
    }
    for (int64_t p = 0; p < number; p++) {
        lines[p] = out[p];
    }
    return number;
}

/* Write a bin's free intervals without what is not connected with the axle's place; return how many are left.
 * Bins are looked at from the axle outwards: every bin's neighbour nearer to the axle is known. */
static int64_t
connected(const struct hdv_around *around, int64_t region, int64_t b, struct hdv_line *lines, int64_t kept) {
    int64_t middle = around->bins / 2, inner = b < middle ? b + 1 : b - 1, left = 0;
    for (int64_t p = 0; p < kept; p++) {
        struct interval span = span_of(lines[p]);
        int inside = (b == middle || b == middle - 1) && touches(span, around->near);
        if (b != middle && !inside) {
            const struct hdv_line *near = &around->lines[(region * around->bins + inner) * HDV_FREE_INTERVALS];
            for (int64_t q = 0; q < around->free[region * around->bins + inner]; q++) {
                inside = inside || touches(span, span_of(near[q]));
            }
        }
        if (inside) {
            lines[left] = lines[p];
            left++;
        }
    }
    return left;
}

/* Write the free intervals of one bin, of the quadrilaterals and triangles that are near. */
static void fill_bin(struct hdv_around *around, int64_t region, int64_t b, int64_t quads, int64_t triangles) {
    struct hdv_line *lines = &around->lines[(region * around->bins + b) * HDV_FREE_INTERVALS];
    double u0 = (double)(b - around->bins / 2) * HDV_BIN_M, u1 = u0 + HDV_BIN_M;
    struct interval pieces[HDV_FREE_INTERVALS];
    int64_t found = 0, total = 0, kept = 0;
    for (int64_t k = 0; k < quads; k++) {
        struct hdv_shape_near *quad = &around->quads[k];
        if (quad->extent.low <= u1 && quad->extent.high >= u0) {
            meet_bin(quad, u0, u1);
            around->met[found] = quad;
            found++;
            total = join_interval(
                pieces, total, HDV_FREE_INTERVALS, quad->whole.low - HDV_ROUNDING, quad->whole.high + HDV_ROUNDING
            );
        }
    }
    for (; kept < total; kept++) {
        lines[kept] = line_around(around->met, found, pieces[kept], u0, u1);
    }
    for (int64_t k = 0; k < triangles; k++) {
        struct hdv_shape_near *triangle = &around->triangles[k];
        if (triangle->extent.low <= u0 && triangle->extent.high >= u1) {
            kept = without(lines, kept, triangle, u0, u1);
        }
    }
    around->free[region * around->bins + b] = connected(around, region, b, lines, kept);
}

/* Write the triangles of obstacles that are near, in the road's frame; return how many. */
static int64_t see_triangles(struct hdv_around *around, struct axes at) {
    double far = HDV_BIN_M * (double)around->bins;
    int64_t number = 0;
    for (int64_t k = 0; k < around->beside->blocked_count; k++) {
        struct hdv_shape_near *seen = &around->triangles[number];
        struct interval across = NOTHING;
        see(at, around->beside->blocked + 6 * k, 3, seen);
        for (int c = 0; c < 3; c++) {
            widen(&across, seen->v[c]);
        }
        number += seen->extent.high >= -far && seen->extent.low <= far && across.high >= -far && across.low <= far;
    }
    return number;
}

/* The first of rising values that is not below another one. */
static int64_t not_below(const double *values, int64_t count, double value) {
    int64_t low = 0, high = count;
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if (values[middle] < value) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

/* Write between which offsets the axle can stand on its own normal: those of the quadrilaterals around it. */
static void axle_room(struct hdv_around *around, struct axes at, double s) {
    const struct hdv_beside *beside = around->beside;
    int64_t last = beside->quad_count - 1, station = not_below(beside->s, beside->quad_count + 1, s);
    int64_t first = station > 2 ? station - 2 : 0, end = station + 1 < last ? station + 1 : last;
    around->near = NOTHING;
    for (int64_t k = first < last ? first : last; k <= end; k++) {
        for (int c = 0; c < 4; c++) {
            const double *corner = beside->quads + ((beside->quad_count + k) * 4 + c) * 2; /* those of whole bodies */
            widen(&around->near, (corner[1] - at.y) * at.cos - (corner[0] - at.x) * at.sin);
        }
    }
}

/* Write the corners of obstacles that a body can touch, in the road's frame. */
static void see_corners(struct hdv_around *around, struct axes at) {
    around->corners_near = 0;
    for (int64_t n = 0; n < around->beside->corner_count; n++) {
        double x = around->beside->corners[2 * n] - at.x, y = around->beside->corners[2 * n + 1] - at.y;
        double *corner = around->corners + 2 * around->corners_near;
        corner[0] = x * at.cos + y * at.sin;
        corner[1] = y * at.cos - x * at.sin;
        around->corners_near += fabs(corner[0]) <= around->reach;
    }
}

/* Write what lies around station i, as far as bodies within reach of the axle can touch it. */
void around_at(struct hdv_around *around, const struct hdv_frame *frame, int64_t i) {
    const struct hdv_beside *beside = around->beside;
    struct axes at = axes_at(frame, i);
    double looked = 2.5 * around->reach + 10.0;
    int64_t first = not_below(beside->s, beside->quad_count + 1, frame->s[i] - looked) - 1;
    int64_t last = not_below(beside->s, beside->quad_count + 1, frame->s[i] + looked);
    first = first > 0 ? first : 0;
    last = last < beside->quad_count ? last : beside->quad_count;
    axle_room(around, at, frame->s[i]);
    int64_t triangles = see_triangles(around, at), middle = around->bins / 2;
    for (int64_t region = around->two_regions ? 0 : 1; region < 2; region++) {
        for (int64_t k = first; k < last; k++) {
            see(at, beside->quads + (region * beside->quad_count + k) * 8, 4, &around->quads[k - first]);
        }
        for (int64_t away = 0; away < around->bins; away++) { /* middle, middle - 1, middle + 1, ... */
            int64_t b = away % 2 == 0 ? middle + away / 2 : middle - 1 - away / 2;
            if (0 <= b && b < around->bins) {
                fill_bin(around, region, b, last - first, triangles);
            }
        }
    }
    see_corners(around, at);
}
