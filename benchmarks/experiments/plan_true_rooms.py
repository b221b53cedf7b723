"""Tasks of the board by `plan` where the map is right: the true room is the planned scene, and where it is carried out.

What fails here, no mapping mends. Rooms are of the board's generator and recipe, tasks are drawn and judged as the
board draws and judges them. A seed is a room; `true`: the robot is told how things stand, `camera`: it looks. Other
arms are told.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from pydantic import Field
from scenewright.stages.kit.stage import Parameters

from benchmarks.board.inputs import RUNGS, Generator
from benchmarks.board.tasks.drawing import KINDS
from benchmarks.board.tasks.measuring import RECIPE, RUNG
from benchmarks.board.tasks.running import TaskRecord, TaskRoom, run_true_room
from benchmarks.experiment import Bench, Experiment, Measure, Pooled, Results, Share, Trial

TASKS = "tasks"
ARMS = {
    "true": ("true", "panda", "told how things stand"),
    "camera": ("camera", "panda", "by its own eyes"),
    "ur5e": ("true", "ur5e", "told, with a UR5e"),
    "xarm7": ("true", "xarm7", "told, with an xArm 7"),
}
"""Arm of the experiment -> eyes, robot, in words."""
TUNING = tuple(f"{RECIPE}-{seed}" for seed in (9001, 9002, 9003, *range(5101, 5115), 6201))
"""Rooms whose failures were looked at while the planner was mended."""
REPORTING = tuple(f"{RECIPE}-{seed}" for seed in range(6202, 6223))


class TrueRoomParameters(Parameters):
    """Options of the experiment."""

    board: Path = Field(Path("outputs/board"), description="Folder in which the board's rooms are made and kept")


@dataclass(frozen=True)
class RoomTasks:
    """What came of the tasks of one room."""

    tasks: tuple[TaskRecord, ...]


def truth_of(bench: Bench, name: str) -> Path:
    """Return the truth of a room, made where it is missing. Raises MethodFailed for a seed without a room."""
    return Generator(bench.parameters.board).truth(name, RUNGS[RUNG])


def prepare(bench: Bench, trials: Sequence[Trial]) -> None:
    """Make the library and the rooms."""
    Generator(bench.parameters.board).prepare()
    for name in sorted({trial.seed for trial in trials}):
        truth_of(bench, name)


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, RoomTasks]]:
    """Yield what came of the tasks of rooms."""
    for trial in trials:
        eyes, robot, _ = ARMS[trial.arm]
        room = TaskRoom(trial.seed, truth_of(bench, trial.seed), int(trial.seed.rsplit("-", 1)[1]))
        yield trial, RoomTasks(tuple(run_true_room(room, bench.folder(trial), eyes, robot)))


def of_kind(kind: str, record: RoomTasks) -> RoomTasks | None:
    """Return the tasks of a kind, None where there are none."""
    own = tuple(task for task in record.tasks if task.kind == kind)
    return replace(record, tasks=own) if own else None


def share(of: Callable[[TaskRecord], bool]) -> Measure:
    """Return the share of tasks of which something holds, intervals over rooms."""
    return Measure(Share(lambda record: (float(sum(map(of, record.tasks))), float(len(record.tasks)))))


def write_failures(results: Results) -> None:
    """Write failures.md: how many tasks each kind of failure ended, and which."""
    lines = []
    for trial, record in results.records.items():
        if trial.case == TASKS:
            lines += [
                f"{trial.arm}: {task.failure}: {task.room} {task.task} {task.kind} {', '.join(task.goal)}"
                for task in record.tasks
                if not task.success
            ]
    counts = Counter(line.split(": ")[1] for line in lines)
    told = [f"{number} {kind}" for kind, number in counts.most_common()]
    (results.bench.out / "failures.md").write_text("\n".join([*told, "", *sorted(lines)]) + "\n", encoding="utf-8")


EXPERIMENT = Experiment(
    name="plan_true_rooms",
    title="Tasks of the board with a perfect map",
    simulated="Rooms, robot and physics.",
    knows="The true room: shapes, poses, joints, who stands on what. With the eyes `camera` it looks all the same.",
    does_not_show="What a map's errors cost: the board does. Tasks are drawn for the hand of a Panda.",
    arms={name: words for name, (*_, words) in ARMS.items()},
    cases=(TASKS,),
    tuning=TUNING,
    reporting=REPORTING,
    measure=measure,
    record=RoomTasks,
    measures={
        "success": share(lambda task: task.success),
        "tasks": Measure(lambda records: float(sum(len(record.tasks) for record in records)), interval=False),
        "seconds": Measure(Pooled(lambda record: (sum(task.seconds for task in record.tasks), len(record.tasks))), "s"),
    },
    subcases={TASKS: (TASKS, lambda record: record)} | {kind: (TASKS, partial(of_kind, kind)) for kind in KINDS},
    default_arms=lambda bench: ("true",),
    quick_seeds=1,
    parameters=TrueRoomParameters,
    places=frozenset({"board"}),
    inputs=lambda bench, trial: [truth_of(bench, trial.seed)],
    prepare=prepare,
    steps=("plan",),
    pairs=tuple((name, "true") for name in ARMS if name != "true"),
    compared=("success",),
    pictures=write_failures,
)
