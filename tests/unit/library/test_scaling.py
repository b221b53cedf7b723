"""Uniform scaling: origins and slides grow, angles stay. Forward kinematics of the URDF against the scaled mesh."""

from __future__ import annotations

import numpy as np
import pytest
import yourdfpy
from scenewright.schemas.cad_library import CadLibrary
from scenewright.stages.kit.formats.cad_models import load_visual_parts, model_folder, part_transforms
from scenewright.stages.kit.formats.scene_links import model_links
from scenewright.stages.kit.formats.urdf_file import Urdf, write_urdf

from tests.unit.library.test_library import build


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> CadLibrary:
    """A printer with a drawer and a lid, a pot whose lid lifts off."""
    root = tmp_path_factory.mktemp("scaled") / "cad_library"
    return build(root, 4, classes=("printer", "cooking_pot"), shapes_per_class=1, small_shapes_per_class=1)


@pytest.mark.parametrize("scale", [0.7, 1.6])
@pytest.mark.parametrize("model_id", ["printer_00", "cooking_pot_00"])
def test_a_scaled_model_opens_as_its_scaled_mesh(library, tmp_path, model_id, scale):
    model = next(entry for entry in library.info.models if entry.id == model_id)
    folder = model_folder(library, model_id)
    slides = {joint.name for joint in model.joints if joint.type == "prismatic"}
    opened = {joint.name: 0.8 * joint.upper for joint in model.joints}
    body = model_links(tmp_path, "thing", model, folder, scale, opened)
    write_urdf(tmp_path / "scaled.urdf", Urdf("scaled", body.links, body.joints))
    robot = yourdfpy.URDF.load(str(tmp_path / "scaled.urdf"), load_meshes=True)
    values = {f"thing__{name}": value * (scale if name in slides else 1.0) for name, value in opened.items()}
    assert body.joint_values == pytest.approx(values)
    robot.update_cfg(values)

    closed, parts, moved = part_transforms(model, {}), load_visual_parts(folder), part_transforms(model, opened)
    farthest = 0.0
    for part in model.parts:
        link = "thing" if part == model.parts[0] else f"thing__{part}"
        frame = robot.get_transform(link, "thing")
        found = scale * parts[part].vertices @ frame[:3, :3].T + frame[:3, 3]
        expected = scale * (parts[part].vertices @ moved[part][:3, :3].T + moved[part][:3, 3])
        assert found == pytest.approx(expected, abs=1e-6), part
        at_rest = scale * (parts[part].vertices @ closed[part][:3, :3].T + closed[part][:3, 3])
        farthest = max(farthest, float(np.abs(expected - at_rest).max()))
    assert farthest > 0.05 * scale, "nothing moved, so nothing was tested"
    drawn = np.concatenate([scale * (parts[p].vertices @ moved[p][:3, :3].T + moved[p][:3, 3]) for p in model.parts])
    assert robot.scene.bounds == pytest.approx(np.array([drawn.min(axis=0), drawn.max(axis=0)]), abs=1e-5)

    limits = {joint.name: joint.limit for joint in robot.robot.joints if joint.limit is not None}
    for joint in model.joints:
        factor = scale if joint.name in slides else 1.0
        assert limits[f"thing__{joint.name}"].upper == pytest.approx(joint.upper * factor, rel=1e-6)
    masses = {link.name: link.inertial.mass for link in body.links if link.inertial is not None}
    assert sum(masses.values()) == pytest.approx(model.mass * scale**3, rel=1e-3)
