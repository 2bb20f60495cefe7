/* The judge sweeps the simulated bodies along the kerbs. Steps from pose to pose become shorter as a body comes nearer:
 * what may be missed between two looks is a small part of the room there. */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "kinematics.h"
#include "numbers.h"
#include "simulate.h"
#include "street.h"

static const double SHARE = 0.25;     /* of the room, that a step may be long */
static const double SHORTEST = 0.005; /* step [m]: a front corner closes in on a kerb by less than a third of that */

/* What is judged. */
struct judged {
    const struct hdv_street *street;
    const struct hdv_unit *units;
    int64_t count, states;
    const struct hdv_curve *curve;
    const double *behind;
};

/* Keep what is tighter than before; return the least gap. */
static double touch(const struct judged *on, double s, const double *z, struct hdv_touch *touches) {
    struct hdv_pose poses[HDV_MOST_UNITS];
    struct path_point at = evaluate(on->curve, s);
    double least = INFINITY;
    place(on->units, on->count, at.x, at.y, at.cos, at.sin, z, poses);
    for (int64_t unit = 0; unit < on->count; unit++) {
        struct hdv_contacts found;
        look_at_body(on->street, NULL, HDV_TO_JUDGE, &on->units[unit], &poses[unit], s, on->behind[unit], &found);
        for (int number = 0; number < 2 * HDV_SECTIONS; number++) {
            const struct hdv_contact *contact = &found.at[number / HDV_SECTIONS][number % HDV_SECTIONS];
            struct hdv_touch *to = &touches[unit * 2 * HDV_SECTIONS + number];
            least = smaller(least, contact->gap);
            if (contact->gap < to->gap) {
                struct plane_point point = body_point(&poses[unit], contact->ahead, contact->left);
                *to = (struct hdv_touch){contact->gap, contact->s, point.x, point.y, contact->ahead, contact->piece};
            }
        }
    }
    return least;
}

/* Drive from one pose to the next, and look as often as the room asks for. */
static void sweep_interval(
    const struct judged *on, const double *s, const double *z, const double *kappa, struct hdv_touch *touches
) {
    int64_t n = on->states;
    double at[2] = {s[0], s[1]}, states[2 * HDV_MOST_STATES], ahead[HDV_MOST_STATES],
           least = touch(on, s[0], z, touches);
    memcpy(states, z, (size_t)(2 * n) * sizeof(double));
    for (;;) {
        double step = larger(SHORTEST, SHARE * least), next = at[0] + step;
        if (at[0] + 1.5 * step > at[1]) /* the next pose is looked at itself */
            return;
        hdv_states_between(on->units, on->count, n, on->curve, 2, at, states, kappa, 1, &next, ahead);
        memcpy(states, ahead, (size_t)n * sizeof(double));
        at[0] = next;
        least = touch(on, next, ahead, touches);
    }
}

/* Writes touches (poses, count, 2, HDV_SECTIONS) of a vehicle that was driven from states z (poses, n) at arclengths
 * s (poses,), each with the curvature kappa (poses - 1,) to the next [1/m]. */
HDV_EXPORT void hdv_touch_many(
    const struct hdv_street *street, const struct hdv_unit *units, int64_t count, int64_t n,
    const struct hdv_curve *curve, const double *behind, int64_t poses, const double *s, const double *z,
    const double *kappa, struct hdv_touch *touches
) {
    static const struct hdv_touch none = {INFINITY, 0.0, 0.0, 0.0, 0.0, -1};
    const struct judged on = {street, units, count, n, curve, behind};
    int64_t each = count * 2 * HDV_SECTIONS;
    for (int64_t number = 0; number < poses * each; number++)
        touches[number] = none;
    for (int64_t i = 0; i + 1 < poses; i++)
        sweep_interval(&on, s + i, z + i * n, kappa + i, touches + i * each);
    if (poses > 0)
        touch(&on, s[poses - 1], z + (poses - 1) * n, touches + (poses - 1) * each);
}
