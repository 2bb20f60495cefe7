/* Drive a manoeuvre exactly: the guided point of the lead unit stays on its path. */
#include <string.h>

#include "kinematics.h"

/* A piece of the guided point's path: its curvature changes linearly. */
struct piece {
    double length;     /* [m] */
    double begin, end; /* curvature [1/m] */
};

/* What is driven: a vehicle, the guided point of its lead unit, and the largest kappa. */
struct guided {
    const struct hdv_unit *units;
    int64_t count;
    double ahead, left; /* [m] */
    double most;        /* [1/m] */
};

/* Returns the guided point's velocity across a direction off the lead body at kappa, per metre that the body moves
 * forward, and writes the body's own rates into f (1 + count,): with the axle on a straight road, in line with it,
 * dz/ds is the motion per metre forward. */
HDV_INLINE double
miss_of(const struct guided *guided, const double *z, double kappa, double cos_off, double sin_off, double *f) {
    derivative(guided->units, guided->count, 0.0, 1 + guided->count, z, kappa, f);
    return (f[0] + guided->ahead * f[1]) * cos_off - (1.0 - guided->left * f[1]) * sin_off;
}

/* Returns the kappa that moves the guided point along a heading [rad], and writes dy/ds of the state y (count,) into
 * rates.
 *
 * kappa comes in as a guess for the secant method, which is exact at once where the lead rear axle is not steered. */
static double rates_along(const struct guided *guided, double heading, const double *y, double kappa, double *rates) {
    double z[HDV_MOST_UNITS + 1] = {0.0};
    double f[HDV_MOST_UNITS + 1];
    double cos_off = cos(heading - y[0]);
    double sin_off = sin(heading - y[0]);
    memcpy(z + 2, y + 1, (size_t)(guided->count - 1) * sizeof *z);
    double last = kappa + 1e-3;
    double last_miss = miss_of(guided, z, last, cos_off, sin_off, f);
    for (int attempt = 1; attempt < 30; attempt++) {
        double miss = miss_of(guided, z, kappa, cos_off, sin_off, f);
        double step = miss * (kappa - last) / (miss - last_miss);
        if (miss == last_miss || miss == 0.0 || fabs(step) < 1e-15) /* rounding of a curvature [1/m] */
            break;
        last = kappa;
        last_miss = miss;
        kappa -= step;
    }
    double along = hypot(
        1.0 - guided->left * f[1], f[0] + guided->ahead * f[1]
    ); /* of the point, per metre that the body moves forward */
    for (int64_t j = 0; j < guided->count; j++)
        rates[j] = f[1 + j] / along;
    return kappa;
}

/* The path's heading u metres after a piece's begin [rad]. */
HDV_INLINE double heading_after(const struct piece *piece, double heading, double u) {
    return heading + piece->begin * u + 0.5 * (piece->end - piece->begin) / piece->length * u * u;
}

/* Moves y (count,) on by h metres from u metres after a piece's begin, by the classical Runge-Kutta method. Returns
 * kappa; stops where it passes what the wheels allow. */
static double move_on(
    const struct guided *guided, const struct piece *piece, double heading, double u, double h, double *y, double kappa
) {
    static const double parts[4] = {0.0, 0.5, 0.5, 1.0};
    double slopes[4][HDV_MOST_UNITS];
    double probe[HDV_MOST_UNITS];
    for (int stage = 0; stage < 4; stage++) {
        for (int64_t j = 0; j < guided->count; j++)
            probe[j] = y[j] + (stage > 0 ? parts[stage] * h * slopes[stage - 1][j] : 0.0);
        kappa = rates_along(guided, heading_after(piece, heading, u + parts[stage] * h), probe, kappa, slopes[stage]);
        if (!(fabs(kappa) <= guided->most))
            return kappa;
    }
    for (int64_t j = 0; j < guided->count; j++)
        y[j] += h / 6.0 * (slopes[0][j] + 2.0 * slopes[1][j] + 2.0 * slopes[2][j] + slopes[3][j]);
    return kappa;
}

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
) {
    struct guided guided = {units, count, ahead, left, most};
    double y[HDV_MOST_UNITS];
    double unused[HDV_MOST_UNITS];
    int64_t row = 0;
    memcpy(y, states, (size_t)count * sizeof *y);
    double kappa = rates_along(&guided, heading, y, 0.0, unused);
    kappas[row] = kappa;
    for (int64_t i = 0; i < count_pieces; i++) {
        const struct piece *piece = pieces + i;
        double h = piece->length / (double)(counts[i] * substeps);
        for (int64_t step = 1; step <= counts[i] * substeps; step++) {
            kappa = move_on(&guided, piece, heading, (double)(step - 1) * h, h, y, kappa);
            if (!(fabs(kappa) <= most))
                return;
            if (step % substeps == 0) {
                row++;
                kappa = rates_along(&guided, heading_after(piece, heading, (double)step * h), y, kappa, unused);
                kappas[row] = kappa;
                memcpy(states + row * count, y, (size_t)count * sizeof *y);
            }
        }
        heading += 0.5 * (piece->begin + piece->end) * piece->length;
    }
}
