/* The time on the wall [s], from an arbitrary moment on: how long the parts of a planning step take. */
#ifndef HDVPLAN_CLOCK_H
#define HDVPLAN_CLOCK_H

double seconds(void);

#endif
