"""Files that pages print in full are read by the code that they are for, and lists of kinds are those of the code."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.engine.batch.spec import read_spec
from scenewright.stages.engine.pipelines import read_pipeline
from scenewright.stages.fuse.parameters import STAGE as FUSE
from scenewright.stages.kit.configuration import parameters_for, read_config
from scenewright.stages.kit.labels import match_labels, read_label_file
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.segment.naming import NamedSegment, name_segments

ROOT = Path(__file__).resolve().parents[2]


def block(page: str, holds: str, folder: Path, name: str) -> Path:
    """Write the one TOML block of a page that holds a text into a folder, and return the file."""
    blocks = re.findall(r"^```toml\n(.*?)^```", (ROOT / "docs" / page).read_text(), re.DOTALL | re.MULTILINE)
    (found,) = [each for each in blocks if holds in each]
    (folder / name).write_text(found)
    return folder / name


def test_the_config_file_is_one_of_its_step(tmp_path: Path) -> None:
    config = read_config(block("BATCH.md", "# fuse.toml", tmp_path, "fuse.toml"))
    assert parameters_for(FUSE, {}, config).model_dump()["voxel_size"] == 0.01
    assert parameters_for(FUSE, {"voxel_size": 0.02}, config).model_dump()["voxel_size"] == 0.02


def test_the_pipeline_file_is_a_pipeline(tmp_path: Path) -> None:
    pipeline = read_pipeline(block("BATCH.md", 'name = "fine-maps"', tmp_path, "fine_maps.toml"))
    assert [step.stage for step in pipeline.step] == ["ingest", "segment", "fuse"]
    assert pipeline.step[-1].parameters == {"voxel_size": 0.01} and list(pipeline.variables) == ["log"]


def test_the_smallest_batch_file_is_enough(tmp_path: Path) -> None:
    spec = read_spec(block("BATCH.md", "# how most real logs end", tmp_path, "rooms.toml"))
    assert spec.pipeline == "reconstruct" and spec.accept == ("unsettled", "penetrating")


def test_the_arm_on_a_table_stands_still_where_it_is_put(tmp_path: Path) -> None:
    robot = load_robot(str(block("ROBOT.md", "# bench_ur5e.toml", tmp_path, "bench_ur5e.toml")))
    assert (robot.name, robot.drives, robot.pedestal_height) == ("bench_ur5e", False, 0.75)
    assert load_robot("ur5e").drives and robot.urdf == load_robot("ur5e").urdf


def test_the_table_of_labels_makes_two_chairs_of_a_semantic_mask(tmp_path: Path) -> None:
    table = read_label_file(block("MASKS.md", 'kind = "stuff"', tmp_path, "labels.toml"))
    ids = np.zeros((20, 40), dtype=np.int32)
    ids[2:18, 2:18] = ids[2:18, 22:38] = 3
    vocabulary = load_vocabulary()
    for given, chairs in ((None, 1), (table, 2)):
        matched = match_labels({1: "wall", 3: "chair"}, given, where="masks")
        frame = name_segments(ids, {3: NamedSegment(matched.labels[3], 1.0)}, vocabulary, minimum_pixels=10)
        assert [mask.class_id for mask in frame.masks.values()] == [vocabulary.by_name("chair").id] * chairs
    assert {label.id: label.class_name for label in table.labels} == {1: "wall", 3: "chair"}


def kinds_raised(file: Path) -> set[str]:
    """Return the kinds of failure that a file gives in so many words to `MotionFailed` and `Failure`."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "id", "")
        given = [*node.args[:1]] if name == "MotionFailed" else []
        if name == "Failure":
            given = [keyword.value for keyword in node.keywords if keyword.arg == "kind"]
        for value in given:
            found |= {part.value for part in ast.walk(value) if isinstance(part, ast.Constant) and part.value}
    return {kind for kind in found if isinstance(kind, str) and not kind.startswith("_")}


def test_every_kind_of_failure_of_a_plan_is_on_its_page() -> None:
    page = (ROOT / "docs" / "PLANNING.md").read_text()
    section = page.partition("### Why a plan fails")[2].partition("\n## ")[0]
    listed = set(re.findall(r"`([a-z_]+)`", " ".join(re.findall(r"^\|([^|]*)\|", section, re.MULTILINE))))
    files = [file for folder in ("stages/plan", "stages/kit/motion") for file in (ROOT / folder).rglob("*.py")]
    raised = set().union(*map(kinds_raised, files)) | {"not_found", "goal_in_collision"}
    assert listed == raised


@pytest.mark.parametrize("link", re.findall(r"\]\((docs/[^)#]+#[^)]+)\)", (ROOT / "README.md").read_text()))
def test_places_on_pages_that_the_readme_links_are_there(link: str) -> None:
    page, _, place = link.partition("#")
    heads = re.findall(r"^#+ (.*)$", (ROOT / page).read_text(), re.MULTILINE)
    assert place in {re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for head in heads}
