"""Figures of the CAD scene: class and model, position, yaw, scale, boxes, joint values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scenewright.schemas.cad_scene import CadScene, CadSceneFile, Replacement
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.ground_truth import GroundTruth, TrueObject
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.evaluate.correspondence import assign, node_affinity
from scenewright.stages.evaluate.graph_measures import upright
from scenewright.stages.evaluate.parameters import EvaluateParameters
from scenewright.stages.evaluate.results import Part
from scenewright.stages.evaluate.truth import TrueRoom
from scenewright.stages.kit.formats.cad_models import posed_mesh, read_model
from scenewright.stages.kit.geometry.boxes import box_iou
from scenewright.stages.kit.measurement.pose_error import position_error, rotation_period, yaw_error, yaw_of
from scenewright.stages.kit.measurement.tables import Cell, Table

QUARTER_TURN = np.pi / 2
"""Turn by which much furniture looks the same [rad]."""
OPEN_FROM = 0.05
"""A joint counts as open from this value on [rad or m]."""


@dataclass(frozen=True)
class CadPair:
    """A true object and the replacement that stands for it, with the errors between them."""

    true: str
    predicted: str
    class_match: bool
    decision: str
    true_model: str | None
    model: str | None = None
    model_rank: int | None = None
    """Place of the true model among the candidates (0 = chosen); None when it is not among them."""
    position: float | None = None
    position_ground: float | None = None
    yaw: float | None = None
    yaw_symmetric: float | None = None
    """Yaw error modulo the turn after which the chosen model's closed shape looks the same (0 for round ones)."""
    yaw_quarter: float | None = None
    """Yaw error modulo a quarter turn: the error of the alignment, without confusions of front and side."""
    scale: float | None = None
    """|scale / true scale - 1|, where the model is the true one."""
    box_iou: float | None = None
    joints: Mapping[str, float] = field(default_factory=dict)
    """Joint -> |value - true value|, where the model is the true one."""
    open_true: bool | None = None
    open_predicted: bool | None = None


def pair_replacements(
    truth: TrueRoom,
    scene: CadSceneFile,
    graph: ContactGraphFile,
    overlaps: Mapping[tuple[int, int], float] | None,
    minimum_iou: float,
    periods: Mapping[str, float],
) -> list[CadPair]:
    """Pair true objects with graph nodes by overlap alone (class and pose decide nothing) and compare them.

    Takes true objects that have a CAD model and were seen. `overlaps` as in `node_affinity`, `periods` from
    `model_periods`.
    """
    objects = {o.name: o for o in truth.evaluated(things_only=True) if o.model_id is not None}
    true_nodes = [n for n in truth.graph.nodes if n.id in objects]
    nodes = [n for n in graph.nodes if n.node_type in ("rigid", "articulated")]
    replacements = {r.node: r for r in scene.replacements}
    pairs = assign(node_affinity(true_nodes, nodes, overlaps, minimum_iou))
    return [_compare(objects[true_nodes[i].id], nodes[j], replacements.get(nodes[j].id), periods) for i, j in pairs]


def model_periods(cad_scene: CadScene, samples: int = 2000) -> dict[str, float]:
    """Turn after which each chosen model's closed shape looks the same (`rotation_period`); without its colours."""
    import trimesh

    periods: dict[str, float] = {}
    for model_id in sorted({r.chosen.model_id for r in cad_scene.info.replacements if r.chosen is not None}):
        folder = cad_scene.path("models") / model_id
        if folder.is_dir():
            mesh = posed_mesh(folder, read_model(folder), {})
            points, _ = trimesh.sample.sample_surface(mesh, samples, seed=0)
            periods[model_id] = rotation_period(np.asarray(points))
    return periods


def _compare(
    true: TrueObject, node: GraphNode, replacement: Replacement | None, periods: Mapping[str, float]
) -> CadPair:
    comparison = CadPair(
        true=true.name,
        predicted=node.id,
        class_match=true.class_name == node.class_name,
        decision=replacement.decision if replacement else "none",
        true_model=true.model_id,
        box_iou=box_iou(true.box, node.box) if node.box is not None and upright(node.box) else None,
    )
    if replacement is None or replacement.decision != "cad" or replacement.chosen is None:
        return comparison
    chosen = replacement.chosen
    ranked = list(dict.fromkeys([chosen.library_model, *(c.library_model for c in replacement.alternatives)]))
    pose, true_pose = np.array(chosen.world_from_model), np.array(true.world_from_model)
    in_space, on_ground = position_error(true_pose[:3, 3], pose[:3, 3])
    yaw, true_yaw = yaw_of(pose[:3, :3]), yaw_of(true_pose[:3, :3])
    same = chosen.model_id == true.model_id
    joints = {name: abs(chosen.joints.get(name, 0.0) - value) for name, value in sorted(true.joints.items())}
    return replace(
        comparison,
        model=chosen.model_id,
        model_rank=ranked.index(true.model_id) if true.model_id in ranked else None,
        position=in_space,
        position_ground=on_ground,
        yaw=yaw_error(true_yaw, yaw),
        yaw_symmetric=yaw_error(true_yaw, yaw, periods.get(chosen.model_id, 2 * np.pi)),
        yaw_quarter=yaw_error(true_yaw, yaw, QUARTER_TURN),
        scale=abs(chosen.scale / true.scale - 1.0) if same else None,
        joints=joints if same else {},
        open_true=_is_open(true.joints) if true.joints else None,
        open_predicted=_is_open(chosen.joints) if true.joints else None,
    )


def _is_open(joints: Mapping[str, float]) -> bool:
    return any(abs(value) > OPEN_FROM for value in joints.values())


def true_joints(truth: GroundTruth) -> dict[tuple[str, str], Joint]:
    """Joints of the true room by (object name, joint name without prefix); empty when the room holds no scene."""
    path = truth.path("room") / "scene.json"
    if not path.is_file():
        return {}
    return {
        (body.name, joint.name.removeprefix(f"{body.name}__")): joint
        for body in InteractiveSceneFile.read(path).bodies
        for joint in body.joints
    }


def measure_cad(
    part: Part,
    truth: TrueRoom,
    scene: CadSceneFile,
    pairs: list[CadPair],
    joints: Mapping[tuple[str, str], Joint],
    parameters: EvaluateParameters,
    random: np.random.Generator,
) -> None:
    """Record shares and errors over the pairs; means come with 95 % bootstrap intervals over objects."""
    resamples = parameters.bootstrap_resamples
    true_count = sum(o.model_id is not None for o in truth.evaluated(things_only=True))
    replaced = [p for p in pairs if p.model is not None]

    def share(hits: int, of: int) -> float | None:
        return hits / of if of else None

    part.set("true_objects", true_count)
    part.set("paired", len(pairs))
    part.set("replaced", len(replaced))
    part.set("replaced_share", share(len(replaced), true_count))
    part.set("class_match", share(sum(p.class_match for p in pairs), len(pairs)))
    part.set("model_top1", share(sum(p.model_rank == 0 for p in replaced), len(replaced)))
    part.set("model_in_candidates", share(sum(p.model_rank is not None for p in replaced), len(replaced)))
    part.set_mean("position_error_m", [p.position for p in replaced if p.position is not None], random, resamples)
    grounds = [p.position_ground for p in replaced if p.position_ground is not None]
    part.set_mean("position_error_ground_m", grounds, random, resamples)
    yaws = [p.yaw for p in replaced if p.yaw is not None]
    part.set_mean("yaw_error_rad", yaws, random, resamples)
    symmetric = [p.yaw_symmetric for p in replaced if p.yaw_symmetric is not None]
    part.set_mean("yaw_error_symmetric_rad", symmetric, random, resamples)
    part.set("yaw_symmetric_within_20deg", share(sum(y < np.radians(20) for y in symmetric), len(symmetric)))
    quarters = [p.yaw_quarter for p in replaced if p.yaw_quarter is not None]
    part.set("yaw_error_quarter_turn_rad_median", float(np.median(quarters)) if quarters else None)
    part.set_mean("scale_error", [p.scale for p in replaced if p.scale is not None], random, resamples)
    part.set_mean("box_iou", [p.box_iou for p in pairs if p.box_iou is not None], random, resamples)
    for kind, unit in (("revolute", "rad"), ("prismatic", "m")):
        errors = [
            error
            for p in replaced
            for name, error in p.joints.items()
            if (p.true, name) in joints and joints[p.true, name].type == kind
        ]
        part.set(f"joint_error_{kind}_{unit}_mean", float(np.mean(errors)) if errors else None)
        part.set(f"joints_{kind}_compared", len(errors))
    states = [p for p in replaced if p.open_true is not None]
    part.set("open_state_match", share(sum(p.open_true == p.open_predicted for p in states), len(states)))
    part.set("conflicts_before", scene.conflicts_before)
    part.set("conflicts_after", scene.conflicts_after)
    part.notes.append(
        "CAD errors compare model frames (bottom centre, front along -y). Yaw is also given modulo the symmetry of "
        "the chosen model's closed shape, without its colours. Yaw modulo a quarter turn leaves out every confusion of "
        "front and side. Scale and joint errors are taken where the chosen model is the true one."
    )
    part.tables.append(
        Table(
            "cad_objects",
            "CAD replacement by thing",
            (
                "true thing",
                "node",
                "class",
                "decision",
                "model",
                "true model",
                "position [m]",
                "yaw [deg]",
                "yaw mod symmetry [deg]",
                "scale error",
                "box IoU",
                "largest joint error",
            ),
            tuple(_row(p) for p in sorted(pairs, key=lambda p: p.true)),
        )
    )


def _row(pair: CadPair) -> tuple[Cell, ...]:
    def degrees(value: float | None) -> float | None:
        return None if value is None else round(float(np.degrees(value)), 2)

    return (
        pair.true,
        pair.predicted,
        "same" if pair.class_match else "other",
        pair.decision,
        pair.model,
        pair.true_model,
        pair.position,
        degrees(pair.yaw),
        degrees(pair.yaw_symmetric),
        pair.scale,
        pair.box_iou,
        max(pair.joints.values()) if pair.joints else None,
    )
