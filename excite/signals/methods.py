"""Signal methods by name."""

from __future__ import annotations

import dataclasses
from importlib import import_module
from typing import Any

from excite.registry import SIGNALS
from excite.signals.measured_velocity import MeasuredVelocity
from excite.signals.method import Method
from regressors.errors import UnknownName

_REGISTRY = {
    "butterworth": ("excite.signals.butterworth", "Butterworth"),
    "differences": ("excite.signals.differences", "Differences"),
    "fourier": ("excite.signals.fourier_fit", "FourierFit"),
    "savitzky-golay": ("excite.signals.savitzky_golay", "SavitzkyGolay"),
    "spline": ("excite.signals.smoothing_spline", "SmoothingSpline"),
}


def signal_method(name: str, *, measured_velocity: bool = False, **options: Any) -> Method:
    """Create a signal method by name."""
    if name not in SIGNALS:
        raise UnknownName("method of signals", name, SIGNALS)
    module, kind = _REGISTRY[name]
    instance = getattr(import_module(module), kind)
    settings = [field.name for field in dataclasses.fields(instance)]
    for option in options:
        if option not in settings:
            raise UnknownName(f"setting of {name}", option, settings)
    method: Method = instance(**options)
    return MeasuredVelocity(method) if measured_velocity else method
