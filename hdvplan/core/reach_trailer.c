/* Everything that a vehicle with one trailer can reach along a road.
 *
 * The polygon of a cell holds the offset e of the leading axle and the trailer's W (hdvplan/proof/reach.py), as
 * SCALE W. Between two stations e and W follow an affine map, but for errors that are added to the supports; the
 * polygons that lead to a cell are joined by the largest of their supports. Stations, cells, and what is known of the
 * heading in between are those of a rigid vehicle, see reach_set.c.
 */
#include "prove.h"

#define SCALE 8.0    /* of W: about the length over which a trailer turns [m] */
#define SIDEWAYS 1.3 /* off the road: no leading unit is said to stand across it by more than 74 degrees [rad] */
#define STRIPS 24.0  /* of W looked at one by one: a polygon that is wide is far from empty */
#define HALF_CIRCLE 3.141592653589793

/* What stays the same while a vehicle is followed. */
struct follow {
    const struct hdv_coupled *pair;
    const struct hdv_frame *frame;
    const struct hdv_grid *grid;
    const struct hdv_around *around;
    struct hdv_allowed *allowed;
    int64_t trailers;
    double kappa; /* [1/m] */
    struct direction directions[HDV_SIDES];
};

/* A straight line through the rate of W between two x: slope x + constant within rough. */
struct straight {
    double slope, constant, rough;
};

static struct straight straight_between(const struct hdv_coupling *coupling, double x_low, double x_high) {
    int64_t most = coupling->entries - 1;
    int64_t a = whole((x_low - coupling->first) / coupling->step, 0, most - 1);
    int64_t b = whole((x_high - coupling->first) / coupling->step, 0, most) + 1;
    b = b > a + 1 ? b : a + 1;
    b = b < most ? b : most;
    double slope = (coupling->rate[b] - coupling->rate[a]) / ((double)(b - a) * coupling->step);
    struct interval over = {INFINITY, -INFINITY};
    for (int64_t n = a; n <= b; n++) {
        double rest = coupling->rate[n] - slope * (coupling->first + (double)n * coupling->step);
        over = (struct interval){smaller(over.low, rest), larger(over.high, rest)};
    }
    return (struct straight){
        slope, 0.5 * (over.low + over.high), 0.5 * (over.high - over.low) + 1e-7
    }; /* between the table's entries */
}

/* The middle and half of an interval. */
struct around_middle {
    double middle, half;
};

static struct around_middle middle_of(double low, double high) {
    return (struct around_middle){0.5 * (low + high), 0.5 * (high - low)};
}

/* What one cell's polygon leads to at the next station: the part of the map that is the same for all headings there. */
struct source {
    struct chord_frame chord;
    struct around_middle e, w; /* of the polygon: offset [m] and W [rad] */
    double theta;              /* of the cell's right edge, off the new normal's direction [rad] */
    double absolute;           /* of the same [rad] */
    double furthest;           /* largest length of the chord along the new normal's direction [m] */
    double turned;             /* by how much the heading can turn [rad] */
    struct straight line;      /* the rate of W over all x that are met */
    double advance;            /* of the middle, along the new normal's direction [m] */
    double tan, sec;           /* of the middle heading */
    double rate;               /* of W there [1/m] */
    double shortened;          /* length of the chord, less what W's change takes from the rate [m] */
    double base[HDV_SIDES];    /* supports of the mapped polygon, about its middle */
};

/* Write the source of cell j; 0 where the normals cross before it. */
static int source_of(const struct follow *follow, int64_t i, int64_t j, const double *h, struct source *from) {
    const struct hdv_grid *grid = follow->grid;
    double e_low = -h[HALF_TURN], e_high = h[0], w_low = -h[HALF_TURN + QUARTER_TURN] / SCALE,
           w_high = h[QUARTER_TURN] / SCALE;
    from->chord = chord_at(follow->frame, i);
    from->e = middle_of(e_low, e_high);
    from->w = middle_of(w_low, w_high);
    from->absolute = grid->first + (double)j * grid->size;
    from->theta = from->absolute - follow->frame->heading[i];
    from->furthest = larger(from->chord.ahead - e_low * from->chord.sin, from->chord.ahead - e_high * from->chord.sin);
    if (from->furthest <= 0.0)
        return 0; /* beyond the centre of curvature */
    double off = larger(fabs(from->theta), fabs(from->theta + grid->size)),
           steepest = SIDEWAYS + fabs(from->chord.turn) + grid->size;
    from->turned = most_turned(follow->kappa, from->furthest, off, steepest);
    double x_low = from->absolute - from->turned - w_high, x_high = from->absolute + grid->size + from->turned - w_low;
    from->line = straight_between(follow->pair->coupling, x_low, x_high);
    from->advance = from->chord.ahead - from->e.middle * from->chord.sin;
    double centre = from->theta + 0.5 * grid->size, slope = from->line.slope;
    from->tan = tan(centre);
    from->sec = 1.0 / cos(centre);
    double length = from->advance * from->sec;
    from->shortened = length - 0.5 * slope * length * length;
    from->rate = from->line.constant + slope * (from->absolute + 0.5 * grid->size - from->w.middle);
    double of_e = from->chord.cos - from->chord.sin * from->tan, w_of_e = -from->chord.sin * from->sec * from->rate;
    double w_of_w = 1.0 - from->shortened * slope;
    for (int d = 0; d < HDV_SIDES; d++) {
        double x = of_e * follow->directions[d].x + SCALE * w_of_e * follow->directions[d].y,
               y = w_of_w * follow->directions[d].y;
        from->base[d] = support(follow->directions, h, x, y) - x * from->e.middle - y * SCALE * from->w.middle;
    }
    return 1;
}

/* Tangent and secant of all directions of a chord between two headings. */
struct directions_met {
    struct around_middle tan, sec;
};

static struct directions_met directions_of(double low, double high, double turned) {
    double tan_low = tan(low), tan_high = tan(high), steepest = larger(fabs(tan_low), fabs(tan_high));
    double flattest = tan_low <= 0.0 && 0.0 <= tan_high ? 0.0 : smaller(fabs(tan_low), fabs(tan_high));
    double sec_low = sqrt(1.0 + flattest * flattest),
           sec_high = sqrt(1.0 + steepest * steepest) * (1.0 + turned * turned);
    return (struct directions_met){middle_of(tan_low, tan_high), middle_of(sec_low, sec_high)};
}

/* Where a polygon's middle is mapped to, and by how much the map may err there. */
struct target {
    double e, w;         /* [m], [rad] */
    double err_e, err_w; /* [m], [rad] */
};

/* The errors of e: the range of tan(delta), of headings in the cells and between the stations, over the longest way;
 * that the linear part is that of the cell. Of W: mean heading and secant; the chord's angle, and that the way is
 * longer than the chord; that it is shorter on the inside; that the linear part is that of the cell; what is beyond the
 * second order of the step. */
static struct target target_of(const struct source *from, const struct hdv_grid *grid, int64_t cells_on) {
    double ratio = (double)cells_on * grid->size / from->turned, range = from->turned + grid->size,
           slope = from->line.slope;
    double bulge = 0.25 * from->turned * larger(0.0, 1.0 - ratio * ratio) + range * range * range / 6.0;
    double off = from->theta + 0.5 * (double)cells_on * grid->size, sine = fabs(from->chord.sin);
    struct directions_met met = directions_of(off - bulge, off + grid->size + bulge, from->turned);
    double sec = met.sec.middle, length = from->advance * sec, shortened = length - 0.5 * slope * length * length;
    double mean = from->absolute + 0.5 * (double)cells_on * grid->size + 0.5 * grid->size;
    double rate = from->line.constant + slope * (mean - from->w.middle), longest = from->furthest * from->sec * 1.1;
    double fastest = fabs(rate) + fabs(slope) * (from->w.half + bulge + 0.5 * grid->size) + from->line.rough;
    struct target to = {
        from->advance * met.tan.middle + from->e.middle * from->chord.cos - from->chord.across,
        from->w.middle + shortened * rate, 0.0, 0.0
    };
    to.err_e = from->furthest * met.tan.half + sine * fabs(met.tan.middle - from->tan) * from->e.half;
    double by_e =
        fabs(sec * rate - from->sec * from->rate) + sec * fabs(slope) * from->w.half + fabs(slope) * longest * fastest;
    to.err_w = longest * (fabs(slope) * (0.5 * grid->size + bulge) + from->line.rough) +
               from->furthest * met.sec.half * fastest + sine * from->e.half * by_e +
               fabs(shortened - from->shortened) * fabs(slope) * from->w.half +
               (slope * longest) * (slope * longest) * (range + longest * fastest);
    return to;
}

/* Join the polygon that cell j leads to into that of a cell so many cells further. */
static void
join_polygon(const struct follow *follow, const struct source *from, int64_t cells_on, int64_t *full, double *h) {
    struct target to = target_of(from, follow->grid, cells_on);
    for (int d = 0; d < HDV_SIDES; d++) {
        double x = follow->directions[d].x, y = follow->directions[d].y * SCALE;
        double value = from->base[d] + x * to.e + y * to.w + fabs(x) * to.err_e + fabs(y) * to.err_w + HDV_ROUNDING;
        h[d] = *full ? larger(h[d], value) : value;
    }
    *full = 1;
}

/* Write what station i can be reached with, from what was reached at the last one. */
static void reach_next(
    const struct follow *follow, int64_t i, const struct hdv_polygons *before, const struct cell_span *span,
    struct hdv_polygons *now
) {
    const struct hdv_grid *grid = follow->grid;
    for (int64_t j = 0; j < grid->cells; j++)
        now->full[j] = 0;
    for (int64_t j = span->begin; j < span->end; j++) {
        struct source from;
        if (!before->full[j] || !source_of(follow, i, j, before->h + j * HDV_SIDES, &from))
            continue;
        int64_t cells = whole(ceil(from.turned / grid->size), 0, INT32_MAX);
        int64_t low = j - cells > span->lowest ? j - cells : span->lowest;
        int64_t high = j + cells + 1 < span->highest ? j + cells + 1 : span->highest;
        for (int64_t k = low; k < high; k++)
            join_polygon(follow, &from, k - j, &now->full[k], now->h + k * HDV_SIDES);
    }
}

/* Between which offsets the coupling can lie, when the trailer's heading is within spread of heading off the road's.
 * The leading unit's heading only turns how far ahead and aside the coupling lies: what was found is kept. */
static struct interval
trailer_room(const struct follow *follow, double turned, double heading, double spread, int64_t i) {
    const struct hdv_around *around = follow->around;
    double offset = follow->pair->coupling->hitch_offset, strip = follow->grid->size, reach = fabs(offset),
           station = (double)(i + 1);
    int64_t leading = (int64_t)(fabs(turned) / HDV_LEADING);
    double middle = ((double)leading + 0.5) * HDV_LEADING, u = -offset * cos(middle);
    double give = reach * (sin(middle) + 0.5 * HDV_LEADING) * 0.5 * HDV_LEADING;
    int64_t first = whole((heading - spread + HALF_CIRCLE) / strip, 0, follow->trailers);
    int64_t last = whole((heading + spread + HALF_CIRCLE) / strip, -1, follow->trailers - 1);
    struct interval found = {INFINITY, -INFINITY};
    for (int64_t c = first; c <= last; c++) {
        struct hdv_allowed *own = &follow->allowed[leading * follow->trailers + c];
        if (own->station != station) {
            struct interval pieces[HDV_FREE_INTERVALS] = {{around->near.low - reach, around->near.high + reach}};
            struct loose_pose pose = {((double)c + 0.5) * strip - HALF_CIRCLE, 0.5 * strip, u, give};
            int64_t number = trim(follow->pair->trailer, pose, around, pieces, 1);
            double low = number > 0 ? pieces[0].low : INFINITY, high = number > 0 ? pieces[number - 1].high : -INFINITY;
            *own = (struct hdv_allowed){low, high, station};
        }
        found = (struct interval){smaller(found.low, own->low), larger(found.high, own->high)};
    }
    return found;
}

/* Between which e a polygon lies where a <= SCALE W <= b. */
static struct interval within_strip(const struct direction *directions, const double *h, double a, double b) {
    struct interval e = {-INFINITY, INFINITY};
    for (int d = 0; d < HDV_SIDES; d++) {
        double x = directions[d].x, y = directions[d].y;
        if (x > HDV_ROUNDING)
            e.high = smaller(e.high, larger((h[d] - y * a) / x, (h[d] - y * b) / x));
        else if (x < -HDV_ROUNDING)
            e.low = larger(e.low, smaller((h[d] - y * a) / x, (h[d] - y * b) / x));
    }
    return e;
}

/* The articulation angle at x = theta - W [rad]: linear between the table's entries, held beyond them. */
static double articulation_at(const struct hdv_coupling *coupling, double x) {
    double at = (x - coupling->first) / coupling->step;
    int64_t entry = whole(at, 0, coupling->entries - 2);
    double over = smaller(larger(at - (double)entry, 0.0), 1.0);
    return coupling->angle[entry] + over * (coupling->angle[entry + 1] - coupling->angle[entry]);
}

/* Cut a polygon down to where the leading body may fit; return 0 where nothing is left. */
static int trim_lead(const struct follow *follow, double turned, double *h) {
    struct interval pieces[HDV_FREE_INTERVALS] = {{-h[HALF_TURN], h[0]}};
    struct loose_pose pose = {turned, 0.5 * follow->grid->size, 0.0, 0.0};
    int64_t number = trim(follow->pair->lead, pose, follow->around, pieces, 1);
    if (number == 0)
        return 0;
    h[HALF_TURN] = -pieces[0].low;
    h[0] = pieces[number - 1].high;
    return tighten(follow->directions, h);
}

/* Cut a polygon down to where the trailer may fit, strip by strip of W; return 0 where nothing is left. */
static int trim_trailer(const struct follow *follow, int64_t i, double turned, double *h) {
    const struct hdv_coupling *coupling = follow->pair->coupling;
    double size = follow->grid->size, theta = follow->frame->heading[i] + turned, kept[HDV_SIDES];
    double aside = coupling->hitch_offset * sin(turned),
           give = 0.5 * fabs(coupling->hitch_offset) * size; /* of the axle from the coupling */
    double w_low = -h[HALF_TURN + QUARTER_TURN] / SCALE, w_high = h[QUARTER_TURN] / SCALE;
    double strips = smaller(larger(1.0, ceil((w_high - w_low) / size)), STRIPS), width = (w_high - w_low) / strips;
    double spread = 0.5 * (width * (1.0 + coupling->offset_share) + coupling->offset_share * size) + 1e-6;
    int anything = 0;
    for (int d = 0; d < HDV_SIDES; d++)
        kept[d] = -INFINITY;
    for (double n = 0.0; n < strips; n += 1.0) {
        double a = SCALE * (w_low + n * width), b = SCALE * (w_low + (n + 1.0) * width);
        struct interval e = within_strip(follow->directions, h, a, b);
        if (e.low > e.high)
            continue;
        double gamma = articulation_at(coupling, theta - 0.5 * (a + b) / SCALE);
        struct interval room = trailer_room(follow, turned, turned - gamma, spread, i);
        e = (struct interval){larger(e.low, room.low + aside - give), smaller(e.high, room.high + aside + give)};
        if (e.low > e.high)
            continue;
        anything = 1;
        double strip[HDV_SIDES];
        box(follow->directions, e, (struct interval){a, b}, strip);
        for (int d = 0; d < HDV_SIDES; d++)
            kept[d] = larger(kept[d], strip[d]);
    }
    for (int d = 0; anything && d < HDV_SIDES; d++)
        h[d] = smaller(h[d], kept[d]);
    return anything && tighten(follow->directions, h);
}

/* Let cells hold all that the axle's normal allows, at any articulation. */
static void
fill_polygons(const struct follow *follow, double widest, const struct cell_span *span, struct hdv_polygons *now) {
    const struct hdv_grid *grid = follow->grid;
    for (int64_t j = span->lowest; j < span->highest; j++) {
        double theta = grid->first + ((double)j + 0.5) * grid->size;
        now->full[j] = 1;
        box(follow->directions, follow->around->near,
            (struct interval){SCALE * (theta - widest), SCALE * (theta + widest)}, now->h + j * HDV_SIDES);
    }
}

/* Cut all cells down to where both bodies may fit, make the span what is left, and note the offsets' bounds. */
static void trim_polygons(
    const struct follow *follow, double widest, int64_t i, struct hdv_polygons *now, struct cell_span *span,
    struct hdv_reached *reached
) {
    const struct hdv_grid *grid = follow->grid;
    struct cell_span left = {span->highest, span->lowest, span->lowest, span->highest};
    for (int64_t j = span->lowest; j < span->highest; j++) {
        double *h = now->h + j * HDV_SIDES, theta = grid->first + ((double)j + 0.5) * grid->size;
        if (!now->full[j])
            continue;
        h[QUARTER_TURN] = smaller(h[QUARTER_TURN], SCALE * (theta + widest));
        h[3 * QUARTER_TURN] = smaller(h[3 * QUARTER_TURN], SCALE * (widest - theta));
        double turned = theta - follow->frame->heading[i];
        now->full[j] = trim_lead(follow, turned, h) && trim_trailer(follow, i, turned, h);
        if (now->full[j])
            note_cell(reached, i, j, -h[HALF_TURN], h[0], &left);
    }
    *span = left;
}

/* Follow everything that a vehicle can reach from any pose at the first station, until nothing is left. memory is two
 * sets of polygons; allowed (|leading heading| in steps of HDV_LEADING, trailer headings in steps of the grid, trailers
 * of them) begins with zeros. */
HDV_EXPORT void hdv_reachable_with_trailer(
    const struct hdv_coupled *pair, double kappa, const struct hdv_frame *frame, const struct hdv_grid *grid,
    struct hdv_around *around, struct hdv_polygons *memory, struct hdv_allowed *allowed, int64_t trailers,
    struct hdv_reached *reached
) {
    const struct hdv_coupling *coupling = pair->coupling;
    struct follow follow = {pair, frame, grid, around, allowed, trailers, kappa, {{0.0, 0.0}}};
    double last = coupling->first + coupling->step * (double)(coupling->entries - 1);
    double widest = smaller(-coupling->first, last) + grid->size; /* of x */
    struct cell_span span = {0, 0, 0, 0};
    write_directions(follow.directions);
    reached->empty = reached->open = -1;
    for (int64_t i = 0; i < frame->stations; i++) {
        struct hdv_polygons *now = &memory[i % 2];
        double heading = frame->heading[i];
        struct interval former = around->near;
        around_at(around, frame, i);
        if (is_empty(around->near)) {
            reached->open = i;
            continue;
        }
        span.lowest = whole(ceil((heading - SIDEWAYS - grid->first) / grid->size) - 1.0, 0, grid->cells);
        span.highest = whole(floor((heading + SIDEWAYS - grid->first) / grid->size) + 1.0, 0, grid->cells);
        if (follows(frame, i, former, around->near))
            reach_next(&follow, i, &memory[(i + 1) % 2], &span, now);
        else
            fill_polygons(&follow, widest, &span, now);
        trim_polygons(&follow, widest, i, now, &span, reached);
        if (reached->filled[i] == 0) {
            reached->empty = i;
            return;
        }
        reached->right[i] = grid->first + (double)span.begin * grid->size - heading;
        reached->left[i] = grid->first + (double)span.end * grid->size - heading;
    }
}
