"""Commands for arms of hobby servos, read back by pyarrow, and beside states as a log."""

from __future__ import annotations

import json
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import excite
from excite.design.design import Design
from excite.logs.mapping import read_mapping
from regressors.errors import InputError


@cache
def design() -> Design:
    return excite.design_trajectory("so101", model="servo", starts=1, rate=50.0)


def test_a_data_set_has_the_commands_in_degrees_and_where_they_are(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    made = design()
    exported = excite.export_motion(made, "lerobot", tmp_path / "arm")
    assert [path.name for path in exported.files] == ["arm", "arm.mapping.yaml"]
    info = json.loads((tmp_path / "arm/meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["total_episodes"]) == ("v3.0", 50, 1)
    assert info["excite"]["coefficients_sha256"] == made.coefficients_sha256
    assert info["features"]["action"]["names"] == [f"{name}.pos" for name in made.robot.joint_names]
    data = tmp_path / "arm" / info["data_path"].format(chunk_index=0, file_index=0)
    frames = parquet.read_table(data).to_pydict()
    assert set(frames) == set(info["features"])
    time = np.arange(info["total_frames"]) / 50.0
    q = made.sequence.at(time)[0].q
    action = np.array(frames["action"])
    assert np.abs(action[:, :5] - np.degrees(q[:, :5])).max() < 1e-4
    low, high = made.robot.limits.lower[5], made.robot.limits.upper[5]
    assert np.abs(action[:, 5] - 100.0 * (q[:, 5] - low) / (high - low)).max() < 1e-4
    assert 0.0 <= action[:, 5].min() < action[:, 5].max() <= 100.0
    assert np.abs(np.array(frames["timestamp"]) - time).max() < 1e-5
    assert frames["frame_index"] == frames["index"] == list(range(time.size))
    (episode,) = parquet.read_table(tmp_path / "arm/meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert (episode["dataset_from_index"], episode["dataset_to_index"]) == (0, time.size) == (0, episode["length"])
    (task,) = parquet.read_table(tmp_path / "arm/meta/tasks.parquet").to_pylist()
    assert episode["tasks"] == [task["task"]]


def test_a_data_set_is_replaced_only_where_that_is_asked_for_by_the_same_bytes(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    excite.export_motion(design(), "lerobot", tmp_path / "arm")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match=r"arm/meta/info\.json already there"):
        excite.export_motion(design(), "lerobot", tmp_path / "arm")
    excite.export_motion(design(), "lerobot", tmp_path / "arm", replace=True)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_where_no_folder_can_be_made_one_line_says_so(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    (tmp_path / "arm").write_text("a file")
    with pytest.raises(InputError, match=r"cannot write .*arm: Not a directory"):
        excite.export_motion(design(), "lerobot", tmp_path / "arm", replace=True)
    assert (tmp_path / "arm").read_text() == "a file"


def test_without_pyarrow_the_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"the format lerobot needs pyarrow: .*'excite-trajectories\[parquet\]'"):
        excite.export_motion(design(), "lerobot", tmp_path / "arm")
    assert not list(tmp_path.iterdir())


def test_a_rate_must_be_a_whole_number_of_frames(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"`rate` 30\.5 Hz: the format lerobot has a whole number of frames"):
        excite.export_motion(design(), "lerobot", tmp_path / "arm", rate=30.5)
    assert not list(tmp_path.iterdir())


def test_a_list_of_positions_is_read_back_beside_the_states_of_servos(tmp_path: Path) -> None:
    excite.export_motion(design(), "sage", tmp_path / "run/control.csv")
    control = (tmp_path / "run/control.csv").read_text()
    (tmp_path / "run/state_motor.csv").write_text(control.replace("CONTROL", "STATE_MOTOR"))
    log = excite.read_log(tmp_path / "run", robot=design().robot)
    q = design().sequence.at(log.time)[0].q
    assert np.abs(log.command - q).max() < 1e-6
    assert np.abs(log.q - q).max() < 1e-6


def test_the_mapping_reads_commands_and_positions(tmp_path: Path) -> None:
    names = design().robot.joint_names
    exported = excite.export_motion(design(), "sage", tmp_path / "control.csv")
    mapping = read_mapping(exported.files[-1])
    assert mapping.design == design().coefficients_sha256
    rng, head = np.random.default_rng(0), ["time", *(f"{n}.{what}" for what in ("command", "position") for n in names)]
    table = np.column_stack([np.arange(50) / 50.0, rng.normal(size=(50, 12))])
    rows = [",".join(head), *(",".join(f"{value:.17g}" for value in row) for row in table)]
    (tmp_path / "recording.csv").write_text("\n".join(rows) + "\n")
    log = excite.read_log(tmp_path / "recording.csv", None, mapping, robot=design().robot)
    assert np.array_equal(np.column_stack([log.command, log.q]), table[:, 1:])
