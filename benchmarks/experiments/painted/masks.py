"""Masks of every frame out of a surface whose things are known: what nobody but a person at every frame could paint."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.vocabulary import UNNAMED
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply
from scipy.spatial import cKDTree

REACH = 0.03
"""A pixel is of the thing whose point is nearest to its own, at most so far [m]."""


def write_masks(truth: GroundTruth, sequence: Sequence, folder: Path) -> int:
    """Write `<frame>.png`, the thing of each pixel with depth, and `<frame>.json`, their classes; return how many.

    What hides what, depth says: a pixel is of what lies at its own point.
    """
    folder.mkdir(parents=True, exist_ok=True)
    points, instances = read_arrays(truth.path("visible.npz"), "points", "instance", shapes=("N 3", "N"))
    tree = cKDTree(points.astype(float), balanced_tree=False, compact_nodes=False)
    owner = np.append(instances.astype(np.uint16), 0)
    names = {entry.instance: "" if entry.class_name == UNNAMED else entry.class_name for entry in truth.info.objects}
    count = 0
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for frame in reader.frames(streams=("depth",)):
            if frame.depth is None or frame.world_from_camera is None:
                continue
            seen = frame.depth > 0
            places = apply(
                frame.world_from_camera,
                back_project(frame.depth, reader.cameras[frame.camera_name])[seen].astype(float),
            )
            labels = np.zeros(frame.depth.shape, dtype=np.uint16)
            labels[seen] = owner[tree.query(places, distance_upper_bound=REACH)[1]]
            Image.fromarray(labels).save(folder / f"{frame.index:06d}.png")
            present = [int(value) for value in np.unique(labels) if value]
            entries = {str(value): {"class": names[value]} for value in present}
            (folder / f"{frame.index:06d}.json").write_text(json.dumps(entries), encoding="utf-8")
            count += 1
    return count
