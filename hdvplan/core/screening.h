/* A bound by which all bodies are clear of the kerbs, without looking at them. */
#ifndef HDVPLAN_SCREENING_H
#define HDVPLAN_SCREENING_H

#include "hdvplan.h"

double clear_by_state(const struct hdv_unit *units, int64_t count, const struct hdv_station *at, const double *z);

#endif
