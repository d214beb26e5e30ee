"""What a page is about: objects, or what folders and files hold."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from excite.design.campaign import Campaign
from excite.design.designed_motion import DesignedMotion
from excite.files import design_folder, result_json, verification_json
from excite.files.design_json import load_design
from excite.files.result_json import load_result
from excite.identification.result import IdentificationResult
from excite.report.campaign_section import campaign_of
from excite.report.verification_section import StoredVerification, load_verification
from excite.storage.atomic import read_json
from excite.storage.commit import settle
from excite.storage.destination import Destination
from excite.verification.verification import Verification
from regressors.errors import InputError

Subject = DesignedMotion | IdentificationResult | StoredVerification | Verification | Campaign
_KINDS = (DesignedMotion, IdentificationResult, StoredVerification, Verification, Campaign)
_VERIFICATIONS = "verification*.json"


def subjects_of(given: Iterable[object], part: Collection[str] = ()) -> list[Subject]:
    """Objects as they are; of each folder its design, its identification and its verifications, of each file its own.

    Parameters
    ----------
    given : iterable
        Designs, identifications, verifications, campaigns, folders, or files: ``design.json``, ``result.json``,
        ``verification-LOG.json``, and what ``excite plan --json`` prints.
    part : collection of str
        User-defined parts, as ``module:Name``, that may be imported where a file names them.

    Raises
    ------
    InputError
        Nothing is given, or something of another kind; a folder that holds none of them; files that cannot be read.
    """
    subjects: list[Subject] = []
    for each in given:
        if isinstance(each, _KINDS):
            subjects.append(each)
        elif isinstance(each, str | Path):
            path = Path(each)
            subjects += [_of_file(path, part)] if path.suffix == ".json" else _of_folder(path, part)
        else:
            raise InputError(
                "a report is of designs, identifications, verifications, campaigns, or their folders; given an object "
                f"of type {type(each).__name__}"
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
    found += [load_verification(path) for path in sorted(folder.glob(_VERIFICATIONS)) if _is_verification(path)]
    if not found:
        raise InputError(
            f"{folder} holds neither a design ({design_folder.DESIGN}), nor an identification ({result_json.RESULT}), "
            "nor a verification (verification-LOG.json)"
        )
    return found


def _is_verification(path: Path) -> bool:
    return read_json(path).get("schema") == verification_json.SCHEMA


def _of_file(path: Path, part: Collection[str]) -> Subject:
    """What a file holds, by its schema."""
    content: Mapping[str, Any] = read_json(path)
    schema = content.get("schema")
    if schema == design_folder.SCHEMA:
        return load_design(path, part)
    if schema == result_json.SCHEMA:
        return load_result(path, part)
    if schema == verification_json.SCHEMA:
        return load_verification(path)
    if schema is None and {"steps", "subsets"} <= set(content):
        return campaign_of(content, path)
    raise InputError(
        f"{path}: expected a design, an identification, a verification, or a campaign of `plan_campaign`, given "
        f"schema {schema!r}"
    )
