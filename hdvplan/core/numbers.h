/* Numbers held between others, NaN minded. */
#ifndef HDVPLAN_NUMBERS_H
#define HDVPLAN_NUMBERS_H

#include "hdvplan.h"

/* Largest and smallest of two numbers as Python's max and min have them: where either is NaN, the first. */
HDV_INLINE double larger(double a, double b) {
    return b > a ? b : a;
}

HDV_INLINE double smaller(double a, double b) {
    return b < a ? b : a;
}

/* A number without its fraction, held between two others, the lower one for NaN: a mere cast can be undefined. */
HDV_INLINE int64_t whole(double value, int64_t low, int64_t high) {
    if (!(value > (double)low))
        return low;
    return value < (double)high ? (int64_t)value : high;
}

#endif
