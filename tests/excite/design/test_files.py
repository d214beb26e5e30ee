"""Files: a design read back is the design, the CSV is the motion, nothing is half-written, broken files are named."""

import dataclasses
import itertools
import json
import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import content_of, files_below, table_of
from hypothesis import given, settings
from hypothesis import strategies as st

from constraints.linear import linear_limits
from excite.design.design import Design
from excite.design.design_folder import save_design
from excite.design.design_json import load_design
from excite.design.optimisation import design_trajectory
from excite.design.start_results import read_starts
from excite.storage.atomic import read_json, replacing, write_json
from excite.storage.sampled_motion import motion_columns
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.task import Task
from regressors.errors import InputError, NumericalError

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
NAMES = ("q1", "q2", "q3", "q4", "q5")
WHAT = ("position", "velocity", "acceleration")
# Joints 4 and 5 may not rest at zero.
POSITIONS = ((-2.9, 2.9), (-0.6, 0.6), (-0.6, 0.5), (0.25, 1.0), (-3.0, -0.5))
RESTING = {"q4": 0.25, "q5": -0.5}


@pytest.fixture(scope="module")
def design() -> Design:
    task = Task(
        "irp6",
        starts=2,
        harmonics=4,
        period=8.0,
        rate=50.0,
        executor="serial",
        noise=(0.5,),
        limits=LimitChoice(position=POSITIONS, jerk=(20.0,)),
    )
    return design_trajectory(task)


@pytest.fixture(scope="module")
def folder(design: Design, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("designs") / "new" / "design"
    assert save_design(design, folder) == [folder / "design.json", folder / "trajectory.csv"]
    return folder


# Reading back


def test_design_read_back_is_the_design(design: Design, folder: Path) -> None:
    for place in (folder, str(folder), folder / "design.json"):
        stored = load_design(place)
        assert stored.folder == folder
        assert stored.task == design.task
        assert stored.robot.sha256() == design.robot.sha256()
        assert stored.moving.sha256() == design.moving.sha256()
        assert stored.trajectory.duration == design.trajectory.duration
    time = np.linspace(0.0, 8.0, 1001)
    read, made = stored.trajectory.samples(time), design.trajectory.samples(time)
    for name in ("q", "dq", "ddq", "dddq"):
        scale = np.abs(getattr(made, name)).max()
        assert np.allclose(getattr(read, name), getattr(made, name), rtol=0.0, atol=2e-15 * scale)


def test_content_survives_json(design: Design, folder: Path) -> None:
    content = content_of(folder)
    assert content["criteria"] == design.criteria
    assert content["base"]["singular_values"] == design.spectrum.tolist()
    assert content["predicted"]["noise"] == [0.5, 0.5, 0.5]
    assert [(*p.values(),)[1:] for p in content["predicted"]["parameters"]] == [
        (p.name, p.expression, p.unit, p.standard_deviation) for p in design.predicted
    ]
    for told, use in zip(content["limits"], design.limits, strict=True):
        assert told == {**vars(use), "holds": use.holds}
    assert content["provenance"] == design.provenance
    assert set(content["provenance"]["versions"]) >= {"excite-trajectories", "casadi", "numpy"}


def test_starts_are_written_and_read(design: Design, folder: Path) -> None:
    assert read_starts(folder / "starts") == list(design.starts)


def same_but_for_rounding(ours: Any, theirs: Any) -> None:
    """Entries of `theirs` are in `ours`, with the same numbers but for how sums are rounded."""
    if isinstance(theirs, dict):
        assert theirs.keys() <= ours.keys()
        for name, value in theirs.items():  # of extremes of one size, rounding decides which is the largest
            if name not in ("time", "extreme"):
                same_but_for_rounding(ours[name], value)
    elif isinstance(theirs, list):
        for our, their in zip(ours, theirs, strict=True):
            same_but_for_rounding(our, their)
    else:
        assert ours == (pytest.approx(theirs, rel=1e-9, abs=1e-12) if isinstance(theirs, float) else theirs)


@pytest.mark.parametrize("kept", ["new", "of the first schema"])
def test_a_loaded_design_is_written_as_it_was(kept: str, folder: Path, tmp_path: Path) -> None:
    before = folder if kept == "new" else SAMPLES / "design-1"
    loaded = load_design(before)
    assert loaded.feasible
    loaded.save(tmp_path / "again")
    same, stated = content_of(tmp_path / "again"), content_of(before)
    assert same["sha256"]["trajectory"] == stated.pop("sha256")["trajectory"]
    same_but_for_rounding(same, stated)
    assert read_starts(tmp_path / "again" / "starts") == read_starts(before / "starts") == list(loaded.starts)


def test_infinite_measures_are_null(design: Design, tmp_path: Path) -> None:
    criteria = {**design.criteria, "condition_number": float("inf"), "log_det": -float("inf")}
    save_design(replaced(design, measured=dataclasses.replace(design.measured, criteria=criteria)), tmp_path)
    content = content_of(tmp_path)
    assert (content["criteria"]["condition_number"], content["criteria"]["log_det"]) == (None, None)
    assert "Infinity" not in (tmp_path / "design.json").read_text()


def replaced(design: Design, **changes: object) -> Design:
    return dataclasses.replace(design, **changes)  # type: ignore[arg-type]


def without(content: dict[str, Any], *path: str) -> None:
    """Leave out one field."""
    for step in path[:-1]:
        content = content[step]
    del content[path[-1]]


def put(content: Any, value: object, *path: str | int) -> None:
    for step in path[:-1]:
        content = content[step]
    content[path[-1]] = value


TAMPERED: tuple[tuple[str, Callable[[dict[str, Any]], object], str], ...] = (
    (
        "other schema",
        lambda c: put(c, "excite.design/9", "schema"),
        "expected schema excite.design/1, given 'excite.des",
    ),
    ("no schema", lambda c: without(c, "schema"), "expected schema excite.design/1, given None"),
    ("hash", lambda c: put(c, "0" * 64, "robot", "sha256"), "the robot's description does not have the hash"),
    ("limit", lambda c: put(c, [9.0] * 5, "robot", "description", "limits", "upper"), "does not have the hash"),
    ("no robot", lambda c: without(c, "robot"), "not a complete design: 'robot' is missing"),
    ("robot of another kind", lambda c: put(c, [], "robot"), "not a complete design: "),
    (
        "no joints",
        lambda c: without(c, "robot", "description", "joints"),
        "not a robot description: 'joints' is missing",
    ),
    ("limits of a list", lambda c: put(c, [], "robot", "description", "limits"), "not a robot description: "),
    (
        "text in numbers",
        lambda c: put(c, ["a"] * 5, "robot", "description", "limits", "upper"),
        "not a robot description",
    ),
    ("unknown option", lambda c: put(c, 3, "task", "wheels"), "no option of a task named 'wheels'"),
    (
        "impossible option",
        lambda c: put(c, -1.0, "task", "period"),
        "`period` must be a number from 0.001 to 100000 s, given -1",
    ),
    ("unknown joint", lambda c: put(c, ["q9"], "task", "joints"), "no joint named 'q9'"),
    ("limits of a task", lambda c: put(c, 3, "task", "limits"), "not a complete design: "),
    ("no trajectory", lambda c: without(c, "trajectory"), "not a complete design: 'trajectory' is missing"),
    ("no sines", lambda c: without(c, "trajectory", "sine"), "not a complete design: 'sine' is missing"),
    (
        "harmonics",
        lambda c: put(c, 5, "trajectory", "harmonics"),
        "trajectory: expected 11 finite coefficients for each of 3",
    ),
    (
        "too few joints",
        lambda c: [c["trajectory"][p].pop() for p in ("offset", "cosine", "sine")],
        "for each of 3 joints",
    ),
    ("ragged", lambda c: c["trajectory"]["cosine"][0].pop(), "not a complete design: "),
    ("text in series", lambda c: put(c, ["x", "y", "z"], "trajectory", "offset"), "not a complete design: "),
    ("NaN in series", lambda c: put(c, [float("nan")] * 3, "trajectory", "offset"), "NaN is not a finite number"),
    ("no provenance", lambda c: without(c, "provenance"), "not a complete design: 'provenance' is missing"),
)


@pytest.mark.parametrize(("change", "message"), [row[1:] for row in TAMPERED], ids=[row[0] for row in TAMPERED])
def test_tampered_designs_are_refused(
    change: Callable[[dict[str, Any]], object], message: str, folder: Path, tmp_path: Path
) -> None:
    content = content_of(folder)
    change(content)
    path = tmp_path / "design.json"
    path.write_text(json.dumps(content))
    with pytest.raises(InputError) as refused:
        load_design(tmp_path)
    assert str(refused.value).startswith(f"{path}: ")
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("part", [0.0, 0.1, 0.5, 0.999])
def test_truncated_designs_are_refused_with_the_line(part: float, folder: Path, tmp_path: Path) -> None:
    text = (folder / "design.json").read_text()
    path = tmp_path / "design.json"
    path.write_text(text[: int(part * len(text))])
    with pytest.raises(InputError, match=r"design\.json is not JSON \(line \d+: ") as refused:
        load_design(tmp_path)
    assert "\n" not in str(refused.value)


def places(content: object, path: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """Paths of all fields."""
    if isinstance(content, dict):
        fields: list[tuple[str | int, object]] = list(content.items())
    else:
        fields = list(enumerate(content)) if isinstance(content, list) else []
    return [found for key, item in fields for found in ((*path, key), *places(item, (*path, key)))]


def read_or_refused(path: Path) -> None:
    try:
        load_design(path)
    except InputError as error:
        refusal = str(error)
    else:
        return
    assert "\n" not in refusal


@settings(max_examples=50)
@given(place=st.floats(0.0, 1.0), text=st.text(max_size=5))
def test_damaged_text_is_read_or_refused_in_one_line(
    place: float, text: str, folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    whole = (folder / "design.json").read_text()
    start = int(place * len(whole))
    path = tmp_path_factory.mktemp("damaged") / "design.json"
    path.write_text(whole[:start] + text + whole[start + 3 :], encoding="utf-8", errors="replace")
    read_or_refused(path)


@settings(max_examples=200)
@given(
    place=st.floats(0.0, 1.0, exclude_max=True),
    value=st.sampled_from([None, True, -1, 0, 10**400, float("nan"), "x", "inf", [], {}, [[1.0]]]),
)
def test_a_field_of_any_value_is_read_or_refused_in_one_line(
    place: float, value: object, folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    content = content_of(folder)
    known = [path for path in places(content) if path[0] in ("schema", "robot", "task", "trajectory", "provenance")]
    put(content, value, *known[int(place * len(known))])
    path = tmp_path_factory.mktemp("changed") / "design.json"
    path.write_text(json.dumps(content))
    read_or_refused(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"[1, 2]", "holds no JSON object"),
        (b"\xff\xfe\x00", "is not JSON"),
        (b"[" * 100_000, "nested too deeply"),
        (b"", "is not JSON (line 1: "),
    ],
)
def test_other_content_is_refused(content: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "design.json").write_bytes(content)
    with pytest.raises(InputError) as refused:
        read_json(tmp_path / "design.json")
    assert message in str(refused.value)


def test_no_design_to_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"x holds no design: there is no .*x/design\.json"):
        load_design(tmp_path / "x")
    (tmp_path / "design.json").mkdir()
    with pytest.raises(InputError, match=r"cannot read .*design\.json: Is a directory"):
        load_design(tmp_path)


# trajectory.csv


@pytest.fixture(scope="module")
def table(folder: Path) -> tuple[list[str], np.ndarray]:
    return table_of(folder / "trajectory.csv")


def column(table: tuple[list[str], np.ndarray], name: str, what: str) -> np.ndarray:
    header, values = table
    return values[:, header.index(f"{name}.{what}")]


def test_header_and_time(table: tuple[list[str], np.ndarray]) -> None:
    header, values = table
    assert header == ["time", *(f"{name}.{what}" for name in NAMES for what in WHAT)]
    assert np.array_equal(values[:, 0], np.linspace(0.0, 8.0, 401))
    assert np.allclose(np.diff(values[:, 0]), 0.02, rtol=1e-12)


def test_numbers_are_the_motions_to_the_last_bit(design: Design, table: tuple[list[str], np.ndarray]) -> None:
    header, values = motion_columns(design.robot.joint_names, design.sequence.sampled(1.0)[0])
    assert header == table[0]
    assert np.array_equal(values, table[1])
    samples = design.trajectory.samples(table[1][:, 0])
    for k, name in enumerate(NAMES[:3]):
        assert np.array_equal(column(table, name, "position"), samples.q[:, k])
        assert np.array_equal(column(table, name, "velocity")[1:-1], samples.dq[1:-1, k])
        assert np.array_equal(column(table, name, "acceleration")[1:-1], samples.ddq[1:-1, k])


def test_rest_at_both_ends_is_exact(table: tuple[list[str], np.ndarray]) -> None:
    for name in NAMES:
        position = column(table, name, "position")
        assert position[0] == pytest.approx(position[-1], abs=1e-12)
        for what in WHAT[1:]:
            assert column(table, name, what)[0] == column(table, name, what)[-1] == 0.0


def test_what_was_replaced_by_zeros_was_rounding(design: Design) -> None:
    samples = design.samples
    assert np.abs(samples.dq[[0, -1]]).max() < 1e-12
    assert np.abs(samples.ddq[[0, -1]]).max() < 1e-12


def test_resting_joints_stand_still_inside_their_limits(table: tuple[list[str], np.ndarray]) -> None:
    for name, position in RESTING.items():
        assert np.all(column(table, name, "position") == position)
        assert not np.any(column(table, name, "velocity"))
        assert not np.any(column(table, name, "acceleration"))


def test_each_column_is_the_slope_of_the_one_before(table: tuple[list[str], np.ndarray]) -> None:
    time = table[1][:, 0]
    for name in NAMES:
        for what, slope in itertools.pairwise(WHAT):
            value, given = column(table, name, what), column(table, name, slope)
            central = (value[2:] - value[:-2]) / (time[2:] - time[:-2])
            bend = np.abs(np.diff(given, 2)).max()  # error of a central difference, h^2/6 q''', is a third of it
            assert np.allclose(central, given[1:-1], rtol=0.0, atol=bend + 1e-12)


def test_limits_hold_in_the_samples(design: Design, table: tuple[list[str], np.ndarray]) -> None:
    # Limits of the whole robot on the file's columns: the transmission's matrix is used on all five joints.
    robot = design.task.limits.applied(design.robot)
    q, dq, ddq = (np.column_stack([column(table, name, what) for name in NAMES]) for what in WHAT)
    assert robot.transmission is not None
    C = robot.transmission.coupling
    for limits, values in (
        (robot.limits, (q, dq, ddq)),
        (robot.transmission.limits, (q @ C.T + robot.transmission.offset, dq @ C.T, ddq @ C.T)),
    ):
        assert np.all(values[0] >= limits.lower)
        assert np.all(values[0] <= limits.upper)
        assert np.all(np.abs(values[1]) <= limits.velocity)
        assert np.all(np.abs(values[2]) <= limits.acceleration)
    used = np.abs(ddq @ C.T).max(axis=0)[:3] / robot.transmission.limits.acceleration[:3]
    assert used.max() > 0.9  # and the motion is not a small one


def test_certificate_is_that_of_the_written_motion(design: Design, folder: Path) -> None:
    stored = load_design(folder)
    time = np.linspace(0.0, stored.trajectory.duration, 20_001)
    samples = stored.trajectory.samples(time)
    told = {limit["label"]: limit for limit in content_of(folder)["limits"]}
    seen = set()
    for limit in linear_limits(stored.moving):
        for k, label in enumerate(limit.labels):
            values, use = limit.values(samples)[:, k], told[label]
            extreme = values[np.argmax(np.minimum(limit.upper[k] - values, values - limit.lower[k]) * -1)]
            assert extreme == pytest.approx(use["extreme"], rel=1e-5, abs=1e-6)
            assert time[np.argmin(np.abs(time - use["time"]))] == pytest.approx(use["time"], abs=1e-3)
            assert use["margin"] == pytest.approx(abs(use["bound"] - use["extreme"]), rel=1e-12)
            seen.add(label)
    assert seen == {label for label, use in told.items() if use["quantity"] not in ("torque", "distance")}


# Complete or absent


def test_replacing_leaves_the_old_file_where_writing_fails(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("old")

    def fail(error: type[BaseException]) -> None:
        with replacing(path) as stream:
            stream.write("new and long")
            stream.flush()
            raise error

    for error in (ValueError, SystemExit, KeyboardInterrupt):
        with pytest.raises(error):
            fail(error)
        assert path.read_text() == "old"
        assert files_below(tmp_path) == {"file"}


@settings(max_examples=25)
@given(old=st.binary(max_size=50), new=st.binary(max_size=50), fails=st.booleans(), binary=st.booleans())
def test_a_file_is_the_old_one_or_the_new_one(
    old: bytes, new: bytes, fails: bool, binary: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("atomic")
    path = folder / "file"
    path.write_bytes(old)
    try:
        with replacing(path, "wb" if binary else "w") as stream:
            stream.write(new if binary else new.decode("latin-1"))
            assert path.read_bytes() == old
            if fails:
                raise RuntimeError
    except RuntimeError:
        assert fails
    written = new if binary else new.decode("latin-1").encode()
    assert path.read_bytes() == (old if fails else written)
    assert files_below(folder) == {"file"}


def test_json_that_cannot_be_written_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "file.json"
    write_json(path, {"a": 0.1})
    for content, error in (({"a": float("nan")}, NumericalError), ({"a": object()}, TypeError)):
        with pytest.raises(error):
            write_json(path, content)
        assert read_json(path) == {"a": 0.1}
    assert files_below(tmp_path) == {"file.json"}


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_survive_json(tmp_path_factory: pytest.TempPathFactory, value: float) -> None:
    path = tmp_path_factory.getbasetemp() / "number.json"
    write_json(path, {"a": value})
    read = read_json(path)["a"]
    assert np.float64(read).tobytes() == np.float64(value).tobytes()


def test_a_folder_that_is_not_there_or_closed(tmp_path: Path) -> None:
    with (
        pytest.raises(InputError, match=r"^cannot write .*none/file: No such file or directory$"),
        replacing(tmp_path / "none" / "file"),
    ):
        pass
    with pytest.raises(InputError, match=r"^cannot write /proc/file: "), replacing(Path("/proc/file")):
        pass


@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_mode_follows_the_umask(mask: int, mode: int, tmp_path: Path) -> None:
    before = os.umask(mask)
    try:
        write_json(tmp_path / "file.json", {})
        (tmp_path / "plain").write_text("")
        assert os.umask(mask) == mask  # looking at it has not changed it
    finally:
        os.umask(before)
    modes = {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("file.json", "plain")}
    assert modes == {mode}


# Folders


def test_a_design_is_kept_unless_forced(design: Design, tmp_path: Path) -> None:
    save_design(design, str(tmp_path))
    (tmp_path / "starts" / "start-0007.json").write_text("old")
    before = (tmp_path / "design.json").read_bytes()
    with pytest.raises(InputError, match="already holds a design; `replace` replaces it"):
        save_design(design, tmp_path)
    assert (tmp_path / "design.json").read_bytes() == before
    assert (tmp_path / "starts" / "start-0007.json").exists()
    save_design(replaced(design, notes=("another",)), tmp_path, replace=True)
    assert content_of(tmp_path)["notes"] == ["another"]
    assert files_below(tmp_path / "starts") == {"start-0000.json", "start-0001.json"}


def test_design_json_comes_last(design: Design, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("excite.design.design_folder.write_trajectory", broken)
    with pytest.raises(OSError, match="No space left"):
        save_design(design, tmp_path)
    assert files_below(tmp_path) == {"starts", "starts/start-0000.json", "starts/start-0001.json"}
