"""Identified models as files that simulators and other programs load, and the interface of their formats."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from excite.export.exported import Exported
from excite.export.models.exported_model import model_of_result
from excite.export.models.identified_model import Feature, IdentifiedModel
from excite.export.models.servo_model import ServoRobot, servos_in
from excite.identification.identification import Identification
from excite.identification.servo_result import ServoResult
from excite.registry import check_name, instance, name_of
from excite.storage.result_folder import check_free, write_file
from excite.study.sample_posterior import chosen_result
from regressors.arguments import checked
from regressors.errors import InputError, shortened

KIND = "model format"


@checked
def export_model(
    result: Identification | ServoResult | str | Path,
    format: str | ModelFormat,
    out: str | Path,
    *,
    robot_file: str | Path | None = None,
    replace: bool = False,
) -> Exported:
    """Write an identified model, or identified servos, in a format of other programs.

    The standard parameters of bodies and drives are the physically consistent ones nearest the robot's description that
    reproduce the base parameters (`excite.export.models.nearest_bodies`). What the format cannot express is named in
    the notes, and in the file's own comment with the hash of ``result.json``. Of servos the bodies stay as described.

    Parameters
    ----------
    result : Identification, ServoResult or path
        Or the folder of a result or of servos.
    format : str or ModelFormat
        Registered name: ``urdf``, ``mjcf``, ``drake``, ``isaac``, ``yaml``, ``npz``, ``csv``, ``md``, ``tex``; of
        servos ``mjcf``, ``urdf``, ``drake``, ``isaac``, ``yaml``, ``bam``; or ``module:Name`` or object of your own.
    out : path
        File to write.
    robot_file : path, optional
        Your own URDF (for ``urdf`` and ``drake``) or MJCF (for ``mjcf``): what is written is a copy of it, with nothing
        but the parameters changed.
    replace : bool
        Whether a file that is there is replaced.

    Returns
    -------
    Exported

    Raises
    ------
    UnknownName
        No such format.
    InputError
        A result of a load, servos in a format that does not hold them, a robot file of another robot, or a file that
        is there already or cannot be written.
    """
    chosen = chosen_format(format)
    path, template = Path(out), None if robot_file is None else Path(robot_file)
    chosen.check_template(template)
    check_free(path, replace=replace)
    if (servos := servos_in(result)) is not None:
        own, written = servos.notes, chosen.servo_text(servos, template)
    else:
        assert not isinstance(result, ServoResult)
        model = model_of_result(chosen_result(result))
        own = (*chosen.left_out(model.features), *model.notes)
        written = chosen.text(model, comment_of(model, own), template)
    write_file(path, written.encoded, replace=replace)
    facts = {} if servos is None else {"servos": list(servos.robot.joint_names)}
    return Exported(name_of(format), (path,), (*own, *written.notes), facts)


def comment_of(model: IdentifiedModel, notes: tuple[str, ...]) -> tuple[str, ...]:
    """Lines of the comment that a file holds: provenance without a date, then notes."""
    origin = "a result that was not saved" if model.sha256 is None else f"result.json with SHA-256 {model.sha256}"
    lines = [f"identified parameters of robot {model.described.name}, written by {model.program} from {origin}"]
    if model.training_error is not None:
        lines.append(f"relative error of the torques on the training logs: {100 * model.training_error:.4g} %")
    return (*lines, *notes)


def chosen_format(given: str | ModelFormat) -> ModelFormat:
    """The format that a name or an object stands for."""
    if isinstance(given, str):
        check_name(KIND, given)
    chosen: Any = instance(KIND, given)
    if not isinstance(chosen, ModelFormat):
        raise InputError(f"format: expected a ModelFormat, given {shortened(repr(given))}")
    return chosen


@dataclass(frozen=True)
class ModelText:
    """Content of a file."""

    content: str | bytes  # text is written in UTF-8 with line feeds
    notes: tuple[str, ...] = ()  # what was assumed, one sentence each

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

    def servo_text(self, servos: ServoRobot, robot_file: Path | None = None) -> ModelText:
        """Content of the file of identified servos; refused by a format that does not hold them."""
        raise InputError(f"{self.name} does not hold servos; choose mjcf, urdf, drake, isaac, yaml or bam")

    def check_template(self, robot_file: Path | None) -> None:
        """Raise `InputError` for a robot file that the format does not take."""
        if robot_file is not None and robot_file.suffix.lower() not in self.template_suffixes:
            suffixes = ", ".join(self.template_suffixes)
            takes = f"takes one that ends in {suffixes}" if suffixes else "takes none"
            raise InputError(f"`robot_file`: the format {self.name} {takes}, given {str(robot_file)!r}")

    def left_out(self, features: tuple[Feature, ...]) -> tuple[str, ...]:
        """One sentence for each feature of a model that the format cannot express."""
        return tuple(f"{self.name} cannot express {each.text}" for each in features if each.kind not in self.expresses)
