"""Messages of the library in words of the command line: options in backticks become what is typed."""

from __future__ import annotations

import re
from collections.abc import Mapping

_TYPED: Mapping[str, str] = {
    "position": "--position-limit",
    "velocity": "--velocity-limit",
    "acceleration": "--acceleration-limit",
    "jerk": "--jerk-limit",
    "constraints": "--constraint",
    "replace": "--force",
}


def in_options(message: str) -> str:
    """A message with every option that stands in backticks written as it is typed.

    An option `torque_margin` becomes ``--torque-margin``, and one with a value, `drop='nan'`, ``--drop nan``.

    Parameters
    ----------
    message : str
    """
    return re.sub(r"`(\w+)(?:=([^`]*))?`", _option, message)


def _option(match: re.Match[str]) -> str:
    name, value = match.group(1), match.group(2)
    typed = _TYPED.get(name, "--" + name.replace("_", "-"))
    return typed if value is None or value == "True" else f"{typed} {value.strip(chr(39) + chr(34))}"
