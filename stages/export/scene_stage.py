"""The step `export scene`: choose the format, write it, say what it could not hold."""

from __future__ import annotations

import importlib

from scenewright.schemas.exported_scene import ExportedScene, SceneExportFile
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.stages.export.parameters import SceneExportParameters
from scenewright.stages.export.scene_bodies import MOVING, SceneToExport
from scenewright.stages.export.scene_registry import Written, scene_format
from scenewright.stages.kit.formats.written_scene import WrittenScene
from scenewright.stages.kit.stage import Context


def run(scene: InteractiveScene, *, parameters: SceneExportParameters, context: Context) -> ExportedScene:
    """Write a scene in another tool's format. Raises BadInput for a scene whose tree or meshes are broken."""
    target = scene_format(parameters.to)
    to_export = SceneToExport(WrittenScene(scene.root, scene.info), scene.graph)
    bodies = to_export.bodies
    with context.progress.step(f"write {target.file}"):
        written: Written = importlib.import_module(target.module).write(context.output, to_export)
    moving = [joint for body in bodies for joint in body.joints if joint.type in MOVING]
    for note in target.notes:
        context.logger.info("%s", note)
    SceneExportFile(
        target=target.name,
        file=target.file,
        bodies=len(bodies),
        movable=sum(body.record.movable for body in bodies),
        joints=len(moving),
        names=written.names,
        joint_zero=written.joint_zero,
        notes=target.notes,
    ).write(context.output / "export.json")
    summary: dict[str, float | str] = {"target": target.name, "bodies": len(bodies), "joints": len(moving)}
    if not bodies:
        summary["reason"] = "the scene has no bodies"
    return ExportedScene(context.output, outcome="ok" if bodies else "empty", summary=summary)
