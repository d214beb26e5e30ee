"""Files that results name: a result holds their content, so none of them is opened.

A file of results comes from anywhere; a path in it would let it read whatever its reader may read.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from regressors.errors import InputError

if TYPE_CHECKING:
    from constraints.collision.geometry import World
    from regressors.robot.robot import Robot


@dataclass(frozen=True)
class UnopenedFile:
    """A file that a result names without its content.

    Parameters
    ----------
    option : str
        Such as ``world``.
    name : str
    """

    option: str
    name: str

    def missing(self) -> InputError:
        """What to say where its content is needed."""
        return InputError(
            f"{self.option} is only named in this file of results ({_short(self.name)}), and files that results name "
            f"are not opened: where the result is loaded, give `{self.option}`"
        )

    def __str__(self) -> str:
        """The name."""
        return self.name


@dataclass(frozen=True, eq=False)
class StoredRobot:
    """A robot whose file a result names, with the description and the shape that the result holds.

    Parameters
    ----------
    name : str
        Of its file.
    robot : Robot
        The whole robot, as mounted and as equipped.
    shape : World, optional
        For the check of self-collision.
    """

    name: str
    robot: Robot
    shape: World | None = None


@dataclass(frozen=True, eq=False)
class InitialDesign:
    """The design that a search began with, as its result holds it."""

    name: str  # of its folder
    trajectory: Mapping[str, Any]  # entry ``trajectory`` of its ``design.json``
    motion: Any = None  # the motion itself, where the entry alone does not give it: that of a family of the user's own

    def __str__(self) -> str:
        """Its folder."""
        return self.name


def _short(text: str) -> str:
    return ascii(text if len(text) <= 60 else f"{text[:57]}...")
