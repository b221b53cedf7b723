"""Reading what `tableware scene` wrote."""

from __future__ import annotations

import numpy as np
from PIL import Image
from scenewright.schemas.errors import BadInput
from scenewright.schemas.tableware_scene import TablewareScene
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.tableware.world.overhead import OverheadCamera


def read_image(scene: TablewareScene) -> tuple[np.ndarray, np.ndarray, OverheadCamera]:
    """Return color (H, W, 3) uint8, depth (H, W) float32 [m] and the camera. Raises BadInput for files that cannot be
    read; whether images and camera fit is for vision to say."""
    file = scene.info
    path = scene.path("color.png")
    try:
        with Image.open(path) as opened:
            if opened.size != (file.camera.width, file.camera.height):
                raise BadInput(
                    f"{path}: {opened.width} x {opened.height} pixels, the camera of scene.json has "
                    f"{file.camera.width} x {file.camera.height}",
                    hint="make the scene again",
                )
            color = np.asarray(opened.convert("RGB"))
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise BadInput(f"{path}: {error}", hint="make the scene again") from None
    (depth,) = read_arrays(scene.path("depth.npz"), "depth", shapes=("H W",), hint="make the scene again")
    return color, depth.astype(np.float32), OverheadCamera(file.camera, np.array(file.world_from_camera))
