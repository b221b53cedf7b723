"""Tasks of the board: drawn from the true room, given to a reconstructed scene or to the true room itself, carried out
and judged in the true one.

A map that lacks a thing fails the literals that name it; what is left is planned, so that its share is measured.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.plan import PlanFile
from scenewright.schemas.sequence import Sequence
from scenewright.stages.evaluate import load_truth

from benchmarks.board.method import Method, MethodFailed
from benchmarks.board.tasks.carrying import OPTIONS, Carried, Counterparts, carry, counterparts
from benchmarks.board.tasks.drawing import Task, draw_tasks
from benchmarks.board.tasks.room_facts import RoomFacts, room_facts
from benchmarks.board.tasks.true_end import Ending, read_ending, which_hold
from benchmarks.steps import opened, unrecorded

EYES = ("camera", "true")
"""What the robot sees by; with `true` it is told how things stand before it acts."""
CHEAP = ("--video-rate", 0, "--image-width", 64)
NOT_IN_MAP, NOT_USABLE, NO_SCENE, SOMETHING_ELSE = "not_in_map", "not_usable", "no_scene", "something_else"
"""Kinds of failure beside those of the plan: the map lacks a thing; it has it, but not as something that can be
carried, or without its doors; there is no scene; the plan went well by its own account, and the goal does not hold."""


@dataclass(frozen=True)
class TaskRoom:
    """A generated room whose tasks are tried."""

    name: str
    truth: Path
    """Artifact `ground_truth` with `room/`."""
    seed: int
    """Of the tasks that are drawn, and of the plans."""


@dataclass(frozen=True)
class MadeScene:
    """Artifacts that a method made of a room's log."""

    sequence: Path
    panoptic_map: Path
    scene: Path


@dataclass(frozen=True)
class TaskRecord:
    """What came of one task."""

    room: str
    task: int
    """Its number in the room."""
    kind: str
    eyes: str
    goal: tuple[str, ...]
    """True literals that do not hold at the beginning."""
    keeps: tuple[str, ...]
    """True literals that have to hold still."""
    asked: tuple[str, ...]
    """What the plan was asked for, in the reconstruction's names; empty: nothing was planned."""
    lacking: tuple[str, ...]
    """Things of the task that the map does not have."""
    holds: tuple[bool, ...]
    """For each literal of `goal`, whether it holds in the true room in the end."""
    success: bool
    """All of `goal` and `keeps` hold, and the map lacked nothing."""
    status: str
    """Of the plan; `refused` where its command failed, `not_planned` where nothing could be asked for."""
    failure: str
    """Kind of the failure, empty for a success."""
    actions: int
    seconds: float
    """Processor seconds of the plan and its execution."""


def facts_of(truth: Path) -> RoomFacts:
    """Return what the tasks of a room are drawn from. Raises BadInput for a truth that can't be read."""
    artifact = opened(GroundTruth, truth)
    room = load_truth(artifact, np.eye(4), OPTIONS.minimum_visible_points)
    return room_facts(artifact.path("room"), artifact.graph, [entry.name for entry in room.evaluated()])


def run_tasks(method: Method, room: TaskRoom, made: MadeScene | None, scratch: Path, eyes: str) -> Iterator[TaskRecord]:
    """Yield what came of each task of a room, by some eyes. Plans are written to folders of `scratch`.

    `made` None: the method makes no scene of this room, and fails every task. Raises BadInput for a truth that can't
    be read, or artifacts of the method that this program can't read.
    """
    known = None if made is None else _counterparts(room, made)
    for number, task in enumerate(draw_tasks(facts_of(room.truth), room.seed)):
        carried = Carried((), ()) if known is None else carry(task, known)
        if made is None or not carried.literals:
            found = _nothing_planned()
        else:
            found = _planned(method, room, made, carried.literals, scratch / f"{number}_{eyes}", eyes)
        yield _record(room, number, task, eyes, carried, found, has_scene=known is not None)


def run_true_room(room: TaskRoom, scratch: Path, eyes: str, robot: str) -> Iterator[TaskRecord]:
    """Yield what came of each task of a room, by some eyes and a named robot, where the planned scene is the true room:
    a perfect map. Plans are written to folders of `scratch`, by this checkout. Raises BadInput for a truth that can't
    be read."""
    for number, task in enumerate(draw_tasks(facts_of(room.truth), room.seed)):
        carried = Carried(task.literals(), ())
        found = _planned_truth(room, carried.literals, scratch / f"{number}_{eyes}", eyes, robot)
        yield _record(room, number, task, eyes, carried, found, has_scene=True)


def _counterparts(room: TaskRoom, made: MadeScene) -> Counterparts:
    pose = np.array(opened(Sequence, made.sequence).info.gravity.world_from_log)
    truth = load_truth(opened(GroundTruth, room.truth), pose, OPTIONS.minimum_visible_points)
    return counterparts(truth, made.panoptic_map, made.scene)


@dataclass(frozen=True)
class _Found:
    """What the method did."""

    status: str
    failure: str
    actions: int
    seconds: float
    ending: Ending


def _nothing_planned() -> _Found:
    return _Found("not_planned", NOT_USABLE, 0, 0.0, Ending())


def _planned(
    method: Method, room: TaskRoom, made: MadeScene, literals: tuple[str, ...], out: Path, eyes: str
) -> _Found:
    goal = [word for literal in literals for word in ("--goal", literal)]
    given: tuple[object, ...] = ("--scene", made.scene, "--ground-truth", room.truth, *goal, "--eyes", eyes)
    try:
        seconds = method.run("plan", out, *given, *CHEAP, "--seed", room.seed)
    except MethodFailed as failed:
        return _Found("refused", f"exit_{failed.exit_code}", 0, 0.0, Ending())
    return _read_plan(out, seconds)


def _planned_truth(room: TaskRoom, literals: tuple[str, ...], out: Path, eyes: str, robot: str) -> _Found:
    shutil.rmtree(out, ignore_errors=True)
    truth, start = opened(GroundTruth, room.truth), time.process_time()
    scene = InteractiveScene(truth.path("room"))
    given = {"goal": literals, "eyes": eyes, "robot": robot, "video_rate": 0, "image_width": 64}
    unrecorded("plan", out, given, seed=room.seed, scene=scene, ground_truth=truth)
    return _read_plan(out, round(time.process_time() - start, 2))


def _read_plan(out: Path, seconds: float) -> _Found:
    plan = PlanFile.read(out / "plan.json")
    failure = plan.failures[-1].kind if plan.failures and plan.status != "executed" else ""
    log = out / "execution.mcap"
    ending = read_ending(log) if log.is_file() else Ending()
    return _Found(plan.status, failure, len(plan.actions), seconds, ending)


def _record(
    room: TaskRoom, number: int, task: Task, eyes: str, carried: Carried, found: _Found, *, has_scene: bool
) -> TaskRecord:
    held = which_hold(room.truth / "room", found.ending, task.literals())
    whole = has_scene and not carried.lacking
    success = all(held) and whole
    return TaskRecord(
        room=room.name,
        task=number,
        kind=task.kind,
        eyes=eyes,
        goal=task.goal,
        keeps=task.keeps,
        asked=carried.literals,
        lacking=carried.lacking,
        holds=held[: len(task.goal)],
        success=success,
        status=found.status,
        failure="" if success else _failure(task, carried, found, has_scene=has_scene),
        actions=found.actions,
        seconds=found.seconds,
    )


def _failure(task: Task, carried: Carried, found: _Found, *, has_scene: bool) -> str:
    if not has_scene:
        return NO_SCENE
    if carried.lacking:
        return NOT_IN_MAP
    if len(carried.literals) < len(task.literals()):
        return NOT_USABLE
    return found.failure or SOMETHING_ELSE
