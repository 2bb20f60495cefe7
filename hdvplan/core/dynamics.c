#include "terms.h"

#include <string.h>

#include "kinematics.h"
#include "sizes.h"

/* Passes of a fixed point: a step shorter than every wheelbase leaves less than half the error at each. */
enum { PASSES = 50 };

/* The rate dz/ds of a state, f (n,), with its derivatives by z, a (n, n), and by kappa, b (n,). */
struct rate {
    double f[HDV_MOST_STATES], b[HDV_MOST_STATES], a[HDV_MOST_STATES * HDV_MOST_STATES];
};

/* The motion from one stage to the next, and where A, B, c of it go: a program's stage with given states and inputs. */
struct interval {
    const struct hdv_station *station;
    double step; /* [m] */
    const double *z, *z_next;
    double kappa; /* [1/m] */
    const struct hdv_pose *poses;
    struct stage stage;
    int64_t states, inputs;
};

void hdv_advance(
    int64_t rule, const struct hdv_unit *units, int64_t count, double k, double k_between, double step, int64_t n,
    const double *z, double kappa, double *z_next
) {
    double f[HDV_MOST_STATES], middle[HDV_MOST_STATES];
    int64_t passes = rule == HDV_EULER ? 0 : rule == HDV_MIDPOINT ? 1 : PASSES;
    derivative(units, count, k, n, z, kappa, f);
    for (int64_t pass = 0; pass < passes; pass++) {
        for (int64_t j = 0; j < n; j++)
            middle[j] = z[j] + 0.5 * step * f[j];
        derivative(units, count, k_between, n, middle, kappa, f);
    }
    for (int64_t j = 0; j < n; j++)
        z_next[j] = z[j] + step * f[j];
}

/* Whether a body's rate depends on a state: e_y, e_psi, articulation angles up to its own, and all wheels. */
HDV_INLINE int depends(int64_t row, int64_t column, int64_t count) {
    return column <= 1 || column <= row || column > count;
}

/* Rate at a state between two stations. */
HDV_INLINE void rate_between(
    const struct interval *on, const struct hdv_unit *units, int64_t count, int64_t n, const double *z,
    struct rate *rate
) {
    struct hdv_pose poses[HDV_MOST_UNITS];
    turn(count, z, poses);
    jacobian(units, count, on->station->curvature_between, n, z, on->kappa, poses, rate->f, rate->a, rate->b);
}

/* Derivatives of a rate at z + half * first, by z and kappa: a += half a a_first, b += half a b_first. */
HDV_INLINE void compose(const struct rate *first, double half, int64_t count, int64_t n, struct rate *rate) {
    for (int64_t j = 0; j <= count; j++) {
        double *row = rate->a + j * n;
        double scaled[HDV_MOST_STATES];
        for (int64_t i = 0; i <= count; i++) {
            scaled[i] = half * row[i];
            rate->b[j] += scaled[i] * first->b[i];
        }
        for (int64_t t = 0; t < n; t++) {
            for (int64_t i = 0; i <= count; i++)
                if (depends(j, i, count) && depends(i, t, count))
                    row[t] += scaled[i] * first->a[i * n + t];
        }
    }
}

/* Writes what the changes of active wheels move: they turn evenly, by half of it until the middle of the interval. */
HDV_INLINE void
write_wheels(const struct interval *on, double half, int64_t count, int64_t n, const struct rate *rate) {
    for (int64_t wheel = count + 1; wheel < n; wheel++)
        for (int64_t j = 0; j <= count; j++)
            on->stage.B[j * on->inputs + wheel - count] = half * rate->a[j * n + wheel];
}

/* Writes A = I + share a, kappa's column, which is B's, and c = z + step f - z_next. The wheels' share is the step. */
HDV_INLINE void write_rate(const struct interval *on, double share, int64_t count, int64_t n, const struct rate *rate) {
    for (int64_t j = 0; j < n; j++) {
        double *row = on->stage.A + j * on->states;
        for (int64_t t = 0; t < n; t++)
            row[t] = (t <= count ? share : on->step) * rate->a[j * n + t];
        row[j] += 1.0;
        row[n] = on->stage.B[j * on->inputs] = on->step * rate->b[j];
        on->stage.c[j] = j <= count ? on->z[j] + on->step * rate->f[j] - on->z_next[j] : 0.0;
    }
}

/* Takes a multiple of the row of a pivot from another row, of a, A, B and c. */
HDV_INLINE void eliminate(const struct interval *on, int64_t count, int64_t n, int64_t pivot, int64_t row, double *a) {
    const struct stage *to = &on->stage;
    double share = a[row * n + pivot] / a[pivot * n + pivot];
    for (int64_t t = pivot + 1; t <= count; t++)
        a[row * n + t] -= share * a[pivot * n + t];
    for (int64_t t = 0; t <= n; t++)
        to->A[row * on->states + t] -= share * to->A[pivot * on->states + t];
    for (int64_t t = 1; t <= n - 1 - count; t++)
        to->B[row * on->inputs + t] -= share * to->B[pivot * on->inputs + t];
    to->c[row] -= share * to->c[pivot];
}

/* Solves (I - half a) dz_next = A dz + B d kappa + c for dz_next, in place.
 *
 * The matrix is close to the identity: elimination needs no pivots. What a chain's couplings have from those behind
 * them is zero. */
HDV_INLINE void collocate(const struct interval *on, double half, int64_t count, int64_t n, double *a) {
    const struct stage *to = &on->stage;
    for (int64_t j = 0; j <= count; j++) {
        for (int64_t t = 0; t <= count; t++)
            a[j * n + t] *= -half;
        a[j * n + j] += 1.0;
    }
    for (int64_t pivot = 0; pivot <= count; pivot++) {
        for (int64_t j = 0; j <= count; j++)
            if (j != pivot && a[j * n + pivot] != 0.0)
                eliminate(on, count, n, pivot, j, a);
    }
    for (int64_t j = 0; j <= count; j++) {
        double scale = 1.0 / a[j * n + j];
        for (int64_t t = 0; t <= n; t++)
            to->A[j * on->states + t] *= scale;
        for (int64_t t = 1; t <= n - 1 - count; t++)
            to->B[j * on->inputs + t] *= scale;
        to->B[j * on->inputs] = to->A[j * on->states + n];
        to->c[j] *= scale;
    }
}

/* Writes A, B, c of one interval: dz_next = A dz + B d kappa + c, at the motion from a stage to the next.
 *
 * The last state of the vehicle's own block is kappa of the interval before, and the first input its change: kappa's
 * column of A is B's. An active axle's wheels turn evenly between stations, by the motion's change of their angle and a
 * separate input; Euler's rule takes the rate at z, where they have not turned yet. By the explicit midpoint rule that
 * rate leads to the middle, the rate there to the end. The implicit one takes the rate at the mean of both states:
 * Newton's first step from z_next ends at z_next + c. */
HDV_INLINE void
linearise_interval(int64_t rule, const struct interval *on, const struct hdv_unit *units, int64_t count, int64_t n) {
    double half = 0.5 * on->step, middle[HDV_MOST_STATES];
    struct rate first, rate;
    struct rate *here = rule == HDV_EULER ? &rate : &first;
    if (rule != HDV_GAUSS)
        jacobian(units, count, on->station->curvature, n, on->z, on->kappa, on->poses, here->f, here->a, here->b);
    if (rule != HDV_EULER) {
        for (int64_t j = 0; j < n; j++)
            middle[j] =
                rule == HDV_MIDPOINT && j <= count ? on->z[j] + half * first.f[j] : 0.5 * (on->z[j] + on->z_next[j]);
        rate_between(on, units, count, n, middle, &rate);
    }
    write_wheels(on, rule == HDV_EULER ? 0.0 : half, count, n, &rate);
    if (rule == HDV_MIDPOINT)
        compose(&first, half, count, n, &rate);
    write_rate(on, rule == HDV_GAUSS ? half : on->step, count, n, &rate);
    if (rule == HDV_GAUSS)
        collocate(on, half, count, n, rate.a);
}

/* Writes A, B, c of the first interval and of those that lead to stages i >= begin, and the poses of the stages that
 * they join; clears Q, q and live of stages i >= begin, to which other terms add. */
HDV_INLINE void
linearise_horizon(int64_t rule, const struct hdv_scene *scene, int64_t begin, int64_t own_states, int64_t own_inputs) {
    const struct hdv_program *program = &scene->program;
    int64_t last = program->shape.stages, size = program->shape.states, m = program->shape.inputs;
    int64_t n = own_states - 1, count = n - own_inputs;
    for (int64_t i = 0; i <= last; i++) {
        if (0 < i && i < begin - 1)
            continue;
        const struct hdv_station *station = scene->road + i;
        struct stage stage = stage_at(program, size, m, i);
        const double *z = state_at(scene->motion, n, i), *z_next = z + n + 1;
        struct hdv_pose *poses = scene->poses + i * count;
        place(scene->units, count, station->x, station->y, station->cos, station->sin, z, poses);
        if (i < last) {
            struct interval on = {station, station->step, z, z_next, z[n], poses, stage, size, m};
            linearise_interval(rule, &on, scene->units, count, n);
        }
        if (i >= begin) {
            memset(stage.Q, 0, (size_t)(size * size + size) * sizeof(double)); /* and q, which follows it */
            *stage.live = 0.0;
        }
    }
}

/* Linearises the dynamics x_{i+1} = A x_i + B u_i + c at the motion. */
int64_t hdv_linearise_dynamics(void *data, const struct hdv_scene *scene, int64_t begin, int64_t fresh) {
    int64_t rule = ((const struct hdv_dynamics *)data)->rule, count = scene->unit_count, n = scene->states;
    (void)fresh;
    HDV_UNROLLED(n + 1, n - count, linearise_horizon, rule, scene, begin); /* the last state is kappa */
    return -1;
}

/* The dynamics have no price of their own: what their gaps cost is a matter of the merit, see motion.c. */
double hdv_price_dynamics(void *data, const struct hdv_scene *scene) {
    (void)data;
    (void)scene;
    return 0.0;
}
