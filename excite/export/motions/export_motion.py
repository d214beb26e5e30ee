"""Export of a design as a motion that a controller plays, with what to record beside it."""

from __future__ import annotations

from pathlib import Path

from excite.design.designed_motion import DesignedMotion
from excite.errors import BrokenLimitError
from excite.export.exported import Exported
from excite.export.motions.certificate import (
    Certificate,
    Interpolation,
    certify,
    check_formula,
    check_interpolated,
    deviation,
)
from excite.export.motions.motion_format import MotionFormat
from excite.export.motions.sampled_design import SampledDesign
from excite.files.design_json import load_design
from excite.logs.mapping import MAPPING
from excite.registry import instance, name_of
from excite.storage.atomic import replacing
from excite.storage.result_folder import replace_files, result_file
from regressors.arguments import checked
from regressors.errors import InputError, TakenError
from regressors.quantities import check

_RECORDS = (".xml", ".yaml")  # what an older export in another format may have left
_FASTER = (1.0, 2.0, 5.0, 10.0)  # times the default rate, until what is interpolated keeps the limits


@checked
def export_motion(
    design: DesignedMotion | str | Path,
    format: MotionFormat | str,
    out: str | Path,
    *,
    rate: float | None = None,
    replace: bool = False,
) -> Exported:
    """Write a design as a motion that a controller plays, and beside it what to record.

    Samples are those of the design's own formula, with approach and return where it has them, at exact rest at both
    ends. Limits of positions, velocities, accelerations, jerks and torques are checked for the formula over continuous
    time, and those of joints and drives once more for what the controller interpolates, where that is documented.

    Parameters
    ----------
    design : DesignedMotion or path
        A design, or its folder.
    format : MotionFormat or str
        A format, or the name of one.
    out : path
        File to write. ``OUT.record.*``, for the recorder that belongs to the controller, and ``OUT.mapping.yaml``,
        by which `identify` reads its recording, are written beside it.
    rate : float, optional
        Samples per second [Hz]; that of the format if not given, or faster where its interpolation would break a limit.
    replace : bool
        Replace files that are already there.

    Returns
    -------
    Exported

    Raises
    ------
    InputError
        Joints or a rate that the format does not have, a name that it cannot have, or files that are there or cannot
        be written.
    BrokenLimitError
        The motion breaks a limit; nothing is written.
    """
    chosen = _format(format)
    out = Path(out)
    check("rate", rate)
    design = load_design(design) if isinstance(design, str | Path) else design
    _check_name(out, chosen)
    chosen.check_robot(design.robot)
    motion, certificate, notes = _certified(design, chosen, rate)
    recorder = chosen.recorder(motion, out.name)
    record = f"{out.name}.record{recorder.suffix}" if recorder.suffix else None
    names = [name for name in (out.name, record, f"{out.name}{MAPPING}") if name is not None]
    with result_file(out):
        _check_free(out, names, replace=replace)
        file = chosen.file(motion, out.stem)
        beside = [*([recorder.content] if record else []), recorder.mapping_text(motion)]
        contents = [file.content, *(text.encode() for text in beside)]
        with replace_files(out, remove=[f"{out.name}.record{suffix}" for suffix in _RECORDS]) as staged:
            for name, content in zip(names, contents, strict=True):
                with replacing(staged / name, "wb") as stream:
                    stream.write(content)
    played = chosen.interpolation is not Interpolation.NONE
    return Exported(
        name_of(format) if isinstance(format, str) else chosen.name,
        tuple(out.parent / name for name in names),
        (*notes, *file.notes, *recorder.notes, chosen.checked),
        _facts(motion, certificate),
        holds=not (played and certificate.broken),
    )


def _format(given: MotionFormat | str) -> MotionFormat:
    """The format itself, with all that a format has."""
    try:
        chosen = instance("motion format", given)
    except TypeError as error:  # such as an abstract class
        raise InputError(f"motion format {name_of(given)}: {error}") from error
    if not isinstance(chosen, MotionFormat):
        raise InputError(f"motion format {name_of(given)}: expected a subclass of excite.MotionFormat")
    missing = [
        name for name in ("name", "default_rate", "fastest", "interpolation", "checked") if not hasattr(chosen, name)
    ]
    if missing:
        raise InputError(f"motion format {name_of(given)}: it does not state its {', '.join(missing)}")
    return chosen


def _check_name(out: Path, chosen: MotionFormat) -> None:
    if chosen.suffix and out.suffix != chosen.suffix:
        raise InputError(f"{out}: the format {chosen.name} expects a name that ends in {chosen.suffix}")


def _check_free(out: Path, names: list[str], *, replace: bool) -> None:
    there = [str(out.parent / name) for name in names if (out.parent / name).exists()]
    if there and not replace:
        raise TakenError(f"{', '.join(there)} already there")


def _certified(
    design: DesignedMotion, chosen: MotionFormat, rate: float | None
) -> tuple[SampledDesign, Certificate, tuple[str, ...]]:
    """The motion at a rate at which what is interpolated keeps the limits; where it is not known, passes them least.

    No rate is raised for files that no controller plays.
    """
    known, refused = len(chosen.interpolation.curves) == 1, None
    least: tuple[SampledDesign, Certificate] | None = None
    for each in _rates(design, chosen, rate):
        chosen.check_rate(each)
        motion = chosen.sampled(design, each)
        if least is None and refused is None:
            check_formula(motion)
        certificate = certify(motion, chosen.interpolation, chosen.given)
        try:
            chosen.check(motion)
            if known:
                check_interpolated(certificate, chosen.interpolation)
        except BrokenLimitError as error:
            refused = error
            continue
        if least is None or _passed(certificate) < _passed(least[1]):
            least = motion, certificate
        if not certificate.broken or chosen.interpolation is Interpolation.NONE:
            break
    if least is None:
        assert refused is not None
        raise refused
    return *least, _notes(*least, chosen, rate)


def _rates(design: DesignedMotion, chosen: MotionFormat, rate: float | None) -> list[float]:
    """The given rate, or that of the format and faster ones that it takes."""
    if rate is not None:
        return [rate]
    faster = (chosen.default_rate * times for times in _FASTER)
    most = chosen.most / design.sequence.duration
    return [chosen.default_rate, *(each for each in faster if chosen.default_rate < each <= min(chosen.fastest, most))]


def _passed(certificate: Certificate) -> float:
    """Largest use of a limit that is passed."""
    return certificate.broken[0].use if certificate.broken else 0.0


def _notes(
    motion: SampledDesign, certificate: Certificate, chosen: MotionFormat, rate: float | None
) -> tuple[str, ...]:
    interpolation = chosen.interpolation
    closest = certificate.uses[0] if certificate.uses else None
    used = "" if closest is None else f"; the closest, {closest.label}, uses {100 * closest.use:.4g} %"
    known = f"limits of joints and drives hold for {interpolation.value}{used}"
    unknown = f"{interpolation.value}: between samples the limits of joints and drives are {certificate.text}"
    raised = (
        (
            f"at {chosen.default_rate:g} Hz the controller's interpolation would break a limit, so the rate is "
            f"{motion.rate:g} Hz",
        )
        if rate is None and motion.rate != chosen.default_rate
        else ()
    )
    away = deviation(motion, interpolation)
    near = () if away is None else (f"what is interpolated deviates from the design by {away:.2g} rad (m) at most",)
    held = motion.time[-1] - motion.sequence.duration
    start = (
        ()
        if "approach" in motion.segments
        else ("the robot must rest in the first pose; a design with `home` also has the approach",)
    )
    rest = (f"the robot rests for {held:.3g} s after the motion, until the last sample",) if held > 1e-9 else ()
    return (*raised, known if len(interpolation.curves) == 1 else unknown, *near, *start, *rest)


def _facts(motion: SampledDesign, certificate: Certificate) -> dict[str, object]:
    closest = certificate.uses[0] if certificate.uses else None
    return {
        "rate": motion.rate,
        "samples": int(motion.time.size),
        "duration": float(motion.time[-1]),
        "joints": list(motion.joints),
        "design": motion.design.file_sha256,
        "coefficients": motion.design.coefficients_sha256,
        "limits_kept": not certificate.broken,
        "between_samples": certificate.text,
        "closest_limit": None if closest is None else closest.label,
        "closest_limit_used": None if closest is None else closest.use,
    }
