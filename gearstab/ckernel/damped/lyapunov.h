/* Lyapunov functions with a radius at scattered points of damped patterns.

   The mathematics stands in gearstab/floquet/kernel/c_points.py. Symmetric matrices are held whole; every point has a
   lane of its own, and what comes out does not depend on its neighbours. */

#ifndef GEARSTAB_LYAPUNOV_H
#define GEARSTAB_LYAPUNOV_H

/* A segment, or an equal part of it, in the lanes in which it is one. */
struct piece {
    const double *decay, *frequency; /* (m,), as in damped.h */
    vec duration;                    /* 0 in other lanes */
    mask there;
};

/* e^{at} cos bt and e^{at} sin bt of the m coordinates over `period` turns times `fraction`. */
INLINE void turned(const double *decay, const double *frequency, int64_t m, vec fraction, vec period, vec *cosine, vec *sine) {
    vec time = TURN * (fraction * period);
    for (int64_t i = 0; i < m; i++) {
        vec size = exponential(decay[i] * time);
        cosine[i] = size, sine[i] = all(0.0);
        if (frequency[i] == 0)
            continue;
        cosine_sine(frequency[i] * fraction, period, &cosine[i], &sine[i]);
        cosine[i] = cosine[i] * size, sine[i] = sine[i] * size;
        i++;
        cosine[i] = cosine[i - 1], sine[i] = sine[i - 1];
    }
}

/* x (m, m) <- x r, or what c and s are of: [[c, s], [-s, c]] for each pair, c for a coordinate alone. */
INLINE void columns_turned(const double *frequency, int64_t m, const vec *c, const vec *s, vec *x) {
    for (int64_t k = 0; k < m; k++) {
        vec *line = x + k * m;
        UNROLLED for (int64_t i = 0; i < m; i++) {
            vec u = line[i];
            if (frequency[i] == 0) {
                line[i] = c[i] * u;
                continue;
            }
            vec v = line[i + 1];
            line[i] = c[i] * u - s[i] * v;
            line[i + 1] = s[i] * u + c[i] * v;
            i++;
        }
    }
}

/* x <- r^T x r. */
INLINE void both_turned(const double *frequency, int64_t m, const vec *c, const vec *s, vec *x) {
    columns_turned(frequency, m, c, s, x);
    for (int64_t i = 0; i < m; i++) {
        vec *line = x + i * m, *next = line + m;
        if (frequency[i] == 0) {
            UNROLLED for (int64_t k = 0; k < m; k++)
                line[k] = c[i] * line[k];
            continue;
        }
        UNROLLED for (int64_t k = 0; k < m; k++) {
            vec u = line[k], v = next[k];
            line[k] = c[i] * u - s[i] * v;
            next[k] = s[i] * u + c[i] * v;
        }
        i++;
    }
}

/* result = x b for b (m, m) the same in all lanes. */
INLINE void times_change(const vec *x, const double *b, int64_t m, vec *result) {
    for (int64_t i = 0; i < m; i++) {
        const vec *line = x + i * m;
        int64_t j = 0;
        for (; j + 1 < m; j += 2) {
            vec s0 = line[0] * b[j], s1 = line[0] * b[j + 1];
            UNROLLED for (int64_t k = 1; k < m; k++) {
                const double *at = b + k * m + j;
                s0 += line[k] * at[0], s1 += line[k] * at[1];
            }
            result[i * m + j] = s0, result[i * m + j + 1] = s1;
        }
        for (; j < m; j++) {
            vec sum = line[0] * b[j];
            for (int64_t k = 1; k < m; k++)
                sum += line[k] * b[k * m + j];
            result[i * m + j] = sum;
        }
    }
}

/* x <- b^T x b, x symmetric; work (m, m). */
INLINE void both_changed(const double *b, int64_t m, vec *x, vec *work) {
    times_change(x, b, m, work);
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = i; j < m; j++) {
            vec sum = b[i] * work[j];
            UNROLLED for (int64_t k = 1; k < m; k++)
                sum += b[k * m + i] * work[k * m + j];
            x[i * m + j] = x[j * m + i] = sum;
        }
}

/* P - X^T P X = D by doubling; p holds D and becomes P, x is destroyed; work (2, m, m). */
INLINE void solve_by_doubling(int64_t m, const struct lyapunov *settings, vec *p, vec *x, vec *work) {
    vec *product = work, *other = work + m * m;
    for (int64_t turn = 0; turn < settings->doublings; turn++) {
        if (!any(largest_entry(x, m * m) > settings->negligible))
            return;
        multiplied(p, x, m, product);
        for (int64_t i = 0; i < m; i++)
            for (int64_t j = i; j < m; j++) {
                vec sum = p[i * m + j];
                UNROLLED for (int64_t k = 0; k < m; k++)
                    sum += x[k * m + i] * product[k * m + j];
                other[i * m + j] = other[j * m + i] = sum;
            }
        multiplied(x, x, m, product);
        for (int64_t i = 0; i < m * m; i++)
            p[i] = other[i], x[i] = product[i];
    }
}

/* Solve a (count, count + 1), right-hand side last, by elimination with row exchanges; the solution replaces that side.
   Returns 0 where a is singular. */
static int eliminated(double *a, int64_t count) {
    const int64_t width = count + 1;
    for (int64_t k = 0; k < count; k++) {
        int64_t best = k;
        for (int64_t i = k + 1; i < count; i++)
            best = fabs(a[i * width + k]) > fabs(a[best * width + k]) ? i : best;
        double pivot = a[best * width + k];
        if (!(fabs(pivot) > DBL_MIN))
            return 0;
        for (int64_t j = k; j < width; j++) {
            double swap = a[best * width + j];
            a[best * width + j] = a[k * width + j];
            a[k * width + j] = swap;
        }
        for (int64_t i = k + 1; i < count; i++) {
            double factor = a[i * width + k] / pivot;
            if (factor != 0)
                for (int64_t j = k + 1; j < width; j++)
                    a[i * width + j] -= factor * a[k * width + j];
        }
    }
    for (int64_t k = count - 1; k >= 0; k--) {
        double sum = a[k * width + count];
        for (int64_t j = k + 1; j < count; j++)
            sum -= a[k * width + j] * a[j * width + count];
        a[k * width + count] = sum / a[k * width + k];
    }
    return 1;
}

/* The same equation in one lane as a linear system for the m (m + 1)/2 entries of P; room (u, u + 1). */
static void solve_lane(int64_t m, int lane, vec *p, const vec *x, double *room) {
    const int64_t count = m * (m + 1) / 2;
    int64_t line = 0;
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = i; j < m; j++, line++) {
            double *at = room + line * (count + 1);
            int64_t place = 0;
            for (int64_t k = 0; k < m; k++)
                for (int64_t l = k; l < m; l++, place++) {
                    double product = x[k * m + i][lane] * x[l * m + j][lane];
                    if (k != l)
                        product += x[l * m + i][lane] * x[k * m + j][lane];
                    at[place] = (place == line) - product;
                }
            at[count] = p[i * m + j][lane];
        }
    int solved = eliminated(room, count);
    line = 0;
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = i; j < m; j++, line++)
            p[i * m + j][lane] = p[j * m + i][lane] = solved ? room[line * (count + 1) + count] : NAN;
}

/* Lanes in which q - radius e (m, m) is positive definite, by Cholesky's pivots; work (m, m). */
INLINE mask positive(const vec *q, const vec *e, vec radius, int64_t m, vec *work) {
    mask good = ~(mask){0};
    UNROLLED for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; j <= i; j++)
            work[i * m + j] = q[i * m + j] - radius * e[i * m + j];
    UNROLLED for (int64_t k = 0; k < m; k++) {
        vec pivot = work[k * m + k];
        good &= pivot > 0.0;
        vec inverse = 1.0 / choose(good, pivot, all(1.0));
        UNROLLED for (int64_t i = k + 1; i < m; i++) {
            vec factor = work[i * m + k] * inverse;
            for (int64_t j = k + 1; j <= i; j++)
                work[i * m + j] -= factor * work[j * m + k];
        }
    }
    return good;
}

/* The largest radius with q - radius e positive definite, at most what is given; sign: that of e. */
INLINE vec largest_radius(const vec *q, const vec *e, double sign, vec radius, int64_t m, const struct lyapunov *settings,
                          vec *work) {
    mask failed = ~positive(q, e, sign * radius, m, work);
    if (!any(failed))
        return radius;
    vec high = radius, low = choose(failed, 0.5 * radius, radius);
    const double least = settings->largest * settings->least;
    for (;;) {
        mask bad = ~positive(q, e, sign * low, m, work) & (low > 0.0);
        if (!any(bad))
            break;
        high = choose(bad, low, high);
        low = choose(bad, choose(low > least, 0.5 * low, all(0.0)), low);
    }
    for (int64_t turn = 0; turn < settings->bisections; turn++) {
        vec middle = root(low * high);
        mask good = positive(q, e, sign * middle, m, work);
        low = choose(good, middle, low), high = choose(good, high, middle);
    }
    return choose(failed, low, radius);
}

/* Generators that change with the mesh frequency, in the coordinates of the states: slope (r, D, m, m) dA/d ln Omega, bend
   (r, D) the size of the second derivative; NULL where they do not. margin: how much of that counts. */
struct slopes {
    const double *slope, *bend;
    double margin;
};

/* Room for the matrices of LANES points. */
struct lyapunov_room {
    vec *start, *p, *x, *before, *rise, *loss, *generator, *work, *cosine, *sine;
    vec bent; /* margin times the second derivative of the generator of a stretched piece */
    double *system; /* of linear equations, NULL where it would be too large */
    void *memory;
};

static int lyapunov_room_new(struct lyapunov_room *room, int64_t m, int64_t unknowns) {
    int64_t count = m * (m + 1) / 2;
    room->system = count <= unknowns ? malloc((size_t)(count * (count + 1)) * sizeof(double)) : NULL;
    room->start = vectors(9 * m * m + 4 * m, &room->memory);
    if (!room->start || (count <= unknowns && !room->system))
        return -1;
    room->p = room->start + m * m;
    room->x = room->p + m * m;
    room->before = room->x + m * m;
    room->rise = room->before + m * m;
    room->loss = room->rise + m * m;
    room->generator = room->loss + m * m;
    room->work = room->generator + m * m;     /* (2, m, m) */
    room->cosine = room->work + 2 * m * m;    /* (2, m): of a piece, and where there is one */
    room->sine = room->cosine + 2 * m;
    return 0;
}

static void lyapunov_room_free(struct lyapunov_room *room) {
    free(room->memory);
    free(room->system);
}

/* (e^z - 1)/z of z = x + iy, times a number that it replaces. */
static void times_mean(double x, double y, double number[2]) {
    if (fabs(x) + fabs(y) < 1e-8)
        return;
    double half = sin(0.5 * y), square = x * x + y * y, a = expm1(x) * cos(y) - 2.0 * half * half, b = exp(x) * sin(y);
    double real = (a * x + b * y) / square, imaginary = (b * x - a * y) / square;
    double first = number[0] * real - number[1] * imaginary;
    number[1] = number[0] * imaginary + number[1] * real;
    number[0] = first;
}

/* a <- (a + b) times factor, b <- i (a - b) times factor: a pair of complex numbers that belong to two real ones, and the
   other way round by the conjugate. */
static void pair_up(double a[2], double b[2], double factor, double sign) {
    double sum[2] = {a[0] + b[0], a[1] + b[1]}, gap[2] = {a[0] - b[0], a[1] - b[1]};
    a[0] = factor * sum[0], a[1] = factor * sum[1];
    b[0] = -sign * factor * gap[1], b[1] = sign * factor * gap[0];
}

/* F^-1 dF/d eta (m, m) of a piece of a length in one lane, F = exp(A t) where A changes with the mesh frequency: A t less
   the mean of its slope, transported; and margin times the size of the derivative of that. part (m, m, 2). */
static void stretched_lane(const struct piece *piece, int64_t m, const double *slope, double bend, double margin, int lane,
                           struct lyapunov_room *room) {
    const double *a = piece->decay, *b = piece->frequency, length = piece->duration[lane];
    double *part = (double *)room->work, size = 0.0, high = a[0] * length, low = high; /* one lane's share of the room */
#define AT(i, j) (part + 2 * ((i) * m + (j)))
    for (int64_t i = 0; i < m * m; i++) {
        part[2 * i] = length * slope[i], part[2 * i + 1] = 0.0;
        size += part[2 * i] * part[2 * i];
    }
    for (int64_t i = 0; i < m; i++) {
        high = fmax(high, a[i] * length), low = fmin(low, a[i] * length);
        for (int64_t j = 0; b[i] > 0 && j < m; j++) { /* columns x, y become x + iy, x - iy */
            double *x = AT(j, i), *y = AT(j, i + 1), turned[2] = {-y[1], y[0]};
            y[0] = x[0] - turned[0], y[1] = x[1] - turned[1];
            x[0] += turned[0], x[1] += turned[1];
        }
    }
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; b[i] > 0 && j < m; j++) { /* rows x, y become (x - iy)/2, (x + iy)/2 */
            double *x = AT(i, j), *y = AT(i + 1, j), turned[2] = {-y[1], y[0]};
            y[0] = 0.5 * (x[0] + turned[0]), y[1] = 0.5 * (x[1] + turned[1]);
            x[0] -= y[0], x[1] -= y[1];
        }
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; j < m; j++)
            times_mean((a[j] - a[i]) * length, (b[j] - b[i]) * length, AT(i, j));
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; b[i] > 0 && j < m; j++) /* columns back */
            pair_up(AT(j, i), AT(j, i + 1), 0.5, -1.0);
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; b[i] > 0 && j < m; j++) /* and rows */
            pair_up(AT(i, j), AT(i + 1, j), 1.0, 1.0);
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; j < m; j++) {
            double own = i == j ? a[i] : b[i] > 0 && j == i + 1 ? b[i] : b[i] < 0 && j == i - 1 ? b[i] : 0.0;
            room->generator[i * m + j][lane] = own * length - *AT(i, j);
        }
#undef AT
    double stretch = exp(high - low);
    size = sqrt(size) * stretch;
    room->bent[lane] = margin * (fabs(length) * bend * stretch + 4.0 * size + size * size);
}

/* rise = E(form) of a generator (m, m). */
INLINE void rising_by(const vec *generator, int64_t m, const vec *form, vec *rise) {
    multiplied(form, generator, m, rise);
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; j <= i; j++)
            rise[i * m + j] = rise[j * m + i] = rise[i * m + j] + rise[j * m + i];
}

/* rise = E(form) of a piece. */
INLINE void rising(const struct piece *piece, int64_t m, const vec *form, vec *rise) {
    for (int64_t k = 0; k < m; k++)
        UNROLLED for (int64_t i = 0; i < m; i++) {
            const vec *at = form + k * m + i;
            vec *to = rise + k * m + i;
            double a = piece->decay[i], b = piece->frequency[i];
            to[0] = a * at[0];
            if (b == 0)
                continue;
            to[0] -= b * at[1], to[1] = a * at[1] + b * at[0];
            i++;
        }
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; j <= i; j++)
            rise[i * m + j] = rise[j * m + i] = piece->duration * (rise[i * m + j] + rise[j * m + i]);
}

/* The conditions of one step, P after it and Y before. */
INLINE void tested(const struct piece *piece, int64_t m, const struct lyapunov *settings, const struct slopes *slopes,
                   const struct lyapunov_room *room, vec radius[2]) {
    vec *loss = room->loss, noise = settings->rounding * largest_entry(room->p, m * m);
    for (int64_t i = 0; i < m * m; i++)
        loss[i] = room->p[i] - room->before[i];
    for (int64_t i = 0; i < m; i++)
        loss[i * m + i] -= noise;
    for (int part = 0; part < 2; part++) {
        const vec *form = part ? room->before : room->p;
        vec square = all(0.0), more;
        if (slopes->slope)
            rising_by(room->generator, m, form, room->rise);
        else
            rising(piece, m, form, room->rise);
        for (int64_t i = 0; slopes->slope && i < m * m; i++)
            square += form[i] * form[i];
        more = slopes->slope ? room->bent * root(square) : square;
        for (int k = 0; k < 2; k++) {
            for (int64_t i = 0; slopes->slope && i < m; i++) /* with its sign below it is more of a rise in both directions */
                room->rise[i * (m + 1)] += k ? -2.0 * more : more;
            vec found = largest_radius(loss, room->rise, k ? -1.0 : 1.0, radius[k], m, settings, room->work);
            radius[k] = choose(piece->there, found, radius[k]);
        }
    }
}

/* Into how many pieces a segment is cut: in a short one P and Y hardly differ, and with them the two conditions. */
INLINE vec pieces_of(const double *decay, int64_t m, double fraction, vec period, const struct lyapunov *settings) {
    double fastest = 0.0;
    for (int64_t i = 0; i < m; i++)
        fastest = fabs(decay[i]) > fastest ? fabs(decay[i]) : fastest;
    vec wanted = 2.0 * fastest * fabs(TURN * fraction) * period / settings->longest;
    if (!any(wanted > 1.0))
        return all(1.0);
    for (int lane = 0; lane < LANES; lane++)
        wanted[lane] = wanted[lane] > 1.0 ? ceil(fmin(wanted[lane], settings->pieces)) : 1.0;
    return wanted;
}

/* Go backwards through a period, from p at its end. Either (radius NULL) x becomes exp(rate T) M and p the D of P - x^T P x
   = D; or p is P, and the radii are lowered to what it proves. */
INLINE void backwards(const struct damped *pattern, const double *weight, int64_t m, int64_t r, vec period, vec rate,
                      const struct lyapunov *settings, const struct slopes *slopes, struct lyapunov_room *room,
                      vec radius[2]) {
    vec *p = room->p, *x = room->x, *cosine = room->cosine, *sine = room->sine;
    for (int64_t s = pattern->segments - 1; s >= 0 && !(m > FEW_COORDINATES && gearstab_stopped()); s--) {
        const int64_t state = r * pattern->states + pattern->state[s];
        const double fraction = pattern->fractions[r * pattern->segments + s];
        const double *change = change_after(pattern, m, r, s), *added = weight + state * m * m;
        struct piece piece = {.decay = pattern->decay + state * m, .frequency = pattern->frequency + state * m};
        vec pieces = pieces_of(piece.decay, m, fraction, period, settings), part = fraction / pieces;
        int64_t most = 1;
        for (int lane = 0; lane < LANES; lane++)
            most = (int64_t)pieces[lane] > most ? (int64_t)pieces[lane] : most;
        turned(piece.decay, piece.frequency, m, part, period, cosine, sine);
        both_changed(change, m, p, room->work);
        if (!radius) {
            times_change(x, change, m, room->work);
            for (int64_t i = 0; i < m * m; i++)
                x[i] = room->work[i];
        }
        piece.duration = TURN * (part * period);
        for (int lane = 0; radius && slopes->slope && lane < LANES; lane++)
            stretched_lane(&piece, m, slopes->slope + state * m * m, slopes->bend[state], slopes->margin, lane, room);
        for (int64_t k = most - 1; k >= 0; k--) {
            piece.there = pieces > all((double)k);
            piece.duration = choose(piece.there, TURN * (part * period), all(0.0));
            for (int64_t i = 0; i < m; i++) {
                cosine[m + i] = choose(piece.there, cosine[i], all(1.0));
                sine[m + i] = choose(piece.there, sine[i], all(0.0));
            }
            both_turned(piece.frequency, m, cosine + m, sine + m, p);
            vec length = magnitude(piece.duration), factor = exponential(rate * length);
            for (int64_t i = 0; radius && i < m * m; i++)
                room->before[i] = p[i];
            for (int64_t i = 0; i < m * m; i++)
                p[i] = factor * factor * p[i] + length * added[i];
            if (!radius) {
                columns_turned(piece.frequency, m, cosine + m, sine + m, x);
                for (int64_t i = 0; i < m * m; i++)
                    x[i] = x[i] * factor;
                continue;
            }
            if (s == 0 && k == 0) /* the period before begins here */
                for (int64_t i = 0; i < m * m; i++)
                    p[i] = room->start[i];
            if (fraction != 0.0) /* what takes no time in this row proves nothing and needs no proof */
                tested(&piece, m, settings, slopes, room, radius);
        }
    }
}

/* Lane by lane the matrices (2, m, m) of an equation, or its solution in the place of the second. */
INLINE void exchanged(double *equation, int64_t m, int64_t lanes, int reads, vec *x, vec *p) {
    for (int64_t lane = 0; lane < lanes; lane++)
        for (int64_t i = 0; i < m * m; i++) {
            double *own = equation + 2 * lane * m * m + i;
            if (reads)
                p[i][lane] = own[m * m];
            else
                own[0] = x[i][lane], own[m * m] = p[i][lane];
        }
}

/* The radii of LANES points of a row. equation (lanes, 2, m, m), or NULL: what is to be solved elsewhere, or with `reads`
   has been. */
INLINE void radii_of(const struct damped *pattern, const double *weight, int64_t m, int64_t r, vec period, vec growth,
                     const struct lyapunov *settings, const struct slopes *slopes, struct lyapunov_room *room,
                     double *equation, int64_t lanes, int reads, vec radius[2]) {
    mask inside = growth < 0.0;
    vec rate = choose(inside, -settings->part * growth / (TURN * period), all(0.0));
    vec *p = room->p, *x = room->x, *start = room->start;
    for (int64_t i = 0; i < m * m; i++)
        p[i] = all(0.0), x[i] = all(i % (m + 1) == 0);
    backwards(pattern, weight, m, r, period, rate, settings, slopes, room, NULL);
    if (equation)
        exchanged(equation, m, lanes, reads, x, p);
    for (int lane = 0; lane < LANES; lane++)
        if (!inside[lane] && room->system && !reads)
            solve_lane(m, lane, p, x, room->system);
    for (int64_t i = 0; i < m * m; i++) {
        start[i] = room->system || reads ? p[i] : all(NAN); /* of lanes outside */
        x[i] = choose(inside, x[i], all(0.0));
    }
    solve_by_doubling(m, settings, p, x, room->work);
    for (int64_t i = 0; i < m * m; i++)
        p[i] = start[i] = choose(inside, p[i], start[i]);
    radius[0] = radius[1] = all(settings->largest);
    backwards(pattern, weight, m, r, period, rate, settings, slopes, room, radius);
}

static int radii(const struct damped *pattern, const double *weight, const struct lyapunov *settings, const double *slope,
                 const double *bend, int64_t first, int64_t last, const int64_t *row, const double *cycle,
                 const double *growth, double *radius, double *equation, int reads) {
    const struct slopes slopes = {slope, bend, settings->margin};
    const int64_t m = pattern->m;
    struct lyapunov_room room;
    int failed = lyapunov_room_new(&room, m, settings->unknowns);
    for (int64_t k = first, count; k < last && !failed && !gearstab_stopped(); k += count) {
        count = together(row, k, last);
        vec period = pattern->cycles * load_part(cycle + k, 0, count), grown = load_part(growth + k, 0, count), found[2];
        double *own = equation ? equation + 2 * k * m * m : NULL;
        if (m == 6 && !slope && !own) /* a quarter faster where the compiler knows it; more sizes would take long to compile */
            radii_of(pattern, weight, 6, row[k], period, grown, settings, &(struct slopes){0}, &room, NULL, count, 0, found);
        else
            radii_of(pattern, weight, m, row[k], period, grown, settings, &slopes, &room, own, count, reads, found);
        for (int64_t lane = 0; lane < count; lane++)
            radius[2 * (k + lane)] = found[0][lane], radius[2 * (k + lane) + 1] = found[1][lane];
    }
    lyapunov_room_free(&room);
    return failed;
}

#endif
