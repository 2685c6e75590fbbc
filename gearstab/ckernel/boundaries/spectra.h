/* Multipliers of one row at scattered periods, LANES at once: what the search for instability boundaries asks for.

   Each of the n pairs of multipliers lambda, 1/lambda = exp(+-(g + i phi)) is given by its angle phi in [0, pi] and its growth
   g >= 0: 0 on the unit circle; angle 0 or pi with growth off it on the real axis; a quadruple off it is two equal pairs.

   They come from rho = lambda + 1/lambda, the n double eigenvalues of W = M + M^-1, found by orthogonal transformations only.
   Where two pairs meet without opening a tongue, or are alike in a symmetric system, the 2 x 2 block of W that belongs to them
   is a multiple of I but for rounding: its eigenvalues are then right to the last digit, where those of M, or of the
   characteristic polynomial, lose half of them. */

#ifndef GEARSTAB_SPECTRA_H
#define GEARSTAB_SPECTRA_H

/* Operations S (4n + 6) a column from which interpolation beats propagation: 32 nodes, 4n^2 entries. Without any a search takes
   8 to 11 % longer for tooth ratios of 9/10 and 19/20, and as long for 3/5 and 4/5; the number itself hardly matters. */
#define PAYS_FROM 200
#define SMALL_PART 0x1p-20    /* imaginary parts above this are no rounding errors */
#define WITHIN 4.0            /* times noise/d: members of a group lie no farther apart */
#define BESIDE_OTHERS 0.1     /* of the distance to another group: imaginary parts are below this */

/* s -> arctan s for 0 <= s <= 1. */
INLINE vec arctangent(vec s) {
    vec t = s / (1.0 + root(1.0 + s * s)), z = t * t; /* of half the angle: t <= tan(pi/8) */
    vec p = -0.017805397205419446 * z + 0.03796525745386593; /* error 1e-18 */
    p = p * z - 0.05035102456601552;
    p = p * z + 0.05846878297330872;
    p = p * z - 0.06662951813629191;
    p = p * z + 0.07692045330902225;
    p = p * z - 0.09090896809064027;
    p = p * z + 0.11111110744919658;
    p = p * z - 0.14285714279250245;
    p = p * z + 0.19999999999940893;
    p = p * z - 0.3333333333333312;
    return 2.0 * ((t * z) * p + t);
}

/* Angle and growth of rho = a + ib; what rounding errors of size `noise` make of rho = +-2 or of a real rho is taken back. */
INLINE vec angle_of(vec a, vec b, vec noise, vec *growth) {
    b = choose(magnitude(b) <= noise, all(0.0), b);
    mask rim = (b == 0.0) & (magnitude(magnitude(a) - 2.0) <= noise);
    a = choose(rim, with_sign_of(2.0 - noise, a), a);
    vec squared = squared_sinh(a, b), reach = 2.0 * root(1.0 + squared);
    mask outside = (b != 0.0) | (magnitude(a) > 2.0);
    *growth = choose(outside, growth_from(squared), all(0.0));
    /* tan^2(phi/2) = (2 cosh g - a)/(2 cosh g + a) */
    reach = choose(outside, reach, all(2.0));
    vec below = larger(reach - a, all(0.0)), above = larger(reach + a, all(0.0));
    mask steep = below > above;
    vec ratio = smaller(below, above) / larger(larger(below, above), all(DBL_MIN));
    vec half = arctangent(root(choose(outside & (b == 0.0), all(0.0), ratio)));
    return choose(steep, 0.5 * TURN - 2.0 * half, 2.0 * half);
}

/* Eigenvalues of the 2 x 2 matrix [[a, b], [c, d]]. */
INLINE void pair_of(vec a, vec b, vec c, vec d, vec *real, vec *imaginary) {
    vec half = 0.5 * (a - d), square = half * half + b * c, distance = root(magnitude(square));
    mask complex = square < 0.0;
    vec middle = d + half;
    real[0] = choose(complex, middle, middle + distance);
    real[1] = choose(complex, middle, middle - distance);
    imaginary[0] = choose(complex, distance, all(0.0));
    imaginary[1] = -imaginary[0];
}

/* The real eigenvalue of h (3, 3) that is farther from the two others than these are from each other, or the only one. */
INLINE vec apart(const vec *h) {
    vec third = (h[0] + h[4] + h[8]) * (1.0 / 3.0), a = h[0] - third, d = h[4] - third, g = h[8] - third;
    vec minor = d * g - h[5] * h[7];
    /* y^3 + p y + q = det(y - (h - third)) */
    vec p = minor + (a * d - h[1] * h[3]) + (a * g - h[2] * h[6]);
    vec q = -(a * minor + h[1] * (h[5] * h[6] - h[3] * g) + h[2] * (h[3] * h[7] - d * h[6]));
    vec square = magnitude(p) * (1.0 / 3.0), length = root(square);
    /* Newton from beyond the outermost root on the side opposite to q, see cubic_growth. */
    vec far = 2.0 * larger(length, cube_root_bound(0.5 * q));
    far = choose(p < 0.0, smaller(far, 1.747742 * length + 0.131644 * (magnitude(q) / larger(square, all(DBL_MIN)))), far);
    vec y = with_sign_of(far, -q);
    for (int k = 0; k < 30; k++) {
        vec value = (y * y + p) * y + q, slope = 3.0 * y * y + p;
        vec step = choose(slope == 0.0, all(0.0), value / slope);
        y = y - step;
        if (!any(magnitude(step) > 1e-6 * magnitude(y)))
            break; /* what is left is of the order of the square, and the deflation below does not ask for more */
    }
    return y + third;
}

/* Eigenvalues of h (3, 3): split off the one that is apart by a reflection of its eigenvector. */
INLINE void three_of(const vec *h, vec *real, vec *imaginary) {
    vec r = apart(h), a = h[0] - r, d = h[4] - r, g = h[8] - r;
    /* Columns of the adjugate of h - r are multiples of the eigenvector; the longest one. */
    vec v[3][3] = {{d * g - h[5] * h[7], h[5] * h[6] - h[3] * g, h[3] * h[7] - d * h[6]},
                   {h[2] * h[7] - h[1] * g, a * g - h[2] * h[6], h[1] * h[6] - a * h[7]},
                   {h[1] * h[5] - h[2] * d, h[2] * h[3] - a * h[5], a * d - h[1] * h[3]}};
    vec best = v[0][0] * v[0][0] + v[0][1] * v[0][1] + v[0][2] * v[0][2];
    for (int k = 1; k < 3; k++) {
        vec size = v[k][0] * v[k][0] + v[k][1] * v[k][1] + v[k][2] * v[k][2];
        mask longer = size > best;
        best = choose(longer, size, best);
        for (int i = 0; i < 3; i++)
            v[0][i] = choose(longer, v[k][i], v[0][i]);
    }
    /* P = I - beta u u^T turns it into the first unit vector. */
    vec u[3] = {v[0][0] + with_sign_of(root(best), v[0][0]), v[0][1], v[0][2]};
    vec square = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    vec beta = choose(square > DBL_MIN, 2.0 / choose(square > DBL_MIN, square, all(1.0)), all(0.0));
    vec t[9], row[3], column[3];
    for (int j = 0; j < 3; j++)
        row[j] = beta * (u[0] * h[j] + u[1] * h[3 + j] + u[2] * h[6 + j]);
    for (int i = 0; i < 9; i++)
        t[i] = h[i] - u[i / 3] * row[i % 3];
    for (int i = 0; i < 3; i++)
        column[i] = beta * (t[3 * i] * u[0] + t[3 * i + 1] * u[1] + t[3 * i + 2] * u[2]);
    for (int i = 0; i < 9; i++)
        t[i] -= column[i / 3] * u[i % 3];
    real[0] = t[0], imaginary[0] = all(0.0);
    pair_of(t[4], t[5], t[7], t[8], real + 1, imaginary + 1);
}

/* rho of the monodromy matrix x, as general_traces, n <= 3 a constant where this is inlined. */
INLINE void few_traces(const vec *x, int64_t n, vec *real, vec *imaginary, vec *work) {
    vec e[9], f[9], g[9];
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++) {
            e[i * n + j] = x[j * 2 * n + i] + x[(n + i) * 2 * n + n + j];
            f[i * n + j] = x[(n + j) * 2 * n + i] - x[(n + i) * 2 * n + j];
            g[i * n + j] = x[j * 2 * n + n + i] - x[i * 2 * n + n + j];
        }
    paige_van_loan(e, f, g, n, work);
    if (n == 1)
        real[0] = e[0], imaginary[0] = all(0.0);
    else if (n == 2)
        pair_of(e[0], e[1], e[2], e[3], real, imaginary);
    else
        three_of(e, real, imaginary);
}

/* The same for any n. */
static void traces_of(vec *x, int64_t n, vec *real, vec *imaginary, vec *work) {
    switch (n) {
    case 1: few_traces(x, 1, real, imaginary, work); break;
    case 2: few_traces(x, 2, real, imaginary, work); break;
    case 3: few_traces(x, 3, real, imaginary, work); break;
    default: general_traces(x, n, real, imaginary, work);
    }
}

/* Take back what rounding errors have parted several equal rho by, as identical parts have them. Each of two such groups that are
   coupled and lie apart by d has a condition of 1/d, so that errors of size `noise` become noise/d: an imaginary part of that
   size, small beside d, is one of real rho. That of a quadruple, or of several, has no other group beside it, but where parts
   are nearly identical the rho of its twin. Two groups have at least four members. Returns the largest that was taken back. */
static vec settle_equals(int64_t n, const vec *real, vec *imaginary, vec noise) {
    vec taken = all(0.0);
    for (int64_t i = 0; n > 3 && i < n; i++) {
        vec size = magnitude(imaginary[i]), apart = all(1.0);
        mask doubtful = (size > noise) & (size < SMALL_PART);
        if (!any(doubtful))
            continue;
        for (int64_t j = 0; j < n; j++) {
            vec distance = magnitude(real[j] - real[i]);
            mask group = {0};
            for (int64_t k = 0; k < n; k++)
                if (k != j)
                    group |= magnitude(real[k] - real[j]) * distance <= WITHIN * noise;
            apart = choose(group & (distance * BESIDE_OTHERS >= size), smaller(apart, distance), apart);
        }
        mask equal = doubtful & (size * apart <= noise);
        taken = choose(equal, larger(size, taken), taken);
        /* The conjugate has the same neighbours, and the same answer. */
        for (int64_t j = 0; any(equal) && j < n; j++)
            imaginary[j] = choose(equal & (real[j] == real[i]) & (magnitude(imaginary[j]) == size), all(0.0), imaginary[j]);
    }
    return taken;
}

/* A row and room for its points. */
struct spectra {
    const struct conservative *pattern;
    struct row row;
    struct room room;
    double *unit; /* (2n,) */
    double type;  /* exponential type of the row's matrices, as functions of the period */
};

static void spectra_free(void *given) {
    struct spectra *s = given;
    if (!s)
        return;
    panels_free(&s->room.panels);
    row_free(&s->row);
    free(s->room.memory);
    free(s->unit);
    free(s);
}

static void *spectra_new(const struct conservative *pattern) {
    struct spectra *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    s->pattern = pattern;
    s->unit = malloc(2 * (size_t)pattern->n * sizeof *s->unit);
    if (!s->unit || row_new(&s->row, pattern) || room_new(&s->room, pattern->n) ||
        panels_new(&s->room.panels, pattern->n, PAYING)) {
        spectra_free(s);
        return NULL;
    }
    return s;
}

/* Units in which all modes of the first segment turn on circles: in others the entries of M differ by ratios of frequencies,
   its rounding errors are those of the largest, and it grows beyond what may be interpolated. */
static void units_set(struct spectra *s) {
    int64_t n = s->row.n;
    for (int64_t i = 0; i < n; i++) {
        const struct mode *mode = s->row.modes + i;
        s->unit[i] = mode->kind == FREE ? 1.0 : sqrt(mode->frequency);
        s->unit[n + i] = 1.0 / s->unit[i];
    }
}

/* Turn to a row. Returns the longest window (in cycle) whose matrices may be interpolated; infinite where that does not pay. */
static double spectra_row(void *given, int64_t index) {
    struct spectra *s = given;
    row_set(&s->row, s->pattern, index);
    units_set(s);
    s->room.panels.count = 0;
    s->room.panels.balance = s->unit;
    if (s->row.segments * (4 * s->row.n + 6) < PAYS_FROM)
        return INFINITY;
    double type = 0.0;
    for (int64_t k = 0; k < s->row.segments; k++) {
        double most = 0.0;
        for (int64_t i = 0; i < s->row.n; i++) {
            const struct mode *mode = s->row.modes + k * s->row.n + i;
            most = mode->kind != FREE && fabs(mode->phase) > most ? fabs(mode->phase) : most;
        }
        type += TURN * most;
    }
    s->type = type;
    return 2.0 * HALF_PHASE / (type * s->row.cycles);
}

/* Interpolate between these cycles from now on, where the matrices allow it. */
static void spectra_window(void *given, double first, double last) {
    struct spectra *s = given;
    struct panels *panels = &s->room.panels;
    panels->first = s->row.cycles * first;
    panels->length = s->row.cycles * (last - first);
    panels->terms = terms_of(0.5 * panels->length * s->type);
    panels->panel[0] = (struct panel){.points = PAYING};
    panels->count = 1;
    panels_room(panels, s->row.n);
    if (panels->panel[0].coefficient)
        panels->panel[0].size = panel_fill(panels, &s->row, 0, s->room.work);
    panels->count = panels->panel[0].size > 0.0;
}

/* The monodromy matrix at LANES periods in balanced units, and the scale taken out of it; by how much its errors exceed those of a
   propagated one. */
INLINE vec balanced_matrix(struct spectra *s, vec period, vec *magnified) {
    *magnified = all(1.0);
    if (interpolate(&s->room.panels, s->row.n, period, s->room.x, magnified))
        return all(0.0);
    vec scale = propagate(&s->row, period, s->room.x, s->room.work);
    rescale(s->unit, s->row.n, s->room.x);
    return scale;
}

/* Points cycle (count,): angle and growth (count, n), the largest entry of M, infinite where it is beyond all digits, and the largest
   imaginary part of rho that was taken for rounding errors of equal ones. */
static void spectra_at(void *given, int64_t count, const double *cycle, double *angle, double *growth, double *size,
                       double *taken) {
    struct spectra *s = given;
    int64_t n = s->row.n;
    vec *x = s->room.x, *real = s->room.real, *imaginary = s->room.imaginary, *work = s->room.work;
    for (int64_t k = 0; k < count && !gearstab_stopped(); k += LANES) {
        vec magnified, scale = balanced_matrix(s, s->row.cycles * load_part(cycle, k, count), &magnified);
        vec largest = magnified * larger(largest_entry(x, 4 * n * n), all(1.0));
        traces_of(x, n, real, imaginary, work);
        vec noise = NOISE * largest;
        store_part(taken, k, count, settle_equals(n, real, imaginary, noise));
        for (int64_t i = 0; i < n; i++) {
            vec own, phi = angle_of(real[i], imaginary[i], noise, &own);
            for (int64_t lane = 0; lane < LANES && k + lane < count; lane++) {
                angle[(k + lane) * n + i] = phi[lane];
                growth[(k + lane) * n + i] = own[lane];
            }
        }
        store_part(size, k, count, choose(scale == 0.0, largest, all(INFINITY)));
    }
}

/* Points cycle (count,), each with its lines (count,) of `room` angles: how many eigenvalues of S are negative there, below
   (count, room), or -1 where that is not known, see inertia.h. */
static void spectra_below(void *given, int64_t count, int64_t room, const double *cycle, const int64_t *lines,
                          const double *angle, int64_t *below) {
    struct spectra *s = given;
    int64_t n = s->row.n;
    vec *x = s->room.x, *form = s->room.work, *inverse = form + n * n;
    for (int64_t k = 0; k < count && !gearstab_stopped(); k += LANES) {
        vec magnified, scale = balanced_matrix(s, s->row.cycles * load_part(cycle, k, count), &magnified), size;
        mask right = held_form(x, n, form, inverse) & (scale == 0.0);
        int64_t most = 0;
        for (int64_t lane = 0; lane < LANES && k + lane < count; lane++)
            most = lines[k + lane] > most ? lines[k + lane] : most;
        for (int64_t line = 0; line < most; line++) {
            vec theta = all(0.0);
            for (int64_t lane = 0; lane < LANES && k + lane < count; lane++)
                theta[lane] = angle[(k + lane) * room + (line < lines[k + lane] ? line : 0)];
            form_at(form, inverse, n, theta, x, x + n * n);
            vec own = negative_of(x, x + n * n, n, &size);
            own = choose(right & (size < GROWN), own, all(-1.0));
            for (int64_t lane = 0; lane < LANES && k + lane < count; lane++)
                if (line < lines[k + lane])
                    below[(k + lane) * room + line] = (int64_t)own[lane];
        }
    }
}

#endif
