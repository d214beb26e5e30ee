"""A folder with an identified payload: ``payload.json``, and one file for each controller."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

from excite.payload.controllers import CONTROLLERS, FILES, controller_text, frame_of
from excite.payload.payload_result import PayloadResult
from excite.storage.atomic import replacing, write_json
from excite.storage.result_folder import check_not_taken, replace_result, result_folder

SCHEMA = "excite.payload/1"
PAYLOAD, KIND = "payload.json", "payload"


def save_payload(
    result: PayloadResult, folder: str | Path, *, controllers: Collection[str] = CONTROLLERS, replace: bool = False
) -> list[Path]:
    """Write a payload into a folder, which is created if it does not exist.

    Parameters
    ----------
    result : PayloadResult
    folder : path
    controllers : collection of str
        That get a file.
    replace : bool
        Replace a payload that is already there.

    Returns
    -------
    list of Path
        Files that were written.

    Raises
    ------
    InputError
        The folder holds a payload, is being written by another process, or cannot be written to.
    """
    folder = Path(folder)
    chosen = controllers if result.mass > 0 else ()
    with result_folder(folder) as run:
        check_no_payload(folder, [FILES[name] for name in chosen], replace=replace)
        with replace_result(folder, KIND, run=run) as staged:
            for name in chosen:
                with replacing(staged / FILES[name]) as stream:
                    stream.write(controller_text(name, result))
            write_json(staged / PAYLOAD, payload_content(result, chosen))
    return [folder / PAYLOAD, *(folder / FILES[name] for name in chosen)]


def check_no_payload(folder: Path, names: Collection[str] = (), *, replace: bool) -> None:
    """Raise `TakenError` where a folder holds a payload, or other files of the names, that may not be replaced."""
    check_not_taken(folder, PAYLOAD, "a payload", names, replace=replace)


def payload_content(result: PayloadResult, controllers: Collection[str] = CONTROLLERS) -> dict[str, Any]:
    """Content of ``payload.json``.

    Parameters
    ----------
    result : PayloadResult
    controllers : collection of str
        Whose text is included.
    """
    gains = result.gains
    return {
        "schema": SCHEMA,
        "robot": {"name": result.robot.name, "sha256": result.robot.sha256()},
        **result.content(),
        "measured": result.source,
        "rated_mass": result.rated,
        "gains": None
        if gains is None
        else {
            "origin": gains.origin,
            "drives": {
                name: {"factor": factor, "deviation": deviation, "found": factor / (1.0 + error)}
                for name, factor, deviation, error in zip(
                    gains.drives,
                    gains.factor.tolist(),
                    gains.deviation.tolist(),
                    result.estimate.gains.tolist(),
                    strict=True,
                )
            },
        },
        "effective_rows": result.estimate.effective,
        "degrees_of_freedom": result.estimate.degrees_of_freedom,
        "logs": [{"load": which, "file": log.source, "sha256": log.sha256} for which, log in result.logs],
        "controllers": {
            name: {"text": controller_text(name, result), "expected_frame": frame_of(name)} for name in controllers
        }
        if result.mass > 0
        else {},
        "notes": list(result.notes),
        "doubts": list(result.doubts),
        "provenance": dict(result.provenance),
    }
