/* Which poses of one body fit: for a heading within a cell, the intervals of the lateral offset of its axle that the
 * free space allows. */
#include "prove.h"

#define SMALL 1e-9    /* sine of a body that lies along the road */
#define CELL_RAD 2e-3 /* of heading, for a body alone [rad] */
#define RIGHT_ANGLE 1.5707963267948966

/* Where a point of a body can be: within (u +- du, e + v +- dv) [m]. */
struct place_of_point {
    double u, v, du, dv;
};

static struct place_of_point place_of_point(const double *point, struct loose_pose pose, double cosine, double sine) {
    double u = point[0] * cosine - point[1] * sine, v = point[0] * sine + point[1] * cosine;
    /* the second order is below 30 um */
    return (struct place_of_point){u + pose.u, v, fabs(v) * pose.spread + pose.give, fabs(u) * pose.spread + pose.give};
}

/* The bin that holds u, or the outermost one. */
static int64_t bin_of(const struct hdv_around *around, double u) {
    return whole(floor(u / HDV_BIN_M) + (double)(around->bins / 2), 0, around->bins - 1);
}

/* Between which offsets e a point lies within one free interval of bin b. */
static struct interval
allowed_by(const struct hdv_around *around, const struct hdv_line *line, int64_t b, struct place_of_point at) {
    double over = at.u - (double)(b - around->bins / 2) * HDV_BIN_M;
    double low = line->low + line->of_low * over - fabs(line->of_low) * at.du - at.dv - at.v;
    double high = line->high + line->of_high * over + fabs(line->of_high) * at.du + at.dv - at.v;
    return (struct interval){low, high};
}

/* Where a point can be, as bins of one region: from first to last. */
struct bins_met {
    const int64_t *free;
    const struct hdv_line *lines;
    int64_t first, last;
};

static struct bins_met bins_met(const struct hdv_around *around, int64_t region, struct place_of_point at) {
    return (struct bins_met){
        around->free + region * around->bins, around->lines + region * around->bins * HDV_FREE_INTERVALS,
        bin_of(around, at.u - at.du), bin_of(around, at.u + at.du)
    };
}

/* Cut pieces down to where one point lies in free space; return how many are left. */
static int64_t trim_point(
    const struct hdv_around *around, struct bins_met met, struct place_of_point at, struct interval *pieces,
    int64_t number
) {
    struct interval room[2 * HDV_FREE_INTERVALS];
    int64_t left = 0;
    for (int64_t b = met.first; b <= met.last; b++) {
        for (int64_t c = 0; c < met.free[b]; c++) {
            struct interval allowed = allowed_by(around, &met.lines[b * HDV_FREE_INTERVALS + c], b, at);
            for (int64_t k = 0; k < number; k++) {
                double low = larger(allowed.low, pieces[k].low), high = smaller(allowed.high, pieces[k].high);
                left = join_interval(room, left, 2 * HDV_FREE_INTERVALS, low, high);
            }
        }
    }
    return keep_intervals(room, left, pieces, HDV_FREE_INTERVALS);
}

/* Cut a single piece down by a point that meets one free interval, nearly always; else change nothing and return 0. */
HDV_INLINE int
trim_piece(const struct hdv_around *around, struct bins_met met, struct place_of_point at, struct interval *piece) {
    if (met.last > met.first + 1 || met.free[met.first] != 1 || met.free[met.last] != 1)
        return 0;
    struct interval one = allowed_by(around, &met.lines[met.first * HDV_FREE_INTERVALS], met.first, at);
    struct interval two = allowed_by(around, &met.lines[met.last * HDV_FREE_INTERVALS], met.last, at);
    if (!touches(one, two))
        return 0;
    piece->low = larger(piece->low, smaller(one.low, two.low));
    piece->high = smaller(piece->high, larger(one.high, two.high));
    return 1;
}

/* Between which distances left of its axis a body meets the line u ahead of the axle: empty where it does not. */
static struct interval across_body(double rear, double front, double half, double u, double cosine, double sine) {
    struct interval across = {-half, half};
    if (fabs(sine) > SMALL) {
        double a = (rear * cosine - u) / sine, b = (front * cosine - u) / sine;
        across.low = larger(across.low, smaller(a, b));
        across.high = smaller(across.high, larger(a, b));
    } else if (!(rear < u && u < front)) {
        across.high = across.low;
    }
    return across;
}

/* Cut off where a corner of an obstacle would lie inside the body, however that is turned and placed within pose. */
static int64_t off_corners(
    const struct hdv_outline *outline, struct loose_pose pose, const struct hdv_around *around, struct interval *pieces,
    int64_t number
) {
    struct interval room[2 * HDV_FREE_INTERVALS];
    double cosine = cos(pose.turned), sine = sin(pose.turned), give = pose.give + outline->reach * pose.spread;
    double rear = outline->rear + give, front = outline->front - give, half = outline->half - give;
    if (rear >= front || half <= 0.0)
        return number;
    for (int64_t n = 0; n < around->corners_near && number > 0; n++) {
        double u = around->corners[2 * n] - pose.u, middle = around->corners[2 * n + 1] - u * sine / cosine;
        struct interval across = across_body(rear, front, half, u, cosine, sine);
        if (across.low >= across.high)
            continue;
        double below = middle - across.high / cosine,
               above = middle - across.low / cosine; /* e in between has the corner inside */
        int64_t left = 0;
        for (int64_t k = 0; k < number; k++) {
            left = join_interval(room, left, 2 * HDV_FREE_INTERVALS, pieces[k].low, smaller(pieces[k].high, below));
            left = join_interval(room, left, 2 * HDV_FREE_INTERVALS, larger(pieces[k].low, above), pieces[k].high);
        }
        number = keep_intervals(room, left, pieces, HDV_FREE_INTERVALS);
    }
    return number;
}

/* Cut pieces of the axle's offset e down to where a body may fit in pose; return how many are left. */
int64_t trim(
    const struct hdv_outline *outline, struct loose_pose pose, const struct hdv_around *around, struct interval *pieces,
    int64_t number
) {
    double cosine = cos(pose.turned), sine = sin(pose.turned);
    for (int64_t p = 0; p < outline->point_count && number > 0; p++) {
        struct place_of_point at = place_of_point(outline->points + 2 * p, pose, cosine, sine);
        struct bins_met met = bins_met(around, outline->region[p], at);
        if (number == 1 && trim_piece(around, met, at, pieces))
            number = pieces->low > pieces->high ? 0 : 1; /* NaN leaves all */
        else
            number = trim_point(around, met, at, pieces, number);
    }
    return number > 0 ? off_corners(outline, pose, around, pieces, number) : 0;
}

/* Whether the body fits at the station that is known, in any heading less than a right angle off the road's. */
static int fits_here(const struct hdv_outline *outline, const struct hdv_around *around) {
    int cells = (int)(RIGHT_ANGLE / CELL_RAD) + 1;
    for (int cell = 0; cell < 2 * cells; cell++) { /* the headings along the road first */
        struct loose_pose pose = {(cell / 2 + 0.5) * CELL_RAD * (cell % 2 == 0 ? 1.0 : -1.0), 0.5 * CELL_RAD, 0.0, 0.0};
        struct interval pieces[HDV_FREE_INTERVALS] = {around->near};
        if (trim(outline, pose, around, pieces, 1) > 0)
            return 1;
    }
    return 0;
}

/* Return the first station at which the body fits in no pose, its axle on the normal there; -1 if there is none. */
HDV_EXPORT int64_t
hdv_fits(const struct hdv_outline *outline, const struct hdv_frame *frame, struct hdv_around *around) {
    for (int64_t i = 0; i < frame->stations; i++) {
        around_at(around, frame, i);
        if (!is_empty(around->near) && !fits_here(outline, around))
            return i;
    }
    return -1;
}
