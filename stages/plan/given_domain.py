"""A domain that was given as data: somebody's PDDL, or what was learned in rooms (`predicates teach --scene`).

Its operators say what may be done and what follows; the motions, and what they ask for, stay the chain's own. Operator
`pick-2` is done by the motions of `pick`: each way of doing it in this scene (from a table, out of a fridge) is one
ground action that has the preconditions and effects of both. Predicates that were learned are read off boxes, joints
and the contact graph by their expressions; those of PDDL are the chain's where it has them, else what operators make
true.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.learned_domain import LearnedDomainFile
from scenewright.schemas.outside import LARGEST_SETTINGS, file_text
from scenewright.schemas.plan import Check
from scenewright.stages.kit.predicates.evaluating import Evaluator
from scenewright.stages.kit.predicates.expressions import Predicate, check, read
from scenewright.stages.kit.predicates.goal_sentences import read_goal
from scenewright.stages.kit.predicates.room import ROOM_WORDS, perceive
from scenewright.stages.kit.simulation.urdf_split import PART_SEPARATOR
from scenewright.stages.kit.tasks.pddl import parse_domain
from scenewright.stages.kit.tasks.strips import Atom, Domain, GroundAction, Problem, Schema, positive_task
from scenewright.stages.plan.action import action_named, all_actions
from scenewright.stages.plan.domain import DOMAIN
from scenewright.stages.plan.world_model import WorldModel

FAMILIES = {"pick": ("pick", "lift", "take_out"), "place": ("place", "stack")}
"""Operators that several of the chain's schemas carry out; other names stand for the schema of that name."""
TAUGHT = "taught"
"""Added to the name of a learned predicate that the chain has with a meaning of its own."""
HINT = "docs/PLANNING.md, A domain of your own"


@dataclass(frozen=True)
class GivenDomain:
    """Operators and predicates as data."""

    source: str
    domain: Domain
    """Predicates of the same names as the chain's mean the same, those with a meaning of their own excepted."""
    meanings: Mapping[str, Predicate] = field(default_factory=dict)
    """Learned predicates, and those that they use."""
    seen: Mapping[str, int] = field(default_factory=dict)
    """Learned predicate -> arguments: those that plans are made with."""
    goals: Mapping[str, tuple[tuple[str, tuple[int, ...]], ...]] = field(default_factory=dict)
    """Part of a goal in words -> predicates, and which of the part's objects they are about."""

    def name_here(self, predicate: str) -> str:
        """Return what a predicate of the domain is called in the task: learned ones keep apart from the chain's."""
        return f"{predicate}-{TAUGHT}" if predicate in self.seen and predicate in DOMAIN.predicates else predicate

    def perceived(self, model: WorldModel, graph: ContactGraphFile) -> frozenset[Atom]:
        """Return which learned predicates hold in a scene as its graph has it."""
        if not self.seen:
            return frozenset()
        state = perceive(model.records.values(), graph, model.description)
        return frozenset(
            (self.name_here(name), *objects) for name, *objects in Evaluator(state, self.meanings).atoms(self.seen)
        )

    def check(self, model: WorldModel, graph: ContactGraphFile, atom: Atom, literal: str) -> Check | None:
        """Return whether a learned predicate holds in the end; None for a predicate that is the chain's."""
        name = next((each for each in self.seen if self.name_here(each) == atom[0]), None)
        if name is None:
            return None
        state = perceive(model.records.values(), graph, model.description)
        holds = Evaluator(state, self.meanings).holds((name, *atom[1:]))
        return Check(condition=literal, holds=holds, detail="by what was learned of it, read off the graph in the end")

    def in_words(self, sentence: str, objects: Mapping[str, str]) -> frozenset[Atom] | None:
        """Return the atoms of a goal in words that were taught, None where a part was not."""
        reading = read_goal(sentence, objects, self.goals)
        if reading.lacking:
            return None
        atoms: set[Atom] = set()
        for part, objects_named in reading.parts:
            atoms |= {
                (self.name_here(name), *(objects_named[argument] for argument in places))
                for name, places in self.goals[part]
            }
        return frozenset(atoms)

    def ungrounded(self, objects: Mapping[str, str], classes: Mapping[str, str]) -> tuple[str, ...]:
        """Return in words what nothing in the scene, or of the robot, stands for."""
        words = []
        added = {atom[0] for schema in self.domain.schemas for atom in schema.add}
        used = {atom[0] for schema in self.domain.schemas for atom in (*schema.preconditions, *schema.negative)}
        for name, kinds in self.domain.predicates.items():
            scene_kinds = DOMAIN.predicates.get(name)
            if name in self.seen or name in added or (scene_kinds is not None and len(scene_kinds) == len(kinds)):
                continue
            if name in used:
                words.append(f"predicate {name} of {len(kinds)} (no operator makes it true, nothing perceived is it)")
        for schema in self.domain.schemas:
            if not _ways(schema.name):
                words.append(f"operator {schema.name} (no motion of that name)")
        for kind in {kind for schema in self.domain.schemas for _, kind in schema.parameters if kind}:
            if not any(_is(self.domain, name, objects[name], classes.get(name, ""), kind) for name in objects):
                words.append(f"type {kind} (nothing here is one)")
        return tuple(sorted(words))

    def task(self, problem: Problem, classes: Mapping[str, str]) -> tuple[Problem, list[GroundAction]]:
        """Return the task of a problem of the chain (whose initial atoms hold the learned ones too) with this domain's
        operators: ground actions of the chain that one of its operators allows. `classes`: body -> class.

        Raises BadInput when not one of its operators can be done in the scene."""
        chain_task, own_actions = positive_task(DOMAIN, problem)
        domain_task, operators = self._ground(problem, classes)
        merged = [action for action in own_actions if not action_named(action.name).has_motion]
        before = len(merged)
        by_body: dict[tuple[str, ...], list[GroundAction]] = {}
        for operator in operators:
            for schema_name in _ways(operator.name):
                key = (schema_name, *operator.arguments[: _compared_count(schema_name)])
                by_body.setdefault(key, []).append(operator)
        for action in own_actions:
            for operator in by_body.get((action.name, *_bodies(action)), ()):
                merged.append(_both(action, operator))
            if _bodies(action) != action.arguments[: _compared_count(action.name)]:
                for operator in by_body.get((action.name, *action.arguments[: _compared_count(action.name)]), ()):
                    merged.append(_both(action, operator))
        if len(merged) == before:
            raise BadInput(f"{self.source}: none of its operators can be done in this scene", hint=HINT)
        false = frozenset(atom for atom in domain_task.initial if atom[0].startswith("not-"))
        return replace(chain_task, initial=chain_task.initial | false), _with_opposites(merged, chain_task.goal)

    def _ground(self, problem: Problem, classes: Mapping[str, str]) -> tuple[Problem, list[GroundAction]]:
        """Return the domain's ground actions; types are static predicates here, as a thing has several of them."""
        kinds = {kind for schema in self.domain.schemas for _, kind in schema.parameters if kind}
        bodies = frozenset(("is-body", name) for name in classes)
        typed = {
            (f"is-{kind}", name)
            for kind in kinds
            for name, object_type in problem.objects.items()
            if _is(self.domain, name, object_type, classes.get(name, ""), kind)
        }
        schemas = tuple(self._plain(schema) for schema in self.domain.schemas if _ways(schema.name))
        domain = Domain(self.domain.name, {}, {}, schemas)
        domain_problem = Problem(
            "given", dict.fromkeys(problem.objects, ""), problem.initial | bodies | typed, frozenset()
        )
        return positive_task(domain, domain_problem)

    def _plain(self, schema: Schema) -> Schema:
        """Return a schema without types, in the task's names."""

        def named(atoms: tuple[Atom, ...]) -> tuple[Atom, ...]:
            return tuple((self.name_here(atom[0]), *atom[1:]) for atom in atoms)

        of_types = tuple((f"is-{kind or 'body'}", name) for name, kind in schema.parameters if kind or self.seen)
        return replace(
            schema,
            parameters=tuple((name, "") for name, _ in schema.parameters),
            preconditions=(*named(schema.preconditions), *of_types),
            add=named(schema.add),
            delete=named(schema.delete),
            negative=named(schema.negative),
        )


def _ways(operator: str) -> tuple[str, ...]:
    """Return the chain's schemas that carry out an operator; none where there is no such motion."""
    schema_names = {schema.name for action in all_actions() if action.has_motion for schema in action.schemas}
    base = operator.split("-")[0]
    return tuple(name for name in FAMILIES.get(base, (base,)) if name in schema_names)


def _compared_count(schema_name: str) -> int:
    """Return how many of the first arguments have to be those of the operator: what is put needs a place too."""
    return 2 if action_named(schema_name).hand == "puts" else 1


def _bodies(action: GroundAction) -> tuple[str, ...]:
    """Return the arguments that are compared, the owners of joints for joints."""
    return tuple(name.split(PART_SEPARATOR)[0] for name in action.arguments[: _compared_count(action.name)])


def _is(domain: Domain, name: str, object_type: str, class_name: str, kind: str) -> bool:
    """Whether an object is of a type: its class, a type of the chain, or one above one of these in the domain."""
    if kind == class_name or (kind in DOMAIN.types and DOMAIN.is_a(object_type, kind)):
        return True
    below = [each for each, parent in domain.types.items() if parent == kind and each != kind]
    return any(_is(domain, name, object_type, class_name, each) for each in below)


def _both(action: GroundAction, operator: GroundAction) -> GroundAction:
    """Return what asks for both and has the effects of both."""
    preconditions = frozenset(atom for atom in operator.preconditions if not atom[0].startswith("is-"))
    add = action.add | operator.add
    delete = (action.delete | operator.delete) - add
    return replace(action, preconditions=action.preconditions | preconditions, add=add, delete=delete)


def _with_opposites(actions: list[GroundAction], goal: frozenset[Atom]) -> list[GroundAction]:
    """Return actions that keep the counterparts of negated atoms, whichever of the two domains changes these."""
    needed = {atom for action in actions for atom in action.preconditions} | goal
    tracked = {(atom[0].removeprefix("not-"), *atom[1:]) for atom in needed if atom[0].startswith("not-")}

    def opposite(atoms: frozenset[Atom]) -> frozenset[Atom]:
        return frozenset((f"not-{atom[0]}", *atom[1:]) for atom in atoms & tracked)

    def plain(atoms: frozenset[Atom]) -> frozenset[Atom]:
        return frozenset(atom for atom in atoms if not atom[0].startswith("not-"))

    return [
        replace(
            action,
            add=plain(action.add) | opposite(plain(action.delete)),
            delete=plain(action.delete) | opposite(plain(action.add)),
        )
        for action in actions
    ]


def read_given_domain(path: Path) -> GivenDomain:
    """Read `--domain`: a PDDL file, or the folder of a domain that was learned in rooms. Raises BadInput."""
    if path.is_dir():
        return _read_learned(path)
    domain = parse_domain(file_text(path, LARGEST_SETTINGS, hint=HINT))
    for name, kinds in domain.predicates.items():
        scene_kinds = DOMAIN.predicates.get(name)
        if scene_kinds is not None and len(scene_kinds) != len(kinds):
            raise BadInput(
                f"{path}: predicate {name} takes {len(kinds)} arguments, the scene's {name} {len(scene_kinds)}",
                hint=HINT,
            )
    return GivenDomain(str(path), domain)


def _read_learned(path: Path) -> GivenDomain:
    if not (path / "domain.json").is_file():
        raise BadInput(f"{path}: no domain.json there", hint="give the folder that `predicates teach` wrote, or PDDL")
    document = LearnedDomainFile.read(path / "domain.json")
    if document.setting != "room":
        raise BadInput(f"{path}: was learned in the kitchen of blocks, not in a room", hint="predicates teach --scene")
    meanings = {
        each.name: Predicate(each.name, each.arguments, read(each.means, f"{path}: {each.name}"))
        for each in document.predicates
    }
    check(meanings, ROOM_WORDS)
    domain = parse_domain(file_text(path / "domain.pddl", LARGEST_SETTINGS))
    for name in domain.predicates:
        if name not in meanings:
            raise BadInput(f"{path}: domain.pddl has {name}, domain.json has not", hint="teach it again")
    goals: dict[str, list[tuple[str, tuple[int, ...]]]] = {}
    for goal in document.goals:
        if goal.phrase >= len(document.phrases):
            raise BadInput(f"{path}: there is no phrase {goal.phrase}", hint="teach it again")
        goals.setdefault(goal.text, []).append((document.phrases[goal.phrase].predicate, goal.places))
    argument_kinds = {name: meanings[name].arguments for name in domain.predicates}
    return GivenDomain(str(path), domain, meanings, argument_kinds, {text: tuple(each) for text, each in goals.items()})
