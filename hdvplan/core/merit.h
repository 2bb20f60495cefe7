/* The merit of a motion: the measure by which the step of a program is taken in full or shortened.
 *
 * The l1 merit function of sequential quadratic programming (Han 1977; Nocedal, Wright 2006, sec. 18.4): the prices of
 * all terms, which hold what broken limits cost, and every gap between a predicted state and the dynamics at a weight
 * no smaller than its multiplier. A step that does not lower it is halved: where limits cannot be kept, full steps
 * swing from side to side.
 */
#ifndef HDVPLAN_MERIT_H
#define HDVPLAN_MERIT_H

#include "hdvplan.h"

HDV_EXPORT int64_t
hdv_l1_weights(const struct hdv_program *program, const struct hdv_point *solution, int64_t count, double *weights);
HDV_EXPORT double hdv_defect_price(const struct hdv_program *program, int64_t count, const double *weights);

#endif
