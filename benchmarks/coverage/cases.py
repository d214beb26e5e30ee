"""The cases of the study, by name. A case of your own is one more line, with any recipe."""

from __future__ import annotations

from dataclasses import replace

from experiments import Experiment
from repetition import Case

from excite.identification.recipe import Recipe

SLOWEST = 0.02  # of a drive, below which rows are left out by the mask [rad/s]

IRP6 = Experiment()
ENERGY = Experiment(model={"model": "energy", "window": "long"})
SHORT = Experiment(model={"model": "energy"}, rate=1000.0)  # windows of 5 ms, as in [KD96]
SHORT_STICKING = replace(SHORT, stiction=1.0, breakaway=1e-5)
SHORT_UR10E = Experiment("ur10e", model={"model": "energy"}, duration=8.0, rate=500.0)
LOAD = Experiment(model={"model": "load-integral", "window": "long"}, duration=4.0)
COULOMB = Experiment(stiction=1.0, breakaway=1e-5)
STICKING = Experiment(stiction=1.5, breakaway=1e-3)
PANDA = Experiment("panda", duration=8.0)
OUTSIDE = replace(PANDA, plant="pinocchio")
HELD = Experiment("panda", {"model": "load"}, duration=4.0, plant="pinocchio")
STILL = replace(HELD, robot="ur10e", duration=5.0, swing=0.02)
UR10E = Experiment("ur10e", duration=8.0, rate=125.0)
POSSIBLE = Recipe(estimator="physical")
ALIKE = Recipe(covariance="white")  # noise that is alike in all windows


CASES = (
    Case("white", IRP6),
    Case("autoregressive", IRP6, noise="autoregressive"),
    Case("low-frequency", IRP6, noise="slow"),
    Case("encoder 2e-4 rad", IRP6, encoder=2e-4),
    Case("encoder 1e-3 rad", IRP6, encoder=1e-3),
    Case("energy, long windows", ENERGY),
    Case("energy, long windows, autoregressive", ENERGY, noise="autoregressive"),
    Case("load-integral, long windows", LOAD),
    Case("load-integral, long windows, autoregressive", LOAD, noise="autoregressive"),
    Case("presliding over a velocity", Experiment(sign_width=0.02)),
    Case("presliding over a distance", Experiment(breakaway=3e-3)),
    Case("physical", IRP6, level=0.3, recipe=POSSIBLE),
    Case("sticking", STICKING),
    Case("sticking, rows near standstill left out", STICKING, recipe=Recipe(standstill=SLOWEST)),
    Case("ur10e, white", UR10E),
    Case("ur10e, low-frequency", UR10E, noise="slow"),
    Case("ur10e, encoder 2e-4 rad", UR10E, encoder=2e-4),
    Case("ur10e, physical, bounds active", UR10E, level=0.1, recipe=POSSIBLE),
    Case(
        "ur10e, physical, pulled", replace(UR10E, wrong=0.2), recipe=Recipe(estimator="physical", described_within=1.0)
    ),
    Case("plain defaults, white", IRP6, plain=True),
    Case("plain defaults, autoregressive", IRP6, noise="autoregressive", plain=True),
    Case("plain defaults, encoder 2e-4 rad", IRP6, encoder=2e-4, plain=True),
    Case("plain defaults, sticking Coulomb friction", COULOMB, plain=True),
    Case("plain defaults, sticking, break-away 1.5 times", STICKING, plain=True),
    Case("plain defaults, sticking, break-away 2 times", replace(STICKING, stiction=2.0), plain=True),
    Case("plain defaults, panda", PANDA, plain=True),
    Case("plain defaults, panda, offset of 0.18 Nm", PANDA, offset=0.18, plain=True),
    Case("plain defaults, panda, torques 3.3 ms late", PANDA, late=3.3e-3, plain=True),
    Case("plain defaults, panda, break-away 1.3 times", replace(PANDA, stiction=1.3, breakaway=1e-4), plain=True),
    Case(
        "plain defaults, load, bias of 0.3 N", Experiment(model={"model": "load"}, duration=4.0), offset=0.3, plain=True
    ),
    Case("plain defaults, Pinocchio's panda, offset of 0.18 Nm", OUTSIDE, offset=0.18, plain=True),
    Case("plain defaults, Pinocchio's panda, Stribeck friction of 30 %", replace(OUTSIDE, stribeck=0.3), plain=True),
    Case("plain defaults, Pinocchio's load, bias of 0.2 N", HELD, offset=0.2, plain=True),
    Case("plain defaults, Pinocchio's load, bias of 0.4 N", HELD, offset=0.4, plain=True),
    Case("plain defaults, Pinocchio's load, hardly turned, bias of 0.2 N", STILL, level=0.01, offset=0.2, plain=True),
    Case("plain defaults, Pinocchio's load, hardly turned, bias of 0.4 N", STILL, level=0.01, offset=0.4, plain=True),
    Case("energy, white, noise taken as alike", SHORT, recipe=ALIKE, plain=True),
    Case("energy, plain defaults, white", SHORT, plain=True),
    Case("energy, plain defaults, positions 1e-4 rad", SHORT, positions=1e-4, plain=True),
    Case("energy, plain defaults, autoregressive", SHORT, noise="autoregressive", plain=True),
    Case("energy, plain defaults, encoder 2e-4 rad", SHORT, encoder=2e-4, plain=True),
    Case("energy, plain defaults, encoder 1e-3 rad", SHORT, encoder=1e-3, plain=True),
    Case("energy, plain defaults, sticking Coulomb friction", SHORT_STICKING, plain=True),
    Case("energy, ur10e, white, noise taken as alike", SHORT_UR10E, recipe=ALIKE, plain=True),
    Case("energy, ur10e, plain defaults, white", SHORT_UR10E, plain=True),
    Case("energy, ur10e, plain defaults, positions 1e-4 rad", SHORT_UR10E, positions=1e-4, plain=True),
    Case("energy, ur10e, plain defaults, autoregressive", SHORT_UR10E, noise="autoregressive", plain=True),
)
