"""Which particles are near each other, compiled: they are sorted by cells of one support radius, then paired."""

import numpy as np

from pipeline.simulate.compiled import part
from pipeline.simulate.fields import SUPPORT


@part
def sort(p, walls):
    """Sort the particles by cell; afterwards those of cell b are bin_start[b] to bin_start[b + 1]."""
    n = p.count[0]
    size = np.float32(SUPPORT) * walls.spacing
    bx, by, bz = walls.bins[0], walls.bins[1], walls.bins[2]
    p.bin_start[:] = 0
    for i in range(n):
        ix = min(max(int((p.x[i, 0] - walls.origin[0]) / size), 0), bx - 1)
        iy = min(max(int((p.x[i, 1] - walls.origin[1]) / size), 0), by - 1)
        iz = min(max(int((p.x[i, 2] - walls.origin[2]) / size), 0), bz - 1)
        p.bin_of[i] = (iz * by + iy) * bx + ix
        p.bin_start[p.bin_of[i] + 2] += 1
    for b in range(bx * by * bz):
        p.bin_start[b + 2] += p.bin_start[b + 1]
    for i in range(n):
        k = p.bin_start[p.bin_of[i] + 1]
        p.bin_start[p.bin_of[i] + 1] = k + 1
        for c in range(4):
            p.spare_x[k, c], p.spare_v[k, c] = p.x[i, c], p.v[i, c]
        p.spare_impulse[k] = p.impulse[i]
    for i in range(n):
        for c in range(4):
            p.x[i, c], p.v[i, c] = p.spare_x[i, c], p.spare_v[i, c]
        p.impulse[i] = p.spare_impulse[i]


@part
def _rows(p, walls, b):
    """List the rows of cells with partners of the particles in cell b, the first its own; return how many, and their particles.

    A row is a range of the sorted particles: up to three cells along x. A pair is found from one side: rows ahead.
    """
    rows, bin_start = p.rows, p.bin_start
    bx, by, bz = walls.bins[0], walls.bins[1], walls.bins[2]
    ix, iy, iz = b % bx, (b // bx) % by, b // (bx * by)
    x0, x1 = max(ix - 1, 0), min(ix + 1, bx - 1)
    count, most = np.uint64(0), 0
    for row in range(5):
        jy = iy if row == 0 else (iy + 1 if row == 1 else iy + row - 3)
        jz = iz if row < 2 else iz + 1
        if jy < 0 or jy >= by or jz >= bz:
            continue
        line = (jz * by + jy) * bx
        begin, end = bin_start[line + x0], bin_start[line + x1 + 1]
        if row == 0 or begin < end:
            rows[count, 0], rows[count, 1] = begin, end
            count += np.uint64(1)
            most += end - begin
    return count, most


@part
def find(p, walls):
    """Find the pairs, each once, and the squares of their distances; return whether they had room."""
    x, other, first, bin_start, square, rows = p.x, p.other, p.first, p.bin_start, p.factor, p.rows
    h = np.float32(SUPPORT) * walls.spacing
    hh = h * h
    k, room = np.uint64(0), other.shape[0]
    for b in range(walls.bins[0] * walls.bins[1] * walls.bins[2]):
        if bin_start[b] == bin_start[b + 1]:
            continue
        count, most = _rows(p, walls, b)
        if np.int64(k) + (bin_start[b + 1] - bin_start[b]) * most > room:
            return False
        for i in range(np.uint64(bin_start[b]), np.uint64(bin_start[b + 1])):
            first[i] = k
            xi, yi, zi = x[i, 0], x[i, 1], x[i, 2]
            rows[0, 0] = np.int64(i) + 1
            for row in range(count):
                for j in range(np.uint64(rows[row, 0]), np.uint64(rows[row, 1])):
                    dx, dy, dz = xi - x[j, 0], yi - x[j, 1], zi - x[j, 2]
                    rr = dx * dx + dy * dy + dz * dz
                    other[k], square[k] = j, rr
                    k += np.uint64(rr < hh)
    first[p.count[0]] = k
    return True
