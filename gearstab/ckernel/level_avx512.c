/* The kernel for x86 processors with AVX-512. */

#if defined(__x86_64__)
#define LANES 8
#define LEVEL gearstab_avx512
#define LEVEL_NAME "avx512"
#define TARGET "avx512f,avx512dq,avx512vl,avx2,fma"
#include "level.h"
#endif
