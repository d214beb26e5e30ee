"""Settings that may be chosen: those that were not given."""

from __future__ import annotations

from collections.abc import Collection

from excite.identification.recipe import Recipe
from excite.registry import CHOSEN
from excite.tasks.model_choice import ModelChoice
from regressors.errors import UnknownName

TERM_SETTINGS = frozenset(CHOSEN) - {"cutoff", "signals", "delay", "friction_scale", "standstill", "estimator"}
_TOGETHER = {  # settings that decide on another one
    "cutoff": ("signals", "measured_velocity", "average"),
    "signals": ("measured_velocity", "average", "period", "harmonics"),
    "delay": ("average",),
    "estimator": ("pull", "described_within"),
}


def free_settings(
    choose: bool | Collection[str], recipe: Recipe, model: ModelChoice, given: Collection[str]
) -> frozenset[str]:
    """Settings that are left to be chosen."""
    wanted = (CHOSEN if choose else ()) if isinstance(choose, bool) else tuple(choose)
    for name in wanted:
        if name not in CHOSEN:
            raise UnknownName("setting to choose", name, CHOSEN)
    recipe_default, model_default = Recipe(), ModelChoice()

    def is_given(name: str) -> bool:
        if name in given:
            return True
        for own, default in ((recipe, recipe_default), (model, model_default)):
            if hasattr(default, name):
                return bool(getattr(own, name) != getattr(default, name))
        return False

    free = {name for name in wanted if not any(map(is_given, (name, *_TOGETHER.get(name, ()))))}
    if not isinstance(model.model, str):
        free -= TERM_SETTINGS
    return frozenset(free)
