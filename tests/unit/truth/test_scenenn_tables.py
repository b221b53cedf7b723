"""`make scenenn`: scenes are found or what they lack is said; tables hold what was measured, and what was printed."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.measurement.average_precision import Candidates
from scenewright.stages.kit.measurement.panoptic_quality import ClassQuality

from benchmarks.command import main
from benchmarks.experiments.scenenn.outcomes import Outcome, ranked
from benchmarks.experiments.scenenn.scenes import Scene, find_scene
from benchmarks.experiments.scenenn.tables import all_figures, of_ten, printed, read_published
from tests.unit.truth.scenenn_folder import SCENE, write_folder


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp("data")
    write_folder(root, frames=3)
    return root


def test_the_printed_figures_are_consistent():
    """PQ, SQ and RQ of table 2.2: the printed class means are the means of the printed classes."""
    published = read_published()
    assert len(published["sequences"]) == len(set(published["sequences"])) == 20
    names = [*published["stuff"], *published["things"]]
    for name in names:
        load_vocabulary().by_name(name)
    for row in published["table_2_2"].values():
        for measure in ("pq", "rq"):
            assert row[measure]["all"] == pytest.approx(np.mean([row[measure][name] for name in names]), abs=0.25)
            assert row[measure]["stuff"] == pytest.approx(
                np.mean([row[measure][name] for name in published["stuff"]]), abs=0.06
            )
    for row, values in published["table_2_4"].items():
        if "refined" in row or row.endswith("ours"):
            assert values["all"] == pytest.approx(np.mean([values[name] for name in published["things"]]), abs=0.1)


def test_a_scene_is_found_wherever_it_lies(data, tmp_path):
    found = find_scene(SCENE, data)
    assert isinstance(found, Scene) and found.mesh == data / SCENE / "011.ply"
    shutil.copytree(data / SCENE, tmp_path / "main" / SCENE)
    assert isinstance(find_scene(SCENE, tmp_path), Scene)
    (tmp_path / "second").mkdir()
    for name in ("011.xml", "011.ply"):
        shutil.copy(data / SCENE / name, tmp_path / "second" / name)
    other = find_scene(SCENE, data, tmp_path / "second")
    assert isinstance(other, Scene) and other.annotation == tmp_path / "second" / "011.xml"


def test_what_a_scene_lacks_is_said(data, tmp_path):
    assert find_scene("005", data) == "no folder"
    folder = tmp_path / SCENE
    folder.mkdir()
    shutil.copy(data / SCENE / "011.ply", folder)
    (tmp_path / "oni").mkdir()
    (tmp_path / "oni" / "011.oni").touch()
    text = find_scene(SCENE, tmp_path)
    assert isinstance(text, str) and "image/" in text and "trajectory.log" in text and "011.oni" in text
    whole = tmp_path / "whole"
    shutil.copytree(data / SCENE, whole / SCENE)
    (whole / SCENE / "011.xml").unlink()
    assert find_scene(SCENE, whole) == "no 011.xml"


def test_without_the_data_one_line_says_what_to_fetch(capsys, tmp_path):
    words = ["scenenn", "--out", str(tmp_path / "out")]
    assert main(words) == 2
    told = capsys.readouterr().err.strip()
    assert "\n" not in told and "https://hkust-vgd.github.io/scenenn/" in told
    assert main([*words, "--data", str(tmp_path), "--sequences", SCENE]) == 3


def outcome(found: int, missed: int, confidence: float) -> Outcome:
    """Tables alone: `found` of them with IoU 0.8, `missed` not; one prediction is wrong."""
    quality = {"table": ClassQuality(found, 1, missed, 0.8 * found), "shelf": ClassQuality(0, 5, 0, 0.0)}
    iou = np.zeros((found + 1, found + missed))
    iou[np.arange(found), np.arange(found)] = 0.8
    candidates = ranked({"table": Candidates(iou, confidence - np.arange(found + 1.0))})
    return Outcome(quality, quality, candidates, candidates, candidates)


def test_figures_add_up_over_sequences_before_they_are_averaged():
    one, other = of_ten(outcome(3, 0, 50.0)), of_ten(outcome(1, 4, 10.0))
    assert all_figures([one])["pq"] == pytest.approx(0.8 * 3 / 3.5)
    both = all_figures([one, other])
    assert both["pq_table"] == pytest.approx(0.8 * 4 / (4 + 1 + 2))
    # Classes outside of the ten take no part, whatever was predicted of them.
    assert both["pq"] == both["pq_table"]
    # Sorted by confidence: three hits, a miss, a hit, a miss; three of eight tables are never found.
    assert both["instance_ap"] == pytest.approx((3 + 4 / 5) / 8)
    code = both["instance_ap_thesis_code"]
    assert code is not None and code > (3 + 4 / 5) / 8
    text = printed(["011"])
    assert "| 011 | Han 2024: ours | 45.5 |" in text
    assert "| 096 |" not in text  # a sequence that was not run is not in the table
    assert "Han 2024: OccuSeg" in text and "Han 2024: ours, refined" in text


@pytest.mark.slow
def test_the_whole_chain_on_a_small_scene(data, tmp_path):
    """Geometric masks name no class, so only that everything runs and is told is looked at."""
    words = [
        "scenenn",
        "--data",
        str(data),
        "--backend",
        "geometric",
        "--arms",
        "ours",
        "--every",
        "1",
        "--voxel-size",
        "0.05",
    ]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out" / "table.md").read_text()
    assert "1 of the thesis's 20 sequences: 011" in text and "005 (no folder)" in text and "name no classes" in text
    assert (tmp_path / "out" / "metrics.json").is_file()
