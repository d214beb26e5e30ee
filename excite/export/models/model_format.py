"""Interface of the formats of identified models."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from excite.export.models.identified_model import Feature, IdentifiedModel
from regressors.errors import InputError


@dataclass(frozen=True)
class ModelText:
    """Content of a file.

    Parameters
    ----------
    content : str or bytes
        Text is written in UTF-8 with line feeds.
    notes : tuple of str
        What was assumed, one sentence each.
    """

    content: str | bytes
    notes: tuple[str, ...] = ()

    @property
    def encoded(self) -> bytes:
        """The bytes that are written."""
        return self.content if isinstance(self.content, bytes) else self.content.encode("utf-8")


class ModelFormat(ABC):
    """A format that an identified model can be written in.

    A format of your own is a subclass that sets `name` and `expresses` and defines `text`.

    Attributes
    ----------
    name : str
        As users know it, such as ``URDF``.
    expresses : frozenset of str
        Kinds of `excite.export.models.identified_model.Feature` that the format holds.
    suffix : str
        Of the files of an ensemble, such as ``.urdf``.
    template_suffixes : tuple of str
        Suffixes of a user's own robot file that the parameters can be written into; empty where there are none.
    """

    name: ClassVar[str]
    expresses: ClassVar[frozenset[str]]
    suffix: ClassVar[str] = ""
    template_suffixes: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """Content of the file.

        Parameters
        ----------
        model : IdentifiedModel
        comment : tuple of str
            Lines that the file holds as a comment: where it comes from, and what it cannot express.
        robot_file : Path, optional
            The user's own file, into a copy of which the parameters are written.
        """

    def check_template(self, robot_file: Path | None) -> None:
        """Raise `InputError` for a robot file that the format does not take."""
        if robot_file is not None and robot_file.suffix.lower() not in self.template_suffixes:
            suffixes = ", ".join(self.template_suffixes)
            takes = f"takes one that ends in {suffixes}" if suffixes else "takes none"
            raise InputError(f"`robot_file`: the format {self.name} {takes}, given {str(robot_file)!r}")

    def left_out(self, features: tuple[Feature, ...]) -> tuple[str, ...]:
        """One sentence for each feature of a model that the format cannot express."""
        beyond = [feature for feature in features if feature.kind not in self.expresses]
        shares = ["" if f.share is None else f"; {100 * f.share:.2g} % of the torques on random states" for f in beyond]
        return tuple(
            f"{self.name} cannot express {each.text}{share}" for each, share in zip(beyond, shares, strict=True)
        )
