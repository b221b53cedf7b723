"""Depth of single pixels out of pictures alone: features that several posed pictures show, triangulated (pycolmap).

Poses are taken as they are. All pictures are matched before the training begins: without depth nothing arrives late.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.needed import needed
from scenewright.stages.splat.views import PosedView

FEATURES = 2000
"""Most features of a picture; by eye."""
LONGEST_EXHAUSTIVE = 60
"""Most pictures that are matched each with each; of more, each is matched with the NEIGHBOURS that follow. By eye."""
NEIGHBOURS = 12
"""Pictures that follow one with which it is matched; by eye."""
LARGEST_ERROR = 2.0
"""Largest error of a point in the pictures that show it [px]; by eye."""
LEAST_ANGLE = 2.0
"""Least angle between the rays of a point [degrees]; by eye."""


def with_points(views: Sequence[PosedView], seed: int) -> list[PosedView]:
    """Return the views with the z-depth [m] of the triangulated points that each shows, 0 everywhere else.

    Raises MissingDependency without pycolmap.
    """
    points = _points(views, seed)
    with_depth = []
    for number, view in enumerate(views):
        height, width = view.color.shape[:2]
        depth = np.zeros((height, width), np.float32)
        if number in points:
            pixels, places = points[number]
            columns = np.clip(np.rint(pixels[:, 0]).astype(int), 0, width - 1)
            rows = np.clip(np.rint(pixels[:, 1]).astype(int), 0, height - 1)
            depth[rows, columns] = np.maximum(apply(view.camera_from_world, places)[:, 2], 0.0)
        with_depth.append(replace(view, depth=depth))
    return with_depth


def _points(views: Sequence[PosedView], seed: int) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Return number of a view -> pixels (K, 2) and places (K, 3) [m, world] of the points that it shows."""
    pycolmap = needed("pycolmap", "triangulation")

    pycolmap.logging.minloglevel = pycolmap.logging.Level.ERROR.value
    pycolmap.set_random_seed(seed)
    cameras = sorted({view.camera_name for view in views})
    with tempfile.TemporaryDirectory(prefix="scenewright-points-") as scratch:
        folder = Path(scratch)
        model = pycolmap.Reconstruction()
        for number, name in enumerate(cameras):
            camera = next(view.camera for view in views if view.camera_name == name)
            # Its pixel centres are at halves.
            parameters = [camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5]
            views_of_camera = [k for k, view in enumerate(views) if view.camera_name == name]
            for k in views_of_camera:
                path = folder / "images" / f"{k:06d}.png"
                path.parent.mkdir(exist_ok=True)
                cv2.imwrite(str(path), np.round(255 * views[k].color[..., ::-1]).astype(np.uint8))
            reading = pycolmap.ImageReaderOptions(
                camera_model="PINHOLE", camera_params=",".join(repr(float(x)) for x in parameters)
            )
            extraction = pycolmap.FeatureExtractionOptions(num_threads=1, use_gpu=False)
            extraction.sift.max_num_features = FEATURES
            pycolmap.extract_features(
                folder / "database.db",
                folder / "images",
                [f"{k:06d}.png" for k in views_of_camera],
                pycolmap.CameraMode.SINGLE,
                reading,
                extraction,
                pycolmap.Device.cpu,
            )
            model.add_camera_with_trivial_rig(
                pycolmap.Camera(
                    model="PINHOLE", width=camera.width, height=camera.height, params=parameters, camera_id=number + 1
                )
            )
        _match(folder / "database.db", len(views), seed)
        with pycolmap.Database.open(folder / "database.db") as database:
            ids = {image.name: image.image_id for image in database.read_all_images()}
        for k, view in enumerate(views):
            image = pycolmap.Image(
                name=f"{k:06d}.png", camera_id=cameras.index(view.camera_name) + 1, image_id=ids[f"{k:06d}.png"]
            )
            model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(view.camera_from_world[:3]))
        options = pycolmap.IncrementalPipelineOptions(num_threads=1, random_seed=seed)
        options.triangulation.random_seed = seed
        options.triangulation.min_angle = LEAST_ANGLE
        (folder / "model").mkdir()
        model = pycolmap.triangulate_points(
            model,
            folder / "database.db",
            folder / "images",
            folder / "model",
            clear_points=True,
            options=options,
            refine_intrinsics=False,
        )
        points_of_view = {}
        for image in model.images.values():
            observations = [(p.xy, model.points3D[p.point3D_id]) for p in image.points2D if p.has_point3D()]
            good = [(xy, point.xyz) for xy, point in observations if point.error <= LARGEST_ERROR]
            if good:
                pixels, places = (np.array(part) for part in zip(*good, strict=True))
                points_of_view[int(image.name.removesuffix(".png"))] = (pixels - 0.5, places)
        return points_of_view


def _match(database: Path, count: int, seed: int) -> None:
    pycolmap = needed("pycolmap", "triangulation")

    matching = pycolmap.FeatureMatchingOptions(num_threads=1, use_gpu=False)
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = seed
    if count <= LONGEST_EXHAUSTIVE:
        exhaustive = pycolmap.ExhaustivePairingOptions()
        pycolmap.match_exhaustive(database, matching, exhaustive, verification, pycolmap.Device.cpu)
    else:
        pairing = pycolmap.SequentialPairingOptions(overlap=NEIGHBOURS, quadratic_overlap=True, num_threads=1)
        pycolmap.match_sequential(database, matching, pairing, verification, pycolmap.Device.cpu)
