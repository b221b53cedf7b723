"""Detections and their witness, pixel by pixel; the witness's file; which backend `auto` takes."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.engine.model_cache import with_usual_models
from scenewright.stages.segment import registry
from scenewright.stages.segment.backends.detector.agreement import SURE, Thing, witnessed
from scenewright.stages.segment.backends.detector.semantic import FROM_VOC, VOC_NAMES, SemanticSegmenter
from scenewright.stages.segment.parameters import STAGE, SegmentParameters

from tests import real_data

VOCABULARY = load_vocabulary()
KNOWN = {n: VOCABULARY.by_name(FROM_VOC[name]) for n, name in enumerate(VOC_NAMES) if name in FROM_VOC}
THRESHOLD = 0.3
REAL = real_data.ROOT / "detectors" / "deeplab_voc_tflite"


def thing(name: str, score: float, rows: int = 20) -> Thing:
    mask = np.zeros((40, 50), dtype=bool)
    mask[:rows] = True
    return Thing(VOCABULARY.by_name(name), score, mask)


def answer(one: Thing, called: str, share: float = 1.0) -> list[tuple[str, float]]:
    """What stands of a detection when the witness calls `share` of the image's columns `called`."""
    classes = np.zeros(one.mask.shape, dtype=np.uint8)
    classes[:, : round(share * classes.shape[1])] = VOC_NAMES.index(called)
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


class Interpreter:
    """The runtime's interface with given tensors."""

    def __init__(self, given: tuple[Any, ...], result: np.ndarray) -> None:
        self.details = [{"index": 0, "shape": given[0], "dtype": given[1]}]
        self.result = result

    def allocate_tensors(self) -> None: ...
    def invoke(self) -> None: ...

    def get_input_details(self) -> list[dict[str, Any]]:
        return self.details

    def get_output_details(self) -> list[dict[str, Any]]:
        return [{"index": 1, "shape": self.result.shape, "dtype": self.result.dtype}]

    def set_tensor(self, index: int, tensor: np.ndarray) -> None:
        assert tensor.shape == self.details[0]["shape"] and tensor.dtype == np.uint8

    def get_tensor(self, index: int) -> np.ndarray:
        return self.result


def with_runtime(monkeypatch: pytest.MonkeyPatch, interpreter: Interpreter) -> None:
    module = ModuleType("ai_edge_litert.interpreter")
    vars(module)["Interpreter"] = lambda path, num_threads: interpreter
    monkeypatch.setitem(sys.modules, "ai_edge_litert", ModuleType("ai_edge_litert"))
    monkeypatch.setitem(sys.modules, "ai_edge_litert.interpreter", module)


def test_a_class_image_comes_back_at_the_size_of_the_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    classes = np.zeros((1, 4, 6), dtype=np.int64)
    classes[0, :, 3:] = VOC_NAMES.index("sofa")
    with_runtime(monkeypatch, Interpreter(((1, 4, 6, 3), np.uint8), classes))
    image = SemanticSegmenter(Path("net.tflite")).classify(np.zeros((8, 12, 3), np.uint8))
    assert (
        image.shape == (8, 12) and set(np.unique(image[:, 6:])) == {VOC_NAMES.index("sofa")} and not image[:, :6].any()
    )


@pytest.mark.parametrize(
    ("given", "result"),
    [
        (((1, 4, 6, 3), np.float32), np.zeros((1, 4, 6), np.int64)),
        (((1, 3, 4, 6), np.uint8), np.zeros((1, 4, 6), np.int64)),
        (((1, 4, 6, 3), np.uint8), np.zeros((1, 1000), np.int64)),
        (((1, 4, 6, 3), np.uint8), np.zeros((1, 4, 6), np.float32)),
    ],
)
def test_a_network_of_another_kind_is_refused(
    monkeypatch: pytest.MonkeyPatch, given: tuple[Any, ...], result: np.ndarray
) -> None:
    with_runtime(monkeypatch, Interpreter(given, result))
    with pytest.raises(BadInput, match="does not take pictures"):
        SemanticSegmenter(Path("net.tflite"))


def test_classes_beyond_those_of_voc_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with_runtime(monkeypatch, Interpreter(((1, 4, 6, 3), np.uint8), np.full((1, 4, 6), 21, np.int64)))
    with pytest.raises(BadInput, match="beyond"):
        SemanticSegmenter(Path("net.tflite")).classify(np.zeros((8, 12, 3), np.uint8))


def test_without_the_runtime_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("ai_edge_litert", "ai_edge_litert.interpreter"):  # another test may have imported it
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingDependency, match="ai-edge-litert"):
        SemanticSegmenter(Path("net.tflite"))


def test_a_file_that_is_no_network_is_refused_and_the_published_one_is_read(tmp_path: Path) -> None:
    pytest.importorskip("ai_edge_litert", reason="an extra")
    (tmp_path / "net.tflite").write_bytes(b"TFL3" * 100)
    with pytest.raises(BadInput, match=r"net\.tflite"):
        SemanticSegmenter(tmp_path / "net.tflite")
    if not REAL.is_dir():
        pytest.skip("the published network is not here")
    network = SemanticSegmenter(REAL / "deeplabv3_mnv2_pascal_quant.tflite")
    assert network.classify(np.full((48, 64, 3), 128, np.uint8)).shape == (48, 64)


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
