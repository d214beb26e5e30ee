"""Certification of the best of several starts: all metrics, and limits over continuous time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from constraints.bounds.certificate import LimitUse, limit_uses
from constraints.bounds.enclosure import enclose
from constraints.collision.geometry import World
from excite.design.approach import approach_and_return
from excite.design.best_starts import BestStarts
from excite.design.design import Design
from excite.design.formulation import Formulation
from excite.design.start_results import StartResult
from excite.design.stated_limits import remedy
from excite.errors import NoFeasibleMotionError
from excite.information.earlier_precision import information_in_hand
from excite.information.metrics import measures, noise_per_row, noise_text, predictions, singular_spectrum
from excite.information.nearly_unidentifiable import nearly_unidentifiable, nearly_unidentifiable_note
from excite.information.precision_forecast import RunInformation
from excite.information.weighting import known_with
from excite.tasks.precision_target import PrecisionTarget
from excite.trajectories import Trajectory
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


def certify(
    robot: Robot,
    formulation: Formulation,
    results: BestStarts | tuple[StartResult, ...],
    provenance: dict[str, object],
    *,
    interrupted: bool = False,
) -> Design:
    """Evaluate the best start: its metrics, and its limits over continuous time.

    Parameters
    ----------
    robot : Robot
    formulation : Formulation
    results : BestStarts or tuple of StartResult
        At least one start.
    provenance : dict
    interrupted : bool

    Raises
    ------
    NoFeasibleMotionError
        No start ended inside the limits.
    """
    starts = results if isinstance(results, BestStarts) else BestStarts.of(results)
    broken: list[LimitUse] = []
    for result in sorted(starts.best, key=lambda r: (r.value, r.index)):
        trajectory = formulation.problem.information.trajectory(result.coefficients)
        uses = limits_of(formulation, trajectory)
        if all(use.holds for use in uses):
            break
        broken.append(max(uses, key=lambda use: use.use))
    else:
        raise NoFeasibleMotionError(_closest(broken, formulation))
    if not np.isfinite(result.value):
        use = max(uses, key=lambda use: use.use)
        raise NoFeasibleMotionError(
            "no start found a motion within the limits from which every parameter is identifiable; widen the limits, "
            f"first of all that of {use.label}: the best uses {100 * use.use:.0f} % of {use.bound:.4g} {use.unit}"
        )
    samples = trajectory.samples(
        formulation.target.model.times(formulation.task.trajectory.period, formulation.task.output.rate)
    )
    noise = noise_per_row(formulation.task.objective.noise, formulation.target.model)
    ends = trajectory.samples(np.array([0.0, trajectory.duration])).q
    transfers = approach_and_return(
        robot, formulation.task, formulation.target.robot.joint_names, ends, formulation.transfer_limits
    )
    hardly = nearly_unidentifiable(formulation.target, samples, noise)
    notes = (*formulation.notes, *(transfers.notes if transfers is not None else ()))
    if hardly:
        what_noise = noise_text(formulation.task.objective.noise, formulation.target.model)
        dropped = formulation.task.objective.nearly_unidentifiable == "drop"
        notes = (nearly_unidentifiable_note(hardly, formulation.target, what_noise, dropped=dropped), *notes)
    if note := starts.note(interrupted=interrupted):
        notes = (*notes, note)
    design = Design(
        robot=robot,
        task=formulation.task,
        target=formulation.target,
        trajectory=trajectory,
        criteria=measures(formulation.target, samples, noise),
        limits=uses,
        predicted=predictions(formulation.target, samples, noise),
        prior=known_with(formulation.target, formulation.task, samples),
        spectrum=singular_spectrum(formulation.target, samples),
        rows=formulation.target.model.assemble(samples).shape[0],
        starts=starts.best,
        further_starts=starts.further,
        best_start=result.index,
        provenance=provenance,
        notes=notes,
        interrupted=interrupted,
        approach_and_return=transfers,
        nonlinear=(*formulation.nonlinear, *formulation.stated),
        unchecked=formulation.unchecked,
        nearly_unidentifiable=hardly,
        shape=shape if isinstance(shape := formulation.blueprint.shape, World) else None,
    )
    return _with_precision(design, samples, noise)


def _with_precision(design: Design, samples: Samples, noise: Array) -> Design:
    """The design with the runs that it takes to the precision that its task asks for, where it asks for one."""
    objective = design.task.objective
    if not isinstance(objective.precision, PrecisionTarget):
        return design
    in_hand = information_in_hand(design.target, design.task)
    of_run = RunInformation.of(objective.precision, design.target, samples, noise, design.sequence.duration, in_hand)
    return replace(design, run_information=of_run)


def _closest(broken: list[LimitUse], formulation: Formulation) -> str:
    """Message on the motion that is closest to feasible: which limit it violates, when, by how much; the remedy."""
    use = min(broken, key=lambda use: use.use)
    beyond = f"{-use.margin:.2g} {use.unit} beyond {use.bound:.4g} {use.unit}"
    return (
        "no start ended with a motion that keeps every limit over continuous time; "
        f"the closest motion exceeds {use.label} at {use.time:.3f} s: {use.extreme:.4g} {use.unit}, {beyond}"
        f"{remedy(use.label, formulation.stated, formulation.task)}"
    )


def limits_of(formulation: Formulation, trajectory: Trajectory) -> tuple[LimitUse, ...]:
    """Certificate of every limit for a motion: exact extrema of linear ones, enclosures of the others."""
    linear = tuple(use for limit in formulation.limits for use in limit_uses(limit, trajectory.extrema(limit)))
    imposed = (*formulation.nonlinear, *formulation.stated)
    enclosures = [enclose(limit, trajectory.samples, trajectory.duration, trajectory.jerk) for limit in imposed]
    return (*linear, *(use for limit, part in zip(imposed, enclosures, strict=True) for use in part.uses(limit)))
