"""The part of tasks: sealed rooms, each with the tasks that are drawn from its truth, by each of the robot's eyes."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path

from pydantic import TypeAdapter
from scenewright.schemas.base import canonical_json

from benchmarks.board.inputs import RUNGS, RoomInputs
from benchmarks.board.method import Method, MethodFailed
from benchmarks.board.reconstruct import ARMS, reconstruct
from benchmarks.board.records import Line, Trial, judge_digest, key_of
from benchmarks.board.rooms import MOST_DRAWS, OURS, Setting, sealed_seed
from benchmarks.board.tasks.figures import failure_counts, task_shares
from benchmarks.board.tasks.running import EYES, MadeScene, TaskRecord, TaskRoom, run_tasks

ROOMS = 12
PART, RUNG, RECIPE = "tasks", "errors", "household"
"""The recipe whose rooms hold every kind of task."""
FIRST = 100
"""Number of the first sealed room of tasks; lower ones are of the scenes."""
JUDGES = (
    "benchmarks.board.tasks.running:run_tasks",
    "benchmarks.board.reconstruct:reconstruct",
    "benchmarks.board.inputs:Generator",
)
"""What of this checkout decides what a room's tasks come to."""
RECORD = TypeAdapter(TaskRecord)
"""Reads the record of a task."""


def measure_room(setting: Setting, number: int) -> Iterator[Line]:
    """Yield the lines of a sealed room, one for each of the eyes, kept or measured. Raises MethodFailed without one."""
    for draw in range(MOST_DRAWS):
        name = f"{RECIPE}-{sealed_seed(setting.method.digest, FIRST + number, draw)}"
        try:
            yield from measure_tasks(setting, name)
        except MethodFailed as error:
            if draw == MOST_DRAWS - 1 or error.command != "synthesize":
                raise
            continue
        return


def measure_tasks(setting: Setting, name: str) -> Iterator[Line]:
    """Yield the lines of a named room, one for each of the eyes. Raises MethodFailed where the room can't be made."""
    trials = [Trial(part=PART, case=eyes, seed=name, arm=OURS) for eyes in EYES]
    judge = judge_digest(JUDGES)
    keys = [key_of(trial, setting.method.digest, asdict(ARMS[OURS]), judge) for trial in trials]
    kept = [setting.read_kept(key) for key in keys]
    work = setting.work / f"{name}_tasks"
    if not all(kept):
        inputs = setting.generator.room(name, RUNGS[RUNG])
        made, seconds, problem = _scene(setting.method, inputs, work)
        room = TaskRoom(name, inputs.truth, int(name.rsplit("-", 1)[1]))
        for place, (trial, key) in enumerate(zip(trials, keys, strict=True)):
            if kept[place] is None:
                records = list(run_tasks(setting.method, room, made, work, trial.case))
                line = setting.line(trial, OURS, setting.method, **told_of(records, seconds, problem))
                kept[place] = setting.keep_line(line.model_copy(update={"key": key, "judge": judge}))
    yield from (line for line in kept if line is not None)
    if not setting.keep:
        shutil.rmtree(work, ignore_errors=True)


def _scene(method: Method, inputs: RoomInputs, work: Path) -> tuple[MadeScene | None, dict[str, float], str]:
    """Return the scene as a user makes it, laid to rest, processor seconds by step, and why there is none."""
    try:
        made, seconds = reconstruct(method, OURS, inputs, work)
        scene = made.arm / "scene_at_rest"
        seconds["urdf"] = method.run("urdf", scene, "--cad-scene", made.cad_scene)
    except MethodFailed as error:
        return None, {}, str(error)
    return MadeScene(made.sequence, made.panoptic_map, scene), seconds, ""


def told_of(records: list[TaskRecord], seconds: dict[str, float], problem: str = "") -> dict[str, dict[str, object]]:
    """Return figures, facts and seconds of a room's line: shares and counts, and each task's record as JSON."""
    figures: dict[str, object] = {"tasks": float(len(records)), "failed": float(bool(problem))}
    for name, share in task_shares(records).items():
        if share.value is not None:
            figures[name.split("/", 1)[1]] = round(share.value, 6)
    for kinds in failure_counts(records).values():
        figures |= {f"failed by {kind}": float(count) for kind, count in kinds.items()}
    facts: dict[str, object] = {str(record.task): canonical_json(asdict(record)) for record in records}
    spent: dict[str, object] = {**seconds, "plan": round(sum(record.seconds for record in records), 2)}
    return {"figures": figures, "facts": facts | ({"failed": problem} if problem else {}), "seconds": spent}


def records_of(lines: Iterable[Line]) -> list[TaskRecord]:
    """Return the records of the tasks in lines of this part."""
    texts = [text for line in lines for name, text in sorted(line.facts.items()) if name.isdigit()]
    return [RECORD.validate_json(text) for text in texts]
