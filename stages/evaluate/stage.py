"""The step `evaluate`: wiring of its parts."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph, ContactGraphFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.evaluation import Evaluation, MetricsFile
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.plan import Plan
from scenewright.schemas.segments import Segments
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.evaluate import counts, figures
from scenewright.stages.evaluate.cad_measures import measure_cad, model_periods, pair_replacements, true_joints
from scenewright.stages.evaluate.correspondence import point_overlaps
from scenewright.stages.evaluate.graph_measures import compare_graphs, measure_boxes, measure_graph, optional_nodes
from scenewright.stages.evaluate.map_measures import (
    PredictedMap,
    label_true_points,
    load_map,
    measure_instances,
    measure_quality,
    measure_surface,
)
from scenewright.stages.evaluate.parameters import EvaluateParameters
from scenewright.stages.evaluate.plan_measures import measure_plan
from scenewright.stages.evaluate.replacement_measures import replacements_of
from scenewright.stages.evaluate.replacement_record import record_replacements
from scenewright.stages.evaluate.results import Part
from scenewright.stages.evaluate.shape_loading import true_shapes
from scenewright.stages.evaluate.trajectory_measures import count_poses, measure_trajectory
from scenewright.stages.evaluate.truth import TrueRoom, load_truth
from scenewright.stages.kit.formats.trajectories import read_stamped_rows, read_tum
from scenewright.stages.kit.measurement.tables import write_table
from scenewright.stages.kit.stage import Context

FAR_FROM_TRUTH = 0.3
"""An aligned trajectory error from which on the reader is warned [m]."""
HEADLINES = (
    "map/pq",
    "map/pq_class_agnostic",
    "map/instance_ap50",
    "map/accuracy_mean_mm",
    "map/mesh_recall",
    "graph/edit_distance",
    "graph/support_f1",
    "graph/any_support_f1",
    "graph/obb_ap50_refined",
    "cad/position_error_m_mean",
    "replacement/scan2cad_success",
    "replacement/functional",
    "replacement/max_penetration_mm",
    "replacement/collisions",
    "plan/goal_reached",
    "counts/entities",
    "counts/support_edges",
)
"""Figures that the summary of the artifact repeats, where there are any."""


@dataclass
class Inputs:
    """What was given. Artifacts are None where they were left out."""

    ground_truth: GroundTruth | None
    sequence: Sequence | None
    trajectory: Trajectory | None
    segments: Segments | None
    panoptic_map: PanopticMap | None
    contact_graph: ContactGraph | None
    cad_scene: CadScene | None
    interactive_scene: InteractiveScene | None
    plan: Plan | None
    cad_library: CadLibrary | None
    predicted_map: PredictedMap | None = None
    truth: TrueRoom | None = None
    overlaps: dict[tuple[int, int], float] | None = None
    """IoU over visible points of true and predicted instances, where there are both truth and map."""
    label: str = ""
    parts: list[Part] = field(default_factory=list)

    def part(self, name: str) -> Part:
        """Return the part called `name`, made when it is new."""
        for part in self.parts:
            if part.name == name:
                return part
        self.parts.append(Part(name))
        return self.parts[-1]


def run(
    ground_truth: GroundTruth | None = None,
    sequence: Sequence | None = None,
    trajectory: Trajectory | None = None,
    segments: Segments | None = None,
    panoptic_map: PanopticMap | None = None,
    contact_graph: ContactGraph | None = None,
    cad_scene: CadScene | None = None,
    interactive_scene: InteractiveScene | None = None,
    plan: Plan | None = None,
    cad_library: CadLibrary | None = None,
    *,
    parameters: EvaluateParameters,
    context: Context,
) -> Evaluation:
    """Measure every given artifact against the ground truth where there is one, and count what is in it.

    Figures are shares in [0, 1] unless the measure's name ends in a unit. Writes metrics.json, tables and plots.
    """
    inputs = Inputs(
        ground_truth,
        sequence,
        trajectory,
        segments,
        panoptic_map,
        contact_graph,
        cad_scene,
        interactive_scene,
        plan,
        cad_library,
    )
    for folder in ("tables", "plots"):
        (context.output / folder).mkdir()
    if panoptic_map is not None:
        if ground_truth is not None and panoptic_map.info.world_from_sequence is not None:
            raise BadInput(
                f"{panoptic_map.root}: an edit of gravity turned it out of the world that the truth is in",
                hint="measure the map that was made before it",
            )
        inputs.predicted_map = load_map(panoptic_map)
    if ground_truth is not None:
        with context.progress.step("read ground truth"):
            inputs.truth = load_truth(ground_truth, world_from_log(sequence), parameters.minimum_visible_points)
    inputs.label = label_of(inputs)
    with context.progress.step("count"):
        _count(inputs)
    if inputs.truth is not None:
        with context.progress.step("map"):
            _evaluate_map(inputs, parameters, context)
        with context.progress.step("graph"):
            _evaluate_graph(inputs, parameters, context)
        with context.progress.step("cad"):
            _evaluate_cad(inputs, parameters, context)
    elif parameters.plots and contact_graph is not None:
        figures.draw_graph(context.output / "plots" / "contact_graph.png", contact_graph.info, inputs.label)
    with context.progress.step("trajectory"):
        _evaluate_trajectory(inputs, parameters, context)
    if plan is not None:
        measure_plan(inputs.part("plan"), plan.info)
    return _write(inputs, context)


def world_from_log(sequence: Sequence | None) -> np.ndarray:
    """What ingest did to the log's world frame, (4, 4); identity without a sequence."""
    return np.eye(4) if sequence is None else np.array(sequence.info.gravity.world_from_log)


def label_of(inputs: Inputs) -> str:
    """Which masks and which room the figures are about."""
    if inputs.segments is not None:
        masks = inputs.segments.info.label
    elif inputs.predicted_map is not None:
        masks = inputs.predicted_map.info.segmentation
    else:
        masks = ""
    room = inputs.truth.name if inputs.truth is not None else ""
    return ", ".join(text for text in (masks, room) if text)


def _count(inputs: Inputs) -> None:
    part = inputs.part("counts")
    if inputs.sequence is not None:
        counts.count_frames(part, inputs.sequence.info)
    if inputs.segments is not None:
        counts.count_segments(part, inputs.segments.info)
    if inputs.panoptic_map is not None and inputs.predicted_map is not None:
        counts.count_entities(part, inputs.predicted_map)
        counts.measure_floor(part, inputs.panoptic_map, inputs.predicted_map)
    if inputs.contact_graph is not None:
        counts.count_graph(part, inputs.contact_graph.info)
    if inputs.cad_scene is not None:
        counts.count_cad(part, inputs.cad_scene)
    if inputs.interactive_scene is not None:
        counts.count_bodies(part, inputs.interactive_scene)


def _evaluate_map(inputs: Inputs, parameters: EvaluateParameters, context: Context) -> None:
    truth, predicted = inputs.truth, inputs.predicted_map
    if truth is None or predicted is None:
        return
    part = inputs.part("map")
    labels = label_true_points(truth, predicted, parameters.label_distance)
    inputs.overlaps = point_overlaps(truth, labels, predicted.classes())
    qualities = measure_quality(part, truth, predicted, labels, parameters)
    measure_instances(part, truth, predicted, labels, parameters)
    to_truth, to_map = measure_surface(part, truth, predicted, parameters.mesh_threshold)
    if truth.optional:
        fraction_text = f"{len(truth.optional)} of {len(truth.objects)}"
        part.notes.append(f"The camera hardly saw {fraction_text} true entities; they count neither way.")
    if parameters.plots:
        plots = context.output / "plots"
        figures.draw_quality(plots / "panoptic_quality.png", qualities, inputs.label)
        figures.draw_surface(plots / "surface_distance.png", to_truth, to_map, parameters.mesh_threshold, inputs.label)


def _evaluate_graph(inputs: Inputs, parameters: EvaluateParameters, context: Context) -> None:
    truth, artifact = inputs.truth, inputs.contact_graph
    if truth is None or artifact is None:
        return
    part = inputs.part("graph")
    graph = artifact.info
    measure_boxes(part, truth, graph, _vertices(inputs.predicted_map), parameters)
    if truth.graph.graph.get("annotated") == "no":
        part.notes.append("Nobody annotated what carries what: there is no graph to compare with.")
        return
    comparison = compare_graphs(truth, graph, inputs.overlaps, parameters.node_match_iou)
    measure_graph(part, truth, comparison)
    if parameters.plots:
        figures.draw_comparison(
            context.output / "plots" / "contact_graphs.png",
            comparison,
            inputs.label,
            optional_nodes(truth, comparison.true),
        )


def _vertices(predicted: PredictedMap | None) -> Mapping[int, int]:
    return {} if predicted is None else {entity.instance: entity.vertices for entity in predicted.info.entities}


def _evaluate_cad(inputs: Inputs, parameters: EvaluateParameters, context: Context) -> None:
    if inputs.truth is None or inputs.ground_truth is None or inputs.cad_scene is None:
        return
    scene, graph = inputs.cad_scene.info, inputs.cad_scene.graph
    periods = model_periods(inputs.cad_scene)
    pairs = pair_replacements(inputs.truth, scene, graph, inputs.overlaps, parameters.node_match_iou, periods)
    joints = true_joints(inputs.ground_truth)
    measure_cad(inputs.part("cad"), inputs.truth, scene, pairs, joints, parameters, context.random(1))
    _evaluate_replacement(inputs, parameters, inputs.cad_scene, inputs.ground_truth, inputs.truth)


def _evaluate_replacement(
    inputs: Inputs, parameters: EvaluateParameters, cad_scene: CadScene, ground_truth: GroundTruth, truth: TrueRoom
) -> None:
    """Measure the scene, and where the library is given and `cad` recorded it, the scene before the global check."""
    true_models = true_shapes(ground_truth, world_from_log(inputs.sequence))
    if not true_models:  # an annotated scan
        return
    minimum_iou = parameters.node_match_iou
    measured = replacements_of(true_models, truth, cad_scene, overlaps=inputs.overlaps, minimum_iou=minimum_iou)
    record_replacements(inputs.part("replacement"), measured)
    if inputs.cad_library is None or all(r.best_single is None for r in cad_scene.info.replacements):
        return
    before = replacements_of(
        true_models,
        truth,
        cad_scene,
        overlaps=inputs.overlaps,
        minimum_iou=minimum_iou,
        library_models=inputs.cad_library.path("models"),
        best_single=True,
    )
    record_replacements(inputs.part("replacement_before_check"), before)


def _evaluate_trajectory(inputs: Inputs, parameters: EvaluateParameters, context: Context) -> None:
    estimated = _trajectory(inputs.trajectory or inputs.sequence)
    paths: dict[str, np.ndarray] = {}
    if estimated is not None:
        paths["camera"] = estimated[1][:, :3, 3]
    if inputs.trajectory is not None and inputs.trajectory.info is not None:
        count_poses(inputs.part("trajectory"), inputs.trajectory.info)
    truth = _true_trajectory(inputs)
    if truth is not None and estimated is not None:
        times, poses = truth
        part = inputs.part("trajectory")
        measure_trajectory(part, times, poses, *estimated)
        _check_same_walk(inputs, part, len(estimated[0]))
        paths["true camera" if inputs.ground_truth is not None else "given camera"] = poses[:, :3, 3]
    if not parameters.plots or not paths:
        return
    graph: ContactGraphFile | None = None
    if inputs.contact_graph is not None:
        graph = inputs.contact_graph.info
    elif inputs.truth is not None:
        graph = inputs.truth.graph
    boxes = [
        (node.id, node.instance, node.box)
        for node in (graph.nodes if graph is not None else ())
        if node.box is not None and node.node_type != "layout"
    ]
    figures.draw_floor_plan(context.output / "plots" / "camera_path.png", boxes, paths, inputs.label)


def _true_trajectory(inputs: Inputs) -> tuple[np.ndarray, np.ndarray] | None:
    """Times and poses to compare with: those of the ground truth, else, for a trajectory, those that the log gave."""
    if inputs.ground_truth is not None and inputs.ground_truth.info.source == "generated":
        times, poses = read_tum(inputs.ground_truth.path("trajectory.tum"))
        return times, world_from_log(inputs.sequence) @ poses
    if inputs.trajectory is None:
        return None
    log_trajectory = _trajectory(inputs.sequence)
    if log_trajectory is not None:
        inputs.part("trajectory").notes.append("The camera path is compared with the poses that the log gave.")
    return log_trajectory


def _check_same_walk(inputs: Inputs, part: Part, poses: int) -> None:
    """Refuse a sequence that was not recorded on the walk that the ground truth describes."""
    if inputs.trajectory is None and 2 * (part.metrics["trajectory/poses_associated"] or 0) < poses:
        raise BadInput(
            "evaluate: the sequence has other time stamps than the ground truth's log",
            hint="ingest the log.mcap of this ground truth",
        )
    error = part.metrics["trajectory/ate_rmse_aligned_m"]
    if error is not None and error > FAR_FROM_TRUTH:
        part.notes.append(
            f"The camera path is {error:.2f} m from the truth even after alignment: lost tracking, or another log."
        )


def _trajectory(artifact: Trajectory | Sequence | None) -> tuple[np.ndarray, np.ndarray] | None:
    """Times (N,) and poses (N, 4, 4) of a trajectory or a sequence; None when it has none."""
    if artifact is None or not artifact.path("trajectory.tum").is_file():
        return None
    if isinstance(artifact, Sequence) and "pose" not in artifact.info.streams:
        return None
    if artifact.manifest is None and isinstance(artifact, Trajectory):
        rows = read_stamped_rows(artifact.path("trajectory.tum"))
        for note in rows.notes:
            logging.getLogger("scenewright").warning("%s", note)
        stamps, order = np.unique(rows.stamps, return_index=True)
        times, poses = stamps * 1e-9, rows.poses[order]
    else:
        times, poses = read_tum(artifact.path("trajectory.tum"))
    return (times, poses) if len(times) else None


def _write(inputs: Inputs, context: Context) -> Evaluation:
    metrics: dict[str, float | None] = {}
    notes: list[str] = []
    for part in inputs.parts:
        metrics |= part.metrics
        notes += part.notes
        for table in part.tables:
            write_table(context.output / "tables", table)
    if inputs.truth is None:
        notes.append("There is no ground truth: the figures count what was found, they do not say that it is right.")
    file = MetricsFile(label=inputs.label, metrics=metrics, notes=tuple(notes))
    file.write(context.output / "metrics.json")
    summary = {name: metrics[name] for name in HEADLINES if metrics.get(name) is not None}
    return Evaluation(context.output, outcome="ok", summary={"label": inputs.label, **summary})
