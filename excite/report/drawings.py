"""Figures of a page: drawn as SVG, or taken from the folder of a result as they were written."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from excite.report.sections import ReportFigure
from excite.storage.manifest import check_files, read_manifest
from regressors.errors import ExciteError, InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LARGEST = 4_000_000  # bytes of a picture that a page takes in


def drawn(figures: Mapping[str, Callable[[], Figure]], prefix: str) -> tuple[tuple[ReportFigure, ...], tuple[str, ...]]:
    """Draw figures as SVG.

    Parameters
    ----------
    figures : mapping of str to callable
        By title.
    prefix : str
        Begins the identifiers of all of them.

    Returns
    -------
    figures : tuple of ReportFigure
    left_out : tuple of str
        Those that cannot be drawn, and why.
    """
    from excite.plots.svg_text import svg_text

    made, left_out = [], []
    for k, (title, draw) in enumerate(figures.items()):
        try:
            made.append(ReportFigure(title, svg_text(draw(), f"{prefix}-{k}", title)))
        except ExciteError as error:
            left_out.append(f"figure {title!r} is not drawn: {error}")
    return tuple(made), tuple(left_out)


def pictures(folder: Path, kind: str, titles: Mapping[str, str]) -> tuple[ReportFigure, ...]:
    """Figures that a result was written with, where they are still those of its run.

    Parameters
    ----------
    folder : Path
        Of the result.
    kind : str
        Its kind in the manifest.
    titles : mapping of str to str
        Title of each figure by its file's name.

    Raises
    ------
    InputError
        A figure was changed since.
    """
    entry = read_manifest(folder).get(kind)
    if entry is None:
        return ()
    names = [name for name in titles if name in entry.files and (folder / name).is_file()]
    check_files(folder, kind, [name for name in entry.files if name.endswith(".json")] + names)
    return tuple(ReportFigure(titles[name], picture=_address(folder / name)) for name in names)


def _address(path: Path) -> str:
    try:
        if path.stat().st_size > _LARGEST:
            raise InputError(f"{path} is larger than {_LARGEST} bytes, more than a page takes in")
        return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode("ascii")
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
