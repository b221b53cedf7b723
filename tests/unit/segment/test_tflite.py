"""TensorFlow Lite networks: what goes in, what comes out, and the masks of that."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, MissingDependency, UsageError
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.segment.choice import BackendRequest, choose_backend
from scenewright.stages.segment.networks.fitting import fit
from scenewright.stages.segment.networks.semantic import SemanticSegmenter, fill, open_segmenter, pixel_classes
from scenewright.stages.segment.networks.sidecar import Sidecar, channels_axis
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask
from scenewright.stages.segment.parameters import SegmentParameters

from tests.real_data import real_data
from tests.unit.segment.tiny_tflite import Interpreter, opened, quantised, run_by, written, yolo

VOCABULARY = load_vocabulary()
SQUARE = (1, 64, 64, 3)


def judged(weights: Path | None, *, backend: str = "tflite", **inputs: Any) -> tuple[Any, PanopticFrame]:
    options, color = inputs.pop("options", {}), inputs.pop("color", np.zeros((64, 64, 3), np.uint8))
    made: Any = choose_backend(BackendRequest(SegmentParameters(backend=backend, **options), weights, **inputs))
    geometric: Any = SimpleNamespace(labels=np.zeros(color.shape[:2], dtype=np.int32))
    return made, made(Frame(0, 0.0, color, None, None, None), geometric, np.random.default_rng(0))


def names_of(frame: PanopticFrame) -> list[str]:
    return sorted(VOCABULARY.by_id(mask.class_id).name for mask in frame.masks.values())


def pixels_of(frame: PanopticFrame, name: str) -> np.ndarray:
    return np.isin(frame.ids, [k for k, mask in frame.masks.items() if VOCABULARY.by_id(mask.class_id).name == name])


@pytest.mark.parametrize(("inside", "shares"), [("floats", True), ("floats", False), ("int8", True)])
@pytest.mark.parametrize("last", [True, False])
def test_yolo_in_every_writing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shares: bool, last: bool, inside: str
) -> None:
    outputs, scales = yolo(shares=shares, last=last), {}
    shape = SQUARE if last else (1, 3, 64, 64)
    kind, quantization = (np.float32, (0.0, 0)) if inside == "floats" else (np.int8, (1 / 255, -128))
    if inside == "int8":
        scales = {"rows": (8 / 127, 0), "prototypes": (0.01, 0)}
        outputs = {name: quantised(array, *scales[name]) for name, array in outputs.items()}
    run_by(monkeypatch, Interpreter(outputs, shape=shape, kind=kind, quantization=quantization, scales=scales))
    made, frame = judged(written(tmp_path / "net.tflite"))
    assert made.label == "tflite net (yolo-seg, coco-80)" and made.name == "tflite"
    assert names_of(frame) == ["chair", "cup"]
    expected = np.zeros((2, 64, 64), dtype=bool)
    expected[0, :, :32], expected[1, 16:, 32:] = True, True
    for name, true in zip(("cup", "chair"), expected, strict=True):
        found = pixels_of(frame, name)
        assert (found & true).sum() / (found | true).sum() > 0.9, name
    assert sorted(mask.score for mask in frame.masks.values()) == pytest.approx([0.5, 0.75], abs=0.05)


def test_of_equal_scores_the_first_goes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    outputs = yolo()
    outputs["rows"][0, 4:84, :3] = 0
    outputs["rows"][0, [4 + 41, 4 + 56], :3] = 0.5  # every box is as much a cup as a chair, and as sure
    outputs["rows"][0, :4, 1] = outputs["rows"][0, :4, 0]
    run_by(monkeypatch, Interpreter(outputs, shape=SQUARE))
    frames = [judged(written(tmp_path / "net.tflite"))[1] for _ in range(2)]
    assert names_of(frames[0]) == ["cup", "cup"] and np.array_equal(frames[0].ids, frames[1].ids)


@pytest.mark.parametrize(
    ("kind", "quantization", "expected"),
    [
        (np.uint8, (1 / 128, 128), 200),
        (np.int8, (1 / 255, -128), 72),
        (np.uint8, (0.0, 0), 200),
        (np.float32, (0.0, 0), 200 / 127.5 - 1),
    ],
)
def test_what_goes_in(
    monkeypatch: pytest.MonkeyPatch, kind: Any, quantization: tuple[float, int], expected: float
) -> None:
    classes = np.zeros((1, 48, 64), np.int32)
    network = opened(monkeypatch, {"a": classes}, kind=kind, quantization=quantization, classes=32)
    tensor = network.fit(np.full((24, 32, 3), 200, np.uint8)).tensor
    assert tensor.shape == (1, 3, 48, 64) and tensor.dtype == kind and np.allclose(tensor, expected, atol=1e-5)


def test_a_sidecar_says_what_whole_numbers_stand_for(monkeypatch: pytest.MonkeyPatch) -> None:
    sidecar = Sidecar(layout="semantic", outputs={"classes": "a"}, scale=1 / 255, mean=(0.5, 0.5, 0.5))
    options = {"kind": np.int8, "quantization": (0.01, 3)}
    network = opened(monkeypatch, {"a": np.zeros((1, 48, 64), np.int32)}, sidecar, **options)
    assert np.unique(network.fit(np.full((8, 8, 3), 255, np.uint8)).tensor).tolist() == [53]


@pytest.mark.parametrize(("classes", "chair"), [(21, 9), (32, 20), (151, 20), (150, 19)])
def test_the_number_of_scores_or_of_hidden_scores_names_the_labels(
    monkeypatch: pytest.MonkeyPatch, classes: int, chair: int
) -> None:
    numbers = np.zeros((1, 48, 64), np.int64)
    numbers[0, :, 32:] = chair
    scores = np.eye(classes, dtype=np.float32)[numbers]
    for output, hidden in ((numbers, classes), (scores, 0), (scores.transpose(0, 3, 1, 2).copy(), 0)):
        segmenter = SemanticSegmenter(opened(monkeypatch, {"a": output}, classes=hidden))
        frame = segmenter.masks(np.zeros((48, 64, 3), np.uint8), VOCABULARY, minimum_pixels=1)
        assert np.array_equal(pixels_of(frame, "chair"), numbers[0] == chair), output.shape


def test_numbers_that_nothing_names_are_refused_and_the_advice_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    numbers = np.zeros((1, 48, 64), np.int64)
    numbers[0, :, 32:] = 1
    run_by(monkeypatch, Interpreter({"a": numbers}))
    weights = written(tmp_path / "net.tflite")
    with pytest.raises(BadInput, match="nothing says what its classes are") as caught:
        judged(weights)
    sidecar = tmp_path / "net.toml"
    advised = (caught.value.hint or "").split(" with ")[1].replace(", ...", ', "wall"')
    sidecar.write_text(advised.replace(", labels", "\nlabels").replace(", outputs", "\noutputs"))
    assert names_of(judged(weights, sidecar=sidecar)[1]) == ["chair", "wall"]
    sidecar.write_text(sidecar.read_text().replace(', "wall"', ""))
    with pytest.raises(BadInput, match="beyond its 1"):
        judged(weights, sidecar=sidecar)


def test_names_in_the_archive_behind_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = np.zeros((1, 48, 64), np.int64)
    numbers[0, :, 32:] = 2
    run_by(monkeypatch, Interpreter({"a": numbers}))
    for name, text in (
        ("labelmap.txt", "background\nwall\nchair\n"),
        ("metadata.json", '{"names": {"0": "background", "1": "wall", "2": "chair"}}'),
        ("temp_meta.txt", "{'names': {0: 'background', 1: 'wall', 2: 'chair'}, 'imgsz': [64, 64]}"),
    ):
        assert names_of(judged(written(tmp_path / "net.tflite", {name: text}))[1]) == ["chair"]


def test_pixels_of_equal_scores_go_to_the_first_class_and_nothing_finite_is_lost() -> None:
    scores = np.zeros((1, 3, 4, 4), np.float32)
    scores[0, 2, :, 2:], scores[0, 0, 0, 0], scores[0, 1, 1] = 1, np.nan, np.nan
    sidecar = Sidecar(layout="semantic", outputs={}, resize="letterbox")
    fitted = fit(np.zeros((4, 8, 3), np.uint8), sidecar, (8, 8))
    found = pixel_classes(scores, fitted, (4, 8))  # the lower half of the input is padding
    assert found[:2, 4:].all() and (found[2:, 4:] == 2).all() and found[0, 0] == 1 and not found[2:, :4].any()
    assert channels_axis((1, 16, 16, 21), (64, 64), 1) == 3 and channels_axis((1, 21, 16, 16), (64, 64), 3) == 1
    assert channels_axis((1, 16, 16, 16), (64, 64), 3) == 3


def test_semantic_masks_fill_what_no_instance_covers() -> None:
    above = PanopticFrame(np.zeros((4, 6), np.int32), {1: PanopticMask(4, True, 0.9)})
    above.ids[:, :2] = 1
    below = PanopticFrame(np.ones((4, 6), np.int32), {1: PanopticMask(1, False, 0.5)})
    below.masks.update({2: PanopticMask(4, True, 0.5), 3: PanopticMask(4, True, 0.5)})
    below.ids[:, :3], below.ids[0, 4:] = 2, 3  # two thirds of the first are the instance
    filled = fill(above, below)
    assert filled.masks == {1: above.masks[1], 2: below.masks[1], 3: below.masks[3]}
    assert (filled.ids[:, 2] == 0).all() and (filled.ids[0, 4:] == 3).all() and (filled.ids[1:, 3:] == 2).all()


def test_instances_over_a_semantic_network_say_who_saw_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = np.ones((1, 64, 64), np.int64)
    run_by(
        monkeypatch,
        {"net": Interpreter(yolo(), shape=SQUARE), "rooms": Interpreter({"a": numbers}, shape=SQUARE, classes=32)},
    )
    pair = [written(tmp_path / f"{name}.tflite") for name in ("net", "rooms")]
    made, frame = judged(pair[0], semantic_weights=pair[1])
    assert made.label == "tflite net (yolo-seg, coco-80) over rooms (semantic, ade20k-31)" and len(made.networks) == 2
    said = {VOCABULARY.by_id(mask.class_id).name: mask.witnesses[0].network for mask in frame.masks.values()}
    assert said == {"cup": 0, "chair": 0, "wall": 1} and pixels_of(frame, "wall")[:16, 32:].all()
    alone, walls = judged(pair[1])
    assert alone.label == "tflite rooms (semantic, ade20k-31)" and names_of(walls) == ["wall"]
    assert not walls.masks[1].witnesses
    assert names_of(judged(None, semantic_weights=pair[1])[1]) == ["wall"]
    for given, error, text in (
        ({"weights": pair[1], "semantic_weights": pair[1]}, BadInput, "--semantic-weights does so too"),
        ({"weights": pair[0], "semantic_weights": pair[0]}, BadInput, "gives instances"),
        ({"weights": pair[1], "options": {"tiles": 2}}, UsageError, "--tiles"),
    ):
        with pytest.raises(error, match=text):
            judged(**given)


@pytest.mark.parametrize(
    ("outputs", "options", "text"),
    [
        ({"a": np.zeros((1, 84, 8400), np.float32)}, {}, "gives boxes without masks"),
        ({"a": np.zeros((1, 1000), np.float32)}, {}, "of no known layout"),
        ({"a": np.zeros((1, 48, 64), np.float32)}, {"shape": (1, 1000)}, "not one image"),
        ({"a": np.zeros((1, 48, 64), np.float32)}, {"kind": np.int64}, "not one image"),
        ({"a": np.zeros((4, 48, 64), np.int32)}, {"shape": (4, 48, 64, 3)}, "4 images at a time"),
    ],
)
def test_networks_of_another_kind_are_refused(
    monkeypatch: pytest.MonkeyPatch, outputs: dict[str, np.ndarray], options: dict[str, Any], text: str
) -> None:
    with pytest.raises(BadInput, match=text) as caught:
        opened(monkeypatch, outputs, **options)
    assert "\n" not in str(caught.value)


def test_without_the_runtime_a_network_or_the_right_ending(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    weights = written(tmp_path / "net.tflite")
    with pytest.raises(MissingDependency, match="needs a network"):
        judged(None)
    with pytest.raises(BadInput, match=r"takes \.onnx files"):
        judged(weights, backend="onnx")
    with pytest.raises(BadInput, match="no TensorFlow Lite network|no TensorFlow Lite file"):
        pytest.importorskip("ai_edge_litert", reason="an extra")
        judged(weights)
    for module in ("ai_edge_litert", "ai_edge_litert.interpreter"):  # another test may have imported it
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingDependency, match="ai-edge-litert"):
        judged(weights)


@pytest.mark.parametrize("name", ["yolov8n_seg_640_int8", "yolov8n_seg_320_int8"])
def test_the_published_instances_find_the_table_of_the_kitchen(name: str) -> None:
    pytest.importorskip("ai_edge_litert", reason="an extra")
    cv2 = pytest.importorskip("cv2")
    picture = sorted(real_data("7scenes_redkitchen").rglob("*color*"))[0]
    color = cv2.cvtColor(cv2.imread(str(picture)), cv2.COLOR_BGR2RGB)
    made, frame = judged(real_data("segmenters") / f"{name}.tflite", color=color)
    assert "table" in names_of(frame) and pixels_of(frame, "table").mean() > 0.1


def test_the_published_segmenters_say_how_many_classes_they_have() -> None:
    pytest.importorskip("ai_edge_litert", reason="an extra")
    grey = np.full((48, 64, 3), 128, np.uint8)
    rooms = open_segmenter(real_data("segmenters") / "deeplabv3_mnv2_ade20k_uint8.tflite")
    voc = open_segmenter(real_data("detectors") / "deeplab_voc_tflite" / "deeplabv3_mnv2_pascal_quant.tflite")
    assert rooms.labels[1].name == "wall" and rooms.labels[31].name == "armchair" and len(rooms.labels) == 31
    assert voc.labels[20].name == "tvmonitor" and voc.classify(grey).shape == rooms.classify(grey).shape == (48, 64)
