"""What a failed motion teaches the task search: which ground actions to leave out, or to do only after something else.

A failure names its cause. What is too wide cannot be picked up from anywhere; what is out of reach where it stands,
by no way of taking it. What a thing that can be moved stands in the way of is tried again once that was moved; what a
door stands in the way of, once the door is as it was not. Only causes that say nothing more block one ground action.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from scenewright.schemas.plan import Failure
from scenewright.stages.kit.simulation.urdf_split import PART_SEPARATOR
from scenewright.stages.kit.tasks.strips import Atom, GroundAction, atom_text
from scenewright.stages.plan.action import schemas_of_hand

TAKING, PUTTING = schemas_of_hand("takes"), schemas_of_hand("puts")
"""Schemas of actions that take something into the hand, and that put it down."""
MOVED = "moved"
"""Predicate that is added to the task: the thing was taken at least once."""
Key = tuple[str, tuple[str, ...]]


@dataclass
class Lessons:
    """Changes to the ground actions of a task, and each of them in words."""

    held: str | None = None
    """What the hand holds in the first state: it may have to be taken otherwise."""
    blocked: set[Key] = field(default_factory=set)
    needs: dict[Key, frozenset[Atom]] = field(default_factory=dict)
    """Further preconditions; `moved(NAME)` becomes true when NAME is picked up."""
    words: list[str] = field(default_factory=list)

    def apply(self, actions: list[GroundAction]) -> list[GroundAction]:
        """Return the actions that are left, with what was learned built in."""
        to_move = {atom[1] for atoms in self.needs.values() for atom in atoms if atom[0] == MOVED}
        changed = []
        for action in actions:
            key = (action.name, action.arguments)
            if key in self.blocked:
                continue
            if key in self.needs:
                action = replace(action, preconditions=action.preconditions | self.needs[key])
            if action.name in TAKING and action.arguments[0] in to_move:
                action = replace(action, add=action.add | {(MOVED, action.arguments[0])})
            changed.append(action)
        return changed

    def learn(
        self, action: GroundAction, failure: Failure, actions: list[GroundAction], state: frozenset[Atom]
    ) -> None:
        """Take in that an action has no motion in a state. `actions` are all of the task, unchanged."""
        key = (action.name, action.arguments)
        further = self._instead(action, failure, actions, state)
        if further is not None and further not in self.needs.get(key, frozenset()):
            self.needs[key] = self.needs.get(key, frozenset()) | {further}
            self.words.append(f"{action.text} is tried again after {atom_text(further)}")
            return
        same = self._same_cause(action, failure, actions)
        self.blocked |= {(same_cause.name, same_cause.arguments) for same_cause in same}
        others = f" and {len(same) - 1} more that fail for the same reason" if len(same) > 1 else ""
        self.words.append(f"{action.text}{others} is not tried again: {failure.kind}")

    def _instead(
        self, action: GroundAction, failure: Failure, actions: list[GroundAction], state: frozenset[Atom]
    ) -> Atom | None:
        """Return what should be true first so that the cause goes away, None when nothing would do that."""
        if failure.kind not in ("goal_in_collision", "no_path", "start_in_collision") or not failure.objects:
            return None
        name = failure.objects[-1]
        body = name.split(PART_SEPARATOR)[0]
        if body not in action.arguments and any(a.name in TAKING and a.arguments[0] == body for a in actions):
            return (MOVED, body)
        if action.name in PUTTING and action.arguments[0] == self.held:
            return (MOVED, self.held)  # put down somewhere and taken again, by another grasp
        if PART_SEPARATOR not in name:
            return None
        doors = {atom for candidate in actions for atom in candidate.add if atom[0] in ("open", "closed")}
        for joint in sorted({atom[1] for atom in doors if atom[1].startswith(f"{name}_") or atom[1] == name}):
            now = "open" if ("open", joint) in state else "closed"
            opposite = ("closed" if now == "open" else "open", joint)
            if opposite in doors and joint not in action.arguments:
                return opposite
        return None

    @staticmethod
    def _same_cause(action: GroundAction, failure: Failure, actions: list[GroundAction]) -> list[GroundAction]:
        """Return the ground actions that fail for the same reason, the failed one first."""
        same = [action]
        unreachable = failure.kind == "no_inverse_kinematics" and (
            failure.numbers.get("unreachable") == failure.numbers.get("tried")
        )
        for candidate in actions:
            if (candidate.name, candidate.arguments) == (action.name, action.arguments):
                continue
            takes_same = (
                action.name in TAKING and candidate.name in TAKING and candidate.arguments[0] == action.arguments[0]
            )
            beside = takes_same and candidate.arguments[1] == action.arguments[1]
            if (failure.kind == "no_grasp" and takes_same) or (unreachable and beside):
                same.append(candidate)
        return same
