#include "simulate.h"

#include <string.h>

#include "kinematics.h"
#include "path.h"

static const double QUARTER_TURN = 1.5707963267948966;

/* What is held over one interval. */
struct held {
    double kappa;                /* [1/m] */
    double off;                  /* lead rear wheels off the body [rad] */
    double rate[HDV_MOST_UNITS]; /* at which active wheels turn [rad/m] */
};

/* The road's curvature at the begin, the middle and the end of a Runge-Kutta step [1/m]. */
struct bend {
    double first, middle, last;
};

/* wheels (2, active) are the angles of active wheels at both ends of an interval of step metres. */
HDV_INLINE struct held
held_over(const struct hdv_unit *lead, double kappa, double step, int64_t active, const double *wheels) {
    struct held held;
    held.kappa = kappa;
    held.off = atan(rear_wheels(lead, kappa).tan);
    for (int64_t j = 0; j < active; j++)
        held.rate[j] = (wheels[active + j] - wheels[j]) / step;
    return held;
}

/* Writes dz/ds into f (n,) at z + ahead * slope. */
HDV_INLINE void rates_at(
    const struct hdv_unit *units, int64_t count, int64_t n, const struct held *held, double k, const double *z,
    double ahead, const double *slope, double *f
) {
    double probe[HDV_MOST_STATES];
    for (int64_t j = 0; j < n; j++)
        probe[j] = z[j] + ahead * slope[j];
    derivative(units, count, k, n, probe, held->kappa, f);
    for (int64_t j = 1 + count; j < n; j++)
        f[j] = held->rate[j - 1 - count];
}

/* Moves z (n,) on by h metres of road: the classical Runge-Kutta method. */
HDV_INLINE void runge_kutta(
    const struct hdv_unit *units, int64_t count, int64_t n, const struct held *held, struct bend k, double h, double *z
) {
    double f[4][HDV_MOST_STATES];
    rates_at(units, count, n, held, k.first, z, 0.0, z, f[0]);
    rates_at(units, count, n, held, k.middle, z, 0.5 * h, f[0], f[1]);
    rates_at(units, count, n, held, k.middle, z, 0.5 * h, f[1], f[2]);
    rates_at(units, count, n, held, k.last, z, h, f[2], f[3]);
    for (int64_t j = 0; j < n; j++)
        z[j] += h / 6.0 * (f[0][j] + 2.0 * f[1][j] + 2.0 * f[2][j] + f[3][j]);
}

/* Moves z (n,) on from arclength s by some steps of h metres; returns whether it stays in the model's domain. */
HDV_INLINE int drive_on(
    const struct hdv_unit *units, int64_t count, int64_t n, const struct hdv_curve *curve, const struct held *held,
    double s, double h, int64_t steps, double *z
) {
    struct bend k;
    k.last = evaluate(curve, s).curvature;
    for (int64_t i = 0; i < steps; i++) {
        double here = s + (double)i * h;
        k.first = k.last;
        k.middle = evaluate(curve, here + 0.5 * h).curvature;
        k.last = evaluate(curve, here + h).curvature;
        runge_kutta(units, count, n, held, k, h, z);
        if (!(1.0 - z[0] * k.last > 0.0 && fabs(z[1] + held->off) < QUARTER_TURN))
            return 0;
    }
    return 1;
}

void hdv_simulate(
    const struct hdv_unit *units, int64_t count, int64_t n, const struct hdv_curve *curve, double s_start,
    int64_t intervals, double step, const double *kappa, const double *wheels, int64_t keep, int64_t substeps,
    double *states
) {
    int64_t rigid = 1 + count;
    int64_t active = n - rigid;
    double h = step / (double)(keep * substeps);
    double z[HDV_MOST_STATES];
    memcpy(z, states, (size_t)n * sizeof *z);
    for (int64_t i = 0; i < intervals; i++) {
        struct held held = held_over(units, kappa[i], step, active, wheels + i * active);
        for (int64_t part = 0; part < keep; part++) {
            double s = s_start + (double)i * step + (double)(part * substeps) * h;
            if (!drive_on(units, count, n, curve, &held, s, h, substeps, z))
                return;
            states += n;
            memcpy(states, z, (size_t)n * sizeof *z);
        }
        for (int64_t j = 0; j < active; j++) /* no rounding may carry the wheels off the plan */
            z[rigid + j] = states[rigid + j] = wheels[(i + 1) * active + j];
    }
}

void hdv_states_between(
    const struct hdv_unit *units, int64_t count, int64_t n, const struct hdv_curve *curve, int64_t poses,
    const double *s, const double *z, const double *kappa, int64_t count_at, const double *at, double *states
) {
    double wheels[2 * HDV_MOST_UNITS];
    int64_t rigid = 1 + count, active = n - rigid, i = 0;
    for (int64_t number = 0; number < count_at; number++, states += n) {
        while (i + 1 < poses && s[i + 1] <= at[number])
            i++;
        memcpy(states, z + i * n, (size_t)n * sizeof *z);
        if (i + 1 == poses || !(at[number] > s[i]))
            continue;
        for (int64_t j = 0; j < active; j++) {
            wheels[j] = z[i * n + rigid + j];
            wheels[active + j] = z[(i + 1) * n + rigid + j];
        }
        struct held held = held_over(units, kappa[i], s[i + 1] - s[i], active, wheels);
        drive_on(units, count, n, curve, &held, s[i], at[number] - s[i], 1, states);
    }
}
