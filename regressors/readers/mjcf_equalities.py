"""Equality constraints of a compiled MuJoCo model: joints that follow others or are held, and what else they tie."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from regressors.readers.urdf_tree import Mimic


@dataclass(frozen=True)
class Tie:
    """A constraint between bodies, or between joints, that is no joint of the tree."""

    label: str  # what it is, for messages
    joints: tuple[int, ...] = ()  # those that it concerns, by their number in the model
    bodies: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Equalities:
    """The active equality constraints of a model."""

    mimics: Mapping[int, Mimic]  # joints that follow another one, by their number
    held: Mapping[int, float]  # position at which a joint is held [rad or m]
    ties: tuple[Tie, ...]  # all the others


def equalities(model: Any, joint_names: Sequence[str]) -> Equalities:
    """Active equality constraints of a compiled model.

    MuJoCo couples two joints by ``q1 - ref1 = sum_k c_k (q2 - ref2)^k``, and holds one by ``q1 - ref1 = c_0``.
    """
    import mujoco

    kinds = mujoco.mjtEq
    mimics: dict[int, Mimic] = {}
    held: dict[int, float] = {}
    ties: list[Tie] = []
    for number in np.flatnonzero(model.eq_active0).tolist():
        kind, first, second = (int(values[number]) for values in (model.eq_type, model.eq_obj1id, model.eq_obj2id))
        if kind == kinds.mjEQ_JOINT and second < 0:
            held[first] = float(model.qpos0[model.jnt_qposadr[first]] + model.eq_data[number][0])
        elif kind == kinds.mjEQ_JOINT:
            mimics[first] = _mimic(model, number, joint_names[second])
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            what = "connect" if kind == kinds.mjEQ_CONNECT else "weld"
            ties.append(Tie(f"the equality <{what}>", bodies=_bodies(model, number, (first, second))))
        elif kind == kinds.mjEQ_TENDON:
            tendons = [tendon for tendon in (first, second) if tendon >= 0]
            ties.append(Tie("the equality <tendon>", *_ends_of_tendons(model, tendons)))
    return Equalities(mimics, held, tuple(ties))


def _mimic(model: Any, number: int, leader: str) -> Mimic:
    """Line through the leader's zero, where a leader off the chain rests."""
    q1, q2 = (model.qpos0[model.jnt_qposadr[ids[number]]] for ids in (model.eq_obj1id, model.eq_obj2id))
    curve = np.polynomial.Polynomial(model.eq_data[number][:5])
    return Mimic(leader, float(curve.deriv()(-q2)), float(q1 + curve(-q2)))


def _bodies(model: Any, number: int, ends: Sequence[int]) -> tuple[int, ...]:
    import mujoco

    at_sites = int(model.eq_objtype[number]) == mujoco.mjtObj.mjOBJ_SITE
    return tuple(int(model.site_bodyid[end]) if at_sites else end for end in ends)


def _ends_of_tendons(model: Any, tendons: Sequence[int]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Joints and bodies that tendons run over."""
    import mujoco

    joints: list[int] = []
    bodies: list[int] = []
    for tendon in tendons:
        begin = int(model.tendon_adr[tendon])
        for place in range(begin, begin + int(model.tendon_num[tendon])):
            kind, what = int(model.wrap_type[place]), int(model.wrap_objid[place])
            if kind == mujoco.mjtWrap.mjWRAP_JOINT:
                joints.append(what)
            elif kind == mujoco.mjtWrap.mjWRAP_SITE:
                bodies.append(int(model.site_bodyid[what]))
    return tuple(joints), tuple(bodies)
