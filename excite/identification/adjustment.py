"""Settings of a task and a recipe that depend on the logs: the length of windows, and presliding of friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from excite.identification.equations import streamed_equations
from excite.identification.friction_directions import listed
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.presliding import best_presliding
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.tasks.task import Task
from regressors.friction.curves import FrictionCurves
from regressors.models.columns import COULOMB
from regressors.models.windows import Window


def with_whole_window(task: Task, target: IdentificationTarget, part: PreparedLog) -> Task:
    """Round the length of a task's short windows to a whole number of samples."""
    window, time = target.model.window, part.samples.time
    if window is None or window.kind != "short":
        return task
    fitted = window.fitted(float(time[-1] - time[0]) / (time.size - 1))
    return task.changed(model=task.model.with_window(fitted))


def with_presliding(
    recipe: Recipe, target: IdentificationTarget, parts: Sequence[PreparedLog], friction: FrictionCurves | None
) -> Recipe:
    """Complete a recipe with the presliding of friction that fits the data best, where it is not given."""
    if recipe.sign_width is not None or recipe.breakaway or target.model.window is not None:
        return replace(recipe, sign_width=recipe.sign_width or 0.0, breakaway=recipe.breakaway or 0.0)
    equations = undirected_equations(recipe, target, parts)
    presliding = best_presliding(target, equations, by_distance=recipe.breakaway is None, friction=friction)
    return replace(recipe, sign_width=presliding.sign_width, breakaway=presliding.breakaway)


def undirected_equations(
    recipe: Recipe, target: IdentificationTarget, parts: Sequence[PreparedLog]
) -> list[tuple[PreparedLog, Observations]]:
    """Equations of every instant of some logs, with the exact sign of friction, for a search of its presliding."""
    plain = replace(recipe, low_pass=None, every=None, sign_width=0.0, breakaway=0.0)
    # friction remembers every row, those too that make no equations later
    return [(part, streamed_equations(target, replace(part, left_out=()), plain)) for part in parts]


def presliding_note(recipe: Recipe, target: IdentificationTarget, *, known: bool) -> tuple[str, ...]:
    """Describe the presliding of friction, or the length of the windows."""
    base, window = target.base, target.model.window
    if window is not None:
        return (_window_note(window),)
    columns = any(base.columns[k].kind == COULOMB for k in base.index)
    if not known and not columns:
        return ()
    what = ("friction, known or not," if columns else "known friction") if known else "Coulomb friction"
    if np.any(recipe.breakaway or 0.0):
        return (
            f"{what} is presliding: it changes direction over {listed(recipe.breakaway)} "
            "rad (or m), and holds at standstill",
        )
    if np.any(recipe.sign_width or 0.0):
        return (f"{what} changes sign over {listed(recipe.sign_width)} rad/s (or m/s) of drive velocity",)
    return (f"{what} has the sign of the velocity",)


def _window_note(window: Window) -> str:
    if window.kind == "long":
        return "the noise of long windows is a cumulated sum, and the intervals allow for that"
    return f"windows of {1e3 * window.length:.4g} ms"
