/* The kernel for x86 processors with AVX2 and fused multiply-add. */

#if defined(__x86_64__)
#define LANES 4
#define LEVEL gearstab_avx2
#define LEVEL_NAME "avx2"
#define TARGET "avx2,fma"
#include "level.h"
#endif
