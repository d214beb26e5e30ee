"""What folders and files hold, as records; and what a page is about."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from excite.design import design_folder
from excite.design.campaign import Campaign
from excite.design.design import Design
from excite.design.design_json import load_design
from excite.design.friction_runs.friction_plan import KIND as FRICTION_PLAN, PLAN, FrictionPlan
from excite.design.sweeps.sweep_table import JSON as CAMPAIGN_TABLE, KIND as CAMPAIGN, SweepTable
from excite.friction.friction_fit import FIT, KIND as FRICTION_FIT, FrictionFit
from excite.identification import result_json
from excite.identification.identification import Identification
from excite.identification.result_json import load_result
from excite.identification.servo_result import KIND as SERVOS_KIND, SERVOS, ServoResult
from excite.logs.log_reading import KIND as LOG
from excite.optimality.design_bound import KIND as BOUND, DesignBound
from excite.payload.payload_result import KIND as PAYLOAD_KIND, PAYLOAD, PayloadResult
from excite.simulation.simulation import SimulatedLog
from excite.storage.atomic import Destination, read_json
from excite.storage.codec import record_of
from excite.storage.commit import settle
from excite.storage.migrations import is_of_kind
from excite.storage.records import read_record
from excite.study.posterior_samples import load_posterior
from excite.study.predict_accuracy import KIND as ACCURACY, AccuracyPrediction
from excite.study.time_study import KIND as STUDY, TimeStudy
from excite.verification.verification import KIND as VERIFICATION, Verification
from excite.verification.verify_servos import KIND as SERVO_VERIFICATION, ServoVerification
from regressors.arguments import checked, fit, rule_of
from regressors.errors import InputError, about

Experiment = TimeStudy | FrictionPlan | FrictionFit | PayloadResult | SimulatedLog | ServoResult | ServoVerification
Record = Experiment | Verification | SweepTable | AccuracyPrediction | DesignBound


@dataclass(frozen=True)
class Filed:
    """A record, and the file that it was read from."""

    record: Record
    path: Path


Subject = Design | Identification | Filed | Campaign | Record
_KINDS = get_args(Subject)
_LOADERS: dict[str, Callable[..., Subject]] = {design_folder.DESIGN: load_design, result_json.RESULT: load_result}
_RECORDS = (PLAN, CAMPAIGN_TABLE, FIT, "study.json", PAYLOAD, SERVOS, "verification*.json")


@checked
def load(path: str | Path, part: str | Collection[str] = ()) -> Any:
    """Load what was saved: a design, an identification, or any other record.

    Parameters
    ----------
    path : path
        Folder of a design, an identification, a friction plan or fit, a study, a sweep or a payload; or a file of one,
        such as ``verification-LOG.json``, ``accuracy.json``, ``bound.json``, ``precision.json`` or ``samples.npz``; or
        a simulated log, of which the file beside it is read.
    part : str or collection of str
        Parts of the user's own, ``module:Name``, that the file names; see `load_design`.

    Returns
    -------
    Design, Identification, Verification, FrictionPlan, FrictionFit, TimeStudy, SweepTable, PayloadResult, \
AccuracyPrediction, DesignBound, PrecisionSearch, SimulatedLog or PosteriorSamples
        Equal to the one that was saved; what needs more than the file has is derived when it is asked for.

    Raises
    ------
    InputError
        There is nothing of these kinds, or it is damaged.
    """
    path, parts = Path(path), (part,) if isinstance(part, str) and part else part
    beside = path.with_suffix(".json")
    if path.suffix == ".npz" or (path.suffix == ".csv" and not beside.exists()):
        return load_posterior(path)
    file = beside if path.suffix == ".csv" else path
    if file.suffix != ".json":
        settle(Destination(path))
        file = next((path / name for name in _WHOLE if (path / name).exists()), path)
        if file == path:
            raise InputError(f"{path} holds none of {', '.join(_WHOLE)}; name one of its files")
        if file.name in _LOADERS:
            return _LOADERS[file.name](path, parts)
    if is_of_kind(design_folder.PRECISION_KIND, read_json(file).get("schema")):
        return design_folder.load_precision_search(file.parent)
    subject = _of_file(file, parts)
    return subject.record if isinstance(subject, Filed) else subject


_CLASSES: dict[str, type[Record]] = {
    VERIFICATION: Verification,
    STUDY: TimeStudy,
    FRICTION_PLAN: FrictionPlan,
    CAMPAIGN: SweepTable,
    FRICTION_FIT: FrictionFit,
    PAYLOAD_KIND: PayloadResult,
    SERVOS_KIND: ServoResult,
    SERVO_VERIFICATION: ServoVerification,
    ACCURACY: AccuracyPrediction,
    LOG: SimulatedLog,
    BOUND: DesignBound,
}
_WHOLE = (*_LOADERS, PLAN, FIT, "study.json", CAMPAIGN_TABLE, PAYLOAD, SERVOS)


def subjects_of(given: Iterable[object], part: Collection[str] = ()) -> list[Subject]:
    """Objects as they are; of each folder its design, identification and verifications, of each file its own."""
    subjects: list[Subject] = []
    for each in given:
        if isinstance(each, _KINDS):
            subjects.append(each)
        elif isinstance(each, str | Path):
            path = Path(fit("paths_or_objects", each, (rule_of(Path)[0], "the name of a folder or a file")))
            subjects += [_of_file(path, part)] if path.suffix == ".json" else _of_folder(path, part)
        else:
            raise InputError(
                "a report is of designs, identifications, verifications, campaigns, fits of friction curves, studies, "
                f"or their folders; given an object of type {type(each).__name__}"
            )
    if not subjects:
        raise InputError("a report needs the folder of a design, an identification or a verification; none is given")
    # a record that is named beside its folder is shown once
    return list({each.path.resolve() if isinstance(each, Filed) else id(each): each for each in subjects}.values())


def _of_folder(folder: Path, part: Collection[str]) -> list[Subject]:
    if not folder.is_dir():
        raise InputError(f"there is no folder {folder}")
    settle(Destination(folder))
    found = [read(folder, part) for name, read in _LOADERS.items() if (folder / name).exists()]
    files = [path for pattern in _RECORDS for path in sorted(folder.glob(pattern))]
    found += [read for path in files if (read := _record(path, read_json(path).get("schema"))) is not None]
    if not found:
        raise InputError(
            f"{folder} holds neither a design ({design_folder.DESIGN}), nor an identification ({result_json.RESULT}), "
            "nor a verification (verification-LOG.json), nor a friction plan (plan.json), a fit of friction curves "
            "(fit.json), a study (study.json) or a campaign (campaign.json)"
        )
    return found


def _record(path: Path, schema: object) -> Filed | None:
    """The record that a file holds; None where it is of another kind."""
    kind = next((kind for kind in _CLASSES if is_of_kind(kind, schema)), None)
    return None if kind is None else Filed(read_record(path, _CLASSES[kind], kind), path)


def _of_file(path: Path, part: Collection[str]) -> Subject:
    """What a file holds, by its schema."""
    content: Mapping[str, Any] = read_json(path)
    schema = content.get("schema")
    if schema == design_folder.SCHEMA:
        return load_design(path, part)
    if is_of_kind(result_json.KIND, schema):
        return load_result(path, part)
    if (record := _record(path, schema)) is not None:
        return record
    if schema is None and {"steps", "subsets"} <= set(content):
        with about(f"{path}: not a complete campaign"):  # as ``excite plan`` prints it
            return record_of(Campaign, content, {})
    raise InputError(
        f"{path}: expected a design, an identification, a verification, a friction plan, a fit of friction curves, a "
        f"study, the table of a campaign, or a campaign of `plan_campaign`, given schema {schema!r}"
    )
