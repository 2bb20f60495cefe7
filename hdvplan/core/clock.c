/* The only file that knows the operating system: C99 has no clock that counts microseconds on the wall. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 199309L
#endif

#include "clock.h"

#if defined(_WIN32)
#include <windows.h>

double seconds(void) {
    LARGE_INTEGER now, per_second;
    QueryPerformanceCounter(&now);
    QueryPerformanceFrequency(&per_second);
    return (double)now.QuadPart / (double)per_second.QuadPart;
}
#else
#include <time.h>

double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}
#endif
