"""The CAD library as built: every class, truthful records, hollow collision, doors that open, stable bytes."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yourdfpy
from scenewright.schemas.cad_library import CadLibrary, CadModel
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.formats.cad_models import (
    load_collision_parts,
    load_visual_parts,
    model_folder,
    part_transforms,
    posed_collision,
    posed_mesh,
    read_model,
)
from scenewright.stages.kit.formats.urdf_check import check_urdf
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.library.families import GENERATORS
from scenewright.stages.library.parameters import LibraryParameters
from scenewright.stages.library.stage import run

from tests.unit.library.clearance import depths_of_links

GRIPPER_OPENING = 0.08
REQUIRED = {
    *("chair", "table", "desk", "cabinet", "wall_cabinet", "shelf", "fridge", "microwave", "sofa", "bed"),
    *("monitor", "keyboard", "bottle", "cup", "bowl", "box", "bin"),
}
ARTICULATED = {"cabinet", "wall_cabinet", "fridge", "microwave"}
FIRST = tuple(GENERATORS)[:19]
"""Furniture of which several shapes are built here; test_more_classes.py has one of each of the others."""


def build(output: Path, seed: int, **parameters) -> CadLibrary:
    output.mkdir(parents=True)
    context = Context(output=output, seed=seed, device="cpu", progress=SilentProgress())
    return run(parameters=LibraryParameters(**parameters), context=context)


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> CadLibrary:
    return build(tmp_path_factory.mktemp("library") / "cad_library", 3, classes=FIRST)


@pytest.fixture(scope="module")
def models(library) -> list[CadModel]:
    return list(library.info.models)


def digest(root: Path) -> str:
    files = sorted(path for path in root.rglob("*") if path.is_file())
    return hashlib.sha256(b"".join(str(f.relative_to(root)).encode() + f.read_bytes() for f in files)).hexdigest()


def inside(pieces: list[trimesh.Trimesh], point: np.ndarray, margin: float = 0.0) -> bool:
    """Whether a point lies in one of the convex pieces (by at least `margin`; negative: or this close)."""
    for piece in pieces:
        height = np.einsum("fi,fi->f", point - piece.triangles[:, 0], piece.face_normals)
        if (height[piece.area_faces > 1e-12] < -margin).all():
            return True
    return False


def test_every_class_has_shapes_that_differ(models):
    assert REQUIRED <= {model.class_name for model in models} <= set(GENERATORS)
    for class_name in sorted(REQUIRED):
        sizes = [m.states[0].box_maximum for m in models if m.class_name == class_name]
        assert len(sizes) >= 3
        assert len(set(sizes)) == len(sizes)
    assert {m.class_name for m in models if m.articulated} == ARTICULATED
    kinds = {joint.type for m in models if m.class_name == "cabinet" for joint in m.joints}
    assert kinds == {"revolute", "prismatic"}


@pytest.mark.slow
def test_same_seed_same_bytes_other_seed_other_shapes(tmp_path):
    classes = ("chair", "fridge", "cup", "keyboard")
    first = build(tmp_path / "a", 5, classes=classes)
    again = build(tmp_path / "b", 5, classes=classes)
    other = build(tmp_path / "c", 6, classes=classes)
    assert digest(first.root) == digest(again.root)
    assert first.info.models[0].states != other.info.models[0].states


def test_leaving_classes_out_changes_no_model(library, tmp_path):
    some = build(tmp_path / "some", 3, classes=("bowl",))
    whole = {model.id: model for model in library.info.models}
    assert all(whole[model.id] == model for model in some.info.models)


def test_an_unknown_class_is_a_usage_error(tmp_path):
    with pytest.raises(UsageError, match="unicorn"):
        build(tmp_path / "x", 0, classes=("unicorn",))


def test_model_frame_and_boxes(library, models):
    for model in models:
        folder = model_folder(library, model.id)
        low, high = np.array(model.states[0].box_minimum), np.array(model.states[0].box_maximum)
        assert low + high == pytest.approx([0, 0, high[2]], abs=1e-6)
        assert low[2] == pytest.approx(0, abs=1e-9)
        for state in model.states:
            bounds = posed_mesh(folder, model, state.joints).bounds
            assert bounds[0] == pytest.approx(state.box_minimum, abs=2e-6)
            assert bounds[1] == pytest.approx(state.box_maximum, abs=2e-6)
        assert read_model(folder) == model


def test_sizes_are_those_of_real_furniture(models):
    ranges = {  # width x, depth y, height z [m]
        "chair": ((0.38, 0.75), (0.4, 0.75), (0.75, 1.1)),
        "table": ((0.7, 2.2), (0.45, 1.3), (0.35, 0.8)),
        "desk": ((1.0, 1.8), (0.55, 0.9), (0.68, 0.78)),
        "cabinet": ((0.4, 1.1), (0.35, 0.7), (0.45, 1.0)),
        "wall_cabinet": ((0.35, 1.0), (0.3, 0.5), (0.5, 0.8)),
        "shelf": ((0.6, 1.1), (0.25, 0.45), (0.7, 2.1)),
        "fridge": ((0.5, 0.75), (0.55, 0.75), (0.8, 1.9)),
        "microwave": ((0.4, 0.6), (0.38, 0.55), (0.25, 0.36)),
        "sofa": ((1.4, 2.8), (0.75, 1.0), (0.7, 1.0)),
        "bed": ((0.9, 1.8), (1.9, 2.2), (0.8, 1.2)),
        "monitor": ((0.45, 0.7), (0.12, 0.25), (0.35, 0.55)),
        "keyboard": ((0.27, 0.48), (0.11, 0.16), (0.015, 0.04)),
        "bottle": ((0.055, 0.08), (0.055, 0.08), (0.12, 0.33)),
        "cup": ((0.06, 0.12), (0.06, 0.085), (0.08, 0.12)),
        "bowl": ((0.12, 0.24), (0.12, 0.24), (0.045, 0.09)),
        "box": ((0.1, 0.45), (0.045, 0.6), (0.06, 0.3)),
        "bin": ((0.22, 0.36), (0.18, 0.36), (0.25, 0.55)),
    }
    for model in models:
        if model.class_name in ranges:
            size = np.array(model.states[0].box_maximum) - model.states[0].box_minimum
            for value, (least, most) in zip(size, ranges[model.class_name], strict=True):
                assert least <= value <= most, (model.id, size)


def test_collision_is_exactly_what_is_seen(library, models):
    for model in models:
        folder = model_folder(library, model.id)
        visual, collision = load_visual_parts(folder), load_collision_parts(folder)
        assert set(visual) == set(collision) == set(model.parts)
        for part in model.parts:
            stacked = np.concatenate([piece.vertices for piece in collision[part]])
            assert visual[part].vertices == pytest.approx(stacked, abs=1e-6)
            for piece in collision[part]:
                assert piece.is_volume
                heights = np.einsum("fvi,fi->fv", piece.vertices[None] - piece.triangles[:, :1], piece.face_normals)
                assert heights.max() < 1e-5, f"{model.id} {part}: a piece is not convex"
            assert len(np.unique(visual[part].visual.vertex_colors, axis=0)) >= 1


def test_hollow_things_are_hollow(library, models):
    for model in models:
        if not model.contains:
            continue
        pieces = posed_collision(model_folder(library, model.id), model, {})
        supports = [plane for plane in model.states[0].planes if plane.horizontal]
        top = model.states[0].box_maximum[2]
        room = 0
        for plane in supports:
            if plane.center[2] > top - 0.04:
                continue
            at = np.array(plane.center) + [0, 0, 0.03]
            below = np.array(plane.center) - [0, 0, 0.001]
            assert inside(pieces, below), f"{model.id}: nothing under the support surface at {plane.center}"
            room += not inside(pieces, at)
        assert room > 0, f"{model.id} claims to contain things but is solid"


def test_a_ball_dropped_into_a_cup_meets_its_floor_not_a_lid(library, models):
    for model in (m for m in models if m.class_name in ("cup", "bowl", "bin")):
        pieces = posed_collision(model_folder(library, model.id), model, {})
        floor = min(plane.center for plane in model.states[0].planes if plane.horizontal)
        middle = np.array([floor[0], floor[1]])
        heights = np.linspace(model.states[0].box_maximum[2] + 0.01, 0.0005, 200)
        hits = [z for z in heights if inside(pieces, np.array([*middle, z]))]
        assert hits, model.id
        assert max(hits) < 0.02, f"{model.id}: closed at {max(hits):.3f} m"


def test_masses_are_plausible_and_inertias_sound(library, models):
    ranges = {"chair": (2, 15), "cup": (0.04, 0.5), "bottle": (0.2, 1.5), "fridge": (25, 110), "table": (8, 70)}
    for model in models:
        least, most = ranges.get(model.class_name, (0.02, 200))
        assert least < model.mass < most, (model.id, model.mass)
        assert check_urdf(model_folder(library, model.id) / "model.urdf") == []


def test_grasp_widths_are_true(library, models):
    for model in models:
        if model.grasp_width is None:
            continue
        assert model.movable
        assert model.grasp_width < GRIPPER_OPENING
        mesh = posed_mesh(model_folder(library, model.id), model, {})
        extents = np.ptp(mesh.vertices[:, :2], axis=0)
        assert model.grasp_width == pytest.approx(extents.min(), rel=0.02), model.id
    assert {m.class_name for m in models if m.grasp_width} >= {"bottle", "cup", "box"}


def joints_of(models: list[CadModel]) -> list[tuple[CadModel, Joint]]:
    return [(model, joint) for model in models for joint in model.joints]


def test_doors_and_drawers_open_towards_the_front(library, models):
    for model, joint in joints_of(models):
        parts = load_visual_parts(model_folder(library, model.id))
        moved = part_transforms(model, {joint.name: 0.5 * joint.upper})[joint.part]
        still = part_transforms(model, {})[joint.part]
        middle = parts[joint.part].vertices.mean(axis=0)
        shift = (moved @ [*middle, 1] - still @ [*middle, 1])[:3]
        assert shift[1] < -0.05, f"{model.id} {joint.name} moves by {shift}"
        if joint.type == "revolute":
            assert np.radians(90) < joint.upper < np.radians(125)
            assert abs(joint.axis[2]) == 1


def test_moving_links_clear_the_body_and_each_other(library, models):
    for model in (m for m in models if m.articulated):
        collision = load_collision_parts(model_folder(library, model.id))
        for state in model.states:
            for part, depth in depths_of_links(model, collision, state.joints).items():
                assert depth < 1e-4, f"{model.id} {part} at {state.joints} is {depth:.4f} m in"


def test_handles_can_be_grasped(library, models):
    """A finger pad fits around the middle of the bar: 4 cm behind it are free, the bar is 1 to 2.5 cm thick."""
    for model, joint in joints_of(models):
        assert joint.handle is not None and joint.handle_axis is not None
        pieces = posed_collision(model_folder(library, model.id), model, {})
        handle, along = np.array(joint.handle), np.array(joint.handle_axis)
        assert inside(pieces, handle), f"{model.id}: the handle point is not in the bar"
        across = np.cross(along, [0, 1, 0])
        for direction in (across, -across, np.array([0, 1.0, 0]), np.array([0, -1.0, 0])):
            assert not inside(pieces, handle + 0.0125 * direction), f"{model.id} {joint.name}: bar thicker than 2.5 cm"
            assert inside(pieces, handle + 0.004 * direction)
        behind = [handle + [0, d, 0] for d in np.linspace(0.013, 0.04, 10)]
        assert not any(inside(pieces, point) for point in behind), f"{model.id} {joint.name}: no room behind the bar"


def test_yourdfpy_opens_the_door_as_we_do(library, models):
    for model in (m for m in models if m.articulated):
        folder = model_folder(library, model.id)
        robot = yourdfpy.URDF.load(str(folder / "model.urdf"), load_meshes=True)
        values = model.states[-1].joints
        robot.update_cfg(values)
        parts, ours = load_visual_parts(folder), part_transforms(model, values)
        theirs_points = []
        for part in model.parts:
            frame = robot.get_transform(part, model.parts[0])
            assert frame == pytest.approx(ours[part], abs=1e-7), f"{model.id} {part}"
            theirs_points.append(parts[part].vertices @ frame[:3, :3].T + frame[:3, 3])
        our_points = posed_mesh(folder, model, values).vertices
        assert np.concatenate(theirs_points) == pytest.approx(our_points, abs=1e-6)
        bounds = robot.scene.bounds
        assert bounds == pytest.approx(np.array([our_points.min(axis=0), our_points.max(axis=0)]), abs=1e-5)


def test_posing_scales_after_opening(library, models):
    model = next(m for m in models if any(joint.type == "prismatic" for joint in m.joints))
    folder = model_folder(library, model.id)
    values = {joint.name: joint.upper for joint in model.joints}
    assert posed_mesh(folder, model, values, 1.5).vertices == pytest.approx(
        1.5 * posed_mesh(folder, model, values).vertices
    )
    small = posed_collision(folder, model, values, 0.5)
    whole = posed_collision(folder, model, values)
    assert all(a.vertices == pytest.approx(0.5 * b.vertices) for a, b in zip(small, whole, strict=True))


def test_missing_models_joints_and_torn_meshes_are_bad_input(library, models, tmp_path):
    with pytest.raises(BadInput, match="no model"):
        model_folder(library, "chair_99")
    with pytest.raises(BadInput, match="no joint 'lid'"):
        part_transforms(models[0], {"lid": 1.0})
    with pytest.raises(BadInput, match="visual"):
        load_visual_parts(tmp_path)
    (tmp_path / "visual").mkdir()
    (tmp_path / "visual" / "body.glb").write_bytes(b"glTF not really")
    with pytest.raises(BadInput, match="body.glb"):
        load_visual_parts(tmp_path)
    (tmp_path / "collision").mkdir()
    (tmp_path / "collision" / "body_0.obj").write_text("v 0 0 0\n")
    with pytest.raises(BadInput, match="body_0.obj"):
        load_collision_parts(tmp_path)


def test_interior_surfaces_are_supports(models):
    fridge = next(m for m in models if m.class_name == "fridge")
    inner = [
        p
        for p in fridge.states[0].planes
        if p.horizontal and 0.05 < p.center[2] < fridge.states[0].box_maximum[2] - 0.1
    ]
    assert len(inner) >= 3
    assert any(p.area > 0.15 for p in inner)
    drawers = next(m for m in models if m.recipe.get("style") == "drawers")
    bottoms = [p.center[2] for p in drawers.states[0].planes if p.horizontal]
    for joint in drawers.joints:
        assert any(0 < joint.origin[2] - z < 0.2 for z in bottoms), f"no support in {joint.part}"
    opened = next(s for s in drawers.states if s.joints[drawers.joints[0].name] == drawers.joints[0].upper)
    moved = {round(p.center[2], 4): p.center[1] for p in opened.planes if p.horizontal}
    closed = {round(p.center[2], 4): p.center[1] for p in drawers.states[0].planes if p.horizontal}
    shifts = [closed[z] - moved[z] for z in closed if z in moved]
    assert max(shifts) == pytest.approx(drawers.joints[0].upper, abs=1e-3)


def test_affordances_of_the_first_classes(library):
    """All shapes of a class can do the same: what opens, what contains, what carries."""
    found: dict[str, list] = {}
    for uses in library.info.affordances:
        found.setdefault(uses.model.rsplit("_", 1)[0], []).append(uses)
    assert {name for name, every in found.items() if all(uses.contains for uses in every)} == {
        *("cabinet", "wall_cabinet", "fridge", "microwave", "cup", "bowl", "bin")
    }
    assert not [
        name for name in ("chair", "table", "desk", "sofa", "bed", "book") if any(u.contains for u in found[name])
    ]
    assert all(u.carries for name in ("chair", "table", "desk", "shelf", "sofa", "bed") for u in found[name])
    kinds = {name: {use.kind for uses in every for use in uses.joints} for name, every in found.items()}
    assert kinds["cabinet"] == {"door", "drawer"} and kinds["fridge"] == {"door"} == kinds["microwave"]
    for uses in (*found["fridge"], *found["microwave"]):
        rooms = [room for room in uses.contains if room.part == "body"]
        assert rooms and all(len(room.reached_through) == 1 for room in rooms)
    assert all(len(uses.grasps) == len(uses.joints) for name in ("cabinet", "fridge") for uses in found[name])
