"""Figures of designs, identifications and verifications.

Importing this package imports matplotlib, so callers import it only when they draw.
"""

from __future__ import annotations

from pathlib import Path

from excite.design.design import Design
from excite.plots.clearance_plot import clearance_figure
from excite.plots.convergence_plot import convergence_figure
from excite.plots.estimates_plot import estimates_figure
from excite.plots.figure_files import write_figure_files
from excite.plots.identification_plots import residuals_figure, torques_figure, write_identification_figures
from excite.plots.motion_plot import motion_figure
from excite.plots.parameters_plot import parameters_figure
from excite.plots.phase_plot import phase_figure
from excite.plots.repetitions_plot import repetitions_figure
from excite.plots.spectrum_plot import spectrum_figure
from excite.plots.verification_plots import (
    error_parts_figure,
    predicted_torques_figure,
    simulated_motion_figure,
    write_verification_figures,
)
from excite.plots.workspace_plot import workspace_figure

__all__ = [
    "FIGURES",
    "WORLD_FIGURES",
    "clearance_figure",
    "convergence_figure",
    "error_parts_figure",
    "estimates_figure",
    "motion_figure",
    "parameters_figure",
    "phase_figure",
    "predicted_torques_figure",
    "repetitions_figure",
    "residuals_figure",
    "simulated_motion_figure",
    "spectrum_figure",
    "torques_figure",
    "workspace_figure",
    "write_figures",
    "write_identification_figures",
    "write_verification_figures",
]

FIGURES = {
    "motion": motion_figure,
    "phase": phase_figure,
    "spectrum": spectrum_figure,
    "convergence": convergence_figure,
}
WORLD_FIGURES = {"clearance": clearance_figure, "workspace": workspace_figure}  # where the task has a world


def write_figures(design: Design, folder: str | Path) -> list[Path]:
    """Draw every figure of a design and write each atomically as a PNG file.

    Parameters
    ----------
    design : Design
    folder : path
        An existing folder.

    Returns
    -------
    list of Path
        ``motion.png``, ``phase.png``, ``spectrum.png`` and ``convergence.png`` in the folder; ``clearance.png`` and
        ``workspace.png`` too, where the task has a world.

    Raises
    ------
    InputError
        The folder is being written by another process, or cannot be written to.
    """
    figures = FIGURES if design.task.limits.world is None else {**FIGURES, **WORLD_FIGURES}
    return write_figure_files({name: figure(design) for name, figure in figures.items()}, folder, "design")
