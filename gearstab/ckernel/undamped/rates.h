/* Flags and growth rates of the points of a result, in its units, its places and its order.

   A tile of points is scanned row by row and moved while it is in the processor's own cache: otherwise the points of a
   large result went through memory once for each step from growths a period to what a file holds. */

#ifndef GEARSTAB_RATES_H
#define GEARSTAB_RATES_H

#define TILE 8192 /* points of a tile of whole rows, 140 kB: 4096 to 16384 are alike */
#define TOGETHER_IN_PLACE 8 /* rows that are moved together: a line of the cache */
#define AHEAD 24 /* mesh frequencies before a place is written at which it is fetched: 16 to 48 are alike */

struct tile {
    int64_t rows, points;
    double *omega, *growth;
    int8_t *verdict;
};

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

/* Some rows of a tile, neighbours in the result: a constant number where this is inlined, so that they are moved together.

   Their growth rates lie in one line of the cache or two; each mesh frequency has others, far apart, and waiting for them
   to come from memory would take half of the time. */
INLINE void move_rows(const struct tile *tile, int64_t row, int64_t rows, int64_t place, const struct result *to) {
    const double *value = tile->growth + row * tile->points;
    const int8_t *code = tile->verdict + row * tile->points;
    for (int64_t k = 0; k < tile->points; k++) {
        double *growth = to->growth + k * to->rows + place;
        __builtin_prefetch(growth + AHEAD * to->rows, 1);
        __builtin_prefetch(growth + AHEAD * to->rows + rows - 1, 1);
        UNROLLED for (int64_t r = 0; r < rows; r++)
            growth[r] = value[r * tile->points + k];
    }
    for (int64_t k = 0; k < tile->points; k++) {
        int8_t *stable = to->stable + k * to->rows + place;
        UNROLLED for (int64_t r = 0; r < rows; r++)
            stable[r] = code[r * tile->points + k];
    }
}

static void move(const struct tile *tile, const int64_t *place, const struct result *to) {
    for (int64_t r = 0; r < tile->rows;) {
        int64_t together = 1;
        while (together < TOGETHER_IN_PLACE && r + together < tile->rows && place[r + together] == place[r] + together)
            together++;
        if (together == TOGETHER_IN_PLACE) {
            move_rows(tile, r, TOGETHER_IN_PLACE, place[r], to);
        } else if (together >= TOGETHER_IN_PLACE / 2) {
            together = TOGETHER_IN_PLACE / 2;
            move_rows(tile, r, TOGETHER_IN_PLACE / 2, place[r], to);
        } else {
            together = 1;
            move_rows(tile, r, 1, place[r], to);
        }
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
            for (int64_t j = 0; j < points; j += LANES)
                store_part(tile.omega + i * points, j, points,
                           load_part(to->omega + (r + i) * to->stride, j, points) / to->rate[r + i]);
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
