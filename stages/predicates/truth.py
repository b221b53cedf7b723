"""Ground truth of the kitchen: what the teacher means, allows and says (data/kitchen)."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from pydantic import Field

from schemas.base import Model
from schemas.outside import LARGEST_SETTINGS, file_text, file_toml
from stages.kit.predicates.expressions import Predicate, check, read
from stages.kit.tasks.pddl import parse_domain
from stages.kit.tasks.strips import Domain
from stages.predicates.state import KITCHEN_WORDS

FOLDER = Path(__file__).resolve().parents[2] / "data" / "kitchen"
TRUTH = FOLDER / "truth.toml"
OPERATORS = {
    "store_objects": FOLDER / "store_objects.pddl",
    "set_table": FOLDER / "set_table.pddl",
    "cook_meal": FOLDER / "cook_meal.pddl",
}


class Meant(Model):
    """A predicate of the teacher and her sentences, <1> and <2> for objects."""

    arguments: int = Field(ge=0, le=2)
    means: str
    lacks: tuple[str, ...] = Field(min_length=1)
    """When it is a precondition that does not hold."""
    unmet: tuple[str, ...] = Field(min_length=1)
    """When it is a goal that does not hold."""


class TruthFile(Model):
    """truth.toml."""

    predicates: dict[str, Meant]
    goals: dict[str, str]
    """Predicate -> what is said of it in a goal."""


@cache
def truth_file() -> TruthFile:
    """Return meanings and sentences."""
    return TruthFile.model_validate(file_toml(TRUTH, LARGEST_SETTINGS))


@cache
def true_predicates() -> dict[str, Predicate]:
    """Return what the teacher means by each of her predicates."""
    found = {
        name: Predicate(name, meant.arguments, read(meant.means, f"truth.toml, {name}"))
        for name, meant in truth_file().predicates.items()
    }
    check(found, KITCHEN_WORDS)
    return found


@cache
def true_domain(name: str) -> Domain:
    """Return the teacher's operators of a domain of the kitchen."""
    return parse_domain(file_text(OPERATORS[name], LARGEST_SETTINGS))


def action_of(operator: str) -> str:
    """Return the action that an operator is about: `pick_up-from_table` is `pick_up`."""
    return operator.split("-")[0]
