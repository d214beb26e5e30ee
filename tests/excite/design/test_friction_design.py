"""Designs for friction that is known beforehand: their columns, torques, files and commands."""

from __future__ import annotations

import dataclasses
import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from commands import Here
from designed import NO_DISTANCES
from friction_curves import without_friction
from pinocchio_chains import drive_torques, whole_motion
from played import EXACT, irp6, played, three_joints

from constraints.torque import TorqueLimit
from excite.design.comparison import compare
from excite.design.design import Design
from excite.design.design_folder import save_design
from excite.design.design_json import load_design
from excite.design.formulation import formulate
from excite.design.optimisation import design_trajectory
from excite.design.task_file import read_task_file, task_content, task_from_options
from excite.identification.procedure import estimate_parameters
from excite.identification.result_json import load_result, result_content
from excite.information.matrix import MotionMeasures
from excite.information.target import target_of
from excite.tasks.friction_file import read_friction, write_friction
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.readers.library import built_in
from regressors.robot.friction.curve import CoulombViscous, Scaled, Stribeck, TableFriction
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm
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
MARGIN, QUICK = 0.6, {"harmonics": 3, "starts": 1, "executor": "serial"}
TASK = Task("irp6", friction_curves=KNOWN, torque_margin=MARGIN, **QUICK, **NO_DISTANCES)
FILE = """\
schema: excite.friction/1
drives:
  z1: {model: coulomb-viscous, coulomb: 28, viscous: 26}
  z2: {model: stribeck, forward: {coulomb: 28.75, viscous: 26, stiction: 16.8, stribeck: 0.2}, offset: 0.5}
  z3: {model: table, speed: [0.1, 0.5], torque: [28, 38]}
  z4: {model: coulomb-viscous, coulomb: 10, viscous: 5}
"""


@cache
def designed() -> Design:
    return design_trajectory(TASK.changed(robot=irp6()))


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a design for known friction, one that identifies friction, and one that leaves it out."""
    folder = tmp_path_factory.mktemp("saved")
    save_design(designed(), folder / "known")
    for name, friction in (("identified", True), ("left-out", False)):
        save_design(design_trajectory(Task(irp6(), friction=friction, **QUICK)), folder / name)
    (folder / "friction.yaml").write_text(FILE, encoding="utf-8")
    return folder


@pytest.fixture
def here(saved: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Here:
    return Here(saved, monkeypatch, capfd)


# --- the motion ------------------------------------------------------------------------------------------------------


def test_a_designed_motion_leaves_room_for_its_friction() -> None:
    """Torques of links and rotors by Pinocchio, of friction by the curves, drive by drive, at 10,001 instants."""
    design, robot = designed(), irp6()
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


@pytest.mark.parametrize("model", ["differential", "energy"])
def test_columns_and_criteria_are_those_without_friction(model: str) -> None:
    design, plain = designed(), Task("irp6", model=model, friction=False, offset=False)
    known, bare = (target_of(irp6(), task) for task in (TASK.changed(model=model, offset=True), plain))
    assert known.model.names == bare.model.names
    assert known.base.names == bare.base.names
    assert not any(name.startswith("F") for name in known.model.names)
    samples = design.trajectory.samples(bare.model.times(10.0, 100.0))
    noise = np.ones(len(bare.model.row_labels))
    expected = MotionMeasures.of(bare, samples, noise).criteria
    assert MotionMeasures.of(known, samples, noise).criteria == expected
    if model == "differential":
        assert design.criteria == expected


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
    for name, curve in KNOWN.curves.items():
        again = TASK.known_friction.curve(name)
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
    curve = CoulombViscous(28.0, 26.0)
    curves = (FrictionCurves({"z2": each}) for each in (Loaded(curve, 0.1, 0.05), curve))
    loaded, plain = (TASK.changed(friction_curves=each) for each in curves)
    assert task_from_options(json.loads(json.dumps(task_content(loaded)))) == loaded
    (limit,), (bare,) = (formulate(irp6(), task).nonlinear for task in (loaded, plain))
    q = np.array([[0.0, 0.3, 0.2]])
    still = Samples(np.zeros(1), q, *np.zeros((3, 1, 3)))  # nothing but gravity
    np.testing.assert_allclose(limit.values(still)[0], bare.values(still)[0] * [1.0, 1.1, 1.0, 1.0, 1.0])
    np.testing.assert_array_equal(limit.upper, bare.upper)


def test_a_task_file_names_curves_from_its_own_folder_or_holds_them(here: Here) -> None:
    inside = here.cwd / "tasks"
    inside.mkdir(exist_ok=True)
    (inside / "friction.yaml").write_text(FILE, encoding="utf-8")
    v = np.linspace(-1.0, 1.0, 21)
    for value in ("friction.yaml", "\n" + "".join(f"  {line}\n" for line in FILE.splitlines())):
        text = f"torque_margin: 0.5\nharmonics: 3\nfriction_curves: {value}\n"
        (inside / "task.yaml").write_text(text, encoding="utf-8")
        task = task_from_options({**read_task_file(inside / "task.yaml"), "robot": "irp6"})
        assert (task.model.friction, task.trajectory.harmonics, task.limits.torque_margin) == (True, 3, 0.5)
        for name, curve in read_friction(inside / "friction.yaml").curves.items():
            np.testing.assert_array_equal(task.known_friction.curve(name).torque(v), curve.torque(v))


def test_task_files_whose_curves_cannot_be_read(here: Here) -> None:
    for value, message in (
        ("3", "task.yaml: friction_curves (line 1): should be the name of a file, or its content, given 3"),
        ("none.yaml", "cannot read friction file none.yaml: No such file or directory"),
        ("{drives: {}}", "friction_curves: schema (line 1): is missing"),
    ):
        (here.cwd / "task.yaml").write_text(f"friction_curves: {value}\n", encoding="utf-8")
        assert here.refused("design", "irp6", "--task", "task.yaml", "--out", "none") == f"excite: {message}\n"


def test_drives_without_a_curve_are_told() -> None:
    partly = TASK.changed(friction_curves=FrictionCurves({"z1": CoulombViscous(20.0), "z3": CoulombViscous(5.0)}))
    told = "no friction curve of z2: identified with the rest"
    assert formulate(irp6(), partly).notes == (f"{told}; torque limits use the friction of the robot's description",)
    assert formulate(irp6(), dataclasses.replace(partly, torque_margin=None)).notes == (told,)
    assert formulate(irp6(), dataclasses.replace(partly, joints=("1", "3"))).notes == ()
    assert formulate(irp6(), partly).target.base.names[7:] == ("F2c", "F2v")
    asked = partly.changed(friction=False, torque_margin=None)
    without = told.replace("identified with the rest", "assumed to have no friction in identification, as asked")
    assert formulate(irp6(), asked).notes == (without,)
    assert formulate(irp6(), asked).target.base.rank == 7


@pytest.mark.slow
def test_limits_of_torques_are_told_of_however_they_are_given() -> None:
    partly = TASK.changed(friction_curves=FrictionCurves({"z1": CoulombViscous(20.0), "z3": CoulombViscous(5.0)}))
    free = partly.changed(torque_margin=None)
    expected = formulate(irp6(), partly).notes
    for limit in (TorqueLimit(0.2), "torque", "power"):
        assert formulate(irp6(), free.changed(constraints=(limit,))).notes == expected
    own = TorqueLimit(0.2, FrictionCurves({}))  # takes nothing of what is known
    assert formulate(irp6(), free.changed(constraints=(own,))).notes == formulate(irp6(), free).notes


def test_temperatures_that_torque_limits_are_for_are_told() -> None:
    """Of drives that turn, where torques are limited."""
    cold, slope = CoulombViscous(20.0, 5.0), Slope(-0.1)
    plain, narrow = Warm(cold, 25.0, slope), Warm(cold, 25.0, slope, range=(25.0, 25.0))
    wide = Loaded(Warm(cold, 32.0, slope, range=(20.0, 45.0)), 0.1)
    warm = TASK.changed(friction_curves=FrictionCurves({"z1": plain, "z2": wide, "z3": narrow, "z4": plain}))
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
    task = Task("ur10e", joints=("1", "2"), harmonics=3, friction_curves=curves, torque_margin=0.1, **NO_DISTANCES)
    made = formulate(robot.replace(limits=limits), task)
    assert made.notes == ()
    np.testing.assert_allclose(made.nonlinear[0].upper[:3], 0.9 * robot.limits.torque[:3] - [3.0, 3.0, 0.0])


# --- other commands --------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_identification_takes_the_curves_of_the_design(here: Here) -> None:
    """As if they had been named, unless friction is asked for."""
    write_friction(KNOWN, here.cwd / "known.yaml")
    here.run("simulate", "known", "--friction", "known.yaml", "--rate", "100", "--out", "log.csv", status=0)
    results = {}
    for out, *more in (("from-design",), ("named", "--friction-curves", "known.yaml"), ("asked", "--friction")):
        ended = here.run("identify", "irp6", "log.csv", "--design", "known", "--out", out, "--force", *more, status=0)
        results[out] = load_result(here.cwd / out)
        assert ("its curves are subtracted" in ended.stderr) == (out == "from-design")
    same, named = results["from-design"], results["named"]
    np.testing.assert_array_equal(same.coefficients, named.coefficients)
    assert same.training_error == named.training_error
    assert same.friction is not None
    assert result_content(same)["friction"]["file"] == "known/design.json"
    assert results["asked"].friction is None
    assert "F1c" in results["asked"].names


def test_identification_takes_the_curves_of_a_task_and_results_keep_them(tmp_path: Path) -> None:
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
    (tmp_path / "result.json").write_text(json.dumps(content), encoding="utf-8")
    assert load_result(tmp_path).friction.curve("z2") == CoulombViscous(28.75, 26.0)
    bare = task.changed(friction=False)
    other = estimate_parameters(irp6(), bare, [log], EXACT, friction=FrictionCurves({}))
    assert other.task.model.friction_curves is None
    with pytest.raises(UnknownName, match="no drive named 'z9'"):
        estimate_parameters(irp6(), Task("irp6"), [log], EXACT, friction=FrictionCurves({"z9": CoulombViscous(1.0)}))
    assert other.estimate.values[0] != pytest.approx(result.estimate.values[0], rel=1e-6)


def test_designs_are_compared_under_the_friction_of_the_first(saved: Path) -> None:
    stored, identified, left_out = (load_design(saved / name) for name in ("known", "identified", "left-out"))
    known, identifying = compare([stored, identified])
    assert (known.parameters, identifying.parameters) == (7, 7)
    assert (known.friction, identifying.friction) == ("known", "identified")
    assert known.criteria == pytest.approx(designed().criteria, rel=1e-9)
    assert known.goal == pytest.approx(designed().condition_number, rel=1e-9)
    assert [one.parameters for one in compare([identified, stored])] == [13, 13]
    load, _ = compare([stored, left_out], "load")
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


# --- what is refused -------------------------------------------------------------------------------------------------

TABLE = "schema: excite.friction/1\ndrives:\n  z1: {model: table, speed: [1.0]}\n"
BAD = {
    "nothing": ("", "cannot read friction file nothing.yaml: No such file or directory"),
    "schema": ("schema: excite.friction/2\ndrives: {}\n", "schema.yaml: schema (line 1): should be 'excite.fric"),
    "fields": (TABLE, "fields.yaml: drives.z1.torque (line 3): is missing; model table needs it"),
    "unknown": (FILE.replace("z3", "q3"), "no drive named 'q3'; available: z1, z2, z3, z4, z5"),
    "much": (FILE.replace("28,", "280,"), "drive z1 torque: friction of 280 Nm exceeds the limit of 331.8 Nm less"),
}


def test_bad_curves(here: Here) -> None:
    for name, (text, message) in BAD.items():
        if text:
            (here.cwd / f"{name}.yaml").write_text(text, encoding="utf-8")
        options = ("--friction-curves", f"{name}.yaml", "--torque-margin", "0.2", "--out", "none")
        assert message in here.refused("design", "irp6", *options)
    assert "no drive named 'q3'" in here.refused("plan", "irp6", "--friction-curves", "unknown.yaml")


def test_tasks_that_cannot_be() -> None:
    scaled = FrictionCurves({"z1": Scaled(CoulombViscous(1.0), 2.0)})
    for curves, message, *model in (
        (KNOWN, "`friction_curves` is for models of joint torques", "load"),
        (KNOWN, "a wrench does not contain friction", "load-integral"),
        (FrictionCurves({"z1": np.tanh}), "friction function: a table of it needs its fastest speed, given None"),
        (scaled, "no curve of type Scaled; available: coulomb-viscous, stribeck, table"),
        ({"z1": 1.0}, r"friction_curves: schema \(line 1\): is missing"),
    ):
        with pytest.raises(InputError, match=message):
            Task("irp6", friction_curves=curves, model=(*model, "differential")[0])
