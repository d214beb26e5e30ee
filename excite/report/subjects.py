"""What a page is about: objects, or what folders and files hold."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, get_args

from excite.design.campaign import Campaign
from excite.design.designed_motion import DesignedMotion
from excite.files import design_folder, result_json
from excite.files.design_json import load_design
from excite.files.result_json import load_result
from excite.friction.fit.friction_fit import FIT, FrictionFit, load_friction_fit
from excite.friction.fit.friction_fit import KIND as FRICTION_FIT
from excite.friction.plan.friction_plan import KIND as FRICTION_PLAN
from excite.friction.plan.friction_plan import PLAN, FrictionPlan, load_friction_plan
from excite.identification.identification import Identification
from excite.report.campaign_section import campaign_of
from excite.storage.atomic import read_json
from excite.storage.commit import settle
from excite.storage.destination import Destination
from excite.storage.migrations import is_of_kind
from excite.study.time_study import KIND as STUDY
from excite.study.time_study import TimeStudy, load_time_study
from excite.sweeps.sweep_table import JSON as CAMPAIGN_TABLE
from excite.sweeps.sweep_table import KIND as CAMPAIGN
from excite.sweeps.sweep_table import SweepTable, load_sweep
from excite.verification.verification import KIND as VERIFICATION
from excite.verification.verification import Verification, load_verification
from regressors.arguments import check_of, fit
from regressors.errors import InputError

Record = Verification | TimeStudy | FrictionPlan | FrictionFit | SweepTable


@dataclass(frozen=True)
class Filed:
    """A record, and the file that it was read from."""

    record: Record
    path: Path


Subject = (
    DesignedMotion
    | Identification
    | Filed
    | Verification
    | Campaign
    | SweepTable
    | FrictionPlan
    | FrictionFit
    | TimeStudy
)
_KINDS = get_args(Subject)
_RECORDS = (PLAN, CAMPAIGN_TABLE, FIT, "study.json", "verification*.json")


def subjects_of(given: Iterable[object], part: Collection[str] = ()) -> list[Subject]:
    """Objects as they are; of each folder its design, identification and verifications, of each file its own."""
    subjects: list[Subject] = []
    for each in given:
        if isinstance(each, _KINDS):
            subjects.append(each)
        elif isinstance(each, str | Path):
            path = Path(fit("paths_or_objects", each, (check_of(Path), "the name of a folder or a file")))
            subjects += [_of_file(path, part)] if path.suffix == ".json" else _of_folder(path, part)
        else:
            raise InputError(
                "a report is of designs, identifications, verifications, campaigns, fits of friction curves, studies, "
                f"or their folders; given an object of type {type(each).__name__}"
            )
    if not subjects:
        raise InputError("a report needs the folder of a design, an identification or a verification; none is given")
    return subjects


def _of_folder(folder: Path, part: Collection[str]) -> list[Subject]:
    if not folder.is_dir():
        raise InputError(f"there is no folder {folder}")
    settle(Destination(folder))
    readers: dict[str, Callable[[Path], Subject]] = {
        design_folder.DESIGN: partial(load_design, part=part),
        result_json.RESULT: partial(load_result, part=part),
    }
    found = [read(folder) for name, read in readers.items() if (folder / name).exists()]
    found += [read for path in _files(folder) if (read := _record(path, read_json(path).get("schema"))) is not None]
    if not found:
        raise InputError(
            f"{folder} holds neither a design ({design_folder.DESIGN}), nor an identification ({result_json.RESULT}), "
            "nor a verification (verification-LOG.json), nor a friction plan (plan.json), a fit of friction curves "
            "(fit.json), a study (study.json) or a campaign (campaign.json)"
        )
    return found


def _files(folder: Path) -> list[Path]:
    """Files of a folder that may hold a record."""
    return [path for pattern in _RECORDS for path in sorted(folder.glob(pattern))]


def _record(path: Path, schema: object) -> Filed | None:
    """The record that a file holds; None where it is of another kind."""
    readers: dict[str, Callable[[Path], Record]] = {
        VERIFICATION: load_verification,
        STUDY: load_time_study,
        FRICTION_PLAN: load_friction_plan,
        CAMPAIGN: load_sweep,
        FRICTION_FIT: load_friction_fit,
    }
    return next((Filed(read(path), path) for kind, read in readers.items() if is_of_kind(kind, schema)), None)


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
        return campaign_of(content, path)
    raise InputError(
        f"{path}: expected a design, an identification, a verification, a friction plan, a fit of friction curves, a "
        f"study, the table of a campaign, or a campaign of `plan_campaign`, given schema {schema!r}"
    )
