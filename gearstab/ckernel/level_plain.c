/* The kernel for any processor: two lanes, whatever the compiler makes of them. */

#define LANES 2
#define LEVEL gearstab_plain
#define LEVEL_NAME "plain"
#include "level.h"
