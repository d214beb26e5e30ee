"""Balance of a robot that stands free: it must neither tip over an edge of its support polygon nor slide.

The wrench ``w = [F; N]`` of the ground is linear in the inertial parameters u, ``w = W(q, dq, ddq) u + w_stand``, see
`regressors.models.load`. In axes x, y of the ground and z along its normal, with the origin in the middle of the
polygon, it passes the zero-moment point ``(-N_y, N_x) / F_z`` [Vukobratovic, Borovac 2004]. The ground can only push,
so the robot stands while this point is inside the polygon: for each edge with the inner normal n through the corner v,
``n_y N_x - n_x N_y - n'v F_z >= d F_z``, a moment about the edge, with the margin d. All of these hold only where
``F_z >= 0``. The forces that corners take without sliding, ``|F_t| <= mu F_z``, make up a cone of wrenches
[Caron, Pham, Nakamura 2015]; with a pyramid of four sides within each cone of friction it is ``A w >= 0``, and holds
the moment about the normal too, which turns a light stand before a force shifts it.

[Vukobratovic, Borovac 2004] "Zero-moment point - thirty five years of its life", Int. J. Humanoid Robotics 1.
[Caron, Pham, Nakamura 2015] "Stability of surface contacts for humanoid robots", ICRA, sections III and IV.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import scipy
from pydantic import BaseModel, Field

from constraints.nonlinear import Limit, NonlinearConstraint
from constraints.torque import check_inertias, deviation_terms
from regressors.arguments import checked
from regressors.errors import InputError, about
from regressors.models.load import BaseWrenchModel, Sensor
from regressors.models.nominal import standard_values, stated_deviations
from regressors.models.partial import PartialMotion
from regressors.readers.documents import Document, Length, Load, Point, read_document, validate
from regressors.robot.robot import Robot
from regressors.robot.symbolic.kinematics import sparse
from regressors.samples import Array

_RESERVE = 0.1  # of the distance from the middle to each edge: what nominal masses may be off, as of torques
_FLAT = 1e-3  # m: points that are so near to a plane, or to a line, are on it
_UPRIGHT = 0.5  # least cosine between the ground's normal and the direction against gravity
_NOTHING = 1e-9  # coefficient of a facet that is zero but for rounding


@checked
@dataclass(frozen=True)
class Balance(Limit):
    """The support polygon of a robot that stands free: it must not tip over its edges, nor slide on the ground.

    Parameters
    ----------
    polygon : sequence of (float, float, float)
        Three points or more where it touches the ground, in the base's frame, of which the convex hull counts; or
        where vertical ropes hold it, which then stay taut [m].
    stand_mass : float
        Of all that does not move: the base itself, what is fixed to it, its stand or trolley [kg].
    stand_centre : tuple of float
        Centre of that mass, in the base's frame [m].
    margin : float, optional
        Distance that the zero-moment point keeps from each edge [m]; a tenth of that of the polygon's middle if not
        given, or none where the parameters are uncertain.
    friction_coefficient : float, optional
        Between robot and ground; if not given, sliding is not checked.
    uncertainty : float
        Share by which every parameter may be off, and the stand's mass, see `constraints.torque.PlausibleTorqueLimit`.

    Raises
    ------
    InputError
        Fewer than three points, points beside a plane or on a line, or numbers below zero.
    """

    polygon: Sequence[Sequence[float]]
    stand_mass: float = 0.0
    stand_centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    margin: float | None = None
    friction_coefficient: float | None = None
    uncertainty: float = 0.0

    def __post_init__(self) -> None:
        points = tuple(tuple(map(float, point)) for point in self.polygon)
        object.__setattr__(self, "polygon", points)
        whole = all(len(point) == 3 and np.all(np.isfinite(point)) for point in (*points, self.stand_centre))
        if len(points) < 3 or not whole:
            raise InputError("polygon and stand_centre: expected three points or more, and one, each of finite x, y, z")
        for name in ("stand_mass", "margin", "friction_coefficient", "uncertainty"):
            value = getattr(self, name)
            if value is not None and not 0 <= value < np.inf:
                raise InputError(f"{name} must be zero or more, given {value:g}")
        _ground(points, np.zeros(3))

    def imposed(self, robot: Robot, motion: PartialMotion) -> Sequence[NonlinearConstraint]:
        """One constraint: a moment about each edge, and the facets of the cone within which nothing slides.

        Raises
        ------
        InputError
            Links of unknown inertia, a ground that is not below the robot, or a margin that leaves no room.
        """
        check_inertias(robot, "limits of balance")
        R, origin, corners, names = _ground(self.polygon, robot.gravity)
        model, known = BaseWrenchModel(robot, Sensor(None, R, origin)), standard_values(robot)
        weight = -self.stand_mass * robot.gravity @ R
        stand = np.concatenate([weight, np.cross((np.array(self.stand_centre) - origin) @ R, weight)])
        tipping = self._tipping(corners)
        A = np.vstack([tipping, _sliding(corners, self.friction_coefficient)])
        values, rows = sparse([known[name] for name in model.names]), sparse(A)
        still = sparse(A @ stand - self.uncertainty * np.abs(A @ stand))
        deviations = deviation_terms(model, stated_deviations(robot, self.uncertainty))

        def expression(q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
            nominal = ca.mtimes(rows, ca.mtimes(model.rows(q, dq, ddq), values)) + still
            return nominal - ca.sum2(ca.fabs(ca.mtimes(rows, deviations(q, dq, ddq)))) if self.uncertainty else nominal

        moved = sum(float(body.theta[0]) for body in robot.bodies if body.theta is not None)
        slides = len(A) - len(tipping)
        labels = (*(f"tipping over edge {a}-{b}" for a, b in names), *("sliding",) * slides)
        units, load = ("Nm",) * len(tipping) + ("N",) * slides, (self.stand_mass + moved) * -robot.gravity @ R[:, 2]
        bounds = np.zeros(len(A)), np.full(len(A), np.inf), A[:, 2] * load
        limit = NonlinearConstraint(robot.n, expression, *bounds, labels, units, quantity="balance").restricted(motion)
        sliding = "" if slides else "; sliding is not checked, since no coefficient of friction is given"
        limit.notes = (
            f"balance: the ground carries {moved:.4g} kg that the joints move and {self.stand_mass:.4g} kg that stand, "
            f"which must include the base{sliding}",
        )
        return (limit,)

    def _tipping(self, corners: Array) -> Array:
        """Rows a with the moment ``a w`` about each edge, less the margin, shape (k, 6)."""
        edges = np.roll(corners, -1, axis=0) - corners
        x, y = edges.T / np.linalg.norm(edges, axis=1)
        distance = y * corners[:, 0] - x * corners[:, 1]  # of the middle, with the inner normal (-y, x)
        margin = (0.0 if self.uncertainty else _RESERVE) * distance if self.margin is None else self.margin
        if np.min(distance - margin) <= 0:
            raise InputError(
                f"margin: {self.margin:g} m leave no room in a support polygon whose middle is {distance.min():.3g} m "
                "from an edge; give a smaller one"
            )
        zero = np.zeros_like(x)
        return np.column_stack([zero, zero, distance - margin, x, y, zero])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, the keys of a support file."""
        stand = {"mass": self.stand_mass, "centre": list(self.stand_centre)}
        content = {"polygon": [list(p) for p in self.polygon], "stand": stand, "margin": self.margin}
        return {**content, "friction": self.friction_coefficient}


def _ground(polygon: Sequence[Sequence[float]], gravity: Array) -> tuple[Array, Array, Array, list[tuple[int, int]]]:
    """Axes of the ground, the polygon's middle, its corners in these, and the numbers of the points of each edge."""
    points = np.array(polygon)
    _, size, axes = np.linalg.svd(points - points.mean(axis=0))
    if size[1] < _FLAT or np.abs((points - points.mean(axis=0)) @ axes[2]).max() > _FLAT:
        raise InputError("polygon: expected points in one plane, not all on a line, as the ground is")
    up = -axes[2] if axes[2] @ gravity > 0 else axes[2]
    if np.any(gravity) and -up @ gravity < _UPRIGHT * np.linalg.norm(gravity):
        raise InputError(f"polygon: gravity {gravity.tolist()} is along its plane, on which no robot stands")
    across = np.cross(up, axes[0])
    flat = scipy.spatial.ConvexHull(points @ np.column_stack([axes[0], across]))
    hull = [int(k) for k in flat.vertices]  # counterclockwise
    first = points[hull[1]] - points[hull[0]]
    x = (first - first @ up * up) / np.linalg.norm(first - first @ up * up)
    R, origin = np.column_stack([x, np.cross(up, x), up]), points[hull].mean(axis=0)
    numbers = [(a + 1, b + 1) for a, b in zip(hull, [*hull[1:], hull[0]], strict=True)]
    return R, origin, (points[hull] - origin) @ R[:, :2], numbers


def _sliding(corners: Array, friction: float | None) -> Array:
    """Rows a with ``a w >= 0`` for all wrenches of forces at the corners that friction holds, shape (k, 6).

    Each is ``friction F_z`` less the force that it takes. Those that are moments about edges are left out.
    """
    if not friction:
        return np.zeros((0, 6))
    sides = friction * np.sqrt(0.5) * np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])
    v, f = (each.reshape(-1, 2) for each in np.broadcast_arrays(corners[:, None], sides[None]))
    rays = np.column_stack([f, v[:, 1], -v[:, 0], v[:, 0] * f[:, 1] - v[:, 1] * f[:, 0]])  # of F_z = 1
    size = np.abs(rays).max(axis=0)
    facets = scipy.spatial.ConvexHull(rays / size).equations
    facets = facets[np.unique(facets.round(9), axis=0, return_index=True)[1]]
    facets = facets[np.abs(facets[:, [0, 1, 4]]).max(axis=1) > _NOTHING]
    a, offset = facets[:, :5] / size, facets[:, 5:]
    return np.asarray(np.insert(-a, 2, -offset.T, axis=1) * friction / -offset)


class _Stand(BaseModel, extra="forbid", allow_inf_nan=False):
    mass: Load
    centre: Point


class _File(BaseModel, extra="forbid", allow_inf_nan=False):
    polygon: list[Point] = Field(min_length=3)
    stand: _Stand = _Stand(mass=0.0, centre=[0.0, 0.0, 0.0])
    margin: Length | None = None
    friction: Load | None = None


def read_support(path: str | Path) -> Balance:
    """Read a support file: ``polygon``, and optionally ``stand``, ``margin`` and ``friction``."""
    return _balance(read_document(path, "support file"))


def balance_of(content: Mapping[str, Any], source: str = "support") -> Balance:
    """The limit that `Balance.to_dict` describes."""
    return _balance(Document(source, dict(content), {}))


def _balance(document: Document) -> Balance:
    content = validate(document, _File)
    with about(document.source):
        x, y, z = content.stand.centre
        return Balance(content.polygon, content.stand.mass, (x, y, z), content.margin, content.friction)
