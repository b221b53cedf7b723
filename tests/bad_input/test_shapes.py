"""Payloads whose parts do not fit each other: said where they are opened, before anything is computed with them."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.panoptic_map import EntitiesFile, PanopticMap
from scenewright.schemas.sequence import SequenceFile
from scenewright.stages.cad.free_space import load_free_space
from scenewright.stages.kit.drawing.tree_layout import tree_layout
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.report.graph_drawing import marks_from_evaluation
from scenewright.stages.report.kinematic_tree import corresponding_trees
from scenewright.stages.report.stage import _write

GOLDEN = Path(__file__).resolve().parents[1] / "golden"


@pytest.mark.parametrize("case", ["transposed", "fewer blocks", "words", "no axis"])
def test_a_volume_of_another_shape(tmp_path: Path, case: str) -> None:
    arrays = {
        "block_coordinates": np.zeros((5, 3), np.int32),
        "tsdf": np.zeros((5, 512), np.float16),
        "weight": np.zeros((5, 512), np.float16),
    }
    EntitiesFile(
        voxel_size=0.02, truncation_distance=0.06, frames_integrated=1, segmentation="truth", entities=()
    ).write(tmp_path / "entities.json")
    np.savez(tmp_path / "volume.npz", **arrays)
    assert load_free_space(PanopticMap(tmp_path)).near.values.shape == (5, 512)
    arrays |= {
        "transposed": {"tsdf": arrays["tsdf"].T},
        "fewer blocks": {"weight": arrays["weight"][:4]},
        "words": {"tsdf": np.full((5, 512), "a")},
        "no axis": {"block_coordinates": np.int32(3)},
    }[case]
    np.savez(tmp_path / "volume.npz", **arrays)
    with pytest.raises(BadInput, match=r"volume\.npz: \w+: shape .*expected"):
        load_free_space(PanopticMap(tmp_path))


@pytest.mark.parametrize("case", ["other blocks", "signed", "no edge"])
def test_free_cells_of_another_form(tmp_path: Path, case: str) -> None:
    arrays = {
        "block_coordinates": np.zeros((2, 3), np.int32),
        "free": np.zeros((2, 64), np.uint8),
        "edge": np.array([0.08]),
    }
    np.savez(tmp_path / "free_space.npz", **arrays)
    assert load_free_space(PanopticMap(tmp_path)).far.edge == 0.08
    arrays |= {
        "other blocks": {"free": np.zeros((2, 512), np.uint8)},
        "signed": {"free": np.zeros((2, 64), np.int64)},
        "no edge": {"edge": np.array([0.0])},
    }[case]
    np.savez(tmp_path / "free_space.npz", **arrays)
    with pytest.raises(BadInput, match="expected"):
        load_free_space(PanopticMap(tmp_path))


def test_shapes_name_the_same_size_by_the_same_letter(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", points=np.zeros((4, 3)), instance=np.zeros(4, int), other=np.zeros(5))
    path = tmp_path / "a.npz"
    assert len(read_arrays(path, "points", "instance", shapes=("N 3", "N"))) == 2
    assert len(read_arrays(path, "points", "other", shapes=("N 3", "M"))) == 2
    with pytest.raises(BadInput, match=r"other: shape \(5,\) of float64, expected \(N = 4\)"):
        read_arrays(path, "points", "other", shapes=("N 3", "N"))


def golden(kind: str, name: str) -> dict:
    """Return a document of the newest golden artifact of a kind."""
    return json.loads(sorted(GOLDEN.glob(f"v*/{kind}/{name}"))[-1].read_text())


@pytest.mark.parametrize(("change", "said"), [({"cameras": []}, "no camera"), ({"frame_count": -1}, "fewer than no")])
def test_a_sequence_without_cameras(tmp_path: Path, change: dict, said: str) -> None:
    (tmp_path / "sequence.json").write_text(json.dumps(golden("sequence", "sequence.json") | change))
    with pytest.raises(BadInput, match=said):
        SequenceFile.read(tmp_path / "sequence.json")


def node(name: str) -> dict:
    """Return a node of a graph."""
    return {"id": name, "instance": 1, "class_name": "box", "node_type": "scene" if name == "scene" else "rigid"}


def link(source: str, target: str, **fields: object) -> dict:
    """Return a support."""
    return {"source": source, "target": target, "relation": "supports", "confidence": 1.0, **fields}


@pytest.mark.parametrize(
    ("names", "links", "said"),
    [
        ("scene a a", [], "twice"),
        ("scene a", [link("scene", "b")], "no such node"),
        ("scene a", [link("b", "a")], "no such node"),
        ("scene a", [link("scene", "a", plane=0)], "no plane 0"),
        ("scene a b", [link("a", "b"), link("b", "a")], "circle"),
        ("scene a", [link("a", "a")], "circle"),
    ],
)
def test_graphs_whose_parts_do_not_fit(tmp_path: Path, names: str, links: list[dict], said: str) -> None:
    document = {"nodes": [node(name) for name in names.split()], "links": links}
    (tmp_path / "graph.json").write_text(json.dumps(document))
    with pytest.raises(BadInput, match=rf"graph\.json: .*{said}"):
        ContactGraphFile.read(tmp_path / "graph.json")


def test_a_tower_of_five_thousand(tmp_path: Path) -> None:
    names = ["scene", *(f"box_{number}" for number in range(5000))]
    links = [link(below, above) for below, above in zip(names, names[1:], strict=False)]
    (tmp_path / "graph.json").write_text(json.dumps({"nodes": [node(name) for name in names], "links": links}))
    graph = ContactGraphFile.read(tmp_path / "graph.json")
    layout = tree_layout({"scene": None} | {entry.target: entry.source for entry in graph.links})
    assert layout["box_4999"] == (5000.0, 0.0) and layout["scene"] == (0.0, 0.0)


def test_trees_of_a_graph_without_the_scene() -> None:
    graph = ContactGraphFile.model_validate({"nodes": [node("box_1")], "links": []})
    with pytest.raises(ValueError, match="no node 'scene'"):
        corresponding_trees(graph, ["world", "box_1"], [])


def test_a_page_that_names_what_is_no_utf8(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="not UTF-8"):
        _write("<p>caf\udce9</p>", "title", (), {}, SimpleNamespace(output=tmp_path))  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("table", [b"error,predicted\nx,\xff\n", b'error,predicted\n"' + b"x" * 200_000 + b'",y\n'])
def test_a_table_of_an_evaluation_that_is_none(tmp_path: Path, table: bytes) -> None:
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "graph_edit_distance.csv").write_bytes(table)
    with pytest.raises(BadInput, match=r"graph_edit_distance\.csv"):
        marks_from_evaluation(tmp_path)
