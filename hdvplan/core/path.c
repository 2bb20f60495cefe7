#include "path.h"

/* Writes the path's points at arclengths s (count,) [m]. */
HDV_EXPORT void
hdv_evaluate_many(const struct hdv_curve *curve, int64_t count, const double *s, struct path_point *points) {
    for (int64_t i = 0; i < count; i++)
        points[i] = evaluate(curve, s[i]);
}

/* Writes the feet of points x, y (count,) [m], each searched from its arclength near. */
HDV_EXPORT void hdv_project_many(
    const struct hdv_curve *curve, int64_t count, const double *x, const double *y, const double *near,
    double last_step, struct foot *feet
) {
    for (int64_t i = 0; i < count; i++)
        feet[i] = project(curve, x[i], y[i], near[i], last_step);
}
