/* Drive a manoeuvre exactly: the guided point of the lead unit stays on its path. */
#ifndef HDVPLAN_FOLLOW_H
#define HDVPLAN_FOLLOW_H

#include "hdvplan.h"

/* A piece of the guided point's path: its curvature changes linearly. */
struct piece {
    double length;     /* [m] */
    double begin, end; /* curvature [1/m] */
};

/* Drives a vehicle with its lead unit's point, ahead of the axle and left of the axis [m], along a path of pieces
 * (count_pieces,).
 *
 * heading is the path's at its begin [rad], most the largest curvature that the front wheels allow [1/m]. A state
 * (count,) is the lead unit's heading and the articulation angles [rad]. From states[0], counts (count_pieces,) states
 * a piece are written behind it, each after substeps Runge-Kutta steps, and kappa of every state into kappas. Stops
 * where kappa passes most: the front wheels are at their stop. */
HDV_EXPORT void hdv_follow(
    const struct hdv_unit *units, int64_t count, double ahead, double left, int64_t count_pieces,
    const struct piece *pieces, const int64_t *counts, int64_t substeps, double heading, double most, double *states,
    double *kappas
);

#endif
