/* The kernel for x86 processors with AVX2 and fused multiply-add. */

#if defined(__x86_64__)
#include <immintrin.h>
#define LANES 4
#define LEVEL gearstab_avx2
#define LEVEL_NAME "avx2"
#define TARGET "avx2,fma"
#define LARGER(a, b) ((vec)_mm256_max_pd((__m256d)(a), (__m256d)(b)))
#define ANY(m) (!_mm256_testz_si256((__m256i)(m), (__m256i)(m)))
#include "level.h"
#endif
