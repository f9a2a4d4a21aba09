"""Questions of the compiled code to a container's precomputed wall: at a point, how much of it, how far, where is the rim?

They take arrays, not the tuple `Walls`: numba counts references to a tuple's arrays at every access.
"""

import numpy as np

from pipeline.simulate.compiled import inlined

# Indices are unsigned where it matters: numba then leaves out its check for negative ones.
ONE = np.uint64(1)


@inlined
def _corner(shape, origin, cell, x, y, z):
    """Return the index of the field's cell around a point, its strides in y and x, and where in the cell the point is."""
    per_m = np.float32(1.0) / cell
    nx, ny, nz = shape[0], shape[1], shape[2]
    low, margin = np.float32(0.0), np.float32(1.001)
    fx = min(max((x - origin[0]) * per_m, low), np.float32(nx) - margin)
    fy = min(max((y - origin[1]) * per_m, low), np.float32(ny) - margin)
    fz = min(max((z - origin[2]) * per_m, low), np.float32(nz) - margin)
    i, j, k = np.uint64(fx), np.uint64(fy), np.uint64(fz)
    return (i * ny + j) * nz + k, nz, ny * nz, fx - np.float32(i), fy - np.float32(j), fz - np.float32(k)


@inlined
def wall_reach(reach, shape, origin, cell, x, y, z):
    """Return the wall's density at a point and its gradient (1/m)."""
    at, dy, dx, u, v, w = _corner(shape, origin, cell, x, y, z)
    one, r = np.float32(1.0), reach
    b = bx = by = bz = np.float32(0.0)
    for a in range(8):
        k = at
        share = one
        if a & 1:
            k += ONE
            share *= w
        else:
            share *= one - w
        if a & 2:
            k += dy
            share *= v
        else:
            share *= one - v
        if a & 4:
            k += dx
            share *= u
        else:
            share *= one - u
        b += share * r[k, 0]
        bx += share * r[k, 1]
        by += share * r[k, 2]
        bz += share * r[k, 3]
    return b, bx, by, bz


@inlined
def wall_distance(distance, shape, origin, cell, x, y, z):
    """Return the distance to the wall (m, negative beyond) and its unit gradient, which points into the cavity."""
    at, dy, dx, u, v, w = _corner(shape, origin, cell, x, y, z)
    one, d = np.float32(1.0), distance
    d000, d001, d010, d011 = d[at], d[at + ONE], d[at + dy], d[at + dy + ONE]
    at += dx
    d100, d101, d110, d111 = d[at], d[at + ONE], d[at + dy], d[at + dy + ONE]
    c00, c01 = d000 + u * (d100 - d000), d001 + u * (d101 - d001)
    c10, c11 = d010 + u * (d110 - d010), d011 + u * (d111 - d011)
    c0, c1 = c00 + v * (c10 - c00), c01 + v * (c11 - c01)
    gz = c1 - c0
    gy = (c10 - c00) * (one - w) + (c11 - c01) * w
    gx = ((d100 - d000) * (one - v) + (d110 - d010) * v) * (one - w)
    gx += ((d101 - d001) * (one - v) + (d111 - d011) * v) * w
    norm = one / (np.sqrt(gx * gx + gy * gy + gz * gz) + np.float32(1e-12))
    return c0 + w * (c1 - c0), gx * norm, gy * norm, gz * norm


@inlined
def rim_at(radii, heights, opening, x, y):
    """Return how far the rim is from the opening's axis in the direction of (x, y), how high, and how far (x, y) is."""
    dx, dy = x - opening[0], y - opening[1]
    m = radii.shape[0]
    turn = np.arctan2(dy, dx) * np.float32(m / (2 * np.pi)) + np.float32(m)
    k = int(turn)
    f = np.float32(turn - np.float32(k))
    k, after = k % m, (k + 1) % m
    one = np.float32(1.0)
    radius = radii[k] * (one - f) + radii[after] * f
    return radius, heights[k] * (one - f) + heights[after] * f, np.sqrt(dx * dx + dy * dy)
