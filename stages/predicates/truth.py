"""Ground truth: what the teacher means, allows and says (data/kitchen, data/room)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from pydantic import Field
from scenewright.schemas.base import Model
from scenewright.schemas.outside import LARGEST_SETTINGS, file_text, file_toml
from scenewright.schemas.places import REINSTALL, data_file
from scenewright.stages.kit.predicates.evaluating import Evaluator
from scenewright.stages.kit.predicates.expressions import Predicate, check, read
from scenewright.stages.kit.predicates.room import ROOM_WORDS
from scenewright.stages.kit.predicates.vocabulary import Perceived, Vocabulary
from scenewright.stages.kit.tasks.pddl import parse_domain
from scenewright.stages.kit.tasks.strips import Atom, Domain
from scenewright.stages.predicates.state import KITCHEN_WORDS

ROOM = "room"
"""The domain of rooms of the chain; the others are the kitchen's."""


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


@dataclass(frozen=True)
class Truth:
    """What the teacher of a domain means, allows and says."""

    name: str
    words: Vocabulary
    file: TruthFile
    predicates: Mapping[str, Predicate]
    operators: Domain

    def atoms(self, state: Perceived) -> frozenset[Atom]:
        """Return which of her atoms hold."""
        names = {name: len(kinds) for name, kinds in self.operators.predicates.items()}
        return Evaluator(state, self.predicates).atoms(names)

    def meant_by(self, phrase: str) -> str | None:
        """Return the predicate that a complaint is about."""
        for name, meant in self.file.predicates.items():
            if phrase in (*meant.lacks, *meant.unmet):
                return name
        return None

    def goal_phrase(self, atom: Atom) -> str:
        """Return what she says of one literal that she wants."""
        text = self.file.goals[atom[0]]
        for number, name in enumerate(atom[1:], start=1):
            text = text.replace(f"<{number}>", name)
        return text


@cache
def truth_of(domain: str) -> Truth:
    """Return the ground truth of a domain."""
    folder, words = (data_file("room"), ROOM_WORDS) if domain == ROOM else (data_file("kitchen"), KITCHEN_WORDS)
    file = TruthFile.model_validate(file_toml(folder / "truth.toml", hint=REINSTALL))
    predicates = {
        name: Predicate(name, meant.arguments, read(meant.means, f"truth.toml, {name}"))
        for name, meant in file.predicates.items()
    }
    check(predicates, words)
    operators = parse_domain(file_text(folder / f"{domain}.pddl", LARGEST_SETTINGS, hint=REINSTALL))
    return Truth(domain, words, file, predicates, operators)


def action_of(operator: str) -> str:
    """Return the action that an operator is about: `pick_up-from_table` is `pick_up`."""
    return operator.split("-")[0]


def true_predicates() -> Mapping[str, Predicate]:
    """Return what the teacher of the kitchen means; her three domains share their predicates."""
    return truth_of("store_objects").predicates


def true_domain(name: str) -> Domain:
    """Return the teacher's operators of a domain."""
    return truth_of(name).operators
