"""What a goal and a domain say of a scene: goals as literals and formulas, and the task that is searched."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import UsageError
from scenewright.schemas.plan import Check
from scenewright.stages.kit.predicates.room import UNSEEN
from scenewright.stages.kit.simulation.urdf_split import PART_SEPARATOR
from scenewright.stages.kit.tasks.strips import Atom, GroundAction, Problem, positive_task
from scenewright.stages.kit.tasks.task_planner import plan_task
from scenewright.stages.plan.domain import DOMAIN
from scenewright.stages.plan.formulas import HINT, Alternative, Names, alternatives, literal_text, together
from scenewright.stages.plan.given_domain import TAUGHT, GivenDomain
from scenewright.stages.plan.symbols import near, parse_goal, task_problem
from scenewright.stages.plan.world_model import WorldModel

MOST_GOALS, GOAL_STATES = 6, 6000
"""Alternatives of a goal that are given geometry; states of the search that ranks them."""
REACHED = "goal-reached"
"""Predicate that is added to the task: one of the goal's alternatives holds."""


@dataclass(frozen=True)
class Reading:
    """Reads goals and makes tasks, in the chain's own domain or in one that was given."""

    given: GivenDomain | None = None

    def problem(
        self,
        model: WorldModel,
        graph: ContactGraphFile,
        objects: dict[str, str],
        initial: frozenset[Atom],
        literals: tuple[str, ...],
    ) -> Problem:
        """Return the task of ground literals. Raises UsageError as `parse_goal` does."""
        if self.given is not None:
            initial |= self.given.perceived(model, graph)
        goal_atoms, unwanted = self._atoms(model, objects, literals)
        return replace(task_problem(objects, initial, goal_atoms), negative_goal=unwanted)

    def task(self, model: WorldModel, problem: Problem) -> tuple[Problem, list[GroundAction]]:
        """Return the problem without negation and its ground actions. Raises BadInput as `GivenDomain.task` does."""
        if self.given is None:
            return positive_task(DOMAIN, problem)
        return self.given.task(problem, _classes(model))

    def candidates(
        self,
        model: WorldModel,
        graph: ContactGraphFile,
        objects: dict[str, str],
        initial: frozenset[Atom],
        goal: tuple[str, ...],
    ) -> list[tuple[str, ...]]:
        """Return what a goal can mean in ground literals, the cheapest to reach first, at most MOST_GOALS.

        Raises UsageError for what is no goal, and for one that can't hold."""
        texts = []
        for text in goal:
            words = None if self.given is None else self.given.in_words(text, objects)
            texts += [text] if words is None else [literal_text((atom, True)) for atom in sorted(words)]
        if self.given is None and all(_plain(text) for text in texts):
            return [parse_goal(tuple(texts), objects)[1]]
        names = Names(_classes(model) | _joints(objects), partial(self._meaning, objects))
        alternatives_found = together([alternatives(text, names) for text in texts], " ".join(goal))
        if not alternatives_found:
            raise UsageError(f"goal {' '.join(goal)[:200]!r} can never hold", hint="docs/PLANNING.md, Goals")
        return self._rank(model, graph, objects, initial, alternatives_found)

    def check(self, model: WorldModel, graph: ContactGraphFile, literal: str) -> Check | None:
        """Return whether a literal of a learned predicate holds; None for one that the room itself is asked for."""
        if self.given is None:
            return None
        plain = literal.removeprefix("not ")
        name, inner = plain.rstrip(")").split("(")
        atom = (name, *(word.strip() for word in inner.split(",") if word.strip()))
        verdict = self.given.check(model, graph, atom, literal)
        return verdict if verdict is None or plain == literal else negated(verdict)

    def _atoms(
        self, model: WorldModel, objects: dict[str, str], literals: tuple[str, ...]
    ) -> tuple[frozenset[Atom], frozenset[Atom]]:
        to_hold: set[Atom] = set()
        unwanted: set[Atom] = set()
        names = Names(_classes(model) | _joints(objects), partial(self._meaning, objects))
        for literal in literals:
            (alternative, *_) = alternatives(literal, names) or (frozenset(),)
            to_hold |= {atom for atom, holds in alternative if holds}
            unwanted |= {atom for atom, holds in alternative if not holds}
        return frozenset(to_hold), frozenset(unwanted)

    def _meaning(self, objects: dict[str, str], atom: Atom, text: str, quantified: bool) -> frozenset[Atom] | None:
        """Return what an atom of a goal stands for: the chain's, or a predicate of the given domain."""
        name = atom[0].removesuffix(f"-{TAUGHT}")
        if self.given is None or name not in self.given.domain.predicates:
            return _of_chain(objects, atom, quantified)
        argument_count = len(self.given.domain.predicates[name])
        if len(atom) - 1 != argument_count:
            raise UsageError(f"goal {text!r}: {name} takes {argument_count} arguments", hint=HINT)
        for term in atom[1:]:
            if term not in objects:
                raise UsageError(f"goal {text!r}: the scene has no {term!r}", hint=near(term, objects))
        if name not in self.given.seen and name in DOMAIN.predicates:
            return _of_chain(objects, atom, quantified)
        return frozenset({(self.given.name_here(name), *atom[1:])})

    def _rank(
        self,
        model: WorldModel,
        graph: ContactGraphFile,
        objects: dict[str, str],
        initial: frozenset[Atom],
        alternatives_found: tuple[Alternative, ...],
    ) -> list[tuple[str, ...]]:
        """Return alternatives as literals in the order in which one search after the other reaches them."""
        unranked = {tuple(sorted(map(literal_text, each))): each for each in alternatives_found}
        ranked: list[tuple[str, ...]] = []
        if any(not each for each in unranked):
            return [()]
        if self.given is not None:
            initial |= self.given.perceived(model, graph)
        unwanted = frozenset(atom for each in alternatives_found for atom, holds in each if not holds)
        start = replace(task_problem(objects, initial, frozenset()), negative_goal=unwanted)
        problem, actions = self.task(model, start)
        problem = replace(problem, goal=frozenset({(REACHED,)}))
        while unranked and len(ranked) < MOST_GOALS:
            achievers = [
                GroundAction(
                    REACHED,
                    literals,
                    frozenset(atom if holds else (f"not-{atom[0]}", *atom[1:]) for atom, holds in each),
                    frozenset({(REACHED,)}),
                    frozenset(),
                )
                for literals, each in unranked.items()
            ]
            plan = plan_task(problem, [*actions, *achievers], limit=GOAL_STATES, improvement=100)
            chosen = plan.actions[-1].arguments if plan.actions else next(iter(unranked))
            if not plan.actions and ranked:
                break  # what is left can't be reached
            ranked.append(chosen)
            del unranked[chosen]
        return ranked


def negated(check: Check) -> Check:
    """Return the check of `not ...`."""
    return check.model_copy(update={"holds": not check.holds})


def _of_chain(objects: dict[str, str], atom: Atom, quantified: bool) -> frozenset[Atom] | None:
    """Return the chain's atoms of a literal; None where a quantifier chose things that it can't be of."""
    kinds = DOMAIN.predicates.get(atom[0], ())
    if quantified and len(kinds) == len(atom) - 1:
        container = atom[0] in ("open", "closed") and objects.get(atom[1]) == "container"
        fitting = (DOMAIN.is_a(objects[term], kind) for term, kind in zip(atom[1:], kinds, strict=True))
        if not container and not all(fitting):
            return None
    return parse_goal((literal_text((atom, True)),), objects)[0]


def _plain(text: str) -> bool:
    words = text.replace("(", " ").replace(",", " ").split()
    return not text.lstrip().startswith("(") and not {"not", "any", "every"} & set(words)


def _classes(model: WorldModel) -> dict[str, str]:
    return {name: record.class_name for name, record in model.records.items() if record.class_name not in UNSEEN}


def _joints(objects: Mapping[str, str]) -> dict[str, str]:
    return {name: kind for name, kind in objects.items() if PART_SEPARATOR in name}
