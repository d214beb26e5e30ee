"""Values that no quantity may be, and any value of any option of any command: a documented status, no traceback."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from commands import COMMANDS, files_below
from hypothesis import HealthCheck, Phase, given, settings
from value_fuzzer import BASE, DESIGN, ROBOT, command_lines, file_cases, memory, prepared, run

from excite.cli.option_types import Number, Numbers
from excite.tasks.option import options_of
from excite.tasks.task import PARTS, Task
from regressors.quantities import QUANTITIES

# Values that no quantity may be: one line with the option or key, what was read, and the range; exit status 2.


# where each command calls the work, and the work as its error names it
WORK = {
    "design": ("excite.design.formulation.target_of", "the formulation of the design"),
    "simulate": ("excite.simulation.simulate.simulate_motion", "the simulation"),
    "identify": ("excite.identification.identify.read_logs", "the identification"),
    "verify": ("excite.verification.verify.prepare", "the verification"),
    "study": ("excite.study.study_over_time.identify", "the study"),
    "plan": ("excite.design.campaign.moving_robot", "the campaign"),
    "compare": ("excite.design.comparison.weighting_of", "the comparison"),
    "friction plan": ("excite.design.friction_runs.plan_friction._coordinate_plan", "the friction plan"),
    "friction fit": ("excite.friction.fit_friction.read_logs", "the friction fit"),
}
NUMBERS = ("integer", "number", "numbers", "ranges", "box", "triple", "poses", "mount", "payload", "parameters")
PLAN = BASE["friction plan"]
OPTIONS: tuple[tuple[tuple[str, ...], str, str], ...] = (
    (DESIGN, "--noise 1e-308", "'--noise': must be a number from 1e-12 to 1e+12, given 1e-308"),
    (DESIGN, "--position-limit=-1e20:1e20,-1:1", "must be a number from -10000 to 10000 rad or m, given -1e+20"),
    (DESIGN, "--tool-box 1e300:2e300,:,:", "'--tool-box': must be a number from -10000 to 10000 m, given 1e+300"),
    (DESIGN, f"--seed {'9' * 400}", "must be a whole number from 0 to 2^63 - 1, given a whole number of about"),
    (DESIGN, f"--seed {'9' * 5000}", "'--seed': expected a whole number, given '9999999999999"),
    (DESIGN, "--period \u0661", r"'--period': expected a number, given '\u0661'"),
    (BASE["identify"], "--delay 0,1e9", "'--delay': expected auto or a number; must be a number from -10000 to"),
    (PLAN, "--velocity-limit 1e-9", "a stroke of 7.5e-10 rad to each side is too short for a run"),
    (PLAN, "--breakaways 2 --creep 1e-6 --creeping 1e-3", "the break-away tests creep only 2e-11 far"),
    (DESIGN, "--mount 1,2,1e99", "expected floor, wall, ceiling, or roll, pitch, yaw [rad]; given '1,2,1e99'"),
    (BASE["simulate"], "--breakaway 1e9", "'--breakaway': must be 0 or a number from 1e-12 to 10000"),
    (BASE["simulate"], "--impact a:1:1e300", "--impact on a: the torque must be a number from -1e+09 to"),
    (BASE["simulate"], "--load 1e300,0,0,0,1,0,0,1,0,1", "'--load': must be a number from -1e+09"),
)
TASKS = {
    "period: 1:30": "period (line 1): should be a number, given '1:30'",
    'period: "1e3"': "period (line 1): should be a number, given '1e3'",
    f"seed: {'9' * 100_000}": "seed (line 1): '99999",
    "prior: 1e-300": "prior (line 1): must be a number from 1e-09 to 1e+09, given 1e-300",
    "prior: {F1c: {value: 1e300, deviation: 1}}": "F1c: value must be a number from -1e+12 to 1e+12, given 1e+300",
    "limits: {velocity: [1, 1e99]}": "limits.velocity (line 1): must be a number from 1e-09 to 1000000 rad/s or m/s",
    'tool_box: [["", ""], [0, 1], [0, 1]]': "tool_box (line 1): should be a pair [lower, upper] for each of x",
    "world: {clearance: true, robot: []}": "clearance (line 1): must be a number from -10000 to 10000 m, given True",
}
WORLD = "robot: [{link: B, from: [0, 0, 0], radius: 0.1}]\n"
WORLDS = {
    'clearance: "1_0"': "clearance (line 1): must be a number, given the text '1_0'",
    "clearance: true": "clearance (line 1): must be a number from -10000 to 10000 m, given True",
    "self_collision: 1": "self_collision (line 1): should be a valid boolean, given 1",
}
ROBOTS = {
    ("mass: 4.0", "mass: 1e300"): "link A: inertial parameters must be a number from -1e+12 to 1e+12 kg m or kg m^2",
    ("ratio: 2.0", "ratio: 1e200"): "drive z1: ratio must be a number from -1e+09 to 1e+09, given 1e+200",
    ("torque: 60", "torque: 1e30"): "limits of joints: torque must be inf or a number from -1e+20 to 1e+20, given",
    ("mass: 4.0", "mass: true"): "links[1].mass (line 9): should be a valid number, given True",
}


def put(key: str, value: object) -> Callable[[dict[str, Any]], str]:
    return lambda content: json.dumps({**content, "task": {**content["task"], key: value}})


def typed(old: str, new: str) -> Callable[[dict[str, Any]], str]:
    return lambda content: json.dumps(content).replace(old, new, 1)


STORED: tuple[tuple[Callable[[dict[str, Any]], str], str], ...] = (
    (typed('"seed": 0', f'"seed": {"9" * 5000}'), "99999999999999999999... is a whole number of 5000 digits"),
    (put("period", 10**400), "10000000000000000000... is a whole number of 401 digits"),
    (put("period", float("inf")), "Infinity is not a finite number"),
    (typed('"period": 2.0', '"period": 1e999'), "1e999 is too large for a number"),
    (put("world", [1]), "world: expected the name of a file, or its content, given [1]"),
    (put("tool_box", ["", "", ""]), "tool_box: expected a pair [lower, upper] for each of x, y, z"),
)


@pytest.fixture(scope="module")
def folder() -> Iterator[Path]:
    with prepared() as made:
        yield made


def refused(arguments: tuple[str, ...], message: str, folder: Path) -> None:
    before = files_below(folder)
    ended = run(arguments, folder)
    assert ended.problems == ()
    assert ended.status == 2, ended.errors
    assert message in ended.errors
    assert len(ended.errors.splitlines()) == 1
    assert files_below(folder) == before


def test_an_option_out_of_its_range(folder: Path) -> None:
    for command, options, message in OPTIONS:
        out = () if "--out" in command else ("--out", "o")
        refused((*command, *options.split(), *out), message, folder)


def test_a_key_of_a_file_out_of_its_range(folder: Path) -> None:
    for text, message in TASKS.items():
        (folder / "wrong.yaml").write_text(text)
        refused((*DESIGN, "--task", "wrong.yaml", "--out", "o"), message, folder)
    for text, message in WORLDS.items():
        (folder / "wrong.yaml").write_text(f"{text}\n{WORLD}")
        refused((*DESIGN, "--world", "wrong.yaml", "--out", "o"), f"wrong.yaml: {message}", folder)
    for change, message in ROBOTS.items():
        (folder / "wrong.yaml").write_text(ROBOT.replace(*change, 1))
        refused(("robots", "wrong.yaml"), f"wrong.yaml: {message}", folder)


def test_a_number_of_a_stored_design_out_of_its_range(folder: Path) -> None:
    stored = folder / "wrong"
    stored.mkdir()
    for file in (folder / "d").glob("*.[cj]s*"):
        (stored / file.name).write_bytes(file.read_bytes())
    text = (folder / "d" / "design.json").read_text()
    for change, message in STORED:
        (stored / "design.json").write_text(change(json.loads(text)))
        refused(("compare", "wrong"), message, folder)


def test_a_prior_that_is_no_number(folder: Path) -> None:
    shape = "F1c (line 1): expected finite numbers {value: ..., deviation: ...}, given a mapping of value"
    long = "F1c (line 1): value must be a number from -1e+12 to 1e+12, given a whole number of about 401"
    for value, message in {"": shape, "x": shape, "'1'": shape, "[1]": shape, f"1{'0' * 400}": long}.items():
        (folder / "wrong.yaml").write_text(f"F1c: {{value: {value}, deviation: 1}}\n")
        refused((*DESIGN, "--prior", "wrong.yaml", "--out", "o"), f"wrong.yaml: {message}", folder)


def test_every_option_that_is_a_number_has_a_quantity() -> None:
    of_tasks = {field.name for part in PARTS.values() for field, o in options_of(part) if o.kind in NUMBERS}
    typed = {
        kind.quantity or param.name
        for name in BASE
        for param in COMMANDS[name].params
        for kind in (param.type,)
        if isinstance(kind, Number | Numbers)
    }
    assert (of_tasks | typed) - QUANTITIES.keys() == set()


def test_no_option_is_a_bare_number() -> None:
    bare = (click.types.FloatParamType, click.types.IntParamType)
    assert [p.name for name in BASE for p in COMMANDS[name].params if isinstance(p.type, bare)] == []


@pytest.mark.parametrize("name", WORK)
def test_a_numerical_failure_is_one_line(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place, work = WORK[name]

    def fails(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(place, fails)
    ended = run(BASE[name], folder)
    assert (ended.status, ended.problems) == (2, ())
    message = f"excite: {work} failed numerically (SVD did not converge); "
    assert ended.errors.splitlines()[-1].startswith(message)


# Any value of any option of any command: an exit status that is documented, no traceback, no warning, finite files.


CASES = 32  # of each command
GROWTH = 500.0  # of the memory over all cases of a command [MB]
OF_TESTS = settings(  # the first case that fails is short enough
    derandomize=True, database=None, deadline=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
)


@pytest.mark.slow
@pytest.mark.parametrize("name", BASE)
def test_values_of_options(name: str, folder: Path) -> None:
    @settings(OF_TESTS, max_examples=CASES)
    @given(command_lines(name))
    def ends_as_it_must(arguments: list[str]) -> None:
        assert run(arguments, folder).problems == ()

    ended, before = run(BASE[name], folder), memory()
    assert (ended.status in (0, 1), ended.problems) == (True, ()), ended.errors
    ends_as_it_must()
    assert memory() < before + GROWTH


@pytest.mark.slow
def test_numbers_in_files(folder: Path) -> None:
    @settings(OF_TESTS, max_examples=CASES)
    @given(file_cases())
    def ends_as_it_must(case: tuple[list[str], dict[str, str]]) -> None:
        arguments, files = case
        assert run(arguments, folder, files=files).problems == ()

    ends_as_it_must()


def test_every_case_begins_with_the_same_files(folder: Path) -> None:
    before = (folder / "two.yaml").read_bytes()
    assert run(("robots", "two.yaml", "--mount", "wall", "--out", "two.yaml", "--force"), folder).status == 0
    assert (folder / "two.yaml").read_bytes() == before


def test_the_fuzzer_sees_what_must_not_be(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def warns(*_: object, **__: object) -> None:
        with np.errstate(divide="warn"):
            np.ones(1) / np.zeros(1)
        raise KeyError("x")

    monkeypatch.setattr(Task, "__init__", warns)
    problems = run(BASE["robots"], folder).problems
    assert [problem.partition(":")[0] for problem in problems[:2]] == ["KeyError", "warning"]
