"""A small room that the tests of the scene bundle share: floor, wall, table, fridge, cups."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from scenewright.schemas.cad_library import CadLibrary, CadModel
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import Box, Relation
from scenewright.stages.kit.formats.cad_models import model_folder, posed_mesh
from scenewright.stages.kit.formats.scene_bundle import BundleBody
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.library.parameters import LibraryParameters
from scenewright.stages.library.stage import run as build_library


def context(output: Path, seed: int = 0) -> Context:
    """A context for calling a step directly."""
    output.mkdir(parents=True, exist_ok=True)
    return Context(output=output, seed=seed, device="cpu", progress=SilentProgress())


def small_library(output: Path, *classes: str, shapes: int = 2) -> CadLibrary:
    """Build a library of a few classes."""
    parameters = LibraryParameters(classes=classes, shapes_per_class=shapes, small_shapes_per_class=shapes)
    return build_library(parameters=parameters, context=context(output))


def find(library: CadLibrary, model_id: str) -> CadModel:
    """Return the record of a model."""
    return next(model for model in library.info.models if model.id == model_id)


def placed(
    library: CadLibrary,
    name: str,
    model_id: str,
    at: tuple[float, float, float],
    *,
    yaw: float = 0.0,
    parent: str | None = None,
    relation: str = "supports",
    movable: bool = False,
    scale: float = 1.0,
    joints: dict[str, float] | None = None,
) -> BundleBody:
    """Return a body that is a model of the library at a pose."""
    model = find(library, model_id)
    folder = model_folder(library, model_id)
    pose = transform_from_yaw(yaw, np.array(at))
    mesh = posed_mesh(folder, model, joints or {}, scale)
    mesh.apply_transform(pose)
    return BundleBody(
        name=name,
        class_name=model.class_name,
        parent=parent,
        relation=relation,
        world_from_body=pose,
        movable=movable,
        box=box_from_bounds(*mesh.bounds),
        model=model,
        model_folder=folder,
        scale=scale,
        joint_values=joints or {},
    )


def layout(
    name: str, class_name: str, center: tuple[float, float, float], size: tuple[float, float, float]
) -> BundleBody:
    """Return a layout body known by its box alone."""
    box = Box(center=center, size=size)
    return BundleBody(
        name=name,
        class_name=class_name,
        parent=None,
        relation="supports",
        world_from_body=np.eye(4),
        movable=False,
        box=box,
    )


def surface_height(model: CadModel, scale: float = 1.0, *, highest: bool = True) -> float:
    """Return the height of the highest (or lowest) support surface of the closed model."""
    heights = [plane.center[2] * scale for plane in model.states[0].planes if plane.horizontal]
    return max(heights) if highest else min(heights)


def room(library: CadLibrary) -> list[BundleBody]:
    """Return a room: floor, wall, scaled table with a cup on it, open fridge with a bottle in it, a cup in the air."""
    table = find(library, "table_00")
    fridge = find(library, "fridge_00")
    inside = surface_height(fridge, highest=False)
    top = surface_height(table, 0.9)
    return [
        placed(library, "cup_5", "cup_00", (0.2, 0.1, top), parent="table_3", movable=True),
        layout("floor_1", "floor", (0.5, 0, 0.0), (4.0, 3.0, 0.02)),
        layout("wall_2", "wall", (0.5, 1.52, 1.25), (4.0, 0.04, 2.5)),
        placed(library, "table_3", "table_00", (0, 0, 0), yaw=0.3, parent="floor_1", scale=0.9),
        placed(library, "fridge_4", "fridge_00", (2.0, 1.0, 0), parent="floor_1", joints={"door_hinge": 1.2}),
        placed(
            library, "bottle_6", "bottle_01", (2.0, 1.05, inside), parent="fridge_4", relation="contains", movable=True
        ),
        placed(library, "cup_7", "cup_01", (-1.2, 0.0, 1.0), parent="floor_1", movable=True),
    ]


def graph_of(bodies: list[BundleBody]) -> ContactGraphFile:
    """Return a contact graph with the bodies' parents."""
    nodes = [GraphNode(id=SCENE_NODE, instance=0, class_name=SCENE_NODE, node_type="scene")]
    links = []
    for body in bodies:
        layout_node = body.class_name in ("floor", "wall", "ceiling")
        kind: Literal["layout", "rigid", "articulated"] = (
            "layout" if layout_node else ("articulated" if body.joint_values else "rigid")
        )
        nodes.append(
            GraphNode(
                id=body.name,
                instance=int(body.name.rsplit("_", 1)[1]),
                class_name=body.class_name,
                node_type=kind,
                box=body.box,
                model_id=body.model.id if body.model else None,
                world_from_model=tuple(map(tuple, body.world_from_body.tolist())) if body.model else None,
                scale=body.scale if body.model else None,
                joints=body.joint_values,
            )
        )
        relation: Literal["supports", "contains"] = "contains" if body.relation == "contains" else "supports"
        links.append(Relation(source=body.parent or SCENE_NODE, target=body.name, relation=relation, confidence=1.0))
    return ContactGraphFile(nodes=tuple(nodes), links=tuple(links))
