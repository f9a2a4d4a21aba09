"""One view of a recording, before its image is read."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

COLOURS = (".png", ".jpg", ".jpeg")


@dataclass(frozen=True)
class Frame:
    """A depth image, its camera K (3, 3) read from `where_K`, depth units per metre, T_world_camera (4, 4) and a colour
    image, where there are any."""

    depth: Path
    K: np.ndarray
    where_K: str
    depth_scale: float
    T_world_camera: np.ndarray | None = None
    colour: Path | None = None


def colour(folder: Path, stem: str) -> Path | None:
    """Return the colour image `stem`, whatever its format, if there is one."""
    ends = [end for lower in COLOURS for end in (lower, lower.upper())]
    return next((folder / f"{stem}{end}" for end in ends if (folder / f"{stem}{end}").is_file()), None)
