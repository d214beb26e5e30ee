"""The possible body nearest to an estimate, forms of bodies, frames, and the words of controllers, read back."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from excite.payload.held_body import Frame, HeldBody, is_possible, nearest_possible, spread_of
from excite.payload.load_estimate import LoadEstimate
from excite.payload.payload_result import CONTROLLERS, EXPECTED, PayloadResult, angles_of, loaddata_text
from regressors.errors import UnknownName
from regressors.readers.library import load_robot
from regressors.robot.inertia import from_centre_of_mass, pseudo_inertia, rotation_from_rpy

BODY = from_centre_of_mass(2.0, [0.02, -0.03, 0.1], np.diag([0.01, 0.02, 0.025]))


def test_an_impossible_body_becomes_the_nearest_possible_one() -> None:
    """No random possible body is nearer in the metric of the covariance."""
    rng = np.random.default_rng(0)
    A = rng.normal(size=(10, 10)) * np.array([0.01, *(0.01,) * 3, *(0.02,) * 6])[:, None]
    C = A @ A.T
    estimate = BODY - np.array([0, 0, 0, 0, 0.05, 0, 0, 0, 0, 0.0])
    assert not is_possible(estimate)
    np.testing.assert_array_equal(nearest_possible(BODY, np.eye(10)), BODY)
    found = nearest_possible(estimate, C)
    assert np.linalg.eigvalsh(pseudo_inertia(found))[0] > 0

    def distance(phi: np.ndarray) -> float:
        d = phi - estimate
        return float(d @ np.linalg.solve(C, d))

    tried = found + rng.normal(size=(4000, 10)) * np.geomspace(1e-6, 1e-2, 4000)[:, None] * np.sqrt(np.diag(C))
    possible = [phi for phi in tried if is_possible(phi)]
    assert len(possible) > 100
    assert min(map(distance, possible)) > distance(found) * (1 - 1e-3)


@pytest.mark.parametrize(("moments", "possible"), [((0.3, 0.4, 0.5), True), ((0.3, 0.1, 0.5), False)])
def test_principal_axes_and_moments_belong_together(moments: tuple[float, ...], possible: bool) -> None:
    """Of axes near those of the frame, whatever the order of the moments; none may exceed the sum of the others."""
    R = rotation_from_rpy([0.1, -0.2, 0.15])
    body = HeldBody.of(from_centre_of_mass(2.0, [0.1, 0.0, 0.2], R @ np.diag(moments[::-1]) @ R.T))
    found, axes = body.principal
    np.testing.assert_allclose(found, moments[::-1])
    np.testing.assert_allclose(axes, R, atol=1e-12)  # a rotation, not a mirror
    assert is_possible(body.parameters) == possible


def test_a_body_is_its_parameters() -> None:
    body = HeldBody.of(BODY)
    np.testing.assert_allclose(body.centre, [0.02, -0.03, 0.1])
    np.testing.assert_allclose(body.inertia, np.diag([0.01, 0.02, 0.025]), atol=1e-15)
    np.testing.assert_allclose(body.parameters, BODY, atol=1e-15)


def test_a_frame_moves_a_body() -> None:
    frame = Frame("flange", rotation_from_rpy([0.1, 0.2, 0.3]), np.array([0.0, 0.1, 0.2]))
    seen = HeldBody.of(frame.from_link @ BODY)
    link = HeldBody.of(BODY)
    assert seen.mass == pytest.approx(link.mass)
    np.testing.assert_allclose(frame.rotation @ seen.centre + frame.translation, link.centre)
    np.testing.assert_allclose(frame.rotation @ seen.inertia @ frame.rotation.T, link.inertia, atol=1e-15)
    np.testing.assert_allclose(frame.to_link @ frame.from_link, np.eye(10), atol=1e-13)


def test_the_spread_of_a_function_is_that_of_samples() -> None:
    rng = np.random.default_rng(1)
    C = np.diag((1e-3 * np.abs(BODY) + 1e-5) ** 2)
    samples = BODY + rng.normal(size=(20000, 10)) * np.sqrt(np.diag(C))
    scatter = np.std([HeldBody.of(phi).listed for phi in samples], axis=0)
    np.testing.assert_allclose(spread_of(lambda phi: HeldBody.of(phi).listed, BODY, C), scatter, rtol=0.03)


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


def test_universal_robots_franka_and_urdf() -> None:
    found = line("ur")
    assert re.fullmatch(
        rf"set_target_payload\({NUMBER}, \[{NUMBER}(, {NUMBER}){{2}}\], \[{NUMBER}(, {NUMBER}){{5}}\]\)", found
    )
    xx, yy, zz, xy, xz, yz = numbers(found)[4:]
    np.testing.assert_allclose([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], INERTIA, atol=1e-8)
    np.testing.assert_allclose(numbers(found)[:4], [2.5, 0.01, -0.02, 0.085])
    found = line("franka")
    assert found.startswith("robot.setLoad(2.5, {{0.01, -0.02, 0.085}}, {{")
    np.testing.assert_allclose(np.reshape(numbers(found)[4:], (3, 3), order="F"), INERTIA, atol=1e-8)
    root = ET.fromstring(f"<robot>{held().text_for('urdf')}</robot>")
    tensor = root.find("link/inertial/inertia")
    values = [[float(tensor.attrib["i" + "".join(sorted(a + b))]) for b in "xyz"] for a in "xyz"]
    np.testing.assert_allclose(values, INERTIA, atol=1e-9)
    assert root.find("link/inertial/mass").attrib == {"value": "2.5"}


def test_kuka_and_abb() -> None:
    triple, abc = rf"X {NUMBER},Y {NUMBER},Z {NUMBER}", rf"A {NUMBER},B {NUMBER},C {NUMBER}"
    kuka = rf"LOAD_DATA\[1\]=\{{M {NUMBER},CM \{{{triple},{abc}\}},J \{{{triple}\}}\}}"
    abb = rf"PERS loaddata payload := \[{NUMBER}, \[.*\], \[.*\]((, {NUMBER}){{3}})\];"
    for name, form in (("kuka", kuka), ("abb", abb)):
        found = line(name)
        assert re.fullmatch(form, found)
        mass, x, y, z, *axes = numbers(found)
        np.testing.assert_allclose([mass, x, y, z], [2.5, 10.0, -20.0, 85.0])
        *axes, xx, yy, zz = axes
        if name == "kuka":
            R = Rotation.from_euler("ZYX", axes, degrees=True).as_matrix()
        else:
            assert np.linalg.norm(axes) == pytest.approx(1.0, abs=1e-8)
            R = Rotation.from_quat([*axes[1:], axes[0]]).as_matrix()
        np.testing.assert_allclose(R @ np.diag([xx, yy, zz]) @ R.T, INERTIA, atol=1e-8)


def test_every_form_says_in_which_frame_it_is_and_others_are_refused() -> None:
    for name in CONTROLLERS:
        assert "in: flange; expected: " + EXPECTED[name][:6] in held().text_for(name)
    with pytest.raises(UnknownName, match="controller"):
        held().text_for("fanuc")


def test_angles_are_those_of_the_rotation() -> None:
    for b, tolerance in ((10.0, 1e-12), (-80.0, 1e-12), (90.0, 1e-7), (-90.0, 1e-7)):  # where two axes fall together
        R = Rotation.from_euler("ZYX", [30.0, b, 20.0], degrees=True).as_matrix()
        back = Rotation.from_euler("ZYX", angles_of(R), degrees=True)
        np.testing.assert_allclose(back.as_matrix(), R, atol=tolerance)


def test_a_point_mass_at_the_origin_gets_a_place_for_abb() -> None:

    body = HeldBody(1.0, np.zeros(3), np.zeros((3, 3)))
    assert "[1.0, [0.0, 0.0, 0.001], [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0]" in loaddata_text(body, "flange")
