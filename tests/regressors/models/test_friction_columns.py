"""Columns of friction against friction written out by hand, with Pinocchio's torques, of all drives and of some."""

from __future__ import annotations

import re
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from motions import random_sines
from pinocchio_chains import drive_torques, joint_torques
from refused import refusal

from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel, SpringModel, standard_of
from regressors.models.energy import EnergyModel
from regressors.models.model import RegressorModel
from regressors.models.nominal import standard_values
from regressors.models.partial import of_joints
from regressors.models.windows import Window
from regressors.readers.library import built_in
from regressors.robot.columns import FRICTION_KINDS, Terms
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

ALL = Terms(offset=True, load_share=True, root=True, asymmetry=True, stribeck=True, stribeck_speed=0.4)
RNG = np.random.default_rng(0)


def coupling(robot: Robot) -> Array:
    return np.eye(robot.n) if robot.transmission is None else np.array(robot.transmission.coupling)


def carried(robot: Robot, samples: Samples) -> Array:
    """Torque at each drive that moves its links and rotors, shape (N, n)."""
    if robot.transmission is None:
        return joint_torques(robot, samples)
    viscous = np.array([drive.viscous for drive in robot.transmission.drives])
    return drive_torques(robot, samples) - viscous * (samples.dq @ coupling(robot).T)


def friction(robot: Robot, samples: Samples, kind: str, drive: int, width: float = 0.0) -> Array:
    """Joint torques of a unit friction parameter, one instant after the other, shape (N, n)."""
    C, load, torques = coupling(robot), carried(robot, samples), []
    for k, dq in enumerate(samples.dq):
        v = float(C[drive] @ dq)
        s = float(np.sign(v)) if width == 0.0 else float(np.tanh(v / width))
        torque = {
            "coulomb": s,
            "viscous": v,
            "offset": 1.0,
            "load share": abs(load[k, drive]) * s,
            "root": abs(v) ** 0.5 * s,
            "asymmetry": abs(v),
            "stribeck": np.exp(-((v / 0.4) ** 2)) * s,
        }[kind]
        torques.append(torque * C[drive])
    return np.array(torques)


def columns_of(model: DifferentialModel, samples: Samples) -> dict[tuple[str, int], Array]:
    W = model.instants(samples).reshape(samples.time.size, -1, len(model.columns))
    return {(c.kind, c.owner): W[:, :, k] for k, c in enumerate(model.columns) if c.kind in FRICTION_KINDS}


@pytest.mark.parametrize("width", [0.0, 0.3])
@pytest.mark.parametrize("name", ["ur10e", "irp6"])
def test_columns_are_friction_written_out(name: str, width: float) -> None:
    robot = built_in(name)
    samples = random_states(robot, 30, seed=1)
    found = columns_of(DifferentialModel(robot, ALL, sign_width=width), samples)
    assert len(found) == len(FRICTION_KINDS) * robot.n
    for (kind, owner), column in found.items():
        expected = friction(robot, samples, kind, owner - 1, width)
        np.testing.assert_allclose(column, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_names_and_units() -> None:
    columns = DifferentialModel(built_in("ur10e"), Terms(offset=(1,), load_share=(2,), root=(3,), stribeck=(4, 1)))
    further = {c.name: c.unit for c in columns.columns if c.name[-1] not in "cv" and c.group == "friction"}
    assert further == {"F1o": "Nm", "F2l": "Nm/Nm", "F3r": "Nm (s/rad)^0.5", "F1s": "Nm", "F4s": "Nm"}


def test_friction_vanishes_smoothly_at_standstill() -> None:
    """The pullback at rest has no infinite slope times zero: designs start and end there."""
    robot = built_in("irp6")
    still = random_states(robot, 5)
    still = replace(still, dq=np.zeros_like(still.dq))
    model = DifferentialModel(robot, ALL, sign_width=0.1)
    motion = [np.ascontiguousarray(x.T) for x in (still.q, still.dq, still.ddq)]
    gradient = model.function.pullback(motion, np.ones((len(model.function.row), 5)))
    assert all(np.all(np.isfinite(part)) for part in gradient)
    for (kind, _), column in columns_of(model, still).items():
        np.testing.assert_allclose(column, 0.0 if kind != "offset" else column, atol=1e-12)


@pytest.mark.parametrize("name", ["irp6", "irp6-full", "panda"])
def test_torques_are_rows_times_parameters(name: str) -> None:
    """The fast form of the product agrees, and it is linear though the load depends on the motion."""
    robot = built_in(name)
    terms = replace(ALL, load_share=False) if name == "irp6-full" else ALL  # whose bars have no known masses
    model = DifferentialModel(robot, terms, sign_width=0.2)
    symbols = [ca.SX.sym(name, robot.n) for name in ("q", "dq", "ddq")]
    state = [RNG.normal(size=robot.n) for _ in symbols]
    a, b = RNG.normal(size=(2, len(model.columns)))
    given = {"a": a, "b": b, "both": 2 * a - 3 * b}
    functions = {key: ca.Function("f", symbols, [model.torque(p, *symbols)]) for key, p in given.items()}
    torque = {key: np.array(function(*state)).ravel() for key, function in functions.items()}
    Y = np.array(ca.Function("Y", symbols, [model.rows(*symbols)])(*state))
    np.testing.assert_allclose(torque["a"], Y @ a, rtol=1e-10)
    np.testing.assert_allclose(torque["both"], 2 * torque["a"] - 3 * torque["b"], rtol=1e-9)


@pytest.mark.parametrize("name", ["ur10e", "irp6", "irp6 axes 1-3"])
def test_identified_base_parameters_are_carried_as_their_standard_ones(name: str) -> None:
    """Standard parameters of random, impossible base parameters reproduce their torques, and load the drives so."""
    robot = built_in(name.partition(" ")[0])
    robot = with_locked_joints(robot, [0, 1, 2]) if "axes" in name else robot
    model = DifferentialModel(robot, Terms(offset=True))
    base, samples = base_parameters(model), random_states(robot, 20, seed=2)
    beta = np.random.default_rng(3).normal(size=base.rank)
    standard = standard_of(model, base, beta)
    assert min(standard.values()) < 0.0
    rigid = np.array([base.columns[k].group != "friction" for k in base.index])
    torque = (model.instants(samples)[:, base.index[rigid]] @ beta[rigid]).reshape(20, -1)
    C = coupling(robot)[: robot.n, : robot.n]
    load = torque @ np.linalg.inv(C)
    loaded = DifferentialModel(robot, Terms(load_share=True), carried=standard)
    for (kind, owner), column in columns_of(loaded, samples).items():
        if kind == "load share":
            expected = np.outer(np.abs(load[:, owner - 1]) * np.sign(samples.dq @ C[owner - 1]), np.ones(robot.n))
            np.testing.assert_allclose(column, expected * C[owner - 1], atol=1e-9 * np.abs(load).max())


def test_other_forms_keep_what_they_carry() -> None:
    robot = built_in("irp6")
    heavy = {name: 3.0 * value for name, value in standard_values(robot).items()}
    terms = Terms(load_share=(1, 2), rotor=False, offset=(5,))
    model = DifferentialModel(robot, terms, carried=heavy)
    samples = random_states(robot, 10)
    plain = columns_of(DifferentialModel(robot, terms), samples)
    for form in (model, model.softened(0.0), model.on(robot), SpringModel(robot, terms, carried=heavy)):
        assert form.options["carried"] == heavy
        for key, column in columns_of(form, samples).items():
            np.testing.assert_allclose(column, (3.0 if key[0] == "load share" else 1.0) * plain[key], rtol=1e-9)
    part = model.restricted(of_joints(robot, [1]))
    np.testing.assert_allclose(part.instants(samples), model.instants(samples)[1::5], rtol=1e-12)
    three = with_locked_joints(built_in("ur10e"), [0, 1, 2])
    moved = DifferentialModel(built_in("ur10e"), Terms(load_share=(1, 5))).on(three)
    assert [c.name for c in moved.columns if c.kind == "load share"] == ["F1l"]


def test_energy_is_the_integral_of_the_power() -> None:
    """Rates of the energy model are the power of the same friction, column by column."""
    robot = built_in("ur10e")
    terms = Terms(offset=(2,), root=(1, 3), asymmetry=True, stribeck=(2,))
    energy, torque = EnergyModel(robot, terms), DifferentialModel(robot, terms)
    samples = random_states(robot, 20)
    power = np.einsum("ti,tip->tp", samples.dq, torque.instants(samples).reshape(20, robot.n, -1))
    np.testing.assert_allclose(energy.instants(samples), power, atol=1e-9 * np.abs(power).max())


UNKNOWN = built_in("iiwa7")
KNOWN = standard_values(built_in("ur10e"))
REFUSED = {
    "a drive that is none": (lambda: Terms(load_share=(0,)), "numbers of drives from 1 on"),
    "a stribeck speed of zero": (lambda: Terms(stribeck_speed=0.0), "greater than zero"),
    "a drive that is not there": (lambda: DifferentialModel(built_in("ur10e"), Terms(root=(7,))), "no drive named '7'"),
    "unknown masses": (lambda: DifferentialModel(UNKNOWN, Terms(load_share=True)), "argument carried in Python"),
    "a carried parameter that is none": (
        lambda: DifferentialModel(built_in("ur10e"), Terms(load_share=True), carried={**KNOWN, "m9": 1.0}),
        "no standard parameter named 'm9'",
    ),
    "a body left out": (
        lambda: DifferentialModel(
            built_in("ur10e"), Terms(load_share=True), carried={k: v for k, v in KNOWN.items() if k != "I3yy"}
        ),
        "I3yy",
    ),
    "a load in the energy model": (lambda: EnergyModel(built_in("ur10e"), Terms(load_share=True)), "`load_share`"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_refused_in_words(case: str) -> None:
    build, message = REFUSED[case]
    assert re.search(message, refusal(build))


SOME, EVERY = Terms(coulomb=(1, 3), viscous=(2,), offset=(2, 3)), Terms(offset=True)
ROBOTS = {"irp6": with_locked_joints(built_in("irp6"), [0, 1, 2]), "panda": built_in("panda")}


def model(kind: str, robot: Robot, terms: Terms) -> RegressorModel:
    if kind == "differential":
        return DifferentialModel(robot, terms)
    return EnergyModel(robot, terms, Window("short", 0.1), sign_width=0.1 if kind == "smooth energy" else 0.0)


@pytest.mark.parametrize("kind", ["differential", "energy", "smooth energy"])
@pytest.mark.parametrize("name", list(ROBOTS))
def test_columns_of_some_drives_are_those_of_all(kind: str, name: str) -> None:
    robot = ROBOTS[name]
    some, every = (model(kind, robot, terms) for terms in (SOME, EVERY))
    samples = random_sines(robot.n, np.random.default_rng(2)).samples(np.linspace(0.0, 1.0, 101))
    wanted = [name for name in every.names if not name.startswith("F") or name in ("F1c", "F3c", "F2v", "F2o", "F3o")]
    assert list(some.names) == wanted
    expected = every.assemble(samples)[:, [every.names.index(name) for name in wanted]]
    np.testing.assert_allclose(some.assemble(samples), expected, atol=1e-12)
