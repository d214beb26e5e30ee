"""The starts of a design on Dask: what a start needs is sent with it, and its result comes back to be written here."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

import cloudpickle

from excite.design.executors.dask_cluster import DaskCluster
from excite.design.executors.unit_executor import LostUnit
from excite.design.formulation import Formulation
from excite.design.multistart import StartsOfRounds, pickled
from excite.design.problem import Problem
from excite.design.single_start import optimise_start
from excite.design.solvers.solver import Solver
from excite.design.start_results import Origin, PlannedStart, StartResult, number_of, write_start
from excite.registry import instance
from regressors.errors import InputError

_log = logging.getLogger(__name__)


# all that the starts of a search need on another machine: the pickled blueprint with the origin of the starts, and the
# seed; a start itself holds the motions it descends from
StartNeeds = tuple[bytes, int]


class DaskStarts:
    """Executor of a search that optimises its starts on the workers of a Dask scheduler.

    Unfinished starts are not saved while they run there.
    """

    def __init__(self, address: str) -> None:
        self.address = address

    def __call__(
        self,
        formulation: Formulation,
        rounds: StartsOfRounds,
        folder: Path,
        progress: Callable[[StartResult], None],
    ) -> None:
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


def optimise_there(needs: StartNeeds, start: PlannedStart | int) -> StartResult:
    """Optimise a start where only ``needs`` is known."""
    content, seed = needs
    problem, method, origin = _prepared(content)
    return optimise_start(problem, method, seed, start, None, origin=origin)


@lru_cache(maxsize=1)
def _prepared(content: bytes) -> tuple[Problem, Solver, Origin]:
    """The problem, built once per worker."""
    blueprint, origin = cloudpickle.loads(content)
    check_versions(origin.problem["versions"])
    return blueprint.problem(), instance("solver", blueprint.task.search.solver), origin


def check_versions(wanted: dict[str, str]) -> None:
    """Check that this process has the same versions of packages as another one."""
    others = [f"{name} {version(name)} instead of {its}" for name, its in wanted.items() if version(name) != its]
    if others:
        raise InputError(f"a Dask worker has {', '.join(others)}; install the same versions there")
