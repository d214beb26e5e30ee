"""Logs written in the house format."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from excite.logs.csv_motion import header_text
from excite.logs.layout import CHANNELS
from excite.logs.log import WRENCH, Log
from excite.storage.atomic import replacing
from excite.storage.finite import check_table


def write_log(log: Log, path: str | Path) -> None:
    """Write a log as CSV that reads back to the same bits."""
    header, columns = ["time"], [log.time[:, None]]
    for k, joint in enumerate(log.joints):
        for name, suffix in CHANNELS.items():
            channel = getattr(log, name)
            if channel is not None:
                header.append(f"{joint}.{suffix}")
                columns.append(channel[:, k : k + 1])
    if log.wrench is not None:
        header += [f"wrench.{part}" for part in WRENCH]
        columns.append(log.wrench)
    table = np.hstack(columns)
    check_table(Path(path), header, table)
    with replacing(Path(path)) as stream:
        np.savetxt(stream, table, fmt="%.17g", delimiter=",", header=header_text(header), comments="")
