"""Figures of whatever has a view: as matplotlib objects, or as files beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from excite.views.figure_files import drawn_figures, write_figure_files
from excite.views.view import View
from regressors.arguments import checked
from regressors.errors import InputError

# views by the classes of what they show; a class is not imported for what is of another one
_VIEWS = {
    "excite.design.design.Design": "design_view.design_view",
    "excite.friction.fit.friction_fit.FrictionFit": "friction_fit_view.friction_fit_view",
    "excite.friction.plan.friction_plan.FrictionPlan": "friction_plan_view.friction_plan_view",
    "excite.identification.identification.Identification": "identification_view.identification_view",
    "excite.payload.payload_motion.PayloadMotion": "payload_view.payload_motion_view",
    "excite.study.time_study.TimeStudy": "study_view.study_view",
    "excite.design.sweeps.sweep_table.SweepTable": "campaign_view.cells_view",
    "excite.verification.verification.Verification": "verification_view.verification_view",
}


@checked
def draw(result: Any, *, width: str = "screen") -> dict[str, Any]:
    """Draw every figure of a design, a result or another object, without writing a file.

    Parameters
    ----------
    result : Design, Identification, Verification, TimeStudy, FrictionPlan, FrictionFit, PayloadMotion or SweepTable
        New, or, of designs and identifications, loaded; of a loaded identification only the parameters can be drawn.
    width : {"screen", "single", "double"}
        As wide as they like, one column of a paper (3.5 in), or both (7.16 in); with fewer panels side by side, and in
        the fonts and sizes of ``excite/views/styles/WIDTH.mplstyle``.

    Returns
    -------
    dict of str to matplotlib.figure.Figure
        By the names that their files would have. They belong to no window and to no global list, so that nothing needs
        to be closed.

    Raises
    ------
    InputError
        Another width, or nothing that has figures.
    """
    figures = _view_of(result).figures
    return drawn_figures(lambda: {each.ending: each.draw() for each in figures}, width)


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
        ``motion.png``, ``phase.png``, ``spectrum.png`` and ``convergence.png`` in the folder, and those of distances
        and of the precision that the design has besides. Or those of other formats, or of another object.

    Raises
    ------
    InputError
        Another format or width, or nothing that has figures; or the folder is being written by another process, or
        cannot be written to.
    """
    return write_view_figures(_view_of(design), folder, formats=formats, width=width)


def write_view_figures(
    view: View, folder: str | Path, *, formats: str | Sequence[str] = ("png",), width: str = "screen"
) -> list[Path]:
    """Write the figures of a view."""
    return write_figure_files(
        lambda: {f"{view.stem}{each.ending}": each.draw() for each in view.figures},
        folder,
        view.filed,
        formats=formats,
        width=width,
    )


def _view_of(result: Any) -> View:
    names = [f"{kind.__module__}.{kind.__qualname__}" for kind in type(result).__mro__]
    known = next((_VIEWS[name] for name in names if name in _VIEWS), None)
    if known is None:
        raise InputError(
            "expected a design, an identification, a verification, a study, a friction plan, a friction fit, a payload "
            f"motion or the table of a campaign to draw, given {type(result).__name__}"
        )
    module, name = known.split(".")
    view: Callable[[Any], View] = getattr(import_module(f"excite.views.{module}"), name)
    return view(result)
