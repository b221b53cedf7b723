"""A kinematic tree as an MCAP log of one moment: transforms of all links and what they look like, for Foxglove."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.message import Message
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from mcap_protobuf.schema import build_file_descriptor_set
from scenewright.stages.kit.formats import foxglove
from scenewright.stages.kit.formats.link_meshes import Surface
from scenewright.stages.kit.formats.link_poses import joint_motion
from scenewright.stages.kit.formats.urdf_file import Urdf
from scenewright.stages.kit.formats.written_scene import WrittenScene
from scenewright.stages.urdf.exports import SceneExporter

TRANSFORMS, SCENE = "/tf", "/scene"


def write_scene_mcap(
    path: Path, urdf: Urdf, surfaces: Mapping[str, list[Surface]], values: Mapping[str, float]
) -> None:
    """Write `/tf` (FrameTransforms, parent link to link, joints at `values` [rad, m]) and `/scene` (SceneUpdate, one
    entity a link, in its frame, with its triangles: `surfaces`) at time 0.
    """
    transforms = FrameTransforms()
    for joint in urdf.joints:
        pose = joint.parent_from_child @ joint_motion(joint, values.get(joint.name, 0.0))
        transforms.transforms.extend(foxglove.transforms_message(0, joint.parent, joint.child, pose).transforms)
    update = SceneUpdate()
    for link in urdf.links:
        if surfaces.get(link.name):
            update.entities.append(_entity(link.name, surfaces[link.name]))
    messages: dict[str, Message] = {TRANSFORMS: transforms, SCENE: update}
    with Path(path).open("wb") as file:
        writer = McapWriter(file, chunk_size=1 << 20, compression=CompressionType.ZSTD)
        writer.start(profile="", library="scenewright")
        for topic, message in messages.items():
            kind = type(message)
            data = build_file_descriptor_set(kind).SerializeToString(deterministic=True)
            schema = writer.register_schema(kind.DESCRIPTOR.full_name, "protobuf", data)
            channel = writer.register_channel(topic, "protobuf", schema)
            writer.add_message(channel, 0, message.SerializeToString(deterministic=True), publish_time=0)
        writer.finish()


def _entity(name: str, surfaces: list[Surface]) -> SceneEntity:
    entity = SceneEntity(frame_id=name, id=name, frame_locked=True)
    for surface in surfaces:
        triangles = entity.triangles.add()
        triangles.pose.orientation.w = 1.0
        red, green, blue, alpha = surface.color
        triangles.color.r, triangles.color.g, triangles.color.b, triangles.color.a = red, green, blue, alpha
        for x, y, z in surface.vertices.astype(float).tolist():
            triangles.points.add(x=x, y=y, z=z)
        if surface.vertex_colors is not None:
            for r, g, b in (surface.vertex_colors / 255.0).tolist():
                triangles.colors.add(r=r, g=g, b=b, a=alpha)
        triangles.indices.extend(np.asarray(surface.faces).ravel().tolist())
    return entity


def _write(path: Path, scene: WrittenScene) -> None:
    write_scene_mcap(path, scene.urdf, scene.surfaces, scene.joint_values)


EXPORTER = SceneExporter("mcap", order=30, file="scene.mcap", write=_write)
