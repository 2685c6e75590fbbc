/* How far the traces rho = lambda + 1/lambda of many points have moved between two computations.

   It takes 2 to 6 % of the time of a smooth sweep (waveforms/harmonics.yaml and trapezoidal.yaml of configs/, 40 x 1024 and
   1 x 4000 points). */

#include <float.h>
#include <math.h>
#include <stdint.h>

#include "kernel.h"

/* |rho^2 - 4|^(1/2) = |lambda - 1/lambda| of rho = x + iy. */
static double split(double x, double y) {
    if (y == 0.0)
        return sqrt(fabs((x - 2.0) * (x + 2.0)));
    double square = (x - 2.0) * (x + 2.0) - y * y, twist = 2.0 * x * y;
    return sqrt(sqrt(square * square + twist * twist));
}

static double distance(double x, double y) { return y == 0.0 ? fabs(x) : sqrt(x * x + y * y); }

/* The numbers of compare.py, which says what they mean: fine and coarse (count, n, 2), change and largest (count,). */
void gearstab_trace_change(int64_t count, int64_t n, double weight, const double *fine, const double *coarse,
                           double *change, double *largest) {
    for (int64_t p = 0; p < count; p++, fine += 2 * n, coarse += 2 * n) {
        double most = 1.0, worst = 0.0;
        for (int64_t i = 0; i < n; i++) {
            double x = fine[2 * i], y = fine[2 * i + 1];
            double modulus = 0.5 * (distance(x, y) + split(x, y));
            most = modulus > most || modulus != modulus ? modulus : most;
        }
        for (int64_t i = 0; i < n; i++) {
            double x = fine[2 * i], y = fine[2 * i + 1], least = INFINITY;
            for (int64_t j = 0; j < n; j++) {
                double dx = coarse[2 * j] - x, dy = coarse[2 * j + 1] - y, square = dx * dx + dy * dy;
                least = square < least || square != square ? square : least;
            }
            if (least == 0.0)
                continue;
            double root = split(x, y), gap = sqrt(least), share = weight * 0.5 * (distance(x, y) + root) / most;
            double divisor = root * root > gap ? root : sqrt(gap);
            double moved = gap / divisor * (share < 1.0 ? share : 1.0);
            worst = moved > worst || moved != moved ? moved : worst;
        }
        change[p] = worst;
        largest[p] = most;
    }
}

/* The numbers of c_kernel.trace_condition: rho (count, n, 2), least, moved and apart (count,). */
void gearstab_trace_condition(int64_t count, int64_t n, const double *rho, const double *least, double *moved,
                              double *apart) {
    for (int64_t p = 0; p < count; p++, rho += 2 * n) {
        double worst = 0.0, closest = INFINITY, edge = sqrt(least[p]);
        for (int64_t i = 0; i < n; i++) {
            double x = rho[2 * i], y = rho[2 * i + 1], root = split(x, y), nearest = INFINITY;
            for (int64_t j = 0; j < n; j++) {
                if (j == i)
                    continue;
                double gap = distance(x - rho[2 * j], y - rho[2 * j + 1]);
                double size = root > DBL_MIN ? root : DBL_MIN;
                nearest = gap < nearest ? gap : nearest;
                /* The smaller of both quotients of a pair is met at the one with the larger root. */
                closest = gap / size < closest ? gap / size : closest;
            }
            nearest = nearest > 1.0 ? 1.0 : nearest < edge ? edge : nearest;
            double shift = least[p] / nearest, divisor = root * root > shift ? root : sqrt(shift);
            double turned = shift == 0.0 ? 0.0 : shift / divisor;
            worst = turned > worst || turned != turned ? turned : worst;
            closest = root < closest || root != root ? root : closest;
        }
        moved[p] = worst;
        apart[p] = closest;
    }
}
