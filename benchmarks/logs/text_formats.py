"""Processor time and memory of reading 10 minutes of 7 joints at 1 kHz as text, and of the guess of its mapping.

``python benchmarks/logs/text_formats.py`` writes the same motion as each program writes it, reads it with
`excite.read_log` in a process of its own with one BLAS thread, and writes ``text_formats.json`` and
``text_formats.md`` beside this file. Names of cases, such as ``rtde``, measure these alone and keep the other results.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from binary_formats import LIMITATIONS, READ_LIMITS, ROBOT, ROWS, SEED, measured, motion

HERE = Path(__file__).resolve().parent
_BLOCK = 20_000


def write_table(path: Path, names: Sequence[str], columns: Sequence[Any], form: str, mark: str = ",") -> Path:
    """Columns under a header, each number by a format; NaN is an empty cell."""
    table = np.column_stack(columns)
    with path.open("w", encoding="utf-8") as stream:
        stream.write(mark.join(names) + "\n")
        for first in range(0, len(table), _BLOCK):
            rows = table[first : first + _BLOCK].tolist()
            text = "\n".join(mark.join([form % x for x in row]) for row in rows)
            stream.write(text.replace("nan", "") + "\n")
    return path


def _numbered(name: str, form: str = "{}_{}") -> list[str]:
    return [form.format(name, k) for k in range(7)]


def write_house(path: Path, data: dict[str, Any]) -> Path:
    """House format, numbers to their last digit."""
    from regressors.readers.library import load_robot

    joints = load_robot(ROBOT).joint_names
    names = [f"{joint}.{what}" for what in ("position", "velocity", "effort") for joint in joints]
    return write_table(path, ["time", *names], [data["time"], data["q"], data["dq"], data["tau"]], "%.17g")


def write_rtde(path: Path, data: dict[str, Any]) -> Path:
    """As the RTDE clients of Universal Robots, with white space and six digits."""
    names = [name for part in ("q", "qd", "current", "current_as_torque") for name in _numbered(f"actual_{part}")]
    columns = [data["time"], data["q"], data["dq"], data["tau"] / 10.0, data["tau"]]
    return write_table(path, ["timestamp", *names], columns, "%.6f", " ")


def write_franka(path: Path, data: dict[str, Any]) -> Path:
    """As libfranka, whose stream prints six digits."""
    states = ("state.q", "state.q_d", "state.dq", "state.dq_d", "state.tau_J", "state.tau_ext_hat_filtered")
    names = [name for state in states for name in _numbered(state, "{}[{}]")]
    milliseconds = np.round(1e3 * data["time"])
    columns = [data["q"], data["q"], data["dq"], data["dq"], data["tau"], 0.1 * data["tau"]]
    header = ["time", " success_rate", *(f" {name}" for name in names)]
    return write_table(path, header, [milliseconds, np.ones(milliseconds.size), *columns], "%.6g")


def write_plotjuggler(path: Path, data: dict[str, Any]) -> Path:
    """As PlotJuggler: efforts in a topic of 500 Hz, stamped between the rows of the positions."""
    from regressors.readers.library import load_robot

    joints = load_robot(ROBOT).joint_names
    time = np.concatenate([data["time"], data["time"][::2] + 3e-4])
    order = np.argsort(time)
    table = np.full((time.size, 21), np.nan)
    table[: data["time"].size, :14] = np.hstack([data["q"], data["dq"]])
    table[data["time"].size :, 14:] = data["tau"][::2]
    names = [f"/joint_states/{joint}/{what}" for what in ("position", "velocity") for joint in joints]
    names += [f"/motors/joint_states/{joint}/effort" for joint in joints]
    return write_table(path, ["__time", *names], [time[order] + 1.7e9, table[order]], "%.6f")


CASES: dict[str, tuple[str, Callable[[Path, dict[str, Any]], Path]]] = {
    "house": ("house format, 17 digits", write_house),
    "rtde": ("RTDE recording, 6 decimals, without a mapping", write_rtde),
    "franka": ("libfranka log of 44 columns, 6 digits, without a mapping", write_franka),
    "plotjuggler": ("PlotJuggler, two topics, empty cells, without a mapping", write_plotjuggler),
}


def read(path: str) -> None:
    """`excite.read_log` of a file, in this process."""
    import excite
    from regressors.readers.library import load_robot

    log = excite.read_log(path, robot=load_robot(ROBOT))
    assert log.effort is not None
    print(json.dumps({"rows": int(log.time.size), "sum": float(log.q.sum()), "efforts": float(log.effort.sum())}))


def study(names: Collection[str]) -> dict[str, dict[str, Any]]:
    """Measurements of some cases."""
    found, data = {}, motion(ROWS, SEED)
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            path = CASES[name][1](Path(folder) / "log", data)
            one = {**measured([__file__, "read", str(path)]), "size": path.stat().st_size / 1e6}
            read_back = json.loads(one.pop("last"))
            assert abs(read_back["rows"] - ROWS) <= 2
            np.testing.assert_allclose(read_back["sum"], data["q"].sum(), rtol=1e-4)
            guess = measured(["-m", "excite", "logs", str(path), "--robot", ROBOT])
            found[name] = {**one, "guess": {key: guess[key] for key in ("cpu", "memory", "wall")}}
    return found


def page(found: dict[str, dict[str, Any]]) -> str:
    """Results as text."""
    lines = ["# Text formats of logs", "", "Written by `python benchmarks/logs/text_formats.py`.", ""]
    lines += [
        f"{ROWS:,} rows of time and of positions, velocities and torques of 7 joints, read by `excite.read_log` and",
        f"shown by `excite logs`; reading should take {READ_LIMITS[0]:g} s of processor time and {READ_LIMITS[1]:g} GB",
        "at most.",
        "",
        "| format | file [MB] | CPU [s] | memory [GB] | CPU of `excite logs` [s] | memory [GB] |",
        "|---|---|---|---|---|---|",
    ]
    for name, (text, _) in CASES.items():
        if name in found:
            m, g = found[name], found[name]["guess"]
            numbers = (m["cpu"], m["memory"], g["cpu"], g["memory"])
            lines.append(f"| {text} | {m['size']:.0f} | " + " | ".join(f"{x:.2f}" for x in numbers) + " |")
    return "\n".join([*lines, "", "Limitations:", "", *(f"- {LIMITATIONS[k]}" for k in (0, 2))]) + "\n"


def main() -> None:
    """Measure everything, or read one file in this process."""
    match sys.argv[1:]:
        case ["read", path]:
            read(path)
        case names:
            results = HERE / "text_formats.json"
            found = json.loads(results.read_text(encoding="utf-8")) if results.exists() and names else {}
            found |= study(names or list(CASES))
            results.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
            (HERE / "text_formats.md").write_text(page(found), encoding="utf-8")
            print(page(found))


if __name__ == "__main__":
    main()
