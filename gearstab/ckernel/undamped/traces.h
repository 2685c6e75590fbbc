/* rho = lambda + 1/lambda of a symplectic M from W = M + M^-1 = [[E, F], [G, E^T]], F and G skew.

   The rules are those of decision.py, to which the comments there apply; the thresholds come from there. */

#ifndef GEARSTAB_TRACES_H
#define GEARSTAB_TRACES_H

/* ---- n <= 3: elementary symmetric functions of the rho, see c_kernel.py */

#define M(i, j) x[(j) * 2 * n + (i)]
#define E_(i, j) (M(i, j) + M(n + (j), n + (i)))
#define F_(i, j) (M(i, n + (j)) - M(j, n + (i)))
#define G_(i, j) (M(n + (i), j) - M(n + (j), i))

INLINE void coefficients(const vec *x, int64_t n, vec s[3]) {
    if (n == 1) {
        s[0] = x[0] + x[3];
    } else if (n == 2) {
        vec a = E_(0, 0), b = E_(0, 1), c = E_(1, 0), d = E_(1, 1);
        s[0] = a + d;
        s[1] = (a * d - b * c) + F_(0, 1) * G_(0, 1);
    } else {
        vec e00 = E_(0, 0), e01 = E_(0, 1), e02 = E_(0, 2);
        vec e10 = E_(1, 0), e11 = E_(1, 1), e12 = E_(1, 2);
        vec e20 = E_(2, 0), e21 = E_(2, 1), e22 = E_(2, 2);
        vec f0 = F_(2, 1), f1 = F_(0, 2), f2 = F_(1, 0);
        vec g0 = G_(2, 1), g1 = G_(0, 2), g2 = G_(1, 0);
        vec c0 = e11 * e22 - e12 * e21, c1 = e12 * e20 - e10 * e22, c2 = e10 * e21 - e11 * e20;
        s[0] = e00 + e11 + e22;
        s[1] = (c0 + (e00 * e22 - e02 * e20)) + (e00 * e11 - e01 * e10) + (f0 * g0 + f1 * g1 + f2 * g2);
        s[2] = (e00 * c0 + e01 * c1 + e02 * c2) + f0 * (e00 * g0 + e01 * g1 + e02 * g2) +
               f1 * (e10 * g0 + e11 * g1 + e12 * g2) + f2 * (e20 * g0 + e21 * g1 + e22 * g2);
    }
}

/* p of y^3 + p y + q, x = y + s1/3; q in *last. */
INLINE vec depressed(const vec s[3], vec *last) {
    vec third = s[0] * (1.0 / 3.0);
    *last = (s[1] - 2.0 * third * third) * third - s[2];
    return s[1] - 3.0 * third * third;
}

/* The discriminant over its own size, but not less than 1; n = 2, 3. */
INLINE vec scaled_discriminant(const vec s[3], int64_t n) {
    if (n == 2) {
        vec half = 0.5 * s[0], square = half * half;
        return (square - s[1]) / larger(square + magnitude(s[1]), all(1.0));
    }
    vec q, p = depressed(s, &q);
    vec a = -4.0 * p * p * p, b = 27.0 * q * q;
    return (a - b) / larger(magnitude(a) + b, all(1.0));
}

/* Whether all roots lie in (-2, 2) provided they are real; the smaller |p(+-2)| in *edge. */
INLINE mask inside(const vec s[3], int64_t n, vec *edge) {
    vec up, down;
    mask result;
    if (n == 1) {
        up = 2.0 - s[0], down = -2.0 - s[0];
        result = (up > 0.0) & (down < 0.0);
    } else if (n == 2) {
        up = 4.0 - 2.0 * s[0] + s[1], down = 4.0 + 2.0 * s[0] + s[1];
        result = (up > 0.0) & (down > 0.0) & (magnitude(s[0]) < 4.0);
    } else {
        up = ((2.0 - s[0]) * 2.0 + s[1]) * 2.0 - s[2];
        down = -2.0 * ((2.0 + s[0]) * 2.0 + s[1]) - s[2];
        vec slope = 12.0 + s[1];
        result = (up > 0.0) & (down < 0.0) & (slope - 4.0 * s[0] > 0.0) & (slope + 4.0 * s[0] > 0.0) &
                 (magnitude(s[0]) < 6.0);
    }
    *edge = smaller(magnitude(up), magnitude(down));
    return result;
}

struct decision {
    mask stable, doubtful;
};

/* noise: errors of the coefficients beyond those of propagation, in units of those that it leaves on coefficients of one. */
INLINE struct decision classify(const vec s[3], int64_t n, const struct limits *limits, double noise) {
    vec size = all(1.0), edge;
    for (int64_t k = 0; k < n; k++)
        size = larger(magnitude(s[k]) * (1.0 / 3.0), size);
    struct decision found;
    found.stable = inside(s, n, &edge);
    found.doubtful = edge < limits->edge * (size + noise);
    if (n > 1) {
        vec discriminant = scaled_discriminant(s, n), distance = magnitude(discriminant);
        found.stable &= discriminant > 0.0;
        if (noise > 0.0)
            distance = distance * (size / (size + noise));
        found.doubtful |= (distance < limits->discriminant) | ((distance < limits->growth) & ~found.stable);
    }
    mask regular = size < limits->coefficient; /* false for NaN in the last coefficient */
    for (int64_t k = 0; k < n; k++)
        regular &= s[k] == s[k];
    found.doubtful |= ~regular;
    return found;
}

/* ---- growth = ln max |lambda| from rho = a + ib */

/* rho/2 = cosh(g + i theta): sinh^2 g is the larger root of y^2 - t y - (b/2)^2, t = |rho/2|^2 - 1. */
INLINE vec squared_sinh(vec real, vec imaginary) {
    vec a = 0.5 * magnitude(real), b = 0.5 * imaginary;
    vec t = (a - 1.0) * (a + 1.0) + b * b, square = 4.0 * b * b;
    vec length = root(t * t + square);
    return choose(t > 0.0, 0.5 * (length + t), 0.5 * square / larger(length - t, all(DBL_MIN)));
}

INLINE vec growth_from(vec squared) {
    vec y = root(squared);
    return logarithm1p(y + squared / (1.0 + root(1.0 + squared)));
}

/* An upper bound on |x|^(1/3), within 15 %. */
INLINE vec cube_root_bound(vec x) {
    /* A third of the exponent; the mantissa's bits interpolate between powers of two. */
    const double bias = 0x1p52;
    vec number = (vec)(((bits)magnitude(x) >> 20) | UINT64_C(0x4330000000000000)) - bias;
    vec third = number * (1.0 / 3.0) + 682 * 0x1p32 + bias; /* 682 is two thirds of the exponents' offset */
    return 1.12 * (vec)((bits)third << 20);
}

/* Newton towards two roots of the cubic, each from beyond the outermost root on its side: monotonic, however close the
   next one. A root that is found stays, so that a point has the same bits beside whatever others. */
INLINE void outermost(const vec s[3], vec x[2]) {
    mask moving[2];
    moving[0] = moving[1] = all(0.0) == 0.0;
    for (int k = 0; k < 30; k++) {
        UNROLLED for (int i = 0; i < 2; i++) {
            vec value = ((x[i] - s[0]) * x[i] + s[1]) * x[i] - s[2], slope = (3.0 * x[i] - 2.0 * s[0]) * x[i] + s[1];
            vec step = choose(moving[i] & (slope != 0.0), value / slope, all(0.0));
            x[i] = x[i] - step;
            moving[i] &= magnitude(step) > 1e-9 * magnitude(x[i]);
        }
        if (!any(moving[0] | moving[1]))
            break; /* the error left is of the order of the square */
    }
}

/* sinh^2 of the growth of a cubic with simple roots. */
INLINE vec cubic_growth(const vec s[3]) {
    vec q, p = depressed(s, &q), third = s[0] * (1.0 / 3.0), square = magnitude(p) * (1.0 / 3.0), length = root(square);
    vec far = 2.0 * larger(length, cube_root_bound(0.5 * q)), near = far;
    mask real = -4.0 * p * p * p - 27.0 * q * q > 0.0;
    /* For p < 0 the outermost roots are 2 length cos(acos(+-c)/3), c = |q|/(2 length^3), concave in c (beyond 1 too, as a
       cosh): its tangents at +-1/2 are bounds, which save 2 to 4 % of a scan. */
    vec slope = magnitude(q) / larger(square, all(DBL_MIN));
    far = choose(p < 0.0, smaller(far, 1.747742 * length + 0.131644 * slope), far);
    near = choose(real, smaller(near, 1.7795 * length - 0.247409 * slope), near);
    vec x[2] = {with_sign_of(far, -q) + third, with_sign_of(near, q) + third};
    x[1] = choose(real, x[1], x[0]);
    outermost(s, x);
    vec largest = larger(squared_sinh(x[0], all(0.0)), squared_sinh(x[1], all(0.0)));
    if (any(~real)) {
        /* The complex pair a +- ib from the quadratic that the real root leaves, and a step of Newton on the cubic. */
        vec a = 0.5 * (s[0] - x[0]), shifted = x[0] - third;
        vec b = root(larger(p + 0.75 * shifted * shifted, all(0.0)));
        for (int k = 0; k < 2; k++) {
            vec u = a - s[0], u1 = u * a - b * b + s[1], v1 = b * (u + a);
            vec value = u1 * a - v1 * b - s[2], value_i = u1 * b + v1 * a;
            vec t = 3.0 * a - 2.0 * s[0], slope = t * a - 3.0 * b * b + s[1], slope_i = b * (t + 3.0 * a);
            vec size = slope * slope + slope_i * slope_i;
            size = choose(size > DBL_MIN, size, all(1.0));
            a = a - (value * slope + value_i * slope_i) / size;
            b = b - (value_i * slope - value * slope_i) / size;
        }
        largest = choose(real, largest, larger(squared_sinh(a, b), largest));
    }
    return largest;
}

/* ln max |lambda| of unstable points. */
INLINE vec growth_of(const vec s[3], int64_t n) {
    if (n == 1)
        return growth_from(squared_sinh(s[0], all(0.0)));
    if (n == 3)
        return growth_from(cubic_growth(s));
    vec half = 0.5 * s[0], discriminant = half * half - s[1], distance = root(magnitude(discriminant));
    mask real = discriminant > 0.0;
    vec far = half + choose(real, with_sign_of(distance, half), all(0.0));
    return growth_from(squared_sinh(far, choose(real, all(0.0), distance)));
}

#undef M
#undef E_
#undef F_
#undef G_

/* ---- any n: Paige & Van Loan (1981), "A Schur decomposition for Hamiltonian matrices" */

/* g <- P g P = g + v p^T - p v^T, p = beta g v, with P = I - beta v v^T on rows and columns k.., v (n - k,), for a skew g of
   which only what lies above the diagonal is kept, without rows before `top`. */
INLINE void both_sides_skew(vec *g, int64_t n, int64_t k, int64_t top, const vec *v, vec beta, vec *p) {
    int64_t count = n - k;
    for (int64_t i = top; i < k; i++)
        reflect_line(g + i * n + k, count, v, beta);
    for (int64_t i = 0; i < count; i++)
        p[i] = all(0.0);
    for (int64_t i = 0; i < count; i++) {
        const vec *line = g + (k + i) * n + k;
        vec sum = p[i];
        for (int64_t c = i + 1; c < count; c++) {
            sum += line[c] * v[c];
            p[c] -= line[c] * v[i];
        }
        p[i] = beta * sum;
    }
    for (int64_t i = 0; i < count; i++) {
        vec *line = g + (k + i) * n + k;
        for (int64_t c = i + 1; c < count; c++)
            line[c] += v[i] * p[c] - p[i] * v[c];
    }
}

/* Rotate coordinates k and n + k so that g[k][j] vanishes against e[k][j], j = k - 1. */
INLINE void rotate_pair(vec *e, vec *f, vec *g, int64_t n, int64_t k) {
    int64_t j = k - 1;
    vec a = e[k * n + j], b = -g[j * n + k], length = root(a * a + b * b);
    mask acts = length > DBL_MIN;
    vec inverse = 1.0 / choose(acts, length, all(1.0));
    vec c = choose(acts, a * inverse, all(1.0)), s = choose(acts, b * inverse, all(0.0));
    for (int64_t i = 0; i < k; i++) {
        vec *eik = e + i * n + k, *fik = f + i * n + k, old = *eik;
        *eik = c * old + s * *fik;
        *fik = c * *fik - s * old;
    }
    for (int64_t i = k + 1; i < n; i++) {
        vec *eik = e + i * n + k, *fki = f + k * n + i, old = *eik;
        *eik = c * old - s * *fki;
        *fki = c * *fki + s * old;
        vec *eki = e + k * n + i, *gki = g + k * n + i;
        old = *eki;
        *eki = c * old + s * *gki;
        *gki = c * *gki - s * old;
    }
    e[k * n + j] = c * a + s * b;
    g[j * n + k] = all(0.0);
}

/* Orthogonal symplectic reduction of [[e, f], [g, e^T]] to [[h, *], [0, h^T]], h Hessenberg, in place of e; of the skew f and g
   what lies above the diagonal is used; work (2, n). Inlined, as a constant n makes it twice as fast. */
INLINE void paige_van_loan(vec *e, vec *f, vec *g, int64_t n, vec *work) {
    vec *v = work, *p = work + n, beta;
    for (int64_t k = 1; k < n; k++)
        for (int turn = 0; turn < 2; turn++) {
            /* Column k - 1 of g, which is its row but for the sign, and of e. */
            vec *column = turn == 0 ? g + (k - 1) * n + k : e + k * n + k - 1;
            int64_t stride = turn == 0 ? 1 : n;
            if (k + 1 < n) {
                vec end = reflector(column, n - k, stride, &v[0], &beta);
                for (int64_t i = 1; i < n - k; i++)
                    v[i] = column[i * stride];
                reflect_rows(e, n, k, n - k, turn == 0 ? k - 1 : k, v, beta);
                reflect_columns(e, n, k, n - k, v, beta);
                both_sides_skew(f, n, k, 0, v, beta, p);
                both_sides_skew(g, n, k, k, v, beta, p);
                column[0] = end;
                for (int64_t i = 1; i < n - k; i++)
                    column[i * stride] = all(0.0);
            }
            if (turn == 0)
                rotate_pair(e, f, g, n, k);
        }
}

/* rho (n,) as real and imaginary parts from the monodromy matrix x (2n, 2n), which is destroyed; the largest entry of W is
   returned. work (3 n + 2, n). */
static vec general_traces(vec *x, int64_t n, vec *real, vec *imaginary, vec *work) {
    vec *e = work, *f = e + n * n, *g = f + n * n, size = all(0.0);
#define M(i, j) x[(j) * 2 * n + (i)]
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++) {
            e[i * n + j] = M(i, j) + M(n + j, n + i);
            f[i * n + j] = M(i, n + j) - M(j, n + i);
            g[i * n + j] = M(n + i, j) - M(n + j, i);
        }
#undef M
    size = largest_entry(e, 3 * n * n);
    paige_van_loan(e, f, g, n, g + n * n);
    hessenberg_eigenvalues(e, n, real, imaginary);
    return size;
}

#endif
