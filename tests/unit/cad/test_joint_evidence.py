"""A joint needs more than a class name: a handle, a seam, a part seen open, or somebody's word."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenewright.schemas.errors import UsageError
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.cad.joint_evidence import Looked, joint_evidence
from scenewright.stages.cad.model_surfaces import load_surface
from scenewright.stages.cad.shapes import Placement, shape_of_state
from scenewright.stages.cad.stage import as_fitted
from scenewright.stages.kit.formats.cad_models import model_folder
from scenewright.stages.kit.formats.scene_links import model_links
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

from tests.panoptic_maps import floor_mesh, seen_surface
from tests.unit.cad.models import write_library
from tests.unit.cad.test_cad_stage import decisions, mesh_of, model_named

WIDTH, DEPTH, HEIGHT, FRONT = 0.9, 0.5, 0.8, -0.25


def door(name, hinge_x, axis, handle_x):
    """A door's joint: hinge at one side of the front, handle at the other."""
    handle = (handle_x, FRONT - 0.05, 0.5)
    limits = {"lower": 0.0, "upper": 1.9, "handle": handle, "handle_axis": (0.0, 0.0, 1.0)}
    return Joint(name=name, type="revolute", part=name, origin=(hinge_x, FRONT, 0.0), axis=(0, 0, axis), **limits)


def cupboard(handles):
    """A carcass with two doors of 2 cm; with `handles` on them."""
    half = WIDTH / 2
    left, right = [((0.0, -0.02, 0.0), (half, 0.0, HEIGHT))], [((-half, -0.02, 0.0), (0.0, 0.0, HEIGHT))]
    if handles:
        left.append(((half - 0.06, -0.06, 0.4), (half - 0.04, -0.02, 0.6)))
        right.append(((-half + 0.04, -0.06, 0.4), (-half + 0.06, -0.02, 0.6)))
    body = [((-half, FRONT, 0.0), (half, DEPTH + FRONT, HEIGHT))]
    joints = [door("left", -half, -1.0, -0.05), door("right", half, 1.0, 0.05)]
    return {"class_name": "cabinet", "parts": {"body": body, "left": left, "right": right}, "joints": joints}


@pytest.fixture(scope="module")
def cupboards(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cupboards")
    return write_library(folder, {"with_handles": cupboard(True), "plain": cupboard(False)})


def looked_at(library, shown, joints=None, color=None):
    """The surface of a model as a map shows it, noise of 2 mm, in one colour or in that of its places."""
    mesh = mesh_of(library, shown, (0, 0, 0), joints=joints)
    random = np.random.default_rng(3)
    points, faces = mesh.sample(12000, return_index=True, seed=3)
    normals = np.asarray(mesh.face_normals)[faces]
    seen = np.ones(len(points), bool)
    if joints is None:  # neither behind the doors nor between them
        seen = (np.abs(points[:, 1] - FRONT) > 0.004) & ((np.abs(normals[:, 0]) < 0.5) | (np.abs(points[:, 0]) > 0.01))
    points, normals = points[seen], normals[seen]
    colors = np.full((len(points), 3), 150) if color is None else color(points)
    return Looked(points + 0.002 * random.normal(size=points.shape), normals, colors.astype(np.uint8))


def evidence(library, looked, joints=None, *, model="with_handles", vouched=False):
    surface = load_surface(model_folder(library, model), model_named(library, model))
    shape = shape_of_state(surface.model, surface.model.states[0])
    values = {joint.name: 0.0 for joint in surface.model.joints} | (joints or {})
    placement = Placement(shape.__class__(**{**vars(shape), "joints": values}), 1.0, np.eye(3), np.zeros(3), 0, 0, 0)
    return joint_evidence(surface, placement, looked, vouched=vouched)


def test_handles_that_stand_out_speak_for_their_doors(cupboards):
    found = evidence(cupboards, looked_at(cupboards, "with_handles"))
    assert {name: entry.grounds for name, entry in found.items()} == {"left": ("handle",), "right": ("handle",)}
    assert found["left"].handle_height == pytest.approx(0.04, abs=0.01)


def test_a_plain_box_of_the_class_has_no_door(cupboards):
    found = evidence(cupboards, looked_at(cupboards, "plain"))
    assert [entry.grounds for entry in found.values()] == [(), ()]


def test_a_handle_beside_the_hinge_is_none(cupboards):
    """Something narrow that stands out where no hand opens: at the hinges of both doors."""
    looked = looked_at(cupboards, "with_handles")
    flipped = looked.vertices.copy()
    bars = flipped[:, 1] < FRONT - 0.025
    flipped[bars, 0] = np.sign(flipped[bars, 0]) * (WIDTH / 2 - np.abs(flipped[bars, 0]))
    found = evidence(cupboards, Looked(flipped, looked.normals, looked.colors))
    assert [entry.grounds for entry in found.values()] == [(), ()]


@pytest.mark.parametrize(("place", "grounds"), [(0.0, [("seam",), ("seam",)]), (0.17, [(), ()])])
def test_a_dark_line_is_a_seam_where_doors_meet(cupboards, place, grounds):
    def lined(points):
        return np.where(np.abs(points[:, :1] - place) < 0.01, 60, 150) * np.ones((1, 3))

    found = evidence(cupboards, looked_at(cupboards, "plain", color=lined), model="plain")
    assert [entry.grounds for entry in found.values()] == grounds


def test_an_open_door_counts_where_the_map_shows_it(cupboards):
    open_by = {"left": 1.2}
    found = evidence(cupboards, looked_at(cupboards, "plain", open_by), open_by, model="plain")
    assert found["left"].grounds == ("open",) and found["right"].grounds == ("thing",)
    shut = evidence(cupboards, looked_at(cupboards, "plain"), open_by, model="plain")
    assert [entry.grounds for entry in shut.values()] == [(), ()]


def test_a_model_that_explains_little_is_not_believed_but_a_person_is(cupboards):
    looked = looked_at(cupboards, "with_handles")
    swollen = Looked(looked.vertices * [1.0, 1.0, 1.6], looked.normals, looked.colors)
    assert [entry.grounds for entry in evidence(cupboards, swollen).values()] == [(), ()]
    told = evidence(cupboards, swollen, vouched=True)
    assert [entry.grounds for entry in told.values()] == [("user",), ("user",)]


def test_held_joints_are_fixed_links(cupboards, tmp_path):
    model, folder = model_named(cupboards, "plain"), model_folder(cupboards, "plain")
    write_urdf_of(folder, model)
    body = model_links(tmp_path, "thing", model, folder, 1.0, {"left": 0.5}, held={"left"})
    assert [(joint.name, joint.type) for joint in body.joints] == [
        ("thing__left", "fixed"),
        ("thing__right", "revolute"),
    ]
    assert [record.name for record in body.joint_records] == ["thing__right"]
    assert body.joint_values == {"thing__right": 0.0}
    turned = transform_from_yaw(-0.5, np.array([-WIDTH / 2, FRONT, 0.0]))
    assert np.allclose(body.joints[0].parent_from_child, turned)


def write_urdf_of(folder, model):
    """A URDF of the little model: a box a part."""
    links = "".join(f'<link name="{part}"/>' for part in model.parts)
    joints = "".join(
        f'<joint name="{j.name}" type="revolute"><origin xyz="{j.origin[0]} {j.origin[1]} {j.origin[2]}"/>'
        f'<parent link="body"/><child link="{j.part}"/><axis xyz="0 0 {j.axis[2]}"/>'
        '<limit lower="0" upper="1.9" effort="10" velocity="1"/></joint>'
        for j in model.joints
    )
    (folder / "model.urdf").write_text(f'<robot name="cupboard">{links}{joints}</robot>')


@pytest.fixture
def room(library):
    """A fridge of the little library, closed, without a handle."""
    meshes = {1: floor_mesh((-1, -1), (1, 1)), 2: mesh_of(library, "fridge_tall", (0.2, 0.4, 0))}
    return seen_surface(meshes, [(0.2, -1.5, 1.5), (-1.2, -0.8, 1.6)], noise=0.002), {1: "floor", 2: "fridge"}


def test_the_step_holds_what_nothing_speaks_for(room, replace_objects):
    assert decisions(replace_objects(*room))["fridge_2"].held == {"door_hinge"}
    told = replace_objects(*room, name="told", vouched=("fridge",))
    assert decisions(told)["fridge_2"].joint_evidence["door_hinge"].grounds == ("user",)
    with pytest.raises(UsageError, match="--vouched gate: no thing"):
        replace_objects(*room, name="wrong", vouched=("gate",))


def test_grounds_are_looked_for_where_the_model_fits_the_map(cupboards):
    """Arranging moves a cupboard aside; what the map shows stays where it was seen."""
    model = model_named(cupboards, "with_handles")
    shape = shape_of_state(model, model.states[0])
    fitted = Placement(shape, 1.0, np.eye(3), np.array([1.0, 2.0, 0.0]), 0.0, 0.01, 0.01)
    turned = replace(fitted, rotation=transform_from_yaw(0.3, np.zeros(3))[:3, :3])
    arranged = replace(fitted, translation=np.array([1.08, 2.0, 0.01]))
    assert as_fitted(arranged, [turned, fitted]).translation == pytest.approx(fitted.translation)
    smaller = replace(arranged, scale=0.97)
    assert as_fitted(smaller, [turned, fitted]) is smaller
