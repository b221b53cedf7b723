"""Any scene as a folder that the physics of this toolkit loads: ours as it is, others written anew beside the fact."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.library.importing.limits import told_refusals
from scenewright.stages.library.importing.scenes.mjcf_scene import mjcf_scene, usd_scene
from scenewright.stages.library.importing.scenes.sdf_scene import sdf_scene
from scenewright.stages.library.importing.scenes.urdf_scene import urdf_scene
from scenewright.stages.library.importing.scenes.writing import OthersScene, write_scene
from scenewright.stages.library.importing.source_folder import SourceFolder

READERS: dict[str, Callable[[Path, Path], OthersScene]] = {
    "robot": urdf_scene,
    "mujoco": mjcf_scene,
    "sdf": sdf_scene,
    "gazebo": sdf_scene,
}
"""Root element -> reader."""
USD = (".usd", ".usda", ".usdc", ".usdz")
WHAT_IS_READ = "name a folder with scene.json, or a URDF, MJCF or SDF file"


@dataclass(frozen=True)
class OpenedScene:
    """A scene that can be loaded."""

    folder: Path
    """With scene.json, bodies and scene.mjcf.xml."""
    format: str = "scene folder"
    findings: tuple[str, ...] = ()
    """What of another's file was left out, or taken as something else."""
    model: Any = None
    """What MuJoCo made of an MJCF, which it runs in place of scene.mjcf.xml."""
    numbers: Mapping[str, int] = field(default_factory=dict)
    """Free body -> its number in that."""


@contextmanager
def opened_scene(path: Path, root: Path | None = None) -> Iterator[OpenedScene]:
    """Open a scene folder of ours, or a URDF, MJCF or SDF file, for as long as the block lasts.

    The meshes of URDF and SDF lie in `root` (None: the file's folder), and nothing beside it is read.

    Raises BadInput for what is none of these, and for what the file's reader refuses.
    """
    if path.is_dir():
        if not (path / "scene.json").is_file():
            raise BadInput(f"{path}: there is no scene.json in it", hint=WHAT_IS_READ)
        yield OpenedScene(path)
        return
    if not path.is_file():
        raise BadInput(f"{path}: there is no such file or folder", hint=WHAT_IS_READ)
    read: Callable[[Path, Path], OthersScene]
    if path.suffix.lower() in USD:
        read = usd_scene
    else:
        tag = SourceFolder(path.parent).read_xml(path).tag
        if tag not in READERS:
            raise BadInput(f"{path}: root element is <{tag:.40}>", hint=WHAT_IS_READ)
        read = READERS[tag]
    path = path.resolve()
    root = path.parent if root is None else root.resolve()
    if not path.is_relative_to(root):
        raise UsageError(f"--root {root}: {path} does not lie in it", hint="name a folder around the file")
    with tempfile.TemporaryDirectory() as folder:
        with told_refusals(str(path)):
            scene = read(path, root)
            write_scene(Path(folder), scene)
        try:
            yield OpenedScene(Path(folder), scene.format, scene.findings, scene.model, scene.numbers)
        except BadInput as error:  # of what was made of it
            raise BadInput(error.message.replace(folder, str(path)), hint="mend the file") from error
