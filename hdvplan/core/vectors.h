/* Rows of matrices four numbers at a time, which is what a processor multiplies and adds in one instruction.
 *
 * A vector of n numbers has room for the next multiple of four. What is behind its last number has no meaning, and is
 * never looked at; loading reads it from what follows in memory, so that up to three numbers more than n must be there.
 */
#ifndef HDVPLAN_VECTORS_H
#define HDVPLAN_VECTORS_H

#include "hdvplan.h"

typedef double four __attribute__((vector_size(32)));
typedef double four_anywhere __attribute__((vector_size(32), aligned(8), may_alias));
typedef four vector[(HDV_MOST_STATES + 3) / 4];

HDV_INLINE int64_t fours(int64_t n) {
    return (n + 3) / 4;
}

HDV_INLINE double entry(const four *of, int64_t j) {
    four part = of[j / 4];
    return part[j % 4];
}

HDV_INLINE void load(four *to, const double *from, int64_t n) {
    for (int64_t part = 0; part < fours(n); ++part)
        to[part] = *(const four_anywhere *)(from + 4 * part);
}

HDV_INLINE void store(double *to, const four *from, int64_t n) {
    for (int64_t j = 0; j < n; ++j)
        to[j] = entry(from, j);
}

HDV_INLINE void copy(four *to, const four *from, int64_t n) {
    for (int64_t part = 0; part < fours(n); ++part)
        to[part] = from[part];
}

/* to = a from. */
HDV_INLINE void scale(four *to, double a, const four *from, int64_t n) {
    for (int64_t part = 0; part < fours(n); ++part)
        to[part] = a * from[part];
}

/* to += a from. */
HDV_INLINE void add(four *to, double a, const four *from, int64_t n) {
    for (int64_t part = 0; part < fours(n); ++part)
        to[part] += a * from[part];
}

#endif
