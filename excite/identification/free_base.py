"""The six equations of a base that nothing touches, beside those of the joints.

No wrench acts on it from outside, so that its equations are ``0 = Y theta`` (see `regressors.robot.moving_base`): the
momentum of the robot changes by gravity alone. They show the base's own parameters, of which the joints' equations
have none, in the units that the torques of the joints give. Least residuals are those of ``theta = 0``, so that noise
in Y pulls towards it, and settings that were chosen by them would make it larger. Hence

- everything is chosen by the joints' equations, and estimated from them first;
- since noise of accelerations grows with their frequency, both sides are low-passed at half the cutoff of positions;
- the estimate from all equations is taken where what the joints' equations show lies within its intervals there, and
  where these do not grow. A light arm on a heavy base hardly moves it: the noise is then too large, and
  the equations of the base stay out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from excite.identification.choices.all_choices import Chosen
from excite.identification.identification import Identification

_LOWER = 0.5  # of the cutoff of the positions: that of both sides
_WITHIN = 0.97  # of the parameters


def low_passed(chosen: Chosen) -> Chosen:
    """Settings with a low-pass of both sides, where none is given; a note says so."""
    cutoff, low_pass = chosen.recipe.cutoff, chosen.recipe.low_pass
    if cutoff is None or low_pass is not None or chosen.recipe.every is not None:
        return chosen
    low_pass = _LOWER * cutoff
    note = f"both sides of the equations are low-passed at {low_pass:.3g} Hz, against noise of the base's motion"
    return replace(chosen, recipe=replace(chosen.recipe, low_pass=low_pass), notes=(*chosen.notes, note))


def why_not(whole: Identification, joints: Identification) -> str:
    """Why an estimate from all equations is not taken instead of that from the joints' alone; empty where it is."""
    place = [whole.names.index(name) for name in joints.names]
    ours, theirs = whole.estimate, joints.estimate
    known = np.isfinite(theirs.half_width) & (theirs.half_width > 0)
    if not known.any():
        return "those of the joints show no parameter, and so not the size of any"
    away = np.abs(ours.coefficients[place] - theirs.coefficients)[known] / theirs.half_width[known]
    if np.mean(away <= 1.0) < _WITHIN:
        worst = np.array(joints.names)[known][int(np.argmax(away))]
        return f"they contradict those of the joints, most in {worst}, as if something touched the robot"
    if np.median(ours.half_width[place][known] / theirs.half_width[known]) > 1.0:
        return "intervals are wider with them"
    return ""
