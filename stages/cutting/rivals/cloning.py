"""Behavioural cloning and the offline Q-network: state and goal as sums of embedded features (section 6.4.2.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from scenewright.schemas.plan import Failure
from scenewright.stages.cutting.corpus import Choice, Corpus, plane_out
from scenewright.stages.cutting.learning import MixtureOfPlanes, fit, layers, seeded
from scenewright.stages.cutting.policy import Action, Goal, Stop
from scenewright.stages.cutting.thesis.encoder import Features
from scenewright.stages.cutting.thesis.model import FEATURES
from scenewright.stages.cutting.world.body import Body

EMBEDDING = 32
"""Numbers of the embedding of a piece; by eye."""
DISCOUNT, MARGIN = 0.95, 0.2
"""Discount of a later cut, and the margin by which other pieces are worth less; by eye."""
STEPS, BATCH = 600, 16
"""Steps of the training and examples of a step; by eye."""
POOL = 0.1
"""Sums over fragments are brought to the size of one of ten."""
Rule = Literal["bc", "qnet"]


class ChoiceNetwork(torch.nn.Module):
    """A number for each fragment that could be cut: its logit (cloning) or its value (Q). `planes` are cloned."""

    def __init__(self) -> None:
        super().__init__()
        self.embed = layers(FEATURES, 64, EMBEDDING)
        self.value = layers(FEATURES + 2 * EMBEDDING, 64, 1)
        self.planes = MixtureOfPlanes(FEATURES + EMBEDDING)

    def pooled(self, z: torch.Tensor) -> torch.Tensor:
        """Return the sum of embedded features (N, 17)."""
        return POOL * self.embed(z).sum(dim=0)

    def values(self, z: torch.Tensor, goal: torch.Tensor) -> torch.Tensor:
        """Return a number for each fragment (N,), given those of the goal (G, 17)."""
        state, pooled_goal = self.pooled(z), self.pooled(goal)
        state_and_goal = torch.cat([state, pooled_goal]).expand(len(z), -1)
        return self.value(torch.cat([z, state_and_goal], dim=1))[:, 0]


@dataclass(frozen=True)
class ChoiceModel:
    """What a rival learned; features are those of the thesis's method."""

    features: Features
    network: ChoiceNetwork
    rule: Rule


def learn(corpus: Corpus, features: Features, rule: Rule, seed: int) -> ChoiceModel:
    """Train on the cuts of the demonstrations."""
    random = seeded(seed, {"bc": 5, "qnet": 6}[rule])
    network = ChoiceNetwork()
    z = torch.from_numpy(features.of_shapes(corpus.shapes).astype(np.float32))
    of_choice = {"bc": _cloning, "qnet": _temporal_difference}[rule]

    def loss(chosen: np.ndarray) -> torch.Tensor:
        choices = [corpus.choices[k] for k in chosen]
        which = torch.stack([of_choice(network, z, choice) for choice in choices]).mean()
        plane_inputs = torch.stack([_plane_input(network, z[c.piece], z[list(c.goal)]) for c in choices])
        planes = torch.from_numpy(np.array([choice.plane for choice in choices], np.float32))
        return which + network.planes.loss(plane_inputs, planes)

    fit(network, loss, len(corpus.choices), random, steps=STEPS, batch=BATCH)
    return ChoiceModel(features, network, rule)


def _plane_input(network: ChoiceNetwork, z: torch.Tensor, goal: torch.Tensor) -> torch.Tensor:
    return torch.cat([z, network.pooled(goal)])


def _cloning(network: ChoiceNetwork, z: torch.Tensor, choice: Choice) -> torch.Tensor:
    logits = network.values(z[list(choice.there)], z[list(choice.goal)])
    return torch.nn.functional.cross_entropy(logits[None], torch.tensor([choice.there.index(choice.piece)]))


def _temporal_difference(network: ChoiceNetwork, z: torch.Tensor, choice: Choice) -> torch.Tensor:
    """Reward 1 for the cut that reaches the goal; what was not chosen is kept a margin below (Kostrikov 2020)."""
    goal = z[list(choice.goal)]
    values = network.values(z[list(choice.there)], goal)
    mine = choice.there.index(choice.piece)
    target = torch.tensor(1.0)
    if not choice.last:
        with torch.no_grad():
            target = DISCOUNT * network.values(z[list(choice.after)], goal).max()
    margins = torch.full_like(values, MARGIN)
    margins[mine] = 0.0
    return (values[mine] - target) ** 2 + (values + margins).max() - values[mine]


class ChoicePolicy:
    """Chooses a fragment (by chance when cloning, the best by Q), and draws a plane."""

    def __init__(self, model: ChoiceModel, goal: Goal, seed: int) -> None:
        self._model, self._random = model, np.random.default_rng([seed, 7])
        self._goal = self._features(goal.fragments)
        self._known: dict[int, torch.Tensor] = {}
        self._refused: set[int] = set()

    def _features(self, bodies: Sequence[Body]) -> torch.Tensor:
        return torch.from_numpy(self._model.features.of(bodies).astype(np.float32))

    @torch.no_grad()
    def decide(self, board: Mapping[int, Body]) -> Action | Stop:
        """Return the next cut."""
        new_numbers = [number for number in board if number not in self._known]
        if new_numbers:
            self._known |= dict(zip(new_numbers, self._features([board[n] for n in new_numbers]), strict=True))
        numbers = [number for number in board if number not in self._refused] or list(board)
        z = torch.stack([self._known[number] for number in numbers])
        values = self._model.network.values(z, self._goal)
        if self._model.rule == "bc":
            chances = torch.softmax(values, dim=0).numpy().astype(float)
            chosen = int(self._random.choice(len(numbers), p=chances / chances.sum()))
        else:
            chosen = int(values.argmax())
        plane_input = _plane_input(self._model.network, z[chosen], self._goal).numpy()
        plane = plane_out(board[numbers[chosen]], self._model.network.planes.draw(plane_input, self._random))
        return Action(numbers[chosen], plane, f"value {float(values[chosen]):.2f}")

    def done(self, action: Action, results: Mapping[int, Body], above: frozenset[int]) -> None:
        """What was refused may be tried again."""
        self._refused.clear()

    def refused(self, action: Action, failure: Failure) -> None:
        """Another fragment is next, as the best by Q would be chosen for ever."""
        self._refused.add(action.piece)
