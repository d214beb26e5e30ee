"""The process that expands one xacro file, which `regressors.readers.library` starts.

It has caps on its CPU time and memory and no network, opens nothing but the files that the description may name, writes
none, and starts no other process. Its own expressions replace those of xacro. It reads its order as JSON from standard
input, and writes its answer as JSON to standard output.
"""

from __future__ import annotations

import ctypes
import encodings
import html
import io
import json
import os
import re
import sys
from collections.abc import Iterator
from contextlib import redirect_stderr, suppress
from pathlib import Path
from typing import Any
from xml.dom import minidom
from xml.parsers import expat

import xacro
import xacro.substitution_args

from regressors import input_files
from regressors.errors import InputError
from regressors.readers.xacro_expressions import LARGEST, Refused, evaluate, known_names

CALLS, DEPTH = 20_000, 400  # of macros, and of macros or files within each other
SEARCHED = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")  # variables of the environment that say where packages are
_PACKAGE = re.compile(r"[A-Za-z][\w-]*")
_EXPRESSION = re.compile(r"\$\{[^}]*\}|\$\([^)]*\)")
_ENCODINGS = os.path.dirname(encodings.__file__) + os.sep
_HARMLESS = {"compile", "os.listdir", "os.scandir", "glob.glob", "glob.glob/2", "marshal.loads", "builtins.id"}
_RECURSION = 20_000  # calls of Python within each other, more than macros may need
_NEW_USER, _NEW_NETWORK = 0x10000000, 0x40000000  # CLONE_NEWUSER, CLONE_NEWNET of Linux


class _Files:
    """The files that a description may open: around it, and of the packages that it names."""

    def __init__(self, path: Path) -> None:
        self.path = path
        folder = path.resolve().parent
        own = next((each for each in (folder, *folder.parents) if (each / "package.xml").is_file()), folder)
        self.roots = {folder, path.parent.absolute(), own}
        self.trusted: set[Path] = set()  # folders that the user named: their links are followed
        self.texts: dict[str, str] = {}
        self.permitted: set[Any] = set()  # names that are being opened

    def read(self, name: str, most: int) -> bytes:
        """Content of a file that may be opened."""
        path = Path(os.path.abspath(name))
        inside = any(path.resolve().is_relative_to(root) for root in self.roots | self.trusted)
        if not inside and not any(path.is_relative_to(root) for root in self.trusted):
            raise Refused(
                f"{path} is outside the folder of {self.path.name} and outside the packages that it names, and is not "
                "opened"
            )
        self.permitted.add(str(path))
        try:
            return input_files.read_bytes(path, most)
        except OSError as error:
            error.filename = str(path)  # which xacro expects
            raise
        finally:
            self.permitted.discard(str(path))

    def open(self, name: str, *_: Any) -> io.BytesIO:
        """A file as `open` gives it."""
        return io.BytesIO(self.read(name, input_files.DOCUMENT))

    def document(self, name: str) -> minidom.Document:
        """A file of XML."""
        content = self.read(name, input_files.FILE)
        self.texts[name] = content.decode("utf-8", "replace")
        parser = expat.ParserCreate()

        def refuse(*_: Any) -> None:
            raise Refused(
                f"{Path(name).name}, line {parser.CurrentLineNumber}: a DOCTYPE or ENTITY declaration is refused; "
                "remove the declaration"
            )

        parser.StartDoctypeDeclHandler = refuse
        with suppress(expat.ExpatError):  # said by the other parser
            parser.Parse(content, True)
        return minidom.parseString(content)

    def package(self, name: str) -> str:
        """Folder of a package, from which files may be opened from now on."""
        if not _PACKAGE.fullmatch(name):
            raise Refused(f"$(find {name}): expected the name of a package")
        folder = find_package(name, self.path)
        if any(folder.is_relative_to(root.resolve()) for root in package_roots()):
            self.trusted.add(folder)
        elif (folder / "package.xml").is_file() or self.path.resolve().is_relative_to(folder):
            self.roots.add(folder)
        else:
            raise Refused(f"$(find {name}): {folder} has no package.xml, and is no package")
        return str(folder)

    def place(self, raw: str) -> str:
        """File and line of an expression; just a file's name where it was put together."""
        wanted = " ".join(raw.split())
        for name, text in self.texts.items():
            for match in _EXPRESSION.finditer(text):
                if " ".join(html.unescape(match.group()).split()) == wanted:
                    return f"{Path(name).name}, line {text.count(chr(10), 0, match.start()) + 1}"
        return self.path.name


def find_package(name: str, near: Path) -> Path:
    """Folder of a package.

    Looked through are, in this order, the roots of ``ROS_PACKAGE_PATH``, ``share`` of the prefixes of
    ``AMENT_PREFIX_PATH``, and the folders that a file is in, the innermost first. A root is the package itself, holds
    it, or holds the repository that holds it.
    """
    for folder in _places(name, near):
        if folder.is_dir():
            return folder.resolve()
    raise InputError(
        f"{near.name}: no folder of the package {name!r}, neither around the file nor in ROS_PACKAGE_PATH; set it to "
        "the folder that holds the package: export ROS_PACKAGE_PATH=FOLDER"
    )


def _places(name: str, near: Path) -> Iterator[Path]:
    for root in package_roots():
        if root.resolve().name == name:
            yield root
        yield root / name
        if root.is_dir():
            yield from (folder / name for folder in sorted(root.iterdir()))
    for folder in near.resolve().parents:
        if folder.name == name:
            yield folder
        yield folder / name


def package_roots() -> list[Path]:
    """Folders to look for packages in that the user named in the environment of ROS."""
    roots, prefixes = ([Path(x) for x in os.environ.get(name, "").split(os.pathsep) if x] for name in SEARCHED)
    return [*roots, *(prefix / "share" for prefix in prefixes)]


class _Expansion:
    """xacro, with its expressions, files and environment replaced."""

    def __init__(self, files: _Files) -> None:
        self.files, self.calls = files, 0
        self.environment = set(os.environ)
        of_args = xacro.substitution_args
        own = {"load_yaml": xacro.load_yaml, "abs_filename": xacro.abs_filename_spec}
        own |= {"dotify": xacro.YamlDictWrapper, "tokenize": xacro.tokenize}
        own |= dict.fromkeys(("message", "warning", "error", "print_location"), lambda *_, **__: "")
        own |= {"fatal": self._fatal, "arg": self._argument}
        self._replace(xacro, "_global_symbols", known_names(own))
        self._replace(xacro, "safe_eval", evaluate)
        self._replace(xacro, "eval_text", self._text)
        self._replace(xacro, "parse", self._parse)
        self._expand, self._included = xacro.handle_macro_call, xacro.process_include
        self._replace(xacro, "handle_macro_call", self._macro)
        self._replace(xacro, "process_include", self._include)
        xacro.open = files.open
        self._replace(of_args, "_eval_find", files.package)
        self._replace(of_args, "_eval_env", self._variable)
        self._replace(of_args, "_eval_optenv", self._variable)
        self._replace(of_args, "_eval", self._eval)

    @staticmethod
    def _replace(module: Any, name: str, value: Any) -> None:
        if not hasattr(module, name):  # it would be looked up nowhere
            raise Refused("this version of xacro is not known; pip install 'xacro>=2.1,<3'")
        setattr(module, name, value)

    @property
    def _arguments(self) -> dict[str, str]:
        return xacro.substitution_args_context["arg"]  # type: ignore[no-any-return]

    def _argument(self, name: str) -> str:
        try:
            return self._arguments[name]
        except KeyError:
            raise xacro.substitution_args.ArgException(name) from None

    @staticmethod
    def _fatal(*words: Any) -> None:
        raise ValueError(" ".join(map(str, words)))

    def _variable(self, name: str, default: str | None = None) -> str:
        if default is not None and name not in self.environment:
            return default
        raise Refused(f"$(env {name}): the environment is not visible to a description; write its value into the file")

    def _eval(self, text: str, context: dict[str, Any]) -> str:
        """Value of ``$(eval ...)``, which sees the arguments by their names."""
        convert = xacro.substitution_args.convert_value

        def optional(name: str, default: str = "") -> str:
            return self._variable(name, default)

        own = {"arg": lambda name: convert(self._argument(name), "auto"), "find": self.files.package}
        own |= {"env": self._variable, "optenv": optional}
        values = {name: convert(str(value), "auto") for name, value in self._arguments.items()}
        known = known_names(own)
        return str(evaluate(text, values | known | known["xacro"] | {"true": True, "false": False}))

    def _parse(self, _: None, name: str) -> minidom.Document:
        try:
            return self.files.document(name)
        except OSError as error:
            if len(xacro.filestack) == 1:
                raise
            xacro.filestack.pop()
            raise xacro.XacroException(f"{error.strerror}: {error.filename}", exc=error) from error

    def _macro(self, node: Any, *others: Any) -> Any:
        """A macro where there is one, up to a number of them and a depth."""
        if node.tagName.startswith("xacro:"):
            self.calls += 1
            self._check_depth(len(xacro.macrostack), f"<{node.tagName}>")
            if self.calls > CALLS:
                raise Refused(f"{self._file}: expanding <{node.tagName}> goes beyond {CALLS} calls of macros")
        return self._expand(node, *others)

    def _include(self, node: Any, *others: Any) -> None:
        self._check_depth(len(xacro.filestack), node.getAttribute("filename"))
        self._included(node, *others)

    def _check_depth(self, depth: int, what: str) -> None:
        if depth > DEPTH:
            raise Refused(f"{self._file}: {what} is more than {DEPTH} deep within each other, and contains itself")

    @property
    def _file(self) -> str:
        return Path(xacro.filestack[-1]).name

    def _text(self, text: str, symbols: Any) -> Any:
        """Value of a text: that of an expression alone, otherwise all its parts as one text."""
        lexer = xacro.QuickLexer(xacro.LEXER)
        lexer.lex(text)
        results: list[Any] = []
        while lexer.peek():
            kind, part = lexer.next()
            if kind in (lexer.EXPR, lexer.EXTENSION):
                results.append(self._part(part, symbols, kind == lexer.EXPR))
            else:
                results.append(part[1:] if kind == lexer.DOLLAR_DOLLAR_BRACE else part)
        if len(results) == 1:
            return results[0]
        parts = list(map(str, results))
        if sum(map(len, parts)) > LARGEST:
            raise Refused(f"{self.files.place(text)}: a text grows beyond {LARGEST} characters")
        return "".join(parts)

    def _part(self, raw: str, symbols: Any, expression: bool) -> Any:
        try:
            text = self._text(raw[2:-1], symbols)
            if expression:
                return evaluate(str(text), symbols)
            return xacro.eval_extension(f"$({text})")
        except _Placed:
            raise
        except Refused as error:
            raise _Placed(f"{self.files.place(raw)}: {error}") from error
        except MemoryError as error:
            raise _Placed(f"{self.files.place(raw)}: {raw[:60]!r} takes more memory than it may") from error
        except xacro.XacroException as error:
            inner = error.exc
            if isinstance(inner, Refused):
                raise _Placed(f"{self.files.place(raw)}: {inner}") from error
            if expression or inner is None or "Undefined" in str(error):
                raise
            raise xacro.XacroException(exc=inner, suffix=self._suffix(raw)) from error
        except RecursionError:
            raise
        except Exception as error:  # an expression raises what it likes
            raise xacro.XacroException(exc=error, suffix=self._suffix(raw)) from error

    def _suffix(self, raw: str) -> str:
        return f"when evaluating expression {raw[:200]!r} ({self.files.place(raw)})"


class _Placed(Refused):
    """What was refused, with its file and line."""


def _expanded(order: dict[str, Any]) -> dict[str, str]:
    """Answer to an order: the expanded text, or the sentence that says why there is none."""
    path = Path(os.path.abspath(order["path"]))
    files = _Files(path)
    memory = f"expanding it takes more than {input_files.in_bytes(order['memory'])}, the most that it may"
    try:
        _Expansion(files)
        _close(files)
        with redirect_stderr(io.StringIO()):
            document = xacro.process_file(str(path), mappings=order["arguments"], verbosity=0)
        text = document.toprettyxml(indent="  ")
        if len(text) <= input_files.FILE:
            return {"text": text}
        reason = memory
    except MemoryError:
        reason = memory
    except RecursionError:
        reason = "its elements, macros or expressions are too deep within each other"
    except Exception as error:
        reason = _reason(error, path, order["path"])
    own = reason.startswith((path.name, "cannot read"))
    return {"error": reason if own else f"{path.name}: {reason}"}


def _reason(error: Exception, path: Path, given: str) -> str:
    """What xacro, or an expression, raised, in words."""
    inner: Any = error
    while inner is not None:
        if isinstance(inner, Refused | InputError):
            return str(inner)
        inner = getattr(inner, "exc", None)
    reason = " ".join(str(error).split()) or type(error).__name__
    if "Undefined substitution argument" in reason:
        name = reason.split("Undefined substitution argument")[1].split()[0]
        return (
            f"the argument {name} has no value; expand the file with one, and give the URDF: "
            f"xacro {path.name} {name}:=VALUE > {path.name.split('.')[0]}.urdf"
        )
    if isinstance(error, OSError):
        return f"cannot read {given!r}: {error.strerror or reason}"
    return f"xacro does not expand it: {reason}"


def _cap(seconds: int, memory: int) -> None:
    """Limit what this process may use, where the system lets it be limited."""
    try:
        import resource
    except ImportError:  # Windows
        return
    limits = {"RLIMIT_CPU": seconds, "RLIMIT_AS": memory, "RLIMIT_FSIZE": 0, "RLIMIT_CORE": 0}
    for name, most in limits.items():
        with suppress(AttributeError, OSError, ValueError):  # macOS has no limit of addresses
            resource.setrlimit(getattr(resource, name), (most, most))


def _leave_network() -> None:
    """Move to a network of its own, without any device, where the system lets it."""
    if not sys.platform.startswith("linux"):
        return
    with suppress(OSError, AttributeError):
        unshare = ctypes.CDLL(None).unshare
        if unshare(_NEW_NETWORK) != 0:
            unshare(_NEW_USER | _NEW_NETWORK)


def _close(files: _Files) -> None:
    """From here on: no sockets, no processes, no code but what is loaded, and no files but permitted ones."""
    minidom.parseString("<a/>").toprettyxml()  # which imports more
    for name in set(os.environ) - set(SEARCHED):
        del os.environ[name]

    def refuse(event: str, given: tuple[Any, ...]) -> None:
        if event in _HARMLESS:
            return
        if event == "open":
            name, _, flags = given
            writes = bool((flags or 0) & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND))
            if not writes and (isinstance(name, int) or str(name) in files.permitted or _of_encodings(name)):
                return
        if event == "import" and str(given[0]).startswith("encodings."):
            return
        if event == "exec" and _of_encodings(getattr(given[0], "co_filename", "")):
            return
        what = f"{event} {str(given[0])[:80]!r}" if given else event
        raise Refused(f"{files.path.name}: {what} is not allowed while a description is expanded")

    sys.addaudithook(refuse)


def _of_encodings(name: Any) -> bool:
    return os.path.abspath(str(name)).startswith(_ENCODINGS)


def main() -> None:
    """Expand the file that the order names."""
    order = json.loads(sys.stdin.buffer.read())
    _cap(order["seconds"], order["memory"])
    _leave_network()
    input_files.SILENCE = order["silence"]
    sys.setrecursionlimit(_RECURSION)
    sys.stdout.write(json.dumps(_expanded(order)))
    sys.stdout.flush()
    os._exit(0)  # what Python does at its end is not allowed any more


if __name__ == "__main__":
    main()
