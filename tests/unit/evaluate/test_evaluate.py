"""The step `evaluate` on a hand-made room: perfect, wrong in known ways, empty, and without ground truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.base import as_transform
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.evaluation import Evaluation
from scenewright.schemas.scene_parts import Box
from scenewright.schemas.sequence import Gravity
from scenewright.stages.evaluate.correspondence import merge_stuff_nodes
from scenewright.stages.evaluate.parameters import STAGE, EvaluateParameters, check_inputs
from scenewright.stages.evaluate.stage import run
from scenewright.stages.kit.formats.trajectories import write_tum
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.unit.evaluate.handmade import (
    LABEL,
    ROOM,
    graph_of,
    make_cad_scene,
    make_graph,
    make_ground_truth,
    make_interactive_scene,
    make_map,
    make_plan,
    make_segments,
    make_sequence,
    poses,
)

FLOOR, WALL, TABLE, CUP, CHAIR, CABINET, BOTTLE = ROOM


def evaluate(out: Path, plots: bool = False, **inputs) -> Evaluation:
    out.mkdir()
    context = Context(output=out, seed=0, device="cpu", progress=SilentProgress())
    return run(**inputs, parameters=EvaluateParameters(plots=plots), context=context)


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    return make_ground_truth(tmp_path_factory.mktemp("truth") / "ground_truth")


def test_a_perfect_reconstruction(tmp_path, truth):
    result = evaluate(
        tmp_path / "evaluation",
        plots=True,
        ground_truth=truth,
        sequence=make_sequence(tmp_path / "sequence"),
        segments=make_segments(tmp_path / "segments"),
        panoptic_map=make_map(tmp_path / "map"),
        contact_graph=make_graph(tmp_path / "graph", graph_of(ROOM)),
        cad_scene=make_cad_scene(tmp_path / "cad"),
        interactive_scene=make_interactive_scene(tmp_path / "scene"),
        plan=make_plan(tmp_path / "plan"),
    )
    metrics = result.info.metrics
    assert result.info.label == f"{LABEL}, handmade, seed 3"
    exact = {
        "map/rq": 1.0,
        "map/rq_thesis_code": 1.0,
        "map/instance_ap50": 1.0,
        "map/mesh_recall": 1.0,
        "map/mesh_precision": 1.0,
        "graph/edit_distance": 0.0,
        "graph/edit_distance_exact": 1.0,
        "graph/any_support_f1": 1.0,
        "graph/contains_f1": 1.0,
        "graph/obb_ap50_observed": 1.0,
        "graph/obb_ap50_refined": 1.0,
        "graph/obb_ap50_refined_thesis_code": 1.0,
        "cad/class_match": 1.0,
        "cad/model_top1": 1.0,
        "cad/position_error_m_mean": 0.0,
        "cad/yaw_error_rad_mean": 0.0,
        "cad/joints_revolute_compared": 1.0,
        "trajectory/ate_rmse_m": 0.0,
        "plan/checks_held": 1.0,
        "plan/goal_reached": 0.0,
        "counts/entities": 7.0,
        "counts/entities_cup": 1.0,
        "counts/support_edges": 5.0,
        "counts/frames_dropped": 1.0,
        "counts/joints": 1.0,
    }
    assert {name: metrics[name] for name in exact} == pytest.approx(exact, abs=1e-9)
    assert metrics["map/pq"] > 0.85  # below 1: points between two touching boxes go to the nearest vertex
    assert metrics["cad/joint_error_revolute_rad_mean"] == pytest.approx(0.1)
    assert metrics["map/accuracy_mean_mm"] < 0.01
    plots = {path.name for path in (result.root / "plots").iterdir()}
    assert plots == {"panoptic_quality.png", "surface_distance.png", "contact_graphs.png", "camera_path.png"}
    for name in ("panoptic_quality", "graph_edges", "graph_edit_distance", "cad_objects", "entities", "plan_checks"):
        assert (result.root / "tables" / f"{name}.csv").is_file()
        assert (result.root / "tables" / f"{name}.md").read_text().startswith("### ")


def test_known_mistakes_give_known_figures(tmp_path, truth):
    """Chair missed, table called desk, cup on the floor, an extra sofa far from everything."""
    table = replace(TABLE, class_name="desk")
    cup = replace(CUP, parent=1)
    sofa = replace(CHAIR, instance=9, class_name="sofa", low=(3.0, 3.0, 0.0), high=(3.5, 3.5, 0.6))
    seen = (FLOOR, WALL, table, cup, CABINET, BOTTLE, sofa)
    metrics = evaluate(
        tmp_path / "evaluation",
        ground_truth=truth,
        panoptic_map=make_map(tmp_path / "map", seen),
        contact_graph=make_graph(tmp_path / "graph", graph_of(seen)),
    ).info.metrics
    # 2 wrong support (cup) + 1 wrong class (table) + 1 missing (chair) + 1 extra (sofa)
    assert metrics["graph/edit_distance"] == 5
    assert metrics["graph/wrong_supports"] == 1
    assert metrics["graph/missing_detections"] == 1
    assert metrics["graph/wrong_detections"] == 2
    # classes of PQ: floor wall cup cabinet bottle (found), chair table (missed), desk sofa (extra)
    assert metrics["map/classes"] == 9
    assert metrics["map/rq"] == pytest.approx(5 / 9)
    # the thesis's averages leave out chair and table, which were never predicted
    assert metrics["map/rq_thesis_code"] > metrics["map/rq"]
    # AP over true thing classes: cup cabinet bottle of table cup chair cabinet bottle
    assert metrics["map/instance_ap50"] == pytest.approx(3 / 5)
    assert metrics["graph/obb_ap50_refined"] == pytest.approx(3 / 5)
    # whatever the class: cabinet, desk, sofa (extra), then bottle and cup, by size; the chair is never found
    assert metrics["map/instance_ap50_class_agnostic"] == pytest.approx((1 + 1 + 4 / 5 + 4 / 5) / 5)
    assert metrics["graph/any_support_recall"] == pytest.approx(5 / 7)
    assert metrics["map/mesh_recall"] < 1.0


def test_an_empty_map_is_zero_and_not_a_crash(tmp_path, truth):
    metrics = evaluate(
        tmp_path / "evaluation",
        plots=True,
        ground_truth=truth,
        panoptic_map=make_map(tmp_path / "map", ()),
        contact_graph=make_graph(tmp_path / "graph", graph_of(())),
    ).info.metrics
    assert metrics["map/pq"] == metrics["map/rq"] == metrics["map/instance_ap50"] == metrics["map/mesh_recall"] == 0.0
    assert metrics["map/pq_thesis_code"] is None
    assert metrics["graph/edit_distance"] == len(ROOM)
    assert metrics["graph/obb_ap50_refined"] == 0.0
    assert metrics["counts/entities"] == 0


def test_class_agnostic_masks_have_no_figures_by_class(tmp_path, truth):
    """Every entity found and none named; the floor in two parts and the wall count neither way."""
    low = replace(FLOOR, instance=20, high=(0.0, 2.0, 0.0))
    high = replace(FLOOR, instance=21, low=(0.0, -2.0, -0.02))
    nameless = tuple(replace(t, class_name="object") for t in (low, high, *ROOM[1:]))
    metrics = evaluate(
        tmp_path / "evaluation", ground_truth=truth, panoptic_map=make_map(tmp_path / "map", nameless)
    ).info.metrics
    assert metrics["map/pq"] is None
    assert metrics["map/instance_ap50"] is None
    assert metrics["map/rq_class_agnostic"] == 1.0
    assert metrics["map/instance_ap50_class_agnostic"] == 1.0


def test_refinement_is_measured(tmp_path, truth):
    """Before refinement the chair's box hangs in the air at half height; after it stands on the floor."""
    graph = graph_of(ROOM)
    hanging = Box(center=(-0.95, -0.25, 0.7), size=(0.5, 0.5, 0.4))
    nodes = tuple(
        node.model_copy(update={"box_observed": hanging}) if node.class_name == "chair" else node
        for node in graph.nodes
    )
    changed = make_graph(tmp_path / "graph", graph.model_copy(update={"nodes": nodes}))
    metrics = evaluate(tmp_path / "evaluation", ground_truth=truth, contact_graph=changed).info.metrics
    assert metrics["graph/obb_ap50_observed"] == pytest.approx(4 / 5)
    assert metrics["graph/obb_ap50_refined"] == 1.0
    assert metrics["graph/edit_distance"] == 0  # paired by boxes, as no map is given


def test_entities_that_the_camera_never_saw_count_neither_way(tmp_path):
    hidden = make_ground_truth(tmp_path / "truth", unseen=frozenset({7}))
    without = tuple(t for t in ROOM if t.instance != 7)
    inputs = {"panoptic_map": make_map(tmp_path / "map", without)}
    graph = make_graph(tmp_path / "graph", graph_of(without))
    metrics = evaluate(tmp_path / "a", ground_truth=hidden, contact_graph=graph, **inputs).info.metrics
    assert (metrics["graph/edit_distance"], metrics["graph/true_nodes"]) == (0, 6)
    assert metrics["map/instance_ap50"] == 1.0
    assert metrics["graph/any_support_recall"] == 1.0
    seen = evaluate(tmp_path / "b", ground_truth=make_ground_truth(tmp_path / "all"), contact_graph=graph, **inputs)
    assert seen.info.metrics["graph/edit_distance"] == 1


def test_cad_errors(tmp_path, truth):
    scene = make_cad_scene(tmp_path / "cad", shift=0.03, turn=np.radians(100))
    metrics = evaluate(tmp_path / "evaluation", ground_truth=truth, cad_scene=scene).info.metrics
    assert metrics["cad/position_error_m_mean"] == pytest.approx(0.03)
    assert metrics["cad/position_error_m_mean_low"] <= 0.03 + 1e-9 <= metrics["cad/position_error_m_mean_high"] + 2e-9
    assert metrics["cad/yaw_error_rad_mean"] == pytest.approx(np.radians(100))
    assert metrics["cad/yaw_error_quarter_turn_rad_median"] == pytest.approx(np.radians(10))
    assert metrics["cad/yaw_symmetric_within_20deg"] == 0.0
    assert metrics["cad/open_state_match"] == 1.0
    assert metrics["cad/joint_error_prismatic_m_mean"] is None


def test_truth_follows_what_ingest_did_to_the_world(tmp_path, truth):
    """Everything reconstructed in a turned and shifted world scores as before when the sequence says so."""
    world_from_log = transform_from_yaw(0.6, np.array([0.3, -0.2, 0.05]))
    sequence = make_sequence(tmp_path / "sequence")
    info = sequence.info
    gravity = Gravity(method="floor_plane", world_from_log=as_transform(world_from_log))
    info.model_copy(update={"gravity": gravity}).write(tmp_path / "sequence" / "sequence.json")
    graph = graph_of(ROOM)

    def moved(box: Box) -> Box:
        center = world_from_log[:3, :3] @ np.array(box.center) + world_from_log[:3, 3]
        return Box(center=tuple(center), orientation=(0.0, 0.0, np.sin(0.3), np.cos(0.3)), size=box.size)

    nodes = tuple(n if n.box is None else n.model_copy(update={"box": moved(n.box)}) for n in graph.nodes)
    nodes = tuple(n.model_copy(update={"box_observed": n.box}) for n in nodes)
    turned = make_graph(tmp_path / "graph", graph.model_copy(update={"nodes": nodes}))
    inputs = {"ground_truth": truth, "contact_graph": turned}
    metrics = evaluate(tmp_path / "with", sequence=sequence, **inputs).info.metrics
    assert metrics["graph/obb_ap50_refined"] == 1.0
    assert metrics["trajectory/ate_rmse_m"] > 0.1  # the trajectory file itself was not moved
    assert metrics["trajectory/ate_rmse_aligned_m"] < 1e-6
    assert evaluate(tmp_path / "without", **inputs).info.metrics["graph/obb_ap50_refined"] < 1.0


def test_without_ground_truth_there_are_counts_only(tmp_path):
    result = evaluate(
        tmp_path / "evaluation",
        plots=True,
        panoptic_map=make_map(tmp_path / "map"),
        contact_graph=make_graph(tmp_path / "graph", graph_of(ROOM)),
    )
    assert {name.split("/")[0] for name in result.info.metrics} == {"counts"}
    assert result.info.metrics["counts/floor_height_rms_m"] == pytest.approx(0.014, abs=0.001)
    assert result.info.metrics["counts/floor_tilt_rad"] == pytest.approx(0.0, abs=1e-6)
    assert "no ground truth" in result.info.notes[-1]
    assert (result.root / "plots" / "contact_graph.png").is_file()


def test_twice_the_same_gives_the_same_bytes(tmp_path, truth):
    inputs = {
        "ground_truth": truth,
        "sequence": make_sequence(tmp_path / "sequence"),
        "panoptic_map": make_map(tmp_path / "map"),
        "contact_graph": make_graph(tmp_path / "graph", graph_of(ROOM)),
        "cad_scene": make_cad_scene(tmp_path / "cad", shift=0.01),
    }
    first = evaluate(tmp_path / "a", plots=True, **inputs)
    second = evaluate(tmp_path / "b", plots=True, **inputs)
    files = sorted(path.relative_to(first.root) for path in first.root.rglob("*") if path.is_file())
    assert len(files) > 15
    for name in files:
        assert (first.root / name).read_bytes() == (second.root / name).read_bytes(), name


def test_labels_that_do_not_fit_the_mesh_are_refused(tmp_path, truth):
    broken = make_map(tmp_path / "map")
    np.savez(tmp_path / "map" / "mesh_labels.npz", instance=np.zeros(3, dtype=np.int32))
    with pytest.raises(BadInput, match="3 labels"):
        evaluate(tmp_path / "evaluation", ground_truth=truth, panoptic_map=broken)


def test_truncated_visible_points_are_refused(tmp_path):
    broken = make_ground_truth(tmp_path / "truth")
    path = tmp_path / "truth" / "visible.npz"
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(BadInput, match="visible"):
        evaluate(tmp_path / "evaluation", ground_truth=broken, panoptic_map=make_map(tmp_path / "map"))


def test_a_sequence_of_another_log_is_refused(tmp_path, truth):
    sequence = make_sequence(tmp_path / "sequence")
    write_tum(sequence.path("trajectory.tum"), np.arange(6) * 0.1 + 100.0, poses())
    with pytest.raises(BadInput, match="time stamps"):
        evaluate(tmp_path / "evaluation", ground_truth=truth, sequence=sequence)


def test_nothing_to_evaluate_is_a_usage_error():
    with pytest.raises(UsageError, match="nothing to evaluate"):
        check_inputs(EvaluateParameters(), {"ground_truth": Path("x")})
    check_inputs(EvaluateParameters(), {"panoptic_map": Path("x")})
    assert STAGE.required() == ()


def test_walls_are_one_node():
    second = replace(WALL, instance=8, low=(-2, -2.04, 0), high=(2, -2, 2.4))
    shelf = replace(CHAIR, instance=9, class_name="shelf", parent=8, relation="carries_on_wall")
    merged, kept = merge_stuff_nodes(graph_of((*ROOM, second, shelf)))
    assert kept["wall_8"] == "wall_2"
    assert {node.id for node in merged.nodes} == {n.id for n in graph_of((*ROOM, shelf)).nodes}
    assert merged.parent_link("shelf_9").source == "wall_2"
    assert isinstance(merged, ContactGraphFile)
