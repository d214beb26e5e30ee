"""Addresses of Dask schedulers."""

from __future__ import annotations

from concurrent.futures import CancelledError
from pathlib import Path

import pytest

from excite.cli.option_types import PartName
from excite.design.executors.dask_cluster import ConnectedCluster, DaskAddress, DaskCluster, dask_address
from excite.design.executors.unit_executor import InProcesses, InThisProcess
from excite.design.executors.unit_executors import unit_executor
from excite.errors import LostWorkersError
from excite.registry import EXECUTORS, check_name
from excite.tasks.search import Search
from regressors.errors import InputError, UnknownName

GOOD = {
    "dask://127.0.0.1:8786": DaskAddress(scheduler="tcp://127.0.0.1:8786"),
    "dask://node-1.cluster:1": DaskAddress(scheduler="tcp://node-1.cluster:1"),
    "dask://[::1]:8786": DaskAddress(scheduler="tcp://[::1]:8786"),
    "dask-file:/tmp/a b.json": DaskAddress(file=Path("/tmp/a b.json")),
    "dask-local": DaskAddress(),
    "dask-local:2": DaskAddress(processes=2),
}
BAD = (
    "dask://", "dask://host", "dask://:8786", "dask://host:port", "dask://host:0", "dask://host:65536", "dask:host:1",
    "dask://host:8786/x", "dask://a@host:1", "dask-file:", "dask-file", "dask-local:", "dask-local:0", "dask-local:-1",
    "dask-local:1_0", "dask-local:٣", "dask-local:2000000", "dask-locale", "tcp://host:1",
)  # fmt: skip


@pytest.mark.parametrize("text", GOOD)
def test_addresses_are_read(text: str) -> None:
    assert dask_address(text) == GOOD[text]
    assert Search(executor=text).executor == text
    assert PartName("executor", EXECUTORS).convert(text, None, None) == text
    assert isinstance(unit_executor(text), DaskCluster)


@pytest.mark.parametrize("text", BAD)
def test_other_addresses_are_refused_with_the_three_forms(text: str) -> None:
    with pytest.raises(InputError, match=r"expected dask://HOST:PORT, dask-file:PATH .*, or dask-local:N"):
        dask_address(text)


def test_addresses_are_shown_as_they_are_given() -> None:
    assert [str(dask_address(text)) for text in GOOD] == [
        "dask://127.0.0.1:8786",
        "dask://node-1.cluster:1",
        "dask://[::1]:8786",
        "dask-file:/tmp/a b.json",
        "dask-local",
        "dask-local",
    ]


def test_names_of_executors() -> None:
    assert isinstance(unit_executor("serial"), InThisProcess)
    pool = unit_executor("process", 3)
    assert isinstance(pool, InProcesses)
    assert pool.count == 3
    assert unit_executor(pool) is pool
    for name in ("proces", "mine:Mine", "DASK://a:1"):
        with pytest.raises(UnknownName, match=r"available: .*serial.*dask://HOST:PORT"):
            unit_executor(name)
    with pytest.raises(UnknownName, match="dask-local"):
        check_name("executor", "proces")
    with pytest.raises(InputError):
        unit_executor("process", 0)


def test_a_scheduler_file_that_is_missing_is_named(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(InputError, match=r"no Dask scheduler file .*none\.json"):
        list(DaskCluster(f"dask-file:{tmp_path}/none.json").run(max, 1, [2]))


class Unfetched:
    """A finished unit whose result stays where it is, since the connection breaks while it is fetched."""

    status = "finished"

    def result(self) -> None:
        raise CancelledError


def test_a_scheduler_that_goes_away_before_a_result_is_here() -> None:
    units = object.__new__(ConnectedCluster)
    units._address = dask_address("dask://127.0.0.1:9")
    with pytest.raises(LostWorkersError, match=r"^the Dask scheduler at dask://127\.0\.0\.1:9 went away; what is"):
        units._result(Unfetched())  # type: ignore[arg-type]


def test_without_dask_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'excite-trajectories\[dask\]'"):
        list(DaskCluster("dask://127.0.0.1:1").run(max, 1, [2]))
