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

    lowest (3,): coordinates of the first voxel. columns (nx, ny), layers (nz,): where to look at all. near (nx, ny,
    nz): where a surface may be; elsewhere two views that see past are enough, and amid blocks whose middles are
    all free or all unseen no view is asked. The arrays of `Planes`; truncation in metres.
    """
    nx, ny, nz = near.shape
    amid = _amid(_blocks(lowest, voxel, near, plane, view, projection, truncation))
    value, weight = np.zeros((nx, ny, nz), np.float32), np.zeros((nx, ny, nz), np.float32)
    seen, column = np.zeros((len(view), 5)), np.zeros((len(view), 3))
    for ix in range(nx):
        for iy in range(ny):
            if not columns[ix, iy]:
                continue
            x, y = (lowest[0] + ix) * voxel, (lowest[1] + iy) * voxel
            _project(x, y, projection, column)
            for iz in range(nz):
                block = amid[ix // TOGETHER, iy // TOGETHER, iz // TOGETHER]
                if not layers[iz] or block == UNSEEN:
                    continue
                if block == FREE:
                    value[ix, iy, iz], weight[ix, iy, iz] = 1.0, LEAST_FREE
                    continue
                z = (lowest[2] + iz) * voxel
                enough = len(view) if near[ix, iy, iz] else LEAST_FREE
                count, free = _observed(x, y, z, column, plane, view, projection, truncation, enough, seen)
                if count + free > 0:
                    distance = _nearest_side(seen[:count], free * FREE_WORTH, truncation)
                    value[ix, iy, iz], weight[ix, iy, iz] = distance / truncation, count + free
    return value, weight


@numba.njit(cache=True)
def _blocks(lowest, voxel, near, plane, view, projection, truncation):  # type: ignore[no-untyped-def]
    """Return of each block of voxels what its middle is: free, unseen, or neither; or that a surface may be in it."""
    shape = [-(-n // TOGETHER) for n in near.shape]
    found = np.full((shape[0], shape[1], shape[2]), SURFACE, np.int8)
    seen, column = np.zeros((len(view), 5)), np.zeros((len(view), 3))
    middle = (TOGETHER - 1) / 2
    for bx in range(shape[0]):
        for by in range(shape[1]):
            x, y = (lowest[0] + bx * TOGETHER + middle) * voxel, (lowest[1] + by * TOGETHER + middle) * voxel
            _project(x, y, projection, column)
            for bz in range(shape[2]):
                i, j, k = bx * TOGETHER, by * TOGETHER, bz * TOGETHER
                if near[i : i + TOGETHER, j : j + TOGETHER, k : k + TOGETHER].any():
                    continue
                z = (lowest[2] + k + middle) * voxel
                count, free = _observed(
                    x, y, z, column, plane, view, projection, truncation, LEAST_FREE, seen
                )
                found[bx, by, bz] = FREE if free >= LEAST_FREE else UNSEEN if count + free == 0 else NEITHER
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
def _project(x, y, projection, column):  # type: ignore[no-untyped-def]
    """Write the part of the projections that is the same for all z to `column` (V, 3)."""
    # One number at a time: assigning to a slice compiles numba's text of an error that cannot be, for seconds.
    for k in range(len(projection)):
        for c in range(3):
            column[k, c] = projection[k, c, 0] * x + projection[k, c, 1] * y + projection[k, c, 3]


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
    u, v = int(np.floor(a * inverse + 0.5)), int(np.floor(b * inverse + 0.5))
    if u < 0 or v < 0 or u >= view[k, 1] or v >= view[k, 2]:
        return -1
    return view[k, 0] + v * view[k, 1] + u


@numba.njit(cache=True)
def _observed(x, y, z, column, plane, view, projection, truncation, enough, seen):  # type: ignore[no-untyped-def]
    """Fill `seen` with distance, weight and normal of the planes within the truncation; return their number and that of views
    that see past. column (V, 3): the part of the projections that is the same for all z."""
    count, free = 0, 0
    for k in range(len(view)):
        a, b = column[k, 0] + projection[k, 0, 2] * z, column[k, 1] + projection[k, 1, 2] * z
        row = _row(a, b, column[k, 2] + projection[k, 2, 2] * z, k, view)
        if row < 0 or plane[row, 4] <= 0:
            continue
        distance = plane[row, 0] * x + plane[row, 1] * y + plane[row, 2] * z - plane[row, 3]
        if distance >= min(truncation, PAST_M * plane[row, 4]):
            free += 1
            if free >= enough or (free >= SURELY_FREE and count == 0):
                break
        elif distance > -truncation:
            # Across the ray a pixel is as uncertain as ever, along it by the tangent of the incidence more.
            seen[count, 0], seen[count, 1] = distance, plane[row, 4] ** 2
            seen[count, 2], seen[count, 3], seen[count, 4] = plane[row, 0], plane[row, 1], plane[row, 2]
            count += 1
    return count, free


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
            row = _pixel(x, y, z, k, view, projection)
            if row < 0 or plane[row, 4] <= 0:
                continue
            p = plane[row]
            cosine = p[0] * normals[i, 0] + p[1] * normals[i, 1] + p[2] * normals[i, 2]
            distance = p[0] * x + p[1] * y + p[2] * z - p[3]
            if cosine >= SAME_SIDE_COSINE and abs(distance) <= reach:
                w = p[4] * cosine
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
            ray = vertices[i] - eye[k]
            if abs((ray * normals[i]).sum()) > OUTLINE_COSINE * np.sqrt((ray**2).sum()):
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
