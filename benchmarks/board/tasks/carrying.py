"""From true names to those of a reconstructed scene: by the points that true things and entities of the map share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.interactive_scene import InteractiveScene, SceneBody
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.evaluate import EvaluateParameters, TrueRoom, label_true_points, load_map, point_overlaps
from scipy.optimize import linear_sum_assignment

from benchmarks.board.tasks.drawing import Task
from benchmarks.board.tasks.literals import names_of, parts, renamed
from benchmarks.steps import opened

OPTIONS = EvaluateParameters.model_validate({})


@dataclass(frozen=True)
class Counterparts:
    """What stands for true things in a reconstructed scene."""

    found: dict[str, str]
    """True name -> the graph's, one to one: the map has it."""
    bodies: dict[str, SceneBody]
    """The scene's bodies by name."""

    def serves(self, literal: str) -> bool:
        """Whether the scene has all things of a literal, and as what the literal needs: something that can be carried,
        furniture that has doors or drawers."""
        predicate, names = parts(literal)
        if any(self.found.get(name) not in self.bodies for name in names):
            return False
        records = [self.bodies[self.found[name]] for name in names]
        carried = predicate not in ("on", "in") or records[0].carriable
        return carried and (predicate == "on" or bool(records[-1].joints))


@dataclass(frozen=True)
class Carried:
    """A task as the reconstructed scene can be given it."""

    literals: tuple[str, ...]
    """In the scene's names; fewer than the task has where the scene lacks things, none where it has nothing of the
    goal."""
    lacking: tuple[str, ...]
    """True names of the task's things that the map does not have."""


def carry(task: Task, counterparts: Counterparts) -> Carried:
    """Return what of a task can be asked for in a reconstructed scene, and which of its things the map lacks."""
    literals = task.literals()
    served = [literal for literal in literals if counterparts.serves(literal)]
    asked = served if set(served) & set(task.goal) else []
    lacking = tuple(name for name in names_of(literals) if name not in counterparts.found)
    return Carried(tuple(renamed(literal, counterparts.found) for literal in asked), lacking)


def counterparts(truth: TrueRoom, panoptic_map: Path, scene: Path) -> Counterparts:
    """Return what stands for the true things of a room in a map and the scene made of it. Raises BadInput."""
    predicted = load_map(opened(PanopticMap, panoptic_map))
    labels = label_true_points(truth, predicted, OPTIONS.label_distance)
    artifact = opened(InteractiveScene, scene)
    nodes = {node.instance: node.id for node in artifact.graph.nodes if node.node_type != "scene"}
    overlaps = point_overlaps(truth, labels, predicted.classes())
    pairs = one_to_one(overlaps, {entry.instance for entry in truth.objects}, nodes, OPTIONS.node_match_iou)
    true_names = {entry.instance: entry.name for entry in truth.objects}
    found = {true_names[true]: nodes[entity] for true, entity in pairs.items()}
    return Counterparts(found, {body.name: body for body in artifact.info.bodies})


def one_to_one(
    overlaps: Mapping[tuple[int, int], float], true: Iterable[int], predicted: Iterable[int], least: float
) -> dict[int, int]:
    """Return true instance -> predicted one: pairs that overlap by `least` (IoU) or more, with the greatest sum."""
    rows, columns = sorted(true), sorted(predicted)
    shared = np.array([[overlaps.get((row, column), 0.0) for column in columns] for row in rows])
    shared = np.where(shared >= least, shared, 0.0).reshape(len(rows), len(columns))
    pairs = zip(*linear_sum_assignment(-shared), strict=True)
    return {rows[i]: columns[j] for i, j in pairs if shared[i, j] > 0}
