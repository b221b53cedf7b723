"""Cups of a real kitchen put on its counter by `plan`, in the scene that the chain made of the log, after `make real`.

The robot starts where the camera was with most room around it: somebody stood there, inside the walls. A case is a cup
of the kitchen, told apart by eye (data/annotations/real); a seed is that of the planner. The goal names the largest
level top that no mask named: that this is the counter is not told to anyone. Where the cup came to rest is held against
the annotated counter.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.plan import Plan
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.kit.formats.trajectories import read_tum
from scenewright.stages.kit.geometry.boxes import transform_points_to_box, upright_box
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.truth import AnnotatedNode, read_support_annotation

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, statistic
from benchmarks.steps import made, opened

ANNOTATION = Path(__file__).resolve().parents[2] / "data" / "annotations" / "real" / "kitchen.json"
LOG = "kitchen"
COUNTER = "counter"
CUPS = ("cup_white", "cup_flower")
LOWEST_TOP = 0.6
"""Level tops on which things are put are higher [m]: not the floor, not seats."""
NEAR = 0.25
"""A cup of the map is the annotated one no farther than this from it [m]."""


class RealPlanParameters(Parameters):
    """Options of the experiment."""

    runs: Path = Field(Path("outputs/experiments/real"), description="Folder that `make real` wrote")


@dataclass(frozen=True)
class Put:
    """What came of one trial."""

    reached: bool
    """What `plan` says: the goal held at the end, in physics, in the reconstructed scene."""
    on_counter: bool
    """The cup rests within the outline of the annotated counter, above it."""
    status: str
    replanned: int
    why: str
    """The last failure, in words; empty when the goal was reached."""
    behind_wall: bool = False
    """The base was somewhere on the other side of an annotated wall than the camera: nobody knows what is there."""


def scene_folder(bench: Bench) -> Path:
    """The interactive scene of the log."""
    return Path(bench.parameters.runs, LOG, "interactive_scene")


def seeds_of(bench: Bench, case: str) -> list[str]:
    """Seeds of the planner, where `make real` has made the scene. Seed 0 was tried while this was written."""
    there = (scene_folder(bench) / "manifest.json").is_file()
    return [str(seed) for seed in range(1000, 1010)] if there else []


def level_area(node: GraphNode) -> float:
    """Area of the level tops of a thing on which others can be put [m^2]."""
    return sum(p.area for p in node.planes if p.horizontal and not p.hidden and p.center[2] > LOWEST_TOP)


def find_counter(graph: ContactGraphFile) -> str | None:
    """Return the unnamed thing with the largest level top, None where nothing has any."""
    unnamed = [node for node in graph.nodes if node.class_name == "object" and level_area(node) > 0]
    return max(unnamed, key=level_area).id if unnamed else None


def find_annotated(graph: ContactGraphFile, told: AnnotatedNode) -> str | None:
    """Return the node of the annotated thing's class that is nearest to it, None where none is within NEAR."""
    assert told.find.box is not None
    center = np.array(told.find.box.center)
    distances = {
        node.id: float(np.linalg.norm(np.array(node.box.center) - center))
        for node in graph.nodes
        if node.class_name == told.class_name and node.box is not None
    }
    nearest = min(distances, key=lambda name: distances[name], default=None)
    return nearest if nearest is not None and distances[nearest] < NEAR else None


def rests_on(node: GraphNode, counter: AnnotatedNode) -> bool:
    """Whether a thing's middle lies within the annotated outline, and not under its top."""
    assert counter.find.box is not None and node.box is not None
    box = counter.find.box
    yaw = np.radians(box.yaw_degrees)
    across = np.array(node.box.center) - np.array(box.center)
    turned = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]) @ across[:2]
    return bool(np.all(np.abs(turned) <= np.array(box.size[:2]) / 2) and across[2] > 0.25 * box.size[2])


def is_behind(walls: Sequence[AnnotatedNode], bases: np.ndarray, camera: np.ndarray) -> bool:
    """Whether any of the places (N, 2) of the base is beyond the middle plane of an annotated wall, along its length,
    seen from the `camera` (2,)."""
    for wall in walls:
        assert wall.find.box is not None
        box = upright_box(wall.find.box)
        thin = int(np.argmin(box.size[:2]))
        local = transform_points_to_box(box, np.column_stack([bases, np.full(len(bases), box.center[2])]))
        of_camera = transform_points_to_box(box, np.array([[*camera, box.center[2]]]))[0, thin]
        along = np.abs(local[:, 1 - thin]) < box.size[1 - thin] / 2
        if (along & (local[:, thin] * np.sign(of_camera) < 0)).any():
            return True
    return False


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Put]]:
    """Plan and execute; a cup or counter that the map does not have is a failure like any other."""
    scene = scene_folder(bench)
    graph = opened(InteractiveScene, scene).graph
    told = {node.name: node for node in read_support_annotation(ANNOTATION).nodes}
    walls = [node for node in told.values() if node.class_name == "wall"]
    sequence = scene.parent / "sequence"
    cameras = read_tum(opened(SequenceArtifact, sequence).path("trajectory.tum"))[1][:, :3, 3]
    for trial in trials:
        item, counter = find_annotated(graph, told[trial.case]), find_counter(graph)
        if item is None or counter is None:
            missing = trial.case if item is None else COUNTER
            yield trial, Put(False, False, "not_found", 0, f"{missing} is not in the map")
            continue
        goal = ["--goal", f"on({item},{counter})", "--seed", trial.seed]
        given = ("--scene", scene, "--sequence", sequence)
        plan = opened(Plan, made("plan", bench.folder(trial) / "plan", *given, *goal))
        reached = plan.info.status == "executed"
        on_counter = reached and rests_on(plan.graph.node(item), told[COUNTER])
        why = "" if reached or not plan.info.failures else plan.info.failures[-1].message
        behind = False
        if plan.path("trajectory.npz").is_file():
            with np.load(plan.path("trajectory.npz"), allow_pickle=False) as moved:
                behind = is_behind(walls, moved["executed_world_from_base"][:, :2, 3], cameras[:, :2].mean(axis=0))
        yield trial, Put(reached, on_counter, plan.info.status, len(plan.info.replanned), why, behind)


def share(name: str) -> Measure:
    """Share of the trials of which something holds [%]."""
    mean = statistic(name, np.mean)
    return Measure(lambda records: None if (value := mean(records)) is None else 100 * value, "%")


def write_failures(results: Results) -> None:
    """Write failures.md: why what was not reached was not."""
    lines = [f"- {trial}: {record.status}: {record.why}" for trial, record in results.records.items() if record.why]
    (results.bench.out / "failures.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


EXPERIMENT = Experiment(
    name="real_plan",
    title="A cup put on the counter of a real kitchen",
    simulated="The robot and physics; the kitchen is a recording, its scene what the chain made of it.",
    knows="The reconstructed scene, in which it is executed too: poses and shapes are those that the planner saw.",
    does_not_show=(
        "That it would work in the kitchen: the scene is executed in itself. What the map lacks on the "
        "counter, how cups slide and how far they are off is unknown. The worktop gave hardly any depth, so "
        "the cup is put on its front edge. One kitchen, two cups, thresholds set on this log; the goal's "
        "`object` was picked by its large level top."
    ),
    arms={"ours": "ours"},
    cases=CUPS,
    seeds_of=seeds_of,
    measure=measure,
    record=Put,
    measures={
        "reached": share("reached"),
        "on_counter": share("on_counter"),
        "behind_wall": share("behind_wall"),
        "replanned": Measure(statistic("replanned", np.mean)),
    },
    quick_seeds=1,
    parameters=RealPlanParameters,
    places=frozenset({"runs"}),
    inputs=lambda bench, trial: [ANNOTATION, scene_folder(bench), scene_folder(bench).parent / "sequence"],
    steps=("plan",),
    pictures=write_failures,
)
