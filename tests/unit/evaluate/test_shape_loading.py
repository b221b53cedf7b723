"""From artifacts to figures: a true room written as the simulator reads it, and CAD scenes out of library models."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import CadCandidate, CadScene, CadSceneFile, Replacement
from scenewright.schemas.ground_truth import GroundTruth, GroundTruthFile, TrueObject
from scenewright.stages.evaluate.replacement_measures import RoomReplacements, replacements_of
from scenewright.stages.evaluate.replacement_record import record_replacements
from scenewright.stages.evaluate.results import Part
from scenewright.stages.evaluate.shape_loading import true_shapes
from scenewright.stages.evaluate.truth import load_truth
from scenewright.stages.kit.formats.scene_bundle import BundleBody, write_scene_bundle
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

from tests.unit.evaluate.handmade import CAMERA
from tests.unit.urdf.small_room import graph_of, placed, room, small_library

TURNED = transform_from_yaw(0.7, np.array([0.5, -1.0, 0.0]))
"""What ingest did to the log's world."""


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> CadLibrary:
    return small_library(tmp_path_factory.mktemp("library"), "table", "fridge", "cup", "bottle", "cabinet", shapes=2)


def bodies_of(library: CadLibrary) -> list[BundleBody]:
    """The small room and a shrunk cabinet with a drawer that stands open."""
    slides = [
        (model, joint.name)
        for model in library.info.models
        if model.class_name == "cabinet"
        for joint in model.joints
        if joint.type == "prismatic"
    ]
    model, joint = slides[0]
    cabinet = placed(library, "cabinet_8", model.id, (-1.0, 1.0, 0.0), parent="floor_1", scale=0.9, joints={joint: 0.1})
    return [*room(library), cabinet]


def make_truth(root: Path, bodies: list[BundleBody]) -> GroundTruth:
    (root / "room").mkdir(parents=True)
    write_scene_bundle(root / "room", bodies, graph_of(bodies))
    instances = {body.name: int(body.name.rsplit("_", 1)[1]) for body in bodies}
    objects = tuple(
        TrueObject(
            instance=instances[b.name],
            name=b.name,
            class_name=b.class_name,
            scale=b.scale,
            box=b.box,
            model_id=b.model.id if b.model else None,
            world_from_model=as_transform(b.world_from_body),
            joints=b.joint_values,
            visible_pixels=900,
        )
        for b in bodies
    )
    GroundTruthFile(
        seed=1, recipe="small", room_size=(4, 3, 2.5), camera=CAMERA, frame_count=1, depth_noise=False, objects=objects
    ).write(root / "ground_truth.json")
    graph_of(bodies).write(root / "graph.json")
    labels = np.repeat(sorted(instances.values()), 50).astype(np.int32)
    np.savez(root / "visible.npz", points=np.zeros((len(labels), 3), np.float32), instance=labels)
    (root / "mesh.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    return GroundTruth(root)


def make_cad(
    root: Path, bodies: list[BundleBody], library: CadLibrary, best: dict[str, CadCandidate] | None = None
) -> CadScene:
    """The same room out of library models, moved as ingest moved the log; `best`: node -> best single candidate."""
    moved = [body.__class__(**{**body.__dict__, "world_from_body": TURNED @ body.world_from_body}) for body in bodies]
    graph = graph_of(moved)
    replacements = []
    for body in moved:
        if body.model is None:
            replacements.append(Replacement(node=body.name, decision="layout"))
            continue
        chosen = CadCandidate(
            model_id=body.model.id,
            joints=body.joint_values,
            scale=body.scale,
            world_from_model=as_transform(body.world_from_body),
            matching_error=0.1,
            alignment_error=0.01,
        )
        single = (best or {}).get(body.name)
        replacements.append(Replacement(node=body.name, decision="cad", chosen=chosen, best_single=single))
        if not (root / "models" / body.model.id).exists():
            shutil.copytree(library.path("models") / body.model.id, root / "models" / body.model.id)
    (root / "layout").mkdir()
    CadSceneFile(replacements=tuple(replacements), conflicts_before=0, conflicts_after=0, iterations=0).write(
        root / "scene.json"
    )
    graph.write(root / "graph.json")
    return CadScene(root)


@pytest.fixture(scope="module")
def bodies(library) -> list[BundleBody]:
    return bodies_of(library)


@pytest.fixture(scope="module")
def truth(tmp_path_factory, bodies) -> GroundTruth:
    return make_truth(tmp_path_factory.mktemp("truth") / "ground_truth", bodies)


def overlaps(bodies: list[BundleBody]) -> dict[tuple[int, int], float]:
    numbers = [int(body.name.rsplit("_", 1)[1]) for body in bodies]
    return {(number, number): 1.0 for number in numbers}


def measured(truth: GroundTruth, cad: CadScene, bodies: list[BundleBody], **more) -> RoomReplacements:
    seen = load_truth(truth, TURNED, 40)
    return replacements_of(true_shapes(truth, TURNED), seen, cad, overlaps=overlaps(bodies), **more)


def test_the_true_room_out_of_the_library_has_no_errors(tmp_path, library, truth, bodies):
    found = measured(truth, make_cad(tmp_path / "cad", bodies, library), bodies)
    assert [r.name for r in found.objects if not (r.success and r.functional and r.rank == 1)] == []
    summary = found.summary
    for name in (
        "translation_error_m_mean",
        "rotation_error_rad_mean",
        "scale_ratio_error_mean",
        "joint_axis_angle_rad_mean",
        "joint_axis_offset_m_mean",
        "joint_limit_error_prismatic_m_mean",
        "joint_limit_error_revolute_rad_mean",
        "joint_value_error_prismatic_m_mean",
    ):
        assert summary[name] == pytest.approx(0.0, abs=2e-5), name
    assert summary["joints_found"] == 1.0 and summary["joints_spurious"] == 0.0
    assert summary["color_difference_mean"] == pytest.approx(0.0, abs=1.0)  # colours of a URDF have four digits
    part = Part("replacement")
    record_replacements(part, found)
    assert {f"replacement/{name}" for name in summary} == set(part.metrics)
    tables = {table.name: table for table in part.tables}
    assert len(tables["replacement_objects"].rows) == len(found.objects)
    assert {row[1] for row in tables["replacement_joints"].rows} >= {"door_hinge"}
    for table in part.tables:
        assert all(len(row) == len(table.columns) for row in table.rows)


def test_true_shapes_stand_where_the_room_has_them(truth, bodies):
    shapes = true_shapes(truth, np.eye(4))
    assert set(shapes) == {body.name for body in bodies if body.model is not None}
    for body in bodies:
        if body.model is None:
            continue
        corners = np.concatenate([piece.vertices for piece in shapes[body.name].pieces()])
        low = np.array(body.box.center) - 0.5 * np.array(body.box.size)
        high = np.array(body.box.center) + 0.5 * np.array(body.box.size)
        assert (corners.min(axis=0) >= low - 0.005).all() and (corners.max(axis=0) <= high + 0.005).all()
    assert shapes["cup_5"].shape.movable and not shapes["table_3"].shape.movable
    assert shapes["fridge_4"].values["door_hinge"] == pytest.approx(1.2)


def test_before_the_global_check_needs_the_library(tmp_path, library, truth, bodies):
    """Best by itself: the table a metre away, as another model that only the library has."""
    other = next(m.id for m in library.info.models if m.class_name == "table" and m.id != "table_00")
    pose = np.array(TURNED)
    pose[0, 3] += 1.0
    single = CadCandidate(
        model_id=other, scale=1.0, world_from_model=as_transform(pose), matching_error=0.1, alignment_error=0.01
    )
    cad = make_cad(tmp_path / "cad", bodies, library, {"table_3": single})
    after = {r.name: r for r in measured(truth, cad, bodies).objects}
    assert after["table_3"].success and after["table_3"].rank == 2
    models = library.path("models")
    before = {r.name: r for r in measured(truth, cad, bodies, best_single=True, library_models=models).objects}
    assert before["table_3"].model == other and before["table_3"].alignment.translation > 0.8
    assert not before["table_3"].success and before["cup_5"].success
    without = {r.name: r for r in measured(truth, cad, bodies, best_single=True).objects}
    assert without["table_3"].model == other and without["table_3"].alignment is None
