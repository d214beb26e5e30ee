"""Logs as other programs write them, of one smooth motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class Motion:
    """Time [s], positions [rad], velocities [rad/s], efforts [Nm], each (N, n)."""

    time: Array
    q: Array
    dq: Array
    tau: Array

    @property
    def n(self) -> int:
        return self.q.shape[1]


def motion(joints: int = 3, rate: float = 100.0, seconds: float = 6.0, seed: int = 0, reach: float = 1.0) -> Motion:
    draw = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate)) / rate
    speed, phase = draw.uniform(1.0, 4.0, joints), draw.uniform(0.0, 6.0, joints)
    size = reach * draw.uniform(0.5, 1.2, joints)
    angle = np.outer(time, speed) + phase
    q, dq = size * np.sin(angle), size * speed * np.cos(angle)
    return Motion(time, q, dq, 10.0 * np.sin(angle + 0.3) + 2.0 * np.sign(dq))


def write_table(path: Path, names: Sequence[str] | None, rows: Iterable[Sequence[object]], mark: str = ",") -> Path:
    lines = [] if names is None else [mark.join(names)]
    lines += [mark.join("" if _empty(cell) else str(cell) for cell in row) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _empty(cell: object) -> bool:
    return isinstance(cell, float) and math.isnan(cell)


def numbered(names: Iterable[str], count: int, form: str = "{}_{}") -> list[str]:
    return [form.format(name, k) for name in names for k in range(count)]


def write_rtde(path: Path, m: Motion, mark: str = " ", torque: str = "actual_current_as_torque") -> Path:
    """As the clients of Universal Robots' RTDE record."""
    quantities = ["target_q", "actual_q", "actual_qd", "actual_current", torque]
    rows = np.column_stack([m.time + 1000.0, m.q + 0.01, m.q, m.dq, m.tau / 10.0, m.tau])
    return write_table(path, ["timestamp", *numbered(quantities, m.n)], rows.tolist(), mark)


def write_franka(path: Path, m: Motion) -> Path:
    """As `franka::logToCSV` writes: time in whole milliseconds, commas with and without a space in the header."""
    states = ["state.q", "state.q_d", "state.dq", "state.dq_d", "state.tau_J", "state.tau_ext_hat_filtered"]
    header = ", ".join(["time", "success_rate", *numbered([*states, "cmd.q_d"], m.n, "{}[{}]")])
    rows = np.column_stack([m.q, m.q + 0.01, m.dq, m.dq + 0.01, m.tau, 0.1 * m.tau, m.q + 0.02]).tolist()
    table = [[round(1e3 * t), 1.0, *row] for t, row in zip(m.time.tolist(), rows, strict=True)]
    return write_table(path, header.split(","), table)


def write_plotjuggler(path: Path, m: Motion, names: Sequence[str], every: int = 4, shift: float = 0.0) -> Path:
    """As PlotJuggler exports: efforts are in another topic, at another rate, and cells in between are empty."""
    later = m.time[::every] + shift
    time = np.union1d(m.time, later)
    row, other = np.searchsorted(time, m.time), np.searchsorted(time, later)
    table = np.full((time.size, 1 + 3 * m.n), np.nan)
    table[:, 0] = time + 1.6e9
    table[row, 1 : 1 + m.n], table[row, 1 + m.n : 1 + 2 * m.n] = m.q, m.dq
    table[other, 1 + 2 * m.n :] = np.column_stack([np.interp(later, m.time, tau) for tau in m.tau.T])
    columns = [f"/joint_states/{name}/{what}" for what in ("position", "velocity") for name in names]
    columns += [f"/currents/joint_states/{name}/effort" for name in names]
    return write_table(path, ["__time", *columns], table.tolist())


def write_folder(path: Path, m: Motion, writer: Callable[[Path, Array], None]) -> Path:
    """One file per signal."""
    path.mkdir()
    for name, values in (("time", m.time), ("q", m.q), ("dq", m.dq), ("tau", m.tau)):
        writer(path / name, values)
    return path


def as_array(path: Path, values: Array) -> None:
    np.save(path.with_suffix(".npy"), values)


def as_text(path: Path, values: Array) -> None:
    np.savetxt(path.with_suffix(".txt"), values)
