/* The body of level_*.c: everything below is compiled once for each level of vector instructions. */

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "kernel.h"

#define STRING(text) #text
#if defined(TARGET) && defined(__clang__)
#define PRAGMA_TARGET(names) _Pragma(STRING(clang attribute push(__attribute__((target(names))), apply_to = function)))
PRAGMA_TARGET(TARGET)
#elif defined(TARGET)
#define PRAGMA_TARGET(names) _Pragma(STRING(GCC target(names)))
PRAGMA_TARGET(TARGET)
#endif

#include "simd.h"
#include "hessenberg.h"
#include "modal.h"
#include "interpolation.h"
#include "traces.h"
#include "stretches.h"
#include "conservative.h"
#include "rates.h"
#include "moduli.h"
#include "exponential.h"
#include "damped.h"
#include "scattered.h"
#include "periodic.h"
#include "exponents.h"
#include "lyapunov.h"
#include "eigenvalues.h"
#include "inertia.h"
#include "spectra.h"
#include "eigenvector.h"
#include "actions.h"
#include "symmetric.h"

const struct level LEVEL = {LEVEL_NAME,   scan,         rates,       monodromy,      traces,     scan_damped,
                            spectra_new,  spectra_free, spectra_row, spectra_window, spectra_at, spectra_below,
                            shares,       symmetric,    moduli,      products,       radii,      eigenvalues,
                            exponentials, exponents,    graded};

#if defined(TARGET) && defined(__clang__)
#pragma clang attribute pop
#endif
