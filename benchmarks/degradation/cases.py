"""Table of the degradations, each at several levels."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Case:
    """One degradation at one level; every log has noise of 1 % of the torques and positions in steps of 1e-6 rad.

    Parameters
    ----------
    kind : str
        Row of the tables.
    level : str
        With its unit.
    options : dict
        Of `Degradation`.
    run : str
        Which simulation: ``plain``, ``sticking``, ``payload``, or ``impact N``, whose peaks are N times the joint's
        torque.
    white : float
        White noise, over the root mean square of each joint's torque.
    coloured : float
        The same of noise below 2 Hz.
    gains : float
        Largest relative error of the joints' gains, with signs that alternate.
    """

    kind: str
    level: str
    options: dict[str, Any] = field(default_factory=dict)
    run: str = "plain"
    white: float = 0.01
    coloured: float = 0.0
    gains: float = 0.0

    @property
    def name(self) -> str:
        """Kind and level."""
        return f"{self.kind}, {self.level}" if self.level else self.kind


HOST = (0.0007, 0.0085)
CASES = (
    Case("as simulated", ""),
    Case("clock jitter", "0.9 to 2 ms", {"clock_jitter": (0.0009, 0.002)}),
    Case("clock jitter", "0.7 to 8.5 ms", {"clock_jitter": HOST}),
    Case("held rows", "2 %", {"hold": 0.02}),
    Case("held rows", "6 %", {"hold": 0.06}),
    Case("held rows", "10 %", {"hold": 0.1}),
    Case("quantisation", "1e-5 rad", {"position_step": (1e-5,)}),
    Case("quantisation", "1e-4 rad", {"position_step": (1e-4,)}),
    Case("quantisation", "1e-3 rad", {"position_step": (1e-3,)}),
    Case("white noise", "3 %", white=0.03),
    Case("white noise", "10 %", white=0.1),
    Case("coloured noise", "3 %", coloured=0.03),
    Case("coloured noise", "10 %", coloured=0.1),
    Case("delay", "2 ms", {"delay": (0.002,)}),
    Case("delay", "4 ms", {"delay": (0.004,)}),
    Case("delay", "8 ms", {"delay": (0.008,)}),
    Case("dropped rows", "1 %", {"drop_rows": 0.01}),
    Case("dropped rows", "5 %", {"drop_rows": 0.05}),
    Case("impacts", "peaks of the torque", run="impact 1"),
    Case("impacts", "5 times the torque", run="impact 5"),
    Case("wrong gains", "10 %", gains=0.1),
    Case("friction drift", "-15 %", {"friction_drift": -0.15}),
    Case("friction drift", "-30 %", {"friction_drift": -0.3}),
    Case("sticking", "presliding", run="sticking"),
    Case("payload forgotten", "", run="payload"),
    Case("host", "jitter, 6 % held, 1e-4 rad, 4 ms", {
        "clock_jitter": HOST, "hold": 0.06, "position_step": (1e-4,), "delay": (0.004,)
    }),
)  # fmt: skip
QUICK = ("as simulated", "clock jitter, 0.7 to 8.5 ms", "quantisation, 1e-3 rad", "delay, 8 ms", "wrong gains, 10 %")
