"""Messages of the library in terms of the command line: options in backticks become command-line options."""

from __future__ import annotations

import re
from collections.abc import Mapping

from regressors.errors import printable

_TYPED: Mapping[str, str] = {
    "position": "--position-limit",
    "velocity": "--velocity-limit",
    "acceleration": "--acceleration-limit",
    "jerk": "--jerk-limit",
    "constraints": "--constraint",
    "replace": "--force",
    "percent": "--speeds",
    "folder": "--out",
    "friction_scale": "--scale-friction",
}
_COMMANDS: Mapping[str, str] = {
    "design_trajectory": "'excite design'",
    "plan_campaign": "'excite plan'",
    "run_sweep": "'excite sweep run'",
    "identify": "'excite identify'",
    "next_motion": "'excite plan'",
    "simulate": "'excite simulate'",
    "predict_accuracy": "'excite predict'",
    "verify": "'excite verify'",
    "compare": "'excite compare'",
    "export_ensemble": "'excite export'",
    "export_model": "'excite export'",
    "export_motion": "'excite export'",
    "plan_friction": "'excite friction plan'",
    "fit_friction": "'excite friction fit'",
    "design_payload_motion": "'excite payload design'",
    "calibrate_gains": "'excite payload gains'",
    "identify_payload": "'excite payload identify'",
    "guess_mapping": "'excite logs'",
    "write_report": "'excite report'",
}


def in_options(message: str) -> str:
    """A message with every option and call in backticks in its command-line form, and nothing a terminal would obey.

    An option `torque_margin` becomes ``--torque-margin``, one with a value, `drop='nan'`, ``--drop nan``, one that is
    turned off, `approach_and_return=False`, ``--no-approach-and-return``, and a call, `plan_friction`,
    ``'excite friction plan'``.
    """
    return re.sub(r"`(\w+)(?:=([^`]*))?`", _option, printable(" ".join(message.split("\n"))))


def _option(match: re.Match[str]) -> str:
    name, value = match.group(1), match.group(2)
    if value is None and name in _COMMANDS:
        return _COMMANDS[name]
    typed = _TYPED.get(name, "--" + name.replace("_", "-"))
    if value == "False":
        return typed.replace("--", "--no-", 1)
    return typed if value is None or value == "True" else f"{typed} {value.strip(chr(39) + chr(34))}"
