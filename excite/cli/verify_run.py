"""A verification from the command line: the verdict on each log, and its files."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import excite
from excite.cli.literal_console import console
from excite.cli.main import NOT_HELD
from excite.cli.options import FigureChoice
from excite.cli.sign_of_life import tell
from excite.cli.summary import Summary, compact_table, show
from excite.cli.view_text import brief_table, print_verdict, print_view
from excite.storage.records import check_replaceable, json_of
from excite.storage.result_folder import result_folder
from excite.verification.verification import KIND
from excite.views.verification_view import verification_view


def verify_and_write(
    folder: Path,
    logs: Sequence[Path],
    out: Path | None,
    *,
    parts: tuple[str, ...],
    figures: FigureChoice,
    **options: Any,
) -> None:
    """Judge a result on logs, and write each verdict."""
    result = excite.load_result(folder, parts)
    target, stems = out or result.folder or folder, _stems(logs)
    with result_folder(target):
        for stem in stems:
            check_replaceable(target, KIND, stem)
        judged = []
        for log in logs:
            tell(f"judging {folder} on {log}")
            judged.append(excite.verify(result, log, **options))
        written = [verification.save(target, name=stem) for verification, stem in zip(judged, stems, strict=True)]
        if figures:
            from excite.views.figures import write_view_figures

            tell("drawing")
            written = [
                [*write_view_figures(verification_view(verification, stem), target, **figures.how), *files]
                for verification, stem, files in zip(judged, stems, written, strict=True)
            ]
    files = [file for some in written for file in some]
    show(_summary(judged, files), lambda: list(map(json_of, judged)), lambda: _print(judged, files))
    sys.exit(0 if all(verification.holds for verification in judged) else NOT_HELD)


def _stems(logs: Sequence[Path]) -> list[str]:
    """Name of each log's files; logs of the same name in different folders are numbered."""
    names = [path.stem for path in logs]
    counts = [names[: k + 1].count(name) for k, name in enumerate(names)]
    return [
        f"verification-{name}" + (f"-{count}" if count > 1 else "") for name, count in zip(names, counts, strict=True)
    ]


def _summary(judged: Sequence[excite.Verification], files: Sequence[Path]) -> Summary:
    """Of one log its verdict and the errors of each joint; of several, a line each."""
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


def _row(verification: excite.Verification) -> tuple[str, ...]:
    motions = [m.relative for m in verification.motions or () if math.isfinite(m.relative)]
    return (
        verification.log.file,
        "holds" if verification.holds else "DOES NOT HOLD",
        f"{100 * verification.relative_error:.3g} %",
        f"{100 * max(motions):.3g} %" if motions else "-",
    )


def _print(judged: Sequence[excite.Verification], files: Sequence[Path]) -> None:
    for view in map(verification_view, judged):
        if len(judged) > 1:
            print_verdict(view)
        print_view(view)
    names = ", ".join(path.name for path in files)
    console().print(f"written to {files[-1].parent}: {names}", soft_wrap=True)
