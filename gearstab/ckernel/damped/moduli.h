/* The largest modulus of the eigenvalues of a small matrix, without the other eigenvalues.

   The roots of its characteristic polynomial are squared again and again (Dandelin and Graeffe), which parts the largest
   modulus r from the others. With the elementary symmetric functions e_j of the 2^k-th powers of m roots, a dominant root
   or pair is a root of z^2 - e_1 z + e_2; and where nothing comes to dominate, r^(2^k) is still max_j |e_j|^(1/j) up to a
   factor binom(m, j), which is nothing after all ROUNDS. From r the argument of the root follows, and a step of Newton on
   the polynomial itself both mends r and tells how sure it is: the derivative says what the rounding errors of the
   coefficients amount to. What it cannot tell is whether rounding, on the way, has let another root of nearly the same
   modulus win; where many squarings were needed they are done again with errors magnified. A point where any of this is
   more than TRUSTED is left to the QR algorithm.

   What it is worth: with QR for every point a scan of a damped pattern takes 2.8 to 5.2 times the time with AVX-512, 2.1 to
   4.2 with AVX2 and 1.8 to 3.2 without either (m = 4 and 6; the least with 16 segments a period, where propagation counts
   most), and floquet.solve on a map of 200 x 2000 points 3.6 times, with the same status everywhere and growths within
   1e-13. One point in 50,000 is left to QR at usual damping, one in 23 at damping ratios of 1e-6, where most are squared
   twice: scripts/bench/kernel.py prints these shares, to be looked at before a constant below is changed. */

#ifndef GEARSTAB_MODULI_H
#define GEARSTAB_MODULI_H

#define LARGEST_POWER 6 /* the order of the matrices */
#define TOGETHER 4      /* vectors whose roots are squared side by side: one alone waits for its own results, 2 to 5 % longer */
#define ROUNDS 10       /* of STEPS squarings; 2^-50 ln binom(6, 3) = 3e-15 */
#define STEPS 5         /* without scaling: r > 2^-3.2 (six equal roots, e_1 = 6 r) still gives e_6 > 2^-620 */
#define FIRST_LOOK 2    /* rounds before it is asked whether a root or pair dominates; 0 differs in last digits and takes 10 %
                           less at heavy damping, and as long elsewhere */
#define DOMINANT 1e-10  /* what the other roots may then still add to ln r */
#define LEAST_GAP 1e-3  /* however little a squaring may count, the others must be smaller by this */
#define SAFE 4          /* rounds, after which the largest two moduli differ by more than 1e-5 and rounding adds 1e-7 */
#define PERTURBATION 1e-8
#define AGREED 3e-10    /* by which Newton may differ from DOMINANT's result: more, and squaring has lost digits */
#define NEAR 1e-8       /* the distance from the root, on a logarithmic scale, whose square is nothing to Newton's step */
#define TURNS 3         /* steps along the circle, at most */
#define ROUNDING (8 * DBL_EPSILON) /* of e_j over the j-th power of the matrix's size */
#define TRUSTED 2e-13
#define LOG_TWO 0.6931471805599453

/* log2 of max_j |e_j|^(1/j), the exponent and mantissa of a number read as a piecewise linear logarithm. */
INLINE vec leading_exponent(const vec *e, int64_t m) {
    vec largest = all(-DBL_MAX);
    UNROLLED for (int64_t j = 1; j <= m; j++) {
        vec number = (vec)(((bits)magnitude(e[j]) >> 11) | UINT64_C(0x4330000000000000)) - (0x1p52 + 1023 * 0x1p41);
        largest = larger(number * (0x1p-41 / (double)j), largest);
    }
    return largest;
}

static const double SIGN[LARGEST_POWER + 1] = {1, -1, 1, 1, -1, -1, 1};

/* e_j of the squares of the roots: e_j^2 - 2 (e_(j-1) e_(j+1) - (e_(j-2) e_(j+2) - ...)), each product changed by a part of
   itself. */
INLINE void square_the_roots(vec *e, int64_t m, double change) {
    vec next[LARGEST_POWER + 1], changed[LARGEST_POWER + 1];
    UNROLLED for (int64_t j = 1; j <= m; j++)
        changed[j] = change == 0 ? e[j] : (1.0 + change * SIGN[j]) * e[j];
    UNROLLED for (int64_t j = 1; j <= m; j++) {
        int64_t last = j < m - j ? j : m - j;
        next[j] = e[j] * changed[j];
        if (last == 0)
            continue;
        vec sum = e[j - last] * changed[j + last];
        UNROLLED for (int64_t i = last - 1; i > 0; i--)
            sum = e[j - i] * changed[j + i] - sum;
        next[j] -= sum + sum;
    }
    UNROLLED for (int64_t j = 1; j <= m; j++)
        e[j] = next[j];
}

/* Divide the roots by a power of 2 near the largest of them; returns its exponent. */
INLINE vec divide_roots(vec *e, int64_t m) {
    vec largest = all(-150.0);
    UNROLLED for (int64_t j = 1; j <= m; j++)
        largest = larger(exponent_of(e[j]) * (1.0 / (double)j), largest);
    vec shifted = 0x1.8p52 - largest, factor = (vec)(((bits)shifted + 1023) << 52), power = factor;
    UNROLLED for (int64_t j = 1; j <= m; j++) {
        e[j] = e[j] * power;
        power = power * factor;
    }
    return 0x1.8p52 - shifted;
}

/* Border a trailing block of x (m, m) by row and column k: from the coefficients q of det(z - block) to those of the
   larger one, with x = [[a, r], [c, block]]: det(z - x) = (z - a) q(z) - r adj(z - block) c (Samuelson 1942, Berkowitz
   1984). The products r block^i c meet half way between powers on c and powers on r. */
INLINE void border(const vec *x, int64_t m, int64_t k, vec *q) {
    int64_t d = m - 1 - k;
    const vec *block = x + (k + 1) * (m + 1);
    vec t[LARGEST_POWER + 1], right[2][LARGEST_POWER], left[2][LARGEST_POWER], sum;
    t[0] = all(1.0);
    t[1] = -x[k * (m + 1)];
    UNROLLED for (int64_t i = 0; i < d; i++) {
        left[0][i] = x[k * m + k + 1 + i];
        right[0][i] = x[(k + 1 + i) * m + k];
    }
    UNROLLED for (int64_t p = 0; p < d; p++) {
        const vec *l = left[p / 2 % 2], *r = right[(p + 1) / 2 % 2];
        if (p > 0 && p % 2 == 0)
            UNROLLED for (int64_t j = 0; j < d; j++) {
                sum = block[j] * left[(p / 2 - 1) % 2][0];
                UNROLLED for (int64_t i = 1; i < d; i++)
                    sum += block[i * m + j] * left[(p / 2 - 1) % 2][i];
                left[p / 2 % 2][j] = sum;
            }
        if (p % 2)
            UNROLLED for (int64_t i = 0; i < d; i++) {
                sum = block[i * m] * right[p / 2 % 2][0];
                UNROLLED for (int64_t j = 1; j < d; j++)
                    sum += block[i * m + j] * right[p / 2 % 2][j];
                right[(p + 1) / 2 % 2][i] = sum;
            }
        sum = l[0] * r[0];
        UNROLLED for (int64_t i = 1; i < d; i++)
            sum += l[i] * r[i];
        t[p + 2] = -sum;
    }
    UNROLLED for (int64_t j = d + 1; j > 0; j--) {
        sum = t[j];
        UNROLLED for (int64_t i = j > d ? 1 : 0; i < j; i++)
            sum += t[i] * q[j - i];
        q[j] = sum;
    }
}

/* e_1..e_m of the eigenvalues of x (m, m), 4 <= m <= 6, from its trailing blocks. */
INLINE void characteristic_polynomial(const vec *x, int64_t m, vec *e) {
    e[0] = all(1.0);
    e[1] = -x[m * m - 1];
    border(x, m, m - 2, e);
    border(x, m, m - 3, e);
    border(x, m, m - 4, e);
    if (m > 4)
        border(x, m, m - 5, e);
    if (m > 5)
        border(x, m, m - 6, e);
    UNROLLED for (int64_t j = 1; j <= m; j += 2)
        e[j] = -e[j];
}

/* Whether the two largest roots, or the largest alone, are beyond the others to a relative error. */
INLINE mask dominated(const vec *e, double tolerance) {
    vec third = magnitude(e[1] * e[3]), fourth = magnitude(e[4]);
    return 2.0 * (third + fourth) <= tolerance * e[2] * e[2];
}

/* log2 of the larger modulus of the roots of z^2 - e_1 z + e_2, and whether they are real. */
INLINE vec log_of_pair(const vec *e, mask *real) {
    vec half = 0.5 * magnitude(e[1]), discriminant = half * half - e[2];
    *real = discriminant > 0.0;
    vec modulus = root(choose(*real, discriminant, magnitude(e[2]))) + choose(*real, half, all(0.0));
    return (1.0 / LOG_TWO) * logarithm(larger(modulus, all(DBL_MIN)));
}

/* What is known of a matrix: its characteristic polynomial, the square of its size, and the largest modulus of its
   eigenvalues as a logarithm, at first an approximation. */
struct spectrum {
    vec e[LARGEST_POWER + 1], square, value;
    double rounding; /* of e_j over the j-th power of the size */
    mask real, sound; /* whether the largest eigenvalue is real; whether it is surely that one */
};

/* ln of the largest modulus of the roots of `count` polynomials, which are destroyed, and whether that root is real;
   returns the rounds of squarings that it took. change: as in square_the_roots. */
INLINE int square_until_dominated(vec (*e)[LARGEST_POWER + 1], int64_t m, int count, double change, vec *value, mask *real) {
    mask simple[TOGETHER];
    double weight = 1.0;
    int k = 0;
    UNROLLED for (int c = 0; c < count; c++)
        value[c] = all(0.0);
    for (; k < ROUNDS; k++) {
        mask every = ~(mask){0};
        double tolerance = DOMINANT < LEAST_GAP * weight ? DOMINANT / weight : LEAST_GAP;
        UNROLLED for (int c = 0; c < count; c++) {
            value[c] += weight * divide_roots(e[c], m);
            every &= simple[c] = dominated(e[c], tolerance);
        }
        if (k >= FIRST_LOOK && !any(~every))
            break;
        for (int step = 0; step < STEPS; step++)
            UNROLLED for (int c = 0; c < count; c++)
                square_the_roots(e[c], m, change);
        weight *= 1.0 / (1 << STEPS);
    }
    UNROLLED for (int c = 0; c < count; c++) {
        vec last = log_of_pair(e[c], &real[c]);
        real[c] &= simple[c];
        if (any(~simple[c]))
            last = choose(simple[c], last, leading_exponent(e[c], m));
        value[c] = LOG_TWO * (value[c] + weight * last);
    }
    return k;
}

/* Whether the value stays where it is, but for as much as rounding may do, when everything is changed by PERTURBATION. */
static mask withstands(const struct spectrum *of, int64_t m) {
    vec e[1][LARGEST_POWER + 1], value, size = root(of->square), amount = all(PERTURBATION);
    mask real;
    e[0][0] = all(1.0);
    for (int64_t j = 1; j <= m; j++) {
        amount = amount * size;
        e[0][j] = of->e[j] + SIGN[j] * amount;
    }
    if (m == 6)
        square_until_dominated(e, 6, 1, PERTURBATION, &value, &real);
    else
        square_until_dominated(e, 4, 1, PERTURBATION, &value, &real);
    return magnitude(value - of->value) < TRUSTED * (PERTURBATION / ROUNDING);
}

/* The approximate value of TOGETHER spectra, m a constant where this is inlined. */
INLINE void approximate(struct spectrum *of, int64_t m) {
    vec e[TOGETHER][LARGEST_POWER + 1], value[TOGETHER];
    mask real[TOGETHER];
    UNROLLED for (int c = 0; c < TOGETHER; c++)
        UNROLLED for (int64_t j = 0; j <= m; j++)
            e[c][j] = of[c].e[j];
    int rounds = square_until_dominated(e, m, TOGETHER, 0.0, value, real);
    UNROLLED for (int c = 0; c < TOGETHER; c++) {
        of[c].value = value[c], of[c].real = real[c];
        of[c].sound = ~(mask){0};
    }
    for (int c = 0; c < TOGETHER && rounds > SAFE; c++) {
        of[c].sound = withstands(&of[c], m);
        COUNT(SQUARED_TWICE, LANES);
    }
}

/* p(r z) r^-m z^(-m/2) for |z| = 1 is f(x) + i Im(z) g(x) with x = z + 1/z. */
struct circle {
    vec f[4], g[3]; /* of degree 3 and 2, or one less for m = 4 */
};

INLINE struct circle on_circle(const vec *e, int64_t m, vec inverse) {
    struct circle of;
    vec c[LARGEST_POWER + 1], power = inverse;
    c[0] = all(1.0);
    UNROLLED for (int64_t j = 1; j <= m; j++) {
        c[j] = (j % 2 ? -e[j] : e[j]) * power;
        power = power * inverse;
    }
    vec ends = c[0] + c[m], next = c[1] + c[m - 1];
    if (m == 6) {
        of.f[3] = 0.5 * ends, of.f[2] = 0.5 * next, of.f[1] = 0.5 * (c[2] + c[4]) - 1.5 * ends, of.f[0] = c[3] - next;
        of.g[2] = c[0] - c[6], of.g[1] = c[1] - c[5], of.g[0] = (c[2] - c[4]) - of.g[2];
    } else {
        of.f[3] = all(0.0), of.f[2] = 0.5 * ends, of.f[1] = 0.5 * next, of.f[0] = c[2] - ends;
        of.g[2] = all(0.0), of.g[1] = c[0] - c[4], of.g[0] = c[1] - c[3];
    }
    return of;
}

INLINE vec cubic(const vec *f, vec x) { return ((f[3] * x + f[2]) * x + f[1]) * x + f[0]; }

/* x = 2 cos of the root on the circle: 2 or -2 if it is real, else the root of g that is also one of f. */
INLINE vec place_on_circle(const struct circle *of, int64_t m, mask real) {
    const vec *g = of->g;
    vec one, two;
    if (m == 6) {
        vec length = root(larger(g[1] * g[1] - 4.0 * (g[0] * g[2]), all(0.0)));
        vec w = -0.5 * (g[1] + with_sign_of(length, g[1])), over = 1.0 / (w * g[2]);
        one = g[0] * (g[2] * over), two = w * (w * over);
    } else {
        one = two = -g[0] / g[1];
    }
    one = choose(real, all(2.0), one), two = choose(real, all(-2.0), two);
    return choose(magnitude(cubic(of->f, one)) < magnitude(cubic(of->f, two)), one, two);
}

/* A step of Newton on ln z for the eigenvalue z of modulus exp(value), m = 4 or 6; returns where that is right to TRUSTED. */
INLINE mask refine(struct spectrum *of, int64_t m) {
    vec inverse = exponential(-of->value), step, size;
    struct circle circle = on_circle(of->e, m, inverse);
    const vec *f = circle.f, *g = circle.g;
    vec x = place_on_circle(&circle, m, of->real);
    mask near;
    for (int k = 0; k < TURNS; k++) {
        vec even = cubic(f, x), slope = (3.0 * f[3] * x + 2.0 * f[2]) * x + f[1], odd = (g[2] * x + g[1]) * x + g[0];
        vec sine = 1.0 - 0.25 * (x * x); /* squared */
        vec part = 0.5 * (x * odd) - 2.0 * sine * (2.0 * g[2] * x + g[1]); /* of dp/d ln z; the other is 2 sin slope */
        size = part * part + 4.0 * (sine * (slope * slope));
        step = (even * part + 2.0 * sine * (odd * slope)) / size;
        vec turn = odd * part - 2.0 * even * slope;
        near = (sine >= 0.0) & (sine * (turn * turn) < NEAR * NEAR * (size * size));
        if (!any(~near))
            break;
        x = choose(near, x, x + 2.0 * sine * turn / size); /* with little damping g alone tells x badly */
    }
    vec h = of->square * (inverse * inverse), noise = of->rounding * (((1.5 * h + 2.0) * h + 2.0) * h + 0.5);
    of->value = of->value - step;
    return of->sound & near & (noise * noise < TRUSTED * TRUSTED * size) & (magnitude(step) < AGREED);
}

/* The square of the size of x (m, m), by which the rounding errors of e are measured. */
INLINE vec squared_size(const vec *x, int64_t m) {
    vec sum = all(0.0);
    UNROLLED for (int64_t i = 0; i < m; i++) {
        vec line = x[i * m] * x[i * m];
        UNROLLED for (int64_t j = 1; j < m; j++)
            line += x[i * m + j] * x[i * m + j];
        sum += line;
    }
    return sum * (1.0 / (double)m);
}

#endif
