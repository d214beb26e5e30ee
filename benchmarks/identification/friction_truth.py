"""Friction curves from simulated runs of an IRp-6: is the truth within its 99 % interval as often as it should be?

Each of the first three drives runs at 5 % and 10 ... 100 % of its largest speed in both directions [KD96] section 5.2,
under Tustin friction whose stiction is the paper's. The runs are simulated once per drive; 500 times noise is put on
the torques (100 times where a plan's runs have exact positions), windows are averaged, and the curve is fitted:
windows alone on a course made by hand, and a planned experiment with friction that sticks and ramps of torque. What the
motion does (control error, encoder counts) is the same every time, so it is a bias, and reported as such.
"""

from __future__ import annotations

import multiprocessing
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import friction_truth_windows
import record
from friction_truth_case import EXPERIMENTS, FEWER, NOISE, RATE, ROBOT, TRUTH, noise
from friction_truth_figure import figure
from friction_truth_planned import CHOSEN, Measured, experiments, fitted, measured, summary
from friction_truth_text import LIMITATIONS, text
from threadpoolctl import threadpool_limits

from excite.friction.friction_fit import Characteristic
from excite.views.style import DPI

__all__ = ["ROBOT", "TRUTH"]  # of this study, for others

HERE = Path(__file__).resolve().parent
PROCESSES, CHUNK = 2, 25
LOGS: dict[str, Measured] = {}  # what the processes of the second pool are born with


@threadpool_limits.wrap(limits=1)
def main() -> None:
    """Run every drive with exact positions and with encoder counts, and write the results."""
    load_before = record.load()
    studies = [(drive, encoder) for drive in TRUTH for encoder in (False, True)]
    counts = {study: EXPERIMENTS if study[1] else FEWER for study in studies}
    fork = multiprocessing.get_context("fork")
    with fork.Pool(PROCESSES) as pool:
        LOGS.update({one.drive: one for one in pool.map(measured, TRUTH, chunksize=1)})
    told: dict[tuple[str, bool], list[dict[str, Any]]] = {study: [] for study in studies}
    chunks = [(*study, range(k, min(k + CHUNK, count))) for study, count in counts.items()
              for k in range(0, count, CHUNK)]  # fmt: skip
    with fork.Pool(PROCESSES) as pool:
        alone = pool.starmap(friction_truth_windows.study, studies, chunksize=1)
        for chunk, found in zip(chunks, pool.imap(_experiments, chunks, chunksize=1), strict=True):
            told[chunk[:2]] += found
    planned = [summary(LOGS[study[0]], study[1], found) for study, found in told.items()]
    figure([_shown(drive) for drive in TRUTH], alone, planned).savefig(HERE / "results" / "friction_truth.png", dpi=DPI)
    content = {"torque_noise": NOISE, "rate": RATE, "planned": planned, "windows_alone": alone}
    record.save("friction_truth", load_before, content, text(alone, planned), LIMITATIONS, folder=HERE)


def _experiments(chunk: tuple[str, bool, range]) -> list[dict[str, Any]]:
    drive, encoder, seeds = chunk
    return experiments(LOGS[drive], encoder, seeds)


def _shown(drive: str) -> Characteristic:
    """The first experiment with encoder counts."""
    logs = LOGS[drive].logs(encoder=True)
    noisy = [replace(log, effort=log.effort + noise(0, log.effort.shape, k)) for k, log in enumerate(logs)]
    return fitted(LOGS[drive], noisy, CHOSEN)


if __name__ == "__main__":
    main()
