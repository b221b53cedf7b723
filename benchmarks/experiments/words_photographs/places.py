"""A recorded room with what its arms ask: one map of all networks, one splat, and the true surface of its things."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path

import numpy as np
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.language_map import LanguageMap
from scenewright.schemas.scene_parts import Box
from scenewright.schemas.segments import Segments
from scenewright.stages.evaluate import TrueRoom
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.masks import PanopticReader
from scenewright.stages.kit.geometry.boxes import minimum_box
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.splat import evenly, posed_frames
from scipy.spatial import cKDTree

from benchmarks.board.real.annotated import annotated_room
from benchmarks.graph_scores import OPTIONS
from benchmarks.steps import made, opened
from benchmarks.words.asked import AskedLog, Labelled, Query

NETWORKS = (
    "detectors/yolox_nano.onnx",
    "detectors/deeplab_voc_tflite/deeplabv3_mnv2_pascal_quant.tflite",
    "segmenters/deeplabv3_mnv2_ade20k_uint8.tflite",
    "segmenters/yolov8n_seg_640_int8.tflite",
)
"""Files of the data folder: YOLOX nano, DeepLab of PASCAL VOC and of ADE20K, YOLOv8n-seg."""
BEHIND = (0.05, 0.02)
"""A Gaussian is seen when it lies no farther behind the measured depth than this [m], and this share of it."""
NEAR = 0.02
"""A pixel shows a thing whose true points are so near to what depth says [m]."""


class AskedPhotographs(AskedLog):
    """A recorded log with masks of every network."""

    def __init__(self, root: Path, name: str, steps: int, log: Path, every: int, data: Path) -> None:
        super().__init__(root, name, steps, log, every)
        self.data, self.networks = data, folder_of_networks(data, root)

    @cached_property
    def segments(self) -> Segments:
        """Masks of all networks."""
        given = ("--sequence", self.sequence.root, "--backend", "detector+tflite", "--weights", self.networks)
        return opened(Segments, made("segment", self.folder / "segments", *given))

    @cached_property
    def map(self) -> Path:
        """The map that names pieces of the splat."""
        given = ("--sequence", self.sequence.root, "--segments", self.segments.root)
        return made("fuse", self.folder / "map", *given)

    @cached_property
    def graph(self) -> ContactGraph:
        """What stands on what in the map."""
        return opened(ContactGraph, made("graph", self.folder / "graph", "--panoptic-map", self.map))

    @cached_property
    def labels(self) -> LanguageMap:
        """Entities of the map, by looks and names."""
        given = ("--panoptic-map", self.map, "--sequence", self.sequence.root, "--most-views", self.most_views)
        return opened(LanguageMap, made("splat label", self.folder / "labels", *given))

    @cached_property
    def entity_places(self) -> list[np.ndarray]:
        """Where answers point that are entities of the map (3,) [m]."""
        return [np.array(region.point) for region in self.labels.info.regions]

    @cached_property
    def truth(self) -> TrueRoom:
        """The painted surface of its things; of a log that nobody painted, what lies in annotated boxes."""
        return annotated_room(self.name, self.sequence, self.folder)

    @cached_property
    def number(self) -> dict[str, int]:
        """Name of an annotated thing -> its instance."""
        return {thing.name: thing.instance for thing in self.truth.objects}

    @cached_property
    def boxes(self) -> dict[int, Box]:
        """Of the true surface that was seen; of what hardly was, as annotated."""
        found = {}
        for thing in self.truth.objects:
            points = self.truth.points[self.truth.instances == thing.instance]
            seen = len(points) >= OPTIONS.minimum_visible_points
            found[thing.instance] = minimum_box(points) if seen else thing.box
        return found

    @property
    def queries(self) -> tuple[list[Query], list[Query]]:
        raise NotImplementedError("phrases are drawn beforehand (drawing.py)")

    def labelled(self, frames: set[int]) -> dict[int, Labelled]:
        """Return what frames show by the true surface."""
        tree, found = cKDTree(self.truth.points), {}
        with FrameReader(self.sequence.path("frames.mcap")) as reader:
            poses = dict(posed_frames(reader, self.sequence, None))
            for index in sorted(frames):
                frame = reader.read(index, ("depth",))
                camera, pose = reader.cameras[frame.camera_name], poses[index]
                assert frame.depth is not None
                rows, columns = np.nonzero(frame.depth > 0)
                z = frame.depth[rows, columns].astype(float)
                rays = np.stack([(columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy, np.ones(len(z))], 1)
                points = (z[:, None] * rays) @ pose[:3, :3].T + pose[:3, 3]
                near, nearest = tree.query(points, distance_upper_bound=NEAR)
                labels = np.zeros(frame.depth.shape, np.int64)
                hits = np.isfinite(near)
                labels[rows[hits], columns[hits]] = self.truth.instances[nearest[hits]]
                found[index] = Labelled(labels, camera, inverse(pose))
        return found

    @cached_property
    def witnessed(self) -> tuple[tuple[str, ...], np.ndarray]:
        """Classes, and (N, classes) of every Gaussian the mean score that masks of the pictures which show it gave
        it: the thesis's field, of the same networks instead of an image-text encoder."""
        means = self.vectors_means
        classes: dict[int, int] = {}
        sums: dict[int, np.ndarray] = {}
        looks = np.zeros(len(means))
        scores = {frame.frame: {s.id: s for s in frame.segments} for frame in self.segments.info.frames}
        learned = [view.frame for view in self.splat.built.views if view.use == "learned"]
        with (
            FrameReader(self.sequence.path("frames.mcap")) as reader,
            PanopticReader(self.segments.path("panoptic.zip")) as masks,
        ):
            poses = dict(posed_frames(reader, self.sequence, None))
            for index in evenly(learned, self.most_views):
                frame = reader.read(index, ("depth",))
                assert frame.depth is not None
                seen, rows, columns = projected(means, frame.depth, reader.cameras[frame.camera_name], poses[index])
                looks[seen] += 1
                ids = masks.read(index)[rows, columns]
                for number in np.unique(ids):
                    segment = scores[index].get(int(number))
                    if segment is not None and segment.class_id:
                        at = seen[ids == number]
                        sums.setdefault(segment.class_id, np.zeros(len(means)))[at] += segment.score
        classes = {number: k for k, number in enumerate(sorted(sums))}
        return names_of_classes(classes), np.stack([sums[n] for n in classes], axis=1) / np.maximum(looks, 1)[:, None]

    @property
    def vectors_means(self) -> np.ndarray:
        """(N, 3) of the splat's Gaussians [m]."""
        from scenewright.stages.splat import read_gaussians

        return np.asarray(read_gaussians(self.splat.path("splat.ply")).means, float)


def names_of_classes(classes: Mapping[int, int]) -> tuple[str, ...]:
    """Return the names of class numbers."""
    from scenewright.schemas.vocabulary import load_vocabulary

    vocabulary = load_vocabulary()
    return tuple(vocabulary.by_id(number).name for number in classes)


def projected(
    means: np.ndarray, depth: np.ndarray, camera: object, world_from_camera: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which of the means (N, 3) a picture shows, and the rows and columns at which it does."""
    fx, fy, cx, cy = (float(getattr(camera, name)) for name in ("fx", "fy", "cx", "cy"))
    pose = inverse(world_from_camera)
    local = means @ pose[:3, :3].T + pose[:3, 3]
    z = np.maximum(local[:, 2], 1e-6)
    columns = np.rint(fx * local[:, 0] / z + cx)
    rows = np.rint(fy * local[:, 1] / z + cy)
    high, wide = depth.shape
    at = np.flatnonzero((local[:, 2] > 0.1) & (columns >= 0) & (columns < wide) & (rows >= 0) & (rows < high))
    r, c = rows[at].astype(int), columns[at].astype(int)
    there = depth[r, c]
    shown = (there > 0) & (z[at] < there + BEHIND[0] + BEHIND[1] * there)
    return at[shown], r[shown], c[shown]


def folder_of_networks(data: Path, out: Path) -> Path:
    """Return a folder with links to the networks, made below `out`."""
    folder = out / "networks"
    folder.mkdir(parents=True, exist_ok=True)
    for name in NETWORKS:
        link = folder / Path(name).name
        if not link.exists():
            link.symlink_to((data / name).resolve())
    return folder
