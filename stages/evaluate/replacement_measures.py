"""CAD replacement against the truth, object by object and over a room: what `evaluate` and the benchmark both call.

`measure_replacements` and `room_summary` are pure; `replacements_of` reads everything they need from the artifacts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.cad_scene import CadScene, CadSceneFile, Replacement
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.ground_truth import TrueObject
from scenewright.stages.evaluate.alignment_errors import AlignmentError, alignment_error
from scenewright.stages.evaluate.correspondence import assign, merge_stuff_nodes, node_affinity
from scenewright.stages.evaluate.functional_equivalence import Equivalence, equivalence, same_relation
from scenewright.stages.evaluate.joint_errors import JointError, joint_errors, placed_joints
from scenewright.stages.evaluate.model_shapes import ModelShape, PlacedShape
from scenewright.stages.evaluate.shape_loading import model_shapes, placed_candidate
from scenewright.stages.evaluate.truth import TrueRoom
from scenewright.stages.kit.measurement.layout_pieces import layout_pieces
from scenewright.stages.kit.measurement.room_penetrations import Penetration, room_penetrations


@dataclass(frozen=True, eq=False)
class ObjectResult:
    """One true object that has a CAD model and was seen, and what stands for it."""

    name: str
    class_name: str
    true_model: str
    node: str | None = None
    """The graph node of the same place; None: not detected."""
    decision: str = "none"
    model: str | None = None
    model_class: str | None = None
    rank: int | None = None
    """Place of the true model among the candidates' models, 1 = first; None when it is not among them (held out,
    rejected, or no candidates)."""
    alignment: AlignmentError | None = None
    """None when nothing was placed, or a shape is not known."""
    joints: tuple[JointError, ...] = ()
    """One entry for each true joint of a replaced object."""
    spurious_joints: int = 0
    """Joints of the chosen model that stand for no true one."""
    equivalence: Equivalence | None = None

    @property
    def detected(self) -> bool:
        """Whether a node of the graph stands where the object is."""
        return self.node is not None

    @property
    def class_right(self) -> bool:
        """Whether the chosen model is of the true object's class."""
        return self.model_class == self.class_name

    @property
    def success(self) -> bool:
        """The Scan2CAD measure: class right, 0.20 m, 20 degrees, 20 % (mean of the three ratios)."""
        return self.class_right and self.alignment is not None and self.alignment.succeeds()

    @property
    def success_every_axis(self) -> bool:
        """The same with the 20 % asked of every extent."""
        return self.class_right and self.alignment is not None and self.alignment.succeeds(every_axis=True)

    @property
    def functional(self) -> bool:
        """All four criteria of functional equivalence."""
        return self.equivalence is not None and self.equivalence.functional


def with_best_single(scene: CadSceneFile) -> CadSceneFile:
    """Return the scene as it was before the global check: every object takes what fitted it best by itself.

    Objects without `best_single` (scenes of older versions) keep their choice; one that the global check left as a
    mesh gets its candidate back.
    """
    return scene.model_copy(update={"replacements": tuple(_before_check(r) for r in scene.replacements)})


def _before_check(replacement: Replacement) -> Replacement:
    if replacement.best_single is None:
        return replacement
    same = replacement.chosen is not None and replacement.chosen.model_id == replacement.best_single.model_id
    colors = replacement.part_colors if same else {}  # they are those of the chosen model's parts
    return replacement.model_copy(update={"chosen": replacement.best_single, "decision": "cad", "part_colors": colors})


def pair_objects(
    truth: TrueRoom, graph: ContactGraphFile, overlaps: Mapping[tuple[int, int], float] | None, minimum_iou: float
) -> dict[str, str]:
    """Return true node id -> node id of the reconstruction that stands for it, by overlap alone, stuff merged.

    Class and pose decide nothing. True nodes that the camera hardly saw take no part. `overlaps`, `minimum_iou` as in
    `node_affinity`.
    """
    evaluated = {entry.instance for entry in truth.evaluated()}
    true_graph, _ = merge_stuff_nodes(truth.graph)
    found_graph, _ = merge_stuff_nodes(graph)
    true = [n for n in true_graph.nodes if n.node_type != "scene" and n.instance in evaluated]
    predicted = [n for n in found_graph.nodes if n.node_type != "scene"]
    pairs = assign(node_affinity(true, predicted, overlaps, minimum_iou))
    return {true[i].id: predicted[j].id for i, j in pairs}


def measure_replacements(
    truth: TrueRoom,
    true_models: Mapping[str, PlacedShape],
    scene: CadSceneFile,
    graph: ContactGraphFile,
    models: Mapping[str, ModelShape],
    overlaps: Mapping[tuple[int, int], float] | None = None,
    minimum_iou: float = 0.25,
) -> list[ObjectResult]:
    """Compare every true object that has a CAD model and was seen with what stands for it, by name of the object.

    `true_models`: object name -> the true model as it stands (`true_shapes`), same world as `truth`; `scene`, `graph`:
    scene.json and graph.json of the CAD scene; `models`: model id -> shape of the chosen models (`model_shapes`);
    `overlaps`: as in `node_affinity`, None pairs by boxes. Objects that nothing stands for are in the list too.
    """
    partner = pair_objects(truth, graph, overlaps, minimum_iou)
    true_graph, _ = merge_stuff_nodes(truth.graph)
    found_graph, _ = merge_stuff_nodes(graph)
    replacements = {r.node: r for r in scene.replacements}
    results = []
    for true in sorted((o for o in truth.evaluated(things_only=True) if o.model_id is not None), key=lambda o: o.name):
        node = partner.get(true.name)
        relation = same_relation(true_graph, found_graph, partner, true.name)
        results.append(_compare(true, true_models.get(true.name), node, replacements, models, relation=relation))
    return results


def _compare(
    true: TrueObject,
    shape: PlacedShape | None,
    node: str | None,
    replacements: Mapping[str, Replacement],
    models: Mapping[str, ModelShape],
    *,
    relation: bool,
) -> ObjectResult:
    replacement = None if node is None else replacements.get(node)
    model_id = true.model_id or ""
    if node is None or replacement is None:
        return ObjectResult(true.name, true.class_name, model_id, node)
    rank = retrieval_rank(replacement, model_id)
    chosen = replacement.chosen if replacement.decision == "cad" else None
    if chosen is None:
        return ObjectResult(true.name, true.class_name, model_id, node, replacement.decision, rank=rank)
    placed = placed_candidate(chosen, models, replacement.held)
    error = None if placed is None or shape is None else alignment_error(shape, placed, is_round=true.round)
    joints: tuple[JointError, ...] = ()
    spurious = 0
    judged: Equivalence | None = None
    model_class = None if placed is None else placed.shape.class_name
    if placed is not None and shape is not None and error is not None:
        joints = tuple(joint_errors(placed_joints(shape), placed_joints(placed)))
        spurious = len(placed.joints) - sum(joint.partner is not None for joint in joints)
        judged = equivalence(
            shape,
            placed,
            rotation=error.symmetry,
            scale_ratios=error.scale_ratios,
            same_class=model_class == true.class_name,
            relation=relation,
            colors=replacement.part_colors,
        )
    return ObjectResult(
        true.name,
        true.class_name,
        model_id,
        node,
        replacement.decision,
        chosen.model_id,
        model_class,
        rank,
        error,
        joints,
        spurious,
        judged,
    )


def retrieval_rank(replacement: Replacement, true_model: str) -> int | None:
    """Return the place of the true model among the candidates' models, 1 = first, None when it is not among them.

    Candidates stand in the order in which they fitted the object by itself: `best_single` (where it is recorded), the
    chosen one, the alternatives; a model counts once, stretched or not.
    """
    candidates = [replacement.best_single, replacement.chosen, *replacement.alternatives]
    ranked = list(dict.fromkeys(candidate.library_model for candidate in candidates if candidate is not None))
    return ranked.index(true_model) + 1 if true_model in ranked else None


def room_summary(results: Sequence[ObjectResult], penetrations: Sequence[Penetration] = ()) -> dict[str, float | None]:
    """Return the figures of one room: name -> number, None where there is nothing to take it over.

    Shares without a suffix are over all objects of `results`, so that an object that was missed or not replaced is a
    failure; those that end in `_detected` are over the detected ones. Errors are means (and medians) over the replaced.
    """
    detected = [r for r in results if r.detected]
    replaced = [r for r in results if r.model is not None]
    errors = [r.alignment for r in replaced if r.alignment is not None]
    ranks = [r.rank for r in results if r.rank is not None]
    summary: dict[str, float | None] = {
        "true_objects": float(len(results)),
        "detected": float(len(detected)),
        "replaced": float(len(replaced)),
    }

    def share(name: str, right: Sequence[bool]) -> None:
        hits = dict(zip((r.name for r in results), right, strict=True))
        summary[name] = _mean([float(hit) for hit in right])
        summary[f"{name}_detected"] = _mean([float(hits[r.name]) for r in detected])

    share("class_right", [r.class_right for r in results])
    share("true_model_first", [r.rank == 1 for r in results])
    share("true_model_among_candidates", [r.rank is not None for r in results])
    summary["true_model_rank_mean"] = _mean([float(rank) for rank in ranks])
    share("scan2cad_success", [r.success for r in results])
    share("scan2cad_success_every_axis", [r.success_every_axis for r in results])
    for name, values in (
        ("translation_error_m", [e.translation for e in errors]),
        ("rotation_error_rad", [e.rotation for e in errors]),
        ("scale_ratio_error", [e.scale for e in errors]),
        ("scale_ratio_error_worst_axis", [e.worst_scale for e in errors]),
    ):
        summary[f"{name}_mean"] = _mean(values)
        summary[f"{name}_median"] = float(np.median(values)) if values else None
    summary |= _joint_summary(results)
    judged = {r.name: r.equivalence for r in results}

    def criterion(name: str) -> list[bool]:
        return [e is not None and bool(getattr(e, name)) for e in (judged[r.name] for r in results)]

    for name in ("class_and_relations", "affordance", "size_and_shape", "appearance"):
        share(f"functional_{name}", criterion(name))
    share("functional", criterion("functional"))
    differences = [e.color_difference for e in judged.values() if e is not None and e.color_difference is not None]
    summary["color_difference_mean"] = _mean(differences)
    return summary | penetration_summary(penetrations)


def _joint_summary(results: Sequence[ObjectResult]) -> dict[str, float | None]:
    """Errors of joints over the replaced objects; `joints_found`: share of their true joints that have a partner."""
    joints = [joint for r in results for joint in r.joints]
    matched = [joint for joint in joints if joint.partner is not None]
    summary: dict[str, float | None] = {
        "joints_compared": float(len(joints)),
        "joints_found": _mean([float(joint.partner is not None) for joint in joints]),
        "joints_spurious": float(sum(r.spurious_joints for r in results)),
        "joint_axis_angle_rad_mean": _mean([j.angle for j in matched if j.angle is not None]),
        "joint_axis_offset_m_mean": _mean([j.offset for j in matched if j.offset is not None]),
    }
    for kind, unit in (("revolute", "rad"), ("prismatic", "m")):
        of_kind = [j for j in matched if j.type == kind]
        summary[f"joint_limit_error_{kind}_{unit}_mean"] = _mean([j.limits for j in of_kind if j.limits is not None])
        summary[f"joint_value_error_{kind}_{unit}_mean"] = _mean([j.value for j in of_kind if j.value is not None])
    return summary


def penetration_summary(penetrations: Sequence[Penetration]) -> dict[str, float | None]:
    """Shared volume, deepest penetration and collisions of a room, between objects and against floor and walls."""
    summary: dict[str, float | None] = {}
    for name, chosen in (
        ("", list(penetrations)),
        ("_objects", [p for p in penetrations if not p.layout]),
        ("_layout", [p for p in penetrations if p.layout]),
    ):
        summary[f"penetration_volume{name}_cm3"] = 1e6 * sum(p.volume for p in chosen)
        summary[f"max_penetration{name}_mm"] = 1e3 * max((p.depth for p in chosen), default=0.0)
        summary[f"collisions{name}"] = float(sum(p.collides for p in chosen))
    return summary


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if len(values) else None


@dataclass(frozen=True, eq=False)
class RoomReplacements:
    """What was measured in one room."""

    objects: list[ObjectResult]
    penetrations: list[Penetration]

    @property
    def summary(self) -> dict[str, float | None]:
        """`room_summary` of both."""
        return room_summary(self.objects, self.penetrations)


def replacements_of(
    true_models: Mapping[str, PlacedShape],
    truth: TrueRoom,
    cad_scene: CadScene,
    *,
    overlaps: Mapping[tuple[int, int], float] | None = None,
    minimum_iou: float = 0.25,
    library_models: Path | None = None,
    best_single: bool = False,
) -> RoomReplacements:
    """Read the scene's shapes and measure one room.

    `true_models` are the `true_shapes` of the ground truth, `truth` its `load_truth`, `overlaps` from `point_overlaps`
    where there is a map. `library_models` is `models/` of the CAD library: `best_single` (the scene before the global
    check) needs it, as the CAD scene holds copies of the chosen models only. Raises BadInput when a file is broken.
    """
    scene = with_best_single(cad_scene.info) if best_single else cad_scene.info
    chosen = {r.node: r.chosen for r in scene.replacements if r.decision == "cad" and r.chosen is not None}
    roots = [cad_scene.path("models"), *([library_models] if library_models is not None else [])]
    models = model_shapes([candidate.model_id for candidate in chosen.values()], roots)
    graph = cad_scene.graph
    objects = measure_replacements(truth, true_models, scene, graph, models, overlaps, minimum_iou)
    placed = {
        node: shape.pieces()
        for node, candidate in chosen.items()
        if (shape := placed_candidate(candidate, models)) is not None
    }
    layout = layout_pieces(graph, cad_scene.path("layout"), cad_scene.shell)
    return RoomReplacements(objects, room_penetrations(placed, layout))
