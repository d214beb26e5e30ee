"""The border of the API: arguments that are not what their annotations say end in `InputError` that names them.

`checked` reads the annotations of a public function or class when it is first called, and makes one check of each:
numbers, text, arrays, sequences, mappings, objects of a class or with the members of a protocol. A number whose name
has an entry in `regressors.quantities.QUANTITIES` must be inside its bounds where the caller's own check does not say
more. Inside, arguments can be relied on.
"""

from __future__ import annotations

import ast
import inspect
import sys
import types
import typing
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import cache, partial, wraps
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeVar

from regressors.errors import InputError
from regressors.quantities import shown

T = TypeVar("T", bound=Callable[..., Any])
Check = Callable[[Any], Any]
_OWN = ("excite", "constraints", "regressors")
_LONGEST_NAME = 255  # bytes
_SEQUENCES = (list, tuple, Sequence, Collection, Iterable)


class Unfit(TypeError):
    """A value of another type than its annotation says."""


def checked(public: T) -> T:
    """Check the arguments of a function, or of a class's constructor, against their annotations at each call.

    Lists become tuples, and lists of numbers arrays, where that is what the annotation says.
    """
    if isinstance(public, type):
        public.__init__ = _checked(public.__init__)  # type: ignore[misc]
        return public
    return _checked(public)  # type: ignore[return-value]


def _checked(function: Callable[..., Any]) -> Callable[..., Any]:
    signature = inspect.signature(function)

    @wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        try:
            bound = signature.bind(*arguments, **named)
        except TypeError:
            return function(*arguments, **named)  # Python says what is missing or too much
        given = bound.arguments
        for name, check in _checks(function).items():
            if name in given:
                given[name] = fit(name, given[name], check)
        return function(*bound.args, **bound.kwargs)

    return call


def fit(name: str, value: Any, check: tuple[Check, str]) -> Any:
    """A value as its annotation says, or `InputError` that names it."""
    convert, expected = check
    try:
        return convert(value)
    except Unfit as error:
        raise InputError(f"{name}: expected {expected}, given {shown(value)}") from error


@cache
def _checks(function: Callable[..., Any]) -> dict[str, tuple[Check, str]]:
    """Check of each parameter, and what it expects, in words."""
    inner = inspect.unwrap(function)
    parameters = inspect.signature(inner).parameters.values()
    plain = {p.name for p in parameters if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)}
    hints = evaluated(inner)
    return {name: rule_of(hint) for name, hint in hints.items() if name in plain and hint is not Any}


def evaluated(thing: Any) -> dict[str, Any]:
    """Annotations of a function, or of a class and its bases, evaluated: names that are imported for them only too."""
    try:
        for kind in thing.__mro__ if isinstance(thing, type) else (inspect.unwrap(thing),):
            if kind.__module__.partition(".")[0] in _OWN:
                _import_names(kind.__module__)
    except OSError:  # frozen without its source
        return {}
    return typing.get_type_hints(thing)


@cache
def _import_names(module: str) -> None:
    """Import into a module what it imports for annotations only, which type checkers and `evaluated` need."""
    space, source = vars(sys.modules[module]), inspect.getsource(sys.modules[module])
    for node in ast.parse(source).body if "if TYPE_CHECKING" in source else ():
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            exec(compile(ast.Module(node.body, []), str(space["__file__"]), "exec"), space)


def rule_of(hint: Any) -> tuple[Check, str]:
    """What converts a value to a type hint, or raises `Unfit`; and what the hint expects, in words."""
    hint = unaliased(hint)
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        rules = {each: rule_of(each) for each in inner}
        several = list(dict.fromkeys(text for _, text in rules.values()))
        if {str, Path} <= rules.keys():
            del rules[str]  # that of a path takes the name of a file too
        text = f"{', '.join(several[:-1])} or {several[-1]}" if several[1:] else several[0]
        return partial(_any_of, tuple(check for check, _ in rules.values())), text
    if origin is typing.Literal:
        kinds = {type(choice) for choice in inner}  # a text that is none is refused by who looks it up
        return _only(lambda value: type(value) in kinds), " or ".join(map(repr, inner))
    if getattr(origin, "__name__", "") == "ndarray":
        return _array_of(inner[1]), "an array of real numbers"
    if origin is tuple and inner[-1:] != (...,):
        checks, texts = zip(*map(rule_of, inner), strict=True)
        return partial(_tuple, checks), f"({', '.join(texts)})"
    if origin in _SEQUENCES:
        check, one = rule_of(inner[0])
        items = {float: "numbers", int: "whole numbers", str: "names"}.get(inner[0])
        text = f"a list of {items}" if items else f"a list, each {one}"
        if hint in (tuple[float, ...], tuple[int, ...]):
            return partial(_one_or_several, check), f"{one}, or {text}"
        return partial(_several, check, origin), text
    if origin in (dict, Mapping):
        (key, _), (item, one) = map(rule_of, inner)
        return partial(_mapping, key, item), "a mapping" if inner[1] is Any else f"a mapping, each {one}"
    if origin is Callable or hint is Callable:
        return _only(callable), "a function"
    if hint in _PLAIN:
        return _PLAIN[hint]
    name = getattr(hint, "__name__", str(hint))
    text = _OBJECTS.get(name) or f"{'an' if name[:1] in 'AEIOU' else 'a'} {name}"
    if isinstance(hint, typing.TypeVar) or hint in (Any, object):
        return (lambda value: value), text
    return partial(_of_class, type if origin is type else origin or hint), text


def unaliased(hint: Any) -> Any:
    """What a type hint stands for that is an alias by name, as `NDArray` is from NumPy 2.5 on."""
    alias = getattr(typing.get_origin(hint) or hint, "__value__", None)
    return hint if alias is None else unaliased(alias[typing.get_args(hint)] if typing.get_args(hint) else alias)


def _number(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, Real):
        raise Unfit
    if isinstance(value, float) or (isinstance(value, Integral) and abs(int(value)) < 2**63):
        return value
    try:
        return float(value)  # of a fraction, or of a whole number that NumPy has no type for
    except OverflowError as error:
        raise Unfit from error


def _only(holds: Callable[[Any], bool], convert: Callable[[Any], Any] = lambda value: value) -> Check:
    """A check of values of which something holds."""

    def check(value: Any) -> Any:
        if not holds(value):
            raise Unfit
        return convert(value)

    return check


def _file(value: Any) -> Any:
    """A name that a file can have."""
    parts = Path(value).parts if isinstance(value, str | Path) else ("\0",)
    if any("\0" in part or len(part.encode(errors="replace")) > _LONGEST_NAME for part in parts):
        raise Unfit
    return value


def _any_of(checks: tuple[Check, ...], value: Any) -> Any:
    for check in checks:
        try:
            return check(value)
        except Unfit:
            continue
    raise Unfit


def _several(check: Check, kind: Any, value: Any) -> Any:
    if isinstance(value, str | bytes | Mapping) or getattr(value, "ndim", 1) == 0:
        raise Unfit
    if kind is Iterable and isinstance(value, Iterator):
        return value  # what can be read once only
    ordered = isinstance(value, Sequence) or hasattr(value, "__array__")
    if not (isinstance(value, Collection) if kind in (Iterable, Collection) else ordered):
        raise Unfit
    items = [check(item) for item in value]
    return tuple(items) if kind is tuple or hasattr(value, "__array__") else value


def _one_or_several(check: Check, value: Any) -> Any:
    return (check(value),) if isinstance(value, Real) else _several(check, tuple, value)


def _tuple(checks: tuple[Check, ...], value: Any) -> Any:
    items = _several(lambda item: item, tuple, value)
    if len(items) != len(checks):
        raise Unfit
    return tuple(check(item) for check, item in zip(checks, items, strict=True))


def _mapping(key: Check, item: Check, value: Any) -> Any:
    if not isinstance(value, Mapping):
        raise Unfit
    for name, each in value.items():
        key(name), item(each)
    return value


def _array_of(kind: Any) -> Check:
    import numpy as np

    scalar = typing.get_args(kind)[0] if typing.get_args(kind) else np.float64
    if not isinstance(scalar, type):
        return lambda value: value
    kinds = {"f": "fiu", "i": "iu", "u": "iu", "b": "b"}.get(np.dtype(scalar).kind, "")
    return partial(_array, kinds, np.dtype(scalar))


def _array(kinds: str, dtype: Any, value: Any) -> Any:
    import numpy as np

    if isinstance(value, np.ndarray) and value.dtype == dtype:
        return value
    try:
        array = np.asarray(value)
    except ValueError as error:  # of rows of different lengths
        raise Unfit from error
    if array.dtype.kind not in kinds or isinstance(value, bool | Real):
        raise Unfit
    return array.astype(dtype)


def _of_class(kind: Any, value: Any) -> Any:
    if isinstance(value, Mapping) and hasattr(kind, "from_dict"):
        return kind.from_dict(value)
    if not (_has_members(kind, value) if getattr(kind, "_is_protocol", False) else isinstance(value, kind)):
        raise Unfit
    return value


def _has_members(protocol: type, value: Any) -> bool:
    """Whether a value has what a protocol asks for; properties are not evaluated."""
    return all(inspect.getattr_static(value, name, Unfit) is not Unfit for name in _members(protocol))


@cache
def _members(protocol: type) -> frozenset[str]:
    kinds = [kind for kind in protocol.__mro__ if getattr(kind, "_is_protocol", False)]
    names = {name for kind in kinds for name in (*vars(kind), *inspect.get_annotations(kind))}
    return frozenset(name for name in names if not name.startswith("_"))


_PLAIN: dict[Any, tuple[Check, str]] = {
    float: (_number, "a number"),
    int: (_only(lambda value: isinstance(value, Integral) and not isinstance(value, bool), int), "a whole number"),
    bool: (_only(lambda x: isinstance(x, bool) or str(getattr(x, "dtype", "")) == "bool", bool), "True or False"),
    str: (partial(_of_class, str), "text"),
    type(None): (_only(lambda value: value is None), "None"),
    Path: (_file, "a path that a file can have"),
}
_OBJECTS = {"Identification": "a result of `identify`", "Played": "a simulation", "Measured": "a simulation"}
