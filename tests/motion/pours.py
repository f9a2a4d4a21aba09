"""Pours of known shape, as files that a user could have recorded."""

from pathlib import Path

import numpy as np

PAIR = "held_object: tall_cup\ntarget_object: wide_bowl\n"


def pour(
    seed: int, length_s: float = 5.0, rate_hz: float = 50.0, spread: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return times (T,) and lip x, y, z, tilt (T, 4) of one pour; metres and radians."""
    rng = np.random.default_rng([11, seed])
    t = np.arange(round(length_s * rate_hz) + 1) / rate_hz
    phase = t / t[-1]
    way = _step(phase, 0.0, 0.35)
    back = _step(phase, 0.75, 1.0)
    start, above, end = spread * 0.01 * rng.standard_normal((3, 3)) + np.array(
        [[-0.24, 0.0, 0.15], [-0.04, 0.0, 0.06], [-0.2, 0.0, 0.16]]
    )
    most = 2.0 + spread * 0.05 * rng.standard_normal()
    lip = start + way[:, None] * (above - start) + back[:, None] * (end - above)
    return t, np.column_stack([lip, most * (_step(phase, 0.3, 0.6) - 0.6 * back)])


def write(folder: Path, pours: list[tuple[np.ndarray, np.ndarray]], pair: str = PAIR) -> Path:
    """Write a folder of demonstrations and return it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "pair.yaml").write_text(pair)
    for number, (t, values) in enumerate(pours):
        write_csv(folder / f"pour_{number:02d}.csv", t, values)
    return folder


def write_csv(path: Path, t: np.ndarray, values: np.ndarray) -> None:
    """Write one pour, of lips (T, 4) or poses (T, 7)."""
    lips, poses = "t_s,lip_x_m,lip_y_m,lip_z_m,tilt_rad", "t_s,x_m,y_m,z_m,qx,qy,qz,qw"
    header = lips if values.shape[1] == 4 else poses
    np.savetxt(path, np.column_stack([t, values]), "%.6f", ",", header=header, comments="")


def _step(phase: np.ndarray, begin: float, end: float) -> np.ndarray:
    u = np.clip((phase - begin) / (end - begin), 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
