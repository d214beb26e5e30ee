"""``excite verify``: verification of a result on other logs."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from excite.cli.command import Command
from excite.cli.option_types import Folder, Number
from excite.cli.options import FigureChoice, drop_option, figure_options, mapping_option, own_parts
from excite.cli.task_options import settings_options
from excite.identification.recipe import Recipe
from excite.verification.tolerances import Tolerances

if TYPE_CHECKING:
    from excite.cli.summary import Summary
    from excite.verification.verification import Verification

_GROUPS = {
    "Verdict": ("torque", "motion", "horizon", "training_too"),
    "Logs": ("mapping", "drop", "rows", "signals", "temperature"),
}


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="verify",
    epilog="""\b
Examples:
  excite verify results/irp6 validation.csv
  excite verify results/ur10e ptp.csv --mapping ur10e.yaml --torque-tolerance 6
  excite verify results/irp6 a.csv b.csv --horizon 1 --json

\b
Two tests per log: the torques that the result predicts along the measured motion, and the motion that the identified
model simulates from the measured torques, restarted from the measured state after each horizon. The verdict is
negative if an error exceeds its tolerance, if a joint is predicted no better than by zero, or if the error is much
larger than on the logs of the identification. The errors that it judges are those of the model: the noise of the
measurement, estimated from what the log has above the frequencies of the motion, does not count. Where an error of the
torques that is allowed would move a joint too far, as a light wrist, the motion restarts earlier.
Of a log longer than 60 s, the motion is simulated in 60 windows at most, spread evenly over the log; torques are
predicted in all of its rows.
Exit status 0: the verdict is positive; 1: it is negative.

\b
What is written to DIR (or --out), per log:
  verification-LOG.json    errors of every joint and what limits them, the verdict with its reasons
  verification-LOG-*.png   measured and predicted torques, measured and simulated motion""",
)
@click.argument("folder", type=Folder(), metavar="DIR")
@click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="LOG...")
@click.option("--out", type=Folder(), metavar="DIR", help="Folder to write.  [default: that of the result]")
@mapping_option
@drop_option
@settings_options(Tolerances)
@click.option(
    "--horizon",
    type=Number(),
    default=0.5,
    metavar="S",
    help="Time after which the simulated motion restarts.",
)
@settings_options(
    Recipe,
    only=("rows", "signals", "temperature"),
    unset={"signals": "as identified", "temperature": "as identified"},
)
@own_parts
@figure_options()
@click.option("--training-too", is_flag=True, help="Accept logs that the result was identified from.")
def command(
    folder: Path,
    logs: tuple[Path, ...],
    out: Path | None,
    mapping: Path | None,
    drop: tuple[str, ...],
    rows: str,
    torque: float,
    motion: float,
    horizon: float,
    signals: str | None,
    temperature: tuple[float, ...] | None,
    parts: tuple[str, ...],
    training_too: bool,
    figures: FigureChoice,
) -> None:
    """Judge the result in DIR on each LOG: predicted torques, simulated motion, and a verdict with its reasons.

    A LOG must be of the same robot, and must not be one that the result was identified from.
    """
    import excite
    from excite.cli.main import NOT_HELD
    from excite.cli.sign_of_life import tell
    from excite.cli.summary import show
    from excite.storage.records import check_replaceable, json_of
    from excite.storage.result_folder import result_folder
    from excite.verification.verification import KIND

    tolerances = Tolerances(torque, motion)
    result = excite.load_result(folder, parts)
    target, stems = out or result.folder or folder, _stems(logs)
    read: dict[str, Any] = {"mapping": mapping, "drop": drop, "rows": rows, "training_too": training_too}
    how: dict[str, Any] = {"horizon": horizon, "signals": signals, "temperature": temperature}
    options = {**read, **how, "tolerances": tolerances}
    with result_folder(target):
        for stem in stems:
            check_replaceable(target, KIND, stem)
        judged = []
        for log in logs:
            tell(f"judging {folder} on {log}")
            judged.append(excite.verify(result, log, **options))
        saved = [verification.save(target, name=stem) for verification, stem in zip(judged, stems, strict=True)]
        written = saved
        if figures:
            from excite.plots import write_verification_figures

            tell("drawing")
            written = [
                [*write_verification_figures(verification, target, stem, **figures.how), *files]
                for verification, stem, files in zip(judged, stems, saved, strict=True)
            ]

    files = [file for some in written for file in some]
    show(_summary(judged, files), lambda: list(map(json_of, judged)), partial(_print, judged, files))
    sys.exit(0 if all(verification.holds for verification in judged) else NOT_HELD)


def _stems(logs: Sequence[Path]) -> list[str]:
    """Name of each log's files; logs of the same name in different folders are numbered."""
    names = [path.stem for path in logs]
    counts = [names[: k + 1].count(name) for k, name in enumerate(names)]
    return [
        f"verification-{name}" + (f"-{count}" if count > 1 else "") for name, count in zip(names, counts, strict=True)
    ]


def _summary(judged: Sequence[Verification], files: Sequence[Path]) -> Summary:
    """Of one log its verdict and the errors of each joint; of several, a line each."""
    from excite.cli.summary import Summary, compact_table
    from excite.cli.view_text import brief_table
    from excite.views.verification_view import verification_view

    holds = all(verification.holds for verification in judged)
    if len(judged) == 1:
        view = verification_view(judged[0])
        verdict, facts, notes = view.verdict, [*view.summary, *brief_table(view.tables[0])], judged[0].verdict.remarks
    else:
        against = sum(not verification.holds for verification in judged)
        verdict = (
            f"The result predicts each of {len(judged)} logs: you can rely on it for motions of these kinds."
            if holds
            else f"Do not rely on the result: it does not hold on {against} of {len(judged)} logs."
        )
        rows = [_row(verification) for verification in sorted(judged, key=lambda each: each.holds)]
        facts = compact_table("log", "verdict", "error of torques", "largest of a motion", rows=rows, left=2)
        notes = tuple(f"{v.log.file}: {text}" for v in judged for text in (*v.verdict.against, *v.verdict.remarks))
    return Summary(
        verdict=verdict,
        holds=holds,
        facts=facts,
        notes=notes,
        files=files,
        next_steps=[] if holds else ["'excite verify ... --verbose' shows what limits each joint"],
        all_in="verification-*.json",
    )


def _row(verification: Verification) -> tuple[str, ...]:
    motions = [m.relative for m in verification.motions or () if math.isfinite(m.relative)]
    return (
        verification.log.file,
        "holds" if verification.holds else "DOES NOT HOLD",
        f"{100 * verification.relative_error:.3g} %",
        f"{100 * max(motions):.3g} %" if motions else "-",
    )


def _print(judged: Sequence[Verification], files: Sequence[Path]) -> None:
    from excite.cli.literal_console import console
    from excite.cli.view_text import print_verdict, print_view
    from excite.views.verification_view import verification_view

    for view in map(verification_view, judged):
        if len(judged) > 1:
            print_verdict(view)
        print_view(view)
    names = ", ".join(path.name for path in files)
    console().print(f"written to {files[-1].parent}: {names}", soft_wrap=True)
