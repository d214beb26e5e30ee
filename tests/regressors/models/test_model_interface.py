"""The interface of the models: what the built-in ones say of themselves, and what a model of one's own gets for it."""

from __future__ import annotations

import pickle
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from motions import Sines
from refused import refusal
from slow_dynamics import general, three_axes

from excite.identification.equations import equations_of, friction_drives, put_friction
from excite.identification.estimator import Context
from excite.identification.estimators.least_squares import weighted, weighting
from excite.identification.estimators.possible_set import standard_problem
from excite.identification.preparation import prepare
from excite.identification.presliding import presliding_note, with_presliding
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.logs.log import Log
from excite.simulation.plant import ModelMotion
from regressors.errors import InputError, UnknownName
from regressors.jax_models import JaxModel
from regressors.models.base import Base, base_parameters
from regressors.models.differential import DifferentialModel
from regressors.models.energy import EnergyModel
from regressors.models.load import LoadIntegralModel, LoadModel, Sensor
from regressors.models.model import PartialModel, RegressorModel
from regressors.models.nominal import parameter_values, standard_values
from regressors.models.partial import of_drives, of_joints
from regressors.models.reduction import Reduction, standard_columns
from regressors.models.windows import Window
from regressors.readers.library import built_in
from regressors.robot.columns import Column, Terms
from regressors.robot.friction.load_and_temperature import friction_rows
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Robot, Structure
from regressors.samples import Array, Samples

ROBOTS = ("irp6", "irp6-full", "panda", "ur10e", "iiwa7", "so101")
SENSOR = Sensor(translation=np.array([0.0, 0.01, 0.1]), equations=("fx", "nz"))
PERIOD = 2.0


@cache
def plain() -> Robot:
    """The three axes without named combinations of parameters."""
    return general(three_axes())


def spring_columns(robot: Robot) -> tuple[Column, ...]:
    return tuple(Column(f"K{k}", "Nm/rad", "stiffness", k) for k in robot.link_numbers)


class SprungModel(DifferentialModel):
    """The differential model with a spring at every joint: one class, its columns and its rows."""

    def __init__(self, robot: Robot, terms: Terms | None = None, *, sign_width: float = 0.0) -> None:
        super().__init__(robot, terms, sign_width=sign_width)
        self.columns = (*self.columns, *spring_columns(robot))

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        return ca.horzcat(super().rows(q, dq, ddq), ca.diag(q))


class SpringsAlone(RegressorModel):
    """Springs and Coulomb friction, and nothing else: as few lines as a model of joint torques can have."""

    rows_are_joint_torques = True

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        friction = tuple(Column(f"F{k}c", "Nm", "coulomb", k) for k in robot.link_numbers)
        self.columns = (*spring_columns(robot), *friction)
        self.row_labels = tuple((name, "Nm") for name in robot.joint_names)

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        C = ca.DM(np.eye(self.robot.n) if self.robot.transmission is None else self.robot.transmission.coupling[:3])
        return ca.horzcat(ca.diag(q), ca.mtimes(C.T, ca.diag(ca.sign(ca.mtimes(C, dq)))))


class Height(RegressorModel):
    """One number per instant that is no torque."""

    columns = (Column("h", "m", "height"),)
    row_labels = (("height", "m"),)

    def __init__(self, robot: Robot) -> None:
        self.robot = robot

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        return ca.SX(ca.sin(q[0]))


class TiedSprings(SprungModel):
    """A constructor that takes one thing more says so in its options."""

    def __init__(self, robot: Robot, terms: Terms | None = None, *, sign_width: float = 0.0, size: float = 1.0) -> None:
        super().__init__(robot, terms, sign_width=sign_width)
        self.size = size

    @property
    def options(self) -> dict[str, Any]:
        return {**super().options, "size": self.size}


def built_in_models() -> list[RegressorModel]:
    robot, terms, window = three_axes(), Terms(offset=True), Window("short", 0.02)
    whole = DifferentialModel(robot, terms, sign_width=0.01)
    return [
        whole,
        EnergyModel(robot, terms, window),
        EnergyModel(robot, window=Window("long")),
        LoadModel(built_in("ur10e"), SENSOR),
        LoadIntegralModel(built_in("ur10e"), SENSOR, window),
        PartialModel(whole, of_drives(robot, ["2"]), ["z2"]),
    ]


def own_models() -> list[RegressorModel]:
    return [SprungModel(plain()), SpringsAlone(plain()), Height(plain()), TiedSprings(plain(), size=3.0)]


def kind(model: RegressorModel) -> str:
    return type(model).__name__


def motion(robot: Robot, count: int = 401, step: float = PERIOD / 400, seed: int = 0) -> Samples:
    rng = np.random.default_rng(seed)
    amplitude = 0.15 * rng.uniform(0.4, 1.0, (robot.n, 3))
    centre, phase = 0.1 * rng.normal(size=robot.n), rng.uniform(0, 2 * np.pi, (robot.n, 3))
    sines = Sines(centre, amplitude, 2 * np.pi / PERIOD * np.arange(1, 4), phase)
    return sines.samples(np.arange(count) * step)


# --- pickling --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", [*built_in_models(), *own_models()], ids=kind)
def test_models_come_back_from_pickles_with_the_same_rows(model: RegressorModel) -> None:
    samples = motion(model.robot)
    rows, W = model.instants(samples), model.assemble(samples)  # compiled by now
    again = pickle.loads(pickle.dumps(model))
    np.testing.assert_array_equal(again.instants(samples), rows)
    np.testing.assert_array_equal(again.assemble(samples), W)
    assert again.columns == model.columns
    assert again.definition()[1] == model.definition()[1]
    np.testing.assert_array_equal(again.definition()[0], model.definition()[0])


# --- columns ---------------------------------------------------------------------------------------------------------


def test_combinations_of_the_structure_belong_to_no_body_and_loads_to_none_of_the_robot() -> None:
    columns = DifferentialModel(three_axes()).columns
    assert {(c.kind, c.owner) for c in columns[:7]} == {("combination", None)}
    assert [(c.name, c.kind, c.owner) for c in columns[7:10]] == [(f"F{k}c", "coulomb", k) for k in (1, 2, 3)]
    assert {c.owner for c in LoadModel(built_in("irp6")).columns} == {None}


@pytest.mark.parametrize("name", ROBOTS)
def test_values_of_parameters_are_those_that_their_columns_stand_for(name: str) -> None:
    """Standard parameters that columns stand for have these values again, shared, reflected and combined ones too."""
    equal = built_in(name).replace(structure=Structure(equal=(("m1", "m2"), ("I1xx", "I2xx", "I2yy"))))
    for robot in (built_in(name), equal):
        composition = DifferentialModel(robot).composition
        identity = composition.definition @ composition.matrix
        np.testing.assert_allclose(identity, np.eye(len(composition.columns)), atol=1e-9)


def test_a_structure_may_name_what_a_model_leaves_out_but_nothing_that_the_robot_lacks() -> None:
    known = Structure(zero=frozenset({"Ia1", "F2c"}))
    without = DifferentialModel(plain().replace(structure=known), Terms.inertial_only())
    assert without.names == DifferentialModel(plain(), Terms.inertial_only()).names
    assert {"Ia5", "F5o"} <= {column.name for column in standard_columns(built_in("irp6"))}
    for name in ("F9c", "Ia0", "F1x", "m7"):
        with pytest.raises(UnknownName, match=f"no parameter named '{name}'"):
            DifferentialModel(plain().replace(structure=Structure(zero=frozenset({name}))))


def test_a_name_decides_nothing() -> None:
    """The same model under other names has the same base, friction and positive parameters."""

    class Renamed(DifferentialModel):
        def __init__(self, robot: Robot) -> None:
            super().__init__(robot)
            old = self.reduction
            self.columns = tuple(map(renamed, old.columns))
            self.reduction = Reduction(tuple(map(renamed, old.standard)), self.columns, old.matrix, old.definition)

    def renamed(column: Column) -> Column:
        return Column(f"p_{column.kind}_{column.owner}_{column.name[-1]}"[::-1], column.unit, column.kind, column.owner)

    ours, theirs = DifferentialModel(plain()), Renamed(plain())
    bases = [base_parameters(model, "pivoted") for model in (ours, theirs)]
    np.testing.assert_array_equal(bases[0].index, bases[1].index)
    targets = [subject_of(model) for model in (ours, theirs)]
    samples = motion(plain())
    for one, other in zip(*(vars(friction_drives(target, samples)).values() for target in targets), strict=True):
        np.testing.assert_array_equal(one, other)
    assert len(friction_drives(targets[1], samples).columns) == 3
    said = [presliding_note(Recipe(), target, known=False) for target in targets]
    assert said[0] == said[1] != ()
    positive = [problem_of(target).positive for target in targets]
    np.testing.assert_array_equal(*positive)
    assert len(positive[0]) == 9
    assert [body.name for body in problem_of(targets[1]).bodies] == [f"link {link.name}" for link in plain().links]


def subject_of(model: RegressorModel) -> IdentificationTarget:
    moved = of_joints(model.robot, range(model.robot.n))
    return IdentificationTarget(model.robot, moved, model, base_parameters(model), {})


def observations_of(target: IdentificationTarget, beta: Array) -> tuple[Any, Context]:
    """Equations of a log that the model made itself."""
    samples = motion(target.robot, 400)
    torque = (target.model.assemble(samples)[:, target.base.index] @ beta).reshape(samples.time.size, -1)
    log = Log("LOG", "0", target.robot.joint_names, samples.time, samples.q, samples.dq, torque, None)
    recipe = Recipe(signals="fourier", period=PERIOD, harmonics=3, rows="all", sign_width=0.0, breakaway=0.0)
    part = prepare(log, target.robot, target, recipe)
    return equations_of(target, part, recipe), Context(target, (part,), recipe)


def problem_of(target: IdentificationTarget) -> Any:
    observations, _ = observations_of(target, np.ones(target.base.rank))
    return standard_problem(weighting(observations), target.model, target.base)


# --- models of one's own ---------------------------------------------------------------------------------------------


def truth(model: RegressorModel, base: Base) -> Array:
    """Base parameters of the description, with springs of 30, 40, 50 Nm/rad."""
    springs = {c.name: 20.0 + 10.0 * (c.owner or 0) for c in model.columns if c.kind == "stiffness"}
    rotors = {c.name: 1e-4 for c in model.standard_columns if c.kind == "rotor"}
    return parameter_values(model, base, {**rotors, **springs, **standard_values(built_in("irp6"))})


@pytest.mark.parametrize("robot", [plain(), three_axes()], ids=["standard", "combinations"])
def test_columns_that_a_subclass_adds_are_parameters_of_their_own(robot: Robot) -> None:
    bare, sprung = DifferentialModel(robot), SprungModel(robot)
    base, expected = base_parameters(sprung), base_parameters(bare)
    assert base.names == (*expected.names, "K1", "K2", "K3")
    assert base.expressions == (*expected.expressions, "K1", "K2", "K3")
    assert sprung.standard_columns == (*bare.standard_columns, *spring_columns(robot))
    assert {column.group for column in sprung.columns[-3:]} == {"other"}
    definition, names = sprung.definition()
    assert names[-3:] == ("K1", "K2", "K3")
    np.testing.assert_array_equal(definition[-3:, -3:], np.eye(3))
    assert not definition[-3:, :-3].any()


@pytest.mark.parametrize("model", [SprungModel(three_axes()), SpringsAlone(plain())], ids=kind)
def test_a_model_of_joint_torques_is_restricted_to_what_moves(model: RegressorModel) -> None:
    robot = model.robot
    assert model.restricted(of_joints(robot, range(3))) is model
    moved = of_drives(robot, ["2", "3"])
    seen = model.restricted(moved, ["z3"])
    samples = motion(robot, 20)
    Y = model.instants(samples).reshape(20, 3, -1)
    expected = np.einsum("j,ijp->ip", moved.matrix[:, 1], Y)
    np.testing.assert_allclose(seen.instants(samples), expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(seen.speeds(samples)[:, 0], samples.dq @ np.linalg.pinv(moved.matrix)[1])
    assert seen.restricted(moved).row_labels == (("z2", "Nm"), ("z3", "Nm"))
    assert seen.channel == "effort"
    equations = seen.torque_equations()
    assert equations.model is model
    assert equations.unused == ("z2",)
    whole = model.torque_equations()
    assert (whole.unused, whole.every_joint) == ((), True)
    np.testing.assert_array_equal(model.speeds(samples), samples.dq)


@pytest.mark.parametrize("model", [SprungModel(three_axes()), SpringsAlone(plain())], ids=kind)
@pytest.mark.parametrize("drives", [None, ["2"], ["1", "3"]])
def test_coulomb_columns_are_their_drives_directions(model: RegressorModel, drives: list[str] | None) -> None:
    seen = model if drives is None else model.restricted(of_drives(model.robot, drives))
    samples = motion(model.robot, 50)
    friction = seen.coulomb_friction()
    W = seen.assemble(samples).reshape(50, len(seen.row_labels), -1)
    expected = np.sign(samples.dq @ friction.coupling.T)[:, None, :] * friction.rows.T
    np.testing.assert_allclose(W[:, :, friction.columns], expected, atol=1e-12)
    assert [seen.columns[k].name for k in friction.columns] == ["F1c", "F2c", "F3c"]


def test_a_coulomb_column_that_drives_share_is_the_sum_of_theirs() -> None:
    robot = plain().replace(structure=Structure(equal=(("F1c", "F2c"),)))
    target = subject_of(DifferentialModel(robot))
    samples = motion(robot, 60)
    drives = friction_drives(target, samples)
    columns = list(drives.columns)
    assert [target.base.names[k] for k in columns] == ["F1c", "F1c", "F3c"]
    W = target.model.assemble(samples)[:, target.base.index].reshape(60, 3, -1)
    filled = np.full_like(W, np.nan)
    torque = drives.torque(np.sign(samples.dq @ friction_rows(robot).T))
    put_friction(filled, drives.columns, torque, drives.rows)
    np.testing.assert_allclose(filled[:, :, columns], W[:, :, columns], atol=1e-12)


def test_other_forms_of_a_model_keep_its_class_and_its_options() -> None:
    model = TiedSprings(plain(), Terms(offset=True), sign_width=0.1, size=3.0)
    locked = model.on(with_locked_joints(plain(), [1, 2]))
    soft = model.softened(0.5)
    for form in (locked, soft):
        assert (type(form), form.size, form.terms) == (TiedSprings, 3.0, Terms(offset=True))
    assert (locked.sign_width, soft.sign_width) == (0.1, 0.5)
    assert locked.names[-2:] == ("K2", "K3")
    assert model.instantaneous() is model
    assert model.with_window(Window()) is model
    assert SpringsAlone(plain()).softened(0.5).names == SpringsAlone(plain()).names
    assert kind(SpringsAlone(plain()).on(with_locked_joints(plain(), [0]))) == "SpringsAlone"


def test_equations_that_are_no_torques_are_left_as_they_are() -> None:
    model = Height(plain())
    samples = motion(plain(), 5)
    assert model.restricted(of_drives(plain(), ["2"]), ["z2"]) is model
    assert model.torque_equations() is None
    assert model.coulomb_friction() is None
    np.testing.assert_array_equal(model.speeds(samples), np.full((5, 1), np.nan))
    assert model.softened(0.1) is model
    assert base_parameters(model).names == ("h",)
    assert "one row per joint, given Height with 1" in refusal(PartialModel, model, of_joints(plain(), [0]))
    with pytest.raises(InputError, match="model of their torques, one row per joint, given LoadModel with 6"):
        PartialModel(LoadModel(built_in("ur10e")), of_joints(built_in("ur10e"), [0]))
    assert "Height has no friction torque at every instant" in refusal(friction_drives, subject_of(model), samples)


def test_springs_are_identified_from_a_log_as_everything_else_is() -> None:
    model = SprungModel(three_axes())
    target = subject_of(model)
    beta = truth(model, target.base)
    observations, context = observations_of(target, beta)
    estimate = weighted(observations)
    np.testing.assert_allclose(estimate.values, beta, rtol=1e-8)
    assert dict(zip(estimate.names, estimate.values, strict=True))["K3"] == pytest.approx(50.0)
    turning = with_presliding(Recipe(), target, context.prepared, None)
    assert (turning.sign_width, turning.breakaway) == (0.0, 0.0)


def test_a_motion_under_springs_is_replayed_by_the_models_own_rows() -> None:
    model = SprungModel(three_axes(), Terms(coulomb=False))
    base = base_parameters(model)
    beta = truth(model, base)
    samples = motion(model.robot, 10)
    tau = (model.assemble(samples)[:, base.index] @ beta).reshape(10, 3)
    rate = ModelMotion(model, beta, base, None).function(0.1)
    moved, _ = rate(np.hstack([samples.q, samples.dq]).T, tau.T)
    np.testing.assert_allclose(moved[3:].T, samples.ddq, rtol=1e-8, atol=1e-8)


# --- windows, and forms of the built-in models -----------------------------------------------------------------------


def test_models_over_windows_say_what_they_integrate() -> None:
    energy = EnergyModel(three_axes(), Terms(offset=True), sign_width=0.2)
    load = LoadIntegralModel(built_in("ur10e"), SENSOR)
    instant = energy.instantaneous()
    assert (instant.columns, instant.sign_width) == (energy.columns, 0.2)
    samples = motion(three_axes(), 20)
    power = np.einsum("ij,ijp->ip", samples.dq, instant.instants(samples).reshape(20, 3, -1))
    np.testing.assert_allclose(energy.instants(samples), power, rtol=1e-9, atol=1e-9)
    assert load.instantaneous().sensor is SENSOR
    assert load.channel == load.instantaneous().channel == "wrench"
    assert load.keeps_all_links is load.instantaneous().keeps_all_links is True


def test_a_subclass_does_not_pass_for_what_its_parent_integrates() -> None:
    class Further(EnergyModel):
        def __init__(self, robot: Robot) -> None:
            super().__init__(robot)
            self.columns = (*self.columns, Column("K", "Nm/rad", "stiffness"))

    assert "Further does not name the model" in refusal(Further(plain()).instantaneous)


def test_windows_fit_the_samples_of_a_log() -> None:
    assert Window("short", 0.005, 0.013).fitted(0.004) == Window("short", 0.004, 0.012)
    assert Window("short", 0.005).fitted(0.01) == Window("short", 0.01)
    assert Window("long", 0.005).fitted(0.004) == Window("long", 0.005)
    model = EnergyModel(three_axes(), Terms(offset=True), Window("short", 0.02), sign_width=0.1)
    other = model.with_window(Window("long"))
    assert isinstance(other, EnergyModel)
    assert (other.window, other.terms, other.sign_width) == (Window("long"), model.terms, 0.1)
    samples = motion(three_axes())
    np.testing.assert_allclose(model.row_times(samples.time), np.arange(1, 101) * 0.02)
    np.testing.assert_array_equal(DifferentialModel(plain()).row_times(samples.time), samples.time)


def test_a_partial_model_passes_changes_on_to_the_model_that_it_sees() -> None:
    whole = DifferentialModel(three_axes(), sign_width=0.0)
    seen = PartialModel(whole, of_drives(three_axes(), ["2", "3"]), ["z3"])
    soft = seen.softened(0.3)
    assert (kind(soft), soft.row_labels, soft.model.options["sign_width"]) == ("PartialModel", seen.row_labels, 0.3)
    other = seen.on(plain())
    assert other.robot is plain()
    assert other.names == DifferentialModel(plain()).names
    assert seen.instantaneous() is seen
    with pytest.raises(InputError, match="3 joints needs a model of their torques, one row per joint"):
        seen.on(with_locked_joints(plain(), [1, 2]))


# --- JAX -------------------------------------------------------------------------------------------------------------


def test_a_form_in_jax_is_not_inherited() -> None:
    assert DifferentialModel.jax_form is not None
    assert SprungModel.jax_form is None
    for model in (SprungModel(plain()), SprungModel(plain()).restricted(of_joints(plain(), [0]))):
        assert "SprungModel has no JAX form" in refusal(JaxModel, model)
