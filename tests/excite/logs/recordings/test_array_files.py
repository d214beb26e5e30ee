"""NPZ, NPY, HDF5, MAT-files, Parquet and data sets of LeRobot: what was written comes back as columns."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from array_files import ROWS, Matlab73, motion, read_all, write_hdf5, write_lerobot, write_parquet
from hypothesis import given, settings as examples, strategies as st
from refused import refusal

from excite.logs.recordings.formats import format_of
from excite.logs.recordings.recording import Recording


def assert_motion(columns: Any, prefix: str, expected: dict[str, Any]) -> None:
    for name, values in expected.items():
        if values.ndim == 1:
            np.testing.assert_array_equal(columns[f"{prefix}{name}"], values)
        else:
            for k, column in enumerate(values.T):
                np.testing.assert_array_equal(columns[f"{prefix}{name}[{k}]"], column)


def test_npz(tmp_path: Path) -> None:
    for save in (np.savez, np.savez_compressed):
        save(tmp_path / "log.npz", **motion(), names=np.array(["a", "b"]), rate=1000.0)
        contents, recording = read_all(tmp_path / "log.npz")
        assert [(stream.rows, len(stream.columns)) for stream in contents.streams] == [(ROWS, 10)]
        assert_motion(recording.streams["arrays"].columns, "", motion())
        assert contents.notes == ("left out: names holds text",)


def test_json_of_arrays_and_of_rows(tmp_path: Path) -> None:
    lists = {name: values.tolist() for name, values in motion().items()}
    rows = [json.dumps(dict(zip(lists, row, strict=True))) for row in zip(*lists.values(), strict=True)]
    lines = "\n".join(rows)
    for text in (json.dumps(lists | {"names": ["a", "b"]}), f"[{','.join(rows)}]", lines, lines + '\n{"t'):
        (tmp_path / "log").write_text(text)
        contents, recording = read_all(tmp_path / "log")
        assert_motion(recording.streams["arrays"].columns, "", motion())
    assert contents.notes == ("left out: its last line was not written to its end",)


def test_names_of_joints_are_the_titles_of_as_many_columns(tmp_path: Path) -> None:
    h5py, names = pytest.importorskip("h5py", reason="h5py is not installed"), ["elbow", "base"]
    np.savez(tmp_path / "npz", t=motion()["t"], q=motion()["q"][:, :2], joint_names=np.array(names))
    with h5py.File(tmp_path / "hdf5", "w") as file:
        group = file.create_group("arm")
        group["t"], group["q"], group["names"] = motion()["t"], motion()["q"][:, :2], names
    for name, q in (("npz.npz", "q"), ("hdf5", "arm/q")):
        contents, recording = read_all(tmp_path / name)
        (stream,) = contents.streams
        assert [stream.title(f"{q}[{k}]") for k in range(2)] == [f"{q}/elbow", f"{q}/base"]
        assert (contents.notes, recording.notes) == ((), ())


def test_streams_of_an_npz_are_of_equal_length(tmp_path: Path) -> None:
    wrench = np.arange(60.0).reshape(10, 6)
    np.savez(tmp_path / "log.npz", **motion(), t_ft=np.arange(10) * 1e-2, wrench=wrench, turned=wrench.T)
    _, recording = read_all(tmp_path / "log.npz")
    assert list(recording.streams) == ["arrays", "arrays of 10 rows"]
    columns = recording.streams["arrays of 10 rows"].columns
    np.testing.assert_array_equal(columns["wrench[5]"], wrench[:, 5])
    np.testing.assert_array_equal(columns["turned[5]"], wrench[:, 5])


def test_npy_and_records(tmp_path: Path) -> None:
    np.save(tmp_path / "q.npy", motion()["q"])
    _, recording = read_all(tmp_path / "q.npy")
    assert_motion(recording.streams["arrays"].columns, "", {"q": motion()["q"]})
    records = np.zeros(5, np.dtype([("stamp", "i8"), ("q", "f4", 2)]))
    records["stamp"], records["q"] = 10**18 + np.arange(5), np.arange(10).reshape(5, 2)
    np.save(tmp_path / "log.npy", records)
    _, recording = read_all(tmp_path / "log.npy")
    (stream,) = recording.streams.values()
    np.testing.assert_array_equal(stream.columns["log.stamp"], 10**18 + np.arange(5))
    assert stream.columns["log.stamp"].dtype == np.int64
    np.testing.assert_array_equal(stream.columns["log.q[1]"], [1, 3, 5, 7, 9])


def test_hdf5_groups_have_clocks_of_their_own_or_that_of_the_file(tmp_path: Path) -> None:
    pytest.importorskip("h5py", reason="h5py is not installed")
    robot, sensor = motion(), motion(rows=ROWS, joints=6, seed=1)
    arrays = {f"robot/{name}": values for name, values in robot.items()}
    arrays |= {"ft/time": sensor["t"] + 5.0, "ft/data": sensor["q"], "rate": 1000.0}
    contents, recording = read_all(write_hdf5(tmp_path / "log.h5", arrays, {"robot/q": "deg"}))
    assert_motion(recording.streams["robot"].columns, "robot/", robot)
    assert_motion(recording.streams["ft"].columns, "ft/", {"data": sensor["q"]})
    units = next(stream.units for stream in contents.streams if stream.name == "robot")
    assert units == {f"robot/q[{k}]": "deg" for k in range(3)}
    arrays = {"time": motion()["t"], "arm/left/q": motion()["q"], "arm/right/q": motion()["dq"]}
    contents, _ = read_all(write_hdf5(tmp_path / "log.h5", arrays))
    assert [(stream.name, len(stream.columns)) for stream in contents.streams] == [("arrays", 7)]


def test_hdf5_leaves_out_what_is_elsewhere(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    (tmp_path / "secret").write_bytes(bytes(80))
    with h5py.File(write_hdf5(tmp_path / "log.h5", motion()), "a") as base:
        base.create_dataset("far", (10,), "f8", external=[(str(tmp_path / "secret"), 0, 80)])
        base["beyond"] = h5py.ExternalLink("other.h5", "/x")
        base["soft"] = h5py.SoftLink("/q")
        base["group/loop"] = base["/"]
        layout = h5py.VirtualLayout((10,), "f8")
        layout[:] = h5py.VirtualSource("other.h5", "x", (10,))
        base.create_virtual_dataset("virtual", layout)
    contents, recording = read_all(tmp_path / "log.h5")
    assert_motion(recording.streams["arrays"].columns, "", motion())
    assert {name.split("[")[0] for name in contents.columns} == {"t", "q", "dq", "tau"}


def matlab_variables() -> dict[str, Any]:
    """Struct, struct with time and signals, cell."""
    data = motion()
    return {
        "robot": {"t": data["t"][:, None], "q": data["q"], "dq": data["dq"].T, "label": "arm"},
        "out": {"time": data["t"][:, None], "signals": {"values": data["tau"], "label": "tau"}},
        "gain": np.array([[3.0]]),
    }


def assert_matlab(recording: Recording) -> None:
    data = motion()
    columns = {name: values for stream in recording.streams.values() for name, values in stream.columns.items()}
    assert_motion(columns, "robot.", {"t": data["t"], "q": data["q"], "dq": data["dq"]})
    assert_motion(columns, "out.signals.", {"values": data["tau"]})
    assert_motion(columns, "parts", {"[0]": data["q"]})
    assert_motion(columns, "arms[1].", {"q": data["dq"]})


@pytest.mark.parametrize("compressed", [False, True])
def test_matlab_5_to_7(tmp_path: Path, compressed: bool) -> None:
    data = motion()
    cell = np.empty((1, 2), dtype=object)
    cell[0, 0], cell[0, 1] = data["q"], "text"
    arms = np.zeros((1, 2), dtype=[("q", object)])
    arms[0, 0]["q"], arms[0, 1]["q"] = data["q"], data["dq"]
    variables = {**matlab_variables(), "parts": cell, "arms": arms}
    scipy.io.savemat(tmp_path / "log.mat", variables, do_compression=compressed)
    contents, recording = read_all(tmp_path / "log.mat")
    assert_matlab(recording)
    assert {stream.name for stream in contents.streams} == {"robot", "out", "arrays"}


def test_matlab_7_3(tmp_path: Path) -> None:
    pytest.importorskip("h5py", reason="h5py is not installed")
    data = motion()
    with Matlab73(tmp_path / "log.mat") as file:
        for name, value in matlab_variables().items():
            file.put(name, value)
        file.put("parts", [data["q"], "text"])
        file.put("arms", ({"q": data["q"]}, {"q": data["dq"]}))
        file.put_object("handle", "function_handle")
        file.put_object("series", "timeseries")
    contents, recording = read_all(tmp_path / "log.mat")
    assert contents.format == "MAT-file of MATLAB 7.3"
    assert_matlab(recording)
    (note,) = contents.notes
    assert "handle is a function handle" in note
    assert "series is an object of class timeseries" in note


SHAPES = st.tuples(st.integers(2, 12), st.integers(1, 6))


@given(SHAPES, st.booleans(), st.sampled_from(["f8", "f4", "i2", "u8", "?"]))
@examples(max_examples=30)
def test_any_array_beside_its_time(tmp_path_factory, shape, turned, kind) -> None:
    values = np.random.default_rng(0).integers(0, 2, shape).astype(kind)
    path = tmp_path_factory.mktemp("any") / "log.npz"
    np.savez(path, time=np.arange(shape[0]), x=values.T if turned and shape[0] != shape[1] else values)
    _, recording = read_all(path)
    columns = recording.streams["arrays"].columns
    names = ["x"] if shape[1] == 1 else [f"x[{k}]" for k in range(shape[1])]
    for name, column in zip(names, values.T, strict=True):
        np.testing.assert_array_equal(columns[name], column.astype(float))


@pytest.mark.parametrize("save", [np.save, np.savez])
def test_arrays_of_objects_are_refused(tmp_path: Path, save: Any) -> None:
    path = tmp_path / "log.npz"
    with path.open("wb") as stream:
        save(stream, np.array([{"a": 1}, None], dtype=object))
    form = format_of(path)
    assert "objects, which only code could read" in refusal(form.contents, path)


parquet = pytest.mark.skipif(find_spec("pyarrow") is None, reason="pyarrow is not installed")


@parquet
@pytest.mark.parametrize("compression", ["none", "snappy", "zstd"])
def test_lists_and_numbers(tmp_path: Path, compression: str) -> None:
    data = motion()
    columns = {**data, "label": ["x"] * ROWS, "flag": np.arange(ROWS) % 2 == 0}
    path = write_parquet(tmp_path / "log", columns, compression=compression, row_group_size=7)
    contents, recording = read_all(path)
    (stream,) = recording.streams.values()
    assert stream.rows == contents.streams[0].rows == ROWS
    assert_motion(stream.columns, "", data)
    np.testing.assert_array_equal(stream.columns["flag"], np.arange(ROWS) % 2 == 0)
    assert contents.notes == ("columns left out: label (string)",)


@parquet
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


@parquet
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


@parquet
def test_a_file_of_lerobot_has_the_names_of_its_data_set(tmp_path: Path) -> None:
    folder = write_lerobot(tmp_path / "set")
    contents, recording = read_all(folder / "data" / "chunk-000" / "episode_000001.parquet")
    assert "observation.state.shoulder.pos" in contents.columns
    assert recording.notes == ()
