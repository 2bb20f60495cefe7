/* A bound by which all bodies are clear of the kerbs, from the state alone. */
#include "terms.h"

#include <math.h>

#include "kinematics.h"
#include "numbers.h"
#include "path.h"

#define BULGING 0.5 /* curvature times reach up to which a body is screened */

/* The maximum of e + slope t + bend t^2 / 2 over t between 0 and x. */
static double highest(double e, double slope, double bend, double x) {
    double found = larger(e, e + x * (slope + 0.5 * bend * x));
    if (bend < 0.0) {
        double summit = x > 0.0 ? -slope / bend : slope / bend;
        if (x != 0.0 && summit > 0.0 && summit < fabs(x))
            found = e - 0.5 * slope * slope / bend;
    }
    return found;
}

/* Bounds of the offset and heading of the line through a body, from one known point of it. */
struct bounds {
    double e_low, e_high;     /* [m] */
    double phi_low, phi_high; /* against the road [rad] */
    double upper, lower;      /* of e'' and of phi' [1/m] */
};

/* Write the bounds of e'' and phi' for a body that reaches so far along the road; 0 where nothing can be said.
 * Along a body's axis e' = sin(phi) and phi' = -cos(phi) k / (1 - k e). */
static int bend_of(struct bounds *at, const struct hdv_station *road, double reach, double length) {
    double k_most = larger(fabs(road->k_low), fabs(road->k_high));
    double most = 1.0 / (1.0 - k_most * reach), least = 1.0 / (1.0 + k_most * reach);
    double steep = larger(fabs(at->phi_low), fabs(at->phi_high)) + length * k_most * most;
    if (steep > 1.0 || at->e_high > reach || at->e_low < -reach)
        return 0;
    double cosine = cos(steep);
    at->upper = -road->k_low * (road->k_low > 0.0 ? cosine * cosine * least : most);
    at->lower = -road->k_high * (road->k_high > 0.0 ? most : cosine * cosine * least);
    return 1;
}

/* A lower bound of all bodies' clearance from the state alone [m], or -inf where it says nothing. Bounds of k around
 * the vehicle give those of e'' and phi', from coupling to coupling: no point needs to be projected. */
double clear_by_state(const struct hdv_unit *units, int64_t count, const struct hdv_station *at, const double *z) {
    double reach = larger(at->room_left, at->room_right);
    if (larger(fabs(at->k_low), fabs(at->k_high)) * reach > BULGING)
        return -INFINITY;
    struct bounds on = {z[0], z[0], z[1], z[1], 0.0, 0.0};
    double clearance = INFINITY;
    for (int64_t number = 0; number < count; number++) {
        const struct hdv_unit *unit = &units[number];
        double behind = number > 0 ? unit->wheelbase : 0.0; /* of the axle behind the point whose offset is known */
        double rear = -behind - unit->rear_overhang, front = unit->front - behind,
               coupling = -behind - unit->hitch_offset;
        if (!bend_of(&on, at, reach, larger(larger(front, -rear), -coupling)))
            return -INFINITY;
        double slope_low = sin(on.phi_low), slope_high = sin(on.phi_high);
        double high =
            larger(highest(on.e_high, slope_low, on.upper, rear), highest(on.e_high, slope_high, on.upper, front));
        double low =
            -larger(highest(-on.e_low, -slope_high, -on.lower, rear), highest(-on.e_low, -slope_low, -on.lower, front));
        clearance = smaller(clearance, smaller(at->room_left - high, at->room_right + low) - unit->half_width);
        if (!(clearance > HDV_CLEAR_M))
            return -INFINITY;
        if (number + 1 < count) {
            double x = coupling, beta = z[2 + number];
            on.e_high += x * (x > 0.0 ? slope_high : slope_low) + 0.5 * x * x * on.upper;
            on.e_low += x * (x > 0.0 ? slope_low : slope_high) + 0.5 * x * x * on.lower;
            on.phi_high += larger(x * on.upper, x * on.lower) - beta;
            on.phi_low += smaller(x * on.upper, x * on.lower) - beta;
        }
    }
    return clearance;
}
