"""A design read from its folder, with everything that its figures and its player show."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from excite.design.design import Design
from excite.design.start_results import StartResult, read_start, start_files
from excite.design.stored_design import StoredDesign
from excite.files.design_folder import STARTS
from excite.storage.records import complete


def restore(stored: StoredDesign) -> Design:
    """The design that a folder holds, with its limits as functions of the motion."""
    content, transfers = stored.content, stored.transfers
    with complete(stored.folder / "design.json", "design"):
        return Design(
            robot=stored.robot,
            task=stored.task,
            target=stored.target,
            trajectory=stored.trajectory,
            limits=stored.limits,
            **vars(stored.measured),
            starts=_starts(stored.folder / STARTS),
            best_start=content["solver"]["best_start"],
            provenance=dict(stored.provenance),
            notes=tuple(content["notes"]),
            interrupted=content["interrupted"],
            approach_and_return=None if transfers is None else replace(transfers, limits=stored.transfer_limits),
            folder=stored.folder,
            nonlinear=stored.nonlinear,
            unchecked=stored.unchecked,
            shape=stored.shape,
        )


def _starts(folder: Path) -> tuple[StartResult, ...]:
    """Results of the starts, where the folder still has them."""
    return tuple(read_start(path)[0] for _, path in start_files(folder)) if folder.is_dir() else ()
