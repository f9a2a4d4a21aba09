"""One time step of the liquid, compiled: pressure, motion, walls. Frame: the container's.

Incompressibility as an implicit pressure impulse per particle with the kernel's gradients frozen for the step (Bender &
Koschier 2015, density part), solved by relaxed Jacobi iterations from the last step's impulses; the wall as a density
that depends on position alone (Koschier & Bender 2017). A trial is one serial piece of work: no atomics, no threads, and
sums in the order of the sorted particles, so that bits repeat.
"""

import numpy as np

from pipeline.simulate.compiled import part
from pipeline.simulate.fields import SUPPORT
from pipeline.simulate.lookup import rim_at, wall_distance, wall_reach
from pipeline.simulate.neighbours import find, sort

WARM = 0.8  # share of the last step's pressure that the next one starts from
RELAXATION = 0.5  # of the Jacobi iterations
ENOUGH = 0.007  # mean excess of density at which the iterations end
STEEPNESS = (
    8.0  # of the kernel: squares of its gradients to its values, summed over neighbours, in its own units
)
VISCOSITY = 0.8  # share of the neighbours' mean velocity taken over in a step (XSPH, Monaghan 1989)
NEAREST = 0.4  # least distance of a particle from the wall, spacings
BEYOND = 0.05  # a particle this many spacings beyond the wall after all corrections has leaked
SPEED_LIMIT = 8.0  # m/s; a fall of 1 m ends at 4.4 m/s

STAYS, LEFT, LEAKED, FAILED = 0, 1, 2, 3


@part
def _weigh(p, walls):
    """Turn each pair's squared distance into the kernel there and the factor from its way apart to the kernel's gradient."""
    weight, factor = p.weight, p.factor
    h = np.float32(SUPPORT) * walls.spacing
    norm = _norm(walls, h)
    steep, per_h = norm / h, np.float32(1.0) / h
    none, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    two, six, eight, many = np.float32(2.0), np.float32(6.0), np.float32(8.0), np.float32(24.0)
    for k in range(np.uint64(p.first[p.count[0]])):
        r = np.sqrt(factor[k] + np.float32(1e-14))
        q = r * per_h
        away, inner = max(one - q, none), max(half - q, none)
        # The cubic spline as 2 (1 − q)³ − 8 (½ − q)³: no branch, so that it runs in vectors.
        weight[k] = norm * (two * away * away * away - eight * inner * inner * inner)
        factor[k] = steep * (many * inner * inner - six * away * away) / r


@part
def _norm(walls, h):
    """Return the kernel's factor for particles of volume spacing³."""
    return np.float32(8.0 / np.pi) * walls.spacing * walls.spacing * walls.spacing / (h * h * h)


@part
def _sum(p, walls):
    """Sum over the pairs into `sums`, from the wall's share on: the density's gradient, density, change of velocity.

    The change of velocity is viscosity's and that of the impulses in `change`, the last step's.
    """
    n = p.count[0]
    x, v, sums, wall, change = p.x, p.v, p.sums, p.wall, p.change
    other, first, weight, factor, slope = p.other, p.first, p.weight, p.factor, p.slope
    reach, shape, origin, cell = walls.reach, walls.shape, walls.origin, walls.cell
    none, viscosity = np.float32(0.0), np.float32(VISCOSITY)
    own = _norm(walls, np.float32(SUPPORT) * walls.spacing)
    for i in range(n):
        share, gx, gy, gz = wall_reach(reach, shape, origin, cell, x[i, 0], x[i, 1], x[i, 2])
        c = change[i]
        wall[i, 0], wall[i, 1], wall[i, 2], wall[i, 3] = gx, gy, gz, share + own
        sums[i, 0], sums[i, 1], sums[i, 2], sums[i, 3] = gx, gy, gz, share + own
        sums[i, 4], sums[i, 5], sums[i, 6], sums[i, 7] = -c * gx, -c * gy, -c * gz, none
    for i in range(n):
        xi, yi, zi, ei = x[i, 0], x[i, 1], x[i, 2], x[i, 3]
        ui, vi, wi, oi = v[i, 0], v[i, 1], v[i, 2], v[i, 3]
        ci = change[i]
        sx = sy = sz = den = du = dv = dw = do = none
        for k in range(np.uint64(first[i]), np.uint64(first[i + 1])):
            j = other[k]
            s, w = factor[k], weight[k]
            gx, gy, gz, ge = s * (xi - x[j, 0]), s * (yi - x[j, 1]), s * (zi - x[j, 2]), s * (ei - x[j, 3])
            slope[k, 0], slope[k, 1], slope[k, 2], slope[k, 3] = gx, gy, gz, ge
            c, m = ci + change[j], viscosity * w
            a, b = m * (v[j, 0] - ui) - c * gx, m * (v[j, 1] - vi) - c * gy
            e, f = m * (v[j, 2] - wi) - c * gz, m * (v[j, 3] - oi) - c * ge
            sx += gx
            sy += gy
            sz += gz
            den -= w
            du += a
            dv += b
            dw += e
            do += f
            sums[j, 0] -= gx
            sums[j, 1] -= gy
            sums[j, 2] -= gz
            sums[j, 3] += w
            sums[j, 4] -= a
            sums[j, 5] -= b
            sums[j, 6] -= e
            sums[j, 7] -= f
        sums[i, 0] += sx
        sums[i, 1] += sy
        sums[i, 2] += sz
        sums[i, 3] -= den
        sums[i, 4] += du
        sums[i, 5] += dv
        sums[i, 6] += dw
        sums[i, 7] += do


@part
def _push(p):
    """Change the velocities by the impulses in `change`, pair by pair, and by the wall's answer."""
    v, slope, change, other, first = p.v, p.slope, p.change, p.other, p.first
    for i in range(p.count[0]):
        c = change[i]
        ax, ay, az, ae = c * p.wall[i, 0], c * p.wall[i, 1], c * p.wall[i, 2], np.float32(0.0)
        for k in range(np.uint64(first[i]), np.uint64(first[i + 1])):
            j = other[k]
            s = c + change[j]
            gx, gy, gz, ge = s * slope[k, 0], s * slope[k, 1], s * slope[k, 2], s * slope[k, 3]
            ax += gx
            ay += gy
            az += gz
            ae += ge
            v[j, 0] += gx
            v[j, 1] += gy
            v[j, 2] += gz
            v[j, 3] += ge
        v[i, 0] -= ax
        v[i, 1] -= ay
        v[i, 2] -= az
        v[i, 3] -= ae


@part
def _correct(p, walls, dt):
    """Set `change` to what the impulses lack for no particle to be denser than 1 at the end of the step.

    Returns whether the mean excess of density was small before that. The diagonal of the equations is the sum of the squares of
    the neighbours' gradients; it is taken from their density, as it decides how fast the solution is found, not which.
    """
    n = p.count[0]
    rate, v, slope, other, first, sums, wall = p.spare_impulse, p.v, p.slope, p.other, p.first, p.sums, p.wall
    h = np.float32(SUPPORT) * walls.spacing
    steep = np.float32(STEEPNESS) * _norm(walls, h) / (h * h)
    for i in range(n):
        rate[i] = v[i, 0] * wall[i, 0] + v[i, 1] * wall[i, 1] + v[i, 2] * wall[i, 2]
    for i in range(n):
        a, b, c = v[i, 0], v[i, 1], v[i, 2]
        own = np.float32(0.0)
        for k in range(np.uint64(first[i]), np.uint64(first[i + 1])):
            j = other[k]
            r = (a - v[j, 0]) * slope[k, 0] + (b - v[j, 1]) * slope[k, 1] + (c - v[j, 2]) * slope[k, 2]
            own += r
            rate[j] += r
        rate[i] += own
    lack = np.float32(0.0)
    for i in range(n):
        t = sums[i, 0] ** 2 + sums[i, 1] ** 2 + sums[i, 2] ** 2
        squares = steep * (sums[i, 3] - wall[i, 3])
        excess = sums[i, 3] + dt * rate[i] - np.float32(1.0)
        lack += max(excess, np.float32(0.0))
        before = p.impulse[i]
        after = before + np.float32(RELAXATION) * excess / (dt * (t + squares) + np.float32(1e-6))
        p.impulse[i] = max(after, np.float32(0.0))
        p.change[i] = p.impulse[i] - before
    return lack <= np.float32(ENOUGH) * np.float32(n)


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
        p.v[i, 0] = keep * (u + dt * (gx - e * cx - w * w * ox - f(2) * w * kx) + p.sums[i, 4])
        p.v[i, 1] = keep * (v + dt * (gy - e * cy - w * w * oy - f(2) * w * ky) + p.sums[i, 5])
        p.v[i, 2] = keep * (s + dt * (gz - e * cz - w * w * oz - f(2) * w * kz) + p.sums[i, 6])


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
    sort(p, walls)
    for i in range(p.count[0]):
        p.impulse[i] *= np.float32(WARM)
        p.change[i] = p.impulse[i]
    if not find(p, walls):
        return False
    _weigh(p, walls)
    _sum(p, walls)
    _accelerate(p, dt, gravity, axis, pivot, speed, growth, damping)
    for _ in range(iterations):
        enough = _correct(p, walls, dt)
        _push(p)
        if enough:
            break
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
        open_side = (p.sums[i, 0] ** 2 + p.sums[i, 1] ** 2 + p.sums[i, 2] ** 2) * walls.spacing**2
        if open_side < 0.04 and p.sums[i, 3] > 0.75:
            total += abs(p.sums[i, 3] - 1.0)
            count += 1
    return total, count
