"""World files, shapes from URDF, meshes: what is read, what is refused and where, capsules around other shapes."""

from __future__ import annotations

import struct
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from click.testing import CliRunner
from hypothesis import given, settings, strategies as st
from public_arms import ARMS, Arm
from refused import refusal
from written_files import text_file

from constraints.geometry import Box, HalfSpace, Obstacle, Part, enclosing_capsule, enclosing_cylinder
from constraints.shapes import MeshError, carried_links, collada_triangles, mesh_corners, urdf_meshes, urdf_shape
from constraints.world_file import read_world, world_of
from excite.cli.main import cli
from excite.design.task_file import read_task_file, task_from_options
from regressors.errors import InputError
from regressors.readers.library import built_in
from regressors.readers.urdf import read_urdf
from regressors.robot.shapes import Capsule

WORLD = """\
schema: excite.world/1
clearance: 0.02
robot:
  - {link: link_2, from: [0, 0, 0], to: [0, -0.14, 0], radius: 0.08}
  - {link: link_6, from: [0, 0, 0], radius: 0.09}
objects:
  table: {plane: {normal: [0, 0, 2], offset: -0.1}}
  post: {capsule: {from: [0.5, 0, 0], to: [0.5, 0, 1], radius: 0.05}}
  ball: {sphere: {centre: [0, 0.7, 0.4], radius: 0.1}}
  crate: {box: {centre: [0.4, 0.4, 0.1], size: [0.2, 0.3, 0.2], rpy: [0, 0, 0.5]}}
ignore:
  - [link_2, table]
"""


def written(folder: Path, text: str, name: str = "world.yaml") -> Path:
    return text_file(folder / name, text)


def test_a_world_file_says_what_stands_where(tmp_path: Path) -> None:
    world = read_world(written(tmp_path, WORLD))
    assert (world.clearance, world.tolerance, world.self_collision) == (0.02, 0.005, True)
    assert world.parts[0] == Part("link_2", Capsule((0.0, 0.0, 0.0), (0.0, -0.14, 0.0), 0.08))
    assert world.parts[1].capsule.length == 0
    assert world.obstacles == (
        Obstacle("table", HalfSpace((0.0, 0.0, 1.0), -0.1)),
        Obstacle("post", Capsule((0.5, 0.0, 0.0), (0.5, 0.0, 1.0), 0.05)),
        Obstacle("ball", Capsule((0.0, 0.7, 0.4), (0.0, 0.7, 0.4), 0.1)),
        Obstacle("crate", Box((0.4, 0.4, 0.1), (0.2, 0.3, 0.2), (0.0, 0.0, 0.5))),
    )
    assert world.ignored == (("link_2", "table"),)
    assert world_of(world.to_dict()) == world


def test_a_task_file_names_a_world_or_holds_one(tmp_path: Path) -> None:
    written(tmp_path, WORLD)
    inside = "world:\n" + "".join(f"  {line}\n" for line in WORLD.splitlines())
    for text in ("world: world.yaml\n", inside):
        task = task_from_options({**read_task_file(written(tmp_path, text, "task.yaml")), "robot": "iiwa7"})
        assert task.limits.world == read_world(tmp_path / "world.yaml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("radius: 0.08", "radius: 0", "robot[1] (line 4): radius must be greater than zero, given 0"),
        ("normal: [0, 0, 2]", "normal: [0, 0, 0]", "objects.table.plane (line 7): normal must not be zero"),
        ("{sphere:", "{cone:", "objects.ball.cone (line 9): no such field; available: capsule, sphere, plane, box"),
        ("{sphere: {centre: [0, 0.7, 0.4], radius: 0.1}}", "{}", "objects.ball (line 9): expected one of capsule"),
        ("clearance: 0.02", "clearance: 0", "clearance must be greater than zero, given 0"),
        ("clearance: 0.02", "clearence: 0.02", "clearence (line 2): no such field; did you mean clearance? available:"),
        (
            "[link_2, table]",
            "[link_2, tabel]",
            "named 'tabel'; did you mean 'table'? available: link_2, link_6, table, ",
        ),
        ("excite.world/1", "excite.world/9", "schema (line 1): should be 'excite.world/1', given 'excite.world/9'"),
    ],
)
def test_mistakes_are_told_with_their_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in WORLD
    path = written(tmp_path, WORLD.replace(old, new, 1))
    told = refusal(read_world, path)
    assert message in told
    assert str(path) in told


def test_urdf_shapes_need_a_urdf(tmp_path: Path) -> None:
    path = written(tmp_path, "robot: urdf\n")
    with pytest.raises(InputError, match=r"robot \(line 1\): .*<collision> elements of a URDF, but 'iiwa7'"):
        read_world(path, "iiwa7")


# --- capsules around other shapes ------------------------------------------------------------------------------------


def outside(capsule: Capsule, points: np.ndarray) -> np.ndarray:
    """How far each point is outside; negative for those that are not."""
    start, line = np.array(capsule.start), np.subtract(capsule.end, capsule.start)
    length = max(float(np.linalg.norm(line)), 1e-300)
    along = (points - start) @ line / length
    beyond = np.maximum(np.maximum(-along, along - length), 0.0)
    across = np.linalg.norm(points - start - along[:, None] * line / length, axis=1)
    return np.hypot(beyond, across) - capsule.radius


def depth(capsule: Capsule, points: np.ndarray) -> float:
    """How far the outermost point is outside; negative if none is."""
    return float(outside(capsule, points).max())


@given(st.integers(1, 60), st.integers(0, 2**32 - 1))
@settings(max_examples=8, deadline=None)
def test_a_capsule_contains_its_points_and_is_small(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3)) @ np.diag(rng.uniform(0.02, 0.5, 3)) + rng.normal(size=3)
    capsule = enclosing_capsule(points)
    assert depth(capsule, points) <= 1e-12
    sphere = np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    volume = capsule.radius**2 * capsule.length + 4 / 3 * capsule.radius**3
    assert volume <= 4 / 3 * sphere**3 * (1 + 1e-6) + 1e-9


def test_the_capsule_around_points_of_a_capsule_is_that_one() -> None:
    rng = np.random.default_rng(0)
    direction = rng.normal(size=(3000, 3))
    points = 0.1 * direction / np.linalg.norm(direction, axis=1)[:, None] + rng.uniform(0, 1, (3000, 1)) * [0.3, 0.4, 0]
    found = enclosing_capsule(points)
    assert found.radius == pytest.approx(0.1, rel=0.03)
    assert found.length == pytest.approx(0.5, rel=0.03)


@pytest.mark.parametrize(("radius", "length"), [(0.1, 0.5), (0.5, 0.1), (0.03, 0.03)])
def test_a_capsule_contains_a_cylinder(radius: float, length: float) -> None:
    capsule = enclosing_cylinder(radius, length)
    angle = np.linspace(0, 2 * np.pi, 40)
    rim = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(40, length / 2)])
    assert -1e-6 < depth(capsule, np.vstack([rim, rim * [1, 1, -1]])) <= 1e-12


TRIANGLES = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0.5], [1, 2, 3], [-1.5, 0, 0]]])


def test_meshes_are_read_in_every_form(tmp_path: Path) -> None:
    body = b"".join(struct.pack("<12fH", 0, 0, 1, *triangle.ravel(), 0) for triangle in TRIANGLES)
    (tmp_path / "a.stl").write_bytes(b"solid but binary".ljust(80) + struct.pack("<I", 2) + body)
    corners = ("".join(f"  vertex {x} {y} {z}\n" for x, y, z in triangle) for triangle in TRIANGLES)
    loops = "".join(f"facet normal 0 0 1\n outer loop\n{three} endloop\nendfacet\n" for three in corners)
    (tmp_path / "b.STL").write_text(f"solid x\n{loops}endsolid x\n")
    (tmp_path / "c.obj").write_text("".join(f"vn 0 0 1\nv {x} {y} {z}\n" for x, y, z in TRIANGLES.reshape(-1, 3)))
    for name in ("a.stl", "b.STL", "c.obj"):
        np.testing.assert_array_equal(mesh_corners(tmp_path / name), TRIANGLES.reshape(-1, 3))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.dae", b"", "no reader for .dae; available: .stl, .obj"),
        ("a.stl", b"solid\nendsolid\n", "expected a mesh of finite corners, given 0 corners"),
        ("a.stl", b"solid\nvertex 1 2\n", "not a mesh"),
        ("b.stl", None, "cannot read mesh"),
    ],
)
def test_meshes_that_are_none_are_refused(tmp_path: Path, name: str, content: bytes | None, message: str) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    assert message in refusal(mesh_corners, tmp_path / name)


@pytest.mark.slow
@pytest.mark.parametrize("arm", [arm for arm in ARMS if arm.id in ("panda-hand", "z1-held-gripper")], ids=str)
def test_shapes_of_a_urdf_are_inside_the_capsules(arm: Arm) -> None:
    """Corners that Pinocchio and Coal find for every collision geometry, all joints at zero."""
    robot = read_urdf(arm.path, base=arm.base, tip=arm.tip)
    parts, left_out = urdf_shape(arm.path, carried_links(arm.path, robot, arm.base))
    assert left_out == ()
    model = pin.buildModelFromUrdf(str(arm.path))
    folders = [str(arm.path.parents[4])]
    shapes = pin.buildGeomFromUrdf(model, str(arm.path), pin.GeometryType.COLLISION, package_dirs=folders)
    data, placed = model.createData(), shapes.createData()
    pin.updateGeometryPlacements(model, data, shapes, placed, np.zeros(model.nq))
    base = data.oMf[model.getFrameId(arm.base)] if arm.base else pin.SE3.Identity()
    pin.framesForwardKinematics(model, data, np.zeros(model.nq))
    poses = {"base": base, **{link.name: data.oMf[model.getFrameId(link.name)] for link in robot.links}}
    assert len(parts) == len(shapes.geometryObjects)
    for shape, T in zip(shapes.geometryObjects, placed.oMg, strict=True):
        points = corners(shape) @ T.rotation.T + T.translation
        there = ((part, (points - poses[part.link].translation) @ poses[part.link].rotation) for part in parts)
        assert any(depth(part.capsule, corners) <= 1e-6 for part, corners in there), shape.name


def corners(shape: pin.GeometryObject) -> np.ndarray:
    """Points of a collision geometry's surface in its own frame."""
    geometry = shape.geometry
    if isinstance(geometry, coal.BVHModelBase):
        return np.array(geometry.vertices()) * shape.meshScale
    if isinstance(geometry, coal.Cylinder):
        angle = np.linspace(0, 2 * np.pi, 24)
        rim = np.column_stack([geometry.radius * np.cos(angle), geometry.radius * np.sin(angle)])
        return np.vstack([np.column_stack([rim, np.full(24, z)]) for z in (-geometry.halfLength, geometry.halfLength)])
    box = geometry.halfSide
    return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * box


def test_a_world_takes_the_shape_of_the_urdf(tmp_path: Path) -> None:
    arm = next(arm for arm in ARMS if arm.id == "panda-elbow")
    path = written(tmp_path, "robot: urdf\nobjects: {table: {plane: {normal: [0, 0, 1], offset: -0.05}}}\n")
    world = read_world(path, str(arm.path), arm.base, arm.tip)
    assert {part.link for part in world.parts} == {"base", "panda_link3", "panda_link4", "panda_link5"}


def test_capsules_are_printed_as_the_beginning_of_a_world_file(tmp_path: Path) -> None:
    arm = next(arm for arm in ARMS if arm.id == "z1-held-gripper")
    arguments = ["robots", str(arm.path), "--base", arm.base, "--tip", arm.tip, "--capsules"]
    printed = CliRunner().invoke(cli, arguments)
    assert printed.exit_code == 0
    parts = read_world(written(tmp_path, printed.output)).parts
    robot = read_urdf(arm.path, base=arm.base, tip=arm.tip)
    exact, _ = urdf_shape(arm.path, carried_links(arm.path, robot, arm.base))
    assert [part.link for part in parts] == [part.link for part in exact]
    for ours, theirs in zip(parts, exact, strict=True):
        ends = np.array([theirs.capsule.start, theirs.capsule.end])
        assert all(ours.capsule.distance(end) <= -theirs.capsule.radius for end in ends)
        assert ours.capsule.radius < theirs.capsule.radius + 3e-6


@pytest.mark.parametrize(
    ("collision", "message"),
    [
        ("<collision/>", "link 'b', <collision>: expected one shape in <geometry>"),
        ("<collision><geometry><cone/></geometry></collision>", "no shape named 'cone'; available: sphere, cylinder"),
        ("<collision><geometry><sphere radius='0'/></geometry></collision>", "radius must be greater than zero"),
        ("<collision><geometry><mesh filename='package://x/y.stl'/></geometry></collision>", "cannot read mesh"),
    ],
)
def test_collision_elements_that_cannot_be_used_are_named(tmp_path: Path, collision: str, message: str) -> None:
    text = f"""<robot name="r"><link name="a"/><link name="b">{collision}</link>
    <joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint></robot>"""
    path = written(tmp_path, text, "r.urdf")
    assert message in refusal(read_world, written(tmp_path, "robot: urdf\n"), str(path))


DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2020-01-01T00:00:00</created><modified>2020-01-01T00:00:00</modified>
<unit name="mm" meter="0.001"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="12">0 0 0 1000 0 0 1000 1000 0 0 1000 0</float_array>
<technique_common><accessor source="#a" count="4" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="1"><input semantic="VERTEX" source="#v" offset="0"/><vcount>4</vcount><p>0 1 2 3</p></polylist>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><translate>0 0 500</translate><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
"""


def test_unit_and_placement_count_and_polygons_are_fans(tmp_path: Path) -> None:
    pytest.importorskip("collada")
    (tmp_path / "m.dae").write_text(DAE)
    triangles = collada_triangles(tmp_path / "m.dae")
    assert triangles.shape == (2, 3, 3)
    np.testing.assert_allclose(triangles.min(axis=(0, 1)), [0.0, 0.0, 0.5])
    np.testing.assert_allclose(triangles.max(axis=(0, 1)), [1.0, 1.0, 0.5])


def test_links_of_a_public_arm_are_as_another_reader_reads_them() -> None:
    pytest.importorskip("collada")
    arm = next(arm for arm in ARMS if arm.id == "panda-hand")
    for path in sorted((arm.path.parents[1] / "meshes" / "visual").glob("link[1-3].dae")):
        triangles, known = collada_triangles(path), coal.MeshLoader().load(str(path), np.ones(3))
        known.computeLocalAABB()
        np.testing.assert_allclose(triangles.min(axis=(0, 1)), known.aabb_local.min_, atol=1e-6)
        np.testing.assert_allclose(triangles.max(axis=(0, 1)), known.aabb_local.max_, atol=1e-6)


@pytest.mark.parametrize("text", ["", "no XML", "<COLLADA/>", DAE[:600], "<!DOCTYPE x [<!ENTITY a 'b'>]>" + DAE])
def test_damaged_files_are_named(text: str, tmp_path: Path) -> None:
    pytest.importorskip("collada")
    (tmp_path / "m.dae").write_text(text)
    with pytest.raises(MeshError, match=r"m\.dae"):
        collada_triangles(tmp_path / "m.dae")


def test_without_the_package_the_message_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "collada", None)
    with pytest.raises(MeshError, match=r"pip install 'excite-trajectories\[meshes\]'"):
        collada_triangles(tmp_path / "m.dae")


def test_nodes_that_stand_for_too_many_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each node stands for two of the one before it."""
    pytest.importorskip("collada")
    nodes = '<node id="n0"><instance_geometry url="#g"/></node>' + "".join(
        f'<node id="n{k}"><instance_node url="#n{k - 1}"/><instance_node url="#n{k - 1}"/></node>' for k in range(1, 40)
    )
    text = DAE.replace("<library_visual", f"<library_nodes>{nodes}</library_nodes><library_visual")
    geometry, node = '</translate><instance_geometry url="#g"/>', '</translate><instance_node url="#n{}"/>'
    (tmp_path / "m.dae").write_text(text.replace(geometry, node.format(4)))
    assert len(collada_triangles(tmp_path / "m.dae")) == 32
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "0.000005")
    with pytest.raises(MeshError, match=r"m\.dae: its triangles take more than the cap of 5 kB"):
        collada_triangles(tmp_path / "m.dae")
    (tmp_path / "m.dae").write_text(text.replace(geometry, node.format(39)))
    with pytest.raises(MeshError, match=r"m\.dae: its nodes stand for more than 10000 nodes"):
        collada_triangles(tmp_path / "m.dae")


def test_so101_capsules_contain_its_meshes() -> None:
    arm = next(arm for arm in ARMS if arm.id == "so101")
    robot, points = built_in("so101"), dict[str, list[np.ndarray]]()
    for link, triangles in urdf_meshes(arm.path, read_urdf(arm.path, tip=arm.tip))[0]:
        points.setdefault(link, []).append(triangles.reshape(-1, 3))
    assert len(points) == 7
    for link, meshes in points.items():
        corners = np.unique(np.vstack(meshes), axis=0)
        distances = [outside(part.capsule, corners) for part in robot.shapes if part.link == link]
        assert np.min(distances, axis=0).max() <= 0.0
