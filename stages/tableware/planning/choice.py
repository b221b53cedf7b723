"""Policies, worlds and time models by the names of the command line."""

from __future__ import annotations

from dataclasses import replace

from schemas.tableware_plan import TimesOfActions
from stages.tableware.options import ActionTimes
from stages.tableware.planning.joint import JointPolicy
from stages.tableware.planning.policies import THESIS, Policy, PullPolicy, RandomOne, RandomPile, StackPolicy
from stages.tableware.planning.rules import Rules
from stages.tableware.planning.time_model import (
    EXACT,
    Chances,
    TimeModel,
    fitted,
    measured,
    with_spills,
    with_thesis_failures,
)


def chances_of(name: str) -> Chances:
    """Return the chances of a world by its name."""
    return {
        "exact": lambda: EXACT,
        "thesis": measured,
        "thesis_spills": with_spills,
        "thesis_failures": with_thesis_failures,
    }[name]()


def time_model(options: ActionTimes) -> TimeModel:
    """Return the fit to a tier, with what is given explicitly in its place."""
    model = fitted(options.times_of, options.delay)
    return TimeModel(
        model.trip if options.trip_seconds is None else options.trip_seconds,
        model.stack if options.stack_seconds is None else options.stack_seconds,
        model.pull if options.pull_seconds is None else options.pull_seconds,
        options.delay,
    )


def as_times(model: TimeModel) -> TimesOfActions:
    """Return a time model for JSON."""
    return TimesOfActions(trip=model.trip, stack=model.stack, pull=model.pull, delay=model.delay)


_BOWLS = ("b", "bb", "bc", "bcc", "bbc")
_PAIRS = frozenset(
    {("u", "u"), ("c", "c"), ("c", "cc"), ("cc", "cc"), ("b", "bbb"), ("bb", "bbb"), ("bbb", "bc")}
    | {(one, other) for one in _BOWLS for other in _BOWLS if one <= other}
)
_BORNE = Rules(most_utensils=2, plates_alone=True, beside=_PAIRS)
RULES: dict[str, Rules] = {
    "ours": _BORNE,
    "ours_without_loaded_pulls": replace(_BORNE, loaded_pulls=False),
    "ours_bold": Rules(),
}
"""What our policies allow themselves. `ours`: what physics bears (docs/TIDY.md): two utensils a pile, plates
alone, and side by side the pairs of piles that came whole in every grasp measured there. Dishes that carry utensils are
lifted side by side as they stand only where the world's chances say that nothing spills. `ours_bold`: whatever the jaws
allow."""


def rules_of(policy: str) -> Rules:
    """Return what a policy allows itself."""
    return RULES.get(policy, THESIS)


def make_policy(name: str, model: TimeModel, chances: Chances, seed: int) -> Policy:
    """Return a policy by its name."""
    if name in RULES:
        return JointPolicy(RULES[name], model, chances)
    if name == "random":
        return RandomOne(seed)
    if name == "random_piles":
        return RandomPile(seed)
    return PullPolicy() if name == "pull" else StackPolicy()
