"""The design that a log mapping names, for `excite identify`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from excite.cli.streams import remark
from excite.files.named_design import find_design
from excite.logs.mapping import read_mapping

_DESIGNS = Path("designs")


def design_folder(given: Path | None, mapping: Path | None, places: Sequence[Path]) -> Path | None:
    """Folder of the design that was played."""
    named = None if mapping is None or given is not None else read_mapping(mapping).design
    if mapping is None or named is None:
        return given
    searched = tuple(places) or (mapping.parent, _DESIGNS)
    found = find_design(named, searched)
    where = ", ".join(str(place) for place in searched)
    if found is None:
        remark(
            f"excite: note: {mapping} names the design {named[:12]}..., which is not in {where} nor directly below: "
            "its model is not used; --designs names other folders, --design the design itself"
        )
    else:
        remark(f"excite: note: {found} holds the design that {mapping} names; its model is used")
    return found
