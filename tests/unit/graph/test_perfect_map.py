"""Precision and recall of support edges on the map that a perfect reconstruction of a known room would give."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.schemas.base import as_transform
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.ground_truth import GroundTruth, GroundTruthFile, TrueObject
from scenewright.schemas.scene_parts import Camera, Relation
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.stage import run
from scenewright.stages.kit.geometry.boxes import box_from_bounds, box_iou, minimum_box
from scenewright.stages.kit.measurement.edge_agreement import edge_agreement
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.panoptic_maps import box_mesh, chair_mesh, floor_mesh, perfect_map, placed, seen_surface, table_mesh

ROOM = {
    1: ("floor", floor_mesh((-1.5, -1.3), (1.5, 1.5))),
    2: ("wall", box_mesh((-1.5, 1.5, 0), (1.5, 1.6, 2.2))),
    3: ("table", table_mesh((0.3, 0.1), yaw=0.2)),
    4: ("chair", chair_mesh((0.3, -0.4), yaw=0.2 + np.pi)),
    5: ("cup", placed(trimesh.creation.cylinder(radius=0.04, height=0.1), (0.5, 0.1, 0.8))),
    6: ("book", box_mesh((0.0, 0.0, 0.75), (0.2, 0.15, 0.79))),
    7: ("cup", placed(trimesh.creation.cylinder(radius=0.04, height=0.1), (0.1, 0.08, 0.84))),
    8: ("wall_cabinet", box_mesh((-1.2, 1.2, 1.3), (-0.6, 1.49, 1.9))),
    9: ("desk", table_mesh((-0.9, 0.9), (0.9, 0.6, 0.72))),
    10: ("monitor", box_mesh((-1.15, 1.05, 0.72), (-0.65, 1.1, 1.1))),
}
PARENTS = {
    1: ("scene", "supports"),
    2: ("scene", "supports"),
    3: ("floor_1", "supports"),
    4: ("floor_1", "supports"),
    5: ("table_3", "supports"),
    6: ("table_3", "supports"),
    7: ("book_6", "supports"),
    8: ("wall_2", "carries_on_wall"),
    9: ("floor_1", "supports"),
    10: ("desk_9", "supports"),
}


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> GroundTruth:
    """The parts of a ground_truth artifact that a perfect map needs."""
    root = tmp_path_factory.mktemp("truth")
    meshes = {k: mesh for k, (_, mesh) in ROOM.items()}
    eyes = [(-0.9, -1.2, 1.5), (1.3, -1.2, 1.6), (1.3, 1.2, 1.7), (-1.4, 0.2, 1.2)]
    points, instance = [], []
    for k, tiles in seen_surface(meshes, eyes, spacing=0.012).items():
        centers = np.asarray(tiles.vertices).reshape(-1, 4, 3).mean(axis=1)
        points.append(centers)
        instance.append(np.full(len(centers), k))
    np.savez(
        root / "visible.npz",
        points=np.concatenate(points).astype(np.float32),
        instance=np.concatenate(instance).astype(np.int32),
    )
    trimesh.util.concatenate(list(meshes.values())).export(root / "mesh.ply")
    objects = tuple(
        TrueObject(
            instance=k,
            name=f"{name}_{k}",
            class_name=name,
            world_from_model=as_transform(np.eye(4)),
            box=minimum_box(mesh.vertices),
            visible_pixels=1,
        )
        for k, (name, mesh) in ROOM.items()
    )
    GroundTruthFile(
        seed=0,
        recipe="by hand",
        room_size=(3.0, 2.8, 2.2),
        camera=Camera(width=64, height=48, fx=60, fy=60, cx=31.5, cy=23.5),
        frame_count=4,
        depth_noise=False,
        objects=objects,
    ).write(root / "ground_truth.json")
    nodes = [GraphNode(id="scene", instance=0, class_name="scene", node_type="scene")]
    for entry in objects:
        kind = "layout" if entry.class_name in ("floor", "wall") else "rigid"
        kind = "articulated" if entry.class_name == "wall_cabinet" else kind
        nodes.append(
            GraphNode(
                id=entry.name, instance=entry.instance, class_name=entry.class_name, node_type=kind, box=entry.box
            )
        )
    links = [
        Relation(source=source, target=f"{ROOM[k][0]}_{k}", relation=relation, confidence=1.0)
        for k, (source, relation) in PARENTS.items()
    ]
    ContactGraphFile(nodes=tuple(nodes), links=tuple(links)).write(root / "graph.json")
    return GroundTruth(root)


def graph_of(truth: GroundTruth, folder: Path, method: str) -> ContactGraphFile:
    output = folder / method
    output.mkdir()
    context = Context(output=output, seed=0, device="cpu", progress=SilentProgress())
    panoptic_map = perfect_map(truth, folder / f"map_{method}")
    return run(panoptic_map, parameters=GraphParameters(method=method), context=context).info


def test_support_edges_of_a_perfect_map(truth, tmp_path):
    graph = graph_of(truth, tmp_path, "ours")
    names = {node.id: node.id for node in truth.graph.nodes}
    agreement = edge_agreement(truth.graph, graph, names)["any_support"]
    assert agreement.true_count == len(ROOM)
    assert agreement.precision == 1.0 and agreement.recall == 1.0
    for entry in truth.info.objects:
        # Back sides were not seen; the boxes are those of what was.
        if entry.class_name in ("table", "chair", "desk"):
            assert box_iou(graph.node(entry.name).box, entry.box) > 0.85, entry.name


def test_the_thesis_rule_finds_most_of_it(truth, tmp_path):
    graph = graph_of(truth, tmp_path, "thesis")
    names = {node.id: node.id for node in truth.graph.nodes}
    assert edge_agreement(truth.graph, graph, names)["any_support"].recall >= 0.9


def test_the_perfect_map_is_what_was_seen(truth, tmp_path):
    panoptic_map = perfect_map(truth, tmp_path / "map")
    assert {entity.instance for entity in panoptic_map.info.entities} == set(ROOM)
    low, high = np.array(ROOM[9][1].bounds)
    desk = next(entity for entity in panoptic_map.info.entities if entity.instance == 9)
    seen = box_from_bounds(desk.box_minimum, desk.box_maximum)
    assert box_iou(seen, box_from_bounds(low, high)) > 0.9
    mesh = trimesh.load(panoptic_map.path(desk.mesh), process=False)
    top = mesh.triangles_center[:, 2] > 0.715
    # All but the tiles on the rim of the board.
    assert np.mean(mesh.face_normals[top][:, 2] > 0.99) > 0.95
