"""The step `report`: gathers the sections of the page."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from schemas.artifact import Artifact
from schemas.cad_library import CadLibrary
from schemas.cad_scene import CadScene, Replacement
from schemas.contact_graph import ContactGraph
from schemas.disparity import Disparity
from schemas.errors import BadInput
from schemas.evaluation import Evaluation, Report, ReportFile
from schemas.ground_truth import GroundTruth
from schemas.interactive_scene import InteractiveScene
from schemas.manifest import CONVENTIONS
from schemas.packing import Packing
from schemas.panoptic_map import PanopticMap
from schemas.plan import Plan
from schemas.segments import Segments
from schemas.sequence import Sequence
from schemas.suture_needle import SutureNeedle, SutureThread
from schemas.suture_trial import SutureEvaluation, SutureTrial
from schemas.tableware_detections import TablewareDetections
from schemas.tableware_plan import TablewarePlan
from schemas.tableware_trial import TablewareEvaluation, TablewareTrial
from schemas.trajectory import Trajectory
from stages.kit.rendering.ray_casting import Rendering
from stages.kit.stage import Context
from stages.report.acting import body_rows, plan_view
from stages.report.candidates import object_views
from stages.report.figures import GROUPS, all_metrics, metric_groups, read_plots, read_tables
from stages.report.frames import frame_views
from stages.report.global_check import checked_scenes
from stages.report.graph_drawing import draw_graph, marks_from_evaluation
from stages.report.images import Picture, jpeg
from stages.report.kinematic_tree import corresponding_trees, read_joints
from stages.report.packing_section import packing_view
from stages.report.page import render_page
from stages.report.parameters import ReportParameters
from stages.report.placed_models import ModelShelf
from stages.report.provenance import made_of
from stages.report.stereo_section import stereo_view
from stages.report.surfaces import Model, cad_model, map_model, true_model
from stages.report.suture_section import suture_view
from stages.report.tableware_section import tableware_view
from stages.report.views import Label, View, oblique_view, place_labels, render, top_view

MAXIMUM_BYTES = 15_000_000
HEADLINES = (
    "counts/frames", "counts/entities", "map/pq", "map/mesh_recall", "map/accuracy_mean_mm", "graph/edit_distance",
    "graph/support_f1", "counts/support_edges", "cad/replaced", "replacement/scan2cad_success", "counts/joints",
    "plan/goal_reached",
)  # fmt: skip
SECTIONS = (
    ("frames", "Frames", "frames"), ("stereo", "Stereo", "stereo"), ("map", "Map", "map_text"),
    ("graph", "Contact graph", "graph"),
    ("cad", "CAD scene", "cad_views"), ("scene", "Interactive scene", "bodies"), ("plan", "Plan", "plan"),
    ("packing", "Packing", "packing"), ("tableware", "Tableware", "tableware"), ("suture", "Suturing", "suture"),
    ("figures", "Figures", "groups"), ("cost", "Time and memory", "made"), ("made", "How it was made", "made"),
)  # fmt: skip


@dataclass(frozen=True)
class DrawnView:
    """A rendered picture with names on it."""

    picture: Picture
    labels: tuple[Label, ...]
    width: int
    height: int
    caption: str
    font_size: float = 13.0
    """Of the labels [px of the picture]."""
    of_masks: bool = True
    """Whether the segmentation masks have to do with it: then their label stands beside it."""


def run(
    ground_truth: GroundTruth | None = None,
    sequence: Sequence | None = None,
    trajectory: Trajectory | None = None,
    segments: Segments | None = None,
    panoptic_map: PanopticMap | None = None,
    contact_graph: ContactGraph | None = None,
    cad_scene: CadScene | None = None,
    cad_library: CadLibrary | None = None,
    interactive_scene: InteractiveScene | None = None,
    plan: Plan | None = None,
    packing: Packing | None = None,
    tableware_detections: TablewareDetections | None = None,
    tableware_plan: TablewarePlan | None = None,
    tableware_trial: TablewareTrial | None = None,
    tableware_evaluation: TablewareEvaluation | None = None,
    suture_needle: SutureNeedle | None = None,
    suture_thread: SutureThread | None = None,
    suture_trial: SutureTrial | None = None,
    suture_evaluation: SutureEvaluation | None = None,
    evaluation: Evaluation | None = None,
    baseline_evaluation: Evaluation | None = None,
    *,
    parameters: ReportParameters,
    context: Context,
) -> Report:
    """Write report.html, one file that needs no network, and report.json. Whatever is missing has no section."""
    given: dict[str, Artifact | None] = {
        "ground_truth": ground_truth, "sequence": sequence, "trajectory": trajectory, "segments": segments,
        "panoptic_map": panoptic_map, "contact_graph": contact_graph, "cad_scene": cad_scene,
        "cad_library": cad_library, "interactive_scene": interactive_scene, "plan": plan, "packing": packing,
        "tableware_detections": tableware_detections, "tableware_plan": tableware_plan,
        "tableware_trial": tableware_trial,
        "tableware_evaluation": tableware_evaluation,
        "suture_needle": suture_needle, "suture_thread": suture_thread, "suture_trial": suture_trial,
        "suture_evaluation": suture_evaluation,
        "evaluation": evaluation, "baseline_evaluation": baseline_evaluation,
    }  # fmt: skip
    artifacts = {role: artifact for role, artifact in given.items() if artifact is not None}
    values: dict[str, Any] = _empty_page()
    values["label"] = _label(evaluation, segments, panoptic_map)
    values["baseline_label"] = baseline_evaluation.info.label if baseline_evaluation is not None else ""
    if sequence is not None:
        with context.progress.step("frames"):
            _add_frames(values, sequence, segments, parameters)
            if isinstance(sequence, Disparity):
                values["stereo"] = stereo_view(sequence, parameters.frames, parameters.frame_width)
    with context.progress.step("views"):
        view = _add_views(values, ground_truth, sequence, panoptic_map, cad_scene, parameters)
    if cad_scene is not None:
        with context.progress.step("candidates"):
            _add_candidates(values, cad_scene, cad_library, panoptic_map, view, parameters)
    if contact_graph is not None:
        _add_graph(values, contact_graph, evaluation)
    if interactive_scene is not None:
        _add_scene(values, interactive_scene)
        _add_trees(values, interactive_scene)
    if plan is not None:
        with context.progress.step("plan"):
            values["plan"] = plan_view(plan, parameters.keyframes, 640)
            values["plan_ok"] = all(check.holds for check in plan.info.checks)
    if packing is not None:
        with context.progress.step("packing"):
            values["packing"] = packing_view(packing, 1100)
    if any(role.startswith("tableware_") for role in artifacts):
        with context.progress.step("tableware"):
            values["tableware"] = tableware_view(
                tableware_detections, tableware_plan, tableware_trial, tableware_evaluation, 1100
            )
    if any(role.startswith("suture_") for role in artifacts):
        with context.progress.step("suture"):
            values["suture"] = suture_view(suture_needle, suture_thread, suture_trial, suture_evaluation, 1100)
    if evaluation is not None:
        with context.progress.step("figures"):
            _add_figures(values, evaluation, baseline_evaluation)
    values["made"] = made_of(artifacts, context.output.parent / "report")
    values["timed"] = any(m.known for m in values["made"])
    values["title"] = parameters.title or _title(ground_truth, sequence, artifacts)
    values["lead"] = _lead(ground_truth, sequence, artifacts)
    values["sections"] = [{"id": i, "name": name} for i, name, key in SECTIONS if values[key]]
    return _write(values, artifacts, context)


def _empty_page() -> dict[str, Any]:
    empty = (
        "frames stereo legend map_views graph cad_views replacements bodies fixed_bodies groups notes plots tables "
        "metrics tiles plan packing tableware suture baseline has_intervals plan_ok checked objects_changed "
        "objects_kept trees"
    )
    texts = "frames_text map_text graph_text graph_errors cad_text scene_text figures_text"
    values: dict[str, Any] = dict.fromkeys(empty.split(), None)
    values.update(dict.fromkeys(texts.split(), ""))
    values["conventions"] = "; ".join(f"{name.replace('_', ' ')}: {text}" for name, text in CONVENTIONS.items())
    try:
        values["version"] = version("scenewright")
    except PackageNotFoundError:
        values["version"] = ""
    return values


def _label(evaluation: Evaluation | None, segments: Segments | None, panoptic_map: PanopticMap | None) -> str:
    if evaluation is not None and evaluation.info.label:
        return evaluation.info.label
    if segments is not None:
        return segments.info.label
    return panoptic_map.info.segmentation if panoptic_map is not None else ""


def _title(ground_truth: GroundTruth | None, sequence: Sequence | None, artifacts: dict[str, Artifact]) -> str:
    if set(artifacts) == {"packing"}:
        return "Boxes and a basket"
    if artifacts and all(role.startswith("tableware_") for role in artifacts):
        return "A table to clear"
    if artifacts and all(role.startswith("suture_") for role in artifacts):
        return "Suture throws"
    if ground_truth is not None and ground_truth.info.source == "generated":
        return "A generated room, reconstructed"
    return "A scanned room, reconstructed" if sequence is not None else "A reconstructed room"


def _lead(ground_truth: GroundTruth | None, sequence: Sequence | None, artifacts: dict[str, Artifact]) -> str:
    parts = []
    if sequence is not None:
        info = sequence.info
        camera = f"{info.camera.width} x {info.camera.height}"
        parts.append(f"{info.frame_count} RGB-D frames of {camera} pixels over {info.end_time - info.start_time:.0f} s")
    names = {
        "panoptic_map": "a labelled map", "contact_graph": "a contact graph", "cad_scene": "a scene of CAD models",
        "interactive_scene": "a scene that simulators load", "packing": "a packing of boxes",
        "tableware_detections": "a table that was looked at", "tableware_plan": "a plan to clear a table",
        "tableware_trial": "a table being cleared",
        "tableware_evaluation": "a comparison of policies",
        "suture_needle": "a needle that was looked at", "suture_thread": "a thread that was traced",
        "suture_trial": "sutures thrown in a simulator", "suture_evaluation": "their figures",
    }  # fmt: skip
    if isinstance(plan := artifacts.get("plan"), Plan):
        status = plan.info.status
        executed = {"executed": "a plan that a robot executed", "execution_failed": "a plan whose execution failed"}
        names["plan"] = executed.get(
            status, "a plan" if status == "planned" else "an attempt to plan that found no way"
        )
    made = [text for role, text in names.items() if role in artifacts]
    if made:
        parts.append(", ".join(made[:-1]) + (" and " if len(made) > 1 else "") + made[-1])
    text = " became ".join(parts) if len(parts) == 2 else "".join(parts)
    truth = ""
    if ground_truth is not None:
        file = ground_truth.info
        truth = f" The room was generated (recipe {file.recipe}, seed {file.seed}), so the truth is known."
        if file.source == "scan":
            truth = f" What is true of the room was annotated by people ({file.recipe})."
    return (text[:1].upper() + text[1:] + "." if text else "") + truth


def _add_frames(
    values: dict[str, Any], sequence: Sequence, segments: Segments | None, parameters: ReportParameters
) -> None:
    info = sequence.info
    views, legend = frame_views(sequence, segments, parameters.frames, parameters.frame_width)
    dropped = ", ".join(f"{count} {reason.replace('_', ' ')}" for reason, count in sorted(info.drops.items()) if count)
    text = f"{info.frame_count} of {info.frames_in_log} frames of the log were used"
    text += f" ({dropped} left out). " if dropped else ". "
    gravity = info.gravity.method.replace("_", " ")
    text += f"Read as {info.source_format}; which way is up: {gravity}. "
    text += "Each card: colour, depth (yellow near, blue far)" + (", segments." if segments is not None else ".")
    values.update(frames=views, legend=legend, frames_text=text)


def _add_views(
    values: dict[str, Any],
    ground_truth: GroundTruth | None,
    sequence: Sequence | None,
    panoptic_map: PanopticMap | None,
    cad_scene: CadScene | None,
    parameters: ReportParameters,
) -> View | None:
    """Draw map and CAD scene; returns the view of the whole room that they share, None when there is neither."""
    width = parameters.view_width
    height = round(0.62 * width)
    scanned = map_model(panoptic_map) if panoptic_map is not None else None
    oblique: View | None = None
    if panoptic_map is not None:
        info = panoptic_map.info
        values["map_text"] = (
            f"{len(info.entities)} entities in a map of {100 * info.voxel_size:g} cm voxels from "
            f"{info.frames_integrated} frames, masks: {info.segmentation}. Grey surface has no label. The near walls "
            "and the ceiling are cut away."
        )
    if scanned is not None:
        coloured = scanned.by_instance()
        oblique = oblique_view(coloured, width, height)
        values["map_views"] = {
            "oblique": _draw(coloured, oblique, "The map, every instance in its colour", 13.5 * width / 960),
            "top": _draw(coloured, top_view(coloured, round(0.75 * width)), "From above, y up", 15.5 * width / 960),
            "color": _draw(scanned, oblique, "In the colours of the images"),
        }
    if cad_scene is None:
        return oblique
    model = cad_model(cad_scene)
    if model is None:
        return oblique
    view = oblique or oblique_view(model, width, height)
    pictures = [_draw(model, view, "CAD scene", 20.0 * width / 960)]
    if values["map_views"] is not None:
        pictures.append(replace(values["map_views"]["color"], caption="The map from the same place."))
    if ground_truth is not None:
        upright = sequence is None or ground_truth.info.source == "scan"
        moved = np.eye(4) if upright or sequence is None else np.array(sequence.info.gravity.world_from_log)
        truth = true_model(ground_truth, moved)
        if truth is not None:
            pictures.append(replace(_draw(truth, view, "The true room from the same place"), of_masks=False))
    pictures.append(
        _draw(model, top_view(scanned or model, round(0.75 * width)), "CAD scene from above", 15.5 * width / 960)
    )
    scene = cad_scene.info
    decisions = [r.decision for r in scene.replacements]
    values.update(
        cad_views=pictures,
        replacements=[_replacement_row(r) for r in scene.replacements if r.decision != "layout"],
        cad_text=f"CAD models: {decisions.count('cad')}; objects that keep their mesh: {decisions.count('mesh')}; "
        f"layout: {decisions.count('layout')}. The global check went from {scene.conflicts_before} to "
        f"{scene.conflicts_after} colliding pairs in {scene.iterations} iterations.",
    )
    return view


def _draw(model: Model, view: View, caption: str, font_size: float | None = None) -> DrawnView:
    """Draw a model; with names on it where a font size is given (larger for pictures that are shown small)."""
    drawn: Rendering = render(model, view)
    labels = tuple(place_labels(drawn.instance, model.names, font_size)) if font_size else ()
    camera = view.camera
    picture = jpeg(drawn.color, caption, camera.width)
    return DrawnView(picture, labels, camera.width, camera.height, caption + ".", font_size or 0.0)


def _replacement_row(replacement: Replacement) -> dict[str, str]:
    chosen = replacement.chosen
    rejected = ", ".join(f"{count} {reason}" for reason, count in sorted(replacement.rejected.items()))
    others = ", ".join(dict.fromkeys(c.model_id for c in replacement.alternatives[:4]))
    what = chosen.model_id if chosen is not None and replacement.decision == "cad" else replacement.decision
    if replacement.reason:
        what += f" ({replacement.reason})"
    return {
        "node": replacement.node,
        "what": what,
        "scale": f"{chosen.scale:.3f}" if chosen else "",
        "matching": f"{chosen.matching_error:.3f}" if chosen else "",
        "alignment": f"{1000 * chosen.alignment_error:.0f} mm" if chosen else "",
        "rest": "; ".join(text for text in (others, f"rejected: {rejected}" if rejected else "") if text),
    }


def _add_candidates(
    values: dict[str, Any],
    cad_scene: CadScene,
    library: CadLibrary | None,
    panoptic_map: PanopticMap | None,
    view: View | None,
    parameters: ReportParameters,
) -> None:
    shelf = ModelShelf(cad_scene, library)
    scenes = checked_scenes(cad_scene, shelf)
    if scenes:
        view = view or oblique_view(scenes[-1].model, parameters.view_width, round(0.62 * parameters.view_width))
        size = 20.0 * parameters.view_width / 960
        values["checked"] = [_draw(scene.model, view, scene.caption, size) for scene in scenes]
    if parameters.candidates == 0:
        return
    objects = object_views(
        cad_scene, shelf, panoptic_map, count=parameters.candidates, width=parameters.candidate_width
    )
    values["objects_changed"] = [entry for entry in objects if entry.changed]
    values["objects_kept"] = [entry for entry in objects if not entry.changed]


def _add_trees(values: dict[str, Any], interactive_scene: InteractiveScene) -> None:
    path = interactive_scene.path(interactive_scene.info.combined_file)
    if not path.is_file():
        return
    try:
        values["trees"] = corresponding_trees(interactive_scene.graph, *read_joints(path))
    except ValueError as error:
        raise BadInput(f"{interactive_scene.path('graph.json')}: {error}", hint="run `urdf` again") from None


def _add_graph(values: dict[str, Any], contact_graph: ContactGraph, evaluation: Evaluation | None) -> None:
    graph = contact_graph.info
    marks, missing = marks_from_evaluation(evaluation.root) if evaluation is not None else ({}, ())
    try:
        values["graph"] = draw_graph(graph, marks, missing)
    except ValueError as error:
        raise BadInput(f"{contact_graph.path('graph.json')}: {error}", hint="make the graph again") from None
    counts: dict[str, int] = {}
    for link in graph.links:
        counts[link.relation] = counts.get(link.relation, 0) + 1
    edges = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in sorted(counts.items()))
    values["graph_text"] = f"{len(graph.nodes) - 1} entities; relations: {edges or 'none'}."
    errors: dict[str, int] = {}
    for mark in marks.values():
        name = mark.split(",")[0]
        errors[name] = errors.get(name, 0) + 1
    plurals = {"wrong class": "wrong classes"}
    values["graph_errors"] = ", ".join(
        f"{count} {name if count == 1 else plurals.get(name, name + 's')}" for name, count in sorted(errors.items())
    )


def _add_scene(values: dict[str, Any], interactive_scene: InteractiveScene) -> None:
    scene = interactive_scene.info
    movable = sum(body.movable for body in scene.bodies)
    joints = sum(len(body.joints) for body in scene.bodies)
    rows = body_rows(interactive_scene)
    values["bodies"] = [row for row in rows if row.joints or row.movable] or rows
    values["fixed_bodies"] = [row for row in rows if row not in values["bodies"]]
    values["scene_text"] = (
        f"{len(scene.bodies)} bodies, {movable} of them free to move, {joints} joints. {scene.combined_file} is the "
        f"whole kinematic tree; {scene.static_file} and one file per free body are for engines without floating joints."
    )


def _add_figures(values: dict[str, Any], evaluation: Evaluation, baseline: Evaluation | None) -> None:
    groups = metric_groups(evaluation, baseline)
    metrics = evaluation.info.metrics
    against_truth = any(not name.startswith("counts/") for name in metrics)
    measures = {measure.key: measure for _, rows in GROUPS for measure in rows}
    values.update(
        groups=groups,
        baseline=baseline is not None,
        has_intervals=any(row.interval for _, rows in groups for row in rows),
        notes=evaluation.info.notes,
        plots=read_plots(evaluation),
        tables=read_tables(evaluation),
        metrics=all_metrics(evaluation),
        tiles=[
            {"name": measures[key].name, "value": measures[key].form(value)}
            for key in HEADLINES
            if (value := metrics.get(key)) is not None
        ],
        figures_text=(
            "Against the ground truth of the generated room. Arrows say which way is better."
            if against_truth
            else "Counts; there is no ground truth to compare with."
        )
        + (
            " Class-agnostic masks name nothing: compare the rows that say “whatever the class”."
            if baseline is not None and metrics.get("map/pq") is not None and baseline_is_nameless(baseline)
            else ""
        ),
    )


def baseline_is_nameless(baseline: Evaluation) -> bool:
    """Whether the baseline's masks have no classes (its class-wise figures are undefined)."""
    theirs = baseline.info.metrics
    return theirs.get("map/pq") is None and theirs.get("map/pq_class_agnostic") is not None


def _write(values: dict[str, Any], artifacts: dict[str, Artifact], context: Context) -> Report:
    page = render_page(values)
    size = len(page.encode("utf-8"))
    if size > MAXIMUM_BYTES:
        raise BadInput(
            f"the report would have {size / 1e6:.0f} MB", hint="use smaller --frame-width, --view-width or --frames"
        )
    context.output.joinpath("report.html").write_text(page, encoding="utf-8")
    sections = tuple(section["id"] for section in values["sections"])
    sources = {role: a.manifest.content_digest if a.manifest is not None else "" for role, a in artifacts.items()}
    ReportFile(title=values["title"], sections=sections, sources=sources).write(context.output / "report.json")
    return Report(context.output, summary={"sections": len(sections), "pictures": page.count("data:image/")})
