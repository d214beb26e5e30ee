"""Designs for friction that is known beforehand: their columns, torques, files and commands."""

from __future__ import annotations

import dataclasses
import json
import pickle
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from commands import Here, content_of
from pinocchio_chains import drive_torques, whole_motion
from played import EXACT, irp6, played, three_joints

from constraints.torque import TorqueLimit
from excite.design.campaign import plan_campaign
from excite.design.comparison import compare
from excite.design.design import Design
from excite.design.design_folder import save_design
from excite.design.design_json import load_design
from excite.design.formulation import formulate
from excite.design.optimisation import design_trajectory
from excite.design.task_file import read_task_file, task_content, task_from_options
from excite.identification.estimation import estimate_parameters
from excite.identification.result_json import load_result, result_content
from excite.information.matrix import MotionMeasures
from excite.information.target import target_of
from excite.tasks.friction_file import read_friction, write_friction
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.readers.library import built_in
from regressors.robot.friction.curve import CoulombViscous, FunctionFriction, Scaled, Stribeck, TableFriction
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm
from regressors.robot.robot import Robot
from regressors.samples import Samples

# [KD96] section 5.2: joints break away at 14.1; 16.8 and 10.6; 18.0 and 14.1 Nm
KNOWN = FrictionCurves(
    {
        "z1": Stribeck(Side(28.0, 26.0, 14.1, 0.2), Side(30.0, 24.0, 14.1, 0.2), 1.5),
        "z2": Stribeck(Side(40.0, 30.0, 16.8, 0.2), Side(45.0, 32.0, 10.6, 0.3, 1.0), -2.0),
        "z3": TableFriction([-1.0, -0.2, 0.1, 0.5], [-50.0, -30.0, 28.0, 38.0]),
        "z4": CoulombViscous(10.0, 5.0),
    }
)
MARGIN = 0.6
FREE_SPACE = {"self_collision": False, "floor": "none"}
TASK = Task("irp6", harmonics=3, starts=1, executor="serial", friction_curves=KNOWN, torque_margin=MARGIN, **FREE_SPACE)
FILE = """\
schema: excite.friction/1
drives:
  z1: {model: coulomb-viscous, coulomb: 28, viscous: 26}
  z2: {model: stribeck, forward: {coulomb: 28.75, viscous: 26, stiction: 16.8, stribeck: 0.2}, offset: 0.5}
  z3: {model: table, speed: [0.1, 0.5], torque: [28, 38]}
  z4: {model: coulomb-viscous, coulomb: 10, viscous: 5}
"""
QUICK = ("--harmonics", "3", "--starts", "1")


@cache
def designed() -> Design:
    return design_trajectory(TASK.changed(robot=irp6()))


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a design for known friction, one that identifies friction, and one that leaves it out."""
    folder = tmp_path_factory.mktemp("saved")
    save_design(designed(), folder / "known")
    for name, friction in (("identified", True), ("left-out", False)):
        task = Task("irp6", harmonics=3, starts=1, executor="serial", friction=friction)
        save_design(design_trajectory(task.changed(robot=irp6())), folder / name)
    (folder / "friction.yaml").write_text(FILE, encoding="utf-8")
    return folder


@pytest.fixture
def here(saved: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Here:
    return Here(saved, monkeypatch, capfd)


# --- the motion ------------------------------------------------------------------------------------------------------


def without_friction(robot: Robot) -> Robot:
    """The robot whose description states no friction."""
    assert robot.transmission is not None
    drives = tuple(dataclasses.replace(d, coulomb=None, viscous=None) for d in robot.transmission.drives)
    return robot.replace(transmission=dataclasses.replace(robot.transmission, drives=drives))


def test_a_designed_motion_leaves_room_for_its_friction() -> None:
    """Torques of links and rotors by Pinocchio, of friction by the curves, drive by drive, at 10,001 instants."""
    design, robot = designed(), irp6()
    assert robot.transmission is not None
    samples = design.trajectory.samples(np.linspace(0, design.trajectory.duration, 10_001))
    whole = whole_motion(robot, design.moving.joint_names, samples)
    total = drive_torques(without_friction(robot), whole)
    for k, curve in enumerate(KNOWN.curves.values()):
        total[:, k] += curve.torque(whole.dq @ robot.transmission.coupling[k])
    used = np.abs(total).max(axis=0) / ((1 - MARGIN) * robot.transmission.limits.torque)
    assert np.all(used <= 1.0)
    assert used[1] > 0.85  # the limit is what holds the motion back, and little is wasted
    assert design.feasible
    uses = {use.label: use for use in design.limits}
    assert uses["drive z2 torque"].use > 0.96


def test_friction_of_the_description_does_not_count() -> None:
    """The same task of a robot without any: the same limits."""
    (limit,) = formulate(irp6(), TASK).nonlinear
    (bare,) = formulate(without_friction(irp6()), TASK).nonlinear
    np.testing.assert_allclose(limit.upper[:4], bare.upper[:4], rtol=1e-15)
    np.testing.assert_allclose(limit.lower[:4], bare.lower[:4], rtol=1e-15)


@pytest.mark.parametrize("model", ["differential", "energy"])
def test_columns_and_criteria_are_those_without_friction(model: str) -> None:
    design = designed()
    known, bare = (
        target_of(irp6(), task)
        for task in (
            TASK.changed(model=model, offset=True),
            Task("irp6", model=model, friction=False, offset=False),
        )
    )
    assert known.model.names == bare.model.names
    assert known.base.names == bare.base.names
    assert not any(name.startswith("F") for name in known.model.names)
    samples = design.trajectory.samples(bare.model.times(10.0, 100.0))
    noise = np.ones(len(bare.model.row_labels))
    expected = MotionMeasures.of(bare, samples, noise).criteria
    assert MotionMeasures.of(known, samples, noise).criteria == expected
    if model == "differential":
        assert design.criteria == expected


def test_energy_designs_take_curves() -> None:
    design = design_trajectory(TASK.changed(model="energy", torque_margin=None).changed(robot=irp6()))
    assert design.feasible
    assert not any(name.startswith("F") for name in design.base.names)
    assert np.isfinite(design.condition_number)


def test_other_processes_see_the_same_friction() -> None:
    task = pickle.loads(pickle.dumps(TASK))
    assert task == TASK
    blueprint = formulate(irp6(), TASK).blueprint
    (limit,), (again,) = (b.problem().limits.nonlinear for b in (blueprint, pickle.loads(pickle.dumps(blueprint))))
    assert again.lower.tolist() == limit.lower.tolist()
    assert again.upper.tolist() == limit.upper.tolist()


# --- tasks and files -------------------------------------------------------------------------------------------------


def test_a_task_keeps_the_content_of_a_friction_file(tmp_path: Path) -> None:
    write_friction(KNOWN, tmp_path / "friction.yaml")
    filed = TASK.changed(friction_curves=read_friction(tmp_path / "friction.yaml"))
    assert filed == TASK
    assert TASK.model.friction is True  # of the drives without a curve
    content = task_content(TASK.changed(friction=("z2", 3)))
    assert content["friction"] == ("z2", "3")
    assert task_from_options(json.loads(json.dumps(content))).model.friction == ("z2", "3")
    assert task_from_options(json.loads(json.dumps(task_content(TASK)))) == TASK
    v = np.linspace(-1.2, 1.2, 50)
    assert TASK.known_friction is not None
    for name, curve in KNOWN.curves.items():
        again = TASK.known_friction.curve(name)
        assert again is not None
        np.testing.assert_array_equal(again.torque(v), curve.torque(v))


def test_friction_counts_at_every_temperature_at_which_it_was_measured() -> None:
    """Most where it is cold; identification is without friction parameters all the same."""
    warm = FrictionCurves({"z1": Warm(CoulombViscous(28.0, 26.0), 32.0, Slope(-0.2), range=(20.0, 45.0))})
    task = TASK.changed(friction_curves=warm)
    assert task_from_options(json.loads(json.dumps(task_content(task)))) == task
    (limit,) = formulate(irp6(), task).nonlinear
    assert limit.upper[0] == pytest.approx((1 - MARGIN) * 331.8 - 28.0 - 12 * 0.2)
    assert limit.lower[0] == -limit.upper[0]


def test_friction_that_grows_with_the_load_counts() -> None:
    loaded, plain = (
        TASK.changed(friction_curves=FrictionCurves({"z2": curve}))
        for curve in (Loaded(CoulombViscous(28.0, 26.0), 0.1, 0.05), CoulombViscous(28.0, 26.0))
    )
    assert task_from_options(json.loads(json.dumps(task_content(loaded)))) == loaded
    (limit,), (bare,) = (formulate(irp6(), task).nonlinear for task in (loaded, plain))
    q = np.array([[0.0, 0.3, 0.2]])
    still = Samples(np.zeros(1), q, *np.zeros((3, 1, 3)))  # nothing but gravity
    np.testing.assert_allclose(limit.values(still)[0], bare.values(still)[0] * [1.0, 1.1, 1.0, 1.0, 1.0])
    np.testing.assert_array_equal(limit.upper, bare.upper)


def test_functions_become_tables() -> None:
    task = Task("irp6", friction_curves=FrictionCurves({"z1": FunctionFriction(lambda v: 20 * np.tanh(v / 0.1), 1.3)}))
    assert task.known_friction is not None
    assert isinstance(curve := task.known_friction.curve("z1"), TableFriction)
    assert curve.torque(0.5) == pytest.approx(20 * np.tanh(5.0), rel=1e-3)


def test_a_design_folder_stands_for_itself(saved: Path) -> None:
    stored = load_design(saved / "known")
    assert stored.task == TASK
    assert content_of(saved / "known")["task"]["friction_curves"]["schema"] == "excite.friction/1"
    assert content_of(saved / "identified")["task"]["friction_curves"] is None


@pytest.mark.parametrize("given", ["friction.yaml", "inline"])
def test_a_task_file_names_curves_from_its_own_folder(given: str, here: Here) -> None:
    inside = here.cwd / "tasks"
    inside.mkdir(exist_ok=True)
    (inside / "friction.yaml").write_text(FILE, encoding="utf-8")
    value = given if given != "inline" else "\n" + "".join(f"  {line}\n" for line in FILE.splitlines())
    (inside / "task.yaml").write_text(f"torque_margin: 0.5\nharmonics: 3\nfriction_curves: {value}\n", encoding="utf-8")
    task = task_from_options({**read_task_file(inside / "task.yaml"), "robot": "irp6"})
    assert task.known_friction is not None
    assert (task.model.friction, task.trajectory.harmonics, task.limits.torque_margin) == (True, 3, 0.5)
    v = np.linspace(-1.0, 1.0, 21)
    for name, curve in read_friction(inside / "friction.yaml").curves.items():
        found = task.known_friction.curve(name)
        assert found is not None
        np.testing.assert_array_equal(found.torque(v), curve.torque(v))


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("3", "task.yaml: friction_curves (line 1): should be the name of a file or its content, given 3"),
        ("none.yaml", "cannot read friction file none.yaml: No such file or directory"),
        ("{drives: {}}", "friction_curves: schema (line 1): is missing"),
    ],
)
def test_task_files_whose_curves_cannot_be_read(value: str, message: str, here: Here) -> None:
    (here.cwd / "task.yaml").write_text(f"friction_curves: {value}\n", encoding="utf-8")
    ended = here.run("design", "irp6", "--task", "task.yaml", "--out", "none")
    assert (ended.returncode, ended.stdout, ended.stderr) == (2, "", f"excite: {message}\n")


@pytest.mark.slow
def test_the_command_takes_what_friction_fit_writes(here: Here) -> None:
    (here.cwd / "sub").mkdir(exist_ok=True)
    (here.cwd / "sub" / "friction.yaml").write_text(FILE, encoding="utf-8")
    folder = here.designed("irp6", "--friction-curves", "sub/friction.yaml", "--torque-margin", "0.5", *QUICK)
    (here.cwd / "sub" / "friction.yaml").unlink()
    stored = load_design(folder)
    assert stored.task.known_friction is not None
    assert sorted(stored.task.known_friction.curves) == ["z1", "z2", "z3", "z4"]
    assert content_of(folder)["base"]["rank"] == 7


def test_drives_without_a_curve_are_told() -> None:
    partly = dataclasses.replace(
        TASK, friction_curves=FrictionCurves({"z1": CoulombViscous(20.0), "z3": CoulombViscous(5.0)})
    )
    told = "no friction curve of z2: identified with the rest"
    assert formulate(irp6(), partly).notes == (f"{told}; torque limits use the friction of the robot's description",)
    assert formulate(irp6(), dataclasses.replace(partly, torque_margin=None)).notes == (told,)
    assert formulate(irp6(), dataclasses.replace(partly, joints=("1", "3"))).notes == ()
    assert formulate(irp6(), partly).target.base.names[7:] == ("F2c", "F2v")
    asked = partly.changed(friction=False, torque_margin=None)
    assert formulate(irp6(), asked).notes == (
        told.replace("identified with the rest", "assumed to have no friction in identification, as asked"),
    )
    assert formulate(irp6(), asked).target.base.rank == 7


@pytest.mark.slow
@pytest.mark.parametrize("limit", [TorqueLimit(0.2), "torque", "power"], ids=str)
def test_limits_of_torques_are_told_of_however_they_are_given(limit: TorqueLimit | str) -> None:
    partly = TASK.changed(friction_curves=FrictionCurves({"z1": CoulombViscous(20.0), "z3": CoulombViscous(5.0)}))
    free = partly.changed(torque_margin=None)
    assert formulate(irp6(), free.changed(constraints=(limit,))).notes == formulate(irp6(), partly).notes
    own = TorqueLimit(0.2, FrictionCurves({}))  # takes nothing of what is known
    assert formulate(irp6(), free.changed(constraints=(own,))).notes == formulate(irp6(), free).notes


def test_temperatures_that_torque_limits_are_for_are_told() -> None:
    """Of drives that turn, where torques are limited."""
    cold, slope = CoulombViscous(20.0, 5.0), Slope(-0.1)
    curves = FrictionCurves(
        {
            "z1": Warm(cold, 25.0, slope),
            "z2": Loaded(Warm(cold, 32.0, slope, range=(20.0, 45.0)), 0.1),
            "z3": Warm(cold, 25.0, slope, range=(25.0, 25.0)),
            "z4": Warm(cold, 25.0, slope),
        }
    )
    warm = TASK.changed(friction_curves=curves)
    assert formulate(irp6(), warm).notes == (
        "torque limits use friction of z1 at 25 deg C only: its file has no range",
        "torque limits use friction of z2 from 20 to 45 deg C",
        "torque limits use friction of z3 at 25 deg C only: its file has no wider range",
    )
    assert formulate(irp6(), dataclasses.replace(warm, torque_margin=None)).notes == ()


def test_curves_of_joints_that_rest_do_no_harm() -> None:
    robot = built_in("ur10e")
    curves = FrictionCurves({name: CoulombViscous(3.0, 2.0) for name in robot.joint_names})
    limits = dataclasses.replace(robot.limits, acceleration=np.full(6, 3.0))
    task = Task("ur10e", joints=("1", "2"), harmonics=3, friction_curves=curves, torque_margin=0.1, **FREE_SPACE)
    made = formulate(robot.replace(limits=limits), task)
    assert made.notes == ()
    np.testing.assert_allclose(made.nonlinear[0].upper[:3], 0.9 * robot.limits.torque[:3] - [3.0, 3.0, 0.0])


# --- other commands --------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_identification_takes_the_curves_of_the_design(here: Here) -> None:
    """As if they had been named, unless friction is asked for."""
    log = simulated(here)
    results = {}
    for out, *more in (
        ("from-design",),
        ("named", "--friction-curves", "known.yaml"),
        ("asked", "--friction"),
    ):
        ended = here.run("identify", "irp6", log, "--design", "known", "--out", out, "--force", *more)
        assert ended.returncode == 0, ended.stderr
        results[out] = load_result(here.cwd / out)
        assert ("its curves are subtracted" in ended.stderr) == (out == "from-design")
    same, named = results["from-design"], results["named"]
    np.testing.assert_array_equal(same.coefficients, named.coefficients)
    assert same.training_error == named.training_error
    assert same.friction is not None
    assert result_content(same)["friction"]["file"] == "known/design.json"
    assert results["asked"].friction is None
    assert "F1c" in results["asked"].names


def simulated(here: Here) -> str:
    write_friction(KNOWN, here.cwd / "known.yaml")
    if not (here.cwd / "log.csv").exists():
        ended = here.run("simulate", "known", "--friction", "known.yaml", "--rate", "100", "--out", "log.csv")
        assert ended.returncode == 0, ended.stderr
    return "log.csv"


@pytest.mark.slow
def test_parameters_that_known_friction_leaves_out_are_told(here: Here) -> None:
    """Where they were asked for, and every moving drive has a curve."""
    note = "excite: note: offset columns are left out: friction is known\n"
    (here.cwd / "task.yaml").write_text("harmonics: 3\nstarts: 1\noffset: true\n", encoding="utf-8")
    known, out = ("--friction-curves", "friction.yaml"), ("--out", "told", "--force")
    for given, told in (
        ((*QUICK,), False),
        ((*QUICK, "--no-friction", "--no-offset"), False),
        ((*QUICK, "--friction", "--offset"), True),
        (("--task", "task.yaml"), True),
    ):
        ended = here.run("design", "irp6", *given, *known, *out)
        assert ended.returncode == 0, ended.stderr
        assert (note in ended.stderr) == told
    log = simulated(here)
    ended = here.run("identify", "irp6", log, "--friction", "--offset", "-v", *known, *out)
    assert ended.returncode == 0, ended.stderr
    assert (ended.stdout + ended.stderr).count("offset columns are left out: friction is known") == 1
    assert "columns are left out" not in here.run("identify", "irp6", log, *known, *out).stderr


@pytest.mark.slow
def test_verification_tells_where_a_table_is_too_slow(here: Here) -> None:
    tables = {name: TableFriction([0.01, fastest], [25.0, 27.0]) for name, fastest in (("z1", 0.02), ("z2", 9.0))}
    write_friction(FrictionCurves(tables), here.cwd / "slow.yaml")
    log = simulated(here)
    here.run("identify", "irp6", log, "--friction-curves", "slow.yaml", "--out", "slow", "--force")
    ended = here.run("verify", "slow", log, "--training-too", "--format", "json")
    (one,) = json.loads(ended.stdout)
    told = [said for said in one["remarks"] if "faster than its table" in said]
    assert len(told) == 1
    assert told[0].startswith("friction of z1: ")


@pytest.mark.slow
def test_files_of_all_joints_serve_motions_of_some(here: Here) -> None:
    """Of a robot without a transmission: designed, simulated, identified and verified with the same file."""
    robot, options = built_in("ur10e"), ("--acceleration-limit", "3", "--harmonics", "3", "--starts", "1")
    curves = FrictionCurves({name: CoulombViscous(8.0, 12.0) for name in robot.joint_names})
    write_friction(curves, here.cwd / "all.yaml")
    here.designed("ur10e", "--joints", "1,2", "--friction-curves", "all.yaml", *options, out="two")
    for log, seed in (("first.csv", "1"), ("second.csv", "2")):
        noise = ("--torque-noise", "0.1", "--rate", "100", "--seed", seed, "--out", log)
        ended = here.run("simulate", "two", "--friction", "all.yaml", *noise)
        assert ended.returncode == 0, ended.stderr
    ended = here.run("identify", "ur10e", "first.csv", "--design", "two", "--out", "masses")
    assert ended.returncode == 0, ended.stderr
    stored = load_result(here.cwd / "masses")
    assert stored.friction is not None
    assert tuple(stored.friction.curves) == robot.joint_names[:2]
    assert here.run("verify", "masses", "second.csv").returncode == 0


def test_identification_takes_the_curves_of_a_task() -> None:
    """The friction of the description, so that the truth comes back without friction parameters."""
    curves = FrictionCurves.of_robot(irp6())
    task, log = Task("irp6", friction_curves=curves), played(three_joints(), 3)
    result = estimate_parameters(irp6(), task, [log], EXACT)
    named = estimate_parameters(irp6(), Task("irp6"), [log], EXACT, friction=curves)
    np.testing.assert_array_equal(result.estimate.values, named.estimate.values)
    assert not any(name.startswith("F") for name in result.estimate.names)
    content = result_content(result)
    assert content["task"]["friction_curves"]["drives"]["z2"]["coulomb"] == 28.75
    assert content["prediction_error"] < 1e-6
    bare = task.changed(friction=False)
    other = estimate_parameters(irp6(), bare, [log], EXACT, friction=FrictionCurves({}))
    assert other.task.model.friction_curves is None
    with pytest.raises(UnknownName, match="no drive named 'z9'"):
        estimate_parameters(irp6(), Task("irp6"), [log], EXACT, friction=FrictionCurves({"z9": CoulombViscous(1.0)}))
    assert other.estimate.values[0] != pytest.approx(result.estimate.values[0], rel=1e-6)


def test_results_keep_the_curves_of_their_task(tmp_path: Path) -> None:
    task = Task("irp6", friction_curves=FrictionCurves.of_robot(irp6()))
    result = estimate_parameters(irp6(), task, [played(three_joints(), 3)], EXACT)
    (tmp_path / "result.json").write_text(json.dumps(result_content(result)), encoding="utf-8")
    stored = load_result(tmp_path)
    assert stored.friction is not None
    assert stored.friction.curve("z2") == CoulombViscous(28.75, 26.0)


def loaded(saved: Path, *names: str) -> list[Design]:
    return [load_design(saved / name) for name in names]


def test_designs_are_compared_under_the_friction_of_the_first(saved: Path) -> None:
    known, identifying = compare(loaded(saved, "known", "identified"))
    assert (known.parameters, identifying.parameters) == (7, 7)
    assert (known.friction, identifying.friction) == ("known", "identified")
    assert known.criteria == pytest.approx(designed().criteria, rel=1e-9)
    assert known.goal == pytest.approx(designed().condition_number, rel=1e-9)
    identifying, known = compare(loaded(saved, "identified", "known"))
    assert (known.parameters, identifying.parameters) == (13, 13)
    load, _ = compare(loaded(saved, "known", "left-out"), "load")
    assert (load.model, load.friction) == ("load", "known")


def test_what_differs_is_said(here: Here) -> None:
    note = "note: only some of the designs identify friction; all are compared like the first one, {} friction"
    ended = here.run("compare", "-v", "known", "identified", "left-out")
    assert note.format("without") + " parameters" in ended.stdout.splitlines()
    row = next(line for line in ended.stdout.splitlines() if "friction, when designed" in line)
    assert [cell.strip() for cell in row.split("│")[2:5]] == ["known", "identified", "left out"]
    assert note.format("with") in here.run("compare", "-v", "identified", "known").stdout
    for others in (("known", "left-out"), ("identified", "known", "--model", "load")):
        assert "only some" not in here.run("compare", "-v", *others).stdout


def test_campaigns_for_known_friction(here: Here) -> None:
    """The motions that show everything without friction, and the command that designs them."""
    ended = here.run("plan", "irp6", "--friction-curves", "friction.yaml")
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "next: excite design irp6 --model energy --friction-curves friction.yaml --drives" in ended.stdout
    plain = plan_campaign(Task("irp6", model="energy", friction=False).changed(robot=irp6()))
    assert (
        plan_campaign(Task("irp6", model="energy", friction_curves=KNOWN).changed(robot=irp6())).subsets
        == plain.subsets
    )
    assert f"all {plain.rank} parameters" in ended.stdout


# --- what is refused -------------------------------------------------------------------------------------------------

BAD = {
    "nothing.yaml": (None, "cannot read friction file nothing.yaml: No such file or directory"),
    "schema.yaml": ("schema: excite.friction/2\ndrives: {}\n", "schema.yaml: schema (line 1): should be 'excite.fric"),
    "fields.yaml": (
        "schema: excite.friction/1\ndrives:\n  z1: {model: table, speed: [1.0]}\n",
        "fields.yaml: drives.z1.torque (line 3): is missing; model table needs it",
    ),
    "unknown.yaml": (
        FILE.replace("z3", "q3"),
        "no drive named 'q3'; available: z1, z2, z3, z4, z5",
    ),
    "much.yaml": (
        FILE.replace("28,", "280,"),
        "drive z1 torque: friction of 280 Nm exceeds the limit of 331.8 Nm less a margin of 20 %",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_curves(name: str, here: Here) -> None:
    text, message = BAD[name]
    if text is not None:
        (here.cwd / name).write_text(text, encoding="utf-8")
    ended = here.run("design", "irp6", "--friction-curves", name, "--torque-margin", "0.2", "--out", "none")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert message in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert not (here.cwd / "none").exists()


def test_plans_refuse_unknown_drives_too(here: Here) -> None:
    (here.cwd / "unknown.yaml").write_text(FILE.replace("z3", "q3"), encoding="utf-8")
    ended = here.run("plan", "irp6", "--friction-curves", "unknown.yaml")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert "no drive named 'q3'; available: z1, z2, z3, z4, z5" in ended.stderr


REFUSED = {
    "a wrench": ({"model": "load", "friction_curves": KNOWN}, "`friction_curves` is for models of joint torques"),
    "integrals of it": ({"model": "load-integral", "friction_curves": KNOWN}, "a wrench does not contain friction"),
    "endless": (
        {"friction_curves": FrictionCurves({"z1": np.tanh})},
        "friction function: a table of it needs its fastest speed, given None",
    ),
    "no file's": (
        {"friction_curves": FrictionCurves({"z1": Scaled(CoulombViscous(1.0), 2.0)})},
        "a friction file holds no curve of type Scaled; available: coulomb-viscous, stribeck, table",
    ),
    "no content": ({"friction_curves": {"z1": 1.0}}, "friction_curves: schema (line 1): is missing"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_tasks_that_cannot_be(name: str) -> None:
    options, message = REFUSED[name]
    with pytest.raises(InputError) as raised:
        Task("irp6", **options)  # type: ignore[arg-type]
    assert message in str(raised.value)


def test_a_curve_of_an_unknown_drive() -> None:
    task = TASK.changed(friction_curves=FrictionCurves({"z7": CoulombViscous(1.0)}))
    with pytest.raises(UnknownName, match="no drive named 'z7'"):
        formulate(irp6(), task)
