"""Expressions of xacro, ``${...}`` and ``$(eval ...)``: parsed, checked, and evaluated by simpleeval, without `eval`.

Allowed are arithmetic, comparisons, boolean and conditional expressions, literals, lists, subscripts, dotted names of
YAML and of the namespaces, and calls of what is listed here. What a value is cannot lead out of it: no attribute of a
Python object is ever looked up. Of simpleeval only the walk through the parts of an expression is used: which parts
there may be, what a dotted name is, what may be called and how large a value may be is decided here.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from simpleeval import DEFAULT_OPERATORS, EvalWithCompoundTypes, NameNotDefined

LONGEST = 10_000  # characters of an expression
LARGEST = 10**6  # characters of a text, entries of a list
BITS = 10_000  # of a whole number
_WIDE = re.compile(r"%[^a-zA-Z%]*(\d{4}|\*)")  # a field of a format that makes a long text of a short one

_NODES = (
    ast.Expression, ast.Constant, ast.Name, ast.Load, ast.List, ast.Tuple, ast.Dict, ast.BinOp, ast.UnaryOp, ast.BoolOp,
    ast.And, ast.Or, ast.Compare, ast.IfExp, ast.Subscript, ast.Slice, ast.Attribute, ast.Call, ast.keyword, ast.cmpop,
    ast.Add, ast.Sub, ast.Mult, ast.Div, ast.FloorDiv, ast.Mod, ast.Pow, ast.UAdd, ast.USub, ast.Not,
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
    try:
        return _Evaluator(names).eval(text, tree.body)
    except NameNotDefined as error:
        raise NameError(f"name {error.name!r} is not defined") from None


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


class _Evaluator(EvalWithCompoundTypes):  # type: ignore[misc]
    """Value of a checked expression, none of whose parts grows without bounds."""

    def __init__(self, names: Mapping[str, Any]) -> None:
        super().__init__(operators=_OPERATORS, names=names)
        self.functions: dict[str, Any] = {}
        self.nodes |= {ast.Attribute: self._dotted, ast.Call: self._called}

    def _eval(self, node: ast.AST) -> Any:
        return _bounded(super()._eval(node))

    def _check_disallowed_items(self, item: Any) -> None:
        """Nothing: a value that is not a `Function` is never called, and lists within each other take long to walk."""

    def _dotted(self, node: ast.Attribute) -> Any:
        """What a dotted name stands for: a method, or an entry of a namespace or of what was read from YAML."""
        value, name = self._eval(node.value), node.attr
        for kind, methods in _METHODS.items():
            if isinstance(value, kind) and name in methods and not isinstance(value, Names):
                return Function(getattr(kind, name).__get__(value))
        if not isinstance(value, dict) or type(value) is dict:
            raise Refused(f"the attribute {name!r} of a {type(value).__name__} is not allowed in an expression")
        try:
            return value[name]
        except KeyError:
            raise NameError(f"name {name!r} is not defined") from None

    def _called(self, node: ast.Call) -> Any:
        function = self._eval(node.func)
        if not isinstance(function, Function):
            raise Refused(f"calling {ast.unparse(node.func)} is not allowed in an expression")
        return function.call(*map(self._eval, node.args), **dict(map(self._eval, node.keywords)))


def _power(a: Any, b: Any) -> Any:
    if isinstance(a, int) and isinstance(b, int) and a.bit_length() * b > BITS:
        raise Refused(f"a whole number of more than {BITS} binary digits is too large")
    return a**b


def _product(a: Any, b: Any) -> Any:
    for many, text in ((a, b), (b, a)):
        if isinstance(many, int) and hasattr(text, "__len__") and many * len(text) > LARGEST:
            raise Refused(f"a value repeated {many:.3g} times is too large")
    return a * b


def _remainder(a: Any, b: Any) -> Any:
    if isinstance(a, str | bytes) and _WIDE.search(str(a)):
        raise Refused("a format with such a width is not allowed in an expression")
    return a % b


_OPERATORS = {**DEFAULT_OPERATORS, ast.Add: operator.add, ast.Mult: _product, ast.Pow: _power, ast.Mod: _remainder}


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
