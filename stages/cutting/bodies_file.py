"""Closed bodies in an NPZ file, in double precision: a mesh that is closed stays closed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.kit.formats.numpy_files import read_arrays

HINT = "make the artifact again"
MOST_BODIES = 8192
"""Most bodies of a file; by eye."""


def write_bodies(path: Path, bodies: Sequence[Body]) -> None:
    """Write bodies in their order."""
    np.savez_compressed(
        path,
        vertices=np.concatenate([body.vertices for body in bodies]),
        faces=np.concatenate([body.faces for body in bodies]).astype(np.int32),
        sizes=np.array([(len(body.vertices), len(body.faces)) for body in bodies], np.int64),
    )


def read_bodies(path: Path) -> list[Body]:
    """Return the bodies of a file. Raises BadInput for one that is torn, or holds what is no closed body."""
    vertices, faces, sizes = read_arrays(path, "vertices", "faces", "sizes", shapes=("V 3", "F 3", "N 2"), hint=HINT)
    is_valid = len(sizes) <= MOST_BODIES and (sizes > 0).all() and np.isfinite(vertices).all()
    if not is_valid or (sizes.sum(axis=0) != (len(vertices), len(faces))).any():
        raise BadInput(f"{path}: its sizes do not fit its vertices and faces", hint=HINT)
    bodies = []
    starts = np.concatenate([np.zeros((1, 2), np.int64), np.cumsum(sizes, axis=0)])
    for number, ((v, f), (v_end, f_end)) in enumerate(zip(starts[:-1], starts[1:], strict=True)):
        mine = faces[f:f_end]
        if mine.min() < 0 or mine.max() >= v_end - v:
            raise BadInput(f"{path}: body {number} names a vertex that it has not", hint=HINT)
        try:
            bodies.append(Body.of_mesh(vertices[v:v_end], mine))
        except ValueError as error:
            raise BadInput(f"{path}: body {number} is not closed: {error}", hint=HINT) from None
    return bodies
