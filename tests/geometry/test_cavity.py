import itertools

import numpy as np
import pytest
import trimesh

from pipeline.errors import PipelineError
from pipeline.geometry.cavity import Cavity, cavity, lip_alone, lip_towards, pour_axis, retained_volume_m3
from pipeline.geometry.frames import rotation_about, transform
from pipeline.scan.shapes import shape

RADIUS_M, DEPTH_M = 0.037, 0.097
CYLINDER_M3 = np.pi * RADIUS_M**2 * DEPTH_M


def revolved(inner_m: list[tuple[float, float]], wall_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a vessel of revolution: the inside's profile (r, z) above its floor, from the axis out and up."""
    inside = [(r, z + wall_m) for r, z in inner_m]
    (r_low, _), (r_high, z_high) = inside[1], inside[-1]
    profile = [(0.0, 0.0), (r_low + wall_m, 0.0), (r_high + wall_m, z_high), *reversed(inside)]
    mesh = trimesh.creation.revolve(np.array(profile), sections=128)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def cylinder(wall_m: float = 0.003) -> tuple[np.ndarray, np.ndarray]:
    return revolved([(0.0, 0.0), (RADIUS_M, 0.0), (RADIUS_M, DEPTH_M)], wall_m)


@pytest.fixture(scope="module")
def cup() -> Cavity:
    return cavity(*cylinder(), name="cup")


@pytest.mark.parametrize("wall_m", [0.0015, 0.003, 0.005])
def test_a_cylinders_capacity_and_rim_are_known_whatever_its_wall(wall_m: float) -> None:
    found = cavity(*cylinder(wall_m), name="cup")
    assert found.capacity_m3 == pytest.approx(CYLINDER_M3, rel=0.01)
    assert np.hypot(*found.rim_m[:, :2].T) == pytest.approx(RADIUS_M, abs=0.0005)
    assert found.rim_m[:, 2] == pytest.approx(DEPTH_M + wall_m, abs=0.0003)
    assert found.opening_m == pytest.approx([0, 0, DEPTH_M + wall_m], abs=0.0005)


def test_a_cones_capacity_is_known() -> None:
    low, high, depth = 0.02, 0.045, 0.08
    found = cavity(*revolved([(0.0, 0.0), (low, 0.0), (high, depth)], 0.003), name="cone")
    truth = np.pi * depth * (low**2 + low * high + high**2) / 3
    assert found.capacity_m3 == pytest.approx(truth, rel=0.015)


@pytest.mark.parametrize("name", ["jug", "square_bowl", "espresso_cup"])
def test_capacity_of_demonstration_objects(name: str) -> None:
    truth = shape(name)
    found = cavity(truth.vertices_m, truth.triangles, name=name)
    assert found.capacity_m3 == pytest.approx(truth.capacity_m3, rel=0.015)
    assert found.rim_m[:, 2].min() == pytest.approx(truth.lip_edge_m[:, 2].min(), abs=0.0005)


def test_pinholes_do_not_drain_a_cup() -> None:
    from trimesh.remesh import subdivide_to_size

    vertices, triangles = subdivide_to_size(*cylinder(), 0.002)
    keep = np.random.default_rng(0).uniform(size=len(triangles)) > 0.02
    found = cavity(vertices, triangles[keep], name="cup")
    assert found.capacity_m3 == pytest.approx(CYLINDER_M3, rel=0.01)


def test_a_handle_above_the_rim_is_no_rim(cup: Cavity) -> None:
    bar = trimesh.creation.box((0.008, 0.012, 0.12), transform(np.eye(3), np.array([-0.06, 0.0, 0.08])))
    vertices, triangles = cylinder()
    both = np.vstack([vertices, bar.vertices]), np.vstack([triangles, bar.faces + len(vertices)])
    found = cavity(*both, name="cup")
    assert found.capacity_m3 == pytest.approx(cup.capacity_m3, rel=0.005)
    assert found.rim_m[:, 2].max() < 0.101


@pytest.mark.parametrize("tube_m", [0.085, 0.1])
def test_the_rim_of_a_cake_tin_is_not_its_tubes(tube_m: float) -> None:
    """Looked for from the middle, it was the tube's: 15 mm from the axis; a tall tube was told to be a hole in the wall."""
    tin = [
        (0.018, 0),
        (0.095, 0),
        (0.105, 0.08),
        (0.102, 0.08),
        (0.092, 0.003),
        (0.021, 0.003),
        (0.021, tube_m),
        (0.018, tube_m),
    ]
    mesh = trimesh.creation.revolve(np.array([*tin, tin[0]]), sections=128)
    found = cavity(np.asarray(mesh.vertices), np.asarray(mesh.faces), name="tin")
    truth = np.pi * 0.077 * ((0.092**2 + 0.092 * 0.102 + 0.102**2) / 3 - 0.021**2)
    assert found.capacity_m3 == pytest.approx(truth, rel=0.01)
    assert np.hypot(*found.rim_m[:, :2].T) == pytest.approx(0.102, abs=0.001)
    assert found.rim_m[:, 2] == pytest.approx(0.08, abs=0.0005)


@pytest.mark.parametrize(("lower_m", "chip_m"), [(0.003, 0.0), (0.006, 0.0), (0.0, 0.0), (0.0, 0.005)])
def test_a_divided_dish_holds_what_its_compartments_hold(lower_m: float, chip_m: float) -> None:
    """The rim was the divider's, and what one compartment holds the capacity; with a chip in the other's edge, too."""
    size, wall, high = np.array([0.16, 0.12]), 0.003, 0.05
    outer, inner = (trimesh.creation.box([*xy, high]) for xy in (size, size - 2 * wall))
    inner.apply_translation([0, 0, wall])
    divider = trimesh.creation.box(
        [wall, size[1], high - lower_m], transform(np.eye(3), np.array([0, 0, -lower_m / 2]))
    )
    dish = trimesh.boolean.union([outer.difference(inner), divider])
    if chip_m:
        chip = trimesh.creation.box([0.02, 0.02, 2 * chip_m])
        dish = dish.difference(chip.apply_translation([size[0] / 2, 0, high / 2]))
    dish.apply_translation([0, 0, high / 2])
    found = cavity(np.asarray(dish.vertices), np.asarray(dish.faces), name="dish")
    divided = wall * (size[1] - 2 * wall) * (high - max(lower_m, chip_m) - wall)
    truth = np.prod(size - 2 * wall) * (high - chip_m - wall) - divided
    assert found.capacity_m3 == pytest.approx(truth, rel=0.02)
    assert np.abs(found.rim_m[:, 0]).max() == pytest.approx(size[0] / 2 - wall, abs=0.003)


def test_all_cups_of_a_muffin_tin_count() -> None:
    """One of them did."""
    radius, depth = 0.03, 0.03
    tin = trimesh.creation.box(bounds=[[-0.12, -0.08, 0], [0.12, 0.08, 0.035]])
    for x, y in itertools.product((-0.075, 0.0, 0.075), (-0.037, 0.037)):
        cup = trimesh.creation.cylinder(radius, 0.04, sections=96)
        tin = tin.difference(cup.apply_translation([x, y, 0.025]))
    found = cavity(np.asarray(tin.vertices), np.asarray(tin.faces), name="tin")
    assert found.capacity_m3 == pytest.approx(6 * np.pi * radius**2 * depth, rel=0.01)
    assert found.opening_m == pytest.approx([0, 0, 0.035], abs=0.002)


def test_a_handle_over_the_opening_is_no_rim(cup: Cavity) -> None:
    """A bucket's: the rim went up it to the middle, and the wall was told to have a gap."""
    upright = transform(rotation_about(np.array([1.0, 0.0, 0.0]), np.pi / 2), np.zeros(3))
    bail = trimesh.creation.torus(RADIUS_M + 0.0015, 0.004, transform=upright)
    bail.apply_translation([0, 0, 0.1])
    both = trimesh.boolean.union([trimesh.Trimesh(*cylinder()), bail])
    inner = trimesh.creation.cylinder(
        RADIUS_M, DEPTH_M, transform=transform(np.eye(3), np.array([0, 0, 0.003 + DEPTH_M / 2]))
    )
    both = both.difference(inner)
    found = cavity(np.asarray(both.vertices), np.asarray(both.faces), name="bucket")
    assert found.capacity_m3 == pytest.approx(cup.capacity_m3, rel=0.01)
    assert found.rim_m[:, 2].max() < 0.102


def test_a_slit_is_bridged_and_an_opening_like_an_l_is_refused() -> None:
    """Rays through the slit met nothing, and the rim's middle went out of the grid."""
    radius, depth = 0.04, 0.057
    tube = [(0, 0), (radius + 0.003, 0), (radius + 0.003, 0.06), (radius, 0.06), (radius, 0.003), (0, 0.003)]
    slit = trimesh.creation.box([0.02, 0.02, 0.03], transform(np.eye(3), np.array([radius, 0.0, 0.06])))
    mesh = trimesh.creation.revolve(np.array(tube), sections=96).difference(slit)
    found = cavity(np.asarray(mesh.vertices), np.asarray(mesh.faces), name="slit")
    assert found.capacity_m3 == pytest.approx(np.pi * radius**2 * (depth - 0.015), rel=0.01)

    def bar(long: int, size: tuple[float, float], low: float, wall: float) -> trimesh.Trimesh:
        extents = np.array([size[1], size[1], 0.04 - low])
        extents[long] = size[0]
        at = extents / 2 + [wall, wall, low]
        return trimesh.creation.box(extents, transform(np.eye(3), at))

    outside, inside = (
        bar(0, size, low, wall).union(bar(1, size, low, wall))
        for size, low, wall in (((0.2, 0.05), 0.0, 0.0), ((0.194, 0.044), 0.003, 0.003))
    )
    dish = outside.difference(inside)
    with pytest.raises(PipelineError, match="expected a wall all round the opening, as seen from its middle"):
        cavity(np.asarray(dish.vertices), np.asarray(dish.faces), name="dish")


def test_the_wall_is_one_sided(cup: Cavity) -> None:
    x, z = 0.037 + 0.010, 0.05  # beyond a wall of 3 mm, outside the cup
    index = tuple(np.rint((np.array([x, 0.0, z]) - cup.origin_m) / cup.cell_m).astype(int))
    assert cup.distance_m[index] == pytest.approx(-0.010, abs=0.003)
    middle = tuple(np.rint((np.array([0.02, 0.0, z]) - cup.origin_m) / cup.cell_m).astype(int))
    assert cup.distance_m[middle] == pytest.approx(0.017, abs=0.002)
    assert cup.interior[middle]
    assert not cup.interior[index]


def _block() -> trimesh.Trimesh:
    return trimesh.creation.box((0.08, 0.08, 0.08), transform(np.eye(3), np.array([0.0, 0.0, 0.04])))


def _plate() -> trimesh.Trimesh:
    return trimesh.creation.cylinder(0.1, 0.006, transform=transform(np.eye(3), np.array([0.0, 0.0, 0.003])))


def _drained() -> trimesh.Trimesh:
    hole, wall, top = 0.006, 0.003, 0.1
    profile = [(hole, 0), (0.04, 0), (0.04, top), (0.037, top), (0.037, wall), (hole, wall), (hole, 0)]
    return trimesh.creation.revolve(np.array(profile), sections=96)


@pytest.mark.parametrize(
    "mesh", [_block(), _plate(), _drained()], ids=["block", "plate", "hole in the floor"]
)
def test_what_holds_no_liquid_is_refused_by_name(mesh: trimesh.Trimesh) -> None:
    with pytest.raises(PipelineError, match=r"my_thing: .*expected an object that holds liquid.*found room"):
        cavity(np.asarray(mesh.vertices), np.asarray(mesh.faces), name="my_thing")


def test_a_mesh_without_faces_is_refused_by_name() -> None:
    with pytest.raises(PipelineError, match=r"my_thing: expected a mesh with faces"):
        cavity(np.zeros((3, 3)), np.zeros((0, 3), int), name="my_thing")


def test_lips(cup: Cavity) -> None:
    assert lip_alone(cup) == pytest.approx([RADIUS_M, 0, 0.1], abs=0.001)  # a level rim: furthest along +x
    T_world_held = transform(rotation_about(np.array([0.0, 0.0, 1.0]), np.pi / 2), np.array([0.3, 0.0, 0.2]))
    # The world's +x is the cup's -y after a quarter turn.
    assert lip_towards(cup, T_world_held, np.array([1.0, 0.0, 0.3])) == pytest.approx(
        [0, -RADIUS_M, 0.1], abs=0.001
    )


@pytest.mark.parametrize("yaw_rad", [0.0, 1.5, 2.6, -2.0])
def test_the_lip_of_a_jug_is_the_middle_of_its_spout_however_it_is_turned(yaw_rad: float) -> None:
    jug, R = shape("jug"), rotation_about(np.array([0.0, 0.0, 1.0]), yaw_rad)
    lip = R.T @ lip_alone(cavity(jug.vertices_m @ R.T, jug.triangles, name="jug"))
    assert np.arctan2(lip[1], lip[0]) == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("azimuth", [0.0, 1.0, 3.0, -2.0])
def test_the_pour_axis_tilts_the_lip_down(azimuth: float) -> None:
    opening, lip = np.array([0.01, 0.02, 0.1]), np.array([np.cos(azimuth), np.sin(azimuth), 3.0])
    axis = pour_axis(opening, lip)
    before = np.array([*(lip - opening)[:2], 0.0])
    after = rotation_about(axis, 0.1) @ before
    assert after[2] == pytest.approx(-np.sin(0.1) * np.linalg.norm(before))
    assert axis[2] == 0.0


def test_what_a_tilted_cylinder_keeps(cup: Cavity) -> None:
    lip = lip_alone(cup)
    axis = pour_axis(cup.opening_m, lip)
    tilts = np.radians([0.0, 10.0, 30.0, 45.0])
    truth = np.pi * RADIUS_M**2 * (DEPTH_M - RADIUS_M * np.tan(tilts))  # the base stays covered
    assert retained_volume_m3(cup, lip, axis, tilts) == pytest.approx(truth, rel=0.01)
    assert float(retained_volume_m3(cup, lip, axis, 0.0)) == pytest.approx(cup.capacity_m3, rel=0.005)
    assert float(retained_volume_m3(cup, lip, axis, np.pi * 2 / 3)) < 0.01 * cup.capacity_m3
    assert np.all(np.diff(retained_volume_m3(cup, lip, axis, np.linspace(0, 2, 50))) <= 0)


@pytest.mark.parametrize(("floor_m", "height_m"), [(0.088, 0.09), (0.003, 0.005)])
def test_a_tray_whose_room_is_level_with_its_rim_is_refused(floor_m, height_m):
    rim = [(0.06, 0), (0.06, height_m), (0.057, height_m), (0.057, floor_m)]
    tray = trimesh.creation.revolve([(0, 0), *rim, (0, floor_m)], sections=64)
    with pytest.raises(PipelineError, match="tray: expected"):
        cavity(tray.vertices, tray.faces, name="tray")
