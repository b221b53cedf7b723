"""What a thing is by its shape: the library's models say it where masks named it nothing, or what it cannot be.

Ours; the thesis takes the class from the masks alone. A model of the right class fits to millimetres at its own size,
others do not. So a thing that no model of its class fits is held against those of all classes, and takes the one that
fits by far the best, if any does; where two fit about as well, shape does not tell, and the thing stays as it is.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from scenewright.schemas.cad_library import CadModel
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.vocabulary import UNNAMED, load_vocabulary
from scenewright.stages.cad.candidates import Shortlist, shortlist
from scenewright.stages.cad.made_models import is_of_family
from scenewright.stages.cad.method import CadMethod
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.cad.stretching import source_of
from scenewright.stages.cad.target import Target

TRIED, LARGEST_MISFIT = 2, 0.035
"""Classes whose models are fitted, of those that are less than this off before the fit [m]; another one, where one of
these names the thing: rivals have to be worse."""
LEAST_SIZE, LARGEST_SIZE, ALIKE = 0.6, 1.4, 2
"""Models are looked at of whose extents so many are about as large as those of what was seen, as shares of them: the
third may be hidden, or added to by an open door."""


def is_doubtful(own: Shortlist, method: CadMethod) -> bool:
    """Whether no model of the class that masks gave a thing fits it as it is, not stretched."""
    whole = [placement.score for placement in own.placements if source_of(placement.shape.model) is None]
    return not whole or whole[0] > method.parameters.recognition_error


def recognised(own: Shortlist, target: Target, models: Iterable[CadModel], method: CadMethod) -> Shortlist:
    """Return the shortlist of the class that a thing is of by its shape, with that class in its node; `own` where shape
    does not tell.

    own: what models of the masks' class come to; target: the thing, with the surfaces of all `models`.
    """
    shortlists = by_class(target, models, method)
    if not shortlists:
        return own
    best, *others = shortlists if not own.placements else [*shortlists, own]
    score, next_score = best.placements[0].score, min((entry.placements[0].score for entry in others), default=np.inf)
    if score > method.parameters.recognition_error or next_score < score + method.parameters.recognition_margin:
        return own
    runner_up = f"all else {1000 * next_score:.0f} mm or more" if others else "nothing else fits"
    reason = f"by its shape a {best.node.class_name}: {1000 * score:.0f} mm off, {runner_up}"
    return replace(best, reason="; ".join(filter(None, (reason, best.reason))))


def named_by_people(panoptic_map: PanopticMap) -> frozenset[str]:
    """Return the nodes whose class somebody gave or changed by an edit of the map: that word stands."""
    edits = panoptic_map.edits
    applied = () if edits is None else (edit for edit in edits.edits if edit.status != "conflict")
    return frozenset(name for edit in applied for name in edit.things)


def renamed(graph: ContactGraphFile, shortlists: Mapping[str, Shortlist]) -> ContactGraphFile:
    """Return the graph in which things have the class that shape gave them."""
    nodes = (shortlists[node.id].node if node.id in shortlists else node for node in graph.nodes)
    return graph.model_copy(update={"nodes": tuple(nodes)})


def with_carriers(
    graph: ContactGraphFile, shortlists: Mapping[str, Shortlist], chosen: Mapping[str, Placement]
) -> ContactGraphFile:
    """Return the graph in which what floated stands on what its model of a family reaches down to, where that is
    `chosen`."""
    carriers = {
        name: shortlists[name].carrier for name, placement in chosen.items() if is_of_family(placement.shape.model)
    }
    links = (carriers.get(link.target) or link if link.relation == "unknown" else link for link in graph.links)
    return graph.model_copy(update={"links": tuple(links)})


def by_class(target: Target, models: Iterable[CadModel], method: CadMethod) -> list[Shortlist]:
    """Return shortlists that are not empty, a class each, the best first: of the classes whose models are least off
    where their planes put them, the thing's own left out. `models`, `target` as in `recognised`."""
    classes: dict[str, list[CadModel]] = {}
    for model in models:
        if model.class_name not in (UNNAMED, target.node.class_name):
            classes.setdefault(model.class_name, []).append(model)
    targets = [of_class(target, name, own_class) for name, own_class in sorted(classes.items())]
    misfits = [(method.misfit(each), index) for index, each in enumerate(targets)]
    promising = [targets[index] for misfit, index in sorted(misfits) if misfit < LARGEST_MISFIT]
    shortlists = [shortlist(each, method) for each in promising[:TRIED]]
    if not all(is_doubtful(entry, method) for entry in shortlists):
        shortlists += [shortlist(each, method) for each in promising[TRIED : TRIED + 1]]
    return sorted((entry for entry in shortlists if entry.placements), key=lambda entry: entry.placements[0].score)


def of_class(target: Target, class_name: str, models: list[CadModel]) -> Target:
    """Return the target as if masks had named it so."""
    vocabulary = load_vocabulary()
    node = target.node.model_copy(update={"class_name": class_name, "node_type": vocabulary.by_name(class_name).node})
    return replace(target, around=replace(target.around, node=node), models=models)


def might_be(model: CadModel, target: Target) -> bool:
    """Whether a model, shut and upright or lying, is about as large as what was seen."""
    state, box = model.states[0], target.node.box
    if box is None:
        return False
    ratio = np.sort(box.size) / np.sort(np.subtract(state.box_maximum, state.box_minimum))
    return int(((ratio > LEAST_SIZE) & (ratio < LARGEST_SIZE)).sum()) >= ALIKE
