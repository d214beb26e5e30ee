"""A result that is a file, with others beside it whose names begin alike, in a folder of other things."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from excite.storage.commit import Read, read_settled, settle
from excite.storage.destination import Destination
from excite.storage.sole_writer import Change, replacing, sole_writer


@contextmanager
def result_file(path: Path) -> Iterator[None]:
    """Be the only writer of a file in the block, whose folder is made if it does not exist; see `result_folder`."""
    with sole_writer(Destination(path.parent, path.name)):
        yield


@contextmanager
def replace_files(path: Path, *, remove: Collection[str] = ()) -> Iterator[Path]:
    """Write a file and those beside it in place of older ones, all at once."""

    def change(staged: Path) -> Change:
        return Change(path.name, set(remove) - {each.name for each in staged.iterdir()})

    with replacing(Destination(path.parent, path.name), change) as staged:
        yield staged


def settle_files(path: Path) -> None:
    """Put files in place that an interrupted run has committed, before a file of a result is read."""
    for at in _writers(path):
        settle(at)


def read_settled_files(path: Path, read: Callable[[], Read]) -> Read:
    """Read a file of a result, and those beside it, as one run has left them."""
    for at in _writers(path):
        read = partial(read_settled, at, read)
    return read()


def _writers(path: Path) -> set[Destination]:
    """What is locked by whoever writes a file: itself, or the joint log that a wrench log belongs to."""
    return {Destination(path.parent, name) for name in (path.name, path.name.replace(".wrench.", "."))}
