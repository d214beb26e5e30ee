"""Figures of a page: drawn as SVG, or taken from the folder of a result as they were written."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from excite.report.sections import ReportFigure
from excite.storage.manifest import Entry, check_files, read_manifest
from regressors.errors import ExciteError, InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LARGEST = 4_000_000  # bytes of a picture that a page takes in


def drawn(figures: Mapping[str, Callable[[], Figure]], prefix: str) -> tuple[tuple[ReportFigure, ...], tuple[str, ...]]:
    """Draw figures as SVG."""
    from excite.plots.svg_text import svg_text

    made, left_out = [], []
    for k, (title, draw) in enumerate(figures.items()):
        try:
            made.append(ReportFigure(title, svg_text(draw(), f"{prefix}-{k}", title)))
        except ExciteError as error:
            left_out.append(f"figure {title!r} is not drawn: {error}")
    return tuple(made), tuple(left_out)


def pictures(folder: Path, kind: str, titles: Mapping[str, str]) -> tuple[ReportFigure, ...]:
    """Figures that a result was written with, as PNG or else SVG, where they are still those of its run."""
    entry = read_manifest(folder).get(kind)
    if entry is None:
        return ()
    shown = {name: file for name in titles if (file := _picture(folder, entry, name)) is not None}
    check_files(folder, kind, [*(name for name in entry.files if name.endswith(".json")), *shown.values()])
    return tuple(ReportFigure(titles[name], picture=_address(folder / file)) for name, file in shown.items())


def no_pictures(folder: Path, kind: str, titles: Mapping[str, str]) -> tuple[str, ...]:
    """What a page says where a result has none of its figures as PNG or SVG; see `pictures`."""
    entry = read_manifest(folder).get(kind)
    if entry is None or any(_picture(folder, entry, name) is not None for name in titles):
        return ()
    return (f"figures of the logs are left out: {folder} has none as PNG or SVG; `figures='png'` writes them",)


def _picture(folder: Path, entry: Entry, name: str) -> str | None:
    """The file of a figure in a form that browsers show; none where there is only a PDF, or nothing."""
    forms = (name, f"{Path(name).stem}.svg")
    return next((file for file in forms if file in entry.files and (folder / file).is_file()), None)


def _address(path: Path) -> str:
    kind = "svg+xml" if path.suffix == ".svg" else "png"
    try:
        if path.stat().st_size > _LARGEST:
            raise InputError(f"{path} is larger than {_LARGEST} bytes, more than a page takes in")
        return f"data:image/{kind};base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
