"""Detections and their witness, pixel by pixel; which backend `auto` takes."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.engine.known_models import identify, known_models
from scenewright.stages.engine.model_cache import with_usual_models
from scenewright.stages.kit.labels import load_label_set
from scenewright.stages.segment import registry
from scenewright.stages.segment.backends.detector.agreement import SURE, Thing, witnessed
from scenewright.stages.segment.networks.semantic import SemanticSegmenter
from scenewright.stages.segment.parameters import STAGE, SegmentParameters

from tests.real_data import real_data
from tests.unit.segment import tiny_tflite

VOCABULARY = load_vocabulary()
VOC = {"background": 0} | {label.name: label.id or 0 for label in load_label_set("pascal-voc").labels}
FROM_VOC = {
    "bottle": "bottle",
    "chair": "chair",
    "diningtable": "table",
    "person": "person",
    "pottedplant": "plant",
    "sofa": "sofa",
    "tvmonitor": "monitor",
}
KNOWN = {VOC[name]: VOCABULARY.by_name(known) for name, known in FROM_VOC.items()}
THRESHOLD = 0.3


def thing(name: str, score: float, rows: int = 20) -> Thing:
    mask = np.zeros((40, 50), dtype=bool)
    mask[:rows] = True
    return Thing(VOCABULARY.by_name(name), score, mask)


def answer(one: Thing, called: str, share: float = 1.0) -> list[tuple[str, float]]:
    """What stands of a detection when the witness calls `share` of the image's columns `called`."""
    classes = np.zeros(one.mask.shape, dtype=np.uint8)
    classes[:, : round(share * classes.shape[1])] = VOC[called]
    left = witnessed([one], classes, KNOWN, threshold=THRESHOLD, anything=VOCABULARY.by_name("object"))
    return [(item.semantic.name, item.score) for item in left]


def test_what_both_see_stands_from_any_score_on() -> None:
    assert answer(thing("chair", 0.16), "chair") == [("chair", SURE)]
    assert answer(thing("sofa", 0.16), "chair", 0.3) == [("sofa", SURE)], "a part of a sofa looks like a chair"
    assert answer(thing("chair", 0.9), "chair") == [("chair", 0.9)]


def test_what_the_witness_knows_and_does_not_see_loses_its_name_unless_the_detector_is_sure() -> None:
    assert answer(thing("plant", 0.4), "background") == [("object", 0.4)]
    assert answer(thing("plant", 0.4), "pottedplant", 0.29) == [("object", 0.4)]
    assert answer(thing("plant", SURE), "background") == [("plant", SURE)]
    assert answer(thing("plant", 0.2), "background") == []


def test_what_the_witness_does_not_know_stands_unless_it_sees_something_else() -> None:
    assert answer(thing("bed", 0.4), "background") == [("bed", 0.4)]
    assert answer(thing("bed", 0.4), "sofa", 0.5) == [("object", 0.4)]
    assert answer(thing("bed", 0.7), "sofa") == [("bed", 0.7)]
    assert answer(thing("bed", 0.2), "background") == []


def test_the_witness_says_nothing_of_what_is_too_small_for_it() -> None:
    small = thing("cup", 0.4)
    small.mask[:] = False
    small.mask[:3, :12] = True  # 36 of 2,000 pixels
    assert answer(small, "sofa") == [("cup", 0.4)]


def test_the_witness_goes_by_the_labels_of_its_network(monkeypatch: pytest.MonkeyPatch) -> None:
    classes = np.zeros((1, 4, 6), dtype=np.int64)
    classes[0, :, 3:] = VOC["sofa"]
    witness = SemanticSegmenter(tiny_tflite.opened(monkeypatch, {"classes": classes}, classes=21))
    assert {label.class_name for label in witness.labels.values()} == {"", *FROM_VOC.values()}
    image = witness.classify(np.zeros((8, 12, 3), np.uint8))
    assert image.shape == (8, 12) and set(np.unique(image[:, 6:])) == {VOC["sofa"]} and not image[:, :6].any()


def test_a_network_of_instances_is_no_witness(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BadInput, match="gives instances"):
        SemanticSegmenter(tiny_tflite.opened(monkeypatch, tiny_tflite.yolo()))


def test_auto_takes_what_the_cache_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SCENEWRIGHT_MODELS", str(tmp_path))
    monkeypatch.setattr(registry, "find_spec", lambda name: SimpleNamespace())
    automatic, asked = SegmentParameters(), SegmentParameters(backend="geometric")
    assert with_usual_models(STAGE.reads, automatic, {}) == {}
    digest = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"  # of nothing
    for name in ("yolox_nano.onnx", "deeplab_voc.tflite"):
        (tmp_path / f"{digest[:16]}-{name}").touch()
    found = with_usual_models(STAGE.reads, automatic, {})
    assert {role: path.name[17:] for role, path in found.items()} == {
        "weights": "yolox_nano.onnx",
        "semantic_weights": "deeplab_voc.tflite",
    }
    assert with_usual_models(STAGE.reads, asked, {}) == {}
    mine = {"weights": tmp_path / "mine.safetensors"}
    assert with_usual_models(STAGE.reads, automatic, mine) == mine
    monkeypatch.setattr(registry, "find_spec", lambda name: None)
    assert set(with_usual_models(STAGE.reads, automatic, {})) == {"weights"}


def test_auto_goes_by_the_kind_of_weights() -> None:
    assert registry.automatic(None).name == registry.automatic(Path("own.safetensors")).name == "network"
    assert registry.automatic(Path("yolox.onnx")).name == "detector"
    assert registry.automatic(Path("yolo.tflite")).name == "tflite"


def test_auto_takes_permissive_networks_alone() -> None:
    automatic, licences = SegmentParameters(), {model.name: model.licence for model in known_models()}
    taken = {registry.usual_detector(automatic, {}), registry.usual_witness(automatic, {"weights": Path("net.onnx")})}
    assert {licences[name] for name in taken if name} == {"Apache-2.0"}
    assert {name for name, licence in licences.items() if licence.startswith("AGPL")} == {
        "yolov8n_seg_640",
        "yolov8n_seg_320",
    }


@pytest.mark.parametrize("name", ["deeplab_ade20k", "yolov8n_seg_640", "yolov8n_seg_320"])
def test_the_published_segmenters_are_known(name: str) -> None:
    file = next(model.file for model in known_models() if model.name == name)
    assert identify(real_data("segmenters") / file).name == name
