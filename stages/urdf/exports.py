"""What stands beside scene.urdf, for planners, log viewers and headsets."""

from __future__ import annotations

from pathlib import Path

from schemas.interactive_scene import InteractiveSceneFile
from schemas.vocabulary import load_vocabulary
from stages.kit.formats.urdf_file import parse_urdf
from stages.urdf.link_meshes import link_surfaces
from stages.urdf.resting_contacts import resting_contacts
from stages.urdf.scene_glb import write_scene_glb
from stages.urdf.scene_mcap import write_scene_mcap
from stages.urdf.srdf_file import write_srdf


def write_exports(root: Path, scene: InteractiveSceneFile) -> None:
    """Write scene.srdf, scene.glb and scene.mcap from the scene in `root`, joints as it was reconstructed."""
    vocabulary = load_vocabulary()
    urdf = parse_urdf(root / scene.combined_file)
    values = {name: value for body in scene.bodies for name, value in body.joint_values.items()}
    layout = {body.name for body in scene.bodies if vocabulary.by_name(body.class_name).is_layout}
    write_srdf(root / "scene.srdf", urdf, resting_contacts(root), values)
    surfaces = {link.name: link_surfaces(link, root) for link in urdf.links}
    write_scene_glb(root / "scene.glb", urdf, surfaces, values, one_sided=layout)
    write_scene_mcap(root / "scene.mcap", urdf, surfaces, values)
