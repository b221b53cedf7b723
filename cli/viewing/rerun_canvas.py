"""A canvas that is a Rerun recording. Rerun is imported only here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np
import trimesh
from numpy.typing import ArrayLike
from scenewright.cli.viewing.arrangement import Arrangement
from scenewright.cli.viewing.viewer_process import viewer_address
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.schemas.scene_parts import Box, Camera
from scenewright.stages.kit.formats.foxglove import PNG_START
from scenewright.stages.kit.geometry.cameras import intrinsic_matrix
from scenewright.stages.kit.geometry.transforms import quaternion_of
from scenewright.stages.kit.viewing.canvas import Color, JointedLink, Parts, Trust, bytes_of, trust_table, vertex_colors

WORLD = "world"
DISTRIBUTION = "rerun-sdk"


def import_rerun() -> ModuleType:
    """Return the rerun module. Raises MissingDependency with the command that installs it."""
    try:
        import rerun
    except ImportError:
        raise MissingDependency(
            f"the viewer needs {DISTRIBUTION}, which is not installed", hint=f'pip install "{DISTRIBUTION}>=0.41"'
        ) from None
    return rerun


class RerunCanvas:
    """One Rerun recording, shown in a window or written to a file. Lengths in metres, z up, times in seconds.

    Paths are entity paths below `world/`. What is drawn before `time` was called is there all the time.
    """

    def __init__(self, name: str, save: Path | None) -> None:
        self._rerun: Any = import_rerun()
        self._recording = self._rerun.RecordingStream("scenewright", send_properties=False)
        self._recording.send_recording_name(name)
        self._static = True
        self._arrangement = Arrangement(WORLD)
        if save is None:
            self._recording.connect_grpc(viewer_address())
        else:
            try:
                save.parent.mkdir(parents=True, exist_ok=True)
                self._recording.save(save)
            except (OSError, RuntimeError) as error:
                raise BadInput(f"{save}: cannot be written: {error}", hint="choose another place for it") from None
        self._log(WORLD, self._rerun.ViewCoordinates.RIGHT_HAND_Z_UP)

    def __enter__(self) -> RerunCanvas:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self._recording.send_blueprint(self._arrangement.blueprint())
        self._recording.flush()
        self._recording.disconnect()

    def time(self, seconds: float, timeline: str = "time") -> None:
        """Set the time [s] of what is drawn from now on."""
        self._static = False
        self._recording.set_time(timeline, duration=float(seconds))

    def always(self) -> None:
        """What is drawn from now on is there all the time."""
        self._static = True

    def enclose(self, minimum: ArrayLike, maximum: ArrayLike) -> None:
        """Keep the box from `minimum` to `maximum` (3,) [m] in sight when the recording is opened."""
        self._arrangement.enclose(np.asarray(minimum, dtype=float), np.asarray(maximum, dtype=float))

    def view(self, name: str, *hidden: str) -> None:
        """Open a 3D view of everything but what lies under the hidden paths; without any there is one of all."""
        self._arrangement.views.append((name, hidden))

    def mesh(
        self,
        path: str,
        mesh: trimesh.Trimesh,
        colors: np.ndarray | None = None,
        *,
        front_only: bool = False,
        parts: Parts | None = None,
    ) -> None:
        """Draw a mesh; `colors` (V, 3 or 4) uint8 per vertex override its own.

        `front_only` leaves out faces that look away, so that one looks into a room through its walls. What the vertices
        belong to is not shown: a click in Rerun says the mesh alone.
        """
        if len(mesh.faces) == 0:
            return
        self._arrangement.drawn = True
        mesh, colors = vertex_colors(mesh, colors)
        self._log(
            f"{WORLD}/{path}",
            self._rerun.Mesh3D(
                vertex_positions=np.asarray(mesh.vertices, dtype=np.float32),
                triangle_indices=np.asarray(mesh.faces, dtype=np.uint32),
                vertex_normals=np.asarray(mesh.vertex_normals, dtype=np.float32),
                vertex_colors=colors,
                face_rendering=self._rerun.components.MeshFaceRendering.Front if front_only else None,
            ),
        )

    def points(self, path: str, points: np.ndarray, colors: np.ndarray | None = None, radius: float = 0.005) -> None:
        """Draw points (N, 3) with colours (N, 3) uint8."""
        self._arrangement.drawn = True
        self._log(
            f"{WORLD}/{path}", self._rerun.Points3D(np.asarray(points, dtype=np.float32), colors=colors, radii=radius)
        )

    def line(
        self,
        path: str,
        strips: list[np.ndarray],
        colors: list[Color],
        radius: float = 0.004,
        labels: list[str] | None = None,
    ) -> None:
        """Draw polylines, each (N, 3), in one colour each; `labels` are shown for what is selected."""
        self._arrangement.drawn = True
        strips = [np.asarray(strip, dtype=np.float32) for strip in strips]
        self._log(
            f"{WORLD}/{path}",
            self._rerun.LineStrips3D(
                strips,
                colors=[bytes_of(color) for color in colors],
                radii=radius,
                labels=labels,
                show_labels=None if labels is None else False,
            ),
        )

    def boxes(
        self, path: str, boxes: list[Box], labels: list[str], colors: list[Color], *, show_labels: bool = True
    ) -> None:
        """Draw oriented boxes with labels."""
        if boxes:
            self._arrangement.drawn = True
            self._log(
                f"{WORLD}/{path}",
                self._rerun.Boxes3D(
                    centers=[box.center for box in boxes],
                    sizes=[box.size for box in boxes],
                    quaternions=[self._rerun.Quaternion(xyzw=box.orientation) for box in boxes],
                    colors=[bytes_of(color) for color in colors],
                    labels=labels,
                    show_labels=show_labels,
                ),
            )

    def transform(self, path: str, parent_from_child: np.ndarray, scale: float = 1.0) -> None:
        """Place what lies under `path` with a rigid (4, 4) transform, after scaling it."""
        self._log(
            f"{WORLD}/{path}",
            self._rerun.Transform3D(
                translation=parent_from_child[:3, 3],
                quaternion=self._rerun.Quaternion(xyzw=quaternion_of(parent_from_child)),
                scale=None if scale == 1.0 else scale,
            ),
        )

    def joints(self, links: Sequence[JointedLink]) -> None:
        """Rerun has no sliders: links stay where `transform` put them."""

    def camera(self, path: str, camera: Camera) -> None:
        """Say that `path` is a pinhole camera (OpenCV axes)."""
        self._arrangement.drawn = True
        self._log(
            f"{WORLD}/{path}",
            self._rerun.Pinhole(
                image_from_camera=intrinsic_matrix(camera),
                width=camera.width,
                height=camera.height,
                camera_xyz=self._rerun.ViewCoordinates.RDF,
                image_plane_distance=0.3,
            ),
        )

    def picture(self, path: str, data: bytes) -> None:
        """Show a JPEG or PNG as it is, in the 2D view of the path above."""
        self._picture(path)
        kind = "image/png" if data.startswith(PNG_START) else "image/jpeg"
        self._log(f"{WORLD}/{path}", self._rerun.EncodedImage(contents=data, media_type=kind))

    def depth(self, path: str, depth: np.ndarray) -> None:
        """Show depth (H, W) float [m], 0 = invalid; under a camera Rerun draws it as points."""
        millimetres = np.clip(np.rint(depth * 1000), 0, 65535).astype(np.uint16)
        data = cv2.imencode(".png", millimetres, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes()
        image = self._rerun.EncodedDepthImage(
            blob=data, media_type="image/png", meter=1000.0, depth_range=(0.0, 5000.0)
        )
        self._log(f"{WORLD}/{path}", image)

    def label_names(self, path: str, rows: list[tuple[int, str, Color]]) -> None:
        """Say what the ids of the label images under `path` mean."""
        infos = [
            self._rerun.AnnotationInfo(id=number, label=name, color=[*bytes_of(color), 255])
            for number, name, color in rows
        ]
        self._log(f"{WORLD}/{path}", self._rerun.AnnotationContext(infos))

    def labels(self, path: str, ids: np.ndarray) -> None:
        """Show ids (H, W) 0..65535 over the picture; 0 is void."""
        self._picture(path)
        self._log(f"{WORLD}/{path}", self._rerun.SegmentationImage(ids.astype(np.uint16), opacity=0.5))

    def graph(self, names: list[str], colors: list[Color], edges: list[tuple[str, str]]) -> None:
        """Show a directed graph in a view of its own."""
        self._arrangement.graph = True
        nodes = self._rerun.GraphNodes(names, labels=names, colors=[bytes_of(color) for color in colors])
        self._log("graph", nodes, self._rerun.GraphEdges(edges, graph_type="directed"))

    def trust(self, rows: Mapping[str, Trust]) -> None:
        """Show how far things can be trusted as a table."""
        self.document("trust", trust_table(rows))

    def moment(self, seconds: float, text: str, *, bad: bool = False) -> None:
        """Say in the log of texts what begins at a time [s]."""
        static = self._static
        self.time(seconds)
        self._log("moments", self._rerun.TextLog(text, level="ERROR" if bad else "INFO"))
        self._static = static

    def document(self, path: str, markdown: str) -> None:
        """Show a text in Markdown."""
        if path not in self._arrangement.documents:
            self._arrangement.documents.append(path)
        self._log(path, self._rerun.TextDocument(markdown, media_type="text/markdown"))

    def _picture(self, path: str) -> None:
        group = path.rpartition("/")[0] or path
        if group not in self._arrangement.pictures:
            self._arrangement.pictures.append(group)

    def _log(self, path: str, *archetypes: Any) -> None:
        self._recording.log(path, *archetypes, static=self._static)
