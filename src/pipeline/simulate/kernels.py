"""One time step of the liquid, compiled: neighbours, pressure, motion, walls. Frame: the container's.

Incompressibility as an implicit pressure impulse per particle with the kernel's gradients frozen for the step (Bender &
Koschier 2015, density part), solved by relaxed Jacobi iterations from the last step's impulses; the wall as a density
that depends on position alone (Koschier & Bender 2017). A trial is one serial piece of work: no atomics, no threads, and
sums in the order of the sorted particles, so that bits repeat.
"""

import numpy as np

from pipeline.simulate.compiled import part
from pipeline.simulate.fields import SUPPORT
from pipeline.simulate.lookup import rim_at, wall_distance, wall_reach

WARM = 0.8  # share of the last step's pressure that the next one starts from
RELAXATION = 0.5  # of the Jacobi iterations
VISCOSITY = 0.8  # share of the neighbours' mean velocity taken over in a step (XSPH, Monaghan 1989)
NEAREST = 0.4  # least distance of a particle from the wall, spacings
BEYOND = 0.05  # a particle this many spacings beyond the wall after all corrections has leaked
SPEED_LIMIT = 8.0  # m/s; a fall of 1 m ends at 4.4 m/s

STAYS, LEFT, LEAKED, FAILED = 0, 1, 2, 3


@part
def _sort(p, walls):
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
        for c in range(3):
            p.spare_x[k, c], p.spare_v[k, c] = p.x[i, c], p.v[i, c]
        p.spare_impulse[k] = p.impulse[i]
    for i in range(n):
        for c in range(3):
            p.x[i, c], p.v[i, c] = p.spare_x[i, c], p.spare_v[i, c]
        p.impulse[i] = p.spare_impulse[i]


@part
def _find(p, walls):
    """Find the pairs, each once, and the way `apart` from its second to its first; return whether they had room."""
    x, other, first, bin_start = p.x, p.other, p.first, p.bin_start
    apart_x, apart_y, apart_z = p.slope_x, p.slope_y, p.slope_z
    bx, by, bz = walls.bins[0], walls.bins[1], walls.bins[2]
    h = np.float32(SUPPORT) * walls.spacing
    hh = h * h
    k, room = np.uint64(0), other.shape[0]
    for b in range(bx * by * bz):
        if bin_start[b] == bin_start[b + 1]:
            continue
        ix, iy, iz = b % bx, (b // bx) % by, b // (bx * by)
        x0, x1 = max(ix - 1, 0), min(ix + 1, bx - 1)
        for i in range(np.uint64(bin_start[b]), np.uint64(bin_start[b + 1])):
            first[i] = k
            xi, yi, zi = x[i, 0], x[i, 1], x[i, 2]
            for row in range(5):
                jy = iy if row == 0 else (iy + 1 if row == 1 else iy + row - 3)
                jz = iz if row < 2 else iz + 1
                if jy < 0 or jy >= by or jz >= bz:
                    continue
                line = (jz * by + jy) * bx
                begin, end = np.int64(i) + 1 if row == 0 else bin_start[line + x0], bin_start[line + x1 + 1]
                if np.int64(k) + end - begin > room:
                    return False
                for j in range(np.uint64(begin), np.uint64(end)):
                    dx, dy, dz = xi - x[j, 0], yi - x[j, 1], zi - x[j, 2]
                    other[k], apart_x[k], apart_y[k], apart_z[k] = j, dx, dy, dz
                    k += np.uint64(dx * dx + dy * dy + dz * dz < hh)
    first[p.count[0]] = k
    return True


@part
def _slopes(p, walls):
    """Turn each pair's way `apart` into the kernel's gradient there; set its weight. No branches, so that it runs in vectors."""
    weight, slope_x, slope_y, slope_z = p.weight, p.slope_x, p.slope_y, p.slope_z
    h = np.float32(SUPPORT) * walls.spacing
    norm = _norm(walls, h)
    steep, per_h = norm / h, np.float32(1.0) / h
    none, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    two, six, eight, many = np.float32(2.0), np.float32(6.0), np.float32(8.0), np.float32(24.0)
    for k in range(np.uint64(p.first[p.count[0]])):
        dx, dy, dz = slope_x[k], slope_y[k], slope_z[k]
        r = np.sqrt(dx * dx + dy * dy + dz * dz + np.float32(1e-14))
        q = r * per_h
        away, inner = max(one - q, none), max(half - q, none)
        # The cubic spline as 2 (1 − q)³ − 8 (½ − q)³: no branch.
        weight[k] = norm * (two * away * away * away - eight * inner * inner * inner)
        s = steep * (many * inner * inner - six * away * away) / r
        slope_x[k], slope_y[k], slope_z[k] = s * dx, s * dy, s * dz


@part
def _norm(walls, h):
    """Return the kernel's factor for particles of volume spacing³."""
    return np.float32(8.0 / np.pi) * walls.spacing * walls.spacing * walls.spacing / (h * h * h)


@part
def _sum(p, walls):
    """Sum over the pairs into `sums`, from the wall's share on: density, its gradient and its square, change of velocity.

    The change of velocity is viscosity's and that of the impulses in `change`, the last step's.
    """
    n = p.count[0]
    x, v, sums, wall, change = p.x, p.v, p.sums, p.wall, p.change
    other, first, weight = p.other, p.first, p.weight
    slope_x, slope_y, slope_z = p.slope_x, p.slope_y, p.slope_z
    reach, shape, origin, cell = walls.reach, walls.shape, walls.origin, walls.cell
    none, viscosity = np.float32(0.0), np.float32(VISCOSITY)
    own = _norm(walls, np.float32(SUPPORT) * walls.spacing)
    for i in range(n):
        share, gx, gy, gz = wall_reach(reach, shape, origin, cell, x[i, 0], x[i, 1], x[i, 2])
        c = change[i]
        wall[i, 0], wall[i, 1], wall[i, 2] = gx, gy, gz
        sums[i, 0], sums[i, 1], sums[i, 2], sums[i, 3], sums[i, 4] = share + own, none, gx, gy, gz
        sums[i, 5], sums[i, 6], sums[i, 7] = -c * gx, -c * gy, -c * gz
    for i in range(n):
        ui, vi, wi, ci = v[i, 0], v[i, 1], v[i, 2], change[i]
        den = sq = sx = sy = sz = du = dv = dw = none
        for k in range(np.uint64(first[i]), np.uint64(first[i + 1])):
            j = other[k]
            w, gx, gy, gz = weight[k], slope_x[k], slope_y[k], slope_z[k]
            gg = gx * gx + gy * gy + gz * gz
            c, m = ci + change[j], viscosity * w
            a, e, f = m * (v[j, 0] - ui) - c * gx, m * (v[j, 1] - vi) - c * gy, m * (v[j, 2] - wi) - c * gz
            den += w
            sq += gg
            sx += gx
            sy += gy
            sz += gz
            du += a
            dv += e
            dw += f
            sums[j, 0] += w
            sums[j, 1] += gg
            sums[j, 2] -= gx
            sums[j, 3] -= gy
            sums[j, 4] -= gz
            sums[j, 5] -= a
            sums[j, 6] -= e
            sums[j, 7] -= f
        sums[i, 0] += den
        sums[i, 1] += sq
        sums[i, 2] += sx
        sums[i, 3] += sy
        sums[i, 4] += sz
        sums[i, 5] += du
        sums[i, 6] += dv
        sums[i, 7] += dw


@part
def _push(p):
    """Change the velocities by the impulses in `change`, pair by pair, and by the wall's answer."""
    for i in range(p.count[0]):
        c = p.change[i]
        ax, ay, az = c * p.wall[i, 0], c * p.wall[i, 1], c * p.wall[i, 2]
        for k in range(np.uint64(p.first[i]), np.uint64(p.first[i + 1])):
            j = p.other[k]
            s = c + p.change[j]
            gx, gy, gz = s * p.slope_x[k], s * p.slope_y[k], s * p.slope_z[k]
            ax += gx
            ay += gy
            az += gz
            p.v[j, 0] += gx
            p.v[j, 1] += gy
            p.v[j, 2] += gz
        p.v[i, 0] -= ax
        p.v[i, 1] -= ay
        p.v[i, 2] -= az


@part
def _correct(p, dt):
    """Set `change` to what the impulses lack for no particle to be denser than 1 at the end of the step."""
    n = p.count[0]
    rate = p.spare_impulse
    for i in range(n):
        rate[i] = p.v[i, 0] * p.wall[i, 0] + p.v[i, 1] * p.wall[i, 1] + p.v[i, 2] * p.wall[i, 2]
    for i in range(n):
        u, v, w = p.v[i, 0], p.v[i, 1], p.v[i, 2]
        own = np.float32(0.0)
        for k in range(np.uint64(p.first[i]), np.uint64(p.first[i + 1])):
            j = p.other[k]
            a = (u - p.v[j, 0]) * p.slope_x[k]
            a += (v - p.v[j, 1]) * p.slope_y[k]
            a += (w - p.v[j, 2]) * p.slope_z[k]
            own += a
            rate[j] += a
        rate[i] += own
    for i in range(n):
        t = p.sums[i, 2] ** 2 + p.sums[i, 3] ** 2 + p.sums[i, 4] ** 2
        excess = p.sums[i, 0] + dt * rate[i] - np.float32(1.0)
        before = p.impulse[i]
        after = before + np.float32(RELAXATION) * excess / (dt * (t + p.sums[i, 1]) + np.float32(1e-6))
        p.impulse[i] = max(after, np.float32(0.0))
        p.change[i] = p.impulse[i] - before


@part
def _accelerate(p, dt, gravity, axis, pivot, speed, growth, damping):
    """Apply gravity, the rotating frame's own accelerations (rad/s, rad/s²), viscosity and the last step's impulses."""
    f = np.float32
    gx, gy, gz = f(gravity[0]), f(gravity[1]), f(gravity[2])
    ax, ay, az = f(axis[0]), f(axis[1]), f(axis[2])
    w, e, keep = f(speed), f(growth), f(1.0 - damping)
    for i in range(p.count[0]):
        rx, ry, rz = p.x[i, 0] - f(pivot[0]), p.x[i, 1] - f(pivot[1]), p.x[i, 2] - f(pivot[2])
        u, v, s = p.v[i, 0], p.v[i, 1], p.v[i, 2]
        cx, cy, cz = ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx
        ox, oy, oz = ay * cz - az * cy, az * cx - ax * cz, ax * cy - ay * cx
        kx, ky, kz = ay * s - az * v, az * u - ax * s, ax * v - ay * u
        p.v[i, 0] = keep * (u + dt * (gx - e * cx - w * w * ox - f(2) * w * kx) + p.sums[i, 5])
        p.v[i, 1] = keep * (v + dt * (gy - e * cy - w * w * oy - f(2) * w * ky) + p.sums[i, 6])
        p.v[i, 2] = keep * (s + dt * (gz - e * cz - w * w * oz - f(2) * w * kz) + p.sums[i, 7])


@part
def _move(p, dt, walls):
    """Move every particle and take it out of the wall; those that left or leaked go to the list of the gone."""
    f = np.float32
    # Local names: numba counts references to a tuple's arrays at every access.
    x, v, impulse = p.x, p.v, p.impulse
    distance, shape, origin, cell = walls.distance, walls.shape, walls.origin, walls.cell
    radii, heights, opening = walls.rim_radius, walls.rim_height, walls.opening
    nearest, lowered, lowest_edge = f(NEAREST) * walls.spacing, walls.lowered, walls.lowest_edge
    beyond, spacing = -f(BEYOND) * walls.spacing, walls.spacing
    kept = gone = 0
    for i in range(p.count[0]):
        ox, oy, oz, su, sv, sw = x[i, 0], x[i, 1], x[i, 2], v[i, 0], v[i, 1], v[i, 2]
        px, py, pz = ox + dt * su, oy + dt * sv, oz + dt * sw
        how, d, nx, ny, nz = STAYS, nearest, f(0.0), f(0.0), f(0.0)
        if su * su + sv * sv + sw * sw < f(SPEED_LIMIT * SPEED_LIMIT):
            d, nx, ny, nz = wall_distance(distance, shape, origin, cell, px, py, pz)
        else:  # or not a number
            how = FAILED
        if d < f(0.98) * nearest:
            in_wall = True
            if pz >= lowest_edge:
                radius, height, out = rim_at(radii, heights, opening, px, py)
                in_wall = pz < height - lowered
                if not in_wall and out > radius:
                    # It left where its way crossed the rim's contour: there it must have been above the edge.
                    before = rim_at(radii, heights, opening, ox, oy)[2]
                    share = min(max((radius - before) / max(out - before, f(1e-9)), f(0.0)), f(1.0))
                    how = LEFT if oz + share * (pz - oz) >= height - lowered - spacing else LEAKED
            for _ in range(4):
                if not in_wall or d >= f(0.98) * nearest:
                    break
                px += (nearest - d) * nx
                py += (nearest - d) * ny
                pz += (nearest - d) * nz
                inwards = min(su * nx + sv * ny + sw * nz, f(0.0))
                su, sv, sw = su - inwards * nx, sv - inwards * ny, sw - inwards * nz
                d, nx, ny, nz = wall_distance(distance, shape, origin, cell, px, py, pz)
            if in_wall and d < beyond:
                how = LEAKED
        if how == STAYS:
            x[kept, 0], x[kept, 1], x[kept, 2] = px, py, pz
            v[kept, 0], v[kept, 1], v[kept, 2] = su, sv, sw
            impulse[kept] = impulse[i]
            kept += 1
        else:
            p.gone_x[gone, 0], p.gone_x[gone, 1], p.gone_x[gone, 2] = px, py, pz
            p.gone_v[gone, 0], p.gone_v[gone, 1], p.gone_v[gone, 2] = su, sv, sw
            p.gone_how[gone] = how
            gone += 1
    p.count[0], p.count[1] = kept, gone


@part
def step(p, walls, dt, iterations, gravity, axis, pivot, speed, growth, damping):
    """Advance by dt (s). Gravity, axis and pivot (x, y, z) in the container's frame; it turns about the axis
    through the pivot at `speed` (rad/s), growing by `growth` (rad/s²). `damping`: share of the velocity taken away.

    Returns whether all is well; the particles that left are listed in `p`.
    """
    dt = np.float32(dt)
    _sort(p, walls)
    for i in range(p.count[0]):
        p.impulse[i] *= np.float32(WARM)
        p.change[i] = p.impulse[i]
    if not _find(p, walls):
        return False
    _slopes(p, walls)
    _sum(p, walls)
    _accelerate(p, dt, gravity, axis, pivot, speed, growth, damping)
    for _ in range(iterations):
        _correct(p, dt)
        _push(p)
    _move(p, dt, walls)
    well = True
    for g in range(p.count[1]):
        well = well and p.gone_how[g] != FAILED
    return well


@part
def density_error(p, walls):
    """Return the sum of |density − 1| over the particles inside the liquid, and their number.

    Inside: neighbours on all sides (the density's gradient is small) and not in the air (the density is not).
    """
    total, count = 0.0, 0
    for i in range(p.count[0]):
        open_side = (p.sums[i, 2] ** 2 + p.sums[i, 3] ** 2 + p.sums[i, 4] ** 2) * walls.spacing**2
        if open_side < 0.04 and p.sums[i, 0] > 0.75:
            total += abs(p.sums[i, 0] - 1.0)
            count += 1
    return total, count
