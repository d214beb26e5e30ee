"""The estimator of a name, ready to be given observations with their context."""

from __future__ import annotations

import math
from collections.abc import Mapping

from excite.identification.commanded import instruments
from excite.identification.context import Context, Estimator
from excite.identification.estimate import Estimate
from excite.identification.estimators.named import estimator
from excite.identification.estimators.standard import Entropic
from excite.identification.observations import Observations
from excite.trajectories import Trajectory
from regressors.errors import InputError


def chosen_estimator(
    name: str, *, trajectory: Trajectory | None = None, known: Mapping[str, float] | None = None, pull: float = 0.0
) -> Estimator:
    """Estimator of a name.

    Parameters
    ----------
    name : str
        One of `excite.registry.ESTIMATORS`.
    trajectory : Trajectory, optional
        Commanded motion, for ``instrumental``.
    known : mapping of str to float, optional
        Standard parameters as described, for ``physical``.
    pull : float
        Weight of the pull towards them, for ``physical``; see `excite.identification.estimators.standard.Entropic`.

    Raises
    ------
    UnknownName
        No such estimator.
    InputError
        Something that it needs is not given, or a pull that cannot be.
    """
    method = estimator(name)
    if not (math.isfinite(pull) and pull >= 0):
        raise InputError(f"pull must be zero or a positive number, given {pull:g}")
    if pull and name != "physical":
        raise InputError(f"a pull towards described values is for the estimator physical, not for {name}")
    if name == "instrumental":
        return _instrumental(trajectory)
    if name == "physical":
        return _physical(known or {}, pull)
    return lambda observations, _: method(observations)


def _instrumental(trajectory: Trajectory | None) -> Estimator:
    if trajectory is None:
        raise InputError("the estimator instrumental needs the commanded motion: name the design that was played")

    def estimate(observations: Observations, context: Context) -> Estimate:
        Z = instruments(trajectory, context.subject, context.prepared, context.recipe)
        return estimator("instrumental")(observations, Z)

    return estimate


def _physical(known: Mapping[str, float], pull: float) -> Estimator:
    def estimate(observations: Observations, context: Context) -> Estimate:
        towards = Entropic(known, pull) if pull > 0 else None
        return estimator("physical")(
            observations, context.subject.model, context.subject.base, pull=towards, reference=known
        )

    return estimate
