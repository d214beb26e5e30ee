"""Where a Dask scheduler is: ``dask://HOST:PORT``, ``dask-file:PATH`` or ``dask-local[:N]``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from regressors.errors import InputError
from regressors.quoting import shortened

_FORMS = "dask://HOST:PORT, dask-file:PATH of a scheduler file, or dask-local:N for N processes of this machine"
_MOST_PORT, _MOST_PROCESSES = 65535, 1024


@dataclass(frozen=True)
class DaskAddress:
    """A scheduler that runs, or one that is started on this machine."""

    scheduler: str = ""  # ``tcp://HOST:PORT``; empty where it is not named
    file: Path | None = None  # scheduler file
    processes: int | None = None  # of a cluster on this machine; one per core if neither this nor the others are given

    @property
    def is_local(self) -> bool:
        """Whether a cluster is started on this machine."""
        return not self.scheduler and self.file is None

    def __str__(self) -> str:
        if self.is_local:
            return "dask-local"
        return self.scheduler.replace("tcp:", "dask:") if self.file is None else f"dask-file:{self.file}"


def dask_address(text: str) -> DaskAddress:
    """Read the name of an executor on Dask."""
    kind, _, rest = text.partition(":")
    if kind == "dask" and rest.startswith("//"):
        host, _, port = rest[2:].rpartition(":")
        if host and not set(host) & set("/@ ") and port.isascii() and port.isdigit() and 0 < int(port) <= _MOST_PORT:
            return DaskAddress(scheduler=f"tcp://{host}:{port}")
    elif kind == "dask-file" and rest:
        return DaskAddress(file=Path(rest))
    elif text == "dask-local":
        return DaskAddress()
    elif kind == "dask-local" and rest.isascii() and rest.isdigit() and 0 < int(rest[:6]) <= _MOST_PROCESSES:
        return DaskAddress(processes=int(rest[:6]))
    raise InputError(f"executor {shortened(text)}: expected {_FORMS}")
