"""What every kind of ROS bag gives: topics, and their messages as they were serialised."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from regressors.errors import InputError

Bytes: TypeAlias = NDArray[np.uint8]
LARGEST_MESSAGE = 64 * 1024  # bytes; what is larger, such as an image, is no measurement of joints


@dataclass(frozen=True)
class Topic:
    """A topic, as far as the bag describes it."""

    name: str
    kind: str  # type of its messages, with the folder: ``sensor_msgs/msg/JointState``
    form: str = ""  # ``msg`` or ``idl``, of the definition; empty where there is none
    text: str = ""  # definition
    ros1: bool = False  # whether the messages are serialised as in ROS 1, else in CDR
    unread: str = ""  # why its messages cannot be read; empty if they can


@dataclass(frozen=True, eq=False)
class Messages:
    """Messages of one topic that follow each other."""

    topic: Topic
    times: list[int] | NDArray[np.int64]  # (n,) when they were recorded [ns]
    raws: list[bytes] | Bytes  # (n, length) their bytes; an array where they are equally long


class BagFile(ABC):
    """A bag that is read once from its beginning to its end."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.notes: list[str] = []  # known when all messages were read

    @property
    def state(self) -> Hashable:
        """What changes when the files of the bag do."""
        try:
            statuses = [path.stat() for path in self.files]
        except OSError as error:
            raise InputError(f"cannot read {self.path}: {error.strerror}") from error
        return tuple((status.st_size, status.st_mtime_ns, status.st_ino) for status in statuses)

    @property
    def files(self) -> tuple[Path, ...]:
        """All files of the bag."""
        return (self.path,)

    @abstractmethod
    def messages(self, wanted: Callable[[Topic], bool]) -> Iterator[Messages]:
        """Messages, those of each topic in recorded order."""
