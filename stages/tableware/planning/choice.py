"""Policies, worlds and time models by the names of the command line."""

from __future__ import annotations

from scenewright.schemas.tableware_plan import TimesOfActions
from scenewright.stages.tableware import policies
from scenewright.stages.tableware.found_by_place import module_named
from scenewright.stages.tableware.options import ActionTimes
from scenewright.stages.tableware.planning.policy import STANDARD_SETTING, DeclaredPolicy, Policy
from scenewright.stages.tableware.planning.time_model import WORLDS, Chances, TimeModel, fitted
from scenewright.stages.tableware.world.setting import Setting


def chances_of(name: str) -> Chances:
    """Return the chances of a world by its name."""
    return WORLDS[name]()


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


def declared_policy(name: str) -> DeclaredPolicy:
    """Return what the file of a policy declares. Raises UsageError for a name that no file has."""
    declared: DeclaredPolicy = module_named(policies, name).POLICY
    return declared


def make_policy(
    name: str, model: TimeModel, chances: Chances, seed: int, setting: Setting = STANDARD_SETTING
) -> Policy:
    """Return a policy by its name, for these sizes and this hand."""
    return declared_policy(name).make(model, chances, seed, setting)
