/* A drive to try the planner on: a road's tables and the vehicle at its start, in sample.c. */
#ifndef HDVPLAN_SAMPLE_H
#define HDVPLAN_SAMPLE_H

#include "planner.h"

extern const struct hdvplan_road sample_road;
extern const double sample_start[STATES]; /* the state at station 0 */
extern const double sample_kappa;         /* driven until there [1/m] */
extern const int64_t sample_stations;     /* to the road's end */

#endif
