"""Files of others: devices, sockets, silent pipes and sizes are refused before they are read."""

import os
import socket
import threading
from pathlib import Path

import pytest
from refused import refusal

from constraints.balance import read_support
from constraints.shapes import MeshError, carried_links, mesh_corners, urdf_meshes, urdf_shape
from constraints.world_file import read_world
from excite.design.design_json import read_precision_target
from excite.design.sweeps.run_sweep import read_sweep_file
from excite.design.task_file import read_task_file
from excite.logs.log_reading import read_log
from excite.logs.mapping import read_mapping
from excite.payload.known_gains import read_gains
from excite.simulation.simulation_files import read_motion
from excite.storage.atomic import read_json
from excite.study.posterior_samples import load_posterior
from excite.tasks.friction_file import read_friction, read_prior
from excite.tasks.payload import read_load
from regressors import input_files
from regressors.errors import InputError
from regressors.input_files import UnreadableFile, in_bytes, read_bytes, read_text, regular_size
from regressors.readers.description import read_description
from regressors.readers.dh_table import read_dh_table
from regressors.readers.library import built_in
from regressors.readers.mjcf import read_mjcf
from regressors.readers.urdf import read_urdf, read_xacro
from regressors.readers.urdf_elements import xml_kind

READERS = {
    "robot": read_description,
    "table": read_dh_table,
    "URDF": read_urdf,
    "xacro": read_xacro,
    "MJCF": read_mjcf,
    "kind": xml_kind,
    "log": read_log,
    "mapping": read_mapping,
    "JSON": read_json,
    "task": read_task_file,
    "friction": read_friction,
    "load": read_load,
    "prior": read_prior,
    "world": lambda path: read_world(path),
    "support": lambda path: read_support(path),
    "motion": lambda path: read_motion(path, ("1",)),
    "campaign": read_sweep_file,
    "gains": read_gains,
    "precision": read_precision_target,
    "capsules": lambda path: urdf_shape(path, carried_links(path, built_in("irp6"))),
    "meshes": lambda path: urdf_meshes(path, built_in("irp6")),
}


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(input_files, "SILENCE", 0.05)


@pytest.mark.parametrize("reader", READERS)
def test_readers_refuse_devices_silent_pipes_and_sizes(reader: str, tmp_path: Path) -> None:
    for device in ("/dev/zero", "/dev/urandom", "/dev/full"):
        assert "it is a device, expected a file" in refusal(READERS[reader], Path(device))
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match=r"nothing came through it for 0\.05 s|it is a pipe, expected a file"):
        READERS[reader](tmp_path / "pipe")
    with (tmp_path / "large").open("wb") as stream:
        stream.truncate(5 * 10**9)  # a sparse file
    with pytest.raises(InputError, match=r"it has 5 GB, more than the (67\.1 MB|16\.8 MB|4 GB) that"):
        READERS[reader](tmp_path / "large")


def test_meshes_too(tmp_path: Path) -> None:
    (tmp_path / "zero.stl").symlink_to("/dev/zero")
    with pytest.raises(MeshError, match="it is a device"):
        mesh_corners(tmp_path / "zero.stl")


def test_posteriors_too(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "posterior.npz")
    assert "nothing came through it" in refusal(load_posterior, tmp_path / "posterior.npz")


def test_files_that_another_library_opens_are_no_pipes(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "file").write_bytes(b"abc")
    assert regular_size(tmp_path / "file") == 3
    for name, message in ((tmp_path / "pipe", "it is a pipe"), ("/dev/zero", "it is a device")):
        with pytest.raises(UnreadableFile, match=message):
            regular_size(name)


def test_sockets_and_folders(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(tmp_path / "socket"))
        with pytest.raises(UnreadableFile, match="it is a socket"):
            read_bytes(tmp_path / "socket")
    with pytest.raises(IsADirectoryError):
        read_bytes(tmp_path)


def test_a_pipe_is_read_to_its_end(tmp_path: Path) -> None:
    pipe, content = tmp_path / "pipe", 300_000 * b"0123456789\r\n"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_bytes, args=(content,))
    writer.start()
    assert read_bytes(pipe) == content
    writer.join()


def test_a_pipe_without_end_is_refused(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)

    def write() -> None:
        with pipe.open("wb", buffering=0) as stream:
            try:
                while True:
                    stream.write(bytes(65536))
            except BrokenPipeError:
                pass

    writer = threading.Thread(target=write)
    writer.start()
    with pytest.raises(UnreadableFile, match=r"larger than 1 MB"):
        read_bytes(pipe, 10**6)
    writer.join()


def test_files_without_a_size_are_bounded_too() -> None:
    assert read_bytes("/proc/self/cmdline", 10**6)
    with pytest.raises(UnreadableFile, match="larger than 4 bytes"):
        read_bytes("/proc/self/cmdline", 4)


def test_line_ends_are_those_of_unix(tmp_path: Path) -> None:
    (tmp_path / "text").write_bytes(b"a\r\nb\rc\n")
    assert read_text(tmp_path / "text") == "a\nb\nc\n"


@pytest.mark.parametrize(("size", "text"), [(5, "5 bytes"), (4e9, "4 GB"), (999.9e6, "1 GB"), (1.25e3, "1.25 kB")])
def test_sizes_in_words(size: float, text: str) -> None:
    assert in_bytes(size) == text
