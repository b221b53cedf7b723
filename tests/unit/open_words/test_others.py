"""Encoders of other people: a service that the test runs, tiny CLIP and SigLIP folders that the test makes."""

from __future__ import annotations

import base64
import io
import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.stages.kit.open_words.opening import open_encoder
from scenewright.stages.kit.open_words.options import EncoderParameters
from scenewright.stages.kit.open_words.service_encoder import ServiceEncoder
from scenewright.stages.kit.open_words.transformers_encoder import TransformersEncoder

from tests.unit.open_words.stand_ins import ColorEncoder


class Handler(BaseHTTPRequestHandler):
    rows = 0

    def do_GET(self) -> None:
        self._answer({"label": "colours", "width": 3, "side": 8})

    def do_POST(self) -> None:
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        if "texts" in body:
            found = ColorEncoder().texts(body["texts"])
        else:
            pictures = [np.asarray(Image.open(io.BytesIO(base64.b64decode(each)))) for each in body["pictures"]]
            found = ColorEncoder().pictures(np.stack(pictures))
        self._answer({"vectors": found[: len(found) - Handler.rows].tolist()})

    def _answer(self, document: dict[str, object]) -> None:
        data = json.dumps(document).encode()
        self.send_response(200)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def address() -> Iterator[str]:
    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    thread.join()
    server.server_close()


def test_a_service_is_an_encoder(address: str) -> None:
    encoder = open_encoder(EncoderParameters(encoder="service", encoder_address=address), None)
    assert (encoder.label, encoder.width, encoder.side) == ("service colours", 3, 8)
    crops = np.random.default_rng(0).integers(0, 256, (70, 8, 8, 3)).astype(np.uint8)
    np.testing.assert_allclose(encoder.pictures(crops), ColorEncoder().pictures(crops), atol=1e-5)
    np.testing.assert_allclose(encoder.texts(("red", "blue")), ColorEncoder().texts(("red", "blue")), atol=1e-6)
    assert encoder.unread("quark") == ()


def test_a_service_that_answers_too_little_is_refused(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Handler, "rows", 1)
    with pytest.raises(BadInput, match="asked for 2 of 3"):
        ServiceEncoder(address).texts(("red", "blue"))


def test_a_model_has_to_be_given() -> None:
    with pytest.raises(MissingDependency, match="needs a model"):
        open_encoder(EncoderParameters(encoder="huggingface"), None)


def test_another_kind_of_model_is_refused(tmp_path: Path) -> None:
    (tmp_path / "config.json").write_text('{"model_type": "bert"}')
    with pytest.raises(BadInput, match="a model of type 'bert'"):
        TransformersEncoder(tmp_path)


def tokenizer(folder: Path) -> None:
    from tokenizers import Tokenizer, models, pre_tokenizers
    from transformers import PreTrainedTokenizerFast

    words = {word: k for k, word in enumerate(("[PAD]", "[UNK]", "red", "mug", "object", "things"))}
    plain = Tokenizer(models.WordLevel(words, unk_token="[UNK]"))
    plain.pre_tokenizer = pre_tokenizers.Whitespace()
    PreTrainedTokenizerFast(
        tokenizer_object=plain, pad_token="[PAD]", unk_token="[UNK]", eos_token="[UNK]"
    ).save_pretrained(folder)


def clip(folder: Path) -> Path:
    from transformers import CLIPConfig, CLIPModel
    from transformers.models.clip.image_processing_pil_clip import CLIPImageProcessorPil

    small = {"hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 1, "num_attention_heads": 2}
    config = CLIPConfig(
        text_config={**small, "vocab_size": 6, "max_position_embeddings": 16, "eos_token_id": 1, "projection_dim": 12},
        vision_config={**small, "image_size": 32, "patch_size": 8, "projection_dim": 12},
        projection_dim=12,
    )
    CLIPModel(config).save_pretrained(folder)
    CLIPImageProcessorPil(size={"shortest_edge": 32}, crop_size={"height": 32, "width": 32}).save_pretrained(folder)
    tokenizer(folder)
    return folder


def siglip(folder: Path) -> Path:
    from transformers import SiglipConfig, SiglipModel
    from transformers.models.siglip.image_processing_pil_siglip import SiglipImageProcessorPil

    small = {"hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 1, "num_attention_heads": 2}
    config = SiglipConfig(
        text_config={**small, "vocab_size": 6, "max_position_embeddings": 64},
        vision_config={**small, "image_size": 32, "patch_size": 8},
    )
    SiglipModel(config).save_pretrained(folder)
    SiglipImageProcessorPil(size={"height": 32, "width": 32}).save_pretrained(folder)
    tokenizer(folder)
    return folder


@pytest.mark.parametrize(("make", "width"), [(clip, 12), (siglip, 16)])
def test_a_folder_of_transformers_is_an_encoder(make, width: int, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    pytest.importorskip("transformers")
    folder = make(tmp_path / "tiny")
    encoder = open_encoder(EncoderParameters(encoder="huggingface"), folder)
    crops = np.random.default_rng(0).integers(0, 256, (3, encoder.side, encoder.side, 3)).astype(np.uint8)
    for found in (encoder.pictures(crops), encoder.texts(("red mug", "things", "quark"))):
        assert found.shape == (3, width) == (3, encoder.width)
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-5)
    assert encoder.label == "huggingface tiny" and encoder.side == 32
    again = TransformersEncoder(folder)
    np.testing.assert_array_equal(again.pictures(crops), encoder.pictures(crops))
