"""What to record while a motion is played: a file that the recorder takes, and how `identify` reads its recording."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from excite.export.motions.sampled_design import SampledDesign
from regressors.quoting import printable


@dataclass(frozen=True)
class Recorder:
    """A recorder of a played motion.

    Parameters
    ----------
    mapping : mapping
        Sections of a log mapping, see `excite.logs.mapping`.
    about : tuple of str
        Lines for the comment of the mapping: what records, at which rate, where the motion starts.
    suffix : str
        Ending of the file that the recorder takes, such as ``.xml``; empty where there is none.
    content : str
        Of that file.
    notes : tuple of str
        What has to be known of the recording, one sentence each.
    """

    mapping: Mapping[str, Any]
    about: tuple[str, ...]
    suffix: str = ""
    content: str = ""
    notes: tuple[str, ...] = ()

    def mapping_text(self, motion: SampledDesign) -> str:
        """The log mapping as YAML, with the hash of the design by which `identify` finds it."""
        comment = [f"# {printable(line)}" for line in (*self.about, *motion.heading)]
        entries = {**self.mapping, "joints": list(motion.joints), "design": motion.sha256}
        return (
            "\n".join(
                [*comment, *(f"{name}: {json.dumps(value, ensure_ascii=False)}" for name, value in entries.items())]
            )
            + "\n"
        )


def columns(form: str, names: Sequence[object]) -> list[str]:
    """Names of the columns of every joint, such as ``state.q[0]`` of the form ``state.q[{}]``."""
    return [form.format(name) for name in names]


def xml_comment(motion: SampledDesign) -> str:
    """Lines of the heading for a comment of XML, in which two hyphens are not allowed."""
    return "\n".join(f"  {re.sub('-(?=-)', '- ', line)}" for line in motion.heading)


HOUSE = "time [s], then NAME.position, NAME.velocity, NAME.effort of every joint [SI], as a CSV file with this header"


def house_recorder(motion: SampledDesign) -> Recorder:
    """A recorder that writes CSV as `excite simulate` does."""
    names = motion.joints
    return Recorder(
        {
            "time": {"column": "time", "unit": "s"},
            "position": {"columns": columns("{}.position", names), "unit": "rad"},
            "velocity": {"columns": columns("{}.velocity", names), "unit": "rad/s"},
            "effort": {"columns": columns("{}.effort", names), "unit": "Nm"},
        },
        (
            f"record: {HOUSE}",
            f"rate: {motion.rate:g} Hz or faster, from before the start of the motion until after its end",
            "start marker: none; the robot rests before the motion and after it, and identify finds where it moves",
        ),
    )
