"""A sentence encoder averages the tokens of a BERT: a tiny one with random weights."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.open_words.reading import sentences
from scenewright.stages.kit.open_words.reading.sentences import SentenceEncoder, installed_sentences

WORDS = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]", "red", "mug", "cup"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    transformers = pytest.importorskip("transformers")
    root = tmp_path_factory.mktemp("bert")
    config = transformers.BertConfig(
        vocab_size=len(WORDS), hidden_size=8, num_hidden_layers=1, num_attention_heads=2, intermediate_size=16
    )
    transformers.BertModel(config).save_pretrained(root, safe_serialization=True)
    (root / "vocab.txt").write_text("\n".join(WORDS) + "\n")
    (root / "tokenizer_config.json").write_text('{"tokenizer_class": "BertTokenizer", "do_lower_case": true}')
    return root


def test_vectors_are_unit_and_repeat(folder: Path) -> None:
    encoder = SentenceEncoder(folder)
    first, again, other = encoder.texts(("red mug", "red mug", "cup"))
    np.testing.assert_allclose(np.linalg.norm([first, other], axis=1), 1.0, rtol=1e-5)
    np.testing.assert_array_equal(first, again)
    np.testing.assert_allclose(SentenceEncoder(folder).texts(("cup",))[0], other, atol=1e-6)
    assert abs(float(first @ other)) < 0.9999


def test_another_kind_of_model_is_refused(tmp_path: Path) -> None:
    (tmp_path / "config.json").write_text('{"model_type": "clip"}')
    with pytest.raises(BadInput, match="model of type 'clip'"):
        SentenceEncoder(tmp_path)


def test_an_installation_without_it_has_none(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(sentences, "PACKAGE", "no_such_package_of_sentences")
    assert installed_sentences() is None
    package = tmp_path / "carried" / "model"
    package.mkdir(parents=True)
    (package.parent / "__init__.py").write_text("raise RuntimeError('never imported')")
    (package / "config.json").write_text("{}")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sentences, "PACKAGE", "carried")
    found = installed_sentences()
    assert found == (package if importlib.util.find_spec("transformers") else None)
