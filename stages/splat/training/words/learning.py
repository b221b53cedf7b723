"""What a step of the embedded encoder's training is, on a processor or a GPU, and what is saved of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from scenewright.stages.kit.open_words.embedded import save_towers
from scenewright.stages.kit.open_words.relevancy import CANONICAL
from scenewright.stages.kit.open_words.two_towers import TwoTowers, tokens, words_of
from scenewright.stages.kit.training.run import TrainingRun, rate_at
from scenewright.stages.splat.training.words.batches import Crops, Drawer, PhrasePool, changed, truth_of_crops
from scenewright.stages.splat.training.words.lexicon import FALSE, TRUE, UNKNOWN, Lexicon, Phrase, lexicon
from scenewright.stages.splat.training.words.samples import Samples
from torch.nn import functional

FILE = "two_towers.safetensors"
WEIGHT_DECAY, WARM_UP, PEAK = 0.02, 0.05, 2e-3
FURTHER_PHRASES = 96
"""Beside one phrase for each crop: of models that need not be in the batch."""
MODELS_SHARE = 0.35
"""Share of a batch that shows library models; the rest is of rooms. By eye."""


@dataclass(frozen=True)
class Plan:
    """What a run is."""

    steps: int
    batch: int
    seed: int
    samples: int
    """Pictures and models that it is trained on."""


class Data:
    """All that is trained on, on a device."""

    def __init__(self, samples: Samples, words: Lexicon, seed: int, device: str) -> None:
        self.drawer = Drawer(samples, len(words.classes), device)
        self.free_places = ~samples.held[self.drawer.places.things]
        self.free_models = np.flatnonzero(~samples.held[samples.sprite_things])
        self.pool = PhrasePool(samples, words, seed, device)
        self.of_thing = torch.from_numpy(self.pool.of_thing).to(device)
        self.canonical = tokens(CANONICAL).to(device)

    def batch(self, plan: Plan, step: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return pictures (N, 3, SIDE, SIDE), tokens of phrases (M, ...), and what is true of which (N, M)."""
        random = np.random.default_rng([plan.seed, 1, step])
        count = round(MODELS_SHARE * plan.batch)
        places = self.drawer.evenly_by_class(self.free_places, random, plan.batch - count)
        models = self.free_models[random.integers(len(self.free_models), size=count)]
        crops = joined(self.drawer.of_rooms(places, random), self.drawer.of_models(models, random))
        further = self.free_models[random.integers(len(self.free_models), size=FURTHER_PHRASES)]
        asked = torch.cat(
            [crops.main[crops.valid], self.drawer.sprite_things[torch.from_numpy(further).to(crops.main.device)]]
        )
        drawn = torch.from_numpy(random.integers(self.of_thing.shape[1], size=len(asked))).to(asked.device)
        phrases = torch.unique(self.of_thing[asked, drawn])
        truth = truth_of_crops(self.drawer.things, crops, self.pool.attributes[phrases])
        return changed(crops.pictures, random), self.pool.tokens[phrases], truth


def joined(first: Crops, second: Crops) -> Crops:
    """Return all of the first and, after them, of the second."""
    parts = ("pictures", "main", "others", "valid")
    return Crops(*(torch.cat([getattr(first, name), getattr(second, name)]) for name in parts))


def loss_of(logits: torch.Tensor, truth: torch.Tensor, count: int) -> torch.Tensor:
    """Return the cross entropy of what is known: of texts that are true or false of a crop and, on the last `count`
    columns, of canonical phrases, which fit anything half."""
    wanted = torch.full_like(logits, 0.5)
    weights = torch.ones_like(logits)
    wanted[:, :-count] = (truth == TRUE).to(logits.dtype)
    weights[:, :-count] = (truth != UNKNOWN).to(logits.dtype)
    # true pairs are rare: they count as much as the false ones
    rarity = ((truth == FALSE).sum() / (truth == TRUE).sum().clamp(min=1)).sqrt().clamp(1.0, 8.0)
    weights[:, :-count] *= torch.where(truth == TRUE, rarity, torch.ones_like(rarity))
    return 20.0 * (functional.binary_cross_entropy_with_logits(logits, wanted, reduction="none") * weights).mean()


class Run(TrainingRun):
    """A training run and its state on disk."""

    average_decay, gradient_norm = 0.995, 5.0

    def __init__(self, plan: Plan, out: Path, device: str = "cpu") -> None:
        self.plan, self.device = plan, device
        torch.manual_seed(plan.seed)
        super().__init__(TwoTowers().to(device), asdict(plan), out, PEAK, WEIGHT_DECAY)

    def train_step(self, data: Data) -> float:
        """Take one step and return its loss."""
        self.network.train()
        pictures, phrases, truth = data.batch(self.plan, self.step)
        pictures = pictures.contiguous(memory_format=torch.channels_last)
        with torch.autocast(self.device, torch.bfloat16, enabled=self.device == "cuda"):
            logits = self.network.logits(pictures, torch.cat([phrases, data.canonical]))
        loss = loss_of(logits.float(), truth, len(CANONICAL))
        self.descend(loss, rate_at(self.step, self.plan.steps, PEAK, WARM_UP))
        return float(loss.detach())

    def averaged(self) -> TwoTowers:
        """Return the network with the moving average of its weights, on the processor."""
        network = TwoTowers()
        network.load_state_dict({name: value.cpu() for name, value in self.average.items()})
        return network.eval()

    def save(self) -> None:
        """Write the state, and the encoder as it would be used now."""
        super().save()
        words = (f"step {self.step} of {self.plan.steps}", f"batch {self.plan.batch}", f"seed {self.plan.seed}")
        save_towers(self.out / FILE, self.averaged(), vocabulary(lexicon()), "two towers, " + ", ".join(words))


def vocabulary(words: Lexicon) -> list[str]:
    """Return the words that may stand in a training text."""
    texts = [
        text
        for k, (kind, _) in enumerate(words.attributes)
        for text in (words.nouns(k) if kind in ("class", "style", "group") else words.adjectives(k))
    ]
    free = [text for text in texts if not words.is_held_phrase(Phrase(text, ()))]
    return sorted({word for text in (*free, *CANONICAL, "thing", "a", "the") for word in words_of(text)})
