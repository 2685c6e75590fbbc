/* Motions whose teeth may part: compiled once, as larger vectors do not make them faster (backlash.yaml of configs/response: 2 %
   at most). */

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "kernel.h"

#define LANES 2
#include "simd.h"
#include "crossing.h"
#include "pieces.h"
#include "follow.h"
#include "polynomials.h"
