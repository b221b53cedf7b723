"""The feature-based arm: incremental structure from motion (Schoenberger and Frahm 2016, pycolmap), scaled by depth.

It stands for the feature-based SLAM of the thesis (Han 2024 uses ORB-SLAM2's poses). Frames are thinned out evenly,
matched with those that follow, mapped, and the largest model is brought to metres by the measured depth of its points.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.registration.rigid_motion import between, fraction
from scenewright.stages.kit.stage import Context
from scenewright.stages.poses.frame_poses import FramePose
from scenewright.stages.poses.parameters import PosesParameters

FEATURES = 1500
"""SIFT features per image, at most."""
LEAST_SCALE_POINTS = 50
"""Points with measured depth below which the scale of a model is not known."""
REGISTERED_POINTS = 200
"""An image that sees so many points of the model has full confidence."""


def reconstruct(
    reader: FrameReader, frames: list[int], camera_name: str, parameters: PosesParameters, context: Context
) -> tuple[list[FramePose], int]:
    """Return the pose of every frame in the world of the first registered one, and into how many models it fell.

    Frames between two registered ones that are neighbours in the selection are interpolated.
    """
    chosen = [
        frames[k]
        for k in np.unique(np.linspace(0, len(frames) - 1, min(len(frames), parameters.sfm_frames)).astype(int))
    ]
    camera = reader.cameras[camera_name]
    with tempfile.TemporaryDirectory(prefix="scenewright-sfm-") as scratch:
        folder = Path(scratch)
        with context.progress.step("write images"):
            names = _write_images(reader, chosen, folder)
        with context.progress.step("structure from motion"):
            models = _map(folder, sorted(names), camera, parameters, context.seed)
    if not models:
        return [FramePose(frame, None, "unposed", "not_registered") for frame in frames], 1
    model = max(models, key=lambda m: (m.num_reg_images(), m.num_points3D()))
    with context.progress.step("scale"):
        scale = _scale(model, names, reader, parameters.maximum_depth)
    if scale is None:
        context.logger.warning("the scale of the model is unknown: too few of its points have depth")
        return [FramePose(frame, None, "unposed", "not_registered") for frame in frames], len(models)
    registered = _poses(model, names, scale)
    return interpolated(frames, chosen, registered), len(models)


def interpolated(
    frames: list[int], chosen: list[int], registered: dict[int, tuple[np.ndarray, float]]
) -> list[FramePose]:
    """Return the poses of all `frames`: registered ones as they are, those between neighbours of `chosen` interpolated.

    `registered` maps a frame to its pose (4, 4) and confidence.
    """
    start = inverse(registered[min(registered)][0])
    places = np.searchsorted(chosen, frames, side="right") - 1
    result = []
    for frame, before_index in zip(frames, places.tolist(), strict=True):
        before, after = chosen[before_index], chosen[min(before_index + 1, len(chosen) - 1)]
        if frame in registered:
            pose, confidence = registered[frame]
            result.append(FramePose(frame, start @ pose, "tracked", confidence=confidence))
        elif before in registered and after in registered:
            (first, sure), (second, also) = registered[before], registered[after]
            motion = fraction(between(first, second), (frame - before) / (after - before))
            pose = start @ first @ motion
            result.append(FramePose(frame, pose, "interpolated", confidence=0.5 * min(sure, also)))
        else:
            result.append(FramePose(frame, None, "unposed", "not_registered"))
    return result


def _write_images(reader: FrameReader, frames: list[int], folder: Path) -> dict[str, int]:
    """Write grey images, and masks of their black holes; return name -> frame."""
    (folder / "images").mkdir()
    (folder / "masks").mkdir()
    names = {}
    for frame in frames:
        color = reader.read(frame, ("color",)).color
        if color is None:
            continue
        gray = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY)
        name = f"{frame:06d}.png"
        cv2.imwrite(str(folder / "images" / name), gray)
        # Colour that was resampled into the depth camera is black where the depth has holes.
        mask = cv2.erode((gray > 0).astype(np.uint8) * 255, np.ones((9, 9), np.uint8))
        cv2.imwrite(str(folder / "masks" / f"{name}.png"), mask)
        names[name] = frame
    return names


def _map(folder: Path, names: list[str], camera: Camera, parameters: PosesParameters, seed: int) -> list[Any]:
    """Return the models (pycolmap.Reconstruction) that the images of the folder make, always the same ones."""
    import pycolmap

    pycolmap.logging.minloglevel = pycolmap.logging.Level.ERROR.value
    pycolmap.set_random_seed(seed)
    database = folder / "database.db"
    reading = pycolmap.ImageReaderOptions(
        camera_model="PINHOLE",
        # Its pixel centres are at halves.
        camera_params=",".join(repr(float(x)) for x in (camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5)),
        mask_path=str(folder / "masks"),
    )
    extraction = pycolmap.FeatureExtractionOptions(num_threads=1, use_gpu=False)
    extraction.sift.max_num_features = FEATURES
    extraction.sift.first_octave = 0
    pycolmap.extract_features(
        database, folder / "images", names, pycolmap.CameraMode.SINGLE, reading, extraction, pycolmap.Device.cpu
    )
    pairing = pycolmap.SequentialPairingOptions(
        overlap=parameters.sfm_neighbours, quadratic_overlap=True, num_threads=1
    )
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = seed
    pycolmap.match_sequential(
        database,
        pycolmap.FeatureMatchingOptions(num_threads=1, use_gpu=False),
        pairing,
        verification,
        pycolmap.Device.cpu,
    )
    options = pycolmap.IncrementalPipelineOptions(
        num_threads=1, random_seed=seed, ba_refine_focal_length=False, ba_refine_extra_params=False, min_model_size=3
    )
    options.mapper.random_seed = options.triangulation.random_seed = seed
    options.mapper.num_threads = 1
    options.mapper.abs_pose_refine_focal_length = options.mapper.abs_pose_refine_extra_params = False
    options.mapper.init_min_tri_angle = 6.0
    (folder / "models").mkdir()
    models = pycolmap.incremental_mapping(database, folder / "images", folder / "models", options)
    return [model for _, model in sorted(models.items())]


def _scale(model: Any, names: dict[str, int], reader: FrameReader, maximum_depth: float) -> float | None:
    """Return metres per unit of the model: the median over images of the median of measured over modelled depth."""
    ratios, points = [], 0
    for image_id in sorted(model.reg_image_ids()):
        image = model.images[image_id]
        depth = reader.read(names[image.name], ("depth",)).depth
        if depth is None:
            continue
        camera_from_world = np.vstack([image.cam_from_world().matrix(), [0, 0, 0, 1]])
        observations = [(p.xy, model.points3D[p.point3D_id].xyz) for p in image.points2D if p.has_point3D()]
        if not observations:
            continue
        pixels = np.array([xy for xy, _ in observations]) - 0.5
        modelled = np.array([xyz for _, xyz in observations]) @ camera_from_world[2, :3] + camera_from_world[2, 3]
        rows = np.clip(np.rint(pixels[:, 1]).astype(int), 0, depth.shape[0] - 1)
        columns = np.clip(np.rint(pixels[:, 0]).astype(int), 0, depth.shape[1] - 1)
        measured = depth[rows, columns]
        good = (measured > 0) & (measured <= maximum_depth) & (modelled > 0)
        if good.sum() >= 5:
            ratios.append(float(np.median(measured[good] / modelled[good])))
            points += int(good.sum())
    return float(np.median(ratios)) if points >= LEAST_SCALE_POINTS else None


def _poses(model: Any, names: dict[str, int], scale: float) -> dict[int, tuple[np.ndarray, float]]:
    """Return frame -> (world_from_camera (4, 4) [m], confidence) of the registered images."""
    result = {}
    for image_id in sorted(model.reg_image_ids()):
        image = model.images[image_id]
        pose = inverse(np.vstack([image.cam_from_world().matrix(), [0, 0, 0, 1]]))
        pose[:3, 3] *= scale
        result[names[image.name]] = (pose, min(1.0, image.num_points3D / REGISTERED_POINTS))
    return result
