/* Disjoint, rising intervals in arrays; where there are too many, some are joined: what is wider is safe. */
#ifndef HDVPLAN_INTERVALS_H
#define HDVPLAN_INTERVALS_H

#include "hdvplan.h"

struct interval {
    double low, high;
};

int64_t join_interval(struct interval *pieces, int64_t total, int64_t most, double low, double high);
int64_t keep_intervals(struct interval *found, int64_t number, struct interval *pieces, int64_t most);

#endif
