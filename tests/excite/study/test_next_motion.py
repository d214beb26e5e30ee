"""Designs after earlier experiments, and the next motion of a sequence."""

from pathlib import Path

import numpy as np
import pytest
from designed import short

import excite
from excite.design.design_folder import design_content
from excite.design.formulation import with_information_in_hand
from excite.information.earlier_precision import deviations_of, earlier_root
from excite.storage.manifest import sha256_of
from regressors.errors import InputError

SEARCH = excite.Search(starts=1, executor="serial")


@pytest.fixture(scope="module")
def short_design() -> excite.Design:
    return short()


@pytest.fixture(scope="module")
def result(short_design: excite.Design) -> excite.Identification:
    log = excite.simulate(short_design, noise=4.0, seed=1)
    return excite.identify("irp6", log, design=short_design, estimator="weighted", choose=False)


@pytest.fixture(scope="module")
def folders(
    result: excite.Identification, short_design: excite.Design, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    folder = tmp_path_factory.mktemp("sequence")
    result.save(folder / "a")
    short_design.save(folder / "b")
    return folder


@pytest.fixture(scope="module")
def after(folders: Path) -> excite.Design:
    in_hand = (str(folders / "a"), str(folders / "b"))
    return excite.design_trajectory("irp6", period=4, after=in_hand, search=SEARCH)


def test_a_result_states_the_information_of_its_covariance(result: excite.Identification, after: excite.Design) -> None:
    task = after.task.changed(after=after.task.objective.after[:1])
    R = earlier_root(after.target, task)
    assert np.allclose(np.linalg.inv(R.T @ R), result.estimate.covariance, rtol=1e-6)
    assert np.allclose(deviations_of(R), result.estimate.deviation)


def test_measured_noise_is_that_of_new_rows(after: excite.Design) -> None:
    """4 Nm at 2000 Hz has the density of 4 / sqrt(20) Nm at 100 Hz."""
    assert after.task.objective.noise == pytest.approx(3 * (4.0 / np.sqrt(20.0),), rel=0.1)


def test_what_is_in_hand_is_stated_beside_what_follows(after: excite.Design) -> None:
    alone = np.array([each.standard_deviation for each in after.predicted])
    before = np.array([each.deviation for each in after.prior])
    together = np.array([each.after for each in after.prior])
    assert np.all(together < np.minimum(alone, before))
    assert [each.value for each in after.prior] == 13 * [None]


def test_objects_and_folders_are_the_same(
    result: excite.Identification, short_design: excite.Design, after: excite.Design
) -> None:
    R, same = (
        earlier_root(after.target, with_information_in_hand(after.robot, task))
        for task in (after.task, after.task.changed(after=(short_design, result)))
    )
    assert np.allclose(R.T @ R, same.T @ same, rtol=1e-9)


def test_a_stored_design_runs_again_without_the_folders(after: excite.Design, folders: Path, tmp_path: Path) -> None:
    after.save(tmp_path / "c")
    stored = excite.load_design(tmp_path / "c")
    content = design_content(stored)
    assert content["task"]["after"] == [str(folders / name) for name in "ab"]
    hashes = [sha256_of(folders / file) for file in ("a/result.json", "b/design.json")]
    assert [each["sha256"] for each in content["after"]] == hashes
    again = excite.design_trajectory(stored.task)
    assert np.array_equal(again.trajectory.x, after.trajectory.x)
    assert design_content(again)["after"] == content["after"]


def test_a_result_after_others_names_them_without_opening(after: excite.Design, tmp_path: Path) -> None:
    log = excite.simulate(after, noise=1.0, seed=2)
    result = excite.identify(after.task, log, estimator="weighted", choose=False)
    result.save(tmp_path / "r")
    stored = excite.load_result(tmp_path / "r")
    with pytest.raises(InputError, match="files that results name are not opened"):
        excite.design_trajectory(stored.task)


def test_enough_is_enough(result: excite.Identification) -> None:
    step = excite.next_motion("irp6", "100%", after=result)
    assert step.enough
    assert (step.design, step.runs, step.missing, step.planned) == (None, 0, (), ())
    widths = np.array([each.half_width for each in step.parameters])
    assert np.allclose(widths, result.estimate.half_width)
    assert [each.value for each in step.parameters] == pytest.approx(result.estimate.values.tolist())


def test_the_runs_are_the_fewest_that_are_expected_to_be_enough(result: excite.Identification) -> None:
    step = excite.next_motion("irp6", 0.1, after=result, period=4, search=SEARCH)
    run = step.design.run_information
    assert not step.enough
    assert step.runs == run.fewest_runs()
    assert run.use(step.runs) <= 1.0
    assert step.runs == 1 or run.use(step.runs - 1) > 1.0
    assert all(each.expected <= each.allowed for each in step.parameters)
    assert step.missing[0].half_width / step.missing[0].allowed == max(
        p.half_width / p.allowed for p in step.parameters
    )


@pytest.mark.slow
def test_a_sequence_ends_where_it_is_expected_to(result: excite.Identification) -> None:
    step = excite.next_motion("irp6", 0.2, after=result, period=4, search=SEARCH)
    assert step.runs == 1
    log = excite.simulate(step.design, noise=4.0, seed=3)
    second = excite.identify("irp6", log, design=step.design, estimator="weighted", choose=False)
    assert excite.next_motion("irp6", 0.2, after=(result, second)).enough


def test_planned_designs_are_named(short_design: excite.Design) -> None:
    step = excite.next_motion("irp6", "100%", after=4 * (short_design,))
    assert step.enough
    assert step.planned == (short_design.name,)


def test_shares_are_of_what_was_measured(result: excite.Identification) -> None:
    measured = excite.next_motion("irp6", 1.0, after=result)
    described = excite.next_motion("irp6", 1.0, after=result, of="described")
    for a, b in zip(measured.parameters, described.parameters, strict=True):
        assert a.allowed == pytest.approx(abs(a.value), rel=1e-9) or a.allowed > abs(a.value)  # about zero
        assert b.allowed != a.allowed
    scaled = excite.PrecisionTarget(1.0, scales={"X5": 7.0})
    assert {p.name: p.allowed for p in excite.next_motion("irp6", scaled, after=result).parameters}["X5"] == 7.0


@pytest.mark.slow
def test_nothing_is_asked_of_what_may_be_zero_and_has_no_size() -> None:
    """The panda's friction is not described, and simulated without; asked shares of it would never be reached."""
    design = excite.design_trajectory("panda", harmonics=3, period=4.0, search=SEARCH)
    result = excite.identify("panda", excite.simulate(design, noise=0.3, seed=0, rate=200.0), design=design)
    step = excite.next_motion("panda", 10.0, after=(result, design))
    asked = {p.name: p.allowed for p in step.parameters}
    by_value = {p.name: abs(p.value) > p.half_width for p in step.parameters if p.name.startswith("F")}
    assert {name: np.isfinite(asked[name]) for name in by_value} == by_value
    assert not all(by_value.values())
    assert step.enough


BAD = [
    ({"after": "nowhere"}, "nowhere holds neither result.json nor design.json"),
    ({"after": 3}, "after: expected results or designs, or their folders, given 3"),
    ({"after": [None]}, "after: expected results or designs"),
    ({"after": object()}, "expected a result or a design, or the folder of one; given object"),
    ({"after": ("a", "a")}, "results of the same log count it twice"),
    ({"after": "a", "robot": "panda"}, "is of the robot irp6, this task is for panda"),
    ({"after": "a", "joints": ("4", "5")}, "the parameters of .* are those of other bodies"),
    ({"after": "a", "payload": (1.0, 0.0, 0.0, 0.1)}, "the robot carries nothing, in this task 1,0,0,0.1"),
    ({"after": "a", "model": "energy"}, "has measured the noise of the equations q1 .* give `noise`"),
    ({"after": "b", "model": "energy"}, "has the equations q1, q2, q3, whose noise is not known here"),
]


@pytest.mark.parametrize(("options", "message"), BAD, ids=[str(k) for k in range(len(BAD))])
def test_bad_inputs_are_named(options: dict, message: str, folders: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folders)
    given = dict(options)
    robot = given.pop("robot", "irp6")
    with pytest.raises(InputError, match=message):
        excite.design_trajectory(robot, period=4, search=SEARCH, **given)


def test_a_folder_with_both_asks_for_the_file(
    result: excite.Identification, short_design: excite.Design, tmp_path: Path
) -> None:
    result.save(tmp_path)
    (tmp_path / "design.json").write_text("{}")
    with pytest.raises(InputError, match="holds a result and a design; name the file"):
        excite.design_trajectory("irp6", after=str(tmp_path))


@pytest.mark.parametrize(
    ("precision", "options", "message"),
    [
        (None, {}, "no precision is asked for"),
        (0.05, {"of": "hoped"}, "`of` must be one of measured, described, given 'hoped'"),
        (-1.0, {}, "precision"),
    ],
)
def test_bad_precisions_are_named(precision: float | None, options: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        excite.next_motion("irp6", precision, **options)
