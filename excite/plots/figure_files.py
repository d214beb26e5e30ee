"""Writing of figures to files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from matplotlib.figure import Figure

from excite.plots.style import DPI, literal
from excite.storage.atomic import replacing


def write_figure_files(figures: Mapping[str, Figure], folder: str | Path) -> list[Path]:
    """Write figures as PNG files, each atomically.

    Parameters
    ----------
    figures : mapping of str to Figure
        Figures by file name, without ``.png``.
    folder : path
        An existing folder.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    paths = []
    for name, figure in figures.items():
        path = Path(folder) / f"{name}.png"
        literal(figure)
        with replacing(path, "wb") as stream:
            figure.savefig(stream, format="png", dpi=DPI)
        paths.append(path)
    return paths
