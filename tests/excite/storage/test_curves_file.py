"""Files of curves: read back as written, refused where they are damaged or far too large."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from excite.storage.records import chosen, every, read_curves, write_curves
from regressors.errors import InputError

ROWS: dict[str, Any] = {
    "time": np.arange(4.0),
    "log": np.zeros(4, dtype=np.int16),
    "measured": np.ones(4, dtype=np.float32),
    "joints": np.array(["a", "b"]),
    "motion_q": np.zeros((3, 2)),
}


def test_arrays_are_read_as_written(tmp_path: Path) -> None:
    write_curves(tmp_path / "c.npz", ROWS)
    read = read_curves(tmp_path / "c.npz")
    assert set(read) == set(ROWS)
    for name, array in ROWS.items():
        np.testing.assert_array_equal(read[name], array)


def _objects() -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    return stream.getvalue()


def _archive(member: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("time.npy", member)
    return stream.getvalue()


@pytest.mark.parametrize(
    "content", [b"", b"PK\x03\x04", *map(_archive, (b"no array", b"\x93NUMPY\x01\x00", _objects()))]
)
def test_damaged_files_are_named(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "c.npz").write_bytes(content)
    with pytest.raises(InputError, match=r"c\.npz"):
        read_curves(tmp_path / "c.npz")


def test_files_that_unpack_to_far_more_are_refused(tmp_path: Path) -> None:
    (tmp_path / "c.npz").write_bytes(_archive(bytes(70_000_000)))
    with pytest.raises(InputError, match="expected at most"):
        read_curves(tmp_path / "c.npz")


def test_strides_and_choices() -> None:
    assert [every(n, 10) for n in (1, 10, 11, 20, 21)] == [1, 1, 2, 2, 3]
    assert chosen(3, 10).tolist() == [0, 1, 2]
    assert chosen(100, 5)[[0, -1]].tolist() == [0, 99]
