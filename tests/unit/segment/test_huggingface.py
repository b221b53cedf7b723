"""Models of transformers: real forward passes of tiny random models, crafted outputs, and what folders can lack."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, MissingDependency, UsageError
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.engine.hub_cache import is_hub_id
from scenewright.stages.engine.model_cache import resolve_weights
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.kit.formats.transformers_folder import short_name
from scenewright.stages.kit.labels import LabelSet, parse_words
from scenewright.stages.segment.backends.huggingface import panoptic
from scenewright.stages.segment.backends.huggingface.backend import HuggingFaceSettings, make_backend
from scenewright.stages.segment.backends.huggingface.open_vocabulary import make_prompts, word_scores
from scenewright.stages.segment.choice import BackendRequest, choose_backend
from scenewright.stages.segment.parameters import SegmentParameters

from tests.unit.segment import tiny_models

pytest.importorskip("transformers")
torch = pytest.importorskip("torch")

VOCABULARY = load_vocabulary()
HEIGHT, WIDTH = 48, 64
IMAGE = np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH, 3)).astype(np.uint8)
PANOPTIC = ("mask2former", "oneformer", "detr")


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    torch.manual_seed(0)
    root = tmp_path_factory.mktemp("models")
    return {name: getattr(tiny_models, name)(root / name) for name in (*PANOPTIC, "grounding_dino", "sam")}


def backend(weights: Path | None, **options: Any) -> Any:
    return make_backend(weights, HuggingFaceSettings(**{"score_threshold": 0.01, **options}), VOCABULARY)


def segmenter_of(made: Any) -> Any:
    """The network within a backend."""
    return next(cell.cell_contents for cell in made._make_frame.__closure__ if hasattr(cell.cell_contents, "_torch"))


def names_of(frame: Any) -> list[str]:
    return [VOCABULARY.by_id(mask.class_id).name for mask in frame.masks.values()]


def test_torchvision_is_absent_or_fits() -> None:
    """A torchvision that was built for another torch breaks every model of transformers."""
    from importlib import metadata

    try:
        metadata.version("torchvision")
    except metadata.PackageNotFoundError:
        return
    import torchvision  # noqa: F401


@pytest.mark.parametrize("name", PANOPTIC)
def test_a_whole_network_runs(folders: dict[str, Path], name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(panoptic, "OVERLAP_SHARE", 0.01)  # the masks of random networks are all over each other
    made = backend(folders[name])
    network = segmenter_of(made)._model
    with torch.no_grad():
        # Random networks are sure of nothing: this one is made to be.
        for head in network.modules():
            if isinstance(head, torch.nn.Linear) and head.out_features == len(tiny_models.NAMES) + 1:
                head.weight *= 20
                head.bias[:] = torch.tensor([3.0, 2.0, 2.0, 3.0, 0.0, -9.0])
    network.register_forward_hook(half_of_every_mask)
    frame = Frame(0, 0.0, IMAGE, None, None, None)
    geometric: Any = SimpleNamespace(labels=np.zeros((HEIGHT, WIDTH), dtype=np.int32))
    found, again = (made(frame, geometric, np.random.default_rng(0)) for _ in range(2))
    assert found.ids.shape == (HEIGHT, WIDTH) and found.ids.dtype == np.int32 and np.array_equal(found.ids, again.ids)
    assert found.masks and set(np.unique(found.ids)) - {0} == set(found.masks)
    assert all(0 < mask.score <= 1 for mask in found.masks.values())
    assert set(names_of(found)) <= {"chair", "table", "wall", "cup"}
    assert made.label == f"huggingface {name}" and made.name == "huggingface"
    blind = Frame(0, 0.0, None, np.ones((HEIGHT, WIDTH), np.float32), None, None)
    empty = made(blind, geometric, np.random.default_rng(0))
    assert not empty.masks and not empty.ids.any()


def half_of_every_mask(network: Any, arguments: Any, outputs: Any) -> None:
    """Random masks may have no pixel at all: these get about half of the image."""
    name = "pred_masks" if hasattr(outputs, "pred_masks") else "masks_queries_logits"
    masks = getattr(outputs, name)
    setattr(outputs, name, 100 * (masks - masks.mean(dim=(-2, -1), keepdim=True)))


def crafted(name: str) -> Any:
    """Outputs of a network that is sure: a chair on the left, two masks of wall on the right, a weak cup, a quark."""
    scores = torch.full((1, 5, 6), -20.0)
    for query, (number, score) in enumerate(((0, 20.0), (2, 20.0), (2, 20.0), (3, -19.9), (4, 20.0))):
        scores[0, query, number] = score
    scores[0, 3, 5] = 5.0  # the cup: nothing there, most likely
    masks = torch.full((1, 5, 24, 32), -20.0)
    masks[0, 0, :, :16] = 20
    masks[0, 1, :12, 16:28] = 20
    masks[0, 2, 12:, 16:28] = 20
    masks[0, 3, :, 16:] = 10
    masks[0, 4, :, 28:] = 20
    if name == "detr":
        return SimpleNamespace(logits=scores, pred_masks=masks)
    return SimpleNamespace(class_queries_logits=scores, masks_queries_logits=masks)


@pytest.mark.parametrize("name", PANOPTIC)
def test_outputs_become_masks(folders: dict[str, Path], name: str) -> None:
    made = backend(folders[name], score_threshold=0.3)
    segmenter_of(made)._model = lambda **inputs: crafted(name)
    found = made._make_frame(IMAGE)
    assert sorted(names_of(found)) == ["chair", "wall"]
    chair, wall = (
        next(k for k, n in zip(found.masks, names_of(found), strict=True) if n == c) for c in ("chair", "wall")
    )
    expected = np.zeros((HEIGHT, WIDTH), dtype=int)
    expected[:, :32], expected[:, 32:56] = chair, wall  # one wall of two; the quark is void
    assert (found.ids == expected).mean() > 0.97  # but for the borders that the scaling moves
    assert not found.masks[wall].is_thing and found.masks[chair].score > 0.99


def test_own_labels_go_first(folders: dict[str, Path]) -> None:
    labels = LabelSet("mine", parse_words(["chair = box", "quark = fridge"], "mine"))
    made = backend(folders["mask2former"], labels=labels, score_threshold=0.3)
    segmenter_of(made)._model = lambda **inputs: crafted("mask2former")
    assert sorted(names_of(made._make_frame(IMAGE))) == ["box", "fridge", "wall"]  # the wall keeps its name


def test_words_become_masks(folders: dict[str, Path]) -> None:
    made = backend(
        folders["grounding_dino"], mask_weights=folders["sam"], words="cup, blue table, tables = desk", minimum_pixels=1
    )
    assert made.label == "huggingface grounding_dino + sam"
    first, second = made._make_frame(IMAGE), made._make_frame(IMAGE)
    assert first.ids.shape == (HEIGHT, WIDTH) and np.array_equal(first.ids, second.ids)
    assert set(names_of(first)) <= {"cup", "object", "desk"}  # "blue table" is in no table
    # Crafted boxes: a cup on the left, the same again with a worse score, and something under the threshold.
    network = segmenter_of(made)
    logits = torch.full((1, 8, 32), -9.0)
    logits[0, 0, 1], logits[0, 1, 1], logits[0, 2, 4] = 3.0, 2.0, -7.0
    boxes = torch.full((1, 8, 4), 0.5)
    boxes[0, :2] = torch.tensor([0.25, 0.5, 0.5, 1.0])
    network._detector = lambda **inputs: SimpleNamespace(logits=logits, pred_boxes=boxes)
    found = network._boxes(IMAGE)
    assert found.boxes.round(3).tolist() == [[0, 0, 32, 48]] and found.words.tolist() == [0]
    assert found.scores[0] == pytest.approx(1 / (1 + np.exp(-3.0)))
    masks = network._masks(IMAGE, np.array([[0, 0, 32, 48], [10, 10, 20, 20.0]]))
    assert masks.shape == (2, HEIGHT, WIDTH) and masks.dtype == bool
    assert network._masks(IMAGE, np.zeros((0, 4))).shape == (0, HEIGHT, WIDTH)


def test_prompts_hold_every_word_once() -> None:
    prompts = make_prompts(["Cup", "blue mug", "no. 5"], [1, 2, 3])
    assert [p.text for p in prompts] == ["cup. blue mug. no  5."] and prompts[0].spans == ((0, 3), (5, 13), (15, 20))
    many = make_prompts([f"w{k}" for k in range(150)], [2] * 150)
    assert len(many) == 3 and sorted(i for p in many for i in p.words) == list(range(150))
    for prompt in many:
        assert all(prompt.text[a:b] == f"w{i}" for i, (a, b) in zip(prompt.words, prompt.spans, strict=True))
    offsets = np.array([[0, 0], [0, 3], [3, 4], [5, 9], [10, 13], [13, 14], [0, 0]])
    tokens = np.array([[0.9, 0.2, 0.9, 0.3, 0.6, 0.9, 0.9]])
    assert word_scores(tokens, offsets, make_prompts(["cup", "blue mug"], [1, 2])[0]).tolist() == [[0.2, 0.6]]


def test_what_folders_can_lack(folders: dict[str, Path], tmp_path: Path) -> None:
    def copy(name: str) -> Path:
        return Path(shutil.copytree(folders["mask2former"], tmp_path / name))

    pickled = copy("pickled")
    (pickled / "model.safetensors").rename(pickled / "pytorch_model.bin")
    torn = copy("torn")
    (torn / "model.safetensors").write_bytes((torn / "model.safetensors").read_bytes()[:5000])
    wrong = copy("wrong")
    config = json.loads((wrong / "config.json").read_text())
    (wrong / "config.json").write_text(json.dumps({**config, "num_queries": 7}))
    other = copy("other")
    (other / "config.json").write_text(json.dumps({**config, "model_type": "bert"}))
    coded = copy("coded")
    (coded / "config.json").write_text(json.dumps({**config, "auto_map": {"AutoModel": "evil.Evil"}}))
    (coded / "evil.py").write_text("raise SystemExit('executed')")
    garbled, blind, nameless = copy("garbled"), copy("blind"), copy("nameless")
    (garbled / "config.json").write_text("{")
    (blind / "preprocessor_config.json").write_text("[]")
    (nameless / "config.json").write_text(json.dumps({**config, "id2label": {str(k): f"LABEL_{k}" for k in range(5)}}))
    for folder, text in (
        (pickled, "no .safetensors"),
        (torn, "cannot be loaded"),
        (wrong, "parameters are missing or of another shape"),
        (other, "type 'bert'"),
        (garbled, "no JSON"),
        (blind, "preprocessor_config"),
        (nameless, "no table"),
        (tmp_path, "file is missing"),
    ):
        with pytest.raises(BadInput, match=text) as caught:
            backend(folder)
        assert "\n" not in str(caught.value)
    assert backend(coded).label == "huggingface coded"  # and its code was not looked at


def test_what_requests_can_lack(folders: dict[str, Path]) -> None:
    with pytest.raises(MissingDependency, match="needs a model"):
        choose_backend(BackendRequest(SegmentParameters(backend="huggingface")))
    with pytest.raises(UsageError, match="open-vocabulary"):
        backend(folders["mask2former"], words="cup")
    with pytest.raises(MissingDependency, match="makes masks"):
        backend(folders["grounding_dino"], words="cup")
    with pytest.raises(BadInput, match="type 'mask2former'"):
        backend(folders["grounding_dino"], mask_weights=folders["mask2former"], words="cup")
    with pytest.raises(UsageError, match="looks for words"):
        backend(folders["grounding_dino"], mask_weights=folders["sam"])


def test_hub_ids_are_sought_in_the_cache_alone(
    folders: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path))
    with pytest.raises(MissingDependency) as caught:
        resolve_weights(Path("some/model@refs/pr/10"))
    assert caught.value.exit_code == 5
    assert caught.value.hint == "fetch it with: hf download some/model --revision refs/pr/10"
    root = tmp_path / "models--some--model"
    shutil.copytree(folders["mask2former"], root / "snapshots" / "0123456789abcdef")
    (root / "refs").mkdir()
    (root / "refs" / "main").write_text("0123456789abcdef\n")
    found = resolve_weights(Path("some/model"))
    assert found == root / "snapshots" / "0123456789abcdef" == resolve_weights(Path("some/model@0123456789abcdef"))
    assert short_name(found) == "some/model@01234567"
    assert (
        not is_hub_id("folder/model.onnx")
        and not is_hub_id("model")
        and not is_hub_id("a/../b")
        and is_hub_id("a/b-c.1")
    )
