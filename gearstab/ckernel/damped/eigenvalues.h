/* Eigenvalues of matrices, LANES of them side by side. */

#ifndef GEARSTAB_EIGENVALUES_H
#define GEARSTAB_EIGENVALUES_H

static int eigenvalues(int64_t first, int64_t last, int64_t m, const double *matrix, double *values) {
    void *memory;
    vec *x = vectors(m * m + 4 * m, &memory);
    if (!x)
        return -1;
    vec *real = x + m * m, *imaginary = real + m, *work = imaginary + m;
    for (int64_t k = first; k < last && !gearstab_stopped(); k += LANES) {
        int64_t count = last - k < LANES ? last - k : LANES;
        mask known = load_matrices(x, m, matrix + k * m * m, count);
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
