"""NPZ, NPY, HDF5 and MAT-files: the arrays that were written come back as columns."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from array_files import ROWS, Matlab73, motion, read_all, write_hdf5
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from excite.logs.recordings.formats import format_of
from regressors.errors import InputError


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
    kind = np.dtype([("stamp", "i8"), ("q", "f4", 2)])
    records = np.zeros(5, kind)
    records["stamp"], records["q"] = 10**18 + np.arange(5), np.arange(10).reshape(5, 2)
    np.save(tmp_path / "log.npy", records)
    _, recording = read_all(tmp_path / "log.npy")
    (stream,) = recording.streams.values()
    np.testing.assert_array_equal(stream.columns["log.stamp"], 10**18 + np.arange(5))
    assert stream.columns["log.stamp"].dtype == np.int64
    np.testing.assert_array_equal(stream.columns["log.q[1]"], [1, 3, 5, 7, 9])


def test_hdf5_groups_have_clocks_of_their_own(tmp_path: Path) -> None:
    pytest.importorskip("h5py", reason="h5py is not installed")
    robot, sensor = motion(), motion(rows=ROWS, joints=6, seed=1)
    arrays = {f"robot/{name}": values for name, values in robot.items()}
    arrays |= {"ft/time": sensor["t"] + 5.0, "ft/data": sensor["q"], "rate": 1000.0}
    contents, recording = read_all(write_hdf5(tmp_path / "log.h5", arrays, {"robot/q": "deg"}))
    assert_motion(recording.streams["robot"].columns, "robot/", robot)
    assert_motion(recording.streams["ft"].columns, "ft/", {"data": sensor["q"]})
    units = next(stream.units for stream in contents.streams if stream.name == "robot")
    assert units == {f"robot/q[{k}]": "deg" for k in range(3)}


def test_hdf5_time_of_the_file_serves_its_groups(tmp_path: Path) -> None:
    pytest.importorskip("h5py", reason="h5py is not installed")
    arrays = {"time": motion()["t"], "arm/left/q": motion()["q"], "arm/right/q": motion()["dq"]}
    contents, _ = read_all(write_hdf5(tmp_path / "log.h5", arrays))
    assert [(stream.name, len(stream.columns)) for stream in contents.streams] == [("arrays", 7)]


def test_hdf5_compound_rows_and_compressed_columns(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    rows = np.zeros(ROWS, [("t", "f8"), ("q", "f4", 2)])
    rows["t"], rows["q"] = motion()["t"], motion()["q"][:, :2]
    with h5py.File(tmp_path / "log.h5", "w") as base:
        base.create_dataset("rows", data=rows, compression="gzip", chunks=(7,))
    _, recording = read_all(tmp_path / "log.h5")
    (stream,) = recording.streams.values()
    np.testing.assert_array_equal(stream.columns["rows.q[1]"], rows["q"][:, 1])


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


def assert_matlab(columns: dict[str, Any]) -> None:
    data = motion()
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
    scipy.io.savemat(
        tmp_path / "log.mat", {**matlab_variables(), "parts": cell, "arms": arms}, do_compression=compressed
    )
    contents, recording = read_all(tmp_path / "log.mat")
    columns = {name: values for stream in recording.streams.values() for name, values in stream.columns.items()}
    assert_matlab(columns)
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
    columns = {name: values for stream in recording.streams.values() for name, values in stream.columns.items()}
    assert_matlab(columns)
    (note,) = contents.notes
    assert "handle is a function handle" in note
    assert "series is an object of class timeseries" in note


SHAPES = st.tuples(st.integers(2, 12), st.integers(1, 6))


@given(SHAPES, st.booleans(), st.sampled_from(["f8", "f4", "i2", "u8", "?"]))
@examples(max_examples=30)
def test_any_array_beside_its_time(
    tmp_path_factory: pytest.TempPathFactory, shape: tuple[int, int], turned: bool, kind: str
) -> None:
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
    assert form is not None
    with pytest.raises(InputError, match="objects, which only code could read"):
        form.contents(path)
