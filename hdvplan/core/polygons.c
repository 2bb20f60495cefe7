#include "prove.h"

#define TURN 6.283185307179586 /* [rad] */

enum { MOST_CORNERS = 2 * HDV_SIDES + 4 };

/* Write the directions (HDV_SIDES,), from the first axis on. */
void write_directions(struct direction *directions) {
    for (int d = 0; d < HDV_SIDES; d++)
        directions[d] = (struct direction){cos(TURN * d / HDV_SIDES), sin(TURN * d / HDV_SIDES)};
}

/* Write the supports of a rectangle. */
void box(const struct direction *directions, struct interval e, struct interval w, double *h) {
    for (int d = 0; d < HDV_SIDES; d++) {
        double x = directions[d].x, y = directions[d].y;
        h[d] = larger(x * e.low, x * e.high) + larger(y * w.low, y * w.high);
    }
}

/* A bound of (x, y) . q over a polygon: from the supports of the two directions between which (x, y) lies. */
double support(const struct direction *directions, const double *h, double x, double y) {
    int sector = (int)whole(floor(atan2(y, x) * HDV_SIDES / TURN), -HDV_SIDES, HDV_SIDES);
    int a = (sector + HDV_SIDES) % HDV_SIDES, b = (sector + 1 + HDV_SIDES) % HDV_SIDES;
    struct direction of_a = directions[a], of_b = directions[b];
    double cross = of_a.x * of_b.y - of_a.y * of_b.x;
    return larger((x * of_b.y - y * of_b.x) / cross, 0.0) * h[a] +
           larger((of_a.x * y - of_a.y * x) / cross, 0.0) * h[b];
}

/* Cut a polygon of number corners off beyond d . q <= most; write the corners that are left and return how many. */
static int cut(const struct direction *corners, int number, struct direction d, double most, struct direction *left) {
    int kept = 0, before = number - 1;
    double former = d.x * corners[before].x + d.y * corners[before].y - most;
    for (int c = 0; c < number; c++) {
        double now = d.x * corners[c].x + d.y * corners[c].y - most;
        if ((former > 0.0) != (now > 0.0)) {
            double share = former / (former - now);
            left[kept].x = corners[before].x + share * (corners[c].x - corners[before].x);
            left[kept].y = corners[before].y + share * (corners[c].y - corners[before].y);
            kept++;
        }
        if (now <= 0.0) {
            left[kept] = corners[c];
            kept++;
        }
        former = now;
        before = c;
    }
    return kept;
}

/* Bring every support down to what the others leave of the polygon; return 0 where nothing is left. */
int tighten(const struct direction *directions, double *h) {
    struct direction memory[2][MOST_CORNERS], *corners = memory[0], *other = memory[1];
    double right = h[0], top = h[QUARTER_TURN], left = -h[HALF_TURN], bottom = -h[HALF_TURN + QUARTER_TURN];
    int number = 4;
    if (right < left || top < bottom)
        return 0;
    corners[0] = (struct direction){right, top};
    corners[1] = (struct direction){left, top};
    corners[2] = (struct direction){left, bottom};
    corners[3] = (struct direction){right, bottom};
    for (int d = 0; d < HDV_SIDES && number > 0; d++) {
        if (d % QUARTER_TURN != 0) {
            struct direction *cut_off = other;
            number = cut(corners, number, directions[d], h[d], cut_off);
            other = corners;
            corners = cut_off;
        }
    }
    for (int d = 0; d < HDV_SIDES && number > 0; d++) {
        double most = -INFINITY;
        for (int c = 0; c < number; c++)
            most = larger(most, directions[d].x * corners[c].x + directions[d].y * corners[c].y);
        h[d] = smaller(h[d], most + HDV_ROUNDING);
    }
    return number > 0;
}
