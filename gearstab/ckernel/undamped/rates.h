/* Flags and growth rates of the points of a result, in its units, its places and its order.

   A tile of points is scanned row by row and moved while it is in the processor's own cache: otherwise the points of a
   large result went through memory once for each step from growths a period to what a file holds. */

#ifndef GEARSTAB_RATES_H
#define GEARSTAB_RATES_H

#define TILE 8192 /* points of a tile of whole rows, 140 kB: 4096 to 16384 are alike */
#define SIDE 8 /* of the squares of points that are moved together: a line of the cache in the result */
#define ALL_STABLE (STABLE * UINT64_C(0x0101010101010101)) /* SIDE verdicts */

struct tile {
    int64_t rows, points;
    double *omega, *growth;
    int8_t *verdict;
};

static void in_units_of(const double *restrict omega, int64_t points, double rate, double *restrict found) {
    for (int64_t k = 0; k < points; k++)
        found[k] = omega[k] / rate;
}

/* Growths a period -> growth rates, and flags of a uniform decay, of a row of a tile; what is not finite is in doubt. */
static void in_units(const struct tile *tile, int64_t row, double cycles, double shift, double rate) {
    const double *omega = tile->omega + row * tile->points;
    double *growth = tile->growth + row * tile->points;
    int8_t *verdict = tile->verdict + row * tile->points;
    for (int64_t k = 0; k < tile->points; k += LANES) {
        vec value = load_part(growth, k, tile->points);
        if (shift == 0.0 && !any(value != 0.0))
            continue; /* most points are stable */
        value /= TURN * cycles / load_part(omega, k, tile->points);
        mask known = magnitude(value) < INFINITY;
        for (int64_t i = 0; (shift != 0.0 || any(~known)) && i < LANES && k + i < tile->points; i++) {
            if (!known[i])
                verdict[k + i] = DOUBTFUL;
            else if (shift != 0.0 && verdict[k + i] != DOUBTFUL)
                verdict[k + i] = value[i] <= shift;
        }
        store_part(growth, k, tile->points, (value - shift) * rate);
    }
}

static int keep_doubts(const struct tile *tile, int64_t row, struct points *kept) {
    const int8_t *end = tile->verdict + tile->rows * tile->points, *next = tile->verdict;
    while (next < end && (next = memchr(next, DOUBTFUL, (size_t)(end - next)))) {
        if (kept->count == kept->room) {
            int64_t room = 2 * kept->room + 64;
            struct point *longer = realloc(kept->point, (size_t)room * sizeof *longer);
            if (!longer)
                return -1;
            kept->point = longer, kept->room = room;
        }
        int64_t k = next++ - tile->verdict;
        kept->point[kept->count++] = (struct point){row + k / tile->points, k % tile->points};
    }
    return 0;
}

/* The points from k on of 8 rows of a tile. Whether they all are stable and grow by nothing, as most are: then they need
   not be turned. */
INLINE int at_rest(const double *value, const int8_t *code, int64_t points) {
    mask growing = {0};
    uint64_t other = 0;
    UNROLLED for (int64_t r = 0; r < SIDE; r++) {
        uint64_t word;
        memcpy(&word, code + r * points, sizeof word);
        other |= word ^ ALL_STABLE;
        UNROLLED for (int64_t i = 0; i < SIDE; i += LANES)
            growing |= (mask)load(value + r * points + i);
    }
    return !other && !any(growing);
}

/* Some rows of a tile, neighbours in the result: a constant number where this is inlined, so that they are moved together. */
INLINE void move_rows(const struct tile *tile, int64_t row, int64_t rows, int64_t place, const struct result *to) {
    const int64_t points = tile->points, all = to->rows; /* bytes that are written might be these, to a compiler */
    const double *value = tile->growth + row * points;
    const int8_t *code = tile->verdict + row * points;
    double *growth = to->growth + place;
    int8_t *stable = to->stable + place;
    for (int64_t k = 0; k < points;) {
        int64_t side = points - k < SIDE ? points - k : SIDE;
        if (rows == SIDE && side == SIDE && at_rest(value + k, code + k, points)) {
            UNROLLED for (int64_t i = 0; i < SIDE; i++) {
                memset(growth + i * all, 0, SIDE * sizeof *growth);
                memset(stable + i * all, STABLE, SIDE);
            }
        } else {
            for (int64_t i = 0; i < side; i++) {
                double numbers[SIDE];
                int8_t codes[SIDE];
                UNROLLED for (int64_t r = 0; r < rows; r++)
                    numbers[r] = value[r * points + k + i], codes[r] = code[r * points + k + i];
                memcpy(growth + i * all, numbers, (size_t)rows * sizeof *numbers);
                memcpy(stable + i * all, codes, (size_t)rows);
            }
        }
        k += side, growth += side * all, stable += side * all;
    }
}

static void move(const struct tile *tile, const int64_t *place, const struct result *to) {
    for (int64_t r = 0; r < tile->rows;) {
        int64_t together = 1;
        while (together < SIDE && r + together < tile->rows && place[r + together] == place[r] + together)
            together++;
        if (together == SIDE)
            move_rows(tile, r, SIDE, place[r], to);
        else
            move_rows(tile, r, together, place[r], to);
        r += together;
    }
}

static int rates(const struct conservative *pattern, int64_t first, int64_t last, int64_t points, const struct result *to,
                 struct points *kept) {
    int64_t most = points ? last - first : 0, height = points < TILE ? TILE / (points ? points : 1) : 1;
    height = height < most ? height : most;
    size_t room = (size_t)(points * height);
    double *memory = room ? malloc(room * (2 * sizeof(double) + 1)) : NULL;
    struct tile tile = {.points = points, .omega = memory, .growth = memory + room, .verdict = (int8_t *)(memory + 2 * room)};
    int failed = room && !memory;
    for (int64_t r = first; room && !failed && r < last; r += height) {
        struct conservative part = *pattern;
        part.rows = tile.rows = last - r < height ? last - r : height;
        part.squared += r * part.states * part.n;
        part.fractions += r * part.segments;
        part.change += r * part.segments * part.n * part.n;
        for (int64_t i = 0; i < tile.rows; i++)
            in_units_of(to->omega + (r + i) * to->stride, points, to->rate[r + i], tile.omega + i * points);
        failed = scan(&part, 0, tile.rows, points, tile.omega, tile.verdict, tile.growth, NULL, NULL);
        for (int64_t i = 0; !failed && i < tile.rows; i++)
            in_units(&tile, i, pattern->cycles, to->shift[r + i], to->rate[r + i]);
        failed = failed || keep_doubts(&tile, r, kept);
        if (!failed)
            move(&tile, to->place + r, to);
    }
    free(memory);
    return failed ? -1 : 0;
}

#endif
