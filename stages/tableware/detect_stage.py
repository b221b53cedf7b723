"""The step `tableware detect`: one image of a table, what is on it, and a picture of how sure that is."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.tableware_detections import TablewareDetections, TablewareDetectionsFile, TablewareOutline
from scenewright.schemas.tableware_dishes import TablewareDishes
from scenewright.stages.kit.stage import Context
from scenewright.stages.tableware.detect_parameters import DetectParameters
from scenewright.stages.tableware.dishes_file import read_dishes, setting_of
from scenewright.stages.tableware.vision.detections_file import to_file
from scenewright.stages.tableware.vision.image_files import TableImage, read_image
from scenewright.stages.tableware.vision.overlay import draw_outlines, draw_sight
from scenewright.stages.tableware.vision.photographs import find_outlines
from scenewright.stages.tableware.vision.seeing import Sizes, see
from scenewright.stages.tableware.world.items import DishSizes
from scenewright.stages.tableware.world.overhead import OverheadCamera


def run(
    image: Path,
    depth: Path | None,
    camera: Path | None,
    dishes: Path | None,
    *,
    parameters: DetectParameters,
    context: Context,
) -> TablewareDetections:
    """Detect tableware in the user's image, or in that of a scene's folder."""
    with context.progress.step("read"):
        image_read = read_image(image, depth, camera, parameters.depth_scale)
        dish_sizes = image_read.dishes if dishes is None else read_dishes(dishes)
    setting = setting_of(dish_sizes)
    if parameters.photograph:
        return _photograph(image_read, setting.sizes, parameters, context)
    sizes = _sizes(parameters, image_read.scene, dishes, dish_sizes)
    with context.progress.step("see"):
        view, sides = _view(image_read, parameters)
        sight = see(
            image_read.color, image_read.depth, view, sides, sizes=sizes, dishes=setting.sizes, seed=context.seed
        )
    for note in sight.notes:
        context.logger.warning("%s", note)
    payload = to_file(sight, sizes, dish_sizes)
    payload.write(context.output / "detections.json")
    with context.progress.step("pictures"):
        _save(context.output / "overlay.png", draw_sight(image_read.color, sight))
        if sight.rectified:
            _save(context.output / "above.png", sight.heights.color)
    kinds = [detection.kind for detection in sight.detections]
    summary = {
        "statement": payload.statement,
        "items": sum(kind is not None for kind in kinds),
        "unknown": kinds.count(None),
        "in_doubt": sum(bool(detection.unsure) for detection in sight.detections),
        "rectified": sight.rectified,
    }
    return TablewareDetections(root=context.output, outcome="ok" if kinds else "nothing_found", summary=summary)


def _sizes(parameters: DetectParameters, scene: bool, given: Path | None, told: TablewareDishes | None) -> Sizes:
    """Return whether sizes are known or estimated. Raises BadInput where both are asked for."""
    has_sizes = told is not None and told.has_sizes
    if parameters.sizes == "auto":
        return "known" if has_sizes or scene else "estimated"
    if parameters.sizes == "estimated" and has_sizes and given is not None:
        raise BadInput(
            f"{given} says what the dishes measure, and --sizes estimated not to go by it",
            hint="leave one of them out; a file of [gripper] alone goes with estimated sizes",
        )
    return parameters.sizes


def _view(read: TableImage, parameters: DetectParameters) -> tuple[OverheadCamera | Camera, tuple[float, float]]:
    """Return the camera, with its pose where that is known, and the workspace's sides [m]. Raises BadInput without
    intrinsics."""
    sides = (parameters.workspace_x, parameters.workspace_y)
    if read.camera is None:
        raise BadInput("there is no camera.json with the image", hint="give --camera: intrinsics in pixels")
    if read.camera.workspace is not None:
        sides = read.camera.workspace
    if read.camera.world_from_camera is not None:
        return OverheadCamera(read.camera.camera, np.array(read.camera.world_from_camera)), sides
    if not parameters.overhead:
        return read.camera.camera, sides
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = parameters.camera_height
    return OverheadCamera(read.camera.camera, pose), sides


def _photograph(
    read: TableImage, sizes: DishSizes, parameters: DetectParameters, context: Context
) -> TablewareDetections:
    outlines = find_outlines(read.color, parameters.picture_width, sizes)
    count = len(outlines)
    statement = f"{count} round thing{'s' * (count != 1)} in a photograph without depth: heights are unknown, nothing "
    statement += "can be planned from this"
    if parameters.picture_width is None:
        statement += "; sizes and kinds are unknown too (--picture-width)"
    payload = TablewareDetectionsFile(
        statement=statement,
        notes=("without depth neither heights, stacks nor utensils are looked for",),
        heights_known=False,
        outlines=tuple(
            TablewareOutline(kind=outline.kind, box=outline.box, confidence=outline.confidence, unsure=outline.unsure)  # type: ignore[arg-type]
            for outline in outlines
        ),
    )
    payload.write(context.output / "detections.json")
    _save(context.output / "overlay.png", draw_outlines(read.color, outlines, statement))
    summary = {"statement": statement, "items": 0, "unknown": count, "in_doubt": count, "rectified": False}
    return TablewareDetections(root=context.output, outcome="no_depth", summary=summary)


def _save(path: Path, picture: np.ndarray) -> None:
    if not cv2.imwrite(str(path), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)):
        raise OSError(f"{path} could not be written")
