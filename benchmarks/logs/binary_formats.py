"""Processor time and memory of reading 10 minutes of 7 joints at 1 kHz in the binary formats, and of a verdict on MCAP.

``python benchmarks/logs/binary_formats.py`` writes the same motion in each format, reads it with `excite.read_log` in a
process of its own with one BLAS thread, and writes ``binary_formats.json`` and ``binary_formats.md`` beside this file.
Names of cases, such as ``mcap``, measure these alone and keep the other results; ``verdict`` identifies a panda from
another log, and verifies the result on the MCAP.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
ROBOT, SEED, ROWS, RATE, START = "panda", 0, 600_000, 1000.0, 1_700_000_000_000_000_000
TRAINING_ROWS = 30_000
READ_LIMITS, VERDICT_LIMIT = (5.0, 1.0), 30.0  # CPU [s], memory [GB]; [s]
_BLOCK = 8192
LIMITATIONS = (
    "the time of reading is that of the whole process, imports and the hash of the file included",
    "joint states have no pauses and one layout; messages of many layouts are decoded in as many groups",
    "a machine of 2 cores that others use at the same time, so that times differ by some",
)


def motion(rows: int, seed: int) -> dict[str, Any]:
    """Time, positions, velocities and torques of a random sum of sines, with noise."""
    from excite.information.target import target_of
    from excite.tasks.task import Task
    from regressors.models.nominal import parameter_values, standard_values
    from regressors.readers.library import load_robot
    from regressors.samples import Samples

    robot, rng = load_robot(ROBOT), np.random.default_rng(seed)
    t, n = np.arange(rows) / RATE, robot.n
    middle = np.array([0.0, 0.0, 0.0, -1.5, 0.0, 1.8, 0.0])
    amplitude, phase = rng.uniform(0.05, 0.2, (5, n)), rng.uniform(0, 2 * np.pi, (5, n))
    q, dq, ddq = (np.zeros((rows, n)) for _ in range(3))
    for k, w in enumerate(2 * np.pi * 0.1 * np.arange(1, 6)):
        angle = w * t[:, None] + phase[k]
        q += amplitude[k] * np.sin(angle)
        dq += amplitude[k] * w * np.cos(angle)
        ddq -= amplitude[k] * w**2 * np.sin(angle)
    q += middle
    target = target_of(robot, Task(ROBOT, offset=True), 0.0)
    friction = {f"F{k}{kind}": x for k in range(1, n + 1) for kind, x in (("c", 0.5), ("v", 0.3), ("o", 0.1))}
    beta = parameter_values(target.model, target.base, {**standard_values(robot), **friction})
    tau = np.empty((rows, n))
    for first in range(0, rows, _BLOCK):
        part = slice(first, first + _BLOCK)
        W = target.model.selected(Samples(t[part], q[part], dq[part], ddq[part], ddq[part]), target.base.index)
        tau[part] = (W @ beta).reshape(-1, n)
    noise = (
        1e-5 * rng.standard_normal(q.shape),
        1e-4 * rng.standard_normal(q.shape),
        0.3 * rng.standard_normal(q.shape),
    )
    return {"time": t, "q": q + noise[0], "dq": dq + noise[1], "tau": tau + noise[2]}


def write_bag(path: Path, data: dict[str, Any], storage: str, compression: str = "") -> Path:
    """Bag of joint states, by rosbags; the message is serialised once, and its numbers are replaced."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    from regressors.readers.library import load_robot

    types = get_typestore(Stores.ROS2_HUMBLE)
    kind = "sensor_msgs/msg/JointState"
    stamp = types.types["builtin_interfaces/msg/Time"](0, 0)
    head = types.types["std_msgs/msg/Header"](stamp, "")
    empty = np.zeros(7)
    names = list(load_robot(ROBOT).joint_names)
    message = bytearray(types.serialize_cdr(types.types[kind](head, names, empty, empty, empty), kind))
    writer = Writer(path, version=8, storage_plugin=StoragePlugin[storage])
    if compression:
        writer.set_compression(CompressionMode[compression], CompressionFormat.ZSTD)
    at = [len(message) - 64 * (3 - k) + 8 for k in range(3)]  # of the arrays, each behind its length and padding
    with writer:
        connection = writer.add_connection("/joint_states", kind, typestore=types)
        for k in range(data["time"].size):
            time_ns = START + round(1e9 * data["time"][k])
            message[4:12] = np.array([time_ns // 10**9, time_ns % 10**9], "<u4").tobytes()
            for place, name in zip(at, ("q", "dq", "tau"), strict=True):
                message[place : place + 56] = data[name][k].tobytes()
            writer.write(connection, time_ns + 150_000, bytes(message))
    return path


def write_npz(path: Path, data: dict[str, Any]) -> Path:
    """NPZ, compressed."""
    np.savez_compressed(path, **data)
    return path


def write_hdf5(path: Path, data: dict[str, Any]) -> Path:
    """HDF5 in compressed chunks."""
    import h5py

    with h5py.File(path, "w") as base:
        for name, values in data.items():
            base.create_dataset(f"robot/{name}", data=values, compression="gzip", compression_opts=1)
    return path


def write_mat(path: Path, data: dict[str, Any], compress: bool = True) -> Path:
    """MAT-file of MATLAB 7, by SciPy."""
    import scipy.io

    scipy.io.savemat(path, {"robot": {**data, "time": data["time"][:, None]}}, do_compression=compress)
    return path


def write_mat73(path: Path, data: dict[str, Any]) -> Path:
    """File laid out as by MATLAB 7.3."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as base:
        group = base.create_group("robot")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in data.items():
            one = group.create_dataset(name, data=np.atleast_2d(values) if values.ndim == 1 else values.T)
            one.attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    return path


def write_parquet(path: Path, data: dict[str, Any]) -> Path:
    """Parquet, with lists as LeRobot has them."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    lists = {name: pa.FixedSizeListArray.from_arrays(pa.array(data[name].ravel()), 7) for name in ("q", "dq", "tau")}
    pq.write_table(pa.table({"time": data["time"], **lists}), path)
    return path


CASES: dict[str, tuple[str, Callable[[Path, dict[str, Any]], Path], str]] = {
    "mcap": ("MCAP, chunks not compressed", lambda path, data: write_bag(path, data, "MCAP") / "log.mcap", "log"),
    "mcap-zstd": ("MCAP, chunks in zstd", lambda path, data: write_bag(path, data, "MCAP", "STORAGE"), "log"),
    "db3": ("rosbag2 in SQLite", lambda path, data: write_bag(path, data, "SQLITE3"), "log"),
    "parquet": ("Parquet, lists", write_parquet, "log.parquet"),
    "npz": ("NPZ, compressed", write_npz, "log.npz"),
    "hdf5": ("HDF5, gzip", write_hdf5, "log.h5"),
    "mat": ("MAT-file of MATLAB 7, compressed struct", write_mat, "log.mat"),
    "mat-7.3": ("MAT-file of MATLAB 7.3, struct", write_mat73, "log73.mat"),
}


def mapping_of(name: str) -> str:
    """Mapping of a file of arrays; empty for bags, whose messages say what they hold."""
    before = {"parquet": "", "npz": "", "hdf5": "robot/", "mat": "robot.", "mat-7.3": "robot."}.get(name)
    if before is None:
        return ""
    lines = [f"time: {{column: {before}time}}"]
    for channel, array, unit in (("position", "q", "rad"), ("velocity", "dq", "rad/s"), ("effort", "tau", "Nm")):
        columns = ", ".join(f'"{before}{array}[{k}]"' for k in range(7))
        lines.append(f"{channel}: {{columns: [{columns}], unit: {unit}}}")
    return "\n".join([*lines, ""])


def read(path: str, mapping: str) -> None:
    """`excite.read_log` of a file, in this process."""
    import excite
    from regressors.readers.library import load_robot

    given = excite.read_mapping(mapping) if mapping else None
    log = excite.read_log(path, mapping=given, robot=load_robot(ROBOT))
    print(json.dumps({"rows": int(log.time.size), "joints": len(log.joints), "sum": float(log.q.sum())}))


def measured(arguments: list[str]) -> dict[str, Any]:
    """Processor time [s], wall time [s], peak memory [GB], exit status and last line of a Python command."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    began = time.monotonic()
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen([sys.executable, *arguments], env=environment, stdout=output)
        _, status, usage = os.wait4(process.pid, 0)
        output.seek(0)
        lines = output.read().decode().splitlines()
    code = os.waitstatus_to_exitcode(status)
    if code not in (0, 1):
        raise SystemExit(f"{' '.join(arguments)} ended with status {code}")
    return {
        "exit": code,
        "cpu": usage.ru_utime + usage.ru_stime,
        "wall": time.monotonic() - began,
        "memory": usage.ru_maxrss * 1024 / 1e9,
        "last": lines[-1] if lines else "",
    }


def verdict(folder: Path, data: dict[str, Any]) -> dict[str, Any]:
    """`excite verify` on the MCAP of a result that was identified from another log."""
    training, out, mapping = folder / "training.npz", folder / "result", folder / "mapping.yaml"
    write_npz(training, motion(TRAINING_ROWS, SEED + 1))
    mapping.write_text(mapping_of("npz"))
    options = ["--mapping", str(mapping), "--offset", "--out", str(out)]
    measured(["-m", "excite", "identify", ROBOT, str(training), *options])
    log = write_bag(folder / "log", data, "MCAP") / "log.mcap"
    load = os.getloadavg()[0]
    found = measured(["-m", "excite", "verify", str(out), str(log)])
    windows = json.loads((out / f"verification-{log.stem}.json").read_text(encoding="utf-8"))["windows"]
    return {**found, "size": log.stat().st_size / 1e6, "load": load, "windows": windows}


def study(names: Collection[str]) -> dict[str, dict[str, Any]]:
    """Measurements of some cases."""
    found, data = {}, motion(ROWS, SEED)
    for name in names:
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            if name == "verdict":
                found[name] = verdict(folder, data)
                continue
            _, write, file = CASES[name]
            path = write(folder / file, data)
            size = sum(one.stat().st_size for one in ([path] if path.is_file() else path.iterdir()))
            mapping = mapping_of(name) and str(folder / "mapping.yaml")
            if mapping:
                Path(mapping).write_text(mapping_of(name))
            found[name] = {**measured([__file__, "read", str(path), mapping]), "size": size / 1e6}
            read_back = json.loads(found[name].pop("last"))
            assert (read_back["rows"], read_back["joints"]) == (ROWS, 7)
            np.testing.assert_allclose(read_back["sum"], data["q"].sum(), rtol=1e-9)
            shutil.rmtree(folder / "log", ignore_errors=True)
    return found


def page(found: dict[str, dict[str, Any]]) -> str:
    """Results as text."""
    lines = ["# Binary formats of logs", "", "Written by `python benchmarks/logs/binary_formats.py`.", ""]
    lines += [
        f"{ROWS:,} rows of time and of positions, velocities and torques of 7 joints, read by `excite.read_log`, bags",
        f"without a mapping; at most {READ_LIMITS[0]:g} s of processor time and {READ_LIMITS[1]:g} GB.",
        "",
        "| format | file [MB] | CPU [s] | memory [GB] | wall [s] |",
        "|---|---|---|---|---|",
    ]
    for name, (text, _, _) in CASES.items():
        if name in found:
            m = found[name]
            lines.append(f"| {text} | {m['size']:.0f} | {m['cpu']:.1f} | {m['memory']:.2f} | {m['wall']:.1f} |")
    if "verdict" in found:
        m = found["verdict"]
        lines += [
            "",
            f"`excite verify` on an MCAP of {m['size']:.0f} MB, from the start of the process to the verdict with its "
            f"figure: {m['wall']:.1f} s, {m['cpu']:.1f} s of processor time, {m['memory']:.2f} GB, exit status "
            f"{m['exit']}; at most {VERDICT_LIMIT:g} s on 2 quiet cores. Others' load was {m['load']:.1f} on "
            f"{os.cpu_count()} cores. The motion is simulated in {m['windows']['simulated']} of {m['windows']['of']} "
            "windows, torques are predicted in all rows.",
        ]
    return "\n".join([*lines, "", "Limitations:", "", *(f"- {text}" for text in LIMITATIONS)]) + "\n"


def main() -> None:
    """Measure everything, or read one file in this process."""
    match sys.argv[1:]:
        case ["read", path, mapping]:
            read(path, mapping)
        case names:
            results = HERE / "binary_formats.json"
            found = json.loads(results.read_text(encoding="utf-8")) if results.exists() and names else {}
            found |= study(names or [*CASES, "verdict"])
            results.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
            (HERE / "binary_formats.md").write_text(page(found), encoding="utf-8")
            print(page(found))


if __name__ == "__main__":
    main()
