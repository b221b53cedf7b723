"""Doors and drawers that a log shows in two states: their joints from the motion alone (`articulate`).

Generated rooms are recorded twice: there, and back after somebody opened or shut one door or drawer of every thing that
has any (`synthesize --opened`). Arms: `ours`; `registration`, which aligns what left with the nearest
of what came by point-to-plane ICP and takes the screw of that motion apart, knowing nothing of leaves and hinges.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import open3d as o3d
from scenewright.schemas.articulations import Articulation
from scenewright.schemas.cad_library import CadLibrary, CadModel
from scenewright.schemas.ground_truth import GroundTruth, TrueObject
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.articulate import ArticulateParameters
from scenewright.stages.articulate.joints import Cloud
from scenewright.stages.articulate.stage import Used, gather, grid_of, regions_of, run, watch
from scenewright.stages.kit.formats.cad_models import load_collision_parts, model_folder, part_transforms
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.transforms import apply
from scipy.optimize import linear_sum_assignment
from scipy.spatial.transform import Rotation

from benchmarks.experiment import Bench, Experiment, Measure, Trial, median
from benchmarks.generated_rooms import STEPS, make_library, make_room
from benchmarks.steps import context_in, opened

TUNING = ("kitchen-40", "office-41", "bedroom-40")
REPORTING = (*(f"kitchen-{seed}" for seed in range(1700, 1704)), "office-1700", "bedroom-1700")
FRAMES, SIZE, OPENED = 120, (480, 360), 8
PLACE = 0.35
"""A joint that was found is that of the part whose middle lies nearest to its leaf's, this far at most [m]."""
TURN = 0.05
"""A motion that turns by less slides [rad]."""


@dataclass(frozen=True)
class TrueMotion:
    """What moved in a room. World frame."""

    type: Literal["revolute", "prismatic"]
    axis: np.ndarray
    origin: np.ndarray
    travel: float
    middle: np.ndarray
    """(3,) of the moving part in the first state [m]."""


@dataclass(frozen=True)
class Moved:
    """What an arm makes of a room."""

    true: int
    """Doors and drawers that were moved, whether the camera saw them well or not."""
    found: int
    """Of these, at the right place with a joint of the right kind."""
    wrong_kind: int
    false: int
    """Joints where nothing was moved."""
    axis_errors: tuple[float, ...]
    """[deg]."""
    offset_errors: tuple[float, ...]
    """Of hinges: distance of the true from the found axis, at the part's height [m]."""
    turn_errors: tuple[float, ...]
    """[deg]."""
    slide_errors: tuple[float, ...]
    """[m]."""
    frame_ms: float
    """Processor time a frame."""


def true_motions(truth: GroundTruth, library: CadLibrary, world_from_log: np.ndarray) -> list[TrueMotion]:
    """Return the joints that were moved, from the first state to the second."""
    models = {model.id: model for model in library.info.models}
    motions = []
    for thing in truth.info.objects:
        if thing.joints_before is None or thing.model_id is None:
            continue
        model = models[thing.model_id]
        motions += [
            _motion(library, model, thing, name, world_from_log)
            for name, value in thing.joints.items()
            if value != thing.joints_before[name]
        ]
    return motions


def _motion(
    library: CadLibrary, model: CadModel, thing: TrueObject, name: str, world_from_log: np.ndarray
) -> TrueMotion:
    joint = next(entry for entry in model.joints if entry.name == name)
    assert thing.joints_before is not None
    world = world_from_log @ np.array(thing.world_from_model)
    change = thing.joints[name] - thing.joints_before[name]
    pieces = load_collision_parts(model_folder(library, model.id))[joint.part]
    corners = np.concatenate([np.asarray(piece.vertices) for piece in pieces])
    placed = thing.scale * apply(part_transforms(model, thing.joints_before)[joint.part], corners)
    length = thing.scale if joint.type == "prismatic" else 1.0
    return TrueMotion(
        joint.type,
        np.sign(change) * world[:3, :3] @ np.asarray(joint.axis),
        apply(world, thing.scale * np.asarray(joint.origin)),
        abs(change) * length,
        apply(world, 0.5 * (placed.min(axis=0) + placed.max(axis=0))),
    )


def judge(found: Sequence[Articulation], true: Sequence[TrueMotion], frame_ms: float) -> Moved:
    """Compare what was found with what was moved."""
    pairs: list[tuple[Articulation, TrueMotion]] = []
    if found and true:
        leaves = np.array([np.mean(entry.leaf, axis=0) for entry in found])
        far = np.linalg.norm(leaves[:, None] - np.array([motion.middle for motion in true])[None], axis=2)
        rows, columns = linear_sum_assignment(np.minimum(far, 10 * PLACE))
        pairs = [(found[i], true[j]) for i, j in zip(rows, columns, strict=True) if far[i, j] <= PLACE]
    same = [(entry, motion) for entry, motion in pairs if entry.type == motion.type]
    turns = [(entry, motion) for entry, motion in same if motion.type == "revolute"]
    slides = [(entry, motion) for entry, motion in same if motion.type == "prismatic"]
    return Moved(
        true=len(true),
        found=len(same),
        wrong_kind=len(pairs) - len(same),
        false=len(found) - len(pairs),
        axis_errors=tuple(
            float(np.degrees(np.arccos(np.clip(np.dot(entry.axis, motion.axis), -1, 1)))) for entry, motion in same
        ),
        offset_errors=tuple(
            float(np.linalg.norm(np.cross(np.asarray(entry.origin) - motion.origin, motion.axis)))
            for entry, motion in turns
        ),
        turn_errors=tuple(float(np.degrees(abs(entry.travel - motion.travel))) for entry, motion in turns),
        slide_errors=tuple(abs(entry.travel - motion.travel) for entry, motion in slides),
        frame_ms=frame_ms,
    )


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Moved]]:
    """Yield what every arm makes of one room."""
    room = make_room(Path(bench.out, "rooms"), trials[0].seed, FRAMES, size=SIZE, opened=OPENED)
    library = opened(CadLibrary, make_library(Path(bench.out, "rooms")))
    sequence = opened(SequenceArtifact, room.sequence)
    world_from_log = np.array(sequence.info.gravity.world_from_log)
    true = true_motions(opened(GroundTruth, room.ground_truth), library, world_from_log)
    for trial in trials:
        started = time.process_time()
        found = ARMS[trial.arm](sequence, bench.folder(trial))
        yield trial, judge(found, true, 1000 * (time.process_time() - started) / FRAMES)


def ours(sequence: SequenceArtifact, folder: Path) -> Sequence[Articulation]:
    """The step."""
    parameters = ArticulateParameters.model_validate({})
    return run(sequence, parameters=parameters, context=context_in(folder)).info.articulations


def registration(sequence: SequenceArtifact, folder: Path) -> list[Articulation]:
    """The same regions, each that was left registered with the nearest that something came to at that time."""
    parameters = ArticulateParameters.model_validate({})
    with FrameReader(sequence.path("frames.mcap")) as reader:
        used = Used(reader, None, parameters)
        grid = grid_of(used, parameters)
        watch(used, grid, parameters, context_in(folder).progress)
        regions = [regions_of(grid.moved_away, grid.left), regions_of(grid.moved_in, grid.came)]
        left, came = gather(used, grid, regions, parameters)
    found = []
    for cloud in left:
        others = [other for other in came if len(other.points) > 20]
        if len(cloud.points) <= 20 or not others:
            continue
        nearest = min(others, key=lambda other: float(np.linalg.norm(_middle(other) - _middle(cloud))))
        found.append(screw_of(cloud, nearest))
    return found


def _middle(cloud: Cloud) -> np.ndarray:
    return np.asarray(cloud.points.mean(axis=0))


def screw_of(before: Cloud, after: Cloud) -> Articulation:
    """Return the joint of the rigid motion by which ICP aligns two clouds, begun with their middles on each other."""
    clouds = []
    for cloud in (before, after):
        made = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(cloud.points))
        made.normals = o3d.utility.Vector3dVector(cloud.normals)
        clouds.append(made.voxel_down_sample(0.02))
    start = np.eye(4)
    start[:3, 3] = _middle(after) - _middle(before)
    method = o3d.pipelines.registration.TransformationEstimationPointToPlane()
    motion = o3d.pipelines.registration.registration_icp(*clouds, 0.15, start, method).transformation
    rotation, shift = motion[:3, :3], motion[:3, 3]
    turn = Rotation.from_matrix(rotation).as_rotvec()
    angle, middle = float(np.linalg.norm(turn)), _middle(before)
    slides = angle < TURN
    way = motion[:3, :3] @ middle + shift - middle
    axis = (way if slides else turn) / max(float(np.linalg.norm(way if slides else turn)), 1e-9)
    origin = middle
    if not slides:  # the point of the axis nearest to the middle: (1 - R) x = t across the axis
        across = shift - (shift @ axis) * axis
        origin = middle + np.linalg.lstsq(np.eye(3) - rotation, across - (np.eye(3) - rotation) @ middle, rcond=None)[0]
    corners = tuple((float(x), float(y), float(z)) for x, y, z in np.repeat(middle[None], 4, axis=0))
    return Articulation(
        type="prismatic" if slides else "revolute",
        axis=(float(axis[0]), float(axis[1]), float(axis[2])),
        origin=(float(origin[0]), float(origin[1]), float(origin[2])),
        travel=float(np.linalg.norm(way)) if slides else angle,
        leaf=corners,
        leaf_after=corners,
        last_before=0,
        first_after=0,
        overlap=0.0,
    )


ARMS = {"ours": ours, "registration": registration}


def share(part: str, of: str) -> Measure:
    """Return a share of counts, pooled over rooms [%]."""

    def figure(records: Sequence[Any]) -> float | None:
        whole = sum(getattr(record, of) for record in records)
        return 100.0 * sum(getattr(record, part) for record in records) / whole if whole else None

    return Measure(figure, "%")


def total(name: str) -> Measure:
    """Return a count over rooms."""
    return Measure(lambda records: float(sum(getattr(record, name) for record in records)), interval=False)


def pooled(name: str, unit: str, percentile: float, factor: float = 1.0) -> Measure:
    """Return a percentile of the errors of all rooms."""

    def figure(records: Sequence[Any]) -> float | None:
        values = [value for record in records for value in getattr(record, name)]
        return factor * float(np.percentile(values, percentile)) if values else None

    return Measure(figure, unit)


EXPERIMENT = Experiment(
    name="moving",
    title="Doors and drawers seen to move",
    simulated=(
        "Generated rooms, a structured-light camera's noise, quantisation and dropouts; things are opened or "
        "shut between the two halves of the walk."
    ),
    knows="Exact poses and intrinsics; no masks, no classes, no models.",
    does_not_show="Real logs: none that we have shows a thing in two states. Nor poses with errors, a hand or a person "
    "in the picture, things opened while the camera looks, sliding doors, lids and flaps.",
    arms={"ours": "ours", "registration": "registration (ICP) and screw"},
    cases=("all",),
    tuning=TUNING,
    reporting=REPORTING,
    quick_seeds=1,
    together=lambda trial: (trial.case, trial.seed),
    measure=measure,
    record=Moved,
    measures={
        "moved": total("true"),
        "found": share("found", "true"),
        "wrong_kind": total("wrong_kind"),
        "false": total("false"),
        "axis": pooled("axis_errors", "deg", 50),
        "axis_90": pooled("axis_errors", "deg", 90),
        "axis_worst": pooled("axis_errors", "deg", 100),
        "hinge": pooled("offset_errors", "mm", 50, 1000),
        "turn": pooled("turn_errors", "deg", 50),
        "slide": pooled("slide_errors", "mm", 50, 1000),
        "frame_ms": median("frame_ms", "ms", interval=False),
    },
    steps=(*STEPS, "articulate"),
)
