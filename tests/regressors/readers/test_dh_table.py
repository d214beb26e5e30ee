"""The reader of Denavit-Hartenberg tables against the products of their steps, and broken tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from refused import refusal
from written_files import text_file

from excite.export.models.robot_yaml import robot_text
from regressors.readers.description import parse_description
from regressors.readers.library import load_robot
from regressors.robot.inertia import inertia_tensor, skew

ROWS = (  # a, alpha, d, theta, prismatic, mass, centre of mass
    (0.1, 90.0, 0.4, 10.0, False, 3.0, (0.1, -0.2, 0.3)),
    (0.5, -30.0, 0.02, -90.0, False, 2.0, (0.0, 0.1, 0.05)),
    (0.03, 60.0, 0.2, 20.0, True, 1.0, (-0.1, 0.0, 0.2)),
    (0.2, 0.0, -0.1, 0.0, False, 0.5, (0.01, 0.02, 0.03)),
)
TENSOR = (0.05, 0.001, -0.002, 0.06, 0.003, 0.04)


def written(folder: Path, text: str) -> str:
    return str(text_file(folder / "arm.csv", text))


def table(convention: str, delimiter: str = ",") -> str:
    header = "type,a,alpha [deg],d [mm],theta [deg],mass,cx,cy,cz,Ixx,Ixy,Ixz,Iyy,Iyz,Izz"
    rows = (
        ("p" if slides else "", a, alpha, 1e3 * d, theta, m, *c, *TENSOR) for a, alpha, d, theta, slides, m, c in ROWS
    )
    lines = [",".join(map(str, row)) for row in rows]
    return f"# convention: {convention}\n" + "\n".join([header, *lines]).replace(",", delimiter) + "\n"


def turn(axis: int, angle: float) -> np.ndarray:
    T = np.eye(4)
    K = skew(np.eye(3)[axis])
    T[:3, :3] += np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return T


def shift(axis: int, length: float) -> np.ndarray:
    T = np.eye(4)
    T[axis, 3] = length
    return T


@pytest.mark.parametrize("delimiter", [",", ";"])
@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_bodies_are_where_the_steps_of_the_table_put_them(convention: str, delimiter: str, tmp_path: Path) -> None:
    robot = load_robot(written(tmp_path, table(convention, delimiter)))
    assert [joint.kind for joint in robot.joints] == ["revolute", "revolute", "prismatic", "revolute"]
    frame = of_table = np.eye(4)
    xx, xy, xz, yy, yz, zz = TENSOR
    about_centre = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    for k, q in enumerate(np.random.default_rng(1).uniform(-1, 1, robot.n)):
        a, alpha, d, theta, sliding, mass, centre = ROWS[k]
        along = turn(0, np.deg2rad(alpha)) @ shift(0, a)
        about = turn(2, np.deg2rad(theta) + (0 if sliding else q)) @ shift(2, d + (q if sliding else 0))
        of_table = of_table @ (about @ along if convention == "standard" else along @ about)
        frame = frame @ robot.joints[k].motion(q)
        parameters = robot.links[k].theta
        c = parameters[1:4] / mass
        np.testing.assert_allclose((frame @ [*c, 1])[:3], (of_table @ [*centre, 1])[:3], atol=1e-13)
        tensor = inertia_tensor(parameters) + mass * skew(c) @ skew(c)
        R, expected = frame[:3, :3], of_table[:3, :3] @ about_centre @ of_table[:3, :3].T
        np.testing.assert_allclose(R @ tensor @ R.T, expected, atol=1e-13)


def test_names_limits_and_drives(tmp_path: Path) -> None:
    text = (
        "# convention: modified\n# name: two joints\nname,type,d,lower [deg],upper [deg],upper [m],lower [m],"
        "velocity [deg/s],torque,ratio,rotor_inertia,viscous\nshoulder,revolute,0.3,-90,180,,,90,40,100,1e-4,2\n"
        ",prismatic,0.2,,,0.5,-0.1,,,,,\n"
    )
    robot = load_robot(written(tmp_path, text))
    assert (robot.name, robot.joint_names) == ("two joints", ("shoulder", "q2"))
    assert robot.source == "modified Denavit-Hartenberg table arm.csv"
    np.testing.assert_allclose(robot.limits.lower, [-np.pi / 2, -0.1])
    np.testing.assert_allclose(robot.limits.upper, [np.pi, 0.5])
    np.testing.assert_allclose(robot.limits.velocity, [np.pi / 2, np.inf])
    np.testing.assert_allclose(robot.limits.torque, [40, np.inf])
    first, second = robot.transmission.drives
    assert (first.ratio.value, first.rotor_inertia, first.viscous, first.coulomb) == (100, 1e-4, 2, None)
    assert (second.rotor_inertia, second.viscous) == (None, None)
    assert parse_description(robot_text(robot), "written").sha256() == robot.sha256()


HEAD = "# convention: standard\n"
BROKEN = {
    "no convention": ("a,d\n1,2\n", "arm.csv: expected a first line '# convention: standard' or"),
    "another convention": ("# convention: craig\na\n1\n", "'# convention: modified', given 'craig'"),
    "unknown column": (HEAD + "a,b\n1,2\n", "no column in arm.csv, line 2 named 'b'; available: name, type, alpha"),
    "unknown unit": (HEAD + "a [inch]\n1\n", "arm.csv, line 2: a: no unit 'inch'; available: m, mm"),
    "cells": (HEAD + "a,d\n1,2\n1\n", "arm.csv, line 4: expected 2 cells as in the header, given 1"),
    "no number": (HEAD + "a,d\n1,x\n", "arm.csv, line 3: d: expected a number, given 'x'"),
    "twice": (HEAD + "a,a [mm]\n1,2\n", "arm.csv, line 3: a is given twice"),
    "type": (HEAD + "type,a\nball,2\n", "arm.csv, line 3: type: expected revolute or prismatic, given 'ball'"),
    "degrees of a slide": (HEAD + "type,lower [deg],upper\np,-1,1\n", "lower of a prismatic joint is not in deg"),
    "one bound": (HEAD + "a,lower\n1,-1\n", "arm.csv, line 3: give lower and upper, or neither"),
    "half a body": (HEAD + "a,mass\n1,1\n", "or none; no Ixx, Iyy, Izz"),
    "ratio": (HEAD + "a,ratio\n1,0\n", "arm.csv: gear ratio must be a finite number other than zero"),
}


@pytest.mark.parametrize(("text", "message"), BROKEN.values(), ids=BROKEN)
def test_broken_tables_are_refused_in_one_line(text: str, message: str, tmp_path: Path) -> None:
    assert message in refusal(load_robot, written(tmp_path, text))
