"""Checkpoints: what is saved is loaded; every fault is one line; the one that ships is small and sound."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from scenewright.schemas.errors import BadInput
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.safetensors_file import read_safetensors, write_safetensors
from scenewright.stages.segment.backends.network.features import CHANNELS
from scenewright.stages.segment.backends.network.model import PanopticNetwork, Widths
from scenewright.stages.segment.backends.network.weights import BUNDLED, load_checkpoint, save_checkpoint

TINY = Widths(encoder=(4, 4, 4, 6, 6), decoder=(4, 4, 4, 6), blocks=1)
CLASSES = ("floor", "wall", "chair")
VOCABULARY = load_vocabulary()


def tiny_checkpoint(path: Path) -> PanopticNetwork:
    torch.manual_seed(0)
    network = PanopticNetwork(len(CHANNELS), len(CLASSES), TINY).eval()
    save_checkpoint(path, network, CLASSES, TINY, "made for a test")
    return network


def test_the_heads_have_half_of_the_inputs_size() -> None:
    network = PanopticNetwork(len(CHANNELS), 5, TINY).eval()
    for height, width in ((64, 96), (51, 33)):
        with torch.inference_mode():
            logits, heat, offsets = network(torch.zeros(2, len(CHANNELS), height, width))
        half = ((height + 1) // 2, (width + 1) // 2)
        assert logits.shape == (2, 5, *half)
        assert heat.shape == (2, 1, *half) and offsets.shape == (2, 2, *half)


def test_what_is_saved_is_loaded(tmp_path: Path) -> None:
    network = tiny_checkpoint(tmp_path / "a.safetensors")
    loaded = load_checkpoint(tmp_path / "a.safetensors", VOCABULARY)
    assert loaded.classes == CLASSES and loaded.description == "made for a test"
    image = torch.randn(1, len(CHANNELS), 32, 48, generator=torch.Generator().manual_seed(1))
    with torch.inference_mode():
        for found, wanted in zip(loaded.network(image), network(image), strict=True):
            assert torch.allclose(found, wanted, atol=0.02)  # numbers are kept as float16


def changed(metadata: dict[str, str]) -> Callable[[dict, dict], None]:
    return lambda tensors, said: said.update(metadata)


def without_a_tensor(tensors: dict, metadata: dict) -> None:
    del tensors["stem.0.0.weight"]


def with_another_shape(tensors: dict, metadata: dict) -> None:
    tensors["stem.0.0.weight"] = tensors["stem.0.0.weight"][:, :3]


def with_a_strange_tensor(tensors: dict, metadata: dict) -> None:
    tensors["strange"] = np.zeros(2, np.float16)


def with_nan(tensors: dict, metadata: dict) -> None:
    tensors["stem.0.0.weight"][0] = np.nan


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (changed({"format": "pt"}), "no checkpoint of the panoptic network"),
        (changed({"version": "2"}), "version '2'"),
        (changed({"channels": '["red"]'}), "other inputs"),
        (changed({"input_width": "640"}), "other inputs"),
        (changed({"classes": '["floor", "wall", "dragon"]'}), "'dragon' is not in the vocabulary"),
        (changed({"classes": '["floor", "wall"]'}), "shape"),
        (changed({"classes": '["floor", "floor", "wall"]'}), "repeats"),
        (changed({"classes": "floor"}), "list of classes"),
        (changed({"widths": "{}"}), "network of this kind"),
        (changed({"widths": '{"encoder": [1, 2, 3, 4, 99999999], "decoder": [1, 1, 1, 1], "blocks": 2}'}), "this kind"),
        (without_a_tensor, "shape None"),
        (with_another_shape, "'stem.0.0.weight' has shape"),
        (with_a_strange_tensor, "the network needs None"),
        (with_nan, "not finite"),
    ],
)
def test_faults_are_named(tmp_path: Path, change: Callable[[dict, dict], None], what: str) -> None:
    path = tmp_path / "a.safetensors"
    tiny_checkpoint(path)
    tensors, metadata = read_safetensors(path)
    change(tensors, metadata)
    write_safetensors(path, tensors, metadata)
    with pytest.raises(BadInput) as error:
        load_checkpoint(path, VOCABULARY)
    assert what in error.value.message and "a.safetensors" in error.value.message and error.value.hint


def test_a_truncated_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.safetensors"
    tiny_checkpoint(path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(BadInput, match=r"a\.safetensors"):
        load_checkpoint(path, VOCABULARY)


def test_the_checkpoint_that_ships() -> None:
    assert BUNDLED.stat().st_size < 10_000_000
    shipped = load_checkpoint(BUNDLED, VOCABULARY)
    assert {"floor", "wall", "chair", "table", "cup", "object"} <= set(shipped.classes)
    assert "generated rooms" in shipped.description
