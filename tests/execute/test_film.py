"""Films where the arm could follow nothing: a picture that says so, and no error."""

import subprocess
import sys

import numpy as np
import pandas as pd
from PIL import Image

from pipeline.artefacts import TABLES, read_arrays, write_film, write_table


def test_no_execution_is_a_picture_that_says_so(tmp_path):
    columns = TABLES["trajectories"].names
    write_table(tmp_path / "trajectories.parquet", pd.DataFrame(columns=columns), "trajectories")
    pair = ["--held", "cup=cup.npz", "--target", "bowl=bowl.npz", "--trajectories", "trajectories.parquet"]
    for module, words in (
        ("simulate.filmed", ["--film", "balls.npz"]),
        ("execute.film", ["--balls-film", "balls.npz", "--film", "film.npz", "--gif", "film.gif"]),
    ):
        call = [sys.executable, "-m", f"pipeline.{module}", *pair, "--features", "standard", *words]
        subprocess.run(call, cwd=tmp_path, check=True)
    film = read_arrays(tmp_path / "film.npz")
    assert len(film["images"]) == 1
    assert 0 < (film["images"] < 128).sum() < 5000  # a line of text on white
    assert film["draw"] == -1
    with Image.open(tmp_path / "film.gif") as shown:
        assert shown.n_frames == 1


def test_a_film_has_its_frames_and_their_time(tmp_path):
    pictures = list(np.random.default_rng(1).integers(0, 256, (5, 8, 12, 3), np.uint8))
    write_film(tmp_path / "film.gif", pictures, 0.1)
    with Image.open(tmp_path / "film.gif") as shown:
        assert (shown.n_frames, shown.size, shown.info["duration"]) == (5, (12, 8), 100)
