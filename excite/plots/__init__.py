"""Figures of designs, identifications and verifications.

Importing this package imports matplotlib, so callers import it only when they draw.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from excite.design.design import Design
from excite.plots.convergence_plot import convergence_figure
from excite.plots.figure_files import write_figure_files
from excite.plots.motion_plot import motion_figure
from excite.plots.phase_plot import phase_figure
from excite.plots.spectrum_plot import spectrum_figure
from regressors.arguments import checked

if TYPE_CHECKING:
    from excite.plots.clearance_plot import clearance_figure
    from excite.plots.estimates_plot import estimates_figure
    from excite.plots.identification_plots import (
        identification_figures,
        residuals_figure,
        torques_figure,
        write_identification_figures,
    )
    from excite.plots.parameters_plot import parameters_figure
    from excite.plots.repetitions_plot import repetitions_figure
    from excite.plots.verification_plots import (
        error_parts_figure,
        predicted_torques_figure,
        simulated_motion_figure,
        verification_figures,
        write_verification_figures,
    )
    from excite.plots.workspace_plot import workspace_figure

__all__ = [
    "FIGURES",
    "WORLD_FIGURES",
    "clearance_figure",
    "convergence_figure",
    "design_figures",
    "error_parts_figure",
    "estimates_figure",
    "identification_figures",
    "motion_figure",
    "parameters_figure",
    "phase_figure",
    "predicted_torques_figure",
    "repetitions_figure",
    "residuals_figure",
    "simulated_motion_figure",
    "spectrum_figure",
    "torques_figure",
    "verification_figures",
    "workspace_figure",
    "write_figures",
    "write_identification_figures",
    "write_verification_figures",
]

# what the figures of a design do not need, with the modules that draw it
_PLACES = {
    "clearance_figure": "clearance_plot",
    "error_parts_figure": "verification_plots",
    "estimates_figure": "estimates_plot",
    "identification_figures": "identification_plots",
    "parameters_figure": "parameters_plot",
    "predicted_torques_figure": "verification_plots",
    "repetitions_figure": "repetitions_plot",
    "residuals_figure": "identification_plots",
    "simulated_motion_figure": "verification_plots",
    "torques_figure": "identification_plots",
    "verification_figures": "verification_plots",
    "workspace_figure": "workspace_plot",
    "write_identification_figures": "identification_plots",
    "write_verification_figures": "verification_plots",
}


def __getattr__(name: str) -> Any:
    """Import what draws other figures than those of a design when it is first used."""
    if name not in _PLACES:
        raise AttributeError(f"module 'excite.plots' has no attribute {name!r}")
    return getattr(import_module(f"excite.plots.{_PLACES[name]}"), name)


def _clearance(design: Design) -> Figure:
    from excite.plots.clearance_plot import clearance_figure

    return clearance_figure(design)


def _precision(design: Design) -> Figure:
    from excite.plots.precision_plot import precision_figure

    return precision_figure(design)


def _workspace(design: Design) -> Figure:
    from excite.plots.workspace_plot import workspace_figure

    return workspace_figure(design)


FIGURES = {
    "motion": motion_figure,
    "phase": phase_figure,
    "spectrum": spectrum_figure,
    "convergence": convergence_figure,
}
WORLD_FIGURES = {"clearance": _clearance, "workspace": _workspace}  # where there are obstacles


def figures_of(design: Design) -> dict[str, Callable[[Design], Figure]]:
    """Functions that draw a design, by the names of their files."""
    if design.task.limits.world is not None:
        return {**FIGURES, **WORLD_FIGURES}
    mounted = design.shape is not None and design.shape.obstacles
    return {**FIGURES, "workspace": _workspace} if mounted else {**FIGURES}


def design_figures(design: Design) -> dict[str, Figure]:
    """Draw every figure of a design."""
    figures = figures_of(design)
    figures = figures if design.precision_search is None else {**figures, "precision": _precision}
    return {name: figure(design) for name, figure in figures.items() if name != "convergence" or design.starts}


@checked
def write_figures(
    design: Any, folder: str | Path, *, formats: str | Sequence[str] = ("png",), width: str = "screen"
) -> list[Path]:
    """Draw every figure of a design, or of whatever else `excite.draw` draws, and write them all at once.

    Parameters
    ----------
    design : Design, Identification, Verification, TimeStudy, FrictionPlan, FrictionFit, PayloadMotion or SweepTable
    folder : path
        An existing folder; where it holds what is drawn, its manifest lists the figures too.
    formats : str or sequence of str
        Of ``png``, ``pdf`` (TrueType fonts embedded) and ``svg`` (text that can be edited).
    width : {"screen", "single", "double"}
        See `excite.draw`.

    Returns
    -------
    list of Path
        ``motion.png``, ``phase.png``, ``spectrum.png`` and ``convergence.png`` in the folder, and those of
        `design_figures` that the design has besides. Or those of other formats, or of another object.

    Raises
    ------
    InputError
        Another format or width, or nothing that has figures; or the folder is being written by another process, or
        cannot be written to.
    """
    if isinstance(design, Design):
        return write_figure_files(lambda: design_figures(design), folder, "design", formats=formats, width=width)
    from excite.plots.drawable import write_drawable

    return write_drawable(design, folder, formats=formats, width=width)
