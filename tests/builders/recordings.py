"""Logs made of known motions, and logs as recorders spoil them: held and lost rows, late stamps, impacts."""

from __future__ import annotations

import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from motions import Sines

from excite.logs.log import Log
from excite.logs.log_reading import SCHEMA, log_entry, read_log, sidecar_path
from excite.logs.mapping import read_mapping
from excite.storage.atomic import write_json
from regressors.samples import Array, Index

ROOT = Path(__file__).resolve().parents[2]
MAPPING = ROOT / "benchmarks" / "identification" / "ur10e.yaml"
REAL, SO101 = (ROOT.parent / "shared" / "data" / name for name in ("ur10e", "so101"))


def real_log(name: str) -> Log:
    """A recorded log; the test is skipped where it is not."""
    path = REAL / f"{name}.csv"
    if not path.exists():
        pytest.skip("recorded logs are not beside the repository")
    return read_log(path, mapping=read_mapping(MAPPING))


def so101_folder(name: str, into: Path) -> Path:
    """A folder of commands and states of a desktop arm; the test is skipped where they are not."""
    (folder := into / name).mkdir()
    for kind in ("control", "state_motor"):
        packed = SO101 / f"{name}.{kind}.csv.gz"
        if not packed.exists():
            pytest.skip("recorded logs are not beside the repository")
        (folder / f"{kind}.csv").write_bytes(gzip.decompress(packed.read_bytes()))
    return folder


def sines(time, joints=2, period=4.0):
    """Position, velocity, acceleration of a periodic motion of three harmonics, shape (N, joints) each."""
    amplitude = np.array([[0.8, 0.3, 0.1], [-0.5, 0.2, 0.2], [0.3, -0.4, 0.1]])[:joints]
    waves = Sines(np.zeros(joints), amplitude, 2 * np.pi / period * np.arange(1, 4), np.full(3, 0.3))
    return tuple(waves.at(time, derivative) for derivative in range(3))


def log_of(time, q, dq=None, effort=None, joints=None, **more):
    """A log of joints ``a``, ``b``, ... ."""
    names = tuple("abcdefgh"[: q.shape[1]]) if joints is None else tuple(joints)
    return Log("LOG", "", names, time, q, dq, effort, **more)


RATE = 1000.0


def recorded(seconds: float = 6.0, rate: float = RATE, noise: float = 1e-6, joints: int = 3, seed: int = 0) -> Log:
    """Sines of three joints ``a``, ``b``, ``c``, and torques that follow their accelerations."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate)) / rate
    q, dq, ddq = sines(time, joints)
    effort = 4.0 * ddq + 2.0 * np.tanh(dq / 0.05) + 0.2 * rng.normal(size=q.shape)
    return log_of(time, q + noise * rng.normal(size=q.shape), dq, effort)


def some_rows(log: Log, share: float, seed: int = 0) -> Index:
    """Rows chosen at random, none of the first."""
    rng = np.random.default_rng(seed)
    return np.flatnonzero(rng.random(log.count) < share)[1:]


def held(log: Log, rows: Index, channels: tuple[str, ...] = ("q", "dq", "effort")) -> Log:
    """The log, some rows of which repeat the row before."""
    source = np.arange(log.count)
    source[rows] = 0
    source = np.maximum.accumulate(source)
    return replace(log, **{name: getattr(log, name)[source] for name in channels})


def late(log: Log, seed: int = 0, longest: float = 8e-3) -> Log:
    """The log, stamped by a host that now and then reads late and catches up at 0.7 ms per row."""
    rng = np.random.default_rng(seed)
    waits = np.where(rng.random(log.count) < 0.02, rng.uniform(0, longest, log.count), rng.uniform(0, 3e-4, log.count))
    gained = 3e-4 * np.arange(log.count)
    return replace(log, time=log.time + np.maximum.accumulate(waits + gained) - gained)


def without_rows(log: Log, rows: Index) -> Log:
    """The log as if some rows had never been written."""
    return replace(log.rows(np.setdiff1d(np.arange(log.count), rows)), numbers=None)


def struck(log: Log, at: float, jump: float = 0.5, joint: int = 1, spike: float = 25.0) -> Log:
    """The log with a blow: a jump of the velocity that dies away in 50 ms, and a torque of 10 ms."""
    since = log.time - at
    q, effort = log.q.copy(), log.effort.copy()
    q[:, joint] += np.where(since > 0, jump * since * np.exp(-np.maximum(since, 0.0) / 0.05), 0.0)
    effort[:, joint] += spike * np.sin(np.pi * np.clip(since / 0.01, 0, 1))
    return replace(log, q=q, effort=effort)


def rounded(x: Array, step: float) -> Array:
    """Values in whole steps."""
    return np.round(x / step) * step


def write_sidecar(log, robot, **more):
    """The file beside a log, with the log's hash where it is there already."""
    content = {"schema": SCHEMA, **log_entry(Path(log)), "robot": {"name": robot.name, "sha256": robot.sha256()}}
    write_json(sidecar_path(log), {**content, "design": None, "settings": {}, "seed": None, "truth": None, **more})
