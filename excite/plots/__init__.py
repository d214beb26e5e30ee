"""Figures of a design: its motion within the limits, what it shows of the parameters, and how it was found.

Importing this package imports matplotlib, so callers import it when they draw.
"""

from __future__ import annotations

from pathlib import Path

from excite.design import Design
from excite.files.atomic import replacing
from excite.plots.convergence import convergence_figure
from excite.plots.motion import motion_figure
from excite.plots.spectrum import spectrum_figure
from excite.plots.style import DPI

__all__ = ["FIGURES", "convergence_figure", "motion_figure", "spectrum_figure", "write_figures"]

FIGURES = {"motion": motion_figure, "spectrum": spectrum_figure, "convergence": convergence_figure}


def write_figures(design: Design, folder: str | Path) -> list[Path]:
    """Draw every figure of a design and write it as a PNG file, each complete or absent.

    Parameters
    ----------
    design : Design
    folder : path
        An existing folder.

    Returns
    -------
    list of Path
        ``motion.png``, ``spectrum.png`` and ``convergence.png`` in the folder.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    paths = []
    for name, figure in FIGURES.items():
        path = Path(folder) / f"{name}.png"
        with replacing(path, "wb") as stream:
            figure(design).savefig(stream, format="png", dpi=DPI)
        paths.append(path)
    return paths
