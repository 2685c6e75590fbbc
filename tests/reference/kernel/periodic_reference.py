"""Monodromy matrices of smooth systems by another way: extrapolated midpoint steps in extended precision.

Gragg's method of order 16 (Hairer, Norsett & Wanner 1993, II.9) on M q'' + C q' + K(t) q = 0 in physical coordinates,
with the 64-bit mantissa of an extended double. No eigenvectors, no exponentials, and steps that know nothing of the
period's structure but its kinks.
"""

from itertools import pairwise

import numpy as np
from scipy.linalg import expm

Long = np.longdouble
EXTENDED = np.finfo(Long).nmant >= 63
SEQUENCE = (2, 4, 6, 8, 10, 12, 14, 16)
TWO_PI = 2 * (Long(np.pi) + Long(1.2246467991473532e-16))
INSIDE = Long(1e-9)
"""Part of a substep: how far values at kinks and jumps are taken inside the smooth interval."""


def monodromy(system, omega, steps=60):
    """``(P, 2n, 2n)`` extended doubles, (q, dq/ds) with s the time in parts of the common period of a single system."""
    cycles, counts = system.common_period()
    period = TWO_PI * Long(cycles.numerator) / Long(cycles.denominator) / np.asarray(omega, dtype=Long)
    inverse = np.linalg.inv(np.asarray(system.mass, dtype=float)).astype(Long)
    damping = None if system.damping is None else inverse @ np.asarray(system.damping, dtype=Long)
    n = system.size

    def field(s, y):
        stiffness = np.asarray(system.stiffness, dtype=Long)
        for mesh, count in zip(system.meshes, counts, strict=True):
            shape = Long(mesh.waveform.value(np.asarray(count * s - Long(float(mesh.lag)))))
            g = np.asarray(mesh.direction, dtype=Long)
            mean, epsilon = Long(float(mesh.mean_stiffness)), Long(float(mesh.epsilon))
            stiffness = stiffness + mean * (1 + 2 * epsilon * shape) * np.outer(g, g)
        change = np.empty_like(y)
        change[:, :n] = y[:, n:]
        change[:, n:] = -(period[:, None, None] ** 2) * np.matmul(inverse @ stiffness, y[:, :n])
        if damping is not None:
            change[:, n:] -= period[:, None, None] * np.matmul(damping, y[:, n:])
        return change

    y = np.broadcast_to(np.eye(2 * n, dtype=Long), (len(omega), 2 * n, 2 * n)).copy()
    edges = _edges(system, counts)
    for start, stop in pairwise(edges):
        count = max(1, int(np.ceil(float(stop - start) * steps)))
        for k in range(count):
            y = _step(field, y, start + (stop - start) * Long(k) / count, (stop - start) / Long(count))
    return y


def _edges(system, counts):
    found = [Long(0), Long(1)]
    for mesh, count in zip(system.meshes, counts, strict=True):
        for point in np.ravel(mesh.waveform.breakpoints()):
            found += [Long((point + float(mesh.lag) + k) / count) % 1 for k in range(count)]
    found = np.sort(np.array(found))
    kept = np.append(True, np.diff(found) > 1e-13)
    found = found[kept]
    found[-1] = 1
    return found


def _step(field, y, start, length):
    table = []
    for j, parts in enumerate(SEQUENCE):
        h = length / parts
        before, now = y, y + h * field(start + INSIDE * h, y)
        for q in range(1, parts):
            before, now = now, before + 2 * h * field(start + q * h, now)
        row = [(before + now + h * field(start + length - INSIDE * h, now)) / 2]
        for k in range(1, j + 1):
            row.append(row[-1] + (row[-1] - table[-1][k - 1]) / ((Long(parts) / SEQUENCE[j - k]) ** 2 - 1))
        table.append(row)
    return table[-1][-1]


def multipliers(system, omega, steps=60):
    """``(P, 2n)``, in no order."""
    return np.linalg.eigvals(monodromy(system, omega, steps).astype(float))


def distance(ours, reference):
    """``(P,)``: the error of multipliers as the package defines it: the largest of all, relative to the largest
    multiplier or 1.
    """
    gap = np.abs(ours[:, :, None] - reference[:, None, :])
    worst = np.maximum(gap.min(axis=2).max(axis=1), gap.min(axis=1).max(axis=1))
    return worst / np.maximum(1.0, np.abs(reference).max(axis=1))


def growth_rate(system, omega, steps):
    """The largest real part of the exponents of a single system, however large or small the multipliers are.

    Magnus steps of fourth order (Iserles & Norsett 1999) in physical coordinates, multiplied in pairs; the size of the
    products is taken out after each round.
    """
    cycles, counts = system.common_period()
    period, n, inverse = 2 * np.pi * float(cycles) / omega, system.size, np.linalg.inv(system.mass)
    damping = np.zeros((n, n)) if system.damping is None else system.damping

    def generator(tau):
        result = np.zeros((steps, 2 * n, 2 * n))
        result[:, :n, n:] = np.eye(n)
        result[:, n:, :n], result[:, n:, n:] = -inverse @ system.stiffness, -inverse @ damping
        for mesh, count in zip(system.meshes, counts, strict=True):
            level = mesh.mean_stiffness * (1 + 2 * mesh.epsilon * mesh.waveform.value(count * tau - mesh.lag))
            result[:, n:, :n] -= level[:, None, None] * (inverse @ mesh.outer)
        return result

    middle, off = (np.arange(steps) + 0.5) / steps, np.sqrt(3) / 6 / steps
    first, second, h = generator(middle - off), generator(middle + off), period / steps
    product = expm(0.5 * h * (first + second) + np.sqrt(3) / 12 * h * h * (second @ first - first @ second))
    scale = 0.0
    while len(product) > 1:
        if len(product) % 2:
            product = np.concatenate([product, np.eye(2 * n)[None]])
        product = product[1::2] @ product[::2]
        size = np.abs(product).max(axis=(1, 2))
        product, scale = product / size[:, None, None], scale + np.log(size).sum()
    return (np.log(np.abs(np.linalg.eigvals(product[0])).max()) + scale) / period
