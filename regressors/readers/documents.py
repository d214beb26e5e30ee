"""YAML documents checked against a schema: every error names the file, the field and its line.

YAML 1.2 without its traps: text, numbers, lists and mappings only. Anchors, tags, directives and duplicate keys are
refused, so that every value is stated exactly once.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args

from pydantic import BaseModel, BeforeValidator, Field, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from regressors.errors import InputError, listed_names, reading, shortened
from regressors.input_files import read_text
from regressors.quantities import fault

FieldPath = tuple[str | int, ...]
Schema = TypeVar("Schema", bound=BaseModel)

_CORE = "tag:yaml.org,2002:"
_TEXT = frozenset({"str", "timestamp", "merge", "value"})  # the last three have no meaning in YAML 1.2's core


def yaml_float(value: float) -> str:
    """The shortest text that YAML 1.1 too reads as this float: with a point before the exponent, as in ``1.0e-05``."""
    return re.sub(r"^(-?\d+)e", r"\1.0e", repr(float(value)))


@dataclass(frozen=True)
class Document:
    """Content of a YAML file, with the line of every field."""

    source: str  # name of the file, for messages
    content: object  # nested dicts, lists, strings, numbers, booleans and None
    lines: Mapping[FieldPath, int]  # path of a field to its line, 1 for the first

    def error(self, problems: Iterable[tuple[FieldPath, str]]) -> InputError:
        """One-line error that lists all problems, each with its field and line, in the order of lines."""
        ordered = sorted((self._line(path), k, path, what) for k, (path, what) in enumerate(problems))
        sentences = (f"{_dotted(path)} (line {line}): {' '.join(what.split())}" for line, _, path, what in ordered)
        return InputError(f"{self.source}: {'; '.join(sentences)}")

    @contextmanager
    def at(self, *place: str | int) -> Iterator[None]:
        """Name a field and its line in errors of a block that uses it."""
        try:
            yield
        except InputError as error:
            raise self.error([(place, str(error))]) from error

    def _line(self, path: FieldPath) -> int:
        known = (self.lines[path[:n]] for n in range(len(path), -1, -1) if path[:n] in self.lines)
        return next(known, 1)


def read_document(path: str | Path, what: str) -> Document:
    """Content of a YAML file; messages name what it is, such as a ``task file``."""
    with reading(f"{what} {path}"):
        text = read_text(path)
    return parse_document(text, str(path))


def parse_document(text: str, source: str) -> Document:
    """Content of a YAML text."""
    if directive := re.search(r"^%.*", text, re.MULTILINE):
        line = text.count("\n", 0, directive.start()) + 1
        raise InputError(f"{source}, line {line}: YAML directives are not supported, given {shortened(directive[0])}")
    try:
        loader = YAML(typ="safe", pure=True)
        root = loader.compose(text)
        nodes = _Nodes(SafeConstructor(loader=loader))
        content = None if root is None else nodes.value(root, ())
    except ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise InputError(f"{source}, line {line}: not valid YAML: character {text[error.position]!r}") from error
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = "" if mark is None else f", line {mark.line + 1}"
        raise InputError(f"{source}{place}: not valid YAML: {error.problem or error.context}") from error
    except YAMLError as error:
        raise InputError(f"{source}: not valid YAML: {' '.join(str(error).split())}") from error
    except RecursionError as error:
        raise InputError(f"{source}: lists and mappings are nested too deeply") from error
    document = Document(source, content, nodes.lines)
    if nodes.problems:
        raise document.error(nodes.problems)
    if not isinstance(content, dict):
        raise InputError(f"{source}: expected a mapping of fields, given {described(content)}")
    return document


def validate(document: Document, schema: type[Schema]) -> Schema:
    """Validate a document and return it as an instance of a schema."""
    try:
        return schema.model_validate(document.content)
    except ValidationError as error:
        problems = error.errors(include_url=False, include_context=False)
    raise document.error((_path(e["loc"]), _sentence(e, schema)) for e in problems)


class _Nodes:
    """Plain values of composed YAML nodes, with their lines and problems."""

    def __init__(self, constructor: SafeConstructor) -> None:
        self.lines: dict[FieldPath, int] = {}
        self.problems: list[tuple[FieldPath, str]] = []
        self._constructor = constructor

    def value(self, node: Node, path: FieldPath) -> object:
        self.lines.setdefault(path, node.start_mark.line + 1)
        if node.anchor is not None:
            return self._refuse(path, "anchors and aliases (&name, *name) are not supported")
        kind = str(node.tag).removeprefix(_CORE)
        if isinstance(node, MappingNode) and kind == "map":
            return self._mapping(node, path)
        if isinstance(node, SequenceNode) and kind == "seq":
            return [self.value(item, (*path, k)) for k, item in enumerate(node.value)]
        if isinstance(node, ScalarNode) and kind in _TEXT:
            return str(node.value)
        if isinstance(node, ScalarNode) and kind in ("null", "int", "float", "bool"):
            return self._scalar(node, kind, path)
        return self._refuse(path, f"YAML tags are not supported, given {shortened(str(node.tag))}")

    def _mapping(self, node: MappingNode, path: FieldPath) -> dict[str, object]:
        content: dict[str, object] = {}
        for key, item in node.value:
            line = key.start_mark.line + 1
            if not isinstance(key, ScalarNode):
                self._refuse(path, f"a field's name must be text (line {line})")
                continue
            field = (*path, str(key.value))
            if key.value in content:
                self._refuse(field, f"is given twice, again in line {line}")
                continue
            self.lines[field] = line
            content[key.value] = self.value(item, field)
        return content

    def _scalar(self, node: ScalarNode, kind: str, path: FieldPath) -> object:
        if kind in ("int", "float") and "_" in node.value:
            return self._refuse(path, f"{shortened(node.value)} is not a number: write it without underscores")
        try:
            value: object = getattr(self._constructor, f"construct_yaml_{kind}")(node)
        except (ValueError, KeyError):
            return self._refuse(path, f"{shortened(node.value)} is not a value of type {kind}")
        return value

    def _refuse(self, path: FieldPath, what: str) -> object:
        self.problems.append((path, what))
        return None


def _path(location: tuple[str | int, ...]) -> FieldPath:
    """Without the steps that name validators and the classes of a union."""
    return tuple(step for step in location if not re.fullmatch(r"\[key\]|function-.*|\w+Entry", str(step)))


def _dotted(path: FieldPath) -> str:
    """Path as text, such as ``joints[2].mdh.alpha``; list items count from 1."""
    text = ""
    for step in path:
        if isinstance(step, int):
            text += f"[{step + 1}]"
        else:
            text += "." * bool(text) + (step if re.fullmatch(r"[\w-]+", step) else shortened(step))
    return text or "the file"


def _sentence(error: Mapping[str, Any], schema: type[BaseModel]) -> str:
    kind, message, given = str(error["type"]), str(error["msg"]), error["input"]
    if kind == "missing":
        return "is missing"
    if kind == "extra_forbidden":
        fields = _fields(schema, error["loc"][:-1])
        near = difflib.get_close_matches(str(error["loc"][-1]), fields, n=2, cutoff=0.7)
        meant = f"did you mean {' or '.join(near)}? " if near else ""
        return f"no such field; {meant}available: {listed_names(fields)}"
    if kind == "value_error":
        return message.removeprefix("Value error, ")
    if kind in ("model_type", "dict_type"):
        message = "should be a mapping of fields"
    # Pydantic writes "Input should be ...", "List should have ...": here the field's name precedes it.
    message = re.sub(r" after validation, not \d+$", "", re.sub(r"^\w+ should ", "should ", message))
    return f"{message}, given {described(given)}"


def _fields(schema: type[BaseModel], location: FieldPath) -> tuple[str, ...]:
    """Names of the fields of the section at a location."""
    for step in location:
        if isinstance(step, str) and step in schema.model_fields:
            schema = _section(schema.model_fields[step].annotation) or schema
    return tuple(field.alias or name for name, field in schema.model_fields.items())


def _section(annotation: object) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_section, get_args(annotation))), None)


def described(value: object) -> str:
    """Short text of a value for messages: scalars as they are, other values by their type."""
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if value is None:
        return "nothing"
    return shortened(value)


def within(quantity: str) -> Callable[[object], object]:
    """Validator of numbers, or lists of these, which leaves them as they are."""

    def validated(value: object) -> object:
        if (wrong := fault(quantity, value)) is not None:
            raise ValueError(wrong)
        return value

    return validated


def _not_text(value: object) -> object:
    if isinstance(value, str):
        raise ValueError(f"must be a number, given the text {value[:40]!r}")
    return value


def _number(quantity: str) -> tuple[object, ...]:
    return BeforeValidator(within(quantity)), BeforeValidator(_not_text)


Length = Annotated[float, *_number("length")]
Angle = Annotated[float, *_number("angle")]
Friction = Annotated[float, *_number("friction_parameter")]
Load = Annotated[float, *_number("load")]
Celsius = Annotated[float, *_number("temperature")]
Exponent = Annotated[float, *_number("exponent")]
Point = Annotated[list[Length], Field(min_length=3, max_length=3)]
Angles = Annotated[list[Angle], Field(min_length=3, max_length=3)]
