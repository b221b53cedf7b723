"""Sequences, segments, maps and ground truth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from schemas.contact_graph import ContactGraphFile
from schemas.disparity import DisparityFile
from schemas.ground_truth import GroundTruthFile, TrueObject
from schemas.panoptic_map import EntitiesFile, Entity
from schemas.scene_parts import Camera
from schemas.segments import FrameSegment, SegmentsFile
from schemas.sequence import SequenceFile
from stages.engine.loading.artifact import LoadedArtifact
from stages.engine.loading.graphs import as_networkx
from stages.kit.formats.disparity_file import DisparityReader
from stages.kit.formats.frames import PIXEL_STREAMS, Frame, FrameReader
from stages.kit.formats.masks import PanopticReader
from stages.kit.formats.mesh_files import read_mesh
from stages.kit.formats.numpy_files import read_arrays
from stages.kit.formats.trajectories import read_tum
from stages.kit.stereo.disparity_map import DisparityMap


class LoadedSequence(LoadedArtifact):
    """Kind `sequence`: calibrated, posed frames."""

    @cached_property
    def info(self) -> SequenceFile:
        """sequence.json: detected format, drops by reason, gravity, notes."""
        return SequenceFile.read(self.path / "sequence.json")

    @property
    def camera(self) -> Camera:
        """The main camera."""
        return self.info.camera

    @property
    def cameras(self) -> dict[str, Camera]:
        """Every camera by name."""
        return {known.name: known.camera for known in self.info.cameras}

    def __len__(self) -> int:
        return self.info.frame_count

    @cached_property
    def times(self) -> np.ndarray:
        """Times (N,) of all frames [s]."""
        with self._reader() as reader:
            return reader.times

    @cached_property
    def trajectory(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (K,) [s] and world_from_camera (K, 4, 4) of the frames that have a pose; OpenCV cameras."""
        return read_tum(self.path / "trajectory.tum")

    @property
    def poses(self) -> np.ndarray:
        """world_from_camera (K, 4, 4) of the frames that have a pose."""
        return self.trajectory[1]

    def frame(self, index: int) -> Frame:
        """Return one frame with all its streams. Raises IndexError."""
        with self._reader() as reader:
            return reader.read(index, PIXEL_STREAMS)

    def frames(self, streams: Iterable[str] = ("color", "depth"), every: int = 1) -> Iterator[Frame]:
        """Yield frames in time order, one in memory at a time: colour (H, W, 3) uint8 RGB, depth (H, W) float32 [m].

        Only the `streams` asked for are decoded (color, depth, labels, right); the pose always is.
        """
        with self._reader() as reader:
            yield from reader.frames(tuple(streams), every)

    def _reader(self) -> FrameReader:
        return FrameReader(self.path / "frames.mcap")


class LoadedDisparity(LoadedSequence):
    """Kind `disparity`: a sequence with depth from stereo, and the maps that it is from."""

    @cached_property
    def matching(self) -> DisparityFile:
        """disparity.json: how pairs were matched, whether they were rectified, what was searched and found."""
        return DisparityFile.read(self.path / "disparity.json")

    def disparity(self, index: int) -> DisparityMap:
        """Return disparity (H, W) [px, NaN unknown] and confidence (H, W) of a frame. Raises IndexError."""
        with self._reader() as reader:
            stamps = reader.stamps
        if not 0 <= index < len(stamps):
            raise IndexError(f"frame {index} of {len(stamps)}")
        with DisparityReader(self.path / "disparity.mcap") as maps:
            return maps.read(int(stamps[index]))


class LoadedSegments(LoadedArtifact):
    """Kind `segments`: per-frame masks."""

    @cached_property
    def info(self) -> SegmentsFile:
        """segments.json."""
        return SegmentsFile.read(self.path / "segments.json")

    @property
    def label(self) -> str:
        """Which masks these are; to print beside every figure made with them."""
        return self.info.label

    @cached_property
    def frame_indices(self) -> tuple[int, ...]:
        """Frames of the sequence that have segments."""
        return tuple(frame.frame for frame in self.info.frames)

    def segments(self, frame: int) -> tuple[FrameSegment, ...]:
        """Return the segments of a frame (index in the sequence). Raises KeyError."""
        found = next((entry for entry in self.info.frames if entry.frame == frame), None)
        if found is None:
            raise KeyError(frame)
        return found.segments

    def mask(self, frame: int) -> np.ndarray:
        """Return the segment ids (H, W) int32 of a frame, 0 = void. Raises BadInput when it has none."""
        with PanopticReader(self.path / "panoptic.zip") as reader:
            return reader.read(frame)


@dataclass(frozen=True)
class LoadedEntity:
    """One object or surface of a panoptic map."""

    info: Entity
    path: Path
    """Its PLY file."""

    @property
    def instance(self) -> int:
        """Instance label, as in `LoadedMap.vertex_labels`."""
        return self.info.instance

    @property
    def class_name(self) -> str:
        """Class of data/vocabulary.toml."""
        return self.info.class_name

    @property
    def confidence(self) -> float:
        """Share of the votes that agree."""
        return self.info.confidence

    @property
    def box(self) -> np.ndarray:
        """Axis-aligned bounds (2, 3) in the world [m]: minimum, maximum."""
        return np.array([self.info.box_minimum, self.info.box_maximum])

    @cached_property
    def mesh(self) -> Any:
        """Its mesh in the world [m], a trimesh.Trimesh with vertex colours."""
        return read_mesh(self.path)

    def __repr__(self) -> str:
        return f"<entity {self.instance} {self.class_name}, {self.info.triangles} triangles>"


class LoadedMap(LoadedArtifact):
    """Kind `panoptic_map`."""

    @cached_property
    def info(self) -> EntitiesFile:
        """entities.json."""
        return EntitiesFile.read(self.path / "entities.json")

    @cached_property
    def mesh(self) -> Any:
        """The whole map in the world [m], a trimesh.Trimesh with vertex colours, in file order."""
        return read_mesh(self.path / "mesh.ply", may_be_empty=True)

    @cached_property
    def vertex_labels(self) -> dict[str, np.ndarray]:
        """`instance`, `segment`, `class_id`: (V,) int32 per vertex of `mesh`, 0 = unlabelled."""
        names = ("instance", "segment", "class_id")
        return dict(zip(names, read_arrays(self.path / "mesh_labels.npz", *names), strict=True))

    @cached_property
    def entities(self) -> tuple[LoadedEntity, ...]:
        """Every object and layout surface."""
        return tuple(LoadedEntity(entity, self.path / entity.mesh) for entity in self.info.entities)


class LoadedGroundTruth(LoadedArtifact):
    """Kind `ground_truth`: a generated log and what is true of its room."""

    @cached_property
    def info(self) -> GroundTruthFile:
        """ground_truth.json."""
        return GroundTruthFile.read(self.path / "ground_truth.json")

    @property
    def objects(self) -> tuple[TrueObject, ...]:
        """Every object: class, model, pose, box, joint values."""
        return self.info.objects

    @property
    def log(self) -> Path:
        """The log, for `scenewright ingest`."""
        return self.path / "log.mcap"

    @cached_property
    def graph(self) -> Any:
        """The true contact graph, a networkx.MultiDiGraph (as `LoadedContactGraph.graph`)."""
        return as_networkx(ContactGraphFile.read(self.path / "graph.json"))

    @cached_property
    def mesh(self) -> Any:
        """The whole true surface, a trimesh.Trimesh."""
        return read_mesh(self.path / "mesh.ply")
