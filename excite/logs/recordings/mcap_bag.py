"""MCAP, as rosbag2 records it by default, with messages of ROS 2 or ROS 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from excite.logs.recordings.mcap_records import MAGIC, McapFile
from excite.logs.recordings.recording import Contents, Recording
from excite.logs.recordings.recording_format import RecordingFormat
from excite.logs.recordings.ros_streams import bag_columns, bag_contents


class McapBag(RecordingFormat):
    """A file in MCAP."""

    name: ClassVar[str] = "MCAP"

    def recognises(self, head: bytes, path: Path) -> bool:
        """See `RecordingFormat.recognises`."""
        return head.startswith(MAGIC[:6])

    def contents(self, path: Path) -> Contents:
        """See `RecordingFormat.contents`."""
        return bag_contents(McapFile(path), self.name)

    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """See `RecordingFormat.read`."""
        return bag_columns(McapFile(path), self.name, wanted)
