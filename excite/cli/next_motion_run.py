"""``excite plan --precision``: what is known, what is missing, and the next motion."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from excite.cli.messages import in_options
from excite.cli.sign_of_life import tell
from excite.cli.streams import remark
from excite.cli.summary import Summary, compact_table, show
from excite.tasks.precision_target import PrecisionTarget
from excite.tasks.task import Task

if TYPE_CHECKING:
    from excite.design.start_results import StartResult
    from excite.study.next_motion import NextMotion, PrecisionInHand

_ROWS = 8
_NAMES = 3  # of parameters of which nothing is asked


def plan_next_motion(task: Task, of: str, out: Path | None, *, force: bool) -> bool:
    """Print whether what is in hand is enough; write the next motion where it is not, and a folder is given."""
    import excite
    from excite.files.design_folder import check_no_design, data_files

    if out is not None:
        check_no_design(out, data_files(task), replace=force)
    tell("weighing what is in hand")
    step = excite.next_motion(task, of=of, progress=_BestSoFar(), report=lambda text: remark(f"excite: {text}"))
    files = step.design.save(out, replace=force) if step.design is not None and out is not None else []
    show(_summary(step, files, out), lambda: _content(step, out), lambda: _print(step))
    return step.enough


class _BestSoFar:
    """Announces every start that ends better than those before."""

    def __init__(self) -> None:
        self._value = math.inf

    def __call__(self, start: StartResult) -> None:
        if start.value < self._value:
            self._value = start.value
            remark(f"excite: start {start.index} ended, best so far {start.value:.4g}")


def _summary(step: NextMotion, files: list[Path], out: Path | None) -> Summary:
    rows = [_row(parameter) for parameter in (step.missing or step.parameters)]
    kind = "missing" if step.missing else "known"
    return Summary(
        verdict=_verdict(step),
        holds=step.enough,
        facts=[
            *_runs_lines(step),
            *compact_table(kind, "value", "half-width", "allowed", "then", "unit", rows=rows, most=_ROWS),
        ],
        notes=[*_not_asked(step), *(in_options(note) for note in (() if step.design is None else step.design.notes))],
        files=files,
        next_steps=[_next(step, out)],
    )


def _verdict(step: NextMotion) -> str:
    count = sum(math.isfinite(parameter.allowed) for parameter in step.parameters)
    if step.enough:
        planned = f", once {', '.join(step.planned)} is played" if step.planned else ""
        return f"Enough: stop. All {count} parameters of {step.robot} are known as precisely as asked for{planned}"
    return f"{len(step.missing)} of {count} parameters of {step.robot} are not known as precisely as asked for"


def _not_asked(step: NextMotion) -> list[str]:
    """Parameters that a share of every one leaves out, since nothing is known of their size."""
    names = [parameter.name for parameter in step.parameters if not math.isfinite(parameter.allowed)]
    asked = step.task.objective.precision
    if not names or not isinstance(asked, PrecisionTarget) or asked.share is None:
        return []
    shown = ", ".join(names[:_NAMES]) + f" and {len(names) - _NAMES} more" * (len(names) > _NAMES)
    return [
        f"nothing is asked of {shown}: their size is not described, and what was measured of them may be zero; "
        "a YAML file for --precision can state it, under scales"
    ]


def _runs_lines(step: NextMotion) -> list[str]:
    forecast = step.forecast
    if forecast is None or step.design is None:
        return []
    runs = f"{forecast.runs} run{'s' * (forecast.runs > 1)}"
    expected = "expected to be enough" if forecast.met else "which are not enough yet"
    return [f"next motion: {step.design.trajectory.duration:g} s, {runs}, {forecast.robot_seconds:g} s; {expected}"]


def _row(parameter: PrecisionInHand) -> tuple[str, ...]:
    value = "-" if parameter.value is None else f"{parameter.value:.4g}"
    widths = (parameter.half_width, parameter.allowed, parameter.expected)
    return (
        parameter.name,
        value,
        *(f"{width:.3g}" if math.isfinite(width) else "-" for width in widths),
        parameter.unit,
    )


def _next(step: NextMotion, out: Path | None) -> str:
    if step.enough:
        return "play the planned motions" if step.planned else "nothing more to play; verify on a log that was not used"
    if out is None:
        return "the same command with --out DIR writes the motion"
    runs = "once" if step.runs == 1 else f"{step.runs} times"
    return f"play {out / 'trajectory.csv'} {runs}, identify from its logs, and plan again with that result in --after"


def _content(step: NextMotion, out: Path | None) -> dict[str, Any]:
    forecast = step.forecast
    return {
        "robot": step.robot,
        "enough": step.enough,
        "planned": list(step.planned),
        "parameters": [
            {name: _finite(value) for name, value in vars(parameter).items()} | {"enough": parameter.enough}
            for parameter in step.parameters
        ],
        "next": None
        if step.design is None or forecast is None
        else {
            "out": None if out is None else str(out),
            "period": step.design.trajectory.duration,
            **{name: value for name, value in forecast.to_dict().items() if name != "parameters"},
        },
    }


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _print(step: NextMotion) -> None:
    from rich.table import Table

    from excite.cli.literal_console import console

    out = console()
    for line in _runs_lines(step):
        out.print(line, soft_wrap=True)
    table = Table(title="half-widths of the intervals", title_justify="left")
    for heading in ("parameter", "value", "in hand", "allowed", "after the next motion", "unit"):
        table.add_column(heading, justify="left" if heading in ("parameter", "unit") else "right")
    for parameter in step.parameters:
        table.add_row(*_row(parameter))
    out.print(table)
