/* The free space beside a road, for a body whose axle is on one of the road's normals.
 *
 * In the frame of the road's point at an arclength (u ahead, v to the left), the axle lies at (0, e). A body that keeps
 * its heading and is moved along the normal moves in v alone: all its points keep their u. So the free space is wanted
 * as the free intervals of v at every u, and then each point of the body says at once which e it allows.
 *
 * The street is a row of areas between its kerbs, each from one cap to the next, in triangles; their union, less the
 * obstacles, is free. Over a bin of u a free interval lies between two straight lines, which are moved outwards until
 * they hold every triangle of the bin.
 *
 * Of the areas only those around the gate on the normal count (gate.c), and of their union only what is connected with
 * the axle's place through free space, unlike the other leg of a hairpin.
 */
#include "prove.h"

enum { PIECES = 8 * HDV_FREE_INTERVALS }; /* of free space in one bin, before they are joined */

#define SLIVER_M 1e-6 /* what is less wide between two triangles of an obstacle is rounding */

/* Write those of count triangles (count, 3, 2) that reach into the bins in the road's frame; return how many. */
static int64_t
see(const struct hdv_around *around, struct axes at, const double *triangles, int64_t count,
    struct hdv_shape_near *seen) {
    double far = 0.5 * HDV_BIN_M * (double)around->bins;
    int64_t number = 0;
    for (int64_t k = 0; k < count; k++) {
        struct hdv_shape_near *one = &seen[number];
        one->extent = NOTHING;
        for (int c = 0; c < 3; c++) {
            const double *corner = triangles + 2 * (3 * k + c);
            one->u[c] = ahead_of(at, corner);
            one->v[c] = left_of(at, corner);
            widen(&one->extent, one->u[c]);
        }
        number += one->extent.high >= -far && one->extent.low <= far;
    }
    return number;
}

/* Where a triangle meets the line of u. */
static struct interval meet_line(const struct hdv_shape_near *triangle, double u) {
    struct interval met = NOTHING;
    for (int c = 0; c < 3; c++) {
        int next = (c + 1) % 3;
        double here = triangle->u[c], there = triangle->u[next], v = triangle->v[c];
        if ((here - u) * (there - u) <= 0.0 && here != there)
            widen(&met, v + (u - here) / (there - here) * (triangle->v[next] - v));
    }
    return met;
}

/* Write where a triangle meets the bin from u0 to u1. */
static void meet_bin(struct hdv_shape_near *area, double u0, double u1) {
    struct interval corners = NOTHING;
    area->first = meet_line(area, u0);
    area->last = meet_line(area, u1);
    for (int c = 0; c < 3; c++)
        if (u0 <= area->u[c] && area->u[c] <= u1)
            widen(&corners, area->v[c]);
    area->whole.low = smaller(smaller(corners.low, area->first.low), area->last.low);
    area->whole.high = larger(larger(corners.high, area->first.high), area->last.high);
}

/* The slope between two ends of a line over a bin, 0 where one is not known. */
static double slope_of(double first, double last) {
    return fabs(first) < INFINITY && fabs(last) < INFINITY ? (last - first) / HDV_BIN_M : 0.0;
}

/* The lines around all triangles of a bin that touch one free piece of it. */
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
        for (int c = 0; touches(met[f]->whole, piece) && c < 3; c++) {
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

/* Write what is left of a free interval beside a triangle, at most two; return how many. Crossing lines leave it. */
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
    triangle->first = meet_line(triangle, u0);
    triangle->last = meet_line(triangle, u1);
    for (int64_t p = 0; p < kept; p++)
        number += beside_triangle(lines[p], triangle, &out[number]);
    while (number > HDV_FREE_INTERVALS) { /* the last two become one */
        take_in(&out[number - 2], out[number - 1]);
        number--;
    }
    for (int64_t p = 0; p < number; p++)
        lines[p] = out[p];
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
            for (int64_t q = 0; q < around->free[region * around->bins + inner]; q++)
                inside = inside || touches(span, span_of(near[q]));
        }
        if (inside) {
            lines[left] = lines[p];
            left++;
        }
    }
    return left;
}

/* Write the free intervals of one bin, of the areas and obstacles that are near. */
static void fill_bin(struct hdv_around *around, int64_t region, int64_t b, int64_t areas, int64_t triangles) {
    struct hdv_line *lines = &around->lines[(region * around->bins + b) * HDV_FREE_INTERVALS];
    double u0 = (double)(b - around->bins / 2) * HDV_BIN_M, u1 = u0 + HDV_BIN_M;
    struct interval all[PIECES], pieces[HDV_FREE_INTERVALS];
    int64_t found = 0, total = 0, kept = 0;
    for (int64_t k = 0; k < areas; k++) {
        struct hdv_shape_near *area = &around->areas[k];
        if (area->extent.low <= u1 && area->extent.high >= u0) {
            meet_bin(area, u0, u1);
            around->met[found] = area;
            found++;
            total = join_interval(all, total, PIECES, area->whole.low - HDV_ROUNDING, area->whole.high + HDV_ROUNDING);
        }
    }
    total = keep_intervals(all, total, pieces, HDV_FREE_INTERVALS);
    for (; kept < total; kept++)
        lines[kept] = line_around(around->met, found, pieces[kept], u0, u1);
    for (int64_t k = 0; k < triangles; k++) {
        struct hdv_shape_near *triangle = &around->triangles[k];
        if (triangle->extent.low <= u0 && triangle->extent.high >= u1)
            kept = without(lines, kept, triangle, u0, u1);
    }
    around->free[region * around->bins + b] = connected(around, region, b, lines, kept);
}

/* Write the corners that a body can touch, in the road's frame. */
static void see_corners(struct hdv_around *around, struct axes at) {
    around->corners_near = 0;
    for (int64_t n = 0; n < around->beside->corner_count; n++) {
        double *corner = around->corners + 2 * around->corners_near;
        corner[0] = ahead_of(at, around->beside->corners + 2 * n);
        corner[1] = left_of(at, around->beside->corners + 2 * n);
        around->corners_near += fabs(corner[0]) <= around->reach;
    }
}

/* Write what bodies within reach of the axle can touch at station i; where nothing is known, its room is empty. */
void around_at(struct hdv_around *around, const struct hdv_frame *frame, int64_t i) {
    const struct hdv_beside *beside = around->beside;
    struct axes at = {frame->x[i], frame->y[i], cos(frame->heading[i]), sin(frame->heading[i])};
    struct gate gate = gate_at(beside->kerbs, at, frame->s[i]);
    struct areas found = is_empty(gate.v) ? (struct areas){0, 0} : areas_at(around, at, gate);
    int64_t middle = around->bins / 2;
    around->near = found.begin < found.end ? gate.v : NOTHING;
    if (is_empty(around->near))
        return;
    int64_t triangles = see(around, at, beside->blocked, beside->blocked_count, around->triangles);
    for (int64_t region = around->two_regions ? 0 : 1; region < 2; region++) {
        const int64_t *begin = beside->begin + region * beside->stretches;
        int64_t first = begin[found.begin], count = begin[found.end] - first;
        count = see(around, at, beside->areas + 6 * first, count, around->areas);
        for (int64_t away = 0; away < around->bins; away++) { /* middle, middle - 1, middle + 1, ... */
            int64_t b = away % 2 == 0 ? middle + away / 2 : middle - 1 - away / 2;
            if (0 <= b && b < around->bins)
                fill_bin(around, region, b, count, triangles);
        }
    }
    see_corners(around, at);
}
