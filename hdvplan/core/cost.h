/* What costs add to a stage of a program. */
#ifndef HDVPLAN_COST_H
#define HDVPLAN_COST_H

#include "sizes.h"

/* Adds Q, q of weight * residual^2 to a stage of n states; gradient (count,) is the residual's by the first states. */
HDV_INLINE void
add_square(struct stage stage, int64_t n, int64_t count, const double *gradient, double residual, double weight) {
    for (int64_t j = 0; j < count; j++) {
        double slope = 2.0 * weight * gradient[j];
        stage.q[j] += slope * residual;
        for (int64_t k = 0; k < count; k++) {
            stage.Q[j * n + k] += slope * gradient[k];
        }
    }
}

#endif
