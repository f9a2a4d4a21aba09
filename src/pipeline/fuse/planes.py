"""Depth images to small planes: every usable pixel gets the plane through its neighbourhood, in the object frame."""

from dataclasses import dataclass

import numba
import numpy as np

from pipeline.fuse.layouts import Views
from pipeline.fuse.table import Placement
from pipeline.geometry import frames

# Pixels this far behind a neighbour are dropped: near an edge the sensor mixes up who is in front, and what is
# wrongly seen behind a lip would carve the lip away.
EDGE_JUMP_M = 0.010
RADIUS_PX, SIGMA_PX = 2, 1.5
GATE_M = 0.004  # from the plane: three times the noise of a Kinect at 0.6 m
_LEAST_PIXELS = 3
# On the slopes of the fit, in pixels²: few neighbours make a steep plane, which is likely wrong.
_RIDGE_PX2 = 0.3
_BORDER_PX = 4


@dataclass(frozen=True)
class Planes:
    """All views' pixels in one table, object frame, metres.

    plane (N, 5) float32: unit normal towards the camera, offset c with normal · x = c on the surface, and the cosine between
    normal and ray (0: nothing known). view (V, 3): first pixel, width and height of the window of each view. projection
    (V, 3, 4): points to homogeneous pixels of that window. eye (V, 3): the cameras.
    """

    plane: np.ndarray
    view: np.ndarray
    projection: np.ndarray
    eye: np.ndarray


def planes(views: Views, placement: Placement) -> Planes:
    """Fit planes to the part of every view that shows the space around the object; beyond it they face the camera."""
    corners = np.stack(np.meshgrid(*placement.bounds_m.T), axis=-1).reshape(-1, 3)
    poses = [placement.T_object_world @ T_world_camera for T_world_camera in views.T_world_cameras]
    depths, cameras, windows, projections, start = [], [], [], [], 0
    for depth_m, K, T_object_camera in zip(views.depths_m, views.intrinsics, poses, strict=True):
        low, high = _window(corners, K, T_object_camera, depth_m.shape)
        cameras.append(K - [[0, 0, low[0]], [0, 0, low[1]], [0, 0, 0]])
        depths.append(np.ascontiguousarray(depth_m[low[1] : high[1], low[0] : high[0]]))
        windows.append((start, *(high - low)))
        projections.append(cameras[-1] @ frames.inverse(T_object_camera)[:3])
        start += depths[-1].size
    plane = np.zeros((start, 5), np.float32)
    for depth_m, K, T_object_camera, (first, *_) in zip(depths, cameras, poses, windows, strict=True):
        own = plane[first : first + depth_m.size]
        _fit_all(inverse_depths(depth_m), K, T_object_camera, placement.bounds_m, own)
    eyes = np.array([T[:3, 3] for T in poses])
    return Planes(plane, np.array(windows, np.int64), np.array(projections), eyes)


@numba.njit(cache=True)
def inverse_depths(depth):  # type: ignore[no-untyped-def]
    """Return the inverse depths (H, W), 0 where there is none or a pixel lies far behind one of its eight neighbours."""
    height, width = depth.shape
    inverses = np.zeros((height, width))
    for v in range(height):
        for u in range(width):
            if depth[v, u] <= 0:
                continue
            nearest = depth[v, u]
            for j in range(max(v - 1, 0), min(v + 2, height)):
                for i in range(max(u - 1, 0), min(u + 2, width)):
                    if 0 < depth[j, i] < nearest:
                        nearest = depth[j, i]
            if depth[v, u] - nearest <= EDGE_JUMP_M:
                inverses[v, u] = 1.0 / depth[v, u]
    return inverses


def _window(
    corners_m: np.ndarray, K: np.ndarray, T_object_camera: np.ndarray, shape: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the first pixel (u, v) of the window that shows the corners (8, 3), and the first beyond it."""
    size = np.array(shape[::-1])
    seen = frames.apply(frames.inverse(T_object_camera), corners_m)
    if seen[:, 2].min() <= 0.01:
        return np.zeros(2, int), size
    pixels = seen[:, :2] / seen[:, 2:] * [K[0, 0], K[1, 1]] + K[:2, 2]
    low = np.clip(np.floor(pixels.min(axis=0)).astype(int) - _BORDER_PX, 0, size - 1)
    return low, np.clip(np.ceil(pixels.max(axis=0)).astype(int) + _BORDER_PX, low + 1, size)


@numba.njit(cache=True)
def _fit_all(inverses, K, T_object_camera, bounds, out):  # type: ignore[no-untyped-def]
    """Write the planes of a window's inverse depths (H, W) to `out` (H · W, 5)."""
    height, width = inverses.shape
    weights = _weights()
    for v in range(height):
        for u in range(width):
            if inverses[v, u] <= 0:
                continue
            z = 1.0 / inverses[v, u]
            x, y = (u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1]
            inverse, along, across = inverses[v, u], 0.0, 0.0
            if _within(x * z, y * z, z, T_object_camera, bounds):
                inverse, along, across, count = _plane_at(inverses, weights, v, u)
                if count < _LEAST_PIXELS:
                    continue
            # On a plane a·x + b·y + c = 1/z, where (x, y, 1) is the ray: its normal is (a, b, c).
            a, b = along * K[0, 0], across * K[1, 1]
            if a == 0.0 and b == 0.0:
                a, b = x * inverse / (x * x + y * y + 1), y * inverse / (x * x + y * y + 1)
            _store(a, b, inverse - a * x - b * y, inverse, x, y, T_object_camera, out[v * width + u])


@numba.njit(cache=True)
def _within(x, y, z, T, bounds):  # type: ignore[no-untyped-def]
    for i in range(3):
        p = T[i, 0] * x + T[i, 1] * y + T[i, 2] * z + T[i, 3]
        if p > bounds[1, i] or (p < bounds[0, i] and i < 2):
            return False
    return True


@numba.njit(cache=True)
def _weights():  # type: ignore[no-untyped-def]
    """Return how much neighbours (2 R + 1, 2 R + 1, 6) count, by their distance in pixels: w, w du, w dv, w du², w du dv, w dv²."""
    weights = np.zeros((2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1, 6))
    for dv in range(-RADIUS_PX, RADIUS_PX + 1):
        for du in range(-RADIUS_PX, RADIUS_PX + 1):
            w = np.exp(-0.5 * (du * du + dv * dv) / SIGMA_PX**2)
            into = weights[RADIUS_PX + dv, RADIUS_PX + du]
            into[0], into[1], into[2] = w, w * du, w * dv
            into[3], into[4], into[5] = w * du * du, w * du * dv, w * dv * dv
    return weights


@numba.njit(cache=True)
def _plane_at(inverses, weights, v, u):  # type: ignore[no-untyped-def]
    """Return inverse depth, its two slopes a pixel and the number of pixels: a small fit, then one gated by it."""
    inverse, along, across, count = _fit(inverses, weights, v, u, 1, 2 * GATE_M, inverses[v, u], 0.0, 0.0)
    if count < _LEAST_PIXELS:
        return inverse, along, across, count
    return _fit(inverses, weights, v, u, RADIUS_PX, GATE_M, inverse, along, across)


@numba.njit(cache=True)
def _fit(inverses, weights, v, u, radius, gate, inverse, along, across):  # type: ignore[no-untyped-def]
    """Fit inverse depth, in which planes are linear, to the pixels whose depth is within `gate` of the plane given."""
    height, width = inverses.shape
    w0, wu, wv, wuu, wuv, wvv, wq, wuq, wvq = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    count = 0
    for j in range(max(v - radius, 0), min(v + radius + 1, height)):
        for i in range(max(u - radius, 0), min(u + radius + 1, width)):
            du, dv, q = i - u, j - v, inverses[j, i]
            expected = inverse + along * du + across * dv
            # The depths are further apart than the gate, without a division.
            if q <= 0 or expected <= 0 or abs(expected - q) > gate * expected * q:
                continue
            w = weights[np.uint64(RADIUS_PX + dv), np.uint64(RADIUS_PX + du)]
            w0, wu, wv, wq = w0 + w[0], wu + w[1], wv + w[2], wq + w[0] * q
            wuu, wuv, wvv = wuu + w[3], wuv + w[4], wvv + w[5]
            wuq, wvq = wuq + w[1] * q, wvq + w[2] * q
            count += 1
    if count < _LEAST_PIXELS:
        return inverse, along, across, count
    mu, mv, mq = wu / w0, wv / w0, wq / w0
    uu, vv = wuu - w0 * mu * mu + _RIDGE_PX2, wvv - w0 * mv * mv + _RIDGE_PX2
    uv, uq, vq = wuv - w0 * mu * mv, wuq - w0 * mu * mq, wvq - w0 * mv * mq
    along = (uq * vv - vq * uv) / (uu * vv - uv * uv)
    across = (vq * uu - uq * uv) / (uu * vv - uv * uv)
    return mq - along * mu - across * mv, along, across, count


@numba.njit(cache=True)
def _store(a, b, c, inverse, x, y, T, out):  # type: ignore[no-untyped-def]
    """Write the plane with the normal -(a, b, c) in the camera's frame through the ray (x, y, 1) at depth 1/inverse."""
    length = np.sqrt(a * a + b * b + c * c)
    offset = 0.0
    for i in range(3):
        normal = -(T[i, 0] * a + T[i, 1] * b + T[i, 2] * c) / length
        out[i] = normal
        offset += normal * ((T[i, 0] * x + T[i, 1] * y + T[i, 2]) / inverse + T[i, 3])
    out[3] = offset
    out[4] = max((a * x + b * y + c) / length / np.sqrt(x * x + y * y + 1), 0.0)
