"""Everything that the thesis's method learns, from demonstrations and a seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from scenewright.stages.cutting.corpus import Corpus, corpus_of
from scenewright.stages.cutting.demonstrations.cutter import Demonstration
from scenewright.stages.cutting.learning import MixtureOfPlanes, fit, layers, seeded
from scenewright.stages.cutting.thesis.encoder import CODE, Features, train_encoder
from scenewright.stages.cutting.thesis.induction import Grammar, induce, production_of

FEATURES = CODE + 1
"""Numbers of a piece: its shape's code and the logarithm of its size."""


@dataclass(frozen=True)
class ThesisModel:
    """Features, grammar, classifier p(c|z), and planes given production and z."""

    features: Features
    grammar: Grammar
    classifier: torch.nn.Module
    planes: MixtureOfPlanes

    @torch.no_grad()
    def log_types(self, z: np.ndarray) -> np.ndarray:
        """Return log p(c|z) (N, K) of features (N, 17)."""
        answer = self.classifier(torch.from_numpy(z.astype(np.float32)))
        return torch.log_softmax(answer, dim=1).numpy().astype(float)

    def given(self, production: int, z: np.ndarray) -> np.ndarray:
        """Return what the planes' network is given: the production as one of many, and z (17,)."""
        return np.concatenate([np.eye(len(self.grammar.productions))[production], z])


def learn_features(demonstrations: Sequence[Demonstration], seed: int) -> tuple[Corpus, Features]:
    """Return the corpus of demonstrations and features trained on it. Raises ValueError where nothing was cut."""
    corpus = corpus_of(demonstrations)
    if not corpus.choices:
        raise ValueError("no demonstration cuts anything")
    return corpus, Features.fitted(train_encoder(corpus.shapes, seed), corpus.shapes)


def learn_grammar(corpus: Corpus, features: Features, seed: int) -> ThesisModel:
    """Train what comes after the features."""
    z = features.of_shapes(corpus.shapes)
    grammar, types = induce(z, corpus, seed)
    random = seeded(seed, 3)
    classifier = layers(FEATURES, 64, grammar.types)
    inputs, target_types = torch.from_numpy(z.astype(np.float32)), torch.from_numpy(types.astype(np.int64))

    def classify(chosen: np.ndarray) -> torch.Tensor:
        return torch.nn.functional.cross_entropy(classifier(inputs[chosen]), target_types[chosen])

    fit(classifier, classify, len(z), random, steps=500, batch=64)
    planes = MixtureOfPlanes(len(grammar.productions) + FEATURES)
    model = ThesisModel(features, grammar, classifier, planes)
    numbers = {(rule.left, rule.right): k for k, rule in enumerate(grammar.productions)}
    rows = [
        model.given(numbers[production_of(choice.piece, choice.results, types)], z[choice.piece])
        for choice in corpus.choices
    ]
    plane_inputs = torch.from_numpy(np.array(rows, np.float32))
    planes_shown = torch.from_numpy(np.array([choice.plane for choice in corpus.choices], np.float32))
    fit(planes, lambda k: planes.loss(plane_inputs[k], planes_shown[k]), len(rows), random, steps=800, batch=64)
    return model
