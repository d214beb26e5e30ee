"""The executor of units that a name stands for."""

from __future__ import annotations

from excite.design.executors.dask_cluster import DaskCluster
from excite.design.executors.unit_executor import InProcesses, InThisProcess, UnitExecutor
from excite.registry import ADDRESS_FORMS, is_addressed
from regressors.errors import UnknownName
from regressors.quantities import check


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
