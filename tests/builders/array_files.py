"""Files of arrays as NumPy, h5py, SciPy, pyarrow and MATLAB 7.3 lay them out."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from excite.logs.recordings.formats import format_of
from excite.logs.recordings.recording import Contents, Recording
from regressors.errors import InputError

ROWS = 40


def read_all(path: Path) -> tuple[Contents, Recording]:
    """Contents of a recording, and all of its columns."""
    form = format_of(path)
    if form is None:
        raise InputError("not a recording")
    contents = form.contents(path)
    return contents, form.read(path, {stream.name: stream.columns for stream in contents.streams})


def motion(rows: int = ROWS, joints: int = 3, seed: int = 0) -> dict[str, NDArray[Any]]:
    """Time and positions, velocities and torques of some joints."""
    random = np.random.default_rng(seed)
    q, dq, tau = (random.normal(size=(rows, joints)) for _ in range(3))
    return {"t": 1e-3 * np.arange(rows), "q": q, "dq": dq, "tau": tau}


class Matlab73:
    """A file as MATLAB 7.3 writes it: a user block, the attribute MATLAB_class, columns first, references."""

    def __init__(self, path: Path) -> None:
        import h5py

        self.path = path
        self.base = h5py.File(path, "w", userblock_size=512)
        self.refs = 0

    def __enter__(self) -> Matlab73:
        return self

    def __exit__(self, *_: object) -> None:
        self.base.close()
        head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Jan  5 10:00:00 2026 HDF5 schema 1.00 ."
        with self.path.open("r+b") as stream:
            stream.write(head.ljust(116) + bytes(8) + b"\x00\x02IM")

    def put(self, name: str, value: Any, group: Any = None) -> None:
        """A variable: array, text, struct (dict), cell (list), array of structs (tuple of dicts)."""
        group = self.base if group is None else group
        if isinstance(value, Mapping):
            inner = group.create_group(name)
            self._mark(inner, "struct")
            for key, field in value.items():
                self.put(key, field, inner)
        elif isinstance(value, tuple):
            inner = group.create_group(name)
            self._mark(inner, "struct")
            for key in value[0]:
                self._references(inner, key, [element[key] for element in value])
        elif isinstance(value, list):
            self._mark(self._references(group, name, value), "cell")
        elif isinstance(value, str):
            data = group.create_dataset(name, data=np.array([[ord(c)] for c in value], dtype=np.uint16))
            self._mark(data, "char")
        else:
            array = np.atleast_2d(np.asarray(value))
            kind = {"f8": "double", "f4": "single", "u1": "logical"}.get(array.dtype.str[1:], str(array.dtype))
            data = group.create_dataset(name, data=array.T)
            self._mark(data, kind)

    def put_object(self, name: str, kind: str) -> None:
        """An object of a class, or a function handle."""
        data = self.base.create_dataset(name, data=np.zeros((1, 6), dtype=np.uint32))
        self._mark(data, kind)
        data.attrs["MATLAB_object_decode"] = np.int32(3)

    def _references(self, group: Any, name: str, values: list[Any]) -> Any:
        import h5py

        refs = self.base.require_group("#refs#")
        data = group.create_dataset(name, (len(values), 1), dtype=h5py.ref_dtype)
        for k, value in enumerate(values):
            self.refs += 1
            self.put(f"r{self.refs}", value, refs)
            data[k, 0] = refs[f"r{self.refs}"].ref
        return data

    def _mark(self, one: Any, kind: str) -> None:
        one.attrs["MATLAB_class"] = np.bytes_(kind)


def write_hdf5(path: Path, arrays: Mapping[str, Any], units: Mapping[str, str] | None = None) -> Path:
    """HDF5 by h5py; names may have slashes."""
    import h5py

    with h5py.File(path, "w") as base:
        for name, values in arrays.items():
            data = base.create_dataset(name, data=values)
            if units and name in units:
                data.attrs["units"] = units[name]
    return path


def write_parquet(path: Path, columns: Mapping[str, Any], **options: Any) -> Path:
    """Parquet by pyarrow; arrays of two dimensions become lists."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = {name: list(values) if getattr(values, "ndim", 1) == 2 else values for name, values in columns.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(table), path, **options)
    return path


def write_lerobot(folder: Path, episodes: int = 2, rows: int = 5, version: str = "v2.1") -> Path:
    """A data set of LeRobot: files of episodes (v2.1), or one file of all (v3.0), and their description."""
    names = ["shoulder.pos", "elbow.pos"]
    features = {
        "observation.state": {"dtype": "float32", "shape": [2], "names": names},
        "action": {"dtype": "float32", "shape": [2], "names": {"motors": names}},
        "timestamp": {"dtype": "float32", "shape": [1], "names": None},
    }
    info = {"codebase_version": version, "fps": 10, "features": features}
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    tables = []
    for episode in range(episodes):
        state = np.arange(2 * rows, dtype=np.float32).reshape(rows, 2) + 100 * episode
        time, number = np.arange(rows, dtype=np.float32) / 10, np.full(rows, episode)
        tables.append({"observation.state": state, "action": -state, "timestamp": time, "episode_index": number})
    if version.startswith("v3"):
        together = {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
        write_parquet(folder / "data" / "chunk-000" / "file-000.parquet", together)
    else:
        for episode, table in enumerate(tables):
            write_parquet(folder / "data" / "chunk-000" / f"episode_{episode:06d}.parquet", table)
    return folder
