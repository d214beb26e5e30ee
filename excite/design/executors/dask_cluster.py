"""Units of work on a Dask cluster: Dask sends them to its workers, and again where a worker is lost."""

from __future__ import annotations

import logging
import os
import queue
import re
import signal
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import version
from itertools import islice
from multiprocessing.resource_tracker import ensure_running
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cloudpickle

from excite.design.executors.unit_executor import InProcesses, InThisProcess, LostUnit, UnitExecutor, Work
from excite.design.formulation import Formulation
from excite.design.interruption import held_signals
from excite.design.multistart import StartsOfRounds, pickled
from excite.design.problem_identity import package_versions
from excite.design.start_results import Progress, Start, StartResult, number_of, write_start
from excite.design.workers import Job, environment_of_workers, main_not_imported, work_on_starts
from excite.errors import LostWorkersError
from excite.registry import ADDRESS_FORMS, is_addressed
from regressors.errors import InputError, UnknownName, shortened
from regressors.quantities import check

if TYPE_CHECKING:
    from distributed import Client, Future


_CONNECT = 10.0  # [s]
_LOOK = 1.0  # seconds between two looks at a cluster that sends nothing
_PATIENCE = 10.0  # seconds without a worker after which that is said
_AHEAD = 1000  # units that are on their way at a time
_TALKATIVE = ("distributed", "tornado")
_one_at_a_time = threading.Lock()
_log = logging.getLogger(__name__)


class DaskCluster:
    """Runs units on the workers of a Dask scheduler.

    A worker runs one unit at a time, whatever its number of threads, since processor time and the threads of linear
    algebra are counted for a whole process.
    """

    shares_disk = False

    def __init__(self, address: str, workers: int | None = None) -> None:
        self.address, self._workers = dask_address(address), workers

    @property
    def processes_here(self) -> int:
        """Workers that are started on this machine: none with the address of a scheduler."""
        return (self.address.processes or self._workers or os.cpu_count() or 1) if self.address.is_local else 0

    def run(self, work: Work, common: Any, units: Sequence[Any]) -> Generator[tuple[int, Any], None, None]:
        """See `UnitExecutor.run`."""
        with self.connected() as cluster:
            yield from cluster.run(work, common, units)

    @contextmanager
    def connected(self) -> Iterator[ConnectedCluster]:
        """Connect once for several runs; errors as in `run`."""
        with _quiet(), _client(self.address, self._workers) as client:
            yield ConnectedCluster(client, self.address)


class ConnectedCluster:
    """A cluster with its client, and the units that are on their way to it and back."""

    def __init__(self, client: Client, address: DaskAddress) -> None:
        self._client, self._address = client, address
        self._without_workers = 0.0

    def run(self, work: Work, common: Any, units: Sequence[Any]) -> Generator[tuple[int, Any], None, None]:
        """See `DaskCluster.run`."""
        done: queue.SimpleQueue[Future] = queue.SimpleQueue()
        running: dict[Future, int] = {}
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Sending large graph", UserWarning)
            # made again where its worker is lost, unlike scattered
            sent = self._client.submit(_same, common, pure=False)

        def submit(index: int) -> None:
            future = self._client.submit(_on_worker, work, sent, units[index], pure=False)
            running[future] = index
            future.add_done_callback(done.put)

        left = iter(range(len(units)))
        try:
            for index in islice(left, _AHEAD):
                submit(index)
            while running:
                future = self._next(done)
                index = running.pop(future)
                result = self._result(future)
                future.release()
                if (following := next(left, None)) is not None:
                    submit(following)
                yield index, result
        finally:
            if self._client.status == "running":  # else it would wait for the scheduler that went away
                with suppress(Exception):
                    self._client.cancel(list(running))

    def _next(self, done: queue.SimpleQueue[Future]) -> Future:
        """The next unit that ended; what waits in vain is said."""
        while True:
            with suppress(queue.Empty):
                return done.get(timeout=_LOOK)
            if self._client.scheduler_info(n_workers=-1)["workers"]:
                self._without_workers = 0.0
            elif not self._without_workers:
                self._without_workers = time.monotonic()
            elif self._without_workers < time.monotonic() - _PATIENCE:
                _log.warning("no Dask worker is connected to %s; waiting for one (Ctrl-C ends it)", self._address)
                self._without_workers = float("inf")

    def _result(self, future: Future) -> Any:
        from distributed.scheduler import KilledWorker

        if future.status in ("cancelled", "lost"):
            raise self._lost()
        if future.status == "finished":
            try:
                return future.result()
            except (CancelledError, OSError) as broken:  # it went away before the result was here
                raise self._lost() from broken
        error = future.exception()
        if isinstance(error, KilledWorker):
            return LostUnit("its Dask worker ended each time")
        if isinstance(error, ImportError):
            raise InputError(f"a Dask worker cannot run this ({error}); install the same version there") from error
        raise error

    def _lost(self) -> LostWorkersError:
        return LostWorkersError(
            f"the Dask scheduler at {self._address} went away",
            "what is finished is kept, and the same command continues with the rest",
        )


def _same(common: Any) -> Any:
    return common


def _on_worker(work: Work, common: Any, unit: Any) -> Any:
    with _one_at_a_time:
        return work(common, unit)


@contextmanager
def _client(address: DaskAddress, workers: int | None) -> Iterator[Client]:
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError(
            f"executor {address} needs Dask, which is not installed: pip install 'excite-trajectories[dask]'"
        ) from error
    with _cluster(address, workers) as given:
        try:
            client = Client(**given, timeout=_CONNECT, set_as_default=False)
        except (OSError, ValueError) as error:
            reason = " ".join(str(error).split())[:120] or type(error).__name__
            raise InputError(f"no Dask scheduler answers at {address}: {reason}") from error
        try:
            yield client
        finally:
            with suppress(Exception):
                client.close(timeout=_LOOK)


@contextmanager
def _cluster(address: DaskAddress, workers: int | None) -> Iterator[dict[str, Any]]:
    """What the client is given; of a cluster on this machine, the cluster."""
    if not address.is_local:
        if address.file is not None and not address.file.is_file():
            raise InputError(
                f"no Dask scheduler file {address.file}; a scheduler that is started with its name writes it"
            )
        yield {"address": address.scheduler} if address.file is None else {"scheduler_file": str(address.file)}
        return
    from distributed import LocalCluster

    if hasattr(os, "fork"):
        ensure_running()  # multiprocessing's own process, whose start would let Ctrl-C through
    with environment_of_workers(), main_not_imported(), held_signals((signal.SIGINT,)):  # which is answered here
        cluster = LocalCluster(
            n_workers=address.processes or workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            silence_logs=logging.ERROR,  # workers that are ended at work warn of it
        )
    try:
        yield {"address": cluster}
    finally:
        with suppress(Exception):
            cluster.close()


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask's own reports of lost connections from the terminal; what matters of them is said here."""
    with suppress(ImportError):
        import distributed  # noqa: F401  # which makes the handlers
    loggers = [logging.getLogger(name) for name in logging.root.manager.loggerDict if name.startswith(_TALKATIVE)]
    handlers = [handler for logger in loggers for handler in logger.handlers]
    for handler in handlers:
        handler.addFilter(_nothing)
    try:
        yield
    finally:
        for handler in handlers:
            handler.removeFilter(_nothing)


def _nothing(_: logging.LogRecord) -> bool:
    return False


_FORMS = "dask://HOST:PORT, dask-file:PATH of a scheduler file, or dask-local:N for N processes of this machine"
_ADDRESS = re.compile(r"dask://([^/@ ]+):([0-9]{1,5})|dask-file:(.+)|dask-local(?::([0-9]{1,6}))?")
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
    if match := _ADDRESS.fullmatch(text):
        host, port, file, count = match.groups()
        if host and 0 < int(port) <= _MOST_PORT:
            return DaskAddress(scheduler=f"tcp://{host}:{port}")
        if file:
            return DaskAddress(file=Path(file))
        if not host and (count is None or 0 < int(count) <= _MOST_PROCESSES):
            return DaskAddress(processes=None if count is None else int(count))
    raise InputError(f"executor {shortened(text)}: expected {_FORMS}")


# all that the starts of a search need on another machine: the pickled blueprint with the origin of the starts, and the
# seed; a start itself holds the motions it descends from
StartNeeds = tuple[bytes, int]


class DaskStarts:
    """Executor of a search that optimises its starts on the workers of a Dask scheduler.

    Unfinished starts are not saved while they run there.
    """

    def __init__(self, address: str) -> None:
        self.address = address

    def __call__(self, formulation: Formulation, rounds: StartsOfRounds, folder: Path, progress: Progress) -> None:
        """Optimise starts; those whose workers end each time are left out, which is logged."""
        origin, search = formulation.identity.origin, formulation.task.search
        needs: StartNeeds = pickled(formulation.blueprint, origin), search.seed
        with DaskCluster(self.address, search.workers).connected() as cluster:
            for starts in rounds:
                for place, result in cluster.run(optimise_there, needs, starts):
                    if isinstance(result, LostUnit):
                        _log.warning("start %d is left out: %s", number_of(starts[place]), result.reason)
                        continue
                    write_start(folder, result, origin)
                    progress(result)


def optimise_there(needs: StartNeeds, start: Start) -> StartResult:
    """Optimise a start where only ``needs`` is known."""
    content, seed = needs
    return _prepared(content)((seed, [start], None))[0]


@lru_cache(maxsize=1)
def _prepared(content: bytes) -> Callable[[Job], list[StartResult]]:
    """What optimises starts, with the problem, built once per worker."""
    blueprint, origin = cloudpickle.loads(content)
    check_versions(origin["problem"]["versions"])
    return work_on_starts(blueprint, origin)


def versions_of(executor: UnitExecutor) -> dict[str, str]:
    """Packages that an executor's processes elsewhere must have in this one's versions, see `check_versions`."""
    return {} if executor.shares_disk else package_versions()


def check_versions(wanted: dict[str, str]) -> None:
    """Check that this process has the same versions of packages as another one."""
    others = [f"{name} {version(name)} instead of {its}" for name, its in wanted.items() if version(name) != its]
    if others:
        raise InputError(f"a Dask worker has {', '.join(others)}; install the same versions there")


def unit_executor(given: str | UnitExecutor, workers: int | None = None) -> UnitExecutor:
    """An executor by its name; an object is returned as it is."""
    check("workers", workers)
    if not isinstance(given, str):
        return given
    if given == "serial":
        return InThisProcess()
    if given == "process":
        return InProcesses(workers)
    if is_addressed("executor", given):
        return DaskCluster(given, workers)
    raise UnknownName("executor of units", given, ("process", "serial", *ADDRESS_FORMS["executor"]))
