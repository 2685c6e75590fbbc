/* The largest modulus of the eigenvalues of a small matrix, without the eigenvalues.

   Traces of powers give the characteristic polynomial (Newton's identities); squaring its roots again and again (Dandelin and
   Graeffe) parts the largest modulus r from the others. With the elementary symmetric functions e_j of the 2^k-th powers of m
   roots, a dominant root or pair is a root of z^2 - e_1 z + e_2; and where nothing comes to dominate, r^(2^k) is still max_j
   |e_j|^(1/j) up to a factor binom(m, j), which is nothing after all ROUNDS. The price is the condition of the roots of
   polynomials, the first and the following, so that it is measured: the same is done with rounding errors magnified, and
   where the result moves too much the point is left to the QR algorithm. */

#ifndef GEARSTAB_MODULI_H
#define GEARSTAB_MODULI_H

#define LARGEST_POWER 6 /* the order of the matrices */
#define ROUNDS 10       /* of STEPS squarings; 2^-50 ln binom(6, 3) = 3e-15 */
#define STEPS 5         /* without scaling: r > 2^-3.2 (six equal roots, e_1 = 6 r) still gives e_6 > 2^-620 */
#define FIRST_LOOK 2    /* rounds before it is asked whether a root or pair dominates */
#define PERTURBATION 1e-8
#define ROUNDING (8 * DBL_EPSILON) /* of e_j over the j-th power of the matrix's size */
#define TRUSTED 2e-13
#define LOG_TWO 0.6931471805599453

static const double SIGN[LARGEST_POWER] = {1, -1, 1, 1, -1, -1};

/* log2 of max_j |e_j|^(1/j), the exponent and mantissa of a number read as a piecewise linear logarithm. */
INLINE vec leading_exponent(const vec *e, int64_t m) {
    vec largest = all(-DBL_MAX);
    UNROLLED for (int64_t j = 1; j <= m; j++) {
        vec number = (vec)(((bits)magnitude(e[j]) >> 11) | UINT64_C(0x4330000000000000)) - (0x1p52 + 1023 * 0x1p41);
        largest = larger(number * (0x1p-41 / (double)j), largest);
    }
    return largest;
}

/* e_j of the squares of the roots: e_j^2 + 2 sum_i (-1)^i e_(j-i) e_(j+i), each product changed by a part of itself. */
INLINE void square_the_roots(vec *e, int64_t m, double change) {
    vec next[LARGEST_POWER + 1];
    UNROLLED for (int64_t j = 1; j <= m; j++) {
        vec sum = all(0.0);
        int64_t last = j < m - j ? j : m - j;
        UNROLLED for (int64_t i = 1; i <= last; i++)
            sum += (i % 2 ? -2.0 : 2.0) * (1.0 + change * SIGN[(i + j) % LARGEST_POWER]) * (e[j - i] * e[j + i]);
        next[j] = (1.0 + change * SIGN[j - 1]) * (e[j] * e[j]) + sum;
    }
    UNROLLED for (int64_t j = 1; j <= m; j++)
        e[j] = next[j];
}

/* Divide the roots by a power of 2 near the largest of them; returns its exponent. */
INLINE vec divide_roots(vec *e, int64_t m) {
    vec shifted = 0x1.8p52 - larger(smaller(leading_exponent(e, m), all(150.0)), all(-150.0));
    vec exponent = 0x1.8p52 - shifted;
    vec factor = (vec)(((bits)shifted + 1023) << 52), power = factor;
    UNROLLED for (int64_t j = 1; j <= m; j++) {
        e[j] = e[j] * power;
        power = power * factor;
    }
    return exponent;
}

/* result = a b, all (m, m). */
INLINE void multiply(const vec *a, const vec *b, int64_t m, vec *result) {
    for (int64_t i = 0; i < m; i++)
        UNROLLED for (int64_t j = 0; j < m; j++) {
            vec sum = a[i * m] * b[j];
            UNROLLED for (int64_t l = 1; l < m; l++)
                sum += a[i * m + l] * b[l * m + j];
            result[i * m + j] = sum;
        }
}

/* e_1..e_m of the eigenvalues of x (m, m) from the traces of its powers, m <= 6. */
INLINE void characteristic_polynomial(const vec *x, int64_t m, vec *e) {
    vec second[LARGEST_POWER * LARGEST_POWER], third[LARGEST_POWER * LARGEST_POWER], trace[LARGEST_POWER + 1];
    const vec *power[] = {x, second, third};
    multiply(x, x, m, second);
    if (m > 4)
        multiply(second, x, m, third);
    trace[1] = all(0.0);
    UNROLLED for (int64_t i = 0; i < m; i++)
        trace[1] += x[i * (m + 1)];
    UNROLLED for (int64_t k = 2; k <= m; k++) {
        const vec *a = power[k / 2 - 1], *b = power[k - k / 2 - 1];
        vec sum = all(0.0);
        UNROLLED for (int64_t i = 0; i < m; i++)
            UNROLLED for (int64_t j = 0; j < m; j++)
                sum += a[i * m + j] * b[j * m + i];
        trace[k] = sum;
    }
    e[0] = all(1.0);
    UNROLLED for (int64_t k = 1; k <= m; k++) {
        vec sum = all(0.0);
        UNROLLED for (int64_t i = 1; i <= k; i++)
            sum += (i % 2 ? 1.0 : -1.0) * (e[k - i] * trace[i]);
        e[k] = sum * (1.0 / (double)k);
    }
}

/* Whether the two largest roots, or the largest alone, are beyond the others to all digits. */
INLINE mask dominated(const vec *e, int64_t m) {
    vec third = m > 2 ? magnitude(e[1] * e[3]) : all(0.0), fourth = m > 3 ? magnitude(e[4]) : all(0.0);
    return 2.0 * (third + fourth) <= DBL_EPSILON * e[2] * e[2];
}

/* log2 of the larger modulus of the roots of z^2 - e_1 z + e_2. */
INLINE vec log_of_pair(const vec *e) {
    vec half = 0.5 * magnitude(e[1]), discriminant = half * half - e[2];
    vec modulus = choose(discriminant > 0.0, half + root(magnitude(discriminant)), root(magnitude(e[2])));
    return (1.0 / LOG_TWO) * logarithm(larger(modulus, all(DBL_MIN)));
}

/* ln max |lambda| of x (m, m), 2 <= m <= 6 a constant where this is inlined; in *sure where that is right to TRUSTED. */
INLINE vec largest_modulus(const vec *x, int64_t m, mask *sure) {
    vec e[2][LARGEST_POWER + 1], result[2] = {all(0.0), all(0.0)}, size = all(0.0), amount = all(PERTURBATION);
    characteristic_polynomial(x, m, e[0]);
    UNROLLED for (int64_t i = 0; i < m * m; i++)
        size += x[i] * x[i];
    size = root(size * (1.0 / (double)m));
    e[1][0] = e[0][0];
    UNROLLED for (int64_t j = 1; j <= m; j++) {
        amount = amount * size;
        e[1][j] = e[0][j] + SIGN[j - 1] * amount;
    }
    double weight = 1.0;
    mask simple = {0};
    for (int k = 0; k < ROUNDS; k++) {
        for (int c = 0; c < 2; c++)
            result[c] += weight * divide_roots(e[c], m);
        simple = dominated(e[0], m) & dominated(e[1], m);
        if (k >= FIRST_LOOK && !any(~simple))
            break;
        for (int step = 0; step < STEPS; step++) {
            square_the_roots(e[0], m, 0.0);
            square_the_roots(e[1], m, PERTURBATION);
        }
        weight *= 1.0 / (1 << STEPS);
    }
    for (int c = 0; c < 2; c++)
        result[c] += weight * choose(simple, log_of_pair(e[c]), leading_exponent(e[c], m));
    *sure = magnitude(result[1] - result[0]) < TRUSTED / LOG_TWO * (PERTURBATION / ROUNDING);
    return LOG_TWO * result[0];
}

#endif
