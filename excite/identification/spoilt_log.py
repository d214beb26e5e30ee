"""The fault of a log that explains why the model does not explain the measurements, if one explains it best by far.

Every fault of `excite.identification.log_faults` is undone and the model fitted again. A fault is named where the
errors fall far, and clearly farther than without any other: models lack some friction and elasticity, of which a fault
may take up a little. A zero of a joint that free bodies do not explain needs less.
"""

from __future__ import annotations

import numpy as np

from excite.identification.choices.delays import LONGEST
from excite.identification.fault_search import EXPLAINED, GAIN, FaultSearch
from excite.identification.large_residual import Doubt
from excite.identification.log_faults import LEAST_ERROR, NO_FAULT, Fault, every_joint_moves, obvious_faults
from excite.identification.preparation import PreparedLog
from excite.information.target import IdentificationTarget
from regressors.errors import percent
from regressors.robot.friction.curves import FrictionCurves
from regressors.samples import Array

_GAIN_EACH = 0.15  # that a fault must win for each joint: what a model lacks of friction gains a third of it by a delay
MARGIN = 0.25  # and on the next fault
_ONE_JOINT = 1.2  # factor by which the error of one joint at least must fall
_ALL_JOINTS, _LITTLE = 0.8, 0.1  # what a fault of all joints, or a zero, may leave of the error; a little error
_WHITE, _OF_WHITE, _OF_ZERO = 1.2, 0.08, 0.25  # white noise at most; what a zero explains where it is left, and else
_LEAST_ZERO, _OF_PARALLEL = np.deg2rad(2.5), 0.1  # of zeros that explain so nearly the same both are named
_SAME_SIGNS = ({"torque gain", "gains"}, {"zero", "gravity"})  # kinds of which a log may not tell which it is
SPOILT = "the log is spoilt:"
_NOISY, _SMALL = 1.2, 0.01  # an error of one joint of more than so many times the noise, and of the torque, is searched
_IN_MOTION = 0.1  # of the root mean square speed of each drive


def spoilt_log(
    target: IdentificationTarget,
    parts: tuple[PreparedLog, ...],
    friction: FrictionCurves | None,
    *,
    doubtful: bool,
    timed: bool,
) -> Doubt | None:
    """Doubt that names the fault of a log, if one explains clearly more than none and than any other.

    A delay of all torques that left-out torques have decided on (``timed``) is not judged again.
    """
    if not every_joint_moves(target):
        return None
    for fault in obvious_faults(target.robot.joint_names, parts):
        return Doubt(f"{SPOILT} {fault.what}", "no sound log has this, whatever the robot", fault.cure, about="torques")
    search = FaultSearch.of(target, parts, friction)
    none = search.plain.fit(NO_FAULT)
    for fault in search.in_other_units(none):
        cause = "its friction would be so many times that described, and no other is"
        return Doubt(f"{SPOILT} {fault.what}", cause, fault.cure, about="torques")
    noisy = np.any(none.errors > np.maximum(_NOISY * search.noise, _SMALL))
    if not (doubtful or noisy or search.gain_of_zeros > _OF_WHITE):
        return None
    fits = [*search.fits(), *FaultSearch.of(target, parts, friction, _IN_MOTION).late_joints(none)]
    fits += [search.with_load()] if target.robot.is_chain else []
    fits = [fit for fit in fits if not timed or fit.kind != "late" or fit.longest > LONGEST]
    best = min([none, *_of_faults(fits)], key=lambda fit: fit.size)
    if best.kind == "gravity":  # of which, to joints that are parallel, a tilt sideways only takes a part
        fits.append(search.with_other_masses())
    fits += [] if np.all(best.errors < _WHITE * search.noise) else [search.with_lengths()]
    return named(none, fits, search.noise)


def _of_faults(fits: list[Fault]) -> list[Fault]:
    return [fit for fit in fits if fit.kind != NO_FAULT.kind]


def named(none: Fault, fits: list[Fault], noise: Array) -> Doubt | None:
    """Doubt of the best fault, or of the best two if they concern the same joint and explain the same."""
    ranked = sorted(_of_faults(fits), key=lambda fit: fit.size)
    if not ranked:
        return None
    best = ranked[0]
    needed = _OF_WHITE if np.all(best.errors < _WHITE * noise) else _OF_ZERO
    gain, fine = none.size - best.size, abs(best.zero) > _LEAST_ZERO and best.shown > needed
    margins = {"zero": _OF_PARALLEL} if fine else {}
    others = min(MARGIN, gain / 2) if fine else MARGIN
    close = [fit for fit in ranked[1:] if fit.size - best.size <= margins.get(fit.kind, others)]
    alike = [best, *(fit for fit in close if fit.joints == best.joints or {fit.kind, best.kind} in _SAME_SIGNS)]
    # of parallel joints, and where a ratio shows alone
    pairs = [fit for fit in close if fit.kind == best.kind == ("zero" if fine else "torque gain")]
    alike += [fit for fit in pairs if np.all(fit.errors < _ONE_JOINT * np.maximum(best.errors, LEAST_ERROR))]
    falls = float(np.max(none.errors / np.maximum(best.errors, LEAST_ERROR)))
    needed = needed if fine else max(GAIN, _GAIN_EACH * len(best.joints))
    clear = gain > needed and (fine or falls > _ONE_JOINT) and best.error < EXPLAINED
    clear = clear and (bool(best.joints) or best.error < max(_ALL_JOINTS * none.error, _LITTLE))
    clear = clear and (best.kind != "zero" or fine or best.error < _ALL_JOINTS * none.error)
    few = len(alike) <= 2 or {fit.kind for fit in alike} == _SAME_SIGNS[0]
    if not (clear and len(close) < len(alike) and few) or not best.what:
        return None
    what, cure = ", or ".join(fault.what for fault in alike), ", or ".join(fault.cure for fault in alike)
    cause = f"without this fault the error of the joints is {percent(best.error)} instead of {percent(none.error)}"
    return Doubt(f"{SPOILT} {what}", cause, cure, about="torques")
