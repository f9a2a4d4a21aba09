"""A virtual depth camera like the Kinect: rays into a scene, with the sensor's steps, noise and lost pixels."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from pipeline.geometry import frames
from pipeline.scan.lofts import Mesh

WIDTH, HEIGHT = 640, 480
# Kinect v1: focal length and baseline, disparity steps of 1/8 px (Khoshelham & Elberink 2012, sections 2 and 3.2).
FOCAL_PX = 575.0
BASELINE_M = 0.075
DISPARITY_STEP_PX = 0.125
# Lateral noise, of edges (Nguyen, Izadi & Lovell 2012, equation 1, its constant part).
LATERAL_PX = 0.8
GRAZING_RAD = np.deg2rad(78.0)  # beyond, the projected pattern is too stretched to be matched
EDGE_JUMP_M = 0.008
EDGE_LOSS = 0.5

# Elevation of each ring of views and its share of the views. Inner floors and deep inner walls need the steep ones.
RINGS_DEG = ((12.0, 0.20), (32.0, 0.20), (50.0, 0.20), (66.0, 0.28), (80.0, 0.12))
LEAST_VIEWS = 10


@dataclass(frozen=True)
class Noise:
    """The sensor's noise, times `scale`; 0 leaves the steps of disparity and of the millimetre alone."""

    scale: float

    def axial_m(self, depth_m: np.ndarray, incidence_rad: np.ndarray) -> np.ndarray:
        """The standard deviation along the ray (Nguyen, Izadi & Lovell 2012, equations 2 and 3)."""
        oblique = np.clip(incidence_rad, 0, GRAZING_RAD)
        extra = 0.0001 / np.sqrt(depth_m) * (oblique / (np.pi / 2 - oblique)) ** 2
        return self.scale * (0.0012 + 0.0019 * (depth_m - 0.4) ** 2 + np.where(oblique > np.pi / 3, extra, 0))


def intrinsics() -> np.ndarray:
    """Return the camera's matrix (3, 3)."""
    return np.array([[FOCAL_PX, 0, (WIDTH - 1) / 2], [0, FOCAL_PX, (HEIGHT - 1) / 2], [0, 0, 1.0]])


def turntable(n: int, target_world: np.ndarray, distance_m: float) -> list[np.ndarray]:
    """Return n poses T_world_camera (4, 4) on rings around the target (3,), from the lowest ring to the highest."""
    shares = np.cumsum([0.0, *(share for _, share in RINGS_DEG)])
    bounds = np.round(n * shares / shares[-1]).astype(int)
    poses = []
    for ring, (elevation_deg, _) in enumerate(RINGS_DEG):
        count = bounds[ring + 1] - bounds[ring]
        elevation = np.deg2rad(elevation_deg)
        for k in range(count):
            azimuth = 2 * np.pi * (k + ring / len(RINGS_DEG)) / count
            level = np.cos(elevation)
            direction = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
            poses.append(frames.look_at(target_world + distance_m * direction, target_world))
    return poses


class Scene:
    """Meshes in the world that rays can hit."""

    def __init__(self, meshes_world: list[Mesh]) -> None:
        from pipeline.geometry.open3d_core import open3d as o3d

        self._scene = o3d.t.geometry.RaycastingScene()
        for vertices, triangles in meshes_world:
            arrays = vertices.astype(np.float32), triangles.astype(np.uint32)
            self._scene.add_triangles(*(o3d.core.Tensor.from_numpy(array) for array in arrays))

    def cast(self, T_world_camera: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return depth (H, W) in metres (inf where nothing is hit) and the angle of incidence (H, W) of every pixel."""
        from pipeline.geometry.open3d_core import open3d as o3d

        rays_camera, length = _rays()
        rays = np.empty((HEIGHT, WIDTH, 6), np.float32)
        rays[..., :3], rays[..., 3:] = T_world_camera[:3, 3], frames.rotate(T_world_camera, rays_camera)
        hits = self._scene.cast_rays(o3d.core.Tensor.from_numpy(rays))
        normals = hits["primitive_normals"].numpy()
        cosine = np.abs(np.einsum("hwi,hwi->hw", normals, rays[..., 3:])) / length
        return hits["t_hit"].numpy().astype(float), np.arccos(np.clip(cosine, 0, 1))


@cache
def _rays() -> tuple[np.ndarray, np.ndarray]:
    """Return the ray through each pixel (H, W, 3), camera frame, of depth 1, and its length (H, W)."""
    v, u = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    K = intrinsics()
    rays = np.stack([(u - K[0, 2]) / FOCAL_PX, (v - K[1, 2]) / FOCAL_PX, np.ones_like(u)], axis=-1)
    return rays, np.linalg.norm(rays, axis=-1)


def depth_image(
    scene: Scene, T_world_camera: np.ndarray, noise: Noise, rng: np.random.Generator
) -> np.ndarray:
    """Return one depth image (H, W) in whole millimetres, uint16, 0 where the sensor has no answer."""
    depth, incidence = scene.cast(T_world_camera)
    edge = _at_edge(np.where(np.isfinite(depth), depth, 10.0))
    place = _displaced(edge, LATERAL_PX * noise.scale, rng)
    depth[edge], incidence[edge] = depth[place], incidence[place]
    lost = ~np.isfinite(depth) | (incidence > GRAZING_RAD) | (edge & (rng.random(depth.shape) < EDGE_LOSS))
    depth = np.where(lost, 1.0, depth)
    measured = depth + noise.axial_m(depth, incidence) * rng.standard_normal(depth.shape)
    disparity = DISPARITY_STEP_PX * np.round(FOCAL_PX * BASELINE_M / measured / DISPARITY_STEP_PX)
    millimetres = np.round(1000 * FOCAL_PX * BASELINE_M / disparity)
    return np.where(lost, 0, millimetres).astype(np.uint16)


def _displaced(edge: np.ndarray, sigma_px: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels (v, u), N each, that the N pixels near edges (H, W) show instead: those a random step away."""
    shift = np.round(sigma_px * rng.standard_normal((2, *edge.shape))[:, edge]).astype(int)
    v, u = np.nonzero(edge) + shift
    return np.clip(v, 0, HEIGHT - 1), np.clip(u, 0, WIDTH - 1)


def _at_edge(depth_m: np.ndarray) -> np.ndarray:
    """Return where (H, W) a pixel's 3×3 neighbourhood spans a jump in depth."""
    from scipy.ndimage import maximum_filter, minimum_filter

    return maximum_filter(depth_m, 3) - minimum_filter(depth_m, 3) > EDGE_JUMP_M
