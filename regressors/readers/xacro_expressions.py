"""Expressions of xacro, ``${...}`` and ``$(eval ...)``: parsed, checked, and evaluated without `eval`.

Allowed are arithmetic, comparisons, boolean and conditional expressions, literals, lists, subscripts, dotted names of
YAML and of the namespaces, and calls of what is listed here. What a value is cannot lead out of it: no attribute of a
Python object is ever looked up.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

LONGEST = 10_000  # characters of an expression
LARGEST = 10**6  # characters of a text, entries of a list
BITS = 10_000  # of a whole number
_WIDE = re.compile(r"%[^a-zA-Z%]*(\d{4}|\*)")  # a field of a format that makes a long text of a short one

_BINARY: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
}
_UNARY: Mapping[type[ast.unaryop], Callable[[Any], Any]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Not: operator.not_,
}
_COMPARED: Mapping[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Is: operator.is_,
    ast.IsNot: operator.is_not,
    ast.In: lambda a, b: a in b,
    ast.NotIn: lambda a, b: a not in b,
}
_NODES = (
    ast.Expression, ast.Constant, ast.Name, ast.Load, ast.List, ast.Tuple, ast.Dict, ast.BinOp, ast.UnaryOp, ast.BoolOp,
    ast.And, ast.Or, ast.Compare, ast.IfExp, ast.Subscript, ast.Slice, ast.Attribute, ast.Call, ast.keyword,
    *_BINARY, *_UNARY, *_COMPARED,
)  # fmt: skip
_NODE_NAMES = {
    ast.Lambda: "a lambda",
    ast.JoinedStr: "an f-string",
    ast.NamedExpr: "an assignment",
    **dict.fromkeys((ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp), "a comprehension"),
}
_METHODS: Mapping[type, tuple[str, ...]] = {
    str: (
        "lower", "upper", "capitalize", "title", "strip", "lstrip", "rstrip", "split", "replace", "startswith",
        "endswith", "find", "count", "join", "isdigit",
    ),
    dict: ("get", "keys", "values", "items"),
    list: ("index", "count"),
}  # fmt: skip


class Refused(Exception):
    """What an expression may not do, in words."""


class Function:
    """A function that expressions may call: a value that has no attributes for them."""

    def __init__(self, call: Callable[..., Any]) -> None:
        self.call = call


def evaluate(text: str, names: Mapping[str, Any]) -> Any:
    """Value of an expression."""
    text = text.strip()
    if len(text) > LONGEST:
        raise Refused(f"an expression of {len(text)} characters, more than the {LONGEST} that one may have")
    tree = ast.parse(text, mode="eval")
    for node in ast.walk(tree):
        _check(node)
    return _value(tree.body, names)


def _check(node: ast.AST) -> None:
    if not isinstance(node, _NODES):
        what = _NODE_NAMES.get(type(node), f"{type(node).__name__}, which")
        raise Refused(f"{what} is not allowed in an expression")
    if isinstance(node, ast.Name) and node.id.startswith("__"):
        raise Refused(f"the name {node.id!r} is not allowed in an expression")
    if isinstance(node, ast.Attribute) and node.attr.startswith("_"):
        raise Refused(f"the attribute {node.attr!r} is not allowed in an expression")
    if (isinstance(node, ast.Dict) and None in node.keys) or (isinstance(node, ast.keyword) and node.arg is None):
        raise Refused("'**' before a dictionary is not allowed in an expression")


def _value(node: ast.AST, names: Mapping[str, Any]) -> Any:
    """Value of a node that was checked."""

    def of(each: ast.AST | None) -> Any:
        return None if each is None else _value(each, names)

    match node:
        case ast.Constant():
            return node.value
        case ast.Name():
            try:
                return names[node.id]
            except KeyError:
                raise NameError(f"name {node.id!r} is not defined") from None
        case ast.List() | ast.Tuple():
            return (list if isinstance(node, ast.List) else tuple)(map(of, node.elts))
        case ast.Dict():
            return dict(zip(map(of, node.keys), map(of, node.values), strict=True))
        case ast.UnaryOp():
            return _UNARY[type(node.op)](of(node.operand))
        case ast.BinOp():
            return _combined(node.op, of(node.left), of(node.right))
        case ast.BoolOp():
            result: Any = None
            for each in node.values:
                result = of(each)
                if bool(result) is isinstance(node.op, ast.Or):
                    break
            return result
        case ast.Compare():
            return _compared(node, of)
        case ast.IfExp():
            return of(node.body) if of(node.test) else of(node.orelse)
        case ast.Slice():
            return slice(of(node.lower), of(node.upper), of(node.step))
        case ast.Subscript():
            return of(node.value)[of(node.slice)]
        case ast.Attribute():
            return _member(of(node.value), node.attr)
        case ast.Call():
            given = {str(each.arg): of(each.value) for each in node.keywords}
            return _bounded(_callee(node.func, of)(*map(of, node.args), **given))
    raise Refused(f"{type(node).__name__} is not allowed in an expression")


def _compared(node: ast.Compare, of: Callable[[ast.AST], Any]) -> bool:
    left = of(node.left)
    for sign, each in zip(node.ops, node.comparators, strict=True):
        right = of(each)
        if not _COMPARED[type(sign)](left, right):
            return False
        left = right
    return True


def _member(value: Any, name: str) -> Any:
    """What a dotted name stands for: an entry of a namespace, or of a dictionary that was read from YAML."""
    if not (isinstance(value, dict) and type(value) is not dict):
        raise Refused(f"the attribute {name!r} of a {type(value).__name__} is not allowed in an expression")
    try:
        return value[name]
    except KeyError:
        raise NameError(f"name {name!r} is not defined") from None


def _callee(node: ast.expr, of: Callable[[ast.AST], Any]) -> Callable[..., Any]:
    if isinstance(node, ast.Attribute):
        value = of(node.value)
        for kind, methods in _METHODS.items():
            if isinstance(value, kind) and node.attr in methods and not isinstance(value, Names):
                return getattr(kind, node.attr).__get__(value)  # type: ignore[no-any-return]
        function = _member(value, node.attr)
    else:
        function = of(node)
    if not isinstance(function, Function):
        raise Refused(f"calling {ast.unparse(node)} is not allowed in an expression")
    return function.call


def _combined(sign: ast.operator, a: Any, b: Any) -> Any:
    """Value of an operation whose size is looked at before it is worked out."""
    whole = isinstance(a, int) and isinstance(b, int)
    if isinstance(sign, ast.Pow) and whole and a.bit_length() * b > BITS:
        raise Refused(f"a whole number of more than {BITS} binary digits is too large")
    if isinstance(sign, ast.Mult):
        for many, text in ((a, b), (b, a)):
            if isinstance(many, int) and hasattr(text, "__len__") and many * len(text) > LARGEST:
                raise Refused(f"a value repeated {many:.3g} times is too large")
    if isinstance(sign, ast.Mod) and isinstance(a, str | bytes) and _WIDE.search(str(a)):
        raise Refused("a format with such a width is not allowed in an expression")
    return _bounded(_BINARY[type(sign)](a, b))


def _bounded(value: Any) -> Any:
    if isinstance(value, int) and value.bit_length() > BITS:
        raise Refused(f"a whole number of more than {BITS} binary digits is too large")
    if isinstance(value, str | bytes | list | tuple | dict | set | frozenset) and len(value) > LARGEST:
        raise Refused(f"a value of {len(value):.3g} parts is too large")
    return value


class Names(dict[str, Any]):
    """A namespace, such as ``math``, whose names are read with a dot."""


def _range(*limits: int) -> range:
    numbers = range(*limits)
    if len(numbers) > LARGEST:  # raises itself where it has more than a machine can count
        raise Refused(f"a range of {len(numbers):.3g} numbers is too long")
    return numbers


def _round(number: Any, digits: int | None = None) -> Any:
    if digits is not None and abs(digits) > 400:
        raise Refused(f"rounding to {digits:.3g} digits is not allowed in an expression")
    return round(number, digits)


def _small(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of whole numbers whose value grows fast, for small ones."""

    def of_small(*numbers: Any) -> Any:
        if any(isinstance(number, int) and number > 1000 for number in numbers):
            raise Refused(f"math.{function.__name__} of a number above 1000 is not allowed in an expression")
        return function(*numbers)

    return of_small


def _with_function(function: Callable[..., Any]) -> Callable[..., Any]:
    def called(first: Any, *others: Iterable[Any]) -> Any:
        if not isinstance(first, Function):
            raise Refused(f"{function.__name__} of {type(first).__name__} is not allowed in an expression")
        return list(function(first.call, *others))

    return called


def _functions(given: Mapping[str, Any]) -> dict[str, Any]:
    return {name: Function(value) if callable(value) else value for name, value in given.items()}


_GLOBAL = _functions(
    {
        **{each.__name__: each for each in (list, dict, len, str, float, int, bool, min, max, sorted)},
        "map": _with_function(map),
        "round": _round,
        "range": _range,
        "True": True,
        "False": False,
    }
)
_PYTHON = _functions(
    {
        **{each.__name__: each for each in (abs, all, any, divmod, sum, tuple, set, frozenset, ord, repr)},
        **{each.__name__: (lambda *of, each=each: list(each(*of))) for each in (enumerate, reversed, zip)},
        "filter": _with_function(filter),
    }
)
_MATH = _functions(
    {
        **{name: value for name, value in vars(math).items() if not name.startswith("_")},
        **{each.__name__: _small(each) for each in (math.factorial, math.comb, math.perm)},
    }
)


def known_names(own: Mapping[str, Any]) -> dict[str, Any]:
    """All that xacro documents, by name."""
    of_xacro = _functions(own)
    plain = {name: of_xacro[name] for name in ("load_yaml", "abs_filename", "dotify") if name in of_xacro}
    spaces: dict[str, Any] = {"math": Names(_MATH), "python": Names({**_PYTHON, **_GLOBAL}), "xacro": Names(of_xacro)}
    return _MATH | _GLOBAL | plain | spaces
