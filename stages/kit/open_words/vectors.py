"""The arrays of a language map, read and written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.language_map import LanguageMap
from scenewright.stages.kit.formats.map_files import write_arrays
from scenewright.stages.kit.formats.numpy_files import read_arrays

FILE = "vectors.npz"
NAMES = ("means", "opacities", "pieces", "regions", "vectors")


@dataclass(frozen=True)
class Vectors:
    """See `scenewright.schemas.language_map.LanguageMap`; vectors as float32."""

    regions: np.ndarray
    means: np.ndarray
    opacities: np.ndarray
    pieces: np.ndarray
    vectors: np.ndarray


def of_regions(regions: np.ndarray) -> Vectors:
    """Return the vectors (R, width) of regions without Gaussians."""
    return Vectors(
        regions,
        np.zeros((0, 3), np.float32),
        np.zeros(0, np.float32),
        np.zeros((0, 0), np.int32),
        np.zeros((0, 0, regions.shape[1]), np.float32),
    )


def write_vectors(folder: Path, vectors: Vectors) -> None:
    """Write `vectors.npz` into a folder."""
    arrays: dict[str, np.ndarray] = {
        "means": vectors.means.astype(np.float32),
        "opacities": vectors.opacities.astype(np.float32),
        "pieces": vectors.pieces.astype(np.int32),
        "regions": vectors.regions.astype(np.float16),
        "vectors": vectors.vectors.astype(np.float16),
    }
    write_arrays(folder / FILE, arrays)


def read_vectors(language: LanguageMap) -> Vectors:
    """Read them. Raises BadInput for arrays that do not fit each other or language.json."""
    info, path = language.info, language.path(FILE)
    array_of = dict(zip(NAMES, read_arrays(path, *NAMES), strict=True))
    count, sizes, regions = info.gaussians, len(info.sizes), len(info.regions)
    shapes = {
        "means": (count, 3),
        "opacities": (count,),
        "pieces": (len(array_of["pieces"]), count),
        "regions": (regions, info.width),
        "vectors": (count, sizes, info.width),
    }
    for name, shape in shapes.items():
        array = array_of[name]
        if array.shape != shape or array.dtype.kind not in "fi" or not np.isfinite(array).all():
            raise BadInput(
                f"{path}: {name} has shape {array.shape}, expected {shape} finite numbers", hint="make it again"
            )
    pieces = array_of["pieces"]
    if pieces.size and (pieces.min() < -1 or pieces.max() >= regions):
        raise BadInput(f"{path}: a Gaussian belongs to a region that is not there", hint="make it again")
    return Vectors(
        array_of["regions"].astype(np.float32),
        array_of["means"].astype(np.float32),
        array_of["opacities"].astype(np.float32),
        pieces.astype(np.int32),
        array_of["vectors"].astype(np.float32),
    )
