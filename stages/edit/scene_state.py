"""A CAD scene while it is edited: its graph, what stands for each node, and where the files of that lie."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_library import CadModel
from scenewright.schemas.cad_scene import SURROUNDINGS, CadScene, Replacement
from scenewright.schemas.contact_graph import GraphNode
from scenewright.schemas.errors import BadInput
from scenewright.stages.edit.anchoring import Conflict
from scenewright.stages.edit.graph_edits import GraphState, relink
from scenewright.stages.kit.formats.cad_models import posed_mesh, read_model
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.ply_files import ColoredMesh, write_ply
from scenewright.stages.kit.geometry.boxes import box_at_yaw, box_yaw
from scenewright.stages.kit.geometry.planes import moved_planes
from scenewright.stages.kit.geometry.transforms import apply, transform_from

GREY = 128
"""Grey value, of 255, of surfaces without a colour."""
HINT = "run `cad` again"


@dataclass
class SceneState(GraphState):
    """Graph and replacements are replaced, never written into."""

    replacements: dict[str, Replacement] = field(default_factory=dict)
    """By node."""
    scene: CadScene | None = None
    library: Path | None = None
    """Folder of the models of a CAD library."""
    map_root: Path | None = None
    """Of the panoptic map, which has the meshes of what models stood for."""
    output: Path = Path()
    """Where models that edits make are written, at once."""
    made: dict[str, Path] = field(default_factory=dict)
    """Folder of each model that an edit made."""
    meshes: dict[str, Path] = field(default_factory=dict)
    """Node without model -> file of its mesh, where that is not the scene's."""
    moved: dict[str, np.ndarray] = field(default_factory=dict)
    """Node without model -> (4, 4) from where its file has it."""

    def model_folder(self, model_id: str) -> Path | None:
        """Return the folder of a model: one that an edit made, the scene's, or the library's."""
        assert self.scene is not None
        places = [self.made.get(model_id), self.scene.path("models") / model_id]
        places += [] if self.library is None else [self.library / model_id]
        return next((candidate for candidate in places if candidate is not None and candidate.is_dir()), None)

    def model_of(self, node: GraphNode) -> tuple[CadModel, Path, np.ndarray]:
        """Return the model of a node, its folder, and (4, 4) world_from_model without the scale. Raises Conflict, when
        none stands for it."""
        if node.model_id is None or node.world_from_model is None:
            raise Conflict(f"no model stands for {node.id}")
        folder = self.model_folder(node.model_id)
        if folder is None:
            raise BadInput(f"{node.id}: its model {node.model_id} is missing", hint=HINT)
        return read_model(folder), folder, np.array(node.world_from_model)

    def mesh_file(self, node: GraphNode) -> Path:
        """Return the file of the mesh that stands for a node without model."""
        assert self.scene is not None
        folder = "layout" if node.node_type == "layout" else "meshes"
        return self.meshes.get(node.id, self.scene.path(folder) / f"{node.id}.ply")

    def mesh_of(self, node: GraphNode) -> trimesh.Trimesh:
        """Return the mesh of a node without model, in the world. Raises Conflict when it has none."""
        file = self.mesh_file(node)
        if not file.is_file():
            raise Conflict(f"{node.id} has no mesh")
        mesh = read_mesh(file, may_be_empty=True, hint=HINT)
        mesh.apply_transform(self.moved.get(node.id, np.eye(4)))
        return mesh

    def put_model(self, node: GraphNode, folder: Path, replacement: Replacement) -> None:
        """Let what `replacement` chose stand for a node: pose, scale, joints, box and planes are those of the model."""
        chosen, model = replacement.chosen, read_model(folder)
        assert chosen is not None
        pose = np.array(chosen.world_from_model)
        points = apply(pose, np.asarray(posed_mesh(folder, model, chosen.joints, chosen.scale).vertices))
        yaw = float(np.arctan2(pose[1, 0], pose[0, 0]))
        yaw = (yaw + np.pi / 4) % (np.pi / 2) - np.pi / 4
        values = {
            "model_id": model.id,
            "world_from_model": chosen.world_from_model,
            "scale": chosen.scale,
            "joints": dict(chosen.joints),
            "box": box_at_yaw(points, yaw),
            "planes": moved_planes(model.states[0].planes, pose[:3, :3], pose[:3, 3], chosen.scale),
        }
        self.replace_node(node.model_copy(update=values))
        self.replacements[node.id] = replacement
        self.meshes.pop(node.id, None)
        self.moved.pop(node.id, None)
        relink(self, node.id)

    def move(self, name: str, motion: np.ndarray) -> None:
        """Move a node by (4, 4), world to world, upright: its pose or mesh, box and planes."""
        node = self.graph.node(name)
        values: dict[str, object] = {"planes": moved_planes(node.planes, motion[:3, :3], motion[:3, 3])}
        for which, box in (("box", node.box), ("box_observed", node.box_observed)):
            if box is not None:
                turned = motion[:3, :3] @ transform_from_box(box_yaw(box))
                yaw = float(np.arctan2(turned[1, 0], turned[0, 0]))
                center = apply(motion, np.array([box.center]))[0]
                values[which] = box_at_yaw(center[None], yaw).model_copy(update={"size": box.size})
        if node.world_from_model is not None:
            pose = as_transform(motion @ np.array(node.world_from_model))
            values["world_from_model"] = pose
            before = self.replacements[name]
            if before.chosen is not None:
                chosen = before.chosen.model_copy(update={"world_from_model": pose})
                self.replacements[name] = before.model_copy(update={"chosen": chosen})
        else:
            self.moved[name] = motion @ self.moved.get(name, np.eye(4))
        self.replace_node(node.model_copy(update=values))

    def write(self, root: Path) -> None:
        """Write models, meshes and layout of the scene as it is now into a folder."""
        assert self.scene is not None
        used = {node.model_id for node in self.graph.nodes if node.model_id is not None}
        for model_id in sorted(used):
            folder = self.model_folder(model_id)
            target = root / "models" / model_id
            if folder is None:
                raise BadInput(f"{self.scene.path('models') / model_id}: model is missing", hint=HINT)
            if folder != target:
                shutil.copytree(folder, target)
        for model_id in self.made.keys() - used if root == self.output else ():
            shutil.rmtree(self.made[model_id])
        for node in self.graph.nodes:
            if node.model_id is None and (file := self.mesh_file(node)).is_file():
                target = root / ("layout" if node.node_type == "layout" else "meshes") / f"{node.id}.ply"
                target.parent.mkdir(parents=True, exist_ok=True)
                if node.id in self.moved:
                    write_ply(target, colored(self.mesh_of(node)))
                else:
                    shutil.copyfile(file, target)
        if self.scene.shell is not None:
            self.scene.shell.write(root / "shell.json")
            shutil.copytree(self.scene.path("shell"), root / "shell")
        nameless = self.scene.path("meshes") / f"{SURROUNDINGS}.ply"
        if nameless.is_file():
            (root / "meshes").mkdir(parents=True, exist_ok=True)
            shutil.copyfile(nameless, root / "meshes" / nameless.name)


def transform_from_box(yaw: float) -> np.ndarray:
    """Return the rotation (3, 3) of a box that is turned by `yaw` [rad] about the vertical."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def about(center: np.ndarray, turn: float, to: np.ndarray) -> np.ndarray:
    """Return the motion (4, 4) that turns by `turn` [rad] about the vertical through `center` (3,) and takes that to
    `to` (3,) [m]."""
    rotation = transform_from_box(turn)
    return transform_from(rotation, to - rotation @ center)


def colored(mesh: trimesh.Trimesh) -> ColoredMesh:
    """Return a mesh as it is written, grey where it has no colours."""
    painted = getattr(mesh.visual, "vertex_colors", None)
    vertices = np.asarray(mesh.vertices, dtype=np.float32)
    colors = np.full((len(vertices), 3), GREY, np.uint8) if painted is None else np.asarray(painted)[:, :3]
    return ColoredMesh(vertices, np.asarray(mesh.faces, np.int32), colors.astype(np.uint8))
