"""What an MJCF would take, predicted from its text and the heads of its files before MuJoCo allocates any of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from regressors.errors import InputError, TooLargeError
from regressors.input_files import FILE, in_bytes, opened, read_bytes, regular_size
from regressors.memory_cap import check_memory

ELEMENTS = 10_000  # of a model, with all that is replicated: the time of MuJoCo grows with their square
_TEXTURE, _CELL, _MESH = 2.0, 16.0, 30.0  # bytes for each byte, of each cell, for each byte of the file; measured
_TEXT = 4 * FILE  # bytes of all files of XML together
_CUBE = ("cube", "skybox")
_PNG = b"\x89PNG\r\n\x1a\n"
_GRIDS = ("composite", "flexcomp")  # whose count makes many elements of one
_FOLDERS = {"texture": "texturedir", "mesh": "meshdir", "skin": "meshdir", "hfield": "assetdir", "flexcomp": "meshdir"}
_FACES = ("fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")


@dataclass
class _Scan:
    """What was found in the files of a model."""

    main: Path
    elements: float = 0.0
    read: int = 0  # bytes
    models: dict[str, float] = field(default_factory=dict)  # elements of those that may be attached
    folders: dict[str, str] = field(default_factory=dict)
    assets: list[tuple[str, dict[str, str], Path]] = field(default_factory=list)
    within: list[Path] = field(default_factory=list)  # files that are being read


def check_mjcf_size(path: Path) -> None:
    """Refuse a model that is too large, or that names what is no file."""
    scan = _Scan(path)
    try:
        _scan_file(scan, path, 1.0)
        sizes = [_asset(scan, *asset) for asset in scan.assets]
    except OSError as error:
        raise InputError(f"cannot read {error.filename or str(path)!r}: {error.strerror}") from error
    if sizes:
        _, what = max(sizes)
        check_memory(path.name, sum(size for size, _ in sizes), what, "give a smaller one, or remove it from the file")


def _scan_file(scan: _Scan, path: Path, times: float) -> None:
    """Go through a file, each of whose elements stands for as many as are replicated of it."""
    if path in scan.within:
        raise InputError(f"{scan.main.name}: {path.name} includes itself")
    try:
        content = read_bytes(path)
    except OSError as error:
        error.filename = str(path)
        raise
    scan.read += len(content)
    if scan.read > _TEXT:
        raise TooLargeError(f"{scan.main.name}: it and what it includes have more than {in_bytes(_TEXT)} of text")
    scan.within.append(path)
    counts = [times]

    def start(tag: str, given: dict[str, str]) -> None:
        counts.append(counts[-1] * _count(tag, given))
        scan.elements += counts[-1] * (1.0 + (scan.models.get(given.get("model", ""), 0.0) if tag == "attach" else 0.0))
        if tag == "compiler":
            scan.folders.update({name: value for name, value in given.items() if name.endswith("dir")})
        elif tag in ("include", "model") and "file" in given:
            _further(scan, tag, given, path, counts[-1])
        elif tag in _FOLDERS:
            scan.assets.append((tag, given, path))
        if scan.elements > ELEMENTS:
            raise TooLargeError(
                f"{path.name}, line {parser.CurrentLineNumber}: with this <{tag}> the model has {scan.elements:.3g} "
                f"elements, more than the {ELEMENTS} that a robot may have; lower the count of what is replicated, or "
                "remove it from the file"
            )

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: counts.pop()
    with suppress(expat.ExpatError):  # said by MuJoCo
        parser.Parse(content, True)
    scan.within.pop()


def _further(scan: _Scan, tag: str, given: Mapping[str, str], source: Path, times: float) -> None:
    """A part of the model in another file, or another model that is attached to it."""
    places = (scan.main.parent / given["file"], source.parent / given["file"])
    path = next((place for place in places if place.exists()), None)
    before = scan.elements
    if path is not None:
        _scan_file(scan, path, times)
    if tag == "model":
        scan.models[given.get("name", Path(given["file"]).stem)] = scan.elements - before


def _count(tag: str, given: Mapping[str, str]) -> float:
    """How many an element stands for."""
    return math.prod(_numbers(given, "count")) if tag == "replicate" or tag in _GRIDS else 1.0


def _numbers(given: Mapping[str, str], name: str) -> list[float]:
    with suppress(ValueError):
        return [max(1.0, float(word)) for word in given.get(name, "").split()]
    return []


def _asset(scan: _Scan, tag: str, given: Mapping[str, str], source: Path) -> tuple[float, str]:
    """Memory that an asset takes [bytes], and what it is."""
    files = [given[name] for name in ("file", *_FACES) if name in given]
    if files:
        parts = [_of_file(tag, _place(scan, tag, each, source)) for each in files]
        return sum(size for size, _ in parts), max(parts)[1]
    if tag == "texture":
        return _texture(given)
    rows, columns = (_number(given, name) for name in ("nrow", "ncol"))
    return (_CELL * rows * columns, f"a height field of {rows:g} x {columns:g}") if tag == "hfield" else (0.0, "")


def _texture(given: Mapping[str, str]) -> tuple[float, str]:
    wide, high = _number(given, "width"), _number(given, "height")
    cube = given.get("type", "cube") in _CUBE
    size = _TEXTURE * max(3.0, _number(given, "nchannel")) * wide * (6.0 * wide if cube else high)
    return size, f"a texture of {wide:g} x {wide if cube else high:g}"


def _number(given: Mapping[str, str], name: str) -> float:
    return next(iter(_numbers(given, name)), 0.0)


def _place(scan: _Scan, tag: str, name: str, source: Path) -> Path:
    """Where MuJoCo looks for a file."""
    folder = scan.folders.get(_FOLDERS.get(tag, ""), scan.folders.get("assetdir", ""))
    places = [parent / folder / name for parent in (scan.main.parent, source.parent)]
    return next((place for place in places if place.exists()), places[0])


def _of_file(tag: str, path: Path) -> tuple[float, str]:
    """Memory that a file takes [bytes]; nothing where it is missing, as MuJoCo says."""
    try:
        size = regular_size(path)
        with opened(path) as stream:
            head = stream.read(24)
    except FileNotFoundError:
        return 0.0, ""
    except OSError as error:
        error.filename = str(path)
        raise
    if head.startswith(_PNG):
        wide, high = (int.from_bytes(head[k : k + 4], "big") for k in (16, 20))
        each = _CELL if tag == "hfield" else 4.0 * _TEXTURE
        return each * wide * high, f"{path.name}, an image of {wide} x {high}"
    if tag == "hfield":
        rows, columns = (int.from_bytes(head[k : k + 4], "little") for k in (0, 4))
        return _CELL * rows * columns, f"{path.name}, a height field of {rows} x {columns}"
    return _MESH * size, f"{path.name}, a mesh of {size} bytes"
