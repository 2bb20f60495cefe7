/* Cosine and sine of an angle at once: calls of libm's would be a third to a half of the linearised dynamics. */
#ifndef HDVPLAN_ANGLES_H
#define HDVPLAN_ANGLES_H

#include <math.h>

#include "hdvplan.h"

enum { COEFFICIENTS = 6 };

/* For |x| <= pi/4: sin(x) = x + x^3 (S_0 + S_1 x^2 + ...), cos(x) = 1 - x^2/2 + x^4 (C_0 + C_1 x^2 + ...). The
 * coefficients are those of FreeBSD's k_sin.c and k_cos.c. */
static const double SINE[COEFFICIENTS] = {
    -1.66666666666666324348e-01, 8.33333333332248946124e-03,  -1.98412698298579493134e-04,
    2.75573137070700676789e-06,  -2.50507602534068634195e-08, 1.58969099521155010221e-10,
};
static const double COSINE[COEFFICIENTS] = {
    4.16666666666666019037e-02,  -1.38888888888741095749e-03, 2.48015872894767294178e-05,
    -2.75573143513906633035e-07, 2.08757232129817482790e-09,  -1.13596475577881948265e-11,
};

/* Writes cosine and sine of an angle [rad], good to a unit in the last place. */
HDV_INLINE void cosine_and_sine(double angle, double *cosine, double *sine) {
    if (!(fabs(angle) <= 0.785398)) {
        *cosine = cos(angle);
        *sine = sin(angle);
        return;
    }
    double square = angle * angle, c = COSINE[COEFFICIENTS - 1], s = SINE[COEFFICIENTS - 1];
    for (int power = COEFFICIENTS - 2; power >= 0; power--) {
        c = COSINE[power] + square * c;
        s = SINE[power] + square * s;
    }
    *cosine = 1.0 - square * (0.5 - square * c);
    *sine = angle + angle * (square * s);
}

#endif
