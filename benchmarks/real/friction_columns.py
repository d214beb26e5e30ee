"""Friction of the rivals: columns of each joint, on the diagonal of the equations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STRIBECK_SPEED = 0.1  # rad/s, fixed
KINDS: dict[str, Callable[[Array, Array], Array]] = {
    "coulomb": lambda dq, load: np.sign(dq),
    "viscous": lambda dq, load: dq,
    "offset": lambda dq, load: np.ones_like(dq),
    "stribeck": lambda dq, load: np.sign(dq) * np.exp(-((dq / STRIBECK_SPEED) ** 2)),
    "root": lambda dq, load: np.sign(dq) * np.sqrt(np.abs(dq)),
    "load": lambda dq, load: np.sign(dq) * np.abs(load),
}
USUAL = ("coulomb", "viscous", "offset")
VARIANTS = {
    "Coulomb, viscous": USUAL[:2],
    "+ offset": USUAL,
    "+ offset, Stribeck": (*USUAL, "stribeck"),
    "+ offset, sqrt v": (*USUAL, "root"),
    "+ offset, load share": (*USUAL, "load"),
    "+ offset, sqrt v, load share": (*USUAL, "root", "load"),
}
COMPARED = "+ offset"  # of which intervals are compared
NOT_NEGATIVE = ("coulomb", "viscous")


def friction_columns(kinds: tuple[str, ...], dq: Array, load: Array) -> Array:
    """Columns of every joint for each kind, shape (N, n, n k).

    Parameters
    ----------
    kinds : tuple of str
        Keys of `KINDS`.
    dq : ndarray, shape (N, n)
        [rad/s]
    load : ndarray, shape (N, n)
        Torque that each joint carries without friction [Nm].
    """
    N, n = dq.shape
    columns = np.zeros((N, n, len(kinds), n))
    for k, kind in enumerate(kinds):
        columns[:, np.arange(n), k, np.arange(n)] = KINDS[kind](dq, load)
    return columns.reshape(N, n, -1)
