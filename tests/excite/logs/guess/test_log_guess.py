"""Logs written in any unit, order and text format are recognised or asked about, never silently wrong."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import (
    Motion,
    as_array,
    as_text,
    motion,
    numbered,
    write_folder,
    write_franka,
    write_plotjuggler,
    write_rtde,
    write_table,
)
from hypothesis import HealthCheck, given, settings, strategies as st
from refused import refusal

import excite
from excite.logs.guess.log_guess import mapping_text
from excite.logs.mapping import SECONDS, LogMapping, PositionSection, VelocitySection
from regressors.errors import InputError
from regressors.readers.documents import parse_document, validate

NAMES = ("shoulder_pan_joint", "wrist_1_joint", "wrist_2_joint")


@pytest.fixture(scope="module")
def moved() -> Motion:
    return motion()


def assert_read(log: excite.Log, true: Motion) -> None:
    for read, moved in ((log.q, true.q), (log.dq, true.dq), (log.effort, true.tau)):
        np.testing.assert_array_equal(read, moved)


def test_rtde_recordings_need_no_mapping_but_gains_of_currents(tmp_path: Path, moved: Motion) -> None:
    for mark in (" ", ","):
        log = excite.read_log(write_rtde(tmp_path / "r", moved, mark))
        assert log.joints == ("1", "2", "3")
        assert_read(log, moved)
        np.testing.assert_array_equal(log.command, moved.q + 0.01)
        assert "read as Universal Robots RTDE recording" in log.left_out[-1]
    path = write_rtde(tmp_path / "r", moved, torque="target_moment")
    (question,) = excite.guess_mapping(path).questions
    assert "gain" in question
    assert re.search(r"gain of each motor current .*`guess_mapping`", refusal(excite.read_log, path))


def test_franka_log_is_in_milliseconds(tmp_path: Path) -> None:
    moved, robot = motion(7), excite.load_robot("panda")
    log = excite.read_log(write_franka(tmp_path / "f", moved), robot=robot)
    assert log.joints == robot.joint_names
    np.testing.assert_allclose(log.time, moved.time, atol=1e-12)
    assert_read(log, moved)


@pytest.mark.parametrize("shift", [0.0, 0.003])
def test_topics_of_plotjuggler_are_aligned(tmp_path: Path, moved: Motion, shift: float) -> None:
    log = excite.read_log(write_plotjuggler(tmp_path / "p", moved, NAMES, every=4, shift=shift))
    assert log.joints == NAMES
    rows, slow = np.rint(log.time * 100).astype(int), moved.time[::4] + shift
    np.testing.assert_array_equal([log.q, log.dq], [moved.q[rows], moved.dq[rows]])
    for column, tau in zip(log.effort.T, moved.tau.T, strict=True):
        at = np.interp(slow, moved.time, tau)
        np.testing.assert_allclose(column, np.interp(log.time, slow, at), atol=1e-3)  # stamps have 0.24 us
    (note,) = [text for text in log.left_out if "interpolated" in text]
    assert "25 Hz" in note
    assert "100 Hz" in note


@pytest.mark.parametrize("writer", [as_array, as_text])
def test_one_file_per_signal(tmp_path: Path, moved: Motion, writer: object) -> None:
    folder = write_folder(tmp_path / "signals", moved, writer)  # type: ignore[arg-type]
    guess = excite.guess_mapping(folder)
    assert [text.split()[0] for text in guess.questions] == ["The", "Are"]  # efforts, rad
    log = excite.read_log(folder, NAMES, guess.mapping.model_copy(update={"joints": list(NAMES)}))
    np.testing.assert_array_equal(log.time, moved.time)
    assert_read(log, moved)


@dataclass(frozen=True)
class Written:
    """How a table is written."""

    time: str
    position: str
    velocity: str | None
    stated: bool
    mark: str
    names: tuple[str, ...]
    time_first: bool
    reach: float
    unit_row: bool


WORDS = (("q", "dq", "tau"), ("pos", "vel", "torque"), ("joint_position", "joint_velocity", "motor"), ("a", "b", "c"))
pick, either = st.sampled_from, st.booleans()
UNITS = (pick(list(SECONDS)), pick(["rad", "deg", "turns"]), pick(["rad/s", "deg/s", "rpm", None]))
FORMS = (either, pick([",", ";", "\t", " "]), pick(WORDS), either, pick([0.02, 1.0, 30.0]), either)
TABLES = st.builds(Written, *UNITS, *FORMS)


def write_any(path: Path, moved: Motion, how: Written) -> Path:
    """A table in the units of `how`."""
    position, velocity, effort = how.names
    parts = {position: (moved.q / PositionSection.units[how.position], how.position), effort: (moved.tau, "Nm")}
    if how.velocity is not None:
        parts[velocity] = (moved.dq / VelocitySection.units[how.velocity], how.velocity)
    names, units, columns = ["t"], [how.time], [moved.time[:, None] / SECONDS[how.time] + 5.0]
    for name, (values, unit) in parts.items():
        names += numbered([name], moved.n, "{}{}")
        units += [unit] * moved.n
        columns.append(values)
    order = np.arange(len(names)) if how.time_first else np.roll(np.arange(len(names)), -1)
    table = np.hstack(columns)[:, order].tolist()
    names, units = [names[k] for k in order], [units[k] for k in order]
    if how.stated and not how.unit_row:
        names = [f"{name}[{unit}]" for name, unit in zip(names, units, strict=True)]
    if how.stated and how.unit_row:
        table = [units, *table]
    return write_table(path, names, table, how.mark)


@pytest.mark.slow
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(how=TABLES, seed=st.integers(0, 20))
def test_units_are_right_or_asked(tmp_path: Path, how: Written, seed: int) -> None:
    moved = motion(seed=seed, reach=how.reach)
    guess = excite.guess_mapping(write_any(tmp_path / "any", moved, how))
    asked = " ".join(guess.questions)
    if guess.mapping is None:
        assert guess.questions
        return
    mapping = guess.mapping
    if "time in" not in asked:
        assert mapping.time.unit == how.time
    if "positions" not in asked:
        assert mapping.position.unit == [how.position]
        if mapping.velocity is not None and "velocit" not in asked:
            assert mapping.velocity.unit == [how.velocity]
    if how.stated:
        assert mapping.position.unit == [how.position]
        assert mapping.time.unit == how.time
    if not guess.questions:
        log = excite.read_log(Path(guess.contents.source))
        np.testing.assert_allclose(log.q, moved.q, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(log.effort, moved.tau, rtol=1e-12, atol=1e-12)
    assert validate(parse_document(mapping_text(guess), "mapping"), LogMapping) == mapping


def test_velocities_in_other_units_show_those_of_positions_and_of_other_joints_are_asked(tmp_path, moved) -> None:
    how = Written("ms", "deg", "rad/s", False, ",", ("q", "dq", "tau"), True, 1.0, False)
    guess = excite.guess_mapping(write_any(tmp_path / "any", moved, how))
    assert (guess.mapping.position.unit, guess.mapping.time.unit) == (["deg"], "ms")
    assert [question.split()[1] for question in guess.questions] == ["efforts"]
    swapped = Motion(moved.time, moved.q, moved.dq[:, [1, 0, 2]] * [1, 1, -1], moved.tau)
    how = replace(how, time="s", position="rad", stated=True)
    guess = excite.guess_mapping(write_any(tmp_path / "any", swapped, how))
    assert any("same sign" in question for question in guess.questions)


def test_velocities_tell_the_rate_of_rows_without_a_time(tmp_path: Path, moved: Motion) -> None:
    names = numbered(["q", "dq", "tau"], moved.n)
    rows = np.column_stack([moved.q, moved.dq, moved.tau])
    guess = excite.guess_mapping(write_table(tmp_path / "n", names, rows.tolist()))
    assert guess.mapping.time.model_dump(exclude_unset=True) == {"rate": 100.0}
    assert any(text.startswith("Are there 100 rows in a second? No column increases") for text in guess.questions)
    assert validate(parse_document(mapping_text(guess), "mapping"), LogMapping) == guess.mapping
    names = [f"{name} [{'deg' if name[0] == 'q' else 'rad/s'}]" for name in names[: 2 * moved.n]]
    guess = excite.guess_mapping(write_table(tmp_path / "n", names, rows[:, : 2 * moved.n].tolist()))
    assert guess.mapping.time.rate == 5730.0  # as of degrees
    slow = np.column_stack([moved.q, 1e-4 * moved.dq]).tolist()
    for some, few in ((names, slow), (names[: moved.n], moved.q.tolist())):
        guess = excite.guess_mapping(write_table(tmp_path / "n", some, few))
        assert guess.mapping is None
        assert guess.questions[0].endswith("increases; a mapping may state a rate of rows: `time: {rate: HZ}`")


def test_columns_without_names_are_found_by_their_numbers(tmp_path: Path, moved: Motion) -> None:
    rows = np.column_stack([moved.time + 100.0, moved.q, moved.dq, moved.tau, 0.5 * moved.tau]).tolist()
    guess = excite.guess_mapping(write_table(tmp_path / "n", None, rows))
    found = (guess.mapping.position, guess.mapping.velocity, guess.mapping.effort)
    assert [section.columns for section in found] == [[2, 3, 4], [5, 6, 7], [8, 9, 10]]
    assert "columns 8 ... 10, or columns 11 ... 13" in " ".join(guess.questions)


ARM = excite.load_robot("ur10e").joint_names
MIXED = [ARM[k] for k in (2, 1, 0, 3, 4, 5)]  # as drivers publish them, by the alphabet
LIST = f'"{MIXED}"'
PRINTED = {  # header, and what stands before the numbers of a row by its seconds and nanoseconds
    "rostopic echo -p": (
        ["%time", *numbered(["field.name", "field.position", "field.velocity", "field.effort"], 6, "{}{}")],
        lambda s, ns: [10**9 * s + ns, *MIXED],
    ),
    "bagpy": (
        ["Time", "header.stamp.secs", "name", *numbered(["position", "velocity", "effort"], 6)],
        lambda s, ns: [s + 1e-9 * ns, s, LIST],
    ),
    "stamp in two columns": (
        ["stamp.sec", "stamp.nanosec", *numbered(["name", "position", "velocity", "effort"], 6, "{}[{}]")],
        lambda s, ns: [s, ns, *MIXED],
    ),
    "ros2 topic echo --csv": (None, lambda s, ns: [s, ns, "", *MIXED]),
}


@pytest.mark.parametrize("name", PRINTED)
def test_printed_messages_of_joints_are_taken_by_the_names_in_them(tmp_path: Path, name: str) -> None:
    (header, before), six, robot = PRINTED[name], motion(6), excite.load_robot("ur10e")
    stamps = [(1_700_000_000 + ns // 10**9, ns % 10**9) for ns in np.round(1e9 * six.time).astype(int).tolist()]
    order = [ARM.index(joint) for joint in MIXED]
    six.dq[0] = 0.0  # the same number several times in the first row, which is no header
    numbers = np.column_stack([six.q[:, order], six.dq[:, order], six.tau[:, order]]).tolist()
    rows = [[*before(*stamp), *row] for stamp, row in zip(stamps, numbers, strict=True)]
    path = write_table(tmp_path / "log.csv", header, rows)
    log = excite.read_log(path, robot=robot)
    assert_read(log, six)
    np.testing.assert_allclose(log.time - log.time[0], six.time, rtol=0, atol=1e-6)
    mapping = excite.guess_mapping(path, robot).mapping
    assert_read(excite.read_log(path, mapping=mapping, robot=robot), six)
    text = path.read_text().replace(LIST, "run").replace(MIXED[0], MIXED[1])
    path.write_text(text)  # no name for each joint any more
    assert excite.guess_mapping(path, robot).questions


def test_messages_in_json_are_taken_by_the_names_in_them(tmp_path: Path) -> None:
    six, order = motion(6), [ARM.index(joint) for joint in MIXED]
    parts = {"position": six.q[:, order], "velocity": six.dq[:, order], "effort": six.tau[:, order]}
    rows = [
        {"header": {"stamp": {"sec": 1_700_000_000 + ns // 10**9, "nanosec": ns % 10**9}}, "name": MIXED}
        | {of: values[k].tolist() for of, values in parts.items()}
        for k, ns in enumerate(np.round(1e9 * six.time).astype(int).tolist())
    ]
    path, robot = tmp_path / "log", excite.load_robot("ur10e")
    for text in (json.dumps(rows), "\n".join(map(json.dumps, rows))):
        path.write_text(text)
        mapping = excite.guess_mapping(path, robot).mapping
        assert mapping.position.columns[0] == "position[2]"
        assert_read(excite.read_log(path, mapping=mapping, robot=robot), six)


def test_dates_and_german_names_are_read(tmp_path: Path, moved: Motion) -> None:
    start = datetime(2026, 11, 2, 9, 30, tzinfo=UTC)
    stamps = [(start + timedelta(seconds=t)).isoformat(timespec="milliseconds") for t in moved.time.tolist()]
    header = ["Zeit", *numbered(["Achse"], 3, "{}{} Istposition [Grad]"), *numbered(["Achse"], 3, "{}{} Moment [Nm]")]
    table = np.column_stack([np.degrees(moved.q), moved.tau]).tolist()
    rows = [[stamp, *(f"{x:.17g}".replace(".", ",") for x in row)] for stamp, row in zip(stamps, table, strict=True)]
    log = excite.read_log(write_table(tmp_path / "log.csv", header, rows, ";"))
    np.testing.assert_allclose(log.time - log.time[0], moved.time, rtol=0, atol=1e-6)
    np.testing.assert_allclose(log.q, moved.q, rtol=1e-14)
    np.testing.assert_array_equal(log.effort, moved.tau)
    damaged = [*rows[:50], ["2026-11-02 at noon", *rows[50][1:]], *rows[50:]]
    path = write_table(tmp_path / "damaged.csv", header, damaged, ";")
    assert "1 line holds no row of numbers: line 52" in excite.read_log(path).left_out


def test_positions_without_a_name_and_efforts_in_percent_are_asked_about(tmp_path: Path, moved: Motion) -> None:
    header = ["time", *numbered(["$AXIS_ACT.A"], 3, "{}{}"), *numbered(["Torque"], 3, "{} {} [%]")]
    rows = np.column_stack([moved.time, np.degrees(moved.q), moved.tau]).tolist()
    guess = excite.guess_mapping(write_table(tmp_path / "log.csv", header, rows))
    assert guess.mapping.position.columns == header[1:4]
    assert "Are the positions of all joints $AXIS_ACT.A0 ... $AXIS_ACT.A2?" in guess.questions
    assert any("are in % of a torque of each joint" in question for question in guess.questions)


@pytest.mark.parametrize("copy", ["filt_{}", "{}_filtered", "{}_lp"])
def test_a_filtered_copy_is_not_proposed_beside_its_channel(tmp_path: Path, moved: Motion, copy: str) -> None:
    own, table = ["q1", "q2", "tau1", "tau2"], np.column_stack([moved.q[:, :2], moved.tau[:, :2]])
    rows = np.column_stack([moved.time, 0.9 * table, table]).tolist()
    guess = excite.guess_mapping(write_table(tmp_path / "log.csv", ["t", *map(copy.format, own), *own], rows))
    assert (guess.mapping.position.columns, guess.mapping.effort.columns) == (own[:2], own[2:])
    assert not any(copy.format(name) in question for question in guess.questions for name in ("q1", "tau1"))


def test_joints_of_a_robot_are_taken_by_name(tmp_path: Path) -> None:
    robot, six = excite.load_robot("ur10e"), motion(6)
    names = [*reversed(robot.joint_names), "finger"]
    seven = Motion(six.time, *(np.column_stack([x[:, ::-1], x[:, 0]]) for x in (six.q, six.dq, six.tau)))
    log = excite.read_log(write_plotjuggler(tmp_path / "p", seven, names, every=1), robot=robot)
    assert log.joints == robot.joint_names
    np.testing.assert_array_equal(log.q, six.q)
    few = write_plotjuggler(tmp_path / "few", motion(3), list(robot.joint_names[3:]), every=1)
    assert excite.read_log(few, robot=robot).joints == robot.joint_names[3:]
    other = write_plotjuggler(tmp_path / "other", six, list("abcdef"), every=1)
    with pytest.raises(InputError, match=r"Are the joints a, b, c, d, e, f .* shoulder_pan_joint"):
        excite.read_log(other, robot=robot)


def test_actions_beside_states_are_commands_in_the_same_unit(tmp_path: Path, moved: Motion) -> None:
    names = [f"{what}.{joint}.pos" for what in ("observation.state", "action") for joint in ("pan", "lift", "elbow")]
    rows = np.column_stack([moved.time, np.degrees(moved.q), np.degrees(moved.q) + 1.0])
    mapping = excite.guess_mapping(write_table(tmp_path / "set", ["timestamp", *names], rows.tolist())).mapping
    assert (mapping.position.columns, mapping.command.columns) == (names[:3], names[3:])
    assert mapping.position.unit == mapping.command.unit == ["deg"]


def test_the_rate_of_a_jittering_clock_is_its_mean_outside_gaps(tmp_path: Path) -> None:
    step = np.tile([0.010, 0.010, 0.012], 200)
    step[300] = 2.0
    time = np.concatenate([[0.0], np.cumsum(step)])
    table = np.column_stack([time, np.sin(time), np.cos(time)]).tolist()
    (summary,) = excite.guess_mapping(write_table(tmp_path / "log.csv", ["time", "q1", "dq1"], table)).summaries
    assert (summary.gaps, round(summary.rate, 2)) == (1, round(599 / (sum(step) - 2.0), 2))
