"""What all views say of a place: how far in front of a surface a voxel is, how far off its pixels a vertex, where an outline.

A thin wall is measured from both sides. What one side's cameras see says nothing about the other side, except that free
space is free: so the two are told apart by the normals, and averaged apart.
"""

import numba
import numpy as np

LEAST_FREE = 2  # views that see a voxel free, far from every surface: enough to believe it
SURELY_FREE = 12  # views that see past, and none before them that sees a surface: the others are not asked
# Blocks of so many voxels a side are asked once, and what they are: see `_blocks`; only the free and the unseen are acted on.
TOGETHER = 4
SURFACE, FREE, UNSEEN, NEITHER = 0, 1, 2, 3
# A view that sees past a voxel counts less than one that sees the surface near it: at a lip, where half of the views see past,
# the mean is then zero in walls of some millimetres.
FREE_WORTH = 0.4
OPPOSED_COSINE = -0.2  # between the mean normals of two groups of pixels: they see two sides
SAME_SIDE_COSINE = 0.5  # between the normals of a vertex and of a pixel that measures it
# Outlines: the line along the normal on which they are looked for, and how square to it the view must be.
OUTLINE_REACH_M, OUTLINE_STEP_M, OUTLINE_COSINE = 0.0025, 0.0005, 0.35
PAST_M = 0.008  # what is this far behind a place, along the ray, is seen past it
# The pixels next to an edge are lost or dropped, one more in front than behind it.
OUTLINE_BIAS_M = 0.00025


@numba.njit(cache=True)
def signed_distances(lowest, voxel, columns, layers, near, plane, view, projection, truncation):  # type: ignore[no-untyped-def]
    """Return signed distances (nx, ny, nz) in truncations, positive in the open, and how many views told.

    lowest (3,): coordinates of the first voxel. columns (C, 2), layers (nz,): where to look at all; what columns that follow each
    other show stays in the processor's cache if they are near. near (nx, ny, nz): where a surface may be; elsewhere two views that
    see past are enough, and amid blocks whose middles are all free or all unseen no view is asked. The arrays of `Planes`;
    truncation in metres.
    """
    nx, ny, nz = near.shape
    amid = _amid(_blocks(lowest, voxel, near, plane, view, projection, truncation))
    value, weight = np.zeros((nx, ny, nz), np.float32), np.zeros((nx, ny, nz), np.float32)
    z, layer, enough = np.zeros(nz), np.zeros(nz, np.int64), np.zeros(nz, np.int64)
    seen, count, free = np.zeros((nz, len(view), 5)), np.zeros(nz, np.int64), np.zeros(nz, np.int64)
    for ix, iy in columns:
        asked = 0
        for iz in range(nz):
            block = amid[ix // TOGETHER, iy // TOGETHER, iz // TOGETHER]
            if not layers[iz] or block == UNSEEN:
                continue
            if block == FREE:
                value[ix, iy, iz], weight[ix, iy, iz] = 1.0, LEAST_FREE
                continue
            z[asked], layer[asked] = (lowest[2] + iz) * voxel, iz
            enough[asked] = len(view) if near[ix, iy, iz] else LEAST_FREE
            asked += 1
        x, y = (lowest[0] + ix) * voxel, (lowest[1] + iy) * voxel
        _observe(x, y, z[:asked], enough, plane, view, projection, truncation, seen, count, free)
        for i in range(asked):
            if count[i] + free[i] > 0:
                distance = _nearest_side(seen[i, : count[i]], free[i] * FREE_WORTH, truncation)
                value[ix, iy, layer[i]], weight[ix, iy, layer[i]] = distance / truncation, count[i] + free[i]
    return value, weight


@numba.njit(cache=True)
def _blocks(lowest, voxel, near, plane, view, projection, truncation):  # type: ignore[no-untyped-def]
    """Return of each block of voxels what its middle is: free, unseen, or neither; or that a surface may be in it."""
    shape = [-(-n // TOGETHER) for n in near.shape]
    found = np.full((shape[0], shape[1], shape[2]), SURFACE, np.int8)
    z, layer, enough = np.zeros(shape[2]), np.zeros(shape[2], np.int64), np.full(shape[2], LEAST_FREE)
    seen = np.zeros((shape[2], len(view), 5))
    count, free = np.zeros(shape[2], np.int64), np.zeros(shape[2], np.int64)
    middle = (TOGETHER - 1) / 2
    for bx in range(shape[0]):
        for by in range(shape[1]):
            asked = 0
            for bz in range(shape[2]):
                i, j, k = bx * TOGETHER, by * TOGETHER, bz * TOGETHER
                if not near[i : i + TOGETHER, j : j + TOGETHER, k : k + TOGETHER].any():
                    z[asked], layer[asked] = (lowest[2] + k + middle) * voxel, bz
                    asked += 1
            x, y = (lowest[0] + bx * TOGETHER + middle) * voxel, (lowest[1] + by * TOGETHER + middle) * voxel
            _observe(x, y, z[:asked], enough, plane, view, projection, truncation, seen, count, free)
            for i in range(asked):
                is_free, is_unseen = free[i] >= LEAST_FREE, count[i] + free[i] == 0
                found[bx, by, layer[i]] = FREE if is_free else UNSEEN if is_unseen else NEITHER
    return found


@numba.njit(cache=True)
def _amid(blocks):  # type: ignore[no-untyped-def]
    """Return the blocks with those as `NEITHER` that border on another kind; a surface beside them does not count."""
    found = blocks.copy()
    nx, ny, nz = blocks.shape
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                around = blocks[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2, max(k - 1, 0) : k + 2]
                for other in around.flat:
                    unlike = other != blocks[i, j, k]
                    if unlike and other != SURFACE:
                        found[i, j, k] = NEITHER
    return found


@numba.njit(cache=True)
def _observe(x, y, z, enough, plane, view, projection, truncation, seen, count, free):  # type: ignore[no-untyped-def]
    """Write for places (M,) above each other distance, weight and normal of the planes within the truncation to `seen` (M, V, 5),
    their number to `count` (M,), and to `free` (M,) that of views that see past: of `enough` (M,) views at most."""
    count[: len(z)], free[: len(z)] = 0, 0
    for k in range(len(view)):  # one after the other: neighbours fare alike, which processors foresee
        P, left = projection[k], 0
        a = P[0, 0] * x + P[0, 1] * y + P[0, 3]
        b = P[1, 0] * x + P[1, 1] * y + P[1, 3]
        w = P[2, 0] * x + P[2, 1] * y + P[2, 3]
        for i in range(len(z)):
            if free[i] >= enough[i] or (free[i] >= SURELY_FREE and count[i] == 0):
                continue
            left += 1
            found = _row(a + P[0, 2] * z[i], b + P[1, 2] * z[i], w + P[2, 2] * z[i], k, view)
            row = np.uint64(found)  # not counted from the end
            if found < 0 or plane[row, 4] <= 0:
                continue
            distance = plane[row, 0] * x + plane[row, 1] * y + plane[row, 2] * z[i] - plane[row, 3]
            if distance >= min(truncation, PAST_M * plane[row, 4]):
                free[i] += 1
            elif distance > -truncation:
                # Across the ray a pixel is as uncertain as ever, along it by the tangent of the incidence more.
                into = seen[i, count[i]]
                into[0], into[1] = distance, plane[row, 4] ** 2
                into[2], into[3], into[4] = plane[row, 0], plane[row, 1], plane[row, 2]
                count[i] += 1
        if left == 0:
            return


@numba.njit(cache=True)
def _pixel(x, y, z, k, view, projection):  # type: ignore[no-untyped-def]
    """Return which row of the planes the point falls on in view k; -1: none."""
    P = projection[k]
    a = P[0, 0] * x + P[0, 1] * y + P[0, 2] * z + P[0, 3]
    b = P[1, 0] * x + P[1, 1] * y + P[1, 2] * z + P[1, 3]
    return _row(a, b, P[2, 0] * x + P[2, 1] * y + P[2, 2] * z + P[2, 3], k, view)


@numba.njit(cache=True)
def _row(a, b, w, k, view):  # type: ignore[no-untyped-def]
    """Return which row of the planes the homogeneous pixel (a, b, w) is in view k; -1: none."""
    if w <= 0:
        return -1
    inverse = 1.0 / w
    u, v = a * inverse + 0.5, b * inverse + 0.5
    if u < 0 or v < 0 or u >= view[k, 1] or v >= view[k, 2]:
        return -1
    return view[k, 0] + int(v) * view[k, 1] + int(u)


@numba.njit(cache=True)
def _nearest_side(seen, free, truncation):  # type: ignore[no-untyped-def]
    """Return the mean distance; where two opposite sides are seen that of the nearer: solid is what is behind both."""
    total, weight, one_side = free * truncation, free, True
    for i in range(len(seen)):
        total += seen[i, 1] * seen[i, 0]
        weight += seen[i, 1]
        one_side &= seen[0, 2] * seen[i, 2] + seen[0, 3] * seen[i, 3] + seen[0, 4] * seen[i, 4] > 0
    if one_side:
        return total / weight
    first, first_weight, cosine = _one_side(seen, _main_axis(seen))
    second, second_weight = total - free * truncation - first, weight - free - first_weight
    if cosine > OPPOSED_COSINE:
        return total / weight
    first, second = first + free * truncation, second + free * truncation
    return max(first / (first_weight + free), second / (second_weight + free))


@numba.njit(cache=True)
def _one_side(seen, axis):  # type: ignore[no-untyped-def]
    """Return the weighted sum of distances along the axis (3,) and their weight, and the cosine between the two sides' normals."""
    total, weight = 0.0, 0.0
    normals = np.zeros((2, 3))
    for i in range(len(seen)):
        along = axis[0] * seen[i, 2] + axis[1] * seen[i, 3] + axis[2] * seen[i, 4] > 0
        if along:
            total += seen[i, 1] * seen[i, 0]
            weight += seen[i, 1]
        for j in range(3):
            normals[int(along), j] += seen[i, 1] * seen[i, 2 + j]
    lengths = np.sqrt((normals[0] ** 2).sum() * (normals[1] ** 2).sum())
    return total, weight, (normals[0] * normals[1]).sum() / lengths if lengths > 0 else 1.0


@numba.njit(cache=True)
def _main_axis(seen):  # type: ignore[no-untyped-def]
    """Return the main axis (3,) of the normals, whatever their signs, by power iteration."""
    scatter = np.zeros((3, 3))
    for k in range(len(seen)):
        for i in range(3):
            for j in range(3):
                scatter[i, j] += seen[k, 1] * seen[k, 2 + i] * seen[k, 2 + j]
    longest = 0
    for i in range(1, 3):
        if scatter[i, i] > scatter[longest, longest]:
            longest = i
    axis, turned = scatter[longest].copy(), np.zeros(3)
    for _ in range(4):
        for i in range(3):
            turned[i] = scatter[i, 0] * axis[0] + scatter[i, 1] * axis[1] + scatter[i, 2] * axis[2]
        length = max(np.sqrt(turned[0] ** 2 + turned[1] ** 2 + turned[2] ** 2), 1e-300)
        for i in range(3):
            axis[i] = turned[i] / length
    return axis


@numba.njit(cache=True)
def offsets(vertices, normals, plane, view, projection, reach):  # type: ignore[no-untyped-def]
    """Return how far (V,) along its normal each vertex (V, 3) must go to the planes that face its side, and their weight (V,)."""
    n = len(vertices)
    offset, weight = np.zeros(n), np.zeros(n)
    for k in range(len(view)):  # one after the other: a view's planes stay in the processor's cache
        for i in range(n):
            x, y, z = vertices[i]
            found = _pixel(x, y, z, k, view, projection)
            row = np.uint64(found)  # not counted from the end
            if found < 0:
                continue
            a, b, c = plane[row, 0], plane[row, 1], plane[row, 2]
            cosine = a * normals[i, 0] + b * normals[i, 1] + c * normals[i, 2]
            if cosine < SAME_SIDE_COSINE or plane[row, 4] <= 0:
                continue
            distance = a * x + b * y + c * z - plane[row, 3]
            if abs(distance) <= reach:
                w = plane[row, 4] * cosine
                offset[i] -= w * distance
                weight[i] += w
    return offset / np.maximum(weight, 1e-12), weight


@numba.njit(cache=True)
def outlines(vertices, normals, wanted, plane, view, projection, eye):  # type: ignore[no-untyped-def]
    """Return how far (V,) along its normal each wanted vertex is from the outline, and in how many views square to it (V,)."""
    n = len(vertices)
    offset, count = np.zeros(n), np.zeros(n)
    for i in np.nonzero(wanted)[0]:
        for k in range(len(view)):
            along, square = 0.0, 0.0
            for c in range(3):
                along += (vertices[i, c] - eye[k, c]) * normals[i, c]
                square += (vertices[i, c] - eye[k, c]) ** 2
            if abs(along) > OUTLINE_COSINE * np.sqrt(square):
                continue
            edge = _outline(vertices[i], normals[i], k, plane, view, projection)
            if not np.isnan(edge):
                offset[i] += edge
                count[i] += 1.0
    return offset / np.maximum(count, 1.0), count


@numba.njit(cache=True)
def _outline(vertex, normal, k, plane, view, projection):  # type: ignore[no-untyped-def]
    """Return where along the normal the object ends in view k: midway between its last pixel and the first that sees past."""
    steps = round(2 * OUTLINE_REACH_M / OUTLINE_STEP_M) + 1
    hits, past = 0, 0
    for j in range(steps):
        s = -OUTLINE_REACH_M + j * OUTLINE_STEP_M
        x, y, z = vertex[0] + s * normal[0], vertex[1] + s * normal[1], vertex[2] + s * normal[2]
        row = _pixel(x, y, z, k, view, projection)
        if row < 0:
            return np.nan
        if plane[row, 4] > 0:
            distance = plane[row, 0] * x + plane[row, 1] * y + plane[row, 2] * z - plane[row, 3]
            behind = distance / plane[row, 4]
            if behind < -PAST_M:
                return np.nan  # something else stands in front
            if behind > PAST_M:
                past += 1
            else:
                hits += 1
        if j == 1 and hits < 2:
            return np.nan
    if past == 0:
        return np.nan
    return -OUTLINE_REACH_M + (0.5 * (steps + hits - past) - 0.5) * OUTLINE_STEP_M - OUTLINE_BIAS_M
