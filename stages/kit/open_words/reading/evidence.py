"""What the networks say that a thing is, with probabilities, as the panoptic map's evidence model has it.

Every image that shows a thing and does not name it counted there (`fuse`, names.py); here its posteriors are read.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.panoptic_map import Because, Entity, PanopticMap
from scenewright.schemas.vocabulary import UNNAMED, load_vocabulary
from scenewright.stages.kit.open_words.reading.colors import color_shares

SEVERAL_LOOKS = 5.0
"""A name that fewer looks gave than this is doubtful; by eye."""
SURE = 0.8
"""Posterior from which on a name is no doubtful one; by eye."""
ALONE = 1.0
"""Posterior of a name where the map keeps no reasons: a scan whose labels are a person's."""


@dataclass(frozen=True)
class Names:
    """What a thing may be."""

    shares: Mapping[str, float]
    """Class -> posterior; what is missing to 1 is for none of them."""
    looks: float = 0.0
    """In how many images it was seen; 0: not known."""
    said: float = 0.0
    """In how many of them masks gave it its likeliest name (sum of scores)."""

    def is_doubtful(self) -> bool:
        """Whether its likeliest name rests on few looks, or is not much likelier than others."""
        best = max(self.shares.values(), default=0.0)
        return best < SURE or (self.looks > 0 and self.said < SEVERAL_LOOKS)


def names_of_map(panoptic_map: PanopticMap) -> dict[int, Names]:
    """Return instance -> names of the entities of a map."""
    because = panoptic_map.because
    reasons = {} if because is None else {reason.instance: reason for reason in because.entities}
    return {entity.instance: names_of(entity, reasons.get(entity.instance)) for entity in panoptic_map.info.entities}


def names_of(entity: Entity, reason: Because | None) -> Names:
    """Return the names of an entity by its reason; without one its class alone."""
    named = {} if entity.class_name == UNNAMED else {entity.class_name: ALONE}
    if reason is None:
        return Names(named)
    shares = dict(reason.runners_up)
    left = 0.0 if named else 1.0 - sum(shares.values())
    shares |= {
        name: min(score, left) for name, score in reason.said.items() if name not in shares and _is_fitting(name)
    }
    if named:
        shares[entity.class_name] = ALONE if reason.posterior is None else reason.posterior
    said = reason.said.get(entity.class_name, 0.0) * reason.looks
    return Names({name: share for name, share in shares.items() if share > 0}, reason.looks, said)


def _is_fitting(class_name: str) -> bool:
    """Whether a class is fitted to a room and no thing (a curtain, a door): the map weighs no names of these, so that
    the mean score of masks stands for a posterior."""
    entry = next((each for each in load_vocabulary().classes if each.name == class_name), None)
    return entry is not None and entry.kind == "stuff" and class_name not in ("floor", "wall", "ceiling")


def colors_of(colors: np.ndarray) -> dict[str, float]:
    """Return name of a colour -> share of the points with these colours (N, 3) uint8."""
    if not len(colors):
        return {}
    shares = color_shares(np.asarray(colors, float) / 255.0, np.ones(len(colors)))
    return {name: round(share, 3) for name, share in sorted(shares.items()) if share >= 0.01}
