"""PLY: what is written is read back, by trimesh too; torn files are refused; canonical order is canonical."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.ply_files import ColoredMesh, canonical_order, read_ply, write_ply


def mesh(seed: int = 0) -> ColoredMesh:
    random = np.random.default_rng(seed)
    return ColoredMesh(
        random.normal(size=(20, 3)).astype(np.float32),
        random.permuted(np.tile(np.arange(20), (30, 1)), axis=1)[:, :3].astype(np.int32),
        random.integers(0, 256, (20, 3)).astype(np.uint8),
    )


def test_round_trip(tmp_path: Path) -> None:
    written = mesh()
    write_ply(tmp_path / "a.ply", written)
    read = read_ply(tmp_path / "a.ply")
    for name in ("vertices", "faces", "colors"):
        assert np.array_equal(getattr(read, name), getattr(written, name))
    other = trimesh.load(tmp_path / "a.ply", process=False)
    assert np.allclose(other.vertices, written.vertices) and np.array_equal(other.faces, written.faces)
    assert np.array_equal(np.asarray(other.visual.vertex_colors)[:, :3], written.colors)


def test_empty_mesh(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", ColoredMesh(*(np.zeros((0, 3), kind) for kind in (np.float32, np.int32, np.uint8))))
    assert len(read_ply(tmp_path / "a.ply").vertices) == 0


def test_canonical_order_forgets_the_order() -> None:
    first = mesh()
    random = np.random.default_rng(5)
    order = random.permutation(20)
    rank = np.argsort(order)
    faces = np.roll(rank[first.faces], 1, axis=1)[random.permutation(30)].astype(np.int32)
    shuffled = ColoredMesh(first.vertices[order], faces, first.colors[order])
    (one, places), (two, _) = canonical_order(first), canonical_order(shuffled)
    for name in ("vertices", "faces", "colors"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()
    assert np.array_equal(one.vertices, first.vertices[places])
    assert (np.diff(one.vertices[:, 2]) >= 0).all()


def test_missing_file_and_wrong_arrays(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="missing"):
        read_ply(tmp_path / "none.ply")
    good = mesh()
    with pytest.raises(ValueError, match="outside"):
        write_ply(tmp_path / "a.ply", ColoredMesh(good.vertices[:5], good.faces, good.colors[:5]))
    with pytest.raises(ValueError, match="both"):
        write_ply(tmp_path / "a.ply", ColoredMesh(good.vertices, good.faces, good.colors[:5]))
