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
