"""Export of a design as a motion that a controller plays, with what to record beside it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from constraints.interpolation import curves_text
from excite.design.design import Design
from excite.design.design_json import load_design
from excite.errors import BrokenLimitError
from excite.export.exported import Exported
from excite.export.motions.motion_format import (
    Certificate,
    Interpolation,
    MotionFormat,
    certify,
    check_formula,
    check_interpolated,
    closest_first,
    deviation,
)
from excite.export.motions.sampled_design import SampledDesign
from excite.logs.mapping import MAPPING
from excite.registry import instance, name_of
from excite.storage.atomic import write_bytes, writing
from excite.storage.result_folder import check_free, replace_files, result_file
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.quantities import check

_RECORDS = (".xml", ".yaml")  # what an older export in another format may have left
_FASTER = (1.0, 2.0, 5.0, 10.0)  # times the default rate, until what is interpolated keeps the limits


@checked
def export_motion(
    design: Design | str | Path,
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
    design : Design or path
        A design, or its folder.
    format : MotionFormat or str
        A format, or the name of one.
    out : path
        File to write, or folder where the format is one. ``OUT.record.*``, for the recorder that belongs to the
        controller, and ``OUT.mapping.yaml``, by which `identify` reads its recording, are written beside it.
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
    excite.errors.BrokenLimitError
        The motion breaks a limit; nothing is written.
    """
    chosen = _format(format)
    out = Path(out)
    check("rate", rate)
    design = load_design(design) if isinstance(design, str | Path) else design
    if chosen.suffix and out.suffix != chosen.suffix:
        raise InputError(f"{out}: the format {chosen.name} expects a name that ends in {chosen.suffix}")
    chosen.check_robot(design.robot)
    motion, certificate = _certified(design, chosen, rate)
    notes, facts = _notes(motion, certificate, chosen, rate), _facts(motion, certificate)
    motion = motion.of_drives
    recorder = chosen.recorder(motion, out.name)
    with result_file(out):
        file = chosen.file(motion, out.stem)
        contents = {} if file.folder else {out.name: file.content}
        if recorder.suffix:
            contents[f"{out.name}.record{recorder.suffix}"] = recorder.content.encode()
        contents[f"{out.name}{MAPPING}"] = recorder.mapping_text(motion).encode()
        paths = [*(out.parent / name for name in contents), *(out / name for name in file.folder)]
        check_free(*paths, replace=replace)
        with replace_files(out, remove=[f"{out.name}.record{suffix}" for suffix in _RECORDS]) as staged:
            for name, content in contents.items():
                write_bytes(staged / name, content)
        _write_folder(out, file.folder)
    played = chosen.interpolation is not Interpolation.NONE
    return Exported(
        name_of(format) if isinstance(format, str) else chosen.name,
        tuple(out.parent / name for name in dict.fromkeys((out.name, *contents))),
        (*notes, *file.notes, *recorder.notes, chosen.checked),
        facts,
        holds=not (played and closest_first(certificate, broken=True)),
    )


def _write_folder(out: Path, files: Mapping[str, bytes]) -> None:
    """Write files below a folder, each whole; the last is there only when all others are."""
    with writing(out):
        for name in list(files)[-1:]:
            (out / name).unlink(missing_ok=True)
        for name in files:
            (out / name).parent.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        write_bytes(out / name, content)


def _format(given: MotionFormat | str) -> MotionFormat:
    """The format itself, with all that a format has."""
    try:
        chosen = instance("motion format", given)
        if not isinstance(chosen, MotionFormat):
            raise TypeError("expected a subclass of excite.MotionFormat")
        needed = ("name", "default_rate", "fastest", "interpolation", "checked")
        if missing := [name for name in needed if not hasattr(chosen, name)]:
            raise TypeError(f"it does not state its {', '.join(missing)}")
    except TypeError as error:  # also of an abstract class
        raise InputError(f"motion format {name_of(given)}: {error}") from error
    return chosen


def _certified(design: Design, chosen: MotionFormat, rate: float | None) -> tuple[SampledDesign, Certificate]:
    """The motion at a rate at which what is interpolated keeps the limits; where it is not known, passes them least."""
    refusals: list[BrokenLimitError] = []
    played: list[tuple[float, SampledDesign, Certificate]] = []
    for each in _rates(design, chosen, rate):
        chosen.check_rate(each)
        motion = chosen.sampled(design, each)
        if not played and not refusals:
            check_formula(motion)
        certificate = certify(motion, chosen.interpolation, chosen.given)
        try:
            chosen.check(motion)
            if len(chosen.interpolation.curves) == 1:
                check_interpolated(certificate, chosen.interpolation)
        except BrokenLimitError as error:
            refusals.append(error)
            continue
        broken = closest_first(certificate, broken=True)
        played.append((broken[0].use if broken else 0.0, motion, certificate))
        if not broken or chosen.interpolation is Interpolation.NONE:  # played by no controller
            break
    if not played:
        raise refusals[-1]
    return min(played, key=lambda each: each[0])[1:]


def _rates(design: Design, chosen: MotionFormat, rate: float | None) -> list[float]:
    """The given rate, or that of the format and faster ones that it takes."""
    if rate is not None:
        return [rate]
    faster = (chosen.default_rate * times for times in _FASTER)
    most = chosen.most / design.sequence.duration
    return [chosen.default_rate, *(each for each in faster if chosen.default_rate < each <= min(chosen.fastest, most))]


def _notes(
    motion: SampledDesign, certificate: Certificate, chosen: MotionFormat, rate: float | None
) -> tuple[str, ...]:
    interpolation, closest = chosen.interpolation, next(iter(closest_first(certificate)), None)
    used = "" if closest is None else f"; the closest, {closest.label}, uses {100 * closest.use:.4g} %"
    kept = f"limits of joints and drives hold for {interpolation.value}{used}"
    if len(interpolation.curves) > 1:
        kept = f"{interpolation.value}: between samples the limits of joints and drives are {curves_text(certificate)}"
    notes = [kept]
    if rate is None and motion.rate != chosen.default_rate:
        break_it = f"at {chosen.default_rate:g} Hz the controller's interpolation would break a limit"
        notes.insert(0, f"{break_it}, so the rate is {motion.rate:g} Hz")
    if (away := deviation(motion, interpolation)) is not None:
        notes.append(f"what is interpolated deviates from the design by {away:.2g} rad (m) at most")
    if "approach" not in motion.segments:
        notes.append("the robot must rest in the first pose; a design with `home` also has the approach")
    if (held := motion.time[-1] - motion.sequence.duration) > 1e-9:
        notes.append(f"the robot rests for {held:.3g} s after the motion, until the last sample")
    return tuple(notes)


def _facts(motion: SampledDesign, certificate: Certificate) -> dict[str, object]:
    closest = next(iter(closest_first(certificate)), None)
    return {
        "rate": motion.rate,
        "samples": int(motion.time.size),
        "duration": float(motion.time[-1]),
        "joints": list(motion.joints),
        "design": motion.design.file_sha256,
        "coefficients": motion.design.coefficients_sha256,
        "limits_kept": not closest_first(certificate, broken=True),
        "between_samples": curves_text(certificate),
        "closest_limit": None if closest is None else closest.label,
        "closest_limit_used": None if closest is None else closest.use,
    }
