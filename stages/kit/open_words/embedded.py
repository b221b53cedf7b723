"""The encoder that comes with the project: safetensors with its vocabulary; nothing in the file is executed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.places import data_file
from scenewright.stages.kit.formats.network_file import put_tensors, write_network
from scenewright.stages.kit.formats.safetensors_file import read_safetensors
from scenewright.stages.kit.open_words.two_towers import SIDE, WIDTH, TwoTowers, tokens, words_of

FORMAT = "scenewright two towers"
VERSION = "2"
FILE = "words/two_towers.safetensors"
"""File below data/."""
BUNDLED = data_file(FILE)
BATCH = 512
"""Crops that pass the network at a time, which bounds the memory."""
SMALL_WORDS = frozenset(("a", "an", "the", "of"))
_OTHER = "give a file that `make words-train` wrote"


def save_towers(path: Path, network: TwoTowers, vocabulary: Sequence[str], description: str) -> None:
    """Write the network as float16, with the words that it has read."""
    metadata = {
        "format": FORMAT,
        "version": VERSION,
        "vocabulary": json.dumps(sorted(vocabulary)),
        "description": description,
    }
    write_network(path, network, metadata)


class EmbeddedEncoder:
    """Our own small encoder. Raises BadInput for a damaged file or one of another kind."""

    width, side = WIDTH, SIDE

    def __init__(self, path: Path = BUNDLED) -> None:
        tensors, metadata = read_safetensors(path)
        if metadata.get("format") != FORMAT or metadata.get("version") != VERSION:
            raise BadInput(f"{path}: no encoder of pictures and words, version {VERSION}", hint=_OTHER)
        try:
            self.vocabulary = frozenset(map(str, json.loads(metadata.get("vocabulary", ""))))
        except (ValueError, TypeError, RecursionError):
            raise BadInput(f"{path}: its vocabulary is not a list of words", hint=_OTHER) from None
        network = TwoTowers()
        put_tensors(network, tensors, str(path), _OTHER)
        self._network = network.eval()
        self.label = f"embedded {metadata.get('description', '')}".strip()

    def pictures(self, crops: np.ndarray) -> np.ndarray:
        """Return (N, width) float32 unit vectors of crops (N, side, side, 3) uint8 RGB."""
        batches = [np.zeros((0, self.width), np.float32)]
        with torch.inference_mode():
            for start in range(0, len(crops), BATCH):
                part = torch.from_numpy(crops[start : start + BATCH]).permute(0, 3, 1, 2).float() / 255.0
                batches.append(self._network.picture(part).numpy())
        return np.concatenate(batches)

    def texts(self, texts: Sequence[str]) -> np.ndarray:
        """Return (M, width) float32 unit vectors of texts. Raises UsageError for one in other letters than it reads:
        its vector would be that of no word at all."""
        for text in texts:
            if any(map(str.isalnum, text)) and not words_of(text):
                raise UsageError(
                    f"{text!r:.80} has no word that our own encoder reads: English, in the letters a to z",
                    hint="ask in English, or with an encoder of that language (--encoder huggingface, or service)",
                )
        with torch.inference_mode():
            return self._network.word(tokens(texts)).numpy()

    def unread(self, text: str) -> tuple[str, ...]:
        """Return the words of a text that were not in its training."""
        return tuple(word for word in words_of(text) if word not in self.vocabulary | SMALL_WORDS)
