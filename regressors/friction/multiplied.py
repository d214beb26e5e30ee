"""Friction curves whose own parameters are multiplied by a factor, of the same kind as before."""

from __future__ import annotations

from dataclasses import replace

from regressors.errors import InputError
from regressors.friction.curve import CoulombViscous, FrictionCurve, Scaled, Side, Stribeck
from regressors.friction.load_share import MOST, Loaded
from regressors.friction.tables import FunctionFriction, TableFriction
from regressors.friction.temperature import Slope, Warm


def multiplied(curve: FrictionCurve, factor: float) -> FrictionCurve:
    """``factor * f`` as a curve of the same kind, which friction files can hold; functions become tables."""
    if isinstance(curve, CoulombViscous):
        return CoulombViscous(factor * curve.coulomb, factor * curve.viscous, factor * curve.offset)
    if isinstance(curve, Stribeck):
        forward, backward = (_side(side, factor) for side in (curve.forward, curve.backward))
        return Stribeck(forward, backward, offset=factor * curve.offset)
    if isinstance(curve, TableFriction):
        return TableFriction(curve.speed, factor * curve.friction)
    if isinstance(curve, FunctionFriction):
        return multiplied(curve.table(), factor)
    if isinstance(curve, Scaled):
        return multiplied(curve.curve, factor * curve.factor)
    if isinstance(curve, Warm):
        warmer, backward_warmer = (_slope(slope, factor) for slope in (curve.forward, curve.backward))
        return Warm(multiplied(curve.curve, factor), curve.reference, warmer, backward_warmer, range=curve.range)
    if isinstance(curve, Loaded):
        shares = (min(factor * share, max(share, MOST)) for share in curve.shares)
        return Loaded(multiplied(curve.curve, factor), *shares)
    raise InputError(f"a friction curve of type {type(curve).__name__} cannot be scaled; use a table")


def _slope(slope: Slope, factor: float) -> Slope:
    return Slope(factor * slope.coulomb, factor * slope.viscous)


def _side(side: Side, factor: float) -> Side:
    assert side.stiction is not None
    return replace(side, coulomb=factor * side.coulomb, viscous=factor * side.viscous, stiction=factor * side.stiction)
