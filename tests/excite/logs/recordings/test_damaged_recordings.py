"""Damaged, encrypted and hostile recordings: one line, or what is whole of them; never a crash."""

from __future__ import annotations

import io
import json
import re
import sqlite3
import struct
import sys
import zipfile
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
import pytest
import scipy.io
from array_files import Matlab73, motion, read_all, write_hdf5, write_lerobot, write_parquet
from hypothesis import given, settings as examples, strategies as st
from refused import refusal
from ros_bags import (
    arm_messages,
    header,
    joint_state,
    slow_columns,
    typestore,
    write_bag,
    write_by_mcap,
    write_old_database,
    write_ros1_bag,
)

from excite.logs.recordings.formats import format_of
from regressors.errors import LONGEST_LINE, InputError

for package in ("rosbags", "h5py", "pyarrow", "mcap_ros2"):
    pytest.importorskip(package, reason=f"{package} is not installed")

TOPIC = "/joint_states"


def states(types: Any = None) -> list[tuple[str, Any, int]]:
    types = types or typestore()
    return [(TOPIC, joint_state(types, message), message.time) for message in arm_messages(30)]


def ros1_states() -> list[tuple[str, Any, int]]:
    from rosbags.typesys import Stores, get_typestore

    return states(get_typestore(Stores.ROS1_NOETIC))


@cache
def whole_files() -> dict[str, bytes]:
    """A file of each format, complete."""
    folder = Path(mkdtemp())
    by_mcap = [(TOPIC, message) for message in arm_messages(30)]
    np.savez(folder / "npz", **motion())
    np.savez_compressed(folder / "npz-compressed", **motion())
    np.save(folder / "npy", motion()["q"])
    scipy.io.savemat(folder / "mat", {"robot": motion(), "cell": np.array([motion()["q"], "x"], dtype=object)})
    scipy.io.savemat(folder / "mat-compressed", {"robot": motion()}, do_compression=True)
    with Matlab73(folder / "mat-7.3") as file:
        file.put("robot", motion())
        file.put("arms", ({"q": motion()["q"]}, {"q": motion()["dq"]}))
    write_by_mcap(folder / "mcap", by_mcap, "none")
    write_by_mcap(folder / "mcap-zstd", by_mcap, "zstd", chunk=1000)
    write_by_mcap(folder / "mcap-lz4", by_mcap, "lz4", chunk=1000)
    write_ros1_bag(folder / "bag", ros1_states(), "lz4")
    write_old_database(folder / "db3", states(), typestore())
    write_hdf5(folder / "hdf5", motion())
    (folder / "json").write_text(json.dumps({name: values.tolist() for name, values in motion().items()}))
    write_parquet(folder / "parquet", motion(), compression="zstd")
    return {re.sub(r"\.(npz|npy|mat)$", "", path.name): path.read_bytes() for path in folder.iterdir()}


def read_or_refuse(raw: bytes, folder: Path) -> None:
    path = folder / "damaged"
    path.write_bytes(raw)
    refused = ""
    try:
        _, recording = read_all(path)
    except InputError as error:
        refused = str(error)
    else:
        for stream in recording.streams.values():
            assert len({values.size for values in stream.columns.values()}) == 1
    assert "\n" not in refused
    assert len(refused) <= LONGEST_LINE


FORMATS = (
    "mcap", "mcap-zstd", "mcap-lz4", "db3", "bag", "npz", "npz-compressed", "npy", "hdf5", "mat", "mat-compressed",
    "mat-7.3", "parquet", "json",
)  # fmt: skip


MAT = ("mat", "mat-compressed")  # which SciPy reads in a process of its own
DAMAGE = {"cut": st.floats(0, 1), "changes": st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), max_size=12)}


def damaged(form: str, cut: float, changes: list[tuple[float, int]]) -> bytes:
    raw = bytearray(whole_files()[form])
    if cut < 0.5:
        raw = raw[: int(2 * cut * len(raw))]
    for place, value in changes:
        if raw:
            raw[int(place * (len(raw) - 1))] = value
    return bytes(raw)


@pytest.mark.parametrize("form", [form for form in FORMATS if form not in MAT])
@given(**DAMAGE)
@examples(max_examples=15)
def test_any_damage(form: str, cut: float, changes: list[tuple[float, int]], tmp_path_factory: Any) -> None:
    read_or_refuse(damaged(form, cut, changes), tmp_path_factory.mktemp("damaged"))


@pytest.mark.parametrize("form", MAT)
@given(**DAMAGE)
@examples(max_examples=4)
def test_any_damage_of_mat_files(
    form: str, cut: float, changes: list[tuple[float, int]], tmp_path_factory: Any
) -> None:
    read_or_refuse(damaged(form, cut, changes), tmp_path_factory.mktemp("damaged"))


@pytest.mark.parametrize("compression", ["none", "zstd", "lz4"])
def test_half_written_mcap_gives_the_messages_that_are_whole(tmp_path: Path, compression: str) -> None:
    messages = arm_messages(200)
    path = write_by_mcap(tmp_path / "log", [(TOPIC, message) for message in messages], compression, chunk=2000)
    whole, effort = path.read_bytes(), f"{TOPIC}/b/effort"
    counts = []
    for share in (0.5, 0.7, 0.8):
        path.write_bytes(whole[: int(share * len(whole))])
        contents, recording = read_all(path)
        count = sum(stream.rows for stream in recording.streams.values())
        assert contents.notes == recording.notes
        assert contents.notes == (f"the file was not closed; the {count} messages that are whole were read",)
        expected = slow_columns(messages[:count], "abc", TOPIC)
        np.testing.assert_array_equal(recording.streams[TOPIC].columns[effort], expected[effort])
        counts.append(count)
    assert 20 < counts[0] < counts[1] < counts[2] <= len(messages)


def test_half_written_bags_of_ros_1_and_databases(tmp_path: Path) -> None:
    path = write_ros1_bag(tmp_path / "log", ros1_states(), "")
    whole = path.read_bytes()
    path.write_bytes(whole[: whole.index(b"op=\x04") + 10])  # without its index
    contents, recording = read_all(path)
    assert sum(stream.rows for stream in recording.streams.values()) == len(ros1_states())
    assert any("ends early" in note for note in contents.notes)


def test_a_folder_without_its_metadata(tmp_path: Path) -> None:
    for storage in ("mcap", "db3"):
        bag = write_bag(tmp_path / storage, states(), storage)
        (bag / "metadata.yaml").unlink()
        contents, recording = read_all(bag)
        assert set(recording.streams) == {TOPIC, f"{TOPIC}#2"}
        assert contents.notes == (f"{bag} has no metadata.yaml; its files were read in order of names",)


def encrypted_npz() -> bytes:
    raw = bytearray(whole_files()["npz"])
    for magic, place in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        for found in re.finditer(re.escape(magic), bytes(raw)):
            raw[found.start() + place] |= 1
    return bytes(raw)


def database(script: str) -> Callable[[], bytes]:
    def build() -> bytes:
        path = Path(mkdtemp()) / "base"
        base = sqlite3.connect(path)
        base.executescript(script)
        base.commit()
        base.close()
        return path.read_bytes()

    return build


def mcap_of(size: int, compression: bytes, packed: bytes) -> bytes:
    """MCAP of one chunk, which says to how many bytes it unpacks, and how it is compressed."""
    lengths = struct.pack("<QQQII", 0, 1, size, 0, len(compression)) + compression + struct.pack("<Q", len(packed))
    return b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, len(lengths) + len(packed)) + lengths + packed


def lying_chunk() -> bytes:
    import lz4.frame

    return mcap_of(10, b"lz4", lz4.frame.compress(bytes(10**7)))


def huge_npz() -> bytes:
    head, packed = b"\x93NUMPY\x01\x00" + struct.pack("<H", 118), io.BytesIO()
    text = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("q.npy", head + text.ljust(117) + b"\n")
    return packed.getvalue()


def huge_mat() -> bytes:
    """A compressed variable of 10^7 zeros."""
    packed = zlib.compress(bytes(10**7))
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    return head + struct.pack("<II", 15, len(packed)) + packed


def bag_of(topic: str) -> bytes:
    """A bag of a text, or of an image."""
    types, message = typestore(), typestore().types["std_msgs/msg/String"]("hello")
    if topic == "/camera":
        image = types.types["sensor_msgs/msg/Image"]
        message = image(header(types, 0), 300, 300, "mono8", 0, 300, np.zeros(90000, np.uint8))
    return (write_bag(Path(mkdtemp()) / "bag", [(topic, message, 1)]) / "bag.mcap").read_bytes()


def bad_checksum() -> bytes:
    raw, number = bytearray(whole_files()["mcap"]), next(m.position[0] for m in arm_messages(30) if m.position)
    raw[raw.index(struct.pack("<d", number))] ^= 1
    return bytes(raw)


ZSTD = b"\x04\0\0\0zstd"
AES = b"\x04\0\0\0aes!"
BAD: tuple[tuple[str, Callable[[], bytes], str], ...] = (
    ("unknown compression", lambda: whole_files()["mcap-zstd"].replace(ZSTD, AES), r"as 'aes!'; only zstd and lz4"),
    ("encrypted NPZ", encrypted_npz, r"is encrypted: \w+\.npy; save it without a password"),
    ("encrypted Parquet", lambda: b"PARE" + bytes(40) + b"PARE", r"is encrypted; save it without encryption"),
    ("cut Parquet", lambda: whole_files()["parquet"][:900], r"cannot be read as Parquet; it is damaged or"),
    ("cut NPZ", lambda: whole_files()["npz"][:900], r"cannot be read as NPZ; it is damaged or was not written to"),
    (
        "MAT-file that ends the process of SciPy's reader",  # numbers of a kind that is not there
        lambda: whole_files()["mat"].replace(b"\t\0\0\0", b"\x4c\0\0\0", 1),
        r"cannot be read as MAT-file; it is damaged or",
    ),
    ("cut MAT-file", lambda: whole_files()["mat"][:900], r"ends early: its variable at byte 128 is cut off"),
    ("cut MAT-file of 7.3", lambda: whole_files()["mat-7.3"][:900], r"cannot be read as MAT-file of MATLAB 7.3; "),
    ("another database", database("CREATE TABLE songs(id)"), r"without the table 'topics' is no bag of rosbag2"),
    (
        "a database that computes",
        database("CREATE TABLE topics(id, name, type, serialization_format); CREATE VIEW messages AS SELECT 1"),
        r"'messages' is no plain table; this is no bag of rosbag2",
    ),
    ("a bag of texts", lambda: bag_of("/hello"), r"no topic .* numbers; /hello: .*\(std_msgs/msg/String\)"),
    ("a bag of images", lambda: bag_of("/camera"), r"/camera: .* of 90\d+ bytes, more than measurements of joints"),
    ("damaged chunk", bad_checksum, r"the checksum of the chunk at byte \d+ does not match; recover what is left"),
    ("chunk of 1e15 bytes", lambda: mcap_of(10**15, b"zstd", b"abcd"), r"reading .* would take"),
    ("chunk that unpacks to more than it says", lying_chunk, r"the chunk at byte 8 is damaged; recover what is left"),
    ("NPZ of 1e12 numbers", huge_npz, r"reading .* would take"),
)  # fmt: skip


@pytest.mark.parametrize(("build", "message"), [row[1:] for row in BAD], ids=[row[0] for row in BAD])
def test_one_line(tmp_path: Path, build: Callable[[], bytes], message: str) -> None:
    path = tmp_path / "bad"
    path.write_bytes(build())
    assert re.search(message, refusal(read_all, path))


def test_a_variable_that_unpacks_to_more_than_may_be_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "0.005")
    (tmp_path / "bad.mat").write_bytes(huge_mat())
    assert re.search(r"reading .* would take", refusal(read_all, tmp_path / "bad.mat"))


METADATA = (
    ("{}", r"is not the metadata of a bag; `ros2 bag reindex` writes it again"),
    ("rosbag2_bagfile_information: [1]", r"is not the metadata of a bag"),
    ("a: [", r"is not the metadata of a bag"),
    ("rosbag2_bagfile_information: {relative_file_paths: [gone.mcap]}", r"files of the bag are missing: gone\.mcap"),
    (
        "rosbag2_bagfile_information: {compression_mode: FILE, compression_format: aes}",
        r"its files are compressed or encrypted as 'aes'; only zstd is read",
    ),
)


def test_metadata(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", states())
    for text, message in METADATA:
        (bag / "metadata.yaml").write_text(text)
        assert re.search(message, refusal(read_all, bag))


ROS = "needs rosbags: pip install 'excite-trajectories[ros]'"
PARQUET = "needs pyarrow: pip install 'excite-trajectories[parquet]'"
MISSING = (
    ("mcap", "rosbags.typesys", ROS),
    ("mcap-lz4", "lz4.frame", ROS),
    ("parquet", "pyarrow.parquet", PARQUET),
    ("hdf5", "h5py", "needs h5py: pip install 'excite-trajectories[hdf5]'"),
    ("mat-7.3", "h5py", "needs h5py: pip install 'excite-trajectories[matlab]'"),
)


@pytest.mark.parametrize(("form", "module", "message"), MISSING)
def test_a_package_that_is_missing_is_named(tmp_path, monkeypatch, form, module, message) -> None:
    (tmp_path / "log").write_bytes(whole_files()[form])
    monkeypatch.setitem(sys.modules, module, None)
    assert refusal(read_all, tmp_path / "log").endswith(message)


def test_streams_and_columns_that_are_not_there_are_answered_with_those_that_are(tmp_path: Path) -> None:
    for form in FORMATS:
        (tmp_path / "log").write_bytes(whole_files()[form])
        one = format_of(tmp_path / "log")
        known = one.contents(tmp_path / "log").streams[0].name
        with pytest.raises(InputError, match=f"; it has .*{known.split('#')[0]}"):
            one.read(tmp_path / "log", {"elsewhere": ["x"]})


def test_few_bytes_that_stand_for_many_values_are_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_parquet(tmp_path / "log", {"t": np.arange(2.0), "q.state": [[1.0, 2.0], [0.0] * 10**6]})
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "0.005")
    form = format_of(tmp_path / "log")
    contents = form.contents(tmp_path / "log")
    assert contents.columns == ("t",)
    assert contents.notes == ("columns left out: q.state (1e+06 values)",)


def test_a_data_set_without_tables(tmp_path: Path) -> None:
    folder = write_lerobot(tmp_path / "set")
    for file in folder.glob("data/**/*.parquet"):
        file.unlink()
    assert "expected 1 to 10000 files data/**/*.parquet of a LeRobot data set" in refusal(read_all, folder)
    (folder / "meta" / "info.json").write_text("{")
    assert "info.json is not the JSON of a LeRobot data set" in refusal(read_all, folder)
