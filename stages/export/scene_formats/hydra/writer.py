"""A contact graph as a dynamic scene graph of spark_dsg: objects with boxes and classes below one room."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import spark_dsg
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.export.scene_bodies import SceneToExport
from scenewright.stages.export.scene_registry import Written
from scipy.spatial.transform import Rotation

ROOM = spark_dsg.NodeSymbol("R", 0)
"""The one room of the scene graph."""


def write(folder: Path, scene: SceneToExport) -> Written:
    """Write scene_graph.json into `folder`. The same scene gives the same bytes."""
    layers = spark_dsg.DsgLayers
    graph = spark_dsg.DynamicSceneGraph()
    labels = {entry.id: entry.name for entry in load_vocabulary().classes}
    graph.set_labelspace(spark_dsg.Labelspace(labels), layers.OBJECTS)
    bodies = [body for body in scene.written.info.bodies if body.name not in scene.written.layout]
    symbols = {body.name: spark_dsg.NodeSymbol("O", number) for number, body in enumerate(bodies)}
    room = spark_dsg.RoomNodeAttributes()
    room.name = "room"
    room.position = np.mean([body.box.center for body in bodies], axis=0) if bodies else np.zeros(3)
    graph.add_node(layers.ROOMS, ROOM, room)
    for body in bodies:
        graph.add_node(layers.OBJECTS, symbols[body.name], _attributes(body))
        graph.insert_edge(ROOM, symbols[body.name])
    for link in scene.graph.links:
        if link.source in symbols and link.target in symbols:
            attributes = spark_dsg.EdgeAttributes()
            attributes.metadata.set({"relation": link.relation, "from": link.source, "to": link.target})
            graph.insert_edge(symbols[link.source], symbols[link.target], attributes)
    graph.save(folder / "scene_graph.json", include_mesh=False)
    return Written(names={str(symbol): name for name, symbol in symbols.items()})


def _attributes(body: SceneBody) -> spark_dsg.ObjectNodeAttributes:
    attributes = spark_dsg.ObjectNodeAttributes()
    attributes.name = body.name
    attributes.semantic_label = load_vocabulary().by_name(body.class_name).id
    attributes.position = np.array(body.box.center)
    orientation = Rotation.from_quat(body.box.orientation).as_matrix()
    attributes.bounding_box = spark_dsg.BoundingBox(
        spark_dsg.BoundingBoxType.OBB,
        np.array(body.box.size, dtype=np.float32),
        np.array(body.box.center, dtype=np.float32),
        orientation.astype(np.float32),
    )
    return attributes
