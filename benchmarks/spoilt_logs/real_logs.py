"""The real logs of a UR10e, to which faults are added."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from excite.logs.log import Log
from excite.logs.log_reading import read_log
from excite.logs.mapping import read_mapping

MAPPING = Path(__file__).resolve().parents[1] / "identification" / "ur10e.yaml"
NAMES = ("ur-20_02_05-20sec_8harm", "ur-20_02_10-30sec_12harm", "ur-20_02_12-40sec_12harm", "ur-20_02_12-50sec_12harm")


def real_logs(folder: Path) -> Iterator[Log]:
    """Recorded logs in a folder."""
    for name in NAMES:
        yield replace(read_log(folder / f"{name}.csv", mapping=read_mapping(MAPPING)), source=name)
