/* The functions of conservative patterns of gearstab.ckernel._kernel, see module.c. */

#include "module.h"

#include <stdlib.h>

FUNCTION(scan, CONSERVATIVE ":rp[drp][Brp][Drp]|[Zrpn]?[Drp]?") {
    struct conservative pattern = conservative(c);
    return c->level->scan(&pattern, c->first, c->last, c->n['p'], array(c, 4), array(c, 5), array(c, 6), wanted(c, 7),
                          wanted(c, 8));
}

FUNCTION(monodromy, CONSERVATIVE ":pp[ip]<r[dp][Dp2n2n][Dp]") {
    struct conservative pattern = conservative(c);
    return c->level->monodromy(&pattern, c->first, c->last, array(c, 4), array(c, 5), array(c, 6), array(c, 7));
}

FUNCTION(traces, CONSERVATIVE ":rp.[drp][Zrpn]") {
    struct conservative pattern = conservative(c);
    return c->level->traces(&pattern, c->first, c->last, c->n['p'], c->real[6], array(c, 4), array(c, 5));
}

/* Mesh frequencies of all rows (points,) or of each (rows, points). */
FUNCTION(rates, CONSERVATIVE ":rpw[d*][dr][dr][ir]<w[Bpw][Dpw]") {
    struct conservative pattern = conservative(c);
    int shared = fits(c, 4, "p");
    if (!shared && !fits(c, 4, "rp"))
        return UNFIT;
    struct result to = {.omega = array(c, 4), .stride = shared ? 0 : c->n['p'], .rate = array(c, 5), .shift = array(c, 6),
                        .place = array(c, 7), .rows = c->n['w'], .stable = array(c, 8), .growth = array(c, 9)};
    struct points kept = {0};
    int failed = c->level->rates(&pattern, c->first, c->last, c->n['p'], &to, &kept);
    give(c, kept.point, kept.count, sizeof *kept.point);
    return failed;
}

FUNCTION(below, CONSERVATIVE ":rpl[drp][drpl][Irpl]") {
    struct conservative pattern = conservative(c);
    int64_t points = c->n['p'], room = c->n['l'];
    int64_t *lines = malloc((size_t)points * sizeof *lines + 1);
    void *spectra = c->level->spectra_new(&pattern);
    for (int64_t k = 0; lines && k < points; k++)
        lines[k] = room;
    for (int64_t row = c->first; spectra && lines && row < c->last; row++) {
        c->level->spectra_row(spectra, row);
        c->level->spectra_below(spectra, points, room, (double *)array(c, 4) + row * points, lines,
                                (double *)array(c, 5) + row * points * room, (int64_t *)array(c, 6) + row * points * room);
    }
    int failed = !spectra || !lines;
    c->level->spectra_free(spectra);
    free(lines);
    return failed;
}

FUNCTION(edges, CONSERVATIVE COARSE ":r....[dr][dr]") {
    struct conservative pattern = conservative(c), rough = coarse(c);
    struct order order = {.level = c->level, .exact = &pattern, .coarse = &rough, .tolerance = c->real[6],
                          .floor = c->real[7], .gap = c->real[8], .density = c->real[9]};
    if (!(order.tolerance > 0 && order.floor > 0 && order.gap > 0))
        return UNFIT;
    struct edge *edges = NULL;
    struct reach *reach = calloc((size_t)(c->last - c->first) + 1, sizeof *reach);
    int64_t count = 0;
    int failed = !reach || gearstab_edges(&order, c->first, c->last, array(c, 8), array(c, 9), &edges, &count, reach);
    give(c, edges, count, sizeof *edges);
    give(c, reach, c->last - c->first, sizeof *reach);
    return failed;
}

FUNCTION(shares, CONSERVATIVE COARSE ":ppw![drkwn][drwn][drn][drnn][ip]<r[dp]") {
    struct conservative pattern = conservative(c), rough = coarse(c);
    struct acting acting = {c->n['w'], array(c, 8), array(c, 9), array(c, 10)};
    struct shares kept = {0};
    int failed = c->level->shares(&pattern, &rough, &acting, array(c, 11), c->first, c->last, array(c, 12), array(c, 13), &kept);
    give(c, kept.share, kept.count, sizeof *kept.share);
    return failed;
}

FUNCTION(names, "crn!.[drn][ic]<r[dc][ic3][ic3][b*]") {
    Py_ssize_t bytes = c->view[5].len, item = (Py_ssize_t)sizeof(struct share);
    struct regions all = {.count = c->n['c'], .rows = c->n['r'], .n = c->n['n'], .shares = bytes / item,
                          .cycles = c->real[0], .frequency = array(c, 0), .row = array(c, 1), .cycle = array(c, 2),
                          .passed = array(c, 3), .meetings = array(c, 4), .share = array(c, 5)};
    int fit = bytes % item == 0;
    for (int64_t i = 0; fit && i < all.shares; i++) /* p and q are indices too */
        fit = 0 <= all.share[i].p && all.share[i].p <= all.share[i].q && all.share[i].q < all.n;
    if (!fit)
        return UNFIT;
    struct names kept = {0};
    int failed = gearstab_names(&all, &kept);
    give(c, kept.name, kept.count, sizeof *kept.name);
    return failed;
}
