"""What can be drawn: its figures as matplotlib objects, or as files beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, singledispatch
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from excite.design.design import Design
from excite.design.stored_design import StoredDesign
from excite.friction.fit.friction_fit import KIND as FIT
from excite.friction.fit.friction_fit import FrictionFit
from excite.friction.plan.friction_plan import KIND as PLAN
from excite.friction.plan.friction_plan import FrictionPlan
from excite.identification.identification import Identification
from excite.payload.payload_motion import PayloadMotion
from excite.plots import design_figures
from excite.plots.figure_files import drawn_figures, write_figure_files
from excite.plots.friction_plan_plot import friction_plan_figure
from excite.plots.friction_plot import friction_figure
from excite.plots.identification_plots import identification_figures
from excite.plots.sweep_plot import sweep_figure
from excite.plots.time_course_plot import estimates_over_time_figure
from excite.plots.verification_plots import verification_figures
from excite.registry import built_in
from excite.study.time_study import KIND as STUDY
from excite.study.time_study import TimeStudy
from excite.sweeps.sweep_table import KIND as CAMPAIGN
from excite.sweeps.sweep_table import SweepTable
from excite.verification.verification import Verification
from regressors.arguments import checked
from regressors.errors import InputError


@dataclass(frozen=True)
class _Drawing:
    """How something is drawn, the kind of result that it is, and what its figures' files begin with."""

    draw: Callable[[], Mapping[str, Figure]]
    kind: str
    prefix: str = ""


@checked
def draw(result: Any, *, width: str = "screen") -> dict[str, Figure]:
    """Draw every figure of a design, a result or another object, without writing a file.

    Parameters
    ----------
    result : Design, Identification, Verification, TimeStudy, FrictionPlan, FrictionFit, PayloadMotion or SweepTable
        New, or, of designs and identifications, loaded; of a loaded identification only the parameters can be drawn.
    width : {"screen", "single", "double"}
        As wide as they like, one column of a paper (3.5 in), or both (7.16 in); with fewer panels side by side, and in
        the fonts and sizes of ``excite/plots/styles/WIDTH.mplstyle``.

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
    return drawn_figures(_drawing(result).draw, width)


def write_drawable(
    result: Any, folder: str | Path, *, formats: str | Sequence[str] = ("png",), width: str = "screen"
) -> list[Path]:
    """Write every figure of an object; see `excite.write_figures`."""
    drawing = _drawing(result)

    def named() -> dict[str, Figure]:
        return {f"{drawing.prefix}{name}": figure for name, figure in drawing.draw().items()}

    return write_figure_files(named, folder, drawing.kind, formats=formats, width=width)


@singledispatch
def _drawing(result: Any) -> _Drawing:
    raise InputError(
        "expected a design, an identification, a verification, a study, a friction plan, a friction fit, a payload "
        f"motion or the table of a campaign to draw, given {type(result).__name__}"
    )


@_drawing.register
def _(result: Design) -> _Drawing:
    return _Drawing(partial(design_figures, result), "design")


@_drawing.register
def _(result: StoredDesign) -> _Drawing:
    return _Drawing(lambda: design_figures(built_in("restored", "design")(result)), "design")


@_drawing.register
def _(result: PayloadMotion) -> _Drawing:
    return _drawing(result.design)


@_drawing.register
def _(result: Identification) -> _Drawing:
    return _Drawing(partial(identification_figures, result, result.reference), "result")


@_drawing.register
def _(result: Verification) -> _Drawing:
    stem = f"verification-{Path(result.log.file).stem}"
    return _Drawing(partial(verification_figures, result), stem, f"{stem}_")


@_drawing.register
def _(result: TimeStudy) -> _Drawing:
    return _Drawing(lambda: {"estimates_over_time": estimates_over_time_figure(result)}, STUDY)


@_drawing.register
def _(result: SweepTable) -> _Drawing:
    return _Drawing(lambda: {"campaign": sweep_figure(result)}, CAMPAIGN)


@_drawing.register
def _(result: FrictionPlan) -> _Drawing:
    return _Drawing(lambda: {"runs": friction_plan_figure(result)}, PLAN)


@_drawing.register
def _(result: FrictionFit) -> _Drawing:
    return _Drawing(lambda: {"friction": friction_figure(result.robot, result.characteristics)}, FIT)
