/* Where an axle passes a road's normal, and which areas of the street a body can touch from there. */
#ifndef HDVPLAN_GATE_H
#define HDVPLAN_GATE_H

#include <math.h>

#include "numbers.h"
#include "prove.h"

static const struct interval NOTHING = {INFINITY, -INFINITY};

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

HDV_INLINE void widen(struct interval *on, double value) {
    on->low = smaller(on->low, value);
    on->high = larger(on->high, value);
}

HDV_INLINE int touches(struct interval one, struct interval other) {
    return one.low <= other.high && one.high >= other.low;
}

HDV_INLINE struct axes axes_at(const struct hdv_frame *frame, int64_t i) {
    return (struct axes){frame->x[i], frame->y[i], cos(frame->heading[i]), sin(frame->heading[i])};
}

HDV_INLINE double ahead_of(struct axes at, const double *point) {
    return (point[0] - at.x) * at.cos + (point[1] - at.y) * at.sin;
}

HDV_INLINE double left_of(struct axes at, const double *point) {
    return (point[1] - at.y) * at.cos - (point[0] - at.x) * at.sin;
}

struct gate gate_at(const struct hdv_street *kerbs, struct axes at, double s);
struct areas areas_at(const struct hdv_around *around, struct axes at, struct gate gate);

#endif
