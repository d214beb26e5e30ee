"""``excite export``: a design as a motion that a controller plays, a result as a model that a simulator loads."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from excite.cli.command import Command
from excite.cli.option_types import Folder, Number, PartName
from excite.cli.options import own_parts
from excite.registry import MODEL_FORMATS, MOTION_FORMATS, built_in

if TYPE_CHECKING:
    from excite.export.exported import Exported

_DESIGN, _RESULT = "design.json", "result.json"

_GROUPS = {"Output": ("form", "rate"), "Ensemble": ("samples", "seed", "level", "prior")}
_OF_ENSEMBLES = ("seed", "level", "prior")


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="export",
    epilog="""\b
Examples:
  excite export designs/ur10e --format ros2-yaml --out play/goal.yaml
  excite export designs/ur10e --format urscript --rate 125 --out play/excite.script
  excite export designs/panda --format franka --out play/panda.csv
  excite export results/ur10e --format urdf --robot-file mine.urdf --out models/ur10e.urdf
  excite export results/ur10e --format mjcf --out models/ur10e.xml
  excite export results/ur10e --format mjcf --samples 100 --out models/ensemble

\b
Motions, of a design:
  ros2-yaml  goal of FollowJointTrajectory        mcap      trajectory_msgs/JointTrajectory in a bag
  urscript   program with servoj                  rtde      CSV of target_q for an RTDE client
  franka     1000 rows a second for libfranka     krl       KUKA spline block with its times
  rsi        CSV for KUKA RSI (6 axes), FRI (7)   rapid     ABB module of MoveAbsJ
  egm        CSV for ABB EGM                      npz, mat  arrays for NumPy and MATLAB
  mujoco     arrays with the rows of qpos and ctrl by joint

\b
Models, of a result:
  urdf   copy of --robot-file with the identified parameters, or a URDF written from the robot's description
  mjcf   the same for MuJoCo                      drake     URDF with Drake's rotor inertias and gear ratios
  isaac  actuator configuration of Isaac Lab      yaml      robot YAML, which excite reads
  npz    arrays in the conventions of Pinocchio   csv, md, tex  tables with intervals

\b
Bodies are the physically possible ones nearest the description; what a format cannot express is named.

\b
With --samples, FILE is a folder of robots that the data allow, each of them possible: what the data determine
is spread as the result states, the rest by --prior about the description. Beside the robots are ranges.yaml
(low, high, mean and deviation of every parameter), samples.npz and, when all is written, ensemble.json.
After Ctrl-C the robots that are written stay, with an ensemble.json that lists them.

\b
Every sample of a motion is the design's own formula, with approach and return where it has them, at exact
rest at both ends. Limits are checked again for what the controller makes of the samples; a motion that breaks
one is not written.

\b
What is written:
  FILE               the motion or the model, with the hash of the design or the result
  FILE.record.*      what to record, for the recorder that belongs to the controller, if it takes a file
  FILE.mapping.yaml  how 'excite identify --mapping' reads that recording, and by which hash it finds the design

Exit status 1, and no file, where the motion breaks a limit; exit status 1 too where the controller does not
document what it makes of the samples (rtde, krl, rapid), and a curve through them would pass one.""",
)
@click.argument("folder", type=Folder(), metavar="DIR")
@click.option(
    "--format",
    "form",
    required=True,
    type=PartName("export format", tuple(dict.fromkeys((*MOTION_FORMATS, *MODEL_FORMATS)))),
    help="Format; see below.",
)
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="FILE", help="File to write.")
@click.option(
    "--rate", type=Number(), metavar="HZ", help="Samples per second of a motion.  [default: that of the format]"
)
@click.option(
    "--robot-file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Description of the robot to change a copy of, for a model.",
)
@click.option(
    "--samples",
    type=Number(),
    metavar="N",
    help="Write an ensemble: N possible robots that the data of a result allow.",
)
@click.option("--seed", type=Number(), metavar="N", help="Seed of the ensemble.  [default: 0]")
@click.option(
    "--level", type=Number(), metavar="SHARE", help="Share of the posterior within the ranges.  [default: 0.99]"
)
@click.option(
    "--prior",
    type=Number(),
    metavar="R",
    help="Relative deviation of the description, for what the data do not determine.  [default: 0.3]",
)
@own_parts
@click.option("--force", is_flag=True, help="Replace files that are already there.")
def command(
    folder: Path,
    form: str,
    out: Path,
    rate: float | None,
    robot_file: Path | None,
    parts: tuple[str, ...],
    force: bool,
    samples: int | None,
    **ensemble: float | None,
) -> None:
    """Export the design or the result in DIR as a FILE that other programs take.

    DIR is the folder of a design or of a result; where it holds both, name its design.json or its result.json.
    """
    given = {name: value for name, value in ensemble.items() if value is not None}
    if samples is None and given:
        raise click.UsageError(f"--{next(iter(given))} is of an ensemble: give the number of its robots, --samples N")
    if _holds_result(folder, form):
        known = {"samples": samples, **given} if samples is not None else {}
        exported = _export_model(folder, form, out, rate, robot_file, parts, force, known)
    elif samples is not None:
        raise click.UsageError("--samples is for the robots of a result, and DIR holds a design")
    else:
        exported = _export_motion(folder, form, out, rate, robot_file, parts, force)
    _show(exported)
    if exported.facts.get("interrupted"):
        from excite.cli.interrupts import interrupted_status

        sys.exit(interrupted_status())
    if not exported.holds:
        sys.exit(1)


def _holds_result(folder: Path, form: str) -> bool:
    """Whether a result is meant, and not a design."""
    if folder.suffix == ".json":
        return folder.name == _RESULT
    design, result = ((folder / name).exists() for name in (_DESIGN, _RESULT))
    if design and result and form in MOTION_FORMATS and form in MODEL_FORMATS:
        raise click.UsageError(
            f"{folder} holds a design and a result, and {form} is a format of both: name {folder / _DESIGN} or "
            f"{folder / _RESULT}"
        )
    return result and (not design or form in MODEL_FORMATS)


def _export_motion(
    folder: Path,
    form: str,
    out: Path,
    rate: float | None,
    robot_file: Path | None,
    parts: tuple[str, ...],
    force: bool,
) -> Exported:
    import excite

    if form in MODEL_FORMATS and form not in MOTION_FORMATS and (folder / _DESIGN).exists():
        raise click.UsageError(
            f"{form} is a format of models, and {folder} holds a design: identify with it and export the result, or "
            f"choose {', '.join(MOTION_FORMATS)}"
        )
    if robot_file is not None:
        raise click.UsageError("--robot-file is for the model of a result, and DIR holds a design")
    exported: Exported = built_in("exporter", "motion")(
        excite.load_design(folder, parts), form, out, rate=rate, replace=force
    )
    return exported


def _export_model(
    folder: Path,
    form: str,
    out: Path,
    rate: float | None,
    robot_file: Path | None,
    parts: tuple[str, ...],
    force: bool,
    ensemble: dict[str, Any],
) -> Exported:
    import excite
    from excite.cli.interrupts import deferred_interrupt
    from excite.cli.progress import progress_of_samples

    if form in MOTION_FORMATS and form not in MODEL_FORMATS:
        raise click.UsageError(
            f"{form} is a format of motions, and {folder} holds a result: export its design, or choose "
            f"{', '.join(MODEL_FORMATS)}"
        )
    if rate is not None:
        raise click.UsageError("--rate is for the motion of a design, and DIR holds a result")
    result = excite.load_result(folder, parts) if parts else excite.load_result(folder)
    exported: Exported
    if not ensemble:
        exported = built_in("exporter", "model")(result, form, out, robot_file=robot_file, replace=force)
        return exported
    with deferred_interrupt("stopping after the robot at work") as answer, progress_of_samples("exported") as progress:

        def report(done: int, total: int) -> None:
            progress(done, total)
            if done < total:
                answer()

        exported = built_in("exporter", "ensemble")(
            result, form, out, robot_file=robot_file, replace=force, progress=report, **ensemble
        )
    return exported


def _show(exported: Exported) -> None:
    from excite.cli.messages import in_options
    from excite.cli.summary import Summary, show

    def content() -> dict[str, Any]:
        notes = [in_options(note) for note in exported.notes]
        files = [str(file) for file in exported.files]
        return {"format": exported.format, "files": files, **exported.facts, "notes": notes}

    def details() -> None:
        for line in (*_facts(exported), *(f"note: {in_options(note)}" for note in exported.notes)):
            click.echo(line)
        click.echo(f"written: {_listed(exported)}")

    show(
        Summary(
            verdict=_verdict(exported),
            holds=exported.holds,
            facts=_played(exported),
            notes=exported.notes,
            files=exported.files,
        ),
        content,
        details,
    )


def _listed(exported: Exported) -> str:
    """The files; of an ensemble its folder and how many."""
    if "robots" not in exported.facts:
        return ", ".join(map(str, exported.files))
    return f"{exported.files[0].parent}: {len(exported.files)} files"


def _verdict(exported: Exported) -> str:
    """What was written, and, of a motion, how near it comes to its limits."""
    facts = exported.facts
    if "robots" in facts:
        ended = ", interrupted" if facts.get("interrupted") else ""
        return f"Ensemble of {facts['robots']} possible robots exported as {exported.format}{ended}"
    if "closest_limit" not in facts:
        return f"Model exported as {exported.format}"
    label, used = facts["closest_limit"], facts["closest_limit_used"]
    if label is None:
        return f"Motion exported as {exported.format}; no limit of the robot is known"
    if not facts["limits_kept"]:
        return f"Motion exported as {exported.format}; between its samples the limits are {facts['between_samples']}"
    return (
        f"Motion exported as {exported.format}, within its limits; the closest, {label}, is used to {100 * used:.4g} %"
    )


def _played(exported: Exported) -> list[str]:
    """Rate and duration of a motion, in one line."""
    facts = exported.facts
    if not {"rate", "samples", "duration", "joints"} <= facts.keys():
        return _facts(exported)
    return [
        f"{facts['samples']} samples at {facts['rate']:g} Hz over {facts['duration']:g} s; {', '.join(facts['joints'])}"
    ]


def _facts(exported: Exported) -> list[str]:
    """Facts with their numbers rounded."""
    return [f"{name.replace('_', ' ')}: {_shown(value)}" for name, value in exported.facts.items()]


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(map(_shown, value)) or "none"
    if isinstance(value, float):
        return f"{value:.4g}"
    return "-" if value is None else str(value)
