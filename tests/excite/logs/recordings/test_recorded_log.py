"""Logs from recordings: clocks, alignment of streams, gaps, rows without values, faults."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_logs import Motion, motion, write_plotjuggler
from refused import refusal
from value_fuzzer import ROBOT

import excite
from excite.logs.mapping import LogMapping
from excite.logs.recordings import formats
from excite.logs.recordings.recording import Contents, Meaning, Recording, RecordingFormat, Stream, StreamContents
from regressors.errors import UnknownName

NS = 10**9
START = 1_700_000_000 * NS
MAGIC = b"recorded\0"


@dataclass
class Recorded:
    """A recording in memory."""

    streams: dict[str, dict[str, Any]]
    clocks: dict[str, tuple[str, ...]]
    meanings: dict[str, Meaning] = field(default_factory=dict)
    asked: list[Mapping[str, Sequence[str]]] = field(default_factory=list)

    def contents(self, path: Path) -> Contents:
        streams = []
        for name, columns in self.streams.items():
            clocks, rows = self.clocks[name], len(next(iter(columns.values())))
            meanings, units = {c: m for c, m in self.meanings.items() if c in columns}, dict.fromkeys(clocks, "ns")
            streams.append(StreamContents(name, tuple(columns), rows, clocks, meanings, units))
        return Contents(str(path), "recorded", tuple(streams))

    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        self.asked.append(wanted)
        streams = {n: Stream(n, {c: np.asarray(self.streams[n][c]) for c in some}) for n, some in wanted.items()}
        return Recording(str(path), "recorded", streams)


M = motion(2, rate=100.0, seconds=5.0)
STAMP = START + np.round(M.time * NS).astype(np.int64)
JS = {"position": "rad", "velocity": "rad/s", "effort": "Nm"}


def joint_states(**changes: Any) -> Recorded:
    """Positions at 100 Hz and efforts at 40 Hz in another topic, stamped in nanoseconds."""
    slow = np.arange(0.0, 4.9, 0.025) + 0.0013
    columns = {"/js/header/stamp": STAMP, "/js/message_time": STAMP + 2_000_000}
    columns |= {f"/js/{j}/{q}": x[:, k] for q, x in (("position", M.q), ("velocity", M.dq)) for k, j in enumerate("ab")}
    other = START + np.round(slow * NS).astype(np.int64)
    efforts = {"/motor/header/stamp": other, "/motor/message_time": other + 2_000_000}
    efforts |= {f"/motor/{j}/effort": 3.0 * slow + k for k, j in enumerate("ab")}
    streams: dict[str, dict[str, Any]] = {"/js": {**columns}, "/motor": {**efforts}}
    for name, values in changes.items():
        stream = f"/{name.partition('__')[0]}"
        streams[stream][f"/{name.replace('__', '/')}"] = values
    all_columns = [column.split("/") for some in streams.values() for column in some]
    measured = [(*words[-2:], "/".join(words)) for words in all_columns if words[-1] in JS]
    meanings = {column: Meaning(q, joint, JS[q], "sensor_msgs/JointState") for joint, q, column in measured}
    clocks = {name: (f"{name}/header/stamp", f"{name}/message_time") for name in streams}
    return Recorded(streams, clocks, meanings)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    (tmp_path / "bag").write_bytes(MAGIC + b"x" * 100)
    return tmp_path / "bag"


def use(patch: pytest.MonkeyPatch, recorded: Recorded) -> Recorded:
    form = RecordingFormat("recorded", lambda head, _: head.startswith(MAGIC), recorded.contents, recorded.read)
    patch.setattr(formats, "FORMATS", (form, *formats.FORMATS))
    return recorded


POSITION = {"columns": ["/js/a/position", "/js/b/position"], "unit": "rad"}
EFFORT = {"columns": ["/motor/a/effort", "/motor/b/effort"], "unit": "Nm"}
CLOCK = {"column": "/js/header/stamp", "unit": "ns"}
BASE = {"joints": ["a", "b"], "time": CLOCK, "position": POSITION}
MAPPING = LogMapping.model_validate({**BASE, "effort": EFFORT})


def test_streams_are_aligned_without_losing_digits(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recorded = use(monkeypatch, joint_states())
    log = excite.read_log(bag, mapping=MAPPING)
    np.testing.assert_allclose(log.time, M.time[1 : 1 + log.count], atol=1e-12)  # a float of the stamp has 2.4e-7
    np.testing.assert_array_equal(log.q, M.q[1 : 1 + log.count])
    np.testing.assert_allclose(log.effort, 3.0 * log.time[:, None] + [0, 1], atol=1e-9)
    assert log.row_numbers[0] == 2
    assert any("40 Hz" in note and "100 Hz" in note and "delay" in note for note in log.left_out)
    assert any("counted from 1700000000 s" in note for note in log.left_out)
    assert [name for some in recorded.asked[-1].values() for name in some] == [
        "/js/header/stamp", "/js/a/position", "/js/b/position",
        "/motor/header/stamp", "/motor/a/effort", "/motor/b/effort",
    ]  # fmt: skip


def test_definitions_need_no_mapping(bag: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    use(monkeypatch, joint_states())
    log = excite.read_log(bag)
    assert log.joints == ("a", "b")
    np.testing.assert_array_equal(log.dq, M.dq[1 : 1 + log.count])
    assert "/js/header/stamp is used, which increases and agrees with /js/message_time" in log.left_out[-1]
    with pytest.raises(UnknownName, match="a, b"):
        excite.read_log(bag, joints=["elbow"], mapping=MAPPING)
    assert "is a folder of no known format; known are recorded, MCAP" in refusal(excite.read_log, tmp_path)


@pytest.mark.parametrize("stamp", [np.zeros(500, np.int64), START + np.arange(500)[::-1], START + np.arange(500) * 7])
def test_headers_that_are_no_clock_leave_the_message_time(bag, monkeypatch, stamp) -> None:
    use(monkeypatch, joint_states(js__header__stamp=stamp))
    guess = excite.guess_mapping(bag)
    assert guess.mapping.time.column == "/js/message_time"
    assert any("/js/header/stamp does not increase as /js/message_time" in text for text in guess.recognised)


def test_gaps_of_the_slower_stream_are_not_bridged(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    efforts = 3.0 * np.arange(196.0)
    efforts[80:120] = np.nan  # from 1.9763 to 3.0013 s
    use(monkeypatch, joint_states(motor__a__effort=efforts))
    log = excite.read_log(bag, mapping=MAPPING)
    assert not np.any((log.time > 1.9763) & (log.time < 3.0013))
    assert log.removed[-1].numbers.size == 103


def test_commands_of_another_stream_hold_over_its_gaps_and_after_it(bag, monkeypatch: pytest.MonkeyPatch) -> None:
    commands = 3.0 * np.arange(196.0)
    commands[80:120] = np.nan
    use(monkeypatch, joint_states(motor__a__effort=commands))
    told = {**EFFORT, "unit": "rad"}
    log = excite.read_log(bag, mapping=LogMapping.model_validate({**BASE, "command": told}))
    np.testing.assert_array_equal(log.row_numbers, np.arange(2, 501))
    given = np.flatnonzero(np.isfinite(commands))
    last = given[np.searchsorted(0.0013 + 0.025 * given, log.time + 1e-9) - 1]
    np.testing.assert_array_equal(log.command[:, 0], 3.0 * last)
    assert any("40 Hz) held onto the rows" in note and "12 rows after the last one" in note for note in log.left_out)


def test_messages_without_some_joints_are_filled_in_time(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    a, b = M.q[:, 0].copy(), M.q[:, 1].copy()
    a[1::2], b[::2] = np.nan, np.nan  # two publishers in turn, each of its joint
    use(monkeypatch, joint_states(js__a__position=a, js__b__position=b))
    log = excite.read_log(bag, mapping=MAPPING)
    np.testing.assert_array_equal(np.diff(log.row_numbers), 2)
    np.testing.assert_allclose(log.q, M.q[log.row_numbers - 1], atol=2e-3)


def test_rows_of_the_positions_are_chosen(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, joint_states())
    log = excite.read_log(bag, mapping=MAPPING, only=(101, 200))
    np.testing.assert_array_equal(log.row_numbers, np.arange(101, 201))
    assert "given 101:900, but /js has 500 rows" in refusal(excite.read_log, bag, mapping=MAPPING, only=(101, 900))


SWAPPED, REPEATED = STAMP[[*range(100), 101, 100, *range(102, 500)]], STAMP[[*range(100), 99, *range(101, 500)]]
NEXT_DAY = START + 86400 * NS + np.arange(196) * 25_000_000
FAULTS = {
    "backwards": ({"js__header__stamp": SWAPPED}, "/js, row 102: time runs backwards"),
    "repeated": ({"js__header__stamp": REPEATED}, r"/js, row 101: .* is repeated; 1 row like this \(`drop='rep"),
    "infinite": ({"js__b__position": np.where(np.arange(500) == 7, np.inf, 0.0)}, "/js/b/position: row 8 is infinite"),
    "nothing": ({"motor__a__effort": np.full(196, np.nan)}, "/motor/a/effort: 0 values"),
    "other day": ({"motor__header__stamp": NEXT_DAY}, "one clock should have stamped both"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_end_in_one_line(bag: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    changes, said = FAULTS[name]
    use(monkeypatch, joint_states(**changes))
    told = refusal(excite.read_log, bag, mapping=MAPPING)
    assert re.search(said, told)
    assert str(bag) in told
    if name == "repeated":
        log = excite.read_log(bag, mapping=MAPPING, drop=["repeated"])
        assert 101 not in log.row_numbers
        assert "1 row with time repeated" in log.left_out


def test_missing_columns_name_those_there(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, joint_states())
    content = MAPPING.model_dump(exclude_unset=True)
    for section, change, said in (
        ("position", {"columns": ["/js/c/position"] * 2}, "/js/a/position"),
        ("time", {"column": "stamp"}, "/js/header/stamp"),
    ):
        wrong = LogMapping.model_validate({**content, section: {**content[section], **change}})
        with pytest.raises(UnknownName, match=said):
            excite.read_log(bag, mapping=wrong)


def test_a_recording_beside_a_text_gives_its_channels(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, joint_states())
    rows = "".join(f"{t + 1.7e9!r},{q},{q}\n" for t, q in zip(M.time.tolist(), M.q[:, 0].tolist(), strict=True))
    (bag.parent / "run.csv").write_text("t,q1,q2\n" + rows, encoding="utf-8")
    effort = {"file": "bag", "time": {"column": "/motor/header/stamp", "unit": "ns"}, **EFFORT}
    position = {"columns": ["q1", "q2"], "unit": "rad"}
    content = {"joints": ["a", "b"], "time": {"column": "t"}, "position": position, "effort": effort}
    log = excite.read_log(bag.parent / "run.csv", mapping=LogMapping.model_validate(content))
    np.testing.assert_allclose(log.effort[:, 0], 3.0 * log.time, atol=1e-5)


def test_read_recording_gives_columns_with_their_clocks(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, joint_states())
    streams = excite.read_recording(bag, ["/js/a/position"]).streams
    assert list(streams["/js"].columns) == ["/js/header/stamp", "/js/message_time", "/js/a/position"]
    with pytest.raises(UnknownName, match="/js/a/position"):
        excite.read_recording(bag, ["nothing"])


DELAY = 0.012  # s


@pytest.mark.slow
def test_delay_of_a_slower_stream_of_efforts_is_estimated(tmp_path: Path) -> None:
    (tmp_path / "two.yaml").write_text(ROBOT, encoding="utf-8")
    robot = excite.load_robot(str(tmp_path / "two.yaml"))
    search = excite.Search(starts=1, executor="serial")
    design = excite.design_trajectory(robot, trajectory=excite.TrajectoryChoice(harmonics=3, period=4.0), search=search)
    log = excite.simulate(design, rate=1000.0, torque_noise=(0.05,), seed=0).log
    tau = np.column_stack([np.interp(log.time - DELAY, log.time, each) for each in log.effort.T])
    recorded = Motion(log.time, log.q, log.dq, tau)
    path = write_plotjuggler(tmp_path / "run", recorded, robot.joint_names, every=4)  # efforts at 250 Hz
    result = excite.identify(robot, path, choose=("delay",))
    assert abs(result.recipe.delay - DELAY) < 1e-3
