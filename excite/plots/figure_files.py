"""Writing of figures to files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from matplotlib.figure import Figure

from excite.plots.style import DPI, literal
from excite.storage.atomic import replacing
from excite.storage.manifest import read_manifest
from excite.storage.result_folder import amend_result, result_folder
from regressors.errors import InputError


def write_figure_files(figures: Mapping[str, Figure], folder: str | Path, kind: str = "") -> list[Path]:
    """Write figures as PNG files, all at once, beside the files of a result that are there already.

    Parameters
    ----------
    figures : mapping of str to Figure
        Figures by file name, without ``.png``.
    folder : path
        An existing folder.
    kind : str
        Kind of the result that they show, such as ``design``; its manifest lists them too.

    Raises
    ------
    InputError
        The folder is being written by another process, or cannot be written to; other files are as they were.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"cannot write {folder / next(iter(figures))}.png: there is no folder {folder}")
    with result_folder(folder), _saying_what_is_saved(folder, kind), amend_result(folder, kind) as staged:
        for name, figure in figures.items():
            literal(figure)
            with replacing(staged / f"{name}.png", "wb") as stream:
                figure.savefig(stream, format="png", dpi=DPI)
    return [folder / f"{name}.png" for name in figures]


@contextmanager
def _saying_what_is_saved(folder: Path, kind: str) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        if kind not in read_manifest(folder):
            raise
        raise InputError(f"{error}; everything but the figures is saved in {folder}") from error
