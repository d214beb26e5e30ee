"""Parquet and data sets of LeRobot: the columns that pyarrow wrote come back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from array_files import ROWS, motion, read_all, write_lerobot, write_parquet

pytest.importorskip("pyarrow", reason="pyarrow is not installed")


@pytest.mark.parametrize("compression", ["none", "snappy", "zstd"])
def test_lists_and_numbers(tmp_path: Path, compression: str) -> None:
    data = motion()
    columns = {**data, "label": ["x"] * ROWS, "flag": np.arange(ROWS) % 2 == 0}
    path = write_parquet(tmp_path / "log", columns, compression=compression, row_group_size=7)
    contents, recording = read_all(path)
    (stream,) = recording.streams.values()
    assert stream.rows == contents.streams[0].rows == ROWS
    np.testing.assert_array_equal(stream.columns["t"], data["t"])
    for name in ("q", "dq", "tau"):
        for k in range(3):
            np.testing.assert_array_equal(stream.columns[f"{name}[{k}]"], data[name][:, k])
    np.testing.assert_array_equal(stream.columns["flag"], np.arange(ROWS) % 2 == 0)
    assert contents.notes == ("columns left out: label (string)",)


def test_times_stay_whole_and_missing_numbers_are_nan(tmp_path: Path) -> None:
    import pyarrow as pa

    start = 1_700_000_000_000_000_000
    times = pa.array(start + 1_000_001 * np.arange(4), pa.timestamp("ns"))
    lists = pa.array([[1.0, 2.0], None, [3.0], [4.0, 5.0]])
    path = write_parquet(tmp_path / "log", {"when": times, "x": pa.array([1.0, None, 3.0, 4.0]), "q": lists})
    contents, recording = read_all(path)
    columns = recording.streams["table"].columns
    assert contents.streams[0].clocks == ("when",)
    assert contents.streams[0].units == {"when": "ns"}
    np.testing.assert_array_equal(columns["when"], start + 1_000_001 * np.arange(4))
    assert columns["when"].dtype == np.int64
    np.testing.assert_array_equal(columns["x"], [1, np.nan, 3, 4])
    np.testing.assert_array_equal(columns["q[1]"], [2, np.nan, np.nan, 5])
    assert recording.notes == ("2 lists have another length than the first; their values are NaN",)


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_data_sets_of_lerobot(tmp_path: Path, version: str) -> None:
    folder = write_lerobot(tmp_path / "set", version=version)
    contents, recording = read_all(folder)
    columns = recording.streams["table"].columns
    assert contents.format == f"Parquet of LeRobot {version}"
    assert contents.streams[0].clocks == ("timestamp",)
    np.testing.assert_array_equal(columns["observation.state.elbow.pos"], [1, 3, 5, 7, 9, 101, 103, 105, 107, 109])
    np.testing.assert_array_equal(columns["action.shoulder.pos"][:2], [0, -2])
    (note,) = recording.notes
    assert "2 episodes" in note
    assert "episode 1: rows 6:10" in note


def test_a_file_of_lerobot_has_the_names_of_its_data_set(tmp_path: Path) -> None:
    folder = write_lerobot(tmp_path / "set")
    contents, recording = read_all(folder / "data" / "chunk-000" / "episode_000001.parquet")
    assert "observation.state.shoulder.pos" in contents.columns
    assert recording.notes == ()
