"""What was learned of every method, and a policy of each for a goal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np
import torch
from scenewright.schemas.cutting_model import CuttingModel, ThesisProduction
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.cutting.demonstrations.cutter import Demonstration
from scenewright.stages.cutting.learning import MixtureOfPlanes, layers
from scenewright.stages.cutting.ours.grammar import Grammar, learn
from scenewright.stages.cutting.ours.imagining import Wish
from scenewright.stages.cutting.ours.items import Item, item_of
from scenewright.stages.cutting.ours.policy import DOUBT, OursPolicy
from scenewright.stages.cutting.ours.records import grammar_of
from scenewright.stages.cutting.policy import Goal, Policy
from scenewright.stages.cutting.rivals import cloning
from scenewright.stages.cutting.thesis import induction
from scenewright.stages.cutting.thesis.encoder import Encoder, Features
from scenewright.stages.cutting.thesis.model import FEATURES, ThesisModel, learn_features, learn_grammar
from scenewright.stages.cutting.thesis.policy import ThesisPolicy
from scenewright.stages.kit.formats.network_file import put_tensors
from scenewright.stages.kit.formats.safetensors_file import read_safetensors, write_safetensors

HINT = "learn the model again"
Network = TypeVar("Network", bound=torch.nn.Module)


@dataclass(frozen=True)
class Learned:
    """Our grammar, and the thesis's and its rivals' networks where they were asked for."""

    grammar: Grammar
    thesis: ThesisModel | None = None
    choices: Mapping[str, cloning.ChoiceModel] = field(default_factory=dict)

    def policy(self, method: str, goal: Goal, seed: int) -> Policy:
        """Return a policy for fragments that are wanted. Raises UsageError for a method that was not learned."""
        if method in ("ours", "ours_together"):
            items = [item_of(body, k) for k, body in enumerate(goal.fragments)]
            return self.policy_for(items, together=method == "ours_together")
        if method == "thesis" and self.thesis is not None:
            return ThesisPolicy(self.thesis, goal, seed)
        if method in self.choices:
            return cloning.ChoicePolicy(self.choices[method], goal, seed)
        raise UsageError(
            f"the model has not learned {method}", hint=f"learn it: scenewright cutting learn --methods {method}"
        )

    def policy_for(self, wanted: Sequence[Item] | Wish, *, together: bool = False, doubt: float = DOUBT) -> Policy:
        """Return our policy for items, or for words; it needs no bodies."""
        return OursPolicy(self.grammar, wanted, together=together, doubt=doubt)


def learn_methods(
    demonstrations: Sequence[Demonstration],
    methods: Sequence[str],
    seed: int,
    tell: Callable[[str], None] = lambda text: None,
) -> Learned:
    """Return what methods learn. Raises ValueError where nothing was cut."""
    tell("ours")
    grammar = learn(demonstrations, seed)
    rivals = [rule for rule in ("bc", "qnet") if rule in methods]
    if "thesis" not in methods and not rivals:
        return Learned(grammar)
    tell("features")
    corpus, features = learn_features(demonstrations, seed)
    tell("networks")
    thesis = learn_grammar(corpus, features, seed) if "thesis" in methods else None
    choices: dict[str, cloning.ChoiceModel] = {rule: cloning.learn(corpus, features, rule, seed) for rule in rivals}  # type: ignore[arg-type]
    return Learned(grammar, thesis, choices)


def productions_of(learned: Learned) -> tuple[ThesisProduction, ...]:
    """Return the thesis's productions as records."""
    if learned.thesis is None:
        return ()
    rules = learned.thesis.grammar.productions
    return tuple(ThesisProduction(left=rule.left, right=rule.right, chance=rule.chance) for rule in rules)


def write_networks(path: Path, learned: Learned) -> None:
    """Write every network there is; nothing where there is none."""
    networks: dict[str, torch.nn.Module] = {}
    tensors: dict[str, np.ndarray] = {}
    features = None
    if learned.thesis is not None:
        features = learned.thesis.features
        networks |= {"classifier": learned.thesis.classifier, "planes": learned.thesis.planes}
        tensors["thesis_centres"] = learned.thesis.grammar.centres
    for rule, model in learned.choices.items():
        features, networks[rule] = model.features, model.network
    if features is None:
        return
    networks["encoder"] = features.encoder
    tensors |= {"feature_mean": features.mean, "feature_deviation": features.deviation}
    for name, network in networks.items():
        tensors |= {f"{name}/{key}": value.detach().numpy() for key, value in network.state_dict().items()}
    write_safetensors(path, tensors, {})


def read_learned(model: CuttingModel) -> Learned:
    """Return what a model artifact holds. Raises BadInput."""
    file = model.info
    grammar = grammar_of(file.grammar)
    if set(file.methods) <= {"ours"}:
        return Learned(grammar)
    path = model.path("networks.safetensors")
    tensors, _ = read_safetensors(path)
    mean, deviation = (_vector(tensors, name, path) for name in ("feature_mean", "feature_deviation"))
    features = Features(_network(Encoder(), "encoder", tensors, path), mean, deviation)
    thesis = None
    if "thesis" in file.methods:
        centres = tensors.get("thesis_centres", np.zeros((0, 0)))
        kinds = 1 + max(max(p.left, *p.right) for p in file.thesis) if file.thesis else 0
        if centres.ndim != 2 or centres.shape[1] != FEATURES or not 0 < kinds <= len(centres) <= 64:
            raise BadInput(f"{path}: its types are not those of the productions", hint=HINT)
        rules = tuple(induction.Production(p.left, p.right, p.chance) for p in file.thesis)
        classifier = _network(layers(FEATURES, 64, len(centres)), "classifier", tensors, path)
        planes = _network(MixtureOfPlanes(len(rules) + FEATURES), "planes", tensors, path)
        thesis = ThesisModel(features, induction.Grammar(centres, rules), classifier, planes)
    choices: dict[str, cloning.ChoiceModel] = {
        rule: cloning.ChoiceModel(features, _network(cloning.ChoiceNetwork(), rule, tensors, path), rule)  # type: ignore[arg-type]
        for rule in ("bc", "qnet")
        if rule in file.methods
    }
    return Learned(grammar, thesis, choices)


def _vector(tensors: Mapping[str, np.ndarray], name: str, path: Path) -> np.ndarray:
    values = tensors.get(name)
    if values is None or values.shape != (FEATURES,) or not np.isfinite(values).all():
        raise BadInput(f"{path}: {name} is not {FEATURES} numbers", hint=HINT)
    return values.astype(float)


def _network(network: Network, name: str, tensors: Mapping[str, np.ndarray], path: Path) -> Network:
    mine = {key.removeprefix(f"{name}/"): value for key, value in tensors.items() if key.startswith(f"{name}/")}
    put_tensors(network, mine, f"{path}: {name}", HINT)
    return network
