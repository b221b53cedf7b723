"""Artifacts for people who write Python: `load` gives the handle that a step gets, `payload` reads its heavy files."""

from __future__ import annotations

import fnmatch
import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar, overload

from scenewright.schemas.artifact import Artifact
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput
from scenewright.stages.engine.reading import open_artifact
from scenewright.stages.engine.run_folders import artifacts_of

if TYPE_CHECKING:
    import networkx
    from scenewright.stages.kit.formats.disparity_file import DisparityReader
    from scenewright.stages.kit.formats.frames import FrameReader
    from scenewright.stages.kit.formats.masks import PanopticReader

READERS = {
    "frames.mcap": ("frames", "FrameReader"),
    "disparity.mcap": ("disparity_file", "DisparityReader"),
    "panoptic.zip": ("masks", "PanopticReader"),
    "*.tum": ("trajectories", "read_tum"),
    "*.npz": ("numpy_files", "read_all_arrays"),
    "*.npy": ("numpy_files", "read_array"),
    "*.ply": ("mesh_files", "read_mesh"),
    "*.obj": ("mesh_files", "read_mesh"),
    "*.glb": ("mesh_files", "read_mesh"),
}
"""Payload files by name, whatever the kind -> module of stages/kit/formats and what steps read them with."""

Kind = TypeVar("Kind", bound=Artifact)


def load(path: Path | str, expected: type[Kind] = Artifact) -> Kind:  # type: ignore[assignment]
    """Open an artifact folder. Kind, version and sizes are checked now, the content is read when it is asked for.

    Raises BadInput when it is no artifact, torn, of another kind than `expected`, or of another schema version (the
    message says how to migrate).
    """
    return open_artifact(Path(path), expected)  # type: ignore[return-value]


def load_run(path: Path | str) -> dict[str, Artifact]:
    """Open every artifact of a run folder: step name -> artifact, in the order in which they were made.

    Raises BadInput when there are none, or for the first that cannot be opened.
    """
    artifacts: dict[str, Artifact] = {name: load(folder) for name, folder in artifacts_of(Path(path)).items()}
    started = {name: artifact.manifest.provenance.started for name, artifact in artifacts.items() if artifact.manifest}
    return dict(sorted(artifacts.items(), key=lambda item: (started[item[0]], item[0])))


@overload
def payload(artifact: Artifact, name: Literal["frames.mcap"]) -> FrameReader: ...
@overload
def payload(artifact: Artifact, name: Literal["disparity.mcap"]) -> DisparityReader: ...
@overload
def payload(artifact: Artifact, name: Literal["panoptic.zip"]) -> PanopticReader: ...
@overload
def payload(artifact: Artifact, name: str) -> Any: ...
def payload(artifact: Artifact, name: str) -> Any:
    """Read a payload file with the reader of its format, the same that steps use.

    `frames.mcap`, `disparity.mcap` and `panoptic.zip` open as readers (close them, or use `with`), `*.tum` gives times
    (N,) [s] and world_from_camera (N, 4, 4), `*.npz` name -> array, `*.npy` an array, a mesh a trimesh.Trimesh.
    Raises BadInput when the artifact has no such file, or it is damaged, or of a format that has no reader here.
    """
    path = artifact.file(name)
    for pattern, (module, reader) in READERS.items():
        if fnmatch.fnmatch(path.name, pattern):
            read_file = getattr(importlib.import_module(f"scenewright.stages.kit.formats.{module}"), reader)
            return read_file(path, may_be_empty=True) if reader == "read_mesh" else read_file(path)
    raise BadInput(f"{path}: has no reader", hint="open it yourself: .file(name) is its path")


def as_networkx(graph: ContactGraphFile) -> networkx.MultiDiGraph:
    """Return a networkx.MultiDiGraph: node id -> the fields of GraphNode, edges keyed and attributed by relation.

    `supports`, `contains`, `carries_on_wall` and `hangs_from` go from the carrier to what it carries, `unknown` from
    the scene to what nothing is known to carry, and `also_supports` and `leans_on`, which stand beside the tree, from
    what helps; `proximal` holds both ways and is there once. `box` and `planes` are the models of
    schemas/scene_parts.py.
    """
    import networkx

    result = networkx.MultiDiGraph()
    for node in graph.nodes:
        result.add_node(node.id, **{name: getattr(node, name) for name in type(node).model_fields if name != "id"})
    for link in graph.links:
        fields = {name: getattr(link, name) for name in type(link).model_fields if name not in ("source", "target")}
        result.add_edge(link.source, link.target, key=link.relation, **fields)
    return result
