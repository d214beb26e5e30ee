"""Fig. 15 of Kozlowski and Dutkiewicz (1996) by ``excite study``: estimates over time, optimal against other motions.

Joint 1 of the IRp-6 moves alone, and X1, F1c and F1v are identified by short integrals (5 ms). The designed motion
stands beside the paper's polynomial of fifth order, once as fast as the limits allow and once at a leisurely pace; each
is simulated, and measured 30 times with other noise.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record
from moves import Moves, shortest
from PIL import Image

from excite.design.formulation import formulate
from excite.study.time_study import TimeCourse, TimeStudy
from excite.tasks.task import Task
from excite.views.subjects import load
from regressors.readers.library import load_robot
from regressors.samples import Array

HERE = Path(__file__).resolve().parent
DURATION, SLOW_MOVE = 10.0, 5.0  # s
ENDS = np.deg2rad([[-40.0], [30.0]])  # of joint 1 in the paper's polynomial motion
REPEATS, RATE, TORQUE_NOISE, COUNTS = 30, 1000, 1, 4000  # Hz, Nm, per revolution of the motor
DESIGN, FAST, SLOW = "designed", "quintic.csv", "slow-quintic.csv"
LIMITATIONS = (
    f"simulated: white noise of {TORQUE_NOISE} Nm on the torque, encoder of {COUNTS} counts per revolution of the "
    "motor, sampled at 1 kHz; the paper's figure is of one run of the real robot, whose noise it does not state",
    "the text of the paper does not say which non-optimal motion its figure shows: here the polynomial of fifth order "
    f"of its load experiments, between -40 and 30 degrees, as fast as the limits allow and in {SLOW_MOVE:g} s a way",
    "true values are those of the robot's file, partly assumed",
    "repetitions share the motion and the choices of cutoff and delay of the first measurement",
)


def write_moves(path: Path, designed: Path, length: float | None) -> None:
    """Write a way to and fro, laid out as a design's file; as fast as the limits allow if no time is given for it [s].

    The other joints rest where they rest in the design.
    """
    ends = ENDS[np.arange(round(2 * DURATION)) % 2]
    limits = formulate(load_robot("irp6"), Task("irp6")).limits  # of joints 1-3, of which the first moves
    lengths = shortest(ends * [1.0, 0.0, 0.0], limits) if length is None else np.full(len(ends) - 1, length)
    time = np.arange(round(500 * DURATION) + 1) / 500
    samples = Moves(ends, lengths, DURATION).samples(time)
    header = designed.read_text(encoding="utf-8").splitlines()[0].split(",")
    table = np.tile(np.loadtxt(designed, delimiter=",", skiprows=1, max_rows=1), (time.size, 1))
    moved = {"time": time, "q1.position": samples.q, "q1.velocity": samples.dq, "q1.acceleration": samples.ddq}
    for name, values in moved.items():
        table[:, header.index(name)] = np.ravel(values)
    np.savetxt(path, table, delimiter=",", header=",".join(header), comments="", fmt="%.12g")


def excite(folder: Path, *arguments: object) -> None:
    """Run the command line in a folder."""
    subprocess.run([sys.executable, "-m", "excite", *map(str, arguments)], cwd=folder, check=True, stdout=sys.stderr)


def study(folder: Path) -> TimeStudy:
    """Design, other motions, and the study of all of them."""
    excite(folder, "design", "irp6", "--model", "energy", "--joints", 1, "--out", DESIGN)
    for name, length in ((FAST, None), (SLOW, SLOW_MOVE)):
        write_moves(folder / name, folder / DESIGN / "trajectory.csv", length)
    motions = ("--design", DESIGN, "--trajectory", FAST, "--trajectory", SLOW)
    noise = ("--rate", RATE, "--torque-noise", TORQUE_NOISE, "--encoder", COUNTS)
    excite(folder, "study", "irp6", *motions, *noise, "--repeats", REPEATS, "--below", 1, "--out", "study")
    study: TimeStudy = load(folder / "study" / "study.json")
    return study


def rows(course: TimeCourse) -> list[list[object]]:
    """Lines of the table: what each parameter's estimates do over time."""
    truth, below, scatter = course.reference, course.time_below(0.01), scatters(course)
    assert course.repeated is not None
    mean, stated = course.repeated[:, -1].mean(axis=0), course.deviation[-1]
    return [
        [
            f"{course.name}, cond(W) {course.condition_number[-1]:.3g}",
            name,
            f"{below[k]:.1f} s" if np.isfinite(below[k]) else "never",
            *(f"{100 * at[k] / abs(truth[k]):.3g} %" for at in scatter),
            f"{100 * stated[k] / abs(truth[k]):.3g} %",
            f"{100 * (mean[k] - truth[k]) / abs(truth[k]):.2g} %",
            f"{scatter[-1][k] / stated[k]:.2f}",
        ]
        for k, name in enumerate(course.names)
    ]


def scatters(course: TimeCourse) -> list[Array]:
    """Scatter of the repetitions after a tenth, half and all of the motion."""
    assert course.scatter is not None
    count = len(course.time)
    return [course.scatter[k] for k in (count // 10 - 1, count // 2 - 1, count - 1)]


def curves(course: TimeCourse) -> dict[str, Any]:
    """What a figure shows of a motion, with five digits; None where the rows so far do not identify a parameter."""

    def short(values: Array) -> list[Any]:
        return [float(f"{x:.5g}") if np.isfinite(x) else None for x in values]

    assert course.scatter is not None
    return {
        "names": list(course.names),
        "units": list(course.units),
        "notes": list(course.notes),
        "condition_number": float(course.condition_number[-1]),
        "true": course.reference.tolist(),
        "time": short(course.time),
        "values": [short(row) for row in course.values.T],
        "scatter": [short(row) for row in course.scatter.T],
    }


HEAD = (
    "motion", "parameter", "deviation below 1 % from", "scatter of 30 after a tenth", "after half", "at the end",
    "stated at the end", "mean error", "scatter over stated",
)  # fmt: skip


def main() -> None:
    """Run the study, keep its figure, write its table."""
    before = record.load()
    with tempfile.TemporaryDirectory() as folder:
        content = study(Path(folder))
        drawn = Image.open(Path(folder) / "study" / "estimates_over_time.png").convert("RGB")
    drawn.quantize(64, dither=Image.Dither.NONE).save(HERE / "results" / "figure_15.png", optimize=True)
    lines = [line for course in content.courses for line in rows(course)]
    courses = {course.name: curves(course) for course in content.courses}
    table = record.table(HEAD, lines)
    text = f"{table}\n\n![Estimates over time](results/figure_15.png)"
    found = {"courses": courses, "head": list(HEAD), "rows": lines}
    record.save("figure_15", before, found, text, LIMITATIONS, folder=HERE)


if __name__ == "__main__":
    main()
