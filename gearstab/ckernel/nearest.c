/* How far the traces rho = lambda + 1/lambda of many points have moved between two computations. */

#include <math.h>
#include <stdint.h>

#include "kernel.h"

/* The numbers of compare.py, which says what they mean: fine and coarse (count, n, 2), change and largest (count,). */
void gearstab_trace_change(int64_t count, int64_t n, double weight, const double *fine, const double *coarse,
                           double *change, double *largest) {
    for (int64_t p = 0; p < count; p++, fine += 2 * n, coarse += 2 * n) {
        double most = 1.0, worst = 0.0;
        for (int64_t i = 0; i < n; i++) {
            double x = fine[2 * i], y = fine[2 * i + 1];
            double square = x * x - y * y - 4.0, twist = 2.0 * x * y;
            double modulus = 0.5 * (sqrt(x * x + y * y) + sqrt(sqrt(square * square + twist * twist)));
            most = modulus > most || modulus != modulus ? modulus : most;
        }
        for (int64_t i = 0; i < n; i++) {
            double x = fine[2 * i], y = fine[2 * i + 1], least = INFINITY;
            for (int64_t j = 0; j < n; j++) {
                double dx = coarse[2 * j] - x, dy = coarse[2 * j + 1] - y, distance = dx * dx + dy * dy;
                least = distance < least || distance != distance ? distance : least;
            }
            double square = x * x - y * y - 4.0, twist = 2.0 * x * y;
            double root = sqrt(sqrt(square * square + twist * twist)), gap = sqrt(least);
            double modulus = 0.5 * (sqrt(x * x + y * y) + root), share = weight * modulus / most;
            double divisor = root * root > gap ? root : sqrt(gap);
            double moved = gap == 0.0 ? 0.0 : gap / divisor * (share < 1.0 ? share : 1.0);
            worst = moved > worst || moved != moved ? moved : worst;
        }
        change[p] = worst;
        largest[p] = most;
    }
}
