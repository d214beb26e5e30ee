"""Files: a design read back is the design, the CSV is the motion, nothing is half-written, broken files are named."""

import dataclasses
import json
import os
import re
import stat
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import content_of, files_below, table_of
from hypothesis import given, settings, strategies as st
from refused import refusal
from written_files import text_file

from excite.design.design import Design
from excite.design.design_folder import save_design
from excite.design.design_json import load_design
from excite.design.optimisation import design_trajectory
from excite.design.start_results import read_starts
from excite.storage.atomic import replacing, write_json
from excite.storage.sampled_motion import motion_columns, write_motion_table
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.task import Task
from regressors.errors import InputError

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
# Joints 4 and 5 may not rest at zero: they do at 0.25 and -0.5.
POSITIONS = ((-2.9, 2.9), (-0.6, 0.6), (-0.6, 0.5), (0.25, 1.0), (-3.0, -0.5))


@pytest.fixture(scope="module")
def design() -> Design:
    limits = LimitChoice(position=POSITIONS, jerk=(20.0,))
    few = {"starts": 2, "harmonics": 4, "period": 8.0, "executor": "serial"}
    return design_trajectory(Task("irp6", rate=50.0, noise=(0.5,), limits=limits, **few))


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
    save_design(dataclasses.replace(design, measured=dataclasses.replace(design.measured, criteria=criteria)), tmp_path)
    content = content_of(tmp_path)
    assert (content["criteria"]["condition_number"], content["criteria"]["log_det"]) == (None, None)
    assert "Infinity" not in (tmp_path / "design.json").read_text()


def put(content: Any, value: Any, *path: str | int) -> None:
    """Set, change or leave out one field."""
    for step in path[:-1]:
        content = content[step]
    if value is GONE:
        del content[path[-1]]
    else:
        content[path[-1]] = value(content[path[-1]]) if callable(value) else value


GONE = object()
TAMPERED: tuple[tuple[str, Any, str], ...] = (
    ("schema", "excite.design/9", "expected schema excite.design/1, given 'excite.des"),
    ("schema", GONE, "expected schema excite.design/1, given None"),
    ("robot.sha256", "0" * 64, "the robot's description does not have the hash"),
    ("robot.description.limits.upper", [9.0] * 5, "does not have the hash"),
    ("robot", GONE, "not a complete design: 'robot' is missing"),
    ("robot.description.joints", GONE, "not a robot description: 'joints' is missing"),
    ("robot.description.limits.upper", ["a"] * 5, "not a robot description"),
    ("task.wheels", 3, "no option of a task named 'wheels'"),
    ("task.period", -1.0, "`period` must be a number from 0.001 to 100000 s, given -1"),
    ("task.joints", ["q9"], "no joint named 'q9'"),
    ("task.limits", 3, "not a complete design: "),
    ("trajectory", lambda t: {k: v[:2] if isinstance(v, list) else v for k, v in t.items()}, "for each of 3 joints"),
    ("trajectory.sine", GONE, "not a complete design: 'sine' is missing"),
    ("trajectory.harmonics", 5, "trajectory: expected 11 finite coefficients for each of 3"),
    ("trajectory.cosine", lambda rows: [rows[0][:-1], *rows[1:]], "not a complete design: "),
    ("trajectory.offset", [float("nan")] * 3, "NaN is not a finite number"),
)


def refusal_of(folder: Path, content: bytes) -> str:
    """The one line that refuses a design of this content."""
    (folder / "design.json").write_bytes(content)
    return refusal(load_design, folder, begins=str(folder / "design.json"))


def test_tampered_designs_are_refused(folder: Path, tmp_path: Path) -> None:
    for place, value, message in TAMPERED:
        content = content_of(folder)
        put(content, value, *place.split("."))
        assert message in refusal_of(tmp_path, json.dumps(content).encode()), place


def test_other_content_is_refused_with_the_line(folder: Path, tmp_path: Path) -> None:
    text = (folder / "design.json").read_bytes()
    for content, message in (
        (b"", r"is not JSON \(line 1: "),
        (text[: len(text) // 10], r"is not JSON \(line \d+: "),
        (text[:-9], r"is not JSON \(line \d+: "),
        (b"[1, 2]", "holds no JSON object"),
        (b"\xff\xfe\x00", "is not JSON"),
        (b"[" * 100_000, "nested too deeply"),
    ):
        assert re.search(message, refusal_of(tmp_path, content)), content[:9]


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
        assert "\n" not in str(error)  # noqa: PT017


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
    path = text_file(tmp_path_factory.mktemp("changed") / "design.json", json.dumps(content))
    read_or_refused(path)


def test_no_design_to_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"x holds no design: there is no .*x/design\.json"):
        load_design(tmp_path / "x")
    (tmp_path / "design.json").mkdir()
    with pytest.raises(InputError, match=r"cannot read .*design\.json: Is a directory"):
        load_design(tmp_path)


# trajectory.csv


def test_the_table_is_the_motion_to_the_last_bit_and_at_rest_at_both_ends(design: Design, folder: Path) -> None:
    header, values = table_of(folder / "trajectory.csv")
    names = [f"q{k}.{what}" for k in range(1, 6) for what in ("position", "velocity", "acceleration")]
    assert header == ["time", *names]
    time, (q, dq, ddq) = values[:, 0], np.moveaxis(values[:, 1:].reshape(-1, 5, 3), 2, 0)
    assert np.array_equal(time, np.linspace(0.0, 8.0, 401))
    again = motion_columns(design.robot.joint_names, design.sequence.sampled(1.0)[0])
    assert again[0] == header
    assert np.array_equal(again[1], values)
    samples = design.trajectory.samples(time)
    assert q[0] == pytest.approx(q[-1], abs=1e-12)
    assert not np.any([dq[[0, -1]], ddq[[0, -1]]])
    assert np.abs([design.samples.dq[[0, -1]], design.samples.ddq[[0, -1]]]).max() < 1e-12
    assert np.array_equal(q[:, :3], samples.q)
    assert np.array_equal([dq[1:-1, :3], ddq[1:-1, :3]], [samples.dq[1:-1], samples.ddq[1:-1]])
    assert np.all(q[:, 3:] == [0.25, -0.5])
    assert not np.any([dq[:, 3:], ddq[:, 3:]])
    for value, slope in ((q, dq), (dq, ddq)):
        central = (value[2:] - value[:-2]) / (time[2:] - time[:-2])[:, None]
        bend = np.abs(np.diff(slope, 2, axis=0)).max(axis=0)  # error of a central difference, h^2/6 q''', is a third
        assert np.all(np.abs(central - slope[1:-1]) <= bend + 1e-12)


def test_zeros_of_the_table_have_no_sign(tmp_path: Path) -> None:
    write_motion_table(tmp_path / "m.csv", ["time", "q"], np.array([[0.0, -0.0]]))
    assert (tmp_path / "m.csv").read_text(encoding="utf-8") == "time,q\n0,0\n"


# Complete or absent


@settings(max_examples=25)
@given(
    old=st.binary(max_size=50),
    new=st.binary(max_size=50),
    error=st.sampled_from([None, ValueError, SystemExit, KeyboardInterrupt]),
    binary=st.booleans(),
)
def test_a_file_is_the_old_one_or_the_new_one(
    old: bytes, new: bytes, error: type | None, binary: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("atomic")
    path = folder / "file"
    path.write_bytes(old)
    with suppress(error or ZeroDivisionError), replacing(path, "wb" if binary else "w") as stream:
        stream.write(new if binary else new.decode("latin-1"))
        stream.flush()
        assert path.read_bytes() == old
        if error:
            raise error
    written = new if binary else new.decode("latin-1").encode()
    assert path.read_bytes() == (old if error else written)
    assert files_below(folder) == {"file"}


def test_a_folder_that_is_not_there_or_closed(tmp_path: Path) -> None:
    for path, why in ((tmp_path / "none" / "file", "No such file or directory$"), (Path("/proc/file"), "")):
        with pytest.raises(InputError, match=rf"^cannot write {path}: {why}"), replacing(path):
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
    save_design(dataclasses.replace(design, notes=("another",)), tmp_path, replace=True)
    assert content_of(tmp_path)["notes"] == ["another"]
    assert files_below(tmp_path / "starts") == {"start-0000.json", "start-0001.json"}
