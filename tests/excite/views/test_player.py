"""Data of the player: poses as of the robot, limits as certified, meshes with few triangles; its bundle."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reported import HOSTILE, reported_design

import excite
from constraints.clearance import link_poses
from constraints.shapes import urdf_meshes
from excite.views.player_data import FRAMES, body_data, decimated, mesh_data, player_motion
from regressors.errors import InputError
from regressors.samples import Array

# Data of the player: poses as of the robot, limits as certified, meshes with few triangles.


@pytest.fixture(scope="module")
def motion() -> dict[str, Any]:
    return player_motion(reported_design())


def poses_of(bodies: list[dict[str, Any]], q: Array) -> list[Array]:
    """Poses by Rodrigues' formula, as the player computes them, base first."""
    poses = [np.eye(4)]
    for body in bodies:
        s, axis = float(np.dot(body["row"], q)) + body["offset"], np.array(body["axis"])
        place, move = np.eye(4), np.eye(4)
        place[:3, :3], place[:3, 3] = body["rotation"], body["translation"]
        if body["kind"] == "revolute":
            x, y, z = axis
            K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            move[:3, :3] = np.eye(3) + np.sin(s) * K + (1 - np.cos(s)) * K @ K
        else:
            move[:3, 3] = s * axis
        poses.append(poses[body["parent"]] @ place @ move)
    return poses


@pytest.mark.parametrize("name", ["irp6", "irp6-full", "panda"])
def test_bodies_have_the_poses_of_the_robot(name: str) -> None:
    robot = excite.load_robot(name)
    number = {"base": 0, **{body.name: k for k, body in enumerate(robot.bodies, 1)}}
    q = np.random.default_rng(0).uniform(-1, 1, robot.n)
    expected = link_poses(robot, q[None])
    bodies = body_data(robot, number)
    for body, pose in zip(bodies, poses_of(bodies, q)[1:], strict=True):
        np.testing.assert_allclose(pose, expected[body["name"]][0], atol=1e-12)


def test_motion_is_the_one_played(motion: dict[str, Any]) -> None:
    design = reported_design()
    samples, _ = design.sequence.sampled()
    assert len(motion["time"]) == min(FRAMES, samples.time.size)
    np.testing.assert_allclose(motion["q"], samples.q, atol=1e-8)
    assert [each["name"] for each in motion["segments"]] == ["approach", "excite", "return"]
    assert motion["segments"][-1]["end"] == pytest.approx(motion["time"][-1])


def test_limits_along_the_motion_stay_within_their_certificates(motion: dict[str, Any]) -> None:
    design = reported_design()
    of_all = [use for uses in (design.limits, *design.transfer_limits.values()) for use in uses]
    values = np.array(motion["values"])
    checked = 0
    for k, limit in enumerate(motion["limits"]):
        label = limit["owner"] if limit["quantity"] == "distance" else f"{limit['owner']} {limit['quantity']}"
        margins = [use.margin for use in of_all if use.label == label]
        if not margins:
            continue
        bounds = ((limit["lower"], 1.0), (limit["upper"], -1.0))
        room = min(float((s * (values[:, k] - b)).min()) for b, s in bounds if b is not None)
        largest = max(abs(bound) for bound, _ in bounds if bound is not None)
        assert room >= min(margins) - 1e-4 * max(1.0, largest), label
        checked += 1
    assert checked >= 15
    assert {"position", "velocity", "acceleration", "torque", "distance"} <= {e["quantity"] for e in motion["limits"]}


def test_objects_and_capsules_are_those_of_the_world(motion: dict[str, Any]) -> None:
    assert [each["kind"] for each in motion["objects"]] == ["plane", "box", "capsule"]
    assert motion["objects"][1]["name"] == HOSTILE
    names = [body["name"] for body in motion["bodies"]]
    assert [names[each["body"] - 1] for each in motion["capsules"]] == ["arm", "forearm"]


def sphere(count: int) -> Array:
    """Triangles of a sphere of radius 1."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, count + 1), np.linspace(0, np.pi, count + 1))
    p = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1)
    a, b, c, d = p[:-1, :-1], p[:-1, 1:], p[1:, :-1], p[1:, 1:]
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([b, d, c], axis=2)]).reshape(-1, 3, 3)


@pytest.mark.parametrize("count", [6, 40])
def test_decimated_meshes_are_small_and_near(count: int) -> None:
    corners, faces = decimated(sphere(count), most=900)
    assert 0 < len(faces) <= 900
    distance = np.abs(np.linalg.norm(corners, axis=1) - 1.0)
    assert distance.max() < 0.15  # a coarse grid's cell
    stored = mesh_data(corners, faces)
    steps = np.frombuffer(base64.b64decode(str(stored["corners"])), "<u2").reshape(-1, 3)
    back = np.array(stored["origin"]) + float(str(stored["scale"])) * steps
    np.testing.assert_allclose(back, corners, atol=1e-4)
    read = np.frombuffer(base64.b64decode(str(stored["faces"])), "<u2").reshape(-1, 3)
    np.testing.assert_array_equal(read, faces)


URDF = """<robot name="arm"><link name="base"/>
  <joint name="j" type="revolute"><parent link="base"/><child link="l"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" velocity="1" effort="10"/></joint>
  <link name="l"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><origin xyz="0 0 0.5"/><geometry><mesh filename="{visual}" scale="2 2 2"/></geometry></visual>
    <collision><geometry><mesh filename="c.obj"/></geometry></collision></link>
  <joint name="f" type="fixed"><parent link="l"/><child link="m"/><origin xyz="1 0 0"/></joint>
  <link name="m"><visual><geometry><mesh filename="c.obj"/></geometry></visual></link>
</robot>"""
OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1/1 2/2 3/3 -1\n"


@pytest.mark.parametrize(("visual", "first"), [("c.obj", [2.0, 0.0, 0.5]), ("c.dae", [1.0, 0.0, 0.0])])
def test_meshes_of_visuals_else_of_collisions(visual: str, first: list[float], tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(URDF.format(visual=visual))
    (tmp_path / "c.obj").write_text(OBJ)
    robot = excite.load_robot(str(tmp_path / "arm.urdf"))
    meshes, left_out = urdf_meshes(tmp_path / "arm.urdf", robot)
    assert ["c.dae" in each for each in left_out] == [True] * (visual == "c.dae")
    assert [link for link, _ in meshes] == ["l", "l"]
    np.testing.assert_allclose(meshes[0][1][0, 1], first)
    np.testing.assert_allclose(meshes[1][1][:, :, 0].min(), 1.0)  # fixed a metre away


def test_a_file_of_another_robot_is_refused(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(URDF.format(visual="c.obj"))
    with pytest.raises(InputError, match="does not describe the robot of a design or a result here: irp6"):
        excite.write_report(reported_design(), tmp_path / "page.html", robot_file=tmp_path / "arm.urdf")


# The bundled player is built from the sources beside it, and asks nothing of a network.


REPORT = Path(__file__).resolve().parents[3] / "excite" / "views"
PLAYER = REPORT / "page" / "player.min.js"
BUNDLE = REPORT / "bundle"


def test_player_is_built_from_its_sources() -> None:
    files = [*sorted((BUNDLE / "player").glob("*.js")), BUNDLE / "package-lock.json"]
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()
    assert PLAYER.read_text(encoding="utf-8").startswith(f"/* sources {digest};"), "run excite/views/bundle/build.sh"


def test_versions_are_pinned_and_the_licence_is_there() -> None:
    package = json.loads((BUNDLE / "package.json").read_text(encoding="utf-8"))
    lock = json.loads((BUNDLE / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    for name, wanted in package["devDependencies"].items():
        assert lock[f"node_modules/{name}"]["version"] == wanted
    assert "MIT License" in (REPORT / "page" / "three.LICENSE").read_text(encoding="utf-8")


def test_player_stands_in_a_page_and_asks_nothing_of_a_network() -> None:
    text = PLAYER.read_text(encoding="utf-8")
    assert not re.search(r"</script|<!--", text, re.IGNORECASE)
    assert not re.search(r"\beval\(|new Function\(|importScripts|WebSocket|sendBeacon", text)
