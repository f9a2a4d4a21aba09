"""The same pour by SPlisHSPlasH: DFSPH, boundary after Akinci et al. 2012, steps of 2 ms; `benchmarks/liquid.py` calls it.

Runs where `import pysplishsplash` is possible; docs/performance.md says how to install it. Every pour is a process of its
own: the engine keeps one simulation a process in globals. Lengths in metres; the lip is the origin and the tilt's axis is y.
"""

import ctypes
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from pipeline.errors import PipelineError
from pipeline.geometry.frames import rotation_about

STEP_S = 0.002
START = 1.05  # spacings; a start at the very spacing is too dense at the wall, and bursts
VISCOSITY_M2_S = 0.001  # the engine's own 0.01 is unstable at 2 ms and 10 mm
# Tolerance of the density in per cent, and whether the divergence is solved for; the first is the engine's own default.
SOLVERS = {"": (0.01, True), "_loose": (0.1, False)}
SLACK_M = 0.004  # so far beyond the cavity's surface a particle still counts as in the cup


@dataclass(frozen=True)
class Pour:
    """A cylindrical cup, how it is filled and how it is moved."""

    radius_m: float
    depth_m: float
    spacing_m: float
    particles: int
    tilt_rad: float
    settle_s: float
    tilt_s: float
    wait_s: float


def compare(
    ours: Callable[[], float], what: Pour, reference: dict[int, float], rounds: int
) -> dict[str, float]:
    """Return for each solver the median time of its pour (ms), in turns with ours, their ratio, and the root mean square
    difference of its share kept to the reference curve (degrees: share); nothing where it is not installed.
    """
    found: dict[str, float] = {}
    for name, solver in SOLVERS.items() if find_spec("pysplishsplash") else ():
        beside, theirs = np.median([(ours(), pour(what, solver)[0]) for _ in range(rounds)], axis=0)
        kept = [pour(replace(what, tilt_rad=np.radians(tilt)), solver)[1] for tilt in reference]
        found[f"ms_splishsplash_155{name}"] = float(theirs)
        found[f"ratio_splishsplash_155{name}"] = float(theirs / beside)
        off = np.array(kept) - list(reference.values())
        found[f"rmse_splishsplash_155{name}"] = float(np.sqrt(np.mean(off**2)))
    return found


def pour(what: Pour, solver: tuple[float, bool]) -> tuple[float, float]:
    """Return the milliseconds of the steps of one pour on one core, set-up excluded, and the share kept at its end."""
    with tempfile.TemporaryDirectory() as folder:
        order = json.dumps([asdict(what), *solver])
        child = subprocess.run(
            [sys.executable, __file__, folder, order],
            env={**os.environ, "OMP_NUM_THREADS": "1"},
            cwd=folder,
            capture_output=True,
            text=True,
        )
        result = Path(folder) / "result.json"
        if child.returncode or not result.is_file():
            said = (child.stderr.strip() or child.stdout.strip() or "nothing").splitlines()[-1]
            raise PipelineError(
                f"SPlisHSPlasH: expected the result of a pour, found exit code {child.returncode} ({said}); "
                "reinstall pySPlisHSPlasH, or remove it to measure without"
            )
        ms, kept = json.loads(result.read_text())
    return ms, kept


class Run:
    """One pour inside this process; SPlisHSPlasH calls `after_step` at the end of every step."""

    def __init__(self, sph: Any, what: Pour, solver: tuple[float, bool]) -> None:
        self.sph, self.what, self.solver = sph, what, solver
        self.steps = round((what.settle_s + what.tilt_s + what.wait_s) / STEP_S)
        self.done, self.spent_s, self.left_s = -1, 0.0, 0.0
        self.found: list[float] = []

    def after_step(self) -> None:
        """Count the time since the last call; put the cup to where the next step ends."""
        self.spent_s += time.perf_counter() - self.left_s
        self.done += 1
        simulation = self.sph.Simulation.getCurrent()
        fluid = simulation.getFluidModel(0)
        if self.done == 0:  # a step of particles that are nowhere yet
            self.spent_s = 0.0
            self._begin(simulation, fluid)
        if self.done == self.steps:
            self.found = [1e3 * self.spent_s, float(_inside(fluid, self.what).mean())]
        _move(simulation.getBoundaryModel(0).getRigidBodyObject(), self.what, (self.done + 1) * STEP_S)
        self.left_s = time.perf_counter()

    def _begin(self, simulation: Any, fluid: Any) -> None:
        dfsph, viscosity = simulation.getTimeStep(), fluid.getViscosityBase()
        dfsph.setValueFloat(dfsph.MAX_ERROR, self.solver[0])
        dfsph.setValueBool(dfsph.USE_DIVERGENCE_SOLVER, self.solver[1])
        viscosity.setValueFloat(viscosity.VISCOSITY_COEFFICIENT, VISCOSITY_M2_S)
        for i, at in enumerate(_lattice(self.what, fluid.numActiveParticles())):
            fluid.setPosition(i, at)
            fluid.setVelocity(i, np.zeros(3))


def _inside(fluid: Any, what: Pour) -> np.ndarray:
    at = np.array([fluid.getPosition(i) for i in range(fluid.numActiveParticles())])
    x, y, z = (at @ rotation_about(np.array([0.0, 1.0, 0.0]), what.tilt_rad)).T
    beside = np.hypot(x + what.radius_m, y) - what.radius_m
    return (z < 0.0) & (z > -what.depth_m - SLACK_M) & (beside < SLACK_M)


def _move(body: Any, what: Pour, at_s: float) -> None:
    """Turn the cup to where it is at a time, so that its velocity there is known as well."""
    u = np.clip((at_s - what.settle_s) / what.tilt_s, 0.0, 1.0)
    tilt_rad = what.tilt_rad * u * u * (3.0 - 2.0 * u)
    body.setRotation([0.0, np.sin(tilt_rad / 2), 0.0, np.cos(tilt_rad / 2)])
    body.setAngularVelocity([0.0, what.tilt_rad * 6.0 * u * (1.0 - u) / what.tilt_s, 0.0])


def _lattice(what: Pour, n: int) -> np.ndarray:
    """Return n points (n, 3) in rings about the cup's axis, layer by layer from the floor."""
    spacing = START * what.spacing_m
    layer = []
    for radius in np.arange(what.radius_m - what.spacing_m / 2, 0.0, -spacing):
        turn = np.linspace(0.0, 2.0 * np.pi, max(1, int(2.0 * np.pi * radius / spacing)), endpoint=False)
        layer.append(np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1))
    points = np.concatenate(layer)
    z = np.repeat(np.arange(-(-n // len(points))), len(points))[:n] * spacing + what.spacing_m / 2
    return np.column_stack([np.resize(points, (len(z), 2)), z]) - [what.radius_m, 0.0, what.depth_m]


def _scene(folder: Path, what: Pour, steps: int) -> Path:
    """Write the scene; the boundary is sampled one particle radius outside the cavity, or it leaks and holds too little."""
    radius = what.spacing_m / 2
    profile = [(0.0, -radius), (what.radius_m + radius, -radius), (what.radius_m + radius, what.depth_m)]
    cup = trimesh.creation.revolve(np.array(profile), sections=96)
    cup.apply_translation([-what.radius_m, 0.0, -what.depth_m])
    cup.export(folder / "cup.obj")
    fours = -(-what.particles // 4)  # a block of 2 × 2 × fours, far away; `_lattice` puts it in the cup
    block = {"denseMode": 0, "start": [5.0, 0.0, 0.0]}
    block["end"] = [5.0 + (fours + 1) * what.spacing_m, 3 * what.spacing_m, 3 * what.spacing_m]
    configuration = {
        "particleRadius": radius,
        "gravitation": [0.0, 0.0, -9.81],
        "simulationMethod": 4,  # DFSPH
        "boundaryHandlingMethod": 0,  # Akinci 2012
        "timeStepSize": STEP_S,
        "cflMethod": 0,  # the step stays
        "enableZSort": False,
        "stopAt": (steps + 5) * STEP_S,
    }
    body = {"geometryFile": "cup.obj", "isAnimated": True, "samplingMode": 0}
    material = {"id": "Fluid", "density0": 1000.0, "viscosityMethod": 1}
    scene = {"Configuration": configuration, "Materials": [material], "RigidBodies": [body]}
    (folder / "scene.json").write_text(json.dumps(scene | {"FluidBlocks": [{"id": "Fluid", **block}]}))
    return folder / "scene.json"


def _engine() -> Any:
    spec = find_spec("pysplishsplash")
    # The wheel's own libGLdispatch has to be there before the module, or the import ends in a segmentation fault.
    for library in (Path(spec.origin).parent / "pysplishsplash.libs").glob("libGLdispatch-*"):
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    import pysplishsplash

    return pysplishsplash


def main() -> None:
    """Run one pour, and write its time and the share kept into the folder given."""
    folder, (what, *solver) = Path(sys.argv[1]), json.loads(sys.argv[2])
    sph, what = _engine(), Pour(**what)
    run, base = Run(sph, what, tuple(solver)), sph.Exec.SimulatorBase()
    scene = _scene(folder, what, run.steps)
    base.init(sceneFile=str(scene), useCache=False, outputDir=str(folder), initialPause=False, useGui=False)
    base.initSimulation()
    base.setTimeStepCB(run.after_step)
    base.runSimulation()
    base.cleanup()
    (folder / "result.json").write_text(json.dumps(run.found))


if __name__ == "__main__":
    main()
