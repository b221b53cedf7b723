"""The recorded logs against what was annotated by eye (data/annotations/real)."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraph, ContactGraphFile, GraphNode
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence
from scenewright.stages.evaluate import TrueRoom, load_map, load_truth
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.measurement.pose_error import yaw_of
from scenewright.stages.truth import SupportAnnotation, read_support_annotation
from scenewright.stages.urdf.settle_report import settle_report

from benchmarks.board.method import Method
from benchmarks.board.real.chain import Run, masks_of, run_chain
from benchmarks.board.real.logs import ANNOTATED, ANNOTATIONS, LOGS, OUTLINES, Log
from benchmarks.board.real.records import AnnotatedRecord, Edges, Settling, Things
from benchmarks.board.real.things import judged, overlaps_of, partners, surfaces_off
from benchmarks.graph_scores import OPTIONS, judge
from benchmarks.steps import opened, step

WORLDS = Path(__file__).parent / "worlds.json"
"""Log -> `world_from_log` of the sequence that its annotation was made in."""
EVERY = 3
"""Every how many-th frame of the sequence shows the annotated things their surface."""
NEAR = 0.05
"""A stand-in is where its thing stood when half of what was seen lies at most so far from its surface [m]; less than
between middles (`told.NEAR`), since what slides along itself is as near as before."""
SAME = 1e-6
"""Worlds that differ less are one [m, rad]."""
NO_GRAPH = ContactGraphFile(
    nodes=(GraphNode(id=SCENE_NODE, instance=0, class_name=SCENE_NODE, node_type="scene"),), links=()
)
"""What is there where the chain made none."""


def measure_annotated(method: Method, log_name: str, data: Path, scratch: Path) -> AnnotatedRecord:
    """Run the chain of a log of `LOGS` below `scratch` and judge what it made."""
    log = LOGS[log_name].within(data)
    run = run_chain(method, log, scratch / log.name, scratch / "cad_library", masks_of(data))
    sequence = run.made(Sequence) or own_sequence(log, scratch / log.name)
    record = AnnotatedRecord(
        log.name,
        annotated=log.name in ANNOTATED,
        settling=settling_of(run.made(InteractiveScene)),
        frames=sequence.info.frame_count,
        seconds=run.seconds,
        failed=run.failed,
    )
    if not record.annotated:
        return record
    things, supports = judge_run(annotated_room(log.name, sequence, scratch / log.name), run)
    return replace(record, things=things, supports=supports)


def own_sequence(log: Log, folder: Path) -> Sequence:
    """Return the sequence that this checkout makes of a log: what is true is known where the method reads nothing."""
    Method().run("ingest", folder / "own_sequence", *log.words)
    return opened(Sequence, folder / "own_sequence")


def annotated_room(name: str, sequence: Sequence, folder: Path) -> TrueRoom:
    """Return what is annotated of a log in the world of a sequence of it; writes below `folder`.

    Outlines that were painted in its frames come before boxes, which hold the wall and the worktop beside a thing."""
    outlines = OUTLINES / f"{name}.json"
    truth = annotated_truth(name, sequence, folder, outlines if outlines.is_file() else None)
    return load_truth(truth, np.eye(4), OPTIONS.minimum_visible_points)


def annotated_truth(name: str, sequence: Sequence, folder: Path, outlines: Path | None = None) -> GroundTruth:
    """Make ground truth of what is annotated of a log below `folder`, by boxes, or by `outlines` painted in frames."""
    told_in = np.array(json.loads(WORLDS.read_text(encoding="utf-8"))[name])
    motion = np.array(sequence.info.gravity.world_from_log) @ inverse(told_in)
    annotation = ANNOTATIONS / f"{name}.json"
    if np.abs(motion - np.eye(4)).max() > SAME:
        told = moved(read_support_annotation(annotation), motion)
        annotation = folder / "annotation.json"
        annotation.write_text(json.dumps(told.model_dump(mode="json", by_alias=True)), encoding="utf-8")
    given: dict[str, Any] = {"annotation": annotation, "sequence": sequence.root}
    if outlines is not None:
        given["outlines"] = outlines
    return opened(GroundTruth, step("truth supports", folder / "ground_truth", {"every": EVERY}, **given))


def moved(told: SupportAnnotation, motion: np.ndarray) -> SupportAnnotation:
    """Return an annotation by boxes in another upright world, `motion` (4, 4) from its own."""
    turn = float(np.degrees(yaw_of(motion[:3, :3])))
    nodes = []
    for node in told.nodes:
        assert node.find.box is not None, "the annotations of recordings find things by boxes"
        center = tuple(float(value) for value in apply(motion, np.array(node.find.box.center)))
        yaw = (node.find.box.yaw_degrees + turn + 180) % 360 - 180
        box = node.find.box.model_copy(update={"center": center, "yaw_degrees": yaw})
        nodes.append(node.model_copy(update={"find": node.find.model_copy(update={"box": box})}))
    return told.model_copy(update={"nodes": tuple(nodes)})


def judge_run(truth: TrueRoom, run: Run) -> tuple[Things, Edges]:
    """Hold what the chain made against the truth; what it did not make is missed."""
    made, graph, scene = run.made(PanopticMap), run.made(ContactGraph), run.made(CadScene)
    predicted = None if made is None else load_map(made)
    overlaps = {} if predicted is None else overlaps_of(truth, predicted)
    found = {} if predicted is None else partners(truth, overlaps, predicted.classes())
    off = {} if scene is None else surfaces_off(truth, found, scene)
    edges = judge(truth, NO_GRAPH if graph is None else graph.info, overlaps)[1]["any_support"]
    return judged(truth, predicted, found, off, NEAR), Edges(edges.true_count, edges.predicted_count, edges.agreed)


def settling_of(scene: InteractiveScene | None) -> Settling | None:
    """Let a scene go in Bullet; None without one. Raises BadInput for a scene that cannot be loaded."""
    if scene is None:
        return None
    report = settle_report(scene.root)
    return Settling(
        movable=len(report.bodies),
        stay=len(report.bodies) - len(report.unsettled),
        joints=len(report.joints),
        blocked=len(report.blocked),
        collisions=len(report.collisions),
    )
