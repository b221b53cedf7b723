"""`fuse`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.panoptic_map import PanopticMap

from tests.advice.rows import NotTried, Tried
from tests.unit.fuse.test_from_mesh import THINGS, write_ply
from tests.unit.fuse.test_from_mesh import room as furnished

PARAMETERS, FRAME, MESH = "stages/fuse/parameters.py", "stages/fuse/scan_frame.py", "stages/fuse/from_mesh.py"
FRAMES = "fuse --out map --sequence {room}/sequence --segments {masks}/segments"
EDITED = "only segments that were edited by hand bring it up, for the manifest names their sequence"


def scan(name: str, size: tuple[float, float, float] = (4.0, 3.0, 2.4), scale: float = 1.0, y_up: bool = False):  # type: ignore[no-untyped-def]
    """Return a writer of the surface of a room, seen from within."""

    def write(folder: Path) -> None:
        mesh = trimesh.creation.box(size).subdivide_to_size(0.15)
        mesh.apply_translation([0, 0, size[2] / 2])
        mesh.invert()
        if y_up:
            mesh.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
        mesh.apply_scale(scale)
        (folder / name).parent.mkdir(exist_ok=True)
        mesh.export(folder / name)

    return write


def two_scans(folder: Path) -> None:
    for name in ("a", "b"):
        scan(f"scans/{name}.ply")(folder)


def dust(folder: Path) -> None:
    two_scans(folder)
    scan("dust.ply", scale=1e-6)(folder)


def floor(folder: Path) -> None:
    """A floor alone, y up."""
    scan("floor.ply", (4.0, 3.0, 0.001), y_up=True)(folder)


def height_is_right(folder: Path) -> None:
    vertices = trimesh.load_mesh(folder / "map/mesh.ply").vertices
    assert abs(np.ptp(vertices[:, 2]) - 2.4) < 0.02 and abs(np.ptp(vertices[:, 0]) - 4.0) < 0.02


def numbered(folder: Path) -> None:
    """A room whose labels are numbers, and what they are."""
    mesh, labels = furnished()
    write_ply(folder / "room.ply", mesh, label=labels)
    rows = [f'{{ name = "n{k}", id = {k}, class = "{name}" }}' for name, k in THINGS.items()]
    (folder / "names.toml").write_text(f"labels = [{', '.join(rows)}]")


def has_its_names(folder: Path) -> None:
    info = PanopticMap(folder / "map").info
    assert {entity.class_name for entity in info.entities} == set(THINGS)


ROWS = [
    Tried(
        PARAMETERS,
        "is not below",
        f"{FRAMES} --minimum-depth 5 --maximum-depth 3 --dry-run",
        f"{FRAMES} --minimum-depth 0.5 --maximum-depth 3 --dry-run",
    ),
    Tried(
        PARAMETERS,
        "is a whole scan",
        "fuse --out map --from-mesh room.ply --sequence {room}/sequence --dry-run",
        "fuse --out map --from-mesh room.ply --dry-run",
        given=scan("room.ply"),
    ),
    Tried(
        PARAMETERS,
        "is a whole scan",
        "fuse --out map --from-mesh room.ply --sequence {room}/sequence --segments {masks}/segments --dry-run",
        f"{FRAMES} --dry-run",
        given=scan("room.ply"),
    ),
    Tried(PARAMETERS, "is missing", "fuse --out map --sequence {room}/sequence --dry-run", f"{FRAMES} --dry-run"),
    Tried(
        PARAMETERS,
        "are those of --from-mesh",
        f"{FRAMES} --up +y",
        "ingest --log {room}/log/frames.mcap --gravity given --up y --out sequence",
    ),
    Tried(
        PARAMETERS,
        "names the labels of --from-mesh",
        f"{FRAMES} --labels names.toml --dry-run",
        "fuse --out map --from-mesh room.ply --labels names.toml",
        given=numbered,
        right=has_its_names,
    ),
    Tried(
        "stages/fuse/annotated_scan.py",
        "name one of them",
        "fuse --out map --from-mesh scans",
        "fuse --out map --from-mesh scans/a.ply",
        code=3,
        given=two_scans,
        right=height_is_right,
    ),
    Tried(
        "stages/fuse/bare_scan.py",
        "no floor is seen",
        "fuse --out map --from-mesh floor.ply",
        "fuse --out map --from-mesh floor.ply --up +y",
        code=3,
        given=floor,
    ),
    Tried(
        MESH,
        "nothing says what label",
        "fuse --out map --from-mesh room.ply",
        "fuse --out map --from-mesh room.ply --labels names.toml",
        code=3,
        given=numbered,
        right=has_its_names,
    ),
    NotTried(MESH, "nothing of it is labelled", "it is said of every bare scan, with the axis that --up gave it"),
    NotTried(MESH, "no floor is annotated", "the scan stays as --up says, and the line names the option again"),
    Tried(
        FRAME,
        "if y is up",
        "fuse --out other --from-mesh room.ply",
        "fuse --out map --from-mesh room.ply --up +y",
        code=3,
        given=scan("room.ply", y_up=True),
        right=height_is_right,
    ),
    Tried(
        FRAME,
        "makes it",
        "fuse --out map --from-mesh room.ply",
        "fuse --out map --from-mesh room.ply --unit mm",
        code=3,
        given=scan("room.ply", scale=1000.0),
        right=height_is_right,
    ),
    Tried(
        FRAME,
        "or the scan of a room",
        "fuse --out map --from-mesh dust.ply",
        "fuse --out map --from-mesh scans/a.ply",
        code=3,
        given=dust,
        right=height_is_right,
    ),
    Tried(
        "stages/fuse/inputs.py",
        "made from another sequence",
        "ingest --log {room}/log/frames.mcap --every 2 --out half && "
        "fuse --out map --sequence half --segments {masks}/segments",
        "segment --sequence half --backend ground-truth --out segments && "
        "fuse --out map --sequence half --segments segments",
        code=3,
    ),
    NotTried("stages/fuse/inputs.py", "run `scenewright segment` on this sequence", EDITED),
    NotTried("stages/fuse/mapping.py", "is in the panoptic image but not in segments.json", EDITED),
]
