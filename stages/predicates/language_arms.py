"""Rivals of learning that ask a language model what to do: Inner Monologue (three kinds) and Code as Policies.

Han 2024, section 5.5. `objects` is told what there is, `scene` also which learned predicates hold, `preconditions` also
the learned operators, and a step that they don't allow goes back to it, at most three times. Code as Policies writes
one program for the goal, with its assertions; it is a list of steps as data here, and nothing of it is run as code.
"""

from __future__ import annotations

import json
from typing import Literal

from pydantic import Field
from scenewright.schemas.base import Model
from scenewright.stages.kit.language.chat import Chat
from scenewright.stages.kit.language.failures import LanguageFailed
from scenewright.stages.kit.language.messages import say
from scenewright.stages.kit.language.reply_schema import schema_of
from scenewright.stages.kit.tasks.strips import Atom, Domain, Problem, ground
from scenewright.stages.predicates.execution import MOST_FAILURES, MOST_STEPS, Attempt, World, action_atom
from scenewright.stages.predicates.learning.memory import Memory
from scenewright.stages.predicates.tasks import Task
from scenewright.stages.predicates.truth import truth_of

Kind = Literal["objects", "scene", "preconditions"]
REPLANS = 3
"""Most times that a step which the learned operators don't allow is asked for anew."""


class NextStep(Model):
    """The next action; `done` when the goal is reached."""

    action: str = Field(max_length=100)
    objects: tuple[str, ...] = Field(max_length=2)


class Statement(Model):
    """One line of a program: do an action, or assert that a predicate holds (else the program ends)."""

    do: Literal["action", "assert"]
    name: str = Field(max_length=200)
    objects: tuple[str, ...] = Field(max_length=2)


class Program(Model):
    """A program for a goal."""

    statements: tuple[Statement, ...] = Field(max_length=60)


def inner_monologue(
    task: Task, world: World, chat: Chat, actions: dict[str, int], kind: Kind, memory: Memory
) -> Attempt:
    """Try a task by asking for one action after the other, and telling what came of each."""
    result = Attempt()
    history: list[str] = []
    failures = 0
    domain = memory.domain("learned") if kind == "preconditions" else None
    while len(result.steps) < MOST_STEPS and failures < MOST_FAILURES:
        step = _ask_step(task, world, chat, actions, kind, memory, history, domain)
        if step is None or step[0] == "done":
            result.unplanned = "" if step else "no action was named that there is"
            break
        reason = world.do(step)
        result.steps.append((step, reason))
        history.append(f"{' '.join(step)}: {reason or 'done'}")
        failures = failures + 1 if reason else 0
    result.success = set(task.goal) <= truth_of(task.name.split("/")[0]).atoms(world.state())
    return result


def _ask_step(
    task: Task,
    world: World,
    chat: Chat,
    actions: dict[str, int],
    kind: Kind,
    memory: Memory,
    told: list[str],
    domain: Domain | None,
) -> Atom | None:
    state = world.state()
    facts = {"goal": task.sentence, "objects": list(state.names), "actions": actions, "so far": list(told)}
    atoms = memory.see(state) if kind != "objects" else frozenset()
    if kind != "objects":
        facts["holds"] = sorted(" ".join(atom) for atom in atoms)
    for _ in range(REPLANS + 1):
        try:
            reply = chat.ask((say("system", STEP), say("user", json.dumps(facts, sort_keys=True))), schema_of(NextStep))
        except LanguageFailed:
            return None
        step = (reply.action, *reply.objects)
        if reply.action == "done":
            return ("done",)
        is_action = actions.get(reply.action) == len(reply.objects) and set(reply.objects) <= set(state.names)
        if is_action and (domain is None or _is_allowed(domain, step, state.names, atoms)):
            return step
        facts["refused"] = (
            f"{' '.join(step)}: {'its preconditions do not hold' if is_action else 'there is no such action'}"
        )
    return None


def _is_allowed(domain: Domain, step: Atom, names: tuple[str, ...], held: frozenset[Atom]) -> bool:
    problem = Problem("now", dict.fromkeys(names, ""), held, frozenset())
    return any(action_atom(each) == step and each.preconditions <= held for each in ground(domain, problem))


def code_as_policies(task: Task, world: World, chat: Chat, actions: dict[str, int], memory: Memory) -> Attempt:
    """Try a task by one program, to its end, its first failure or its first assertion that does not hold."""
    result = Attempt()
    state = world.state()
    predicates = memory.used()
    facts = {"goal": task.sentence, "objects": list(state.names), "actions": actions, "predicates": predicates}
    try:
        program = chat.ask((say("system", CODE), say("user", json.dumps(facts, sort_keys=True))), schema_of(Program))
    except LanguageFailed as error:
        return Attempt(unplanned=str(error))
    for line in program.statements[:MOST_STEPS]:
        takes_objects = (actions if line.do == "action" else predicates).get(line.name) == len(line.objects)
        if not takes_objects or not set(line.objects) <= set(state.names):
            result.unplanned = f"the program names {line.name} {' '.join(line.objects)}, which there is not"
            break
        if line.do == "assert":
            if (line.name, *line.objects) not in memory.see(world.state()):
                result.unplanned = f"asserted in vain: {line.name} {' '.join(line.objects)}"
                break
            continue
        reason = world.do((line.name, *line.objects))
        result.steps.append(((line.name, *line.objects), reason))
        if reason:
            break
    result.success = set(task.goal) <= truth_of(task.name.split("/")[0]).atoms(world.state())
    return result


STEP = (
    "You control a robot gripper. Name the next action towards the goal, by name and objects in order; `actions` says "
    "how many each takes; `done` without objects when the goal is reached. What was done is told with what came of it."
)
CODE = (
    "Write a program for a robot gripper that reaches the goal: statements that do an action, or assert that a "
    "predicate holds before the next one. Numbers say how many objects each takes."
)
