"""The payload in the words of controllers, read back."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from excite.payload.controllers import CONTROLLERS, EXPECTED, angles_of, loaddata_text
from excite.payload.held_body import Frame, HeldBody
from excite.payload.load_estimate import LoadEstimate
from excite.payload.payload_result import PayloadResult
from regressors.errors import UnknownName
from regressors.readers.library import load_robot
from regressors.robot.inertia import from_centre_of_mass, rotation_from_rpy

AXES = rotation_from_rpy([0.3, -0.4, 0.5])
INERTIA = AXES @ np.diag([0.011, 0.02, 0.027]) @ AXES.T
PHI = from_centre_of_mass(2.5, [0.01, -0.02, 0.085], INERTIA)
NUMBER = r"-?\d+\.\d+"


def held() -> PayloadResult:
    none = np.zeros(0)
    estimate = LoadEstimate(PHI, 1e-9 * np.eye(10), 0 * np.eye(10), none, np.zeros((0, 0)), none, 9, none, 9.0)
    return PayloadResult(load_robot("panda"), Frame("flange", np.eye(3), np.zeros(3)), estimate, "wrench", None)


def numbers(text: str) -> list[float]:
    return [float(x) for x in re.findall(NUMBER, text)]


def line(name: str) -> str:
    lines = held().text_for(name).splitlines()
    return next(one for one in lines if not one.startswith(("#", "//", ";", "!", "<!--")))


def test_universal_robots() -> None:
    found = line("ur")
    assert re.fullmatch(
        rf"set_target_payload\({NUMBER}, \[{NUMBER}(, {NUMBER}){{2}}\], \[{NUMBER}(, {NUMBER}){{5}}\]\)", found
    )
    xx, yy, zz, xy, xz, yz = numbers(found)[4:]
    np.testing.assert_allclose([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], INERTIA, atol=1e-8)
    np.testing.assert_allclose(numbers(found)[:4], [2.5, 0.01, -0.02, 0.085])


def test_franka() -> None:
    found = line("franka")
    assert found.startswith("robot.setLoad(2.5, {{0.01, -0.02, 0.085}}, {{")
    np.testing.assert_allclose(np.reshape(numbers(found)[4:], (3, 3), order="F"), INERTIA, atol=1e-8)


def test_kuka() -> None:
    found = line("kuka")
    triple = rf"X {NUMBER},Y {NUMBER},Z {NUMBER}"
    abc = rf"A {NUMBER},B {NUMBER},C {NUMBER}"
    assert re.fullmatch(rf"LOAD_DATA\[1\]=\{{M {NUMBER},CM \{{{triple},{abc}\}},J \{{{triple}\}}\}}", found)
    mass, x, y, z, a, b, c, *moments = numbers(found)
    R = Rotation.from_euler("ZYX", [a, b, c], degrees=True).as_matrix()
    np.testing.assert_allclose(R @ np.diag(moments) @ R.T, INERTIA, atol=1e-8)
    np.testing.assert_allclose([mass, x, y, z], [2.5, 10.0, -20.0, 85.0])


def test_abb() -> None:
    found = line("abb")
    assert re.fullmatch(rf"PERS loaddata payload := \[{NUMBER}, \[.*\], \[.*\]((, {NUMBER}){{3}})\];", found)
    mass, x, y, z, w, qx, qy, qz, *moments = numbers(found)
    R = Rotation.from_quat([qx, qy, qz, w]).as_matrix()
    np.testing.assert_allclose(R @ np.diag(moments) @ R.T, INERTIA, atol=1e-8)
    np.testing.assert_allclose([mass, x, y, z], [2.5, 10.0, -20.0, 85.0])
    assert w**2 + qx**2 + qy**2 + qz**2 == pytest.approx(1.0, abs=1e-8)


def test_urdf() -> None:
    root = ET.fromstring(f"<robot>{held().text_for('urdf')}</robot>")
    inertial = root.find("link/inertial")
    assert inertial is not None
    tensor = {name: float(value) for name, value in inertial.find("inertia").attrib.items()}  # type: ignore[union-attr]
    np.testing.assert_allclose([tensor["ixx"], tensor["ixy"], tensor["iyz"]], INERTIA[[0, 0, 1], [0, 1, 2]], atol=1e-9)
    assert inertial.find("mass").attrib == {"value": "2.5"}  # type: ignore[union-attr]


@pytest.mark.parametrize("name", CONTROLLERS)
def test_every_form_says_in_which_frame_it_is(name: str) -> None:
    assert "in: flange; expected: " + EXPECTED[name][:6] in held().text_for(name)


def test_an_unknown_controller_is_refused() -> None:
    with pytest.raises(UnknownName, match="controller"):
        held().text_for("fanuc")


@pytest.mark.parametrize("seed", range(3))
def test_angles_are_those_of_the_rotation(seed: int) -> None:
    R = Rotation.random(rng=np.random.default_rng(seed))
    a, b, c = angles_of(R.as_matrix())
    np.testing.assert_allclose(
        Rotation.from_euler("ZYX", [a, b, c], degrees=True).as_matrix(), R.as_matrix(), atol=1e-12
    )


@pytest.mark.parametrize("b", [90.0, -90.0])
def test_angles_where_two_axes_fall_together(b: float) -> None:
    R = Rotation.from_euler("ZYX", [30.0, b, 20.0], degrees=True).as_matrix()
    np.testing.assert_allclose(Rotation.from_euler("ZYX", angles_of(R), degrees=True).as_matrix(), R, atol=1e-7)


def test_a_point_mass_at_the_origin_gets_a_place_for_abb() -> None:

    body = HeldBody(1.0, np.zeros(3), np.zeros((3, 3)))
    assert "[1.0, [0.0, 0.0, 0.001], [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0]" in loaddata_text(body, "flange")
