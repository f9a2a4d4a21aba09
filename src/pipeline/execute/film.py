"""Film an execution with Bullet's own renderer: the arm along what it did, the containers, the balls."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pybullet

from pipeline import artefacts, command
from pipeline.execute import containers, kinematics
from pipeline.execute.cell import Cell, Solid, T_cup_flange
from pipeline.execute.following import PLAN_S
from pipeline.execute.task import TILT_AXIS
from pipeline.geometry import bodies
from pipeline.geometry.frames import inverse, transform

if TYPE_CHECKING:
    import pandas as pd

SIZE = (480, 360)
_EYE_M, _AT_M, _FIELD_DEG = [0.60, 0.50, 0.42], [-0.09, -0.02, 0.11], 29.0
_LIGHT = [0.6, 0.5, 1.6]
# Okabe and Ito's colours, which colour-blind people can tell apart.
_HELD, _SECOND, _BALL = (0.90, 0.62, 0.0, 0.45), (0.0, 0.45, 0.70, 0.55), (0.0, 0.62, 0.45, 1.0)
_TABLE, _HAND = (0.82, 0.80, 0.77, 1.0), (0.25, 0.25, 0.25, 1.0)
_HIDDEN_M = [0.0, 0.0, -5.0]


class Studio:
    """A robot's cell that is looked at: what it is made of has colours, and balls can be put where they were."""

    def __init__(self, cell: Cell, held: Solid, second: Solid, balls: int, radius_m: float) -> None:
        self._cell, self._client = cell, cell.client
        for body, colour in ((cell.table, _TABLE), (cell.hand, _HAND)):
            pybullet.changeVisualShape(body, -1, rgbaColor=colour, physicsClientId=self._client)
        for body in (cell.held, cell.second):
            pybullet.changeVisualShape(body, -1, rgbaColor=(0, 0, 0, 0), physicsClientId=self._client)
        self.cup, self.bowl = self._skin(held, _HELD), self._skin(second, _SECOND)
        ball = pybullet.createVisualShape(
            pybullet.GEOM_SPHERE, radius=radius_m, rgbaColor=_BALL, physicsClientId=self._client
        )
        self.balls = [self._visual(ball) for _ in range(balls)]

    def _skin(self, solid: Solid, colour: tuple[float, ...]) -> int:
        vertices, triangles = solid.coarse
        shape = pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            vertices=vertices.tolist(),
            indices=np.concatenate([triangles, triangles[:, ::-1]]).ravel().tolist(),
            rgbaColor=colour,
            physicsClientId=self._client,
        )
        return self._visual(shape)

    def _visual(self, shape: int) -> int:
        return pybullet.createMultiBody(0.0, -1, shape, _HIDDEN_M, physicsClientId=self._client)

    def image(self, T_world_second: np.ndarray, balls_m: np.ndarray) -> np.ndarray:
        """Return a picture (H, W, 3) of the arm where it is, with balls (n, 3) in the world."""
        self._cell.follow_flange()
        bodies.place(self.cup, self._cell.T_world_cup(), self._client)
        bodies.place(self.bowl, T_world_second, self._client)
        hidden = np.tile(_HIDDEN_M, (len(self.balls) - len(balls_m), 1))
        for ball, at in zip(self.balls, np.concatenate([balls_m, hidden]), strict=True):
            bodies.place(ball, transform(np.eye(3), at), self._client)
        view = pybullet.computeViewMatrix(_EYE_M, _AT_M, [0.0, 0.0, 1.0])
        lens = pybullet.computeProjectionMatrixFOV(_FIELD_DEG, SIZE[0] / SIZE[1], 0.05, 4.0)
        picture = pybullet.getCameraImage(
            *SIZE,
            view,
            lens,
            lightDirection=_LIGHT,
            shadow=1,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        return np.reshape(picture[2], (SIZE[1], SIZE[0], 4))[:, :, :3].astype(np.uint8)


def main() -> None:
    """Write all frames of one execution."""
    parser = command.parser(__doc__)
    for role in ("--held", "--target"):
        parser.add_argument(role, type=command.name_and_path, required=True, metavar="NAME=FILE")
    parser.add_argument("--trajectories", type=Path, required=True, help="what the arm did")
    parser.add_argument("--features", default="label_mapping", help="whose motor primitive")
    parser.add_argument("--balls-film", type=Path, required=True, help="where the balls are in each frame")
    parser.add_argument("--film", type=Path, required=True, help="where the frames are written (NPZ)")
    parser.add_argument("--gif", type=Path, required=True, help="where they are written to be looked at")
    options = parser.parse_args()

    table = artefacts.read_table(options.trajectories, "trajectories")
    film = artefacts.read_arrays(options.balls_film)
    run = table[(table["features"] == options.features) & (table["draw"] == int(film["draw"]))]
    images = _pictures(options, run, film) if len(run) else [_nothing()]
    same = {name: film[name] for name in ("every_s", "draw")}
    artefacts.write_arrays(options.film, {"images": np.array(images), **same})
    artefacts.write_film(options.gif, images, float(film["every_s"]))


def _pictures(options: argparse.Namespace, run: "pd.DataFrame", film: artefacts.Arrays) -> list[np.ndarray]:
    balls = np.split(film["balls_m"], np.cumsum(film["counts"])[:-1])
    T_world_held, T_world_second = artefacts.poses(run), artefacts.T_world_second(run)
    # The arm turns the cup about one axis that is fixed in it: along the world's y.
    axis = T_world_held[0, :3, :3].T @ TILT_AXIS
    yaw_rad = float(np.arctan2(-axis[0], axis[1]))
    cup, second = (containers.solid(*each) for each in (options.held, options.target))
    images = []
    with Cell(cup, second, T_world_second, T_cup_flange(cup, yaw_rad)) as cell:
        q, _ = kinematics.path(cell, T_world_held @ inverse(cell.T_flange_cup))
        studio = Studio(cell, cup, second, int(film["counts"].max()), float(film["radius_m"]))
        filming = f"filming {options.held[0]} into {options.target[0]}"
        for number, there in enumerate(command.progress(balls, len(balls), filming)):
            cell.pose_arm(q[min(round(number * float(film["every_s"]) / PLAN_S), len(q) - 1)])
            images.append(studio.image(T_world_second, there))
    return images


def _nothing() -> np.ndarray:
    """Return a picture that says why there is none."""
    from PIL import Image, ImageDraw

    blank = Image.new("RGB", SIZE, "white")
    ImageDraw.Draw(blank).text(
        (SIZE[0] // 2, SIZE[1] // 2), "the arm could follow no sample", "black", anchor="mm"
    )
    return np.asarray(blank)


if __name__ == "__main__":
    command.run(main)
