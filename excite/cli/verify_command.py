"""``excite verify``: whether to believe a result."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from excite.cli.options import Folder, Numbers
from excite.registry import DROPPABLE, SIGNALS

if TYPE_CHECKING:
    from excite.verification.verification import Verification

SCHEMA = "excite.verification/1"


@click.command(
    name="verify",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110, "show_default": True},
    epilog="""\b
Examples:
  excite verify results/irp6 validation.csv
  excite verify results/ur10e ptp.csv --mapping ur10e.yaml --torque-tolerance 6
  excite verify results/irp6 a.csv b.csv --horizon 1 --format json

\b
Two tests per log: the torques that the result predicts along the measured motion, and the motion that the identified
model makes of the measured torques, which starts anew from the measured state after each horizon. The verdict is
negative if a tolerance is not reached, if a joint is predicted no better than by zero, or if the error is much larger
than on the logs of the identification. Exit status 0: believe it; 1: do not.

\b
What is written to DIR (or --out), per log:
  verification-LOG.json    errors of every joint and what limits them, the verdict with its reasons
  verification-LOG-*.png   measured and predicted torques, measured and simulated motion""",
)
@click.argument("folder", type=Folder(), metavar="DIR")
@click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="LOG...")
@click.option("--out", type=Folder(), metavar="DIR", help="Folder to write.  [default: that of the result]")
@click.option(
    "--mapping", type=click.Path(path_type=Path), metavar="FILE", help="YAML: what a foreign log's columns are."
)
@click.option(
    "--drop", multiple=True, type=click.Choice(DROPPABLE), help="Faulty rows to leave out instead of refusing the log."
)
@click.option(
    "--rows", default="auto", metavar="A:B", help="Rows to use: auto finds the motion; all; or from row A to B."
)
@click.option(
    "--torque-tolerance", type=float, default=10.0, metavar="%", help="Largest error of the torques, over all joints."
)
@click.option(
    "--motion-tolerance", type=float, default=25.0, metavar="%", help="Largest error of a joint's simulated motion."
)
@click.option("--horizon", type=float, default=0.5, metavar="S", help="How long the motion is simulated at a time.")
@click.option(
    "--signals", type=click.Choice(SIGNALS), help="From positions to accelerations.  [default: as identified]"
)
@click.option(
    "--temperature",
    type=Numbers(),
    metavar="T,...",
    help="Of logs without NAME.temperature, for known friction that depends on it [deg C].  [default: as identified]",
)
@click.option("--training-too", is_flag=True, help="Accept logs that the result was identified from.")
@click.option("--format", "form", type=click.Choice(["text", "json"]), default="text", help="Form of the summary.")
def command(
    folder: Path,
    logs: tuple[Path, ...],
    out: Path | None,
    mapping: Path | None,
    drop: tuple[str, ...],
    rows: str,
    torque_tolerance: float,
    motion_tolerance: float,
    horizon: float,
    signals: str | None,
    temperature: tuple[float, ...] | None,
    training_too: bool,
    form: str,
) -> None:
    """Judge the result in DIR on each LOG: predicted torques, simulated motion, and a verdict in words.

    A LOG must be of the same robot, and must not be one that the result was identified from.
    """
    from excite.cli.main import NOT_HELD
    from excite.files.result_json import read_result
    from excite.logs.log_reading import read_log
    from excite.logs.mapping import read_mapping
    from excite.logs.sidecar import sidecar_of
    from excite.plots import write_verification_figures
    from excite.storage.atomic import write_json
    from excite.storage.folder import made_folder
    from excite.verification.verdict import Tolerances
    from excite.verification.verification import verified

    _check(torque_tolerance, motion_tolerance)
    result = read_result(folder)
    layout = None if mapping is None else read_mapping(mapping)
    target = result.folder if out is None else out
    tolerances = Tolerances(torque_tolerance / 100, motion_tolerance / 100)
    for path in logs:
        sidecar_of(path, result.robot)
    with made_folder(target):
        read = [read_log(path, None, layout, drop) for path in logs]
        found = [
            verified(
                result,
                log,
                rows=rows,
                tolerances=tolerances,
                horizon=horizon,
                signals=signals,
                temperature=temperature,
                training_too=training_too,
            )
            for log in read
        ]
    contents = [verification_content(one, result.content["robot"], tolerances) for one in found]
    for one, content, stem in zip(found, contents, _stems(logs), strict=True):
        files = write_verification_figures(one, target, stem)
        write_json(target / f"{stem}.json", content)
        if form == "text":
            _show(one, [*files, target / f"{stem}.json"])
    if form == "json":
        click.echo(json.dumps(contents, indent=1))
    sys.exit(0 if all(one.verdict.holds for one in found) else NOT_HELD)


def _stems(logs: Sequence[Path]) -> list[str]:
    """Name of each log's files; logs of the same name in different folders are numbered."""
    names = [path.stem for path in logs]
    counts = [names[: k + 1].count(name) for k, name in enumerate(names)]
    return [
        f"verification-{name}" + (f"-{count}" if count > 1 else "") for name, count in zip(names, counts, strict=True)
    ]


def _check(torque: float, motion: float) -> None:
    for name, value in (("--torque-tolerance", torque), ("--motion-tolerance", motion)):
        if not (math.isfinite(value) and value > 0):
            raise click.UsageError(f"{name} must be a positive number of percent, given {value:g}")


def verification_content(found: Verification, robot: Mapping[str, Any], tolerances: object) -> dict[str, Any]:
    """Content of a verification's JSON file.

    Parameters
    ----------
    found : Verification
    robot : mapping
        Of the result.
    tolerances : Tolerances
    """
    log = found.prepared.log
    return {
        "schema": SCHEMA,
        "robot": {name: robot[name] for name in ("name", "sha256")},
        "log": {
            "file": log.source,
            "sha256": log.sha256,
            "rows": log.count,
            "from": float(log.time[0]),
            "to": float(log.time[-1]),
            "notes": list(found.prepared.notes),
        },
        "tolerances": vars(tolerances),
        "holds": found.verdict.holds,
        "verdict": found.verdict.text,
        "against": list(found.verdict.against),
        "remarks": list(found.verdict.remarks),
        "relative_error": _finite(found.relative_error),
        "training_error": found.training_error,
        "torques": [{**_plain(asdict(error)), "limited_by": error.limited_by} for error in found.torques],
        "motions": None if found.motions is None else [_plain(asdict(error)) for error in found.motions],
    }


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    return {name: _finite(value) if isinstance(value, float) else value for name, value in values.items()}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _show(found: Verification, files: list[Path]) -> None:
    from rich.table import Table
    from rich.text import Text

    from excite.cli.design_text import console

    out, log = console(), found.prepared.log
    trained = "" if found.training_error is None else f" ({100 * found.training_error:.3g} % where identified)"
    out.print(
        Text("\n").append(log.source, style="bold"),
        f": {log.count} rows, predicted within {100 * found.relative_error:.3g} % of what was measured{trained}",
        sep="",
        soft_wrap=True,
    )
    table = Table(title="predicted against measured", title_justify="left")
    for heading in ("", "measured", "error", "unit", "relative", "worst", "at [s]", "noise", "standstill", "model"):
        table.add_column(heading, justify="left" if heading in ("", "unit") else "right")
    for t in found.torques:
        parts = (f"{100 * part:.0f} %" for part in (t.noise, t.standstill, t.systematic))
        sizes = (f"{t.measured:.3g}", f"{t.error:.3g}", t.unit, f"{100 * t.relative:.1f} %", f"{t.worst:.3g}")
        table.add_row(t.name, *sizes, f"{t.worst_time:.2f}", *parts)
    out.print(table)
    if found.motions is not None:
        motion = Table(title="simulated against measured motion", title_justify="left")
        for heading in ("", "travel", "error", "unit", "relative", "worst", "at [s]"):
            motion.add_column(heading, justify="left" if heading in ("", "unit") else "right")
        for m in found.motions:
            share = f"{100 * m.relative:.1f} %" if math.isfinite(m.relative) else "-"
            motion.add_row(m.name, f"{m.travel:.3g}", f"{m.error:.2g}", m.unit, share, f"{m.worst:.2g}",
                           f"{m.worst_time:.2f}")  # fmt: skip
        out.print(motion)
    out.print(Text(found.verdict.text, style="bold green" if found.verdict.holds else "bold red"), soft_wrap=True)
    for remark in found.verdict.remarks:
        out.print(f"note: {remark}", soft_wrap=True)
    out.print(f"written to {files[-1].parent}: {', '.join(path.name for path in files)}", soft_wrap=True)
