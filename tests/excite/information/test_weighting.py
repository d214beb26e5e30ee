"""Criteria of rows weighted by noise, with prior knowledge and scaled columns, against slow statistics."""

from __future__ import annotations

import json

import numpy as np
import pytest
from commands import Here, content_of
from refused import refusal
from written_files import text_file

from excite.cli.streams import in_options
from excite.design.comparison import compare
from excite.design.design_json import load_design
from excite.design.formulation import Formulation, formulate
from excite.design.initial_guesses import random_motion
from excite.design.task_file import read_task_file, task_content, task_from_options
from excite.information.prior import prior_of
from excite.information.target import target_of
from excite.information.weighting import known_with
from excite.registry import instance
from excite.tasks.friction_file import read_prior
from excite.tasks.objective import Belief
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.models.nominal import parameter_values, standard_values, stated_deviations
from regressors.readers.library import load_robot
from regressors.samples import Array, Samples

KNOWN = (Belief("X7", 8.125, 0.5), Belief("m3c3x", 0.59, 0.1), Belief("F2c", 28.75, 4.0))
PIVOTED = {"base": "pivoted", "friction": False, "noise": (0.5, 2.0, 1.0, 4.0, 0.2, 0.1, 0.3)}
TASKS = {
    "weighted": Task("irp6", noise=(0.5, 8.0, 2.0), weighted=True),
    "pivoted": Task("panda", **PIVOTED, weighted=True, criterion="trace"),
    "orthonormal": Task("irp6", joints=tuple("12345"), base="orthonormal", noise=(1, 2, 3, 4, 5), prior=0.1),
    "prior": Task("irp6", noise=(0.5, 8.0, 2.0), prior=0.3, criterion="sigma-min", scale="prior"),
    "some known": Task("irp6", noise=(0.5, 8.0, 2.0), prior=KNOWN, criterion="logdet"),
    "value": Task("irp6", scale="value", criterion="sigma-min"),
    "value, pivoted": Task("panda", **PIVOTED, prior=0.2, scale="value", criterion="sigma-min"),
    "one joint": Task("irp6", joints=("3",), noise=(0.7,), prior=0.2, scale="prior", criterion="frobenius"),
    "energy": Task("irp6", model="energy", noise=(0.1,), prior=0.2, scale="prior"),
    "load": Task("irp6", model="load", noise=(2.0, 2.0, 1.0, 0.1, 0.2, 0.3), weighted=True, period=5.0),
    "load-integral": Task("irp6", model="load-integral", noise=(2.0, 2.0, 1.0, 0.1, 0.2, 0.3), weighted=True, period=5),
}


@pytest.fixture(scope="module", params=TASKS)
def made(request: pytest.FixtureRequest) -> Formulation:
    task = TASKS[request.param]
    return formulate(load_robot(task.robot), task)


def motion(made: Formulation, seed: int = 0) -> Array:
    return random_motion(made.problem, np.random.default_rng(seed))


def written(made: Formulation, x: Array) -> Samples:
    """The motion at the instants at which it is judged."""
    trajectory = made.problem.information.trajectory(x)
    return trajectory.samples(made.target.model.times(made.task.trajectory.period, made.task.output.rate))


def slow_deviations(made: Formulation) -> dict[str, float]:
    """Deviations of standard parameters of the IRp-6 or Panda, link by link."""
    prior, found = made.task.objective.prior, {}
    if isinstance(prior, tuple):
        return {belief.name: belief.deviation for belief in prior}
    if prior is None:
        return {}
    known = standard_values(made.target.robot)
    for name, value in known.items():
        link, kind = "".join(c for c in name[1:] if c.isdigit())[:1], name[0]
        if kind == "m" and "c" in name:
            size = np.sqrt(sum(known[f"m{link}c{link}{axis}"] ** 2 for axis in "xyz"))
        elif kind == "I" and name[1] != "a":
            tensor = [[known[f"I{link}{''.join(sorted(a + b))}"] for b in "xyz"] for a in "xyz"]
            size = np.linalg.norm(tensor, 2)
        else:
            size = abs(value)
        found[name] = prior * float(size)
    names = made.target.model.definition()[1]
    return {name: deviation for name, deviation in found.items() if deviation and name in names}


def slow_covariance(made: Formulation, samples: Samples) -> Array:
    """Covariance of the wanted base parameters: every row, and every prior value, is one scalar equation in u."""
    model, task = made.target.model, made.task
    definition, names = model.definition()
    definition = definition.copy()
    deviations = slow_deviations(made)
    for name in deviations:
        if name not in names:  # a column that is known as such
            row = model.names.index(name)
            definition[row] = 0.0
            definition, names = np.column_stack([definition, np.eye(len(definition))[row]]), (*names, name)
    equations = []
    by_noise = task.objective.weighted or task.objective.prior is not None
    noise = task.objective.noise if by_noise and task.objective.noise else (1.0,) * len(model.row_labels)
    for k, row in enumerate(model.assemble(samples) @ definition):
        equations.append(row / noise[k % len(noise)])
    equations += [np.eye(len(names))[names.index(name)] / s for name, s in deviations.items()]
    to_wanted = np.linalg.inv(made.target.transforms[task.objective.base]) @ made.target.base.D @ definition
    sizes = np.linalg.norm(equations, axis=0)
    sizes[sizes < 1e-10 * sizes.max()] = np.inf
    R = np.linalg.qr(np.array(equations) / sizes, mode="r")
    root = (to_wanted / sizes) @ np.linalg.pinv(R, rcond=1e-11)
    return np.asarray(root @ root.T)


def slow_scale(made: Formulation) -> Array:
    """What each wanted parameter is measured in."""
    target, task = made.target, made.task
    T = target.transforms[task.objective.base]
    if task.objective.scale == "unit":
        return np.ones(len(T))
    known = standard_values(target.robot)
    if task.objective.scale == "value":
        return np.abs(np.linalg.inv(T) @ parameter_values(target.model, target.base, known))
    definition, names = target.model.definition()
    deviations = slow_deviations(made)
    to_wanted = np.linalg.inv(T) @ target.base.D @ definition
    squares = [sum((a * deviations[n]) ** 2 for a, n in zip(row, names, strict=True) if a) for row in to_wanted]
    return np.sqrt(squares)


def test_information_is_the_inverse_of_the_covariance_of_all_that_is_known(made: Formulation) -> None:
    """``M = inverse(N covariance)`` with parameters measured in their scale, whatever the columns and the prior."""
    problem, x = made.problem, motion(made)
    samples, scale = written(made, x), slow_scale(made)
    N = len(made.target.model.assemble(samples)) / len(made.target.model.row_labels)
    covariance = slow_covariance(made, samples) / np.outer(scale, scale)
    M = problem.objective.matrix(problem.objective.exact_matrix(x))
    sizes = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    np.testing.assert_allclose(np.linalg.inv(M) / N / sizes, covariance / sizes, atol=2e-5)
    assert problem.exact_value(x) == instance("criterion", made.task.objective.criterion).value(M)
    if made.task.objective.criterion == "sigma-min":  # the largest relative deviation of any combination of parameters
        assert problem.exact_value(x) == pytest.approx(np.sqrt(N * np.linalg.norm(covariance, 2)), rel=1e-5)


def test_gradient_is_that_of_finite_differences(made: Formulation) -> None:
    problem, x = made.problem, motion(made, 2)
    rng = np.random.default_rng(3)
    for sharpness in problem.criterion.stages[:2]:
        gradient = problem.gradient(problem.point(x, sharpness))
        direction = rng.normal(size=x.shape)
        direction /= np.abs(direction).max()
        found, slopes = np.sum(gradient * direction), []
        for h in (1e-5, 1e-4, 1e-3):  # rounding spoils small steps, curvature large ones
            value = [problem.point(x + k * h * direction, sharpness).value for k in (-2, -1, 1, 2)]
            slopes.append((8 * (value[2] - value[1]) - (value[3] - value[0])) / (12 * h))
        nearest = min(slopes, key=lambda slope: abs(slope - found))
        assert found == pytest.approx(nearest, rel=1e-4, abs=2e-6)


def test_deviations_after_the_experiment(made: Formulation) -> None:
    samples = written(made, motion(made, 4))
    found = known_with(made.target, made.task, samples)
    if made.task.objective.prior is None:
        assert found == ()
        return
    if made.task.objective.base == "gautier":
        expected = np.sqrt(np.diag(slow_covariance(made, samples)))
        assert [known.after for known in found] == pytest.approx(expected, rel=1e-5)
    assert [known.name for known in found] == list(made.target.base.names)
    assert all(known.deviation is None or known.after <= known.deviation * (1 + 1e-9) for known in found)


def test_noise_for_predictions_alone_leaves_the_criterion_as_it_is() -> None:
    robot = load_robot("irp6")
    plain, noisy = formulate(robot, Task("irp6")), formulate(robot, Task("irp6", noise=(0.5, 8.0, 2.0)))
    x = motion(plain)
    assert noisy.problem.exact_value(x) == plain.problem.exact_value(x)


@pytest.mark.parametrize("robot", ["irp6", "panda", "ur10e"])
def test_stated_deviations_belong_to_whole_quantities(robot: str) -> None:
    described = load_robot(robot)
    found, half = stated_deviations(described, 0.2), stated_deviations(described, 0.1)
    values = standard_values(described)
    assert {name: 2 * s for name, s in half.items()} == pytest.approx(found)
    assert set(values) - set(found) == {n for n, v in values.items() if v == 0.0} - set(found)
    for name, deviation in found.items():
        assert deviation >= 0.2 * abs(values[name]) * (1 - 1e-12)
    assert len({found[f"m2c2{axis}"] for axis in "xyz"}) == 1
    assert len({found[f"I2{pair}"] for pair in ("xx", "xy", "xz", "yy", "yz", "zz")}) == 1


def test_what_nothing_is_known_of_stays_unknown() -> None:
    target = target_of(load_robot("irp6"), Task("irp6", offset=True))
    prior, rank = prior_of(target.model, target.base, 0.2), target.base.rank
    offsets = [k for k, name in enumerate(target.base.names) if name.endswith("o")]
    assert len(offsets) == 3
    np.testing.assert_allclose(prior.precision[offsets], 0.0, atol=1e-12)
    assert np.flatnonzero(np.isinf(prior.base_deviations(np.eye(rank)))).tolist() == offsets
    assert np.linalg.matrix_rank(prior.precision) == rank - 3


REFUSED = (
    ({"weighted": True}, "--weighted divides rows by the noise of their equations, which is not given; give --noise"),
    ({"scale": "prior"}, "--scale prior needs prior knowledge, but none is given; give --prior"),
    ({"scale": "inch"}, "no scale named 'inch'; available: unit, prior, value"),
    ({"scale": "value", "base": "orthonormal"}, "columns of the orthonormal base are not single parameters"),
    ({"prior": 0.2, "scale": "prior", "offset": True}, "no prior deviation is known for F1o, F2o, F3o"),
    ({"scale": "value", "offset": True}, "scale value: values are zero or not known for F1o, F2o, F3o"),
    ({"prior": 0.2, "model": "load"}, "prior: the description of 'irp6' states no parameter of this model; give"),
    ({"prior": (Belief("X9", 1.0, 1.0),)}, "no parameter named 'X9'; available: X1, X2"),
    ({"weighted": True, "noise": (1.0, 2.0)}, "noise needs one value, or 3 for q1, q2, q3; given 2"),
)


def test_what_cannot_be_weighted_is_refused() -> None:
    for task, message in REFUSED:
        with pytest.raises((InputError, UnknownName)) as refused:
            formulate(load_robot("irp6"), Task("irp6", **task))
        assert message in in_options(str(refused.value))
    for value, deviation in ((1.0, 0.0), (1.0, -1.0), (np.nan, 1.0), (1.0, np.inf)):
        with pytest.raises(InputError, match=r"`prior`: the (value|deviation) of X7 must be a number from"):
            Belief("X7", value, deviation)


# --- files and commands ----------------------------------------------------------------------------------------------

QUICK = "design irp6 --starts 2 --harmonics 3 --executor serial --noise 1,0.1,10 --criterion trace"
KNOWN_YAML = "X7: {value: 8.125, deviation: 0.5}\nm3c3x: {value: 0.59, deviation: 0.1}\n"


def test_tasks_survive_json() -> None:
    for task in TASKS.values():
        assert task_from_options(json.loads(json.dumps(task_content(task)))).objective == task.objective


@pytest.mark.slow
def test_command(here: Here) -> None:
    """Designing for the weighted criterion pays under the weighted criterion, and the files say what was minimised."""
    (here.cwd / "known.yaml").write_text(KNOWN_YAML)
    content = {}
    for name, typed in {"plain": (), "weighted": ("--weighted",), "known": ("--prior", "known.yaml")}.items():
        ended = here.run(*QUICK.split(), "-v", "--out", name, *typed, status=0)
        assert ("known beforehand" in ended.stdout) == (name == "known")
        content[name] = content_of(here.cwd / name)
    weighted, known = content["weighted"], content["known"]
    assert weighted["minimised"] == "trace, base gautier, rows divided by their noise"
    assert weighted["task"]["weighted"] is True
    assert weighted["predicted"]["prior"] == []
    assert known["task"]["prior"]["X7"] == {"value": 8.125, "deviation": 0.5}
    before = {one["name"]: one for one in known["predicted"]["prior"]}
    assert before["X7"]["after"] < before["X7"]["deviation"] == pytest.approx(0.5)
    assert before["X1"]["deviation"] is None
    values = {name: each["criteria"]["trace_inverse_noise_weighted"] for name, each in content.items()}
    assert values["weighted"] < 0.5 * values["plain"]
    best, least = (min(start["value"] for start in each["solver"]["starts"]) for each in (weighted, known))
    assert best == pytest.approx(np.sqrt(1001 * values["weighted"]), rel=1e-9)
    found = compare([load_design(here.cwd / name) for name in ("known", "plain")])
    assert found[0].goal == min(one.goal or np.inf for one in found) == pytest.approx(least, rel=1e-9)
    shown = here.run("compare", "-v", "weighted", "plain").stdout
    assert "criterion of the first" in shown
    assert "rows divided" in shown


def test_files_and_options_that_cannot_be(here: Here) -> None:
    for read, text, message in (
        (read_prior, "X7: {value: 8.1}", "X7 (line 1): expected finite numbers {value: ..., deviation: ...}, given a"),
        (read_prior, "X7: {value: 8.1, deviation: .inf}", "X7 (line 1): deviation must be a number"),
        (read_prior, "- 3", "expected a mapping of fields, given a list of 1"),
        (read_prior, "X7: [", "not valid YAML"),
        (read_task_file, "prior: [1]", "prior (line 1): expected a relative uncertainty or a mapping of parameters"),
        (read_task_file, "prior: {X7: {deviation: 1}}", "prior (line 1): X7: expected finite numbers {value: ..., dev"),
    ):
        assert message in refusal(read, text_file(here.cwd / "known.yaml", f"{text}\n"))
    for typed, message in (
        ("--prior 0", "'--prior': expected a relative uncertainty greater than zero, or a file, given '0'"),
        ("--prior none.yaml", "cannot read prior file none.yaml: No such file or directory"),
        ("--scale inch", "'--scale': 'inch' is not one of 'unit', 'prior', 'value'"),
    ):
        assert message in here.refused("design", "irp6", "--out", "out", *typed.split())


def test_assumed_noise_is_said() -> None:
    robot = load_robot("irp6")
    assumed, given = (formulate(robot, Task("irp6", prior=0.2, noise=noise)).notes for noise in (None, (2.0,)))
    assert set(assumed) - set(given) == {
        "prior knowledge is weighed against the noise of the measurements, assumed to be 1; give it with `noise`"
    }
