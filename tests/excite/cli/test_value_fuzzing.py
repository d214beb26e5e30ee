"""Any value of any option of any command: an exit status that is documented, no traceback, no warning, finite files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from value_fuzzer import BASE, command_lines, file_cases, memory, nothing_drawn, prepared, run

GROWTH = 500.0  # of the memory over all cases of a command [MB]
OF_TESTS = settings(  # the first case that fails is short enough
    derandomize=True, database=None, deadline=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
)


@pytest.fixture(scope="module")
def folder() -> Iterator[Path]:
    with prepared() as made:
        yield made


def fuzz(name: str, folder: Path, cases: int) -> None:
    """Run command lines of a command until one does not end as it must."""

    @settings(OF_TESTS, max_examples=cases)
    @given(command_lines(name))
    def ends_as_it_must(arguments: list[str]) -> None:
        assert run(arguments, folder).problems == ()

    before = memory()
    check: Callable[[], None] = ends_as_it_must
    check()
    assert memory() < before + GROWTH


@pytest.mark.slow
@pytest.mark.parametrize("name", BASE)
def test_a_right_command_line_works(name: str, folder: Path) -> None:
    ended = run(BASE[name], folder)
    assert (ended.status in (0, 1), ended.problems) == (True, ()), ended.errors


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in BASE if not name.startswith("payload")])  # these take longer
def test_twenty_values(name: str, folder: Path) -> None:
    with nothing_drawn():
        fuzz(name, folder, 20)


def fuzz_files(folder: Path, cases: int) -> None:
    """Run commands that read files with any numbers until one does not end as it must."""

    @settings(OF_TESTS, max_examples=cases)
    @given(file_cases())
    def ends_as_it_must(case: tuple[list[str], dict[str, str]]) -> None:
        arguments, files = case
        assert run(arguments, folder, files=files).problems == ()

    check: Callable[[], None] = ends_as_it_must
    check()


@pytest.mark.slow
def test_twenty_files(folder: Path) -> None:
    with nothing_drawn():
        fuzz_files(folder, 20)


@pytest.mark.slow
def test_two_hundred_files(folder: Path) -> None:
    fuzz_files(folder, 200)


@pytest.mark.slow
@pytest.mark.parametrize("name", BASE)
def test_two_hundred_values(name: str, folder: Path) -> None:
    fuzz(name, folder, 200)


def test_every_case_begins_with_the_same_files(folder: Path) -> None:
    before = (folder / "two.yaml").read_bytes()
    assert run(("robots", "two.yaml", "--mount", "wall", "--out", "two.yaml", "--force"), folder).status == 0
    assert (folder / "two.yaml").read_bytes() == before


def test_the_fuzzer_sees_what_must_not_be(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import numpy as np

    from excite.tasks.task import Task

    def warns(*_: object, **__: object) -> None:
        with np.errstate(divide="warn"):
            np.ones(1) / np.zeros(1)
        raise KeyError("x")

    monkeypatch.setattr(Task, "__init__", warns)
    problems = run(BASE["robots"], folder).problems
    assert [problem.partition(":")[0] for problem in problems[:2]] == ["KeyError", "warning"]
