"""The motion that a robot is to do its work with, whose torques a design is to predict best."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from regressors.arguments import checked
from regressors.errors import InputError

if TYPE_CHECKING:  # what describes options must be imported in no time
    from regressors.samples import Array

STATES = ("q", "dq", "ddq")


@checked
@dataclass(frozen=True, eq=False)
class TaskMotion:
    """Instants of a motion.

    Parameters
    ----------
    name : str
        Of its file or folder.
    joints : tuple of str
        Names of the joints that it has.
    q, dq, ddq : ndarray, shape (N, n)
        Position, velocity and acceleration of these joints [rad, rad/s, rad/s^2, or with m].

    Raises
    ------
    InputError
        No instants, shapes that do not match, or values that are not finite.
    """

    name: str
    joints: tuple[str, ...]
    q: Array
    dq: Array
    ddq: Array

    def __post_init__(self) -> None:
        import numpy as np

        for state in STATES:
            values = np.array(getattr(self, state), dtype=float)
            if values.ndim != 2 or values.shape != (len(self.q), len(self.joints)) or not values.size:
                raise InputError(
                    f"task_motion {self.name}: {state} has shape {values.shape}, expected one row per instant with "
                    f"{len(self.joints)} values"
                )
            if not np.all(np.isfinite(values)):
                raise InputError(f"task_motion {self.name}: {state} has values that are not finite")
            object.__setattr__(self, state, values)

    def __str__(self) -> str:
        """Its name."""
        return self.name

    def __eq__(self, other: object) -> bool:
        """Whether both have the same instants, and come from the same place."""
        return isinstance(other, TaskMotion) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        """Of its name and joints."""
        return hash((self.name, self.joints))

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        states = {state: getattr(self, state).tolist() for state in STATES}
        return {"name": self.name, "joints": list(self.joints), **states}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> TaskMotion:
        """From what `to_dict` returned.

        Raises
        ------
        InputError
            Entries that are missing or of another type.
        """
        try:
            rows = {state: [[float(x) for x in row] for row in content[state]] for state in STATES}
            return cls(str(content["name"]), tuple(map(str, content["joints"])), **rows)  # type: ignore[arg-type]
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(
                "task_motion: expected a mapping with name, joints, q, dq and ddq, the latter with a list of numbers "
                f"per instant; {error} is missing or wrong"
            ) from error
