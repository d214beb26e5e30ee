"""Ensembles: possible robots that the data of a result allow, one file each, to randomise a simulator with."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from hashlib import sha256
from math import ceil
from pathlib import Path

from excite.design.interruption import signal_answered
from excite.export.exported import Exported
from excite.export.models.export_model import ModelFormat, chosen_format, comment_of
from excite.export.models.exported_model import model_of_result, model_of_sample
from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.robot_yaml import ranges_text
from excite.identification.identification import Identification
from excite.registry import name_of
from excite.storage.atomic import read_json, write_bytes, write_json
from excite.storage.result_folder import result_folder
from excite.study.chains import path_count
from excite.study.posterior_samples import LEVEL, NPZ, PosteriorSamples
from excite.study.sample_posterior import PRIOR, chosen_result, sample_posterior
from regressors.arguments import checked
from regressors.errors import InputError, TakenError
from regressors.quantities import check

SCHEMA = "excite.ensemble/1"
ENSEMBLE, RANGES, SAMPLES = "ensemble.json", "ranges.yaml", f"samples{NPZ}"
ROBOTS = 100
_BEYOND = 10  # draws beyond each end of a range
METHOD = (
    "posterior of the base parameters (Student's t with the covariance and degrees of freedom of the result), with the "
    "description on what the data do not determine, over possible robots; Hamiltonian Monte Carlo with reflections"
)


@checked
def export_ensemble(
    result: Identification | str | Path,
    format: str | ModelFormat,
    out: str | Path,
    *,
    samples: int = ROBOTS,
    seed: int = 0,
    level: float = LEVEL,
    prior: float = PRIOR,
    robot_file: str | Path | None = None,
    replace: bool = False,
    progress: Callable[[int, int], None] = lambda _, __: None,
) -> Exported:
    """Write possible robots that the data of a result allow, each as a file of its own.

    The folder has ``NAME-0001.xml`` and so on; ``samples.npz`` with the standard parameters of every robot in their
    order, and of further ones that only the ranges are taken from, which `excite.load` reads; ``ranges.yaml``
    with low, high, mean and deviation of every parameter; and, when all is written, ``ensemble.json`` with the hashes
    of the result and of every file. The same result, seed and numbers give the same bytes.

    Parameters
    ----------
    result : Identification or path
        Or the folder of a result.
    format : str or ModelFormat
        As of `export_model`.
    out : path
        Folder to write, made if it does not exist.
    samples : int
        Number of robots.
    seed, prior
        See `sample_posterior`.
    level : float
        Share of the posterior within each parameter's range.
    robot_file : path, optional
        See `export_model`; every robot is a copy of it.
    replace : bool
        Whether an ensemble that is there is replaced.
    progress : callable
        Called with the number of steps that are done, and of all.

    Returns
    -------
    Exported
        After Ctrl-C of the robots that are written, with ``interrupted`` among its facts.

    Raises
    ------
    InputError
        What `sample_posterior` and `export_model` refuse, or an ensemble that is there already.
    """
    for name, value in (("samples", samples), ("level", level)):
        check(name, value)
    chosen, folder, template = chosen_format(format), Path(out), None if robot_file is None else Path(robot_file)
    chosen.check_template(template)
    _check_free(folder, replace=replace)
    known = chosen_result(result)
    model = model_of_result(known)
    draws = max(samples, ceil(2 * _BEYOND / (1 - level) - 1e-9))
    paths = path_count(draws)
    drawn = sample_posterior(known, draws, seed=seed, prior=prior, progress=lambda i, n: progress(i, n + samples))
    facts = {"samples": samples, "seed": seed, "level": level, "prior": prior}
    files: dict[str, str] = {}  # hashes by name

    def add(name: str, content: bytes) -> None:
        write_bytes(folder / name, content)
        files[name] = sha256(content).hexdigest()

    robots, notes, interrupted = 0, drawn.notes, False
    with result_folder(folder):
        _check_free(folder, replace=replace)
        _remove_older(folder)
        try:
            origin = comment_of(model, (f"ranges of {100 * level:g} % of the posterior", *drawn.notes))
            add(SAMPLES, drawn.file_content(NPZ))
            add(RANGES, ranges_text(drawn, level, origin).encode("utf-8"))
            for number, (name, content, own) in enumerate(_robots(known, model, chosen, drawn, template, samples)):
                add(name, content)
                robots += 1
                notes = notes if number else tuple(dict.fromkeys((*notes, *own)))
                progress(paths + number + 1, paths + samples)
        except KeyboardInterrupt:
            signal_answered()
            interrupted = True
        listed = {
            "schema": SCHEMA,
            "robot": drawn.robot,
            "result_sha256": drawn.result_sha256,
            "program": model.program,
            "format": name_of(format),
            **facts,
            "interrupted": interrupted,
            "method": METHOD,
            "draws": len(drawn),
            "independent_draws": drawn.effective,
            "split_deviation": drawn.split_deviation,
            "distance": drawn.distance,
            "mean": dict(zip(drawn.names, drawn.mean.tolist(), strict=True)),
        }
        write_json(folder / ENSEMBLE, {**listed, "files": files, "notes": list(notes)})
    told = {"robots": robots, **({"interrupted": True} if interrupted else {})}
    return Exported(name_of(format), (folder / ENSEMBLE, *(folder / name for name in files)), notes, told)


def _robots(
    result: Identification,
    model: IdentifiedModel,
    format: ModelFormat,
    drawn: PosteriorSamples,
    template: Path | None,
    count: int,
) -> Iterator[tuple[str, bytes, tuple[str, ...]]]:
    """Name, content and notes of the file of each robot."""
    stem = "".join(c if c.isalnum() or c in "_.-" else "_" for c in model.described.name)
    for number in range(count):
        note = (
            f"sample {number + 1} of the posterior with seed {drawn.seed}: a possible robot that the data allow, "
            "not the identified one"
        )
        robot = model_of_sample(model, result, drawn.standard(number), note)
        own = (*format.left_out(robot.features), *robot.notes)
        written = format.text(robot, comment_of(robot, own), template)
        others = (*(line for line in own if line != note), *written.notes)
        yield f"{stem}-{number + 1:0{max(4, len(str(count)))}d}{format.suffix}", written.encoded, others


def _remove_older(folder: Path) -> None:
    """Remove the files of an ensemble that is to be replaced, its list first."""
    with suppress(InputError):
        older = read_json(folder / ENSEMBLE).get("files")
        (folder / ENSEMBLE).unlink()
        for name in older if isinstance(older, dict) else ():
            if Path(name).name == name:
                (folder / name).unlink(missing_ok=True)


def _check_free(folder: Path, *, replace: bool) -> None:
    if folder.is_file():
        raise InputError(f"cannot write an ensemble to {str(folder)!r}: it is a file; name a folder")
    if (folder / ENSEMBLE).exists() and not replace:
        raise TakenError(f"{folder} already holds an ensemble")
