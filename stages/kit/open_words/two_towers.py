"""The embedded encoder's network: a small convolutional tower for crops, a small transformer for words.

Words are sums of their parts (all runs of 3 to 5 letters, hashed; Bojanowski et al. 2017), so that a word that was
never read still stands near those it is made of. Training: `scenewright train words`; a picture's and a text's vectors
give the probability that they belong together, sigmoid(scale * cosine + bias) (SigLIP, Zhai et al. 2023).
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Sequence

import torch
from torch import nn

WIDTH = 64
"""Numbers of a vector of either tower."""
SIDE = 48
"""Crops are looked at in this size [px]."""
MOST_WORDS = 8
"""Words of a text that are read."""
MOST_PARTS = 24
"""Parts of a word that are read: itself and its runs of letters."""
BUCKETS = 4096
"""Buckets into which parts of words are hashed."""
PART_LENGTHS = (3, 4, 5)
"""Lengths of the runs of letters of a word; by eye."""
_WORD = re.compile(r"[a-z0-9]+")


def words_of(text: str) -> list[str]:
    """Return the words of a text, in small letters."""
    return _WORD.findall(text.lower())


def parts_of(word: str) -> list[int]:
    """Return the buckets, 1 to BUCKETS, of a word and of its runs of letters."""
    marked = f"<{word}>"
    runs = [marked] + [marked[k : k + n] for n in PART_LENGTHS for k in range(len(marked) - n + 1)]
    return [1 + zlib.crc32(run.encode()) % BUCKETS for run in dict.fromkeys(runs)][:MOST_PARTS]


def tokens(texts: Sequence[str]) -> torch.Tensor:
    """Return (M, MOST_WORDS, MOST_PARTS) int64: buckets of the first words of each text, 0 where there is nothing."""
    table = torch.zeros((len(texts), MOST_WORDS, MOST_PARTS), dtype=torch.int64)
    for row, text in enumerate(texts):
        for position, word in enumerate(words_of(text)[:MOST_WORDS]):
            pieces_of_word = parts_of(word)
            table[row, position, : len(pieces_of_word)] = torch.tensor(pieces_of_word)
    return table


class _Residual(nn.Module):
    """Two convolutions beside a shortcut."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(channels, channels, 3, padding=1, bias=False)
        self.second = nn.Conv2d(channels, channels, 3, padding=1, bias=False)
        self.norms = nn.ModuleList([nn.BatchNorm2d(channels), nn.BatchNorm2d(channels)])

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return the same shape."""
        inner = torch.relu(self.norms[0](self.first(x)))
        return torch.relu(x + self.norms[1](self.second(inner)))


def _halving(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride=2, padding=1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU()
    )


class PictureTower(nn.Module):
    """Crops (N, 3, SIDE, SIDE), 0 to 1 -> (N, WIDTH) unit vectors."""

    def __init__(self) -> None:
        super().__init__()
        self.body = nn.Sequential(
            *(_halving(3, 32), _Residual(32)),
            *(_halving(32, 64), _Residual(64)),
            *(_halving(64, 128), _Residual(128)),
            *(_halving(128, 192), _Residual(192)),
        )
        self.head = nn.Sequential(nn.Linear(192 * (SIDE // 16) ** 2, 192), nn.ReLU(), nn.Linear(192, WIDTH))

    def forward(self, crops: torch.Tensor) -> torch.Tensor:
        """Return unit vectors."""
        features = self.head(self.body(4.0 * (crops - 0.5)).flatten(1))
        return nn.functional.normalize(features, dim=1)


class WordTower(nn.Module):
    """Tokens (M, MOST_WORDS, MOST_PARTS) -> (M, WIDTH) unit vectors."""

    def __init__(self) -> None:
        super().__init__()
        self.parts = nn.EmbeddingBag(BUCKETS + 1, WIDTH, mode="mean", padding_idx=0)
        self.places = nn.Parameter(0.1 * torch.randn(MOST_WORDS, WIDTH))
        self.layers = nn.ModuleList(
            nn.TransformerEncoderLayer(WIDTH, 4, 128, dropout=0.0, batch_first=True) for _ in range(2)
        )
        self.out = nn.Linear(WIDTH, WIDTH)

    def forward(self, table: torch.Tensor) -> torch.Tensor:
        """Return unit vectors; texts without words are all alike."""
        count = len(table)
        missing = (table == 0).all(dim=2)
        missing[:, 0] = False
        x = self.parts(table.reshape(-1, MOST_PARTS)).reshape(count, MOST_WORDS, WIDTH)
        x = 4.0 * x + self.places
        for layer in self.layers:
            x = layer(x, src_key_padding_mask=missing)
        has_word = (~missing).unsqueeze(2).to(x.dtype)
        return nn.functional.normalize(self.out((x * has_word).sum(1) / has_word.sum(1)), dim=1)


class TwoTowers(nn.Module):
    """Both towers, with the scale and bias that make a cosine a probability."""

    def __init__(self) -> None:
        super().__init__()
        self.picture, self.word = PictureTower(), WordTower()
        self.log_scale = nn.Parameter(torch.tensor(2.3))
        self.bias = nn.Parameter(torch.tensor(-3.0))

    def logits(self, crops: torch.Tensor, table: torch.Tensor) -> torch.Tensor:
        """Return (N, M) log odds that crop and text belong together."""
        return self.log_scale.exp() * self.picture(crops) @ self.word(table).T + self.bias
