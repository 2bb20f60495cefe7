/* The places of a body's edges that come nearest to a limit, and the rows that keep them from it. */
#ifndef HDVPLAN_EDGES_H
#define HDVPLAN_EDGES_H

#include "limits.h"

/* A limit at one arclength [m], and its slope along s. */
struct limit {
    double value, slope;
};

HDV_EXPORT void hdv_limit_at(const struct hdv_limit_table *table, int64_t row, double s, double *found);
struct limit limit_at(const struct hdv_limit_table *table, int64_t row, double s);
void never_bind(const struct hdv_program *program, int64_t i, int64_t begin, int64_t end, double clear);

/* Write the rows of edge number, side (0 left, 1 right) at stage i, and what is known of the edge; that is NaN where a
 * point has no foot. */
void write_edge(
    const struct hdv_limits *own, const struct hdv_scene *scene, int64_t i, int64_t number, int64_t side,
    struct hdv_edge *edge
);

#endif
