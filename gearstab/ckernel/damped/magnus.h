/* Products of exponentials of Magnus steps, and eigenvalues of what they make, LANES of them side by side. */

#ifndef GEARSTAB_MAGNUS_H
#define GEARSTAB_MAGNUS_H

enum { POWERS_OF_STEP = 5 };

/* x (m, m) after all steps, and the logarithm of what was taken out of it; work (7, m, m). */
INLINE vec magnus_steps(const struct steps *of, int64_t m, vec period, vec *x, vec *work) {
    vec scale = all(0.0), *a = work, *e = work + m * m;
    for (int64_t s = 0; s < of->count && !(s % RESCALE_EVERY == 0 && gearstab_stopped()); s++) {
        const double *c = of->coefficients + s * POWERS_OF_STEP * m * m;
        vec step = of->length[s] * period;
        UNROLLED for (int64_t i = 0; i < m * m; i++) {
            vec sum = all(c[(POWERS_OF_STEP - 1) * m * m + i]);
            UNROLLED for (int64_t k = POWERS_OF_STEP - 2; k >= 0; k--)
                sum = sum * step + c[k * m * m + i];
            a[i] = sum * step;
        }
        scale += matrix_exponential(a, m, e, work + 2 * m * m);
        multiplied(e, x, m, a);
        UNROLLED for (int64_t i = 0; i < m * m; i++)
            x[i] = a[i];
        normalise(x, m, &scale);
    }
    return scale;
}

static int magnus(const struct steps *of, int64_t first, int64_t last, const double *period, double *matrix, double *scale) {
    const int64_t m = of->m;
    void *memory;
    vec *x = vectors(7 * m * m, &memory);
    if (!x)
        return -1;
    for (int64_t k = first; k < last && !gearstab_stopped(); k += LANES) {
        int64_t count = last - k < LANES ? last - k : LANES;
        vec asked = load_part(period + k, 0, count), taken;
        for (int64_t lane = 0; lane < LANES; lane++)
            for (int64_t i = 0; i < m * m; i++)
                x[i][lane] = matrix[(k + (lane < count ? lane : 0)) * m * m + i];
        switch (m) {
#define CASE(m) case m: taken = magnus_steps(of, m, asked, x, x + m * m); break;
        CASE(2) CASE(4) CASE(6)
#undef CASE
        default: taken = magnus_steps(of, m, asked, x, x + m * m);
        }
        for (int64_t lane = 0; lane < count; lane++) {
            scale[k + lane] += taken[lane];
            for (int64_t i = 0; i < m * m; i++)
                matrix[(k + lane) * m * m + i] = x[i][lane];
        }
    }
    free(memory);
    return 0;
}

static int eigenvalues(int64_t first, int64_t last, int64_t m, const double *matrix, double *values) {
    void *memory;
    vec *x = vectors(m * m + 4 * m, &memory);
    if (!x)
        return -1;
    vec *real = x + m * m, *imaginary = real + m, *work = imaginary + m;
    for (int64_t k = first; k < last && !gearstab_stopped(); k += LANES) {
        int64_t count = last - k < LANES ? last - k : LANES;
        int known[LANES];
        for (int64_t lane = 0; lane < LANES; lane++) {
            const double *own = matrix + (k + (lane < count ? lane : 0)) * m * m;
            known[lane] = 1;
            for (int64_t i = 0; i < m * m; i++)
                known[lane] &= isfinite(own[i]);
            for (int64_t i = 0; i < m * m; i++)
                x[i][lane] = known[lane] ? own[i] : 0.0;
        }
        reduce_to_hessenberg(x, m, work);
        hessenberg_eigenvalues(x, m, real, imaginary);
        for (int64_t lane = 0; lane < count; lane++)
            for (int64_t i = 0; i < m; i++) {
                double *to = values + ((k + lane) * m + i) * 2;
                to[0] = known[lane] ? real[i][lane] : NAN;
                to[1] = known[lane] ? imaginary[i][lane] : NAN;
            }
    }
    free(memory);
    return 0;
}

#endif
