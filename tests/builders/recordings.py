"""Logs made of known motions, for the tests of logs and signals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from excite.logs.log import Log
from excite.logs.log_reading import read_log
from excite.logs.mapping import read_mapping

ROOT = Path(__file__).resolve().parents[2]
MAPPING = ROOT / "benchmarks" / "identification" / "ur10e.yaml"
REAL = ROOT.parent / "shared" / "data" / "ur10e"


def real_log(name: str) -> Log:
    """A recorded log; the test is skipped where it is not."""
    path = REAL / f"{name}.csv"
    if not path.exists():
        pytest.skip("recorded logs are not beside the repository")
    return read_log(path, mapping=read_mapping(MAPPING))


def sines(time, joints=2, period=4.0):
    """Position, velocity, acceleration of a periodic motion of three harmonics, shape (N, joints) each."""
    w = 2 * np.pi / period * np.array([1.0, 2.0, 3.0])
    amplitude = np.array([[0.8, 0.3, 0.1], [-0.5, 0.2, 0.2], [0.3, -0.4, 0.1]])[:joints]
    angle = time[:, None, None] * w + 0.3
    return (
        (np.sin(angle) * amplitude).sum(axis=2),
        (np.cos(angle) * amplitude * w).sum(axis=2),
        (-np.sin(angle) * amplitude * w**2).sum(axis=2),
    )


def log_of(time, q, dq=None, effort=None, joints=None, **more):
    """A log of joints ``a``, ``b``, ... ."""
    names = tuple("abcdefgh"[: q.shape[1]]) if joints is None else tuple(joints)
    return Log("LOG", "", names, time, q, dq, effort, **more)
