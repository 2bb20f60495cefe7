#include "kinematics.h"

/* Writes the poses (steps, count) of a vehicle in states z (steps, n) beside points (steps,) of the road. */
HDV_EXPORT void hdv_place_many(
    const struct hdv_unit *units, int64_t count, int64_t steps, const struct path_point *points, int64_t n,
    const double *z, struct hdv_pose *poses
) {
    for (int64_t i = 0; i < steps; i++)
        place(units, count, points[i].x, points[i].y, points[i].cos, points[i].sin, z + i * n, poses + i * count);
}

HDV_EXPORT void hdv_derivative(
    const struct hdv_unit *units, int64_t count, double k, int64_t n, const double *z, double kappa, double *f
) {
    derivative(units, count, k, n, z, kappa, f);
}

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
