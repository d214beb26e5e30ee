"""Ranges of parameters as YAML, for programs that randomise a simulated robot."""

from __future__ import annotations

from excite.posterior.posterior_samples import ParameterRange, PosteriorSamples


def ranges_text(samples: PosteriorSamples, level: float, comment: tuple[str, ...] = ()) -> str:
    """The whole document, the same for the same samples."""
    lines = [
        *(f"# {line}" for line in comment),
        f"robot: {_quoted(samples.robot)}",
        f"result_sha256: {_quoted(samples.result_sha256 or '')}",
        f"level: {_number(level)}",
        f"samples: {len(samples)}",
        f"seed: {samples.seed}",
        f"prior: {_number(samples.prior)}",
        "parameters:",
        *map(_line, samples.ranges(level)),
    ]
    return "".join(f"{line}\n" for line in lines)


def _line(one: ParameterRange) -> str:
    numbers = ", ".join(f"{name}: {_number(getattr(one, name))}" for name in ("low", "high", "mean", "deviation"))
    return f"  {one.name}: {{unit: {_quoted(one.unit)}, {numbers}}}"


def _number(value: float) -> str:
    """Text that also readers of YAML 1.1, such as PyYAML, take for this number: with a point before the exponent."""
    digits, exponent, power = repr(float(value)).partition("e")
    return f"{digits}{'' if '.' in digits else '.0'}{exponent}{power}"


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
