/* The only file that knows the operating system and the processor. C99 has no clock that counts microseconds on the
 * wall. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 199309L
#endif

#include "step.h"

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

/* The loader asks the library for every processor of this kind before it takes a faster one. */
#if defined(__x86_64__)
#include <cpuid.h>

/* Whether processor and system have AVX2 and FMA: CPUID's leaves 1 and 7, and XCR0, as in Intel's manual, volume
 * 1, 14.3.
 * __builtin_cpu_supports answers 0 in shared libraries that zig 0.17 links. */
HDV_EXPORT int64_t hdv_has_avx2(void) {
    const unsigned int wanted = bit_FMA | bit_OSXSAVE | bit_AVX, wide_registers_kept = 6;
    unsigned int a, b, c, d;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & wanted) != wanted)
        return 0;
    __asm__ volatile("xgetbv" : "=a"(a), "=d"(d) : "c"(0));
    if ((a & wide_registers_kept) != wide_registers_kept)
        return 0;
    return __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & bit_AVX2) != 0;
}
#else
HDV_EXPORT int64_t hdv_has_avx2(void) {
    return 0;
}
#endif
