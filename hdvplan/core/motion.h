/* The motion that a planning step linearises at: the last plan, extended and moved by each program's solution. */
#ifndef HDVPLAN_MOTION_H
#define HDVPLAN_MOTION_H

#include "hdvplan.h"

HDV_EXPORT void hdv_guess_motion(
    const struct hdv_scene *scene, const double *start, const double *states, const double *curvatures, int64_t kept,
    const double *most, const double *change, int64_t wheels
);
HDV_EXPORT double hdv_take_step(const struct hdv_scene *scene, const struct hdv_point *solution, double share);

#endif
