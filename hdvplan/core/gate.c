/* The gate on a road's normal: the segment between a right and a left kerb that is nearest to the line. It joins the
 * two sides of the street, and so parts what is before it from what is beyond it: whoever passes crosses it.
 *
 * A body is connected, so that it lies in the areas around the gate, as far as caps are within its reach: another arm
 * of the road is left out, also where it is near in the plane.
 */
#include "prove.h"

#define BESIDE_M 20.0 /* kerbs that belong to the line so far before and beyond a normal can make its gate */

enum { CROSSINGS = 32 }; /* of kerbs with one normal: of more nothing is known */

/* Where a kerb crosses a normal: how far left, at which arclength of the line; 1: with the street to the left of it, as
 * a right kerb has it, -1: with the street to the right of it, as a left one has it, 0: neither. */
struct crossing {
    double v, s;
    int street;
};

/* Write where kerbs cross the normal at arclength s, from right to left; return how many, none if they are too many. */
static int64_t cross(const struct hdv_street *kerbs, struct axes at, double s, struct crossing *found) {
    int64_t number = 0;
    for (int64_t k = 0; k < kerbs->count; k++) {
        const struct hdv_piece *piece = &kerbs->pieces[k];
        const double from[2] = {piece->x, piece->y};
        const double to[2] = {piece->x + piece->length * piece->cos, piece->y + piece->length * piece->sin};
        double first = ahead_of(at, from), last = ahead_of(at, to);
        if (piece->s_low > s + BESIDE_M || piece->s_high < s - BESIDE_M || (first < 0.0) == (last < 0.0))
            continue;
        if (number == CROSSINGS)
            return 0;
        double part = first / (first - last), v = left_of(at, from) + part * (left_of(at, to) - left_of(at, from));
        int64_t place = number;
        for (; place > 0 && found[place - 1].v > v; place--)
            found[place] = found[place - 1];
        int street = piece->left ? (last < first ? -1 : 0) : (last > first ? 1 : 0);
        found[place] = (struct crossing){v, piece->s_begin + part * (piece->s_end - piece->s_begin), street};
        number++;
    }
    return number;
}

/* The gate on the normal at arclength s that is nearest to the line; empty where there is none. */
struct gate gate_at(const struct hdv_street *kerbs, struct axes at, double s) {
    struct crossing found[CROSSINGS];
    struct gate gate = {NOTHING, NOTHING};
    int64_t number = cross(kerbs, at, s, found);
    double nearest = INFINITY;
    for (int64_t k = 0; k + 1 < number; k++) {
        double away = larger(0.0, larger(found[k].v, -found[k + 1].v));
        if (found[k].street == 1 && found[k + 1].street == -1 && away < nearest) {
            nearest = away;
            gate.v = (struct interval){found[k].v, found[k + 1].v};
            gate.s = NOTHING;
            widen(&gate.s, found[k].s);
            widen(&gate.s, found[k + 1].s);
        }
    }
    return gate;
}

/* Distance of a point (u, v) from a gate. */
static double off_gate(struct interval gate, double u, double v) {
    return hypot(u, larger(0.0, larger(gate.low - v, v - gate.high)));
}

/* Distance of a gate's end (0, v) from the line between two points. */
static double off_cap(double v, const double *u_cap, const double *v_cap) {
    double du = u_cap[1] - u_cap[0], dv = v_cap[1] - v_cap[0], squared = du * du + dv * dv;
    double part = squared > 0.0 ? ((v - v_cap[0]) * dv - u_cap[0] * du) / squared : 0.0;
    part = larger(0.0, smaller(1.0, part));
    return hypot(u_cap[0] + part * du, v_cap[0] + part * dv - v);
}

/* Whether a body whose axle is in a gate cannot reach a cap. */
static int out_of_reach(const struct hdv_around *around, struct axes at, struct interval gate, int64_t number) {
    const struct hdv_beside *beside = around->beside;
    for (int64_t region = around->two_regions ? 0 : 1; region < 2; region++) {
        const double *cap = beside->caps + (region * (beside->stretches + 1) + number) * 4;
        double u[2] = {ahead_of(at, cap), ahead_of(at, cap + 2)}, v[2] = {left_of(at, cap), left_of(at, cap + 2)};
        double nearest = smaller(off_gate(gate, u[0], v[0]), off_gate(gate, u[1], v[1]));
        nearest = smaller(nearest, smaller(off_cap(gate.low, u, v), off_cap(gate.high, u, v)));
        if ((u[0] < 0.0) != (u[1] < 0.0))
            nearest = smaller(nearest, off_gate(gate, 0.0, v[0] + u[0] / (u[0] - u[1]) * (v[1] - v[0])));
        if (nearest <= around->reach)
            return 0;
    }
    return 1;
}

/* The areas that a body whose axle is in a gate can touch; none where it can reach beyond the last that are known. */
struct areas areas_at(const struct hdv_around *around, struct axes at, struct gate gate) {
    const struct hdv_beside *beside = around->beside;
    struct areas found = {
        (int64_t)floor((gate.s.low - beside->first) / beside->stretch),
        (int64_t)floor((gate.s.high - beside->first) / beside->stretch) + 1
    };
    while (found.begin >= 0 && found.begin <= beside->stretches && !out_of_reach(around, at, gate.v, found.begin))
        found.begin--;
    while (found.end >= 0 && found.end <= beside->stretches && !out_of_reach(around, at, gate.v, found.end))
        found.end++;
    return 0 <= found.begin && found.begin < found.end && found.end <= beside->stretches ? found : (struct areas){0, 0};
}

/* Whether what was reached in the gate before can be followed to station i: all of that lies behind the new normal, as
 * it does not where normals cross within the street. */
int follows(const struct hdv_frame *frame, int64_t i, struct interval former, struct interval near) {
    if (i == 0 || is_empty(former) || is_empty(near) || !touches(former, near))
        return 0;
    struct chord_frame chord = chord_at(frame, i);
    return smaller(chord.ahead - former.low * chord.sin, chord.ahead - former.high * chord.sin) > 0.0;
}
