/* The only file that knows the processor: the loader asks the library for every processor of this kind before it takes
 * a faster one. */
#include "hdvplan.h"

HDV_EXPORT int64_t hdv_has_avx2(void);

#if defined(__x86_64__)
#include <cpuid.h>

/* Whether processor and system have AVX2 and FMA: CPUID's leaves 1 and 7, and XCR0, as in Intel's manual, volume
 * 1, 14.3.
 * __builtin_cpu_supports answers 0 in shared libraries that zig 0.17 links. */
int64_t hdv_has_avx2(void) {
    const unsigned int wanted = bit_FMA | bit_OSXSAVE | bit_AVX, wide_registers_kept = 6;
    unsigned int a, b, c, d;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & wanted) != wanted) {
        return 0;
    }
    __asm__ volatile("xgetbv" : "=a"(a), "=d"(d) : "c"(0));
    if ((a & wide_registers_kept) != wide_registers_kept) {
        return 0;
    }
    return __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & bit_AVX2) != 0;
}
#else
int64_t hdv_has_avx2(void) {
    return 0;
}
#endif
