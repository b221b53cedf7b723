"""The step `tableware detect`: its files, the same bytes twice, images and cameras that cannot be read; the score."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.tableware_detections import TablewareDetection, TablewareDetections, TablewareDetectionsFile
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.tableware.detect_parameters import DETECT, DetectParameters, check_inputs
from scenewright.stages.tableware.detect_stage import run
from scenewright.stages.tableware.vision.detections import Detection, as_table
from scenewright.stages.tableware.vision.detections_file import from_file
from scenewright.stages.tableware.vision.error_model import ErrorModel, KindErrors, error_model, sampled_detections
from scenewright.stages.tableware.vision.image_files import read_camera, read_image
from scenewright.stages.tableware.vision.photographs import find_outlines
from scenewright.stages.tableware.world.items import STANDARD, Table, make_item
from scenewright.stages.tableware.world.overhead import overhead_camera

from benchmarks.experiments.tidy_detect.score import Match, compare, measures, reliability
from benchmarks.experiments.tidy_detect_real import grouped, matched, overlap, ratio

VIEW = overhead_camera()


@pytest.fixture(scope="module")
def scene(images, tmp_path_factory) -> Path:
    folder: Path = tmp_path_factory.mktemp("scene")
    cv2.imwrite(str(folder / "color.png"), images[0][..., ::-1])
    np.savez(folder / "depth.npz", depth=images[1])
    told = {"camera": VIEW.camera.model_dump(), "world_from_camera": VIEW.world_from_camera.tolist(), "tier": "any"}
    (folder / "scene.json").write_text(json.dumps(told))
    return folder


def detect(
    folder: Path,
    image: Path,
    depth: Path | None = None,
    camera: Path | None = None,
    dishes: Path | None = None,
    **options: Any,
):
    folder.mkdir()
    context = Context(output=folder, seed=0, device="cpu", progress=SilentProgress())
    parameters = DetectParameters(**options)
    check_inputs(parameters, {"image": image, "depth": depth, "camera": camera})
    return run(image, depth, camera, dishes, parameters=parameters, context=context)


def test_a_scenes_folder_becomes_the_same_bytes_twice(scene: Path, tmp_path: Path) -> None:
    first, second = (detect(tmp_path / name, scene) for name in ("a", "b"))
    assert isinstance(first, TablewareDetections) and first.outcome == second.outcome == "ok"
    for name in ("detections.json", "overlay.png"):
        assert (first.root / name).read_bytes() == (second.root / name).read_bytes()
    told = first.info
    assert [item.kind for item in told.items] == ["bowl", "cup", "spoon", None]
    assert told.items[1].on == 0 and told.heights_known and not told.rectified
    found = from_file(told)
    assert found[2].yaw == pytest.approx(0.6, abs=0.03)
    assert [item.kind for item in as_table(found).items] == ["bowl", "cup", "spoon"]
    assert first.summary["items"] == 3 and first.summary["unknown"] == 1
    assert first.summary["statement"] == told.statement


def test_a_16_bit_image_is_millimetres_and_a_wrong_scale_is_refused(scene: Path, images, tmp_path: Path) -> None:
    millimetres = tmp_path / "depth.png"
    cv2.imwrite(str(millimetres), np.rint(1000.0 * images[1]).astype(np.uint16))
    made = detect(tmp_path / "a", scene / "color.png", millimetres, scene / "scene.json")
    assert [item.kind for item in made.info.items] == ["bowl", "cup", "spoon", None]
    with pytest.raises(BadInput, match="in metres"):
        detect(tmp_path / "b", scene / "color.png", millimetres, scene / "scene.json", depth_scale=1.0)


def test_an_empty_table_is_an_outcome(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "color.png"), np.full((720, 1280, 3), 220, np.uint8))
    np.save(tmp_path / "depth.npy", np.full((720, 1280), 0.83, np.float32))
    (tmp_path / "camera.json").write_text(json.dumps({"camera": VIEW.camera.model_dump()}))
    made = detect(tmp_path / "a", tmp_path, overhead=True)
    assert made.outcome == "nothing_found" and "empty" in made.info.statement


def test_a_photograph_has_outlines_without_heights(tmp_path: Path) -> None:
    picture = np.full((480, 640, 3), 90, np.uint8)
    cv2.ellipse(picture, (300, 240), (90, 60), 0, 0, 360, (230, 230, 230), -1)
    cv2.imwrite(str(tmp_path / "photo.png"), picture)
    made = detect(tmp_path / "a", tmp_path / "photo.png", photograph=True, picture_width=0.78)
    told = made.info
    assert made.outcome == "no_depth" and not told.heights_known and told.items == ()
    (outline,) = told.outlines
    assert outline.box == pytest.approx((210, 180, 390, 300), abs=4)
    assert outline.kind == "plate" and "heights unknown" in outline.unsure
    with pytest.raises(BadInput, match="heights are unknown"):
        from_file(told)
    assert find_outlines(np.full((480, 640, 3), 90, np.uint8)) == ()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"picture_width": 1.0}, "--picture-width"),
        ({"photograph": True, "sizes": "estimated"}, "--sizes"),
        ({"photograph": True, "overhead": True}, "colour alone"),
    ],
)
def test_options_that_contradict_are_refused(options: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        check_inputs(DetectParameters(**options), {})


def test_the_declaration_is_complete() -> None:
    assert DETECT.name == "tableware detect" and DETECT.folder == "tableware" and DETECT.required() == ("image",)
    assert all(field.description for field in DetectParameters.model_fields.values())


def test_files_that_cannot_be_read_are_refused(scene: Path, tmp_path: Path) -> None:
    (tmp_path / "text.png").write_text("no picture")
    (tmp_path / "empty").mkdir()
    np.save(tmp_path / "three.npy", np.zeros((2, 3, 4)))
    (tmp_path / "short.npz").write_bytes(b"PK")
    color = scene / "color.png"
    for image, depth, said in (
        (tmp_path / "none.png", None, "no such file"),
        (tmp_path / "text.png", None, "no image"),
        (tmp_path / "empty", None, "no colour image"),
        (color, color, "not 16 bits"),
        (color, tmp_path / "three.npy", "the depth is"),
        (color, tmp_path / "short.npz", "not a zip file"),
    ):
        with pytest.raises(BadInput, match=said) as refusal:
            read_image(image, depth)
        assert refusal.value.hint
    with pytest.raises(BadInput, match=r"no camera\.json"):
        detect(tmp_path / "a", color, scene / "depth.npz")


JUNK = st.none() | st.booleans() | st.floats() | st.text(max_size=4) | st.lists(st.integers(), max_size=3)


@settings(max_examples=25, deadline=None)
@given(told=JUNK | st.dictionaries(st.sampled_from(["camera", "world_from_camera", "fx"]), JUNK, max_size=3))
def test_any_camera_file_is_read_or_refused(told: Any, tmp_path_factory) -> None:
    path = tmp_path_factory.getbasetemp() / "camera.json"
    path.write_text(json.dumps(told))
    with pytest.raises(BadInput):
        read_camera(path)


def test_detections_that_cannot_be_are_refused() -> None:
    cup = TablewareDetection(kind="cup", position=(0.0, 0.0, 0.0), lip=0.08, on=1, confidence=1.0)
    with pytest.raises(ValidationError, match="before it"):
        TablewareDetectionsFile(statement="", items=(cup, cup.model_copy(update={"on": None})))
    thing = TablewareDetection(kind=None, position=(0.0, 0.0, 0.0), lip=0.08, confidence=0.0)
    with pytest.raises(ValidationError, match="unknown"):
        TablewareDetectionsFile(statement="", items=(thing, cup.model_copy(update={"on": 0})))
    with pytest.raises(ValidationError, match="outlines"):
        TablewareDetectionsFile(statement="", items=(thing,), heights_known=False)


def test_the_score_tells_errors_misses_confusions_and_things_in_vain() -> None:
    table = Table(
        (
            make_item("cup_1", "cup", 0.0, 0.0),
            make_item("fork_1", "fork", 0.2, 0.0, 0.5),
            make_item("bowl_1", "bowl", -0.2, 0.0),
        )
    )
    found = (
        Detection("cup", (0.003, 0.004, 0.0), lip=0.08, confidence=0.97),
        Detection("spoon", (0.2, 0.001, 0.0), yaw=0.5, lip=0.003, confidence=0.7, unsure=("fork or spoon",)),
        Detection(None, (0.3, 0.2, 0.0), confidence=0.0),
    )
    matches = compare(table, found)
    assert {(m.kind, m.found) for m in matches} == {
        ("cup", "cup"),
        ("fork", "spoon"),
        ("bowl", None),
        (None, "unknown"),
    }
    values = measures(matches)
    assert values["cup"]["center_mm"] == pytest.approx(5.0)
    assert values["cup"]["precision"] == values["cup"]["recall"] == 1.0
    assert values["fork"]["recall"] == values["spoon"]["precision"] == values["bowl"]["recall"] == 0.0
    assert values["all"]["precision"] == 0.5 and values["all"]["recall"] == pytest.approx(1 / 3)
    assert values["unknown"]["found"] == 1.0


def test_the_calibration_error_is_the_mean_distance_of_bins() -> None:
    right = [Match(kind="cup", found="cup", confidence=0.97) for _ in range(3)]
    wrong = [Match(kind="cup", found="bowl", confidence=0.97), Match(kind=None, found="fork", confidence=0.6)]
    bins, error = reliability([*right, *wrong, Match(kind="cup", found=None), Match(kind=None, found="unknown")])
    assert [(count, share) for _, _, count, _, share in bins] == [(1, 0.0), (4, 0.75)]
    assert error == pytest.approx((0.6 * 1 + 0.22 * 4) / 5)


def test_shares_of_real_frames_have_intervals_over_scenes() -> None:
    scenes = grouped("frames_left_out", {"000000": {"cup/true": 2, "cup/right": 1}, "000008": {"bowl/true": 3}})
    assert sum(counts["dish/true"] for counts in scenes) == 5
    said = ratio([Counter(right=1, true=2), Counter(right=3, true=3)], "right", "true")
    assert said is not None and (said.low, said.value, said.high) == (0.5, 0.8, 1.0)
    assert ratio([Counter(right=1)], "right", "true") is None


def test_boxes_are_matched_by_overlap() -> None:
    assert overlap((0, 0, 2, 2), (1, 0, 3, 2)) == pytest.approx(1 / 3)
    assert matched(np.array([[0.9, 0.6], [0.8, 0.1]]), 0.5) == [(0, 1), (1, 0)]
    assert matched(np.zeros((0, 2)), 0.5) == []


def test_the_error_model_is_measured_and_whole() -> None:
    model = error_model()
    assert set(model.kinds) == set(STANDARD.kinds)
    for kind, errors in model.kinds.items():
        assert errors.items >= 30 and 0.0 < errors.position_sigma < 0.003, kind
        assert errors.miss_rate + sum(errors.confused_as.values()) < 0.1
        assert (errors.yaw_sigma > 0.0) == (kind in ("fork", "spoon"))
    assert model.seeds == "tuning" and model.commit and model.images >= 90


def test_sampled_detections_err_as_the_model_says() -> None:
    errors = KindErrors(
        items=1,
        position_sigma=0.002,
        miss_rate=0.2,
        confused_as={"spoon": 0.1},
        false_rate=0.0,
        yaw_sigma=0.01,
        turned_rate=0.0,
    )
    model = ErrorModel(
        date="",
        commit="",
        command="",
        seeds="",
        images=1,
        conditions="",
        unknown_rate=0.0,
        kinds=dict.fromkeys(STANDARD.kinds, errors),
    )
    table = Table((make_item("bowl_1", "bowl", 0.0, 0.0), make_item("fork_1", "fork", 0.0, 0.0, 1.0, 0.07, "bowl_1")))
    random = np.random.default_rng(0)
    draws = [sampled_detections(table, random, model) for _ in range(3000)]
    both = [one for one in draws if len(one) == 2]
    assert len(both) / 3000 == pytest.approx(0.64, abs=0.03)
    assert all(one[1].on == 0 for one in both)
    assert all(one[0].on is None for one in draws if one)
    assert np.std([one[0].position[0] for one in both]) == pytest.approx(0.002, rel=0.1)
    assert np.mean([one[1].kind == "spoon" for one in both]) == pytest.approx(0.1, abs=0.03)
    nothing_wrong = ErrorModel(
        date="",
        commit="",
        command="",
        seeds="",
        images=1,
        conditions="",
        unknown_rate=0.0,
        kinds=dict.fromkeys(STANDARD.kinds, KindErrors(items=1, position_sigma=0.0, miss_rate=0.0, false_rate=0.0)),
    )
    assert as_table(sampled_detections(table, random, nothing_wrong)).items[1].position == table.items[1].position
