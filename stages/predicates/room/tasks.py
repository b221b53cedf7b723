"""Tasks in rooms of the chain: some of a room's things, and a goal that a walk with the teacher's operators reaches."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.stages.kit.predicates.room import Body, RoomState, perceive
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.kit.tasks.strips import Atom, Problem, apply_action, ground
from scenewright.stages.predicates.room.world import RoomWorld
from scenewright.stages.predicates.tasks import Task
from scenewright.stages.predicates.truth import ROOM, truth_of

ITEMS, SUPPORTS, CONTAINERS = 4, 3, 2
"""Most things of each kind in a task: rooms have dozens, and what is learned is about pairs of them."""
WALK, LITERALS, TRIES = 6, 2, 200
"""Most actions of the walk whose end a goal is taken from, most literals of a goal, and most tries; by eye."""


@dataclass(frozen=True)
class RoomTask(Task):
    """A task with the room that it begins in; `objects`: where their middles are on the floor."""

    room: RoomState = RoomState({})

    def begun(self) -> RoomWorld:
        """Return the room as it begins."""
        return RoomWorld(self.room, self.seed)


def read_rooms(path: Path, robot: str) -> list[RoomState]:
    """Return what a robot perceives of the scenes of a folder: an interactive scene, the `room` of a ground truth, or a
    folder of these, by name. Raises BadInput where there is none, or one with nothing to pick up or put things on, and
    as `load_robot` does."""
    folders = [path] if (path / "scene.json").is_file() else sorted(each.parent for each in path.glob("**/scene.json"))
    if not folders:
        raise BadInput(f"{path}: no scene.json there or below", hint="give what `urdf` or `synthesize` wrote")
    described, rooms = load_robot(robot), []
    for folder in folders:
        scene = InteractiveSceneFile.read(folder / "scene.json")
        state = perceive(scene.bodies, ContactGraphFile.read(folder / "graph.json"), described)
        if not _kinds(state)[0] or not _kinds(state)[1]:
            raise BadInput(f"{folder}: nothing that a hand can take, or nothing to put it on", hint="another room")
        rooms.append(state)
    return rooms


def open_room(task: Task) -> RoomWorld:
    """Return the room of a task."""
    assert isinstance(task, RoomTask)
    return task.begun()


def _kinds(state: RoomState) -> tuple[list[str], list[str], list[str]]:
    """Return the names of items that the hand can take, of what carries things, and of what has doors."""
    items = [name for name, body in state.bodies.items() if body.width < state.hand_opening and not body.doors]
    doors = [name for name, body in state.bodies.items() if body.doors]
    surfaces = [name for name, body in state.bodies.items() if name not in (*items, *doors) and body.surface > 0.05]
    return items, surfaces, doors


def room_tasks(rooms: list[RoomState], count: int, seed: int) -> list[RoomTask]:
    """Return tasks in rooms, one room after the other. Raises BadInput when no goal is found in one of them."""
    drawn = (np.random.default_rng([seed, 5, number]) for number in range(count))
    return [_task(rooms[number % len(rooms)], number, random) for number, random in enumerate(drawn)]


def _task(room: RoomState, number: int, random: np.random.Generator) -> RoomTask:
    for _ in range(TRIES):
        state = _some(room, random)
        goal = _walk_goal(state, random)
        if goal:
            objects = {name: body.middle[:2] for name, body in state.bodies.items()}
            return RoomTask(f"{ROOM}/{number + 1}", objects, goal, int(random.integers(2**31)), room=state)
    raise BadInput("no goal was found for this room", hint="a room with more things in it")


def _some(room: RoomState, random: np.random.Generator) -> RoomState:
    """Return a room of some of its things, with what carries them; doors open or shut by chance."""
    kinds = _kinds(room)
    names: set[str] = set()
    for kind, most in zip(kinds, (ITEMS, SUPPORTS, CONTAINERS), strict=True):
        names |= {kind[index] for index in random.permutation(len(kind))[:most].tolist()}
    names |= {room.supported.get(name, room.contained.get(name, name)) for name in sorted(names & set(kinds[0]))}
    bodies: dict[str, Body] = {}
    for name in sorted(names):
        body = room.bodies[name]
        bodies[name] = replace(body, openness=float(random.random() < 0.5)) if body.doors else body
    return replace(
        room,
        bodies=bodies,
        supported={upper: lower for upper, lower in room.supported.items() if upper in bodies and lower in bodies},
        contained={upper: lower for upper, lower in room.contained.items() if upper in bodies and lower in bodies},
    )


def _walk_goal(state: RoomState, random: np.random.Generator) -> tuple[Atom, ...]:
    """Return what a walk with the teacher's operators made true, up to LITERALS of it."""
    truth = truth_of(ROOM)
    start = truth.atoms(state)
    problem = Problem("walk", dict.fromkeys(state.bodies, ""), start, frozenset())
    actions, atoms = ground(truth.operators, problem), start
    for _ in range(int(random.integers(1, WALK + 1))):
        possible = [action for action in actions if action.preconditions <= atoms]
        if not possible:
            break
        atoms = apply_action(atoms, possible[int(random.integers(len(possible)))])
    new_atoms = sorted(atom for atom in atoms - start if atom[0] in truth.file.goals)
    if not new_atoms or any(atom[0] == "holding" for atom in atoms):
        return ()
    drawn = random.permutation(len(new_atoms))[: int(random.integers(1, LITERALS + 1))]
    return tuple(new_atoms[index] for index in sorted(drawn.tolist()))
