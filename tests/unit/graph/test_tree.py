"""The parse tree: always a tree, and the true one for stacks of boxes."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.contact_graph import SCENE_NODE
from scenewright.stages.graph.ours import Ours
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.support import Candidate
from scenewright.stages.graph.tree import choose_parents, descends_from
from scenewright.stages.graph.unknown import NOTHING_BELOW, unknown_support

from tests.unit.graph.test_support import solid

FLOOR = solid("floor_1", (-9, -9, -0.01), (9, 9, 0.0), class_name="floor", node_type="layout")


@st.composite
def stacks(draw):
    """Columns of boxes, each smaller than and within the one below it; the true parent of every box."""
    entities, parents, label = [FLOOR], {}, 2
    for column in range(draw(st.integers(1, 3))):
        x, below = 4.0 * column - 4.0, "floor_1"
        low, high, z = np.array([x, 0.0]), np.array([x + 1.5, 1.5]), 0.0
        for _ in range(draw(st.integers(1, 4))):
            shrink = draw(st.floats(0.02, 0.12))
            low, high = low + shrink, high - shrink
            height = draw(st.floats(0.15, 0.6))
            name = f"box_{label}"
            entities.append(solid(name, (*low, z), (*high, z + height)))
            parents[name] = below
            below, z, label = name, z + height, label + 1
    order = draw(st.permutations(range(len(entities))))
    return [entities[k] for k in order], parents


@given(stacks())
@settings(max_examples=60, deadline=None)
def test_stacks_give_the_true_support_tree(scene):
    entities, parents = scene
    chosen = choose_parents(Ours(GraphParameters()).ranked_candidates(entities))
    assert {name: candidate.parent for name, candidate in chosen.items()} == parents
    assert all(candidate.relation == "supports" for candidate in chosen.values())


@given(st.integers(0, 2**31), st.integers(2, 12))
@settings(max_examples=60, deadline=None)
def test_any_heap_of_boxes_gives_a_tree(seed, count):
    """Boxes thrown anywhere, overlapping, of equal heights: one parent each, and every path ends at the scene."""
    random = np.random.default_rng(seed)
    entities = []
    for k in range(count):
        low = np.round(random.uniform(0, 0.6, size=3), 1)
        high = low + np.round(random.uniform(0.1, 0.8, size=3), 1)
        kind = random.choice(["cup", "shelf", "table", "fridge"])
        node = "articulated" if kind == "fridge" else "rigid"
        entities.append(
            solid(f"{kind}_{k + 1}", low, high, class_name=str(kind), node_type=node, movable=kind == "cup")
        )
    chosen = choose_parents(Ours(GraphParameters()).ranked_candidates(entities))
    assert set(chosen) <= {entity.name for entity in entities}
    assert paths_end(chosen)


def paths_end(chosen) -> bool:
    """Whether going from child to parent ends wherever it begins."""
    for name in chosen:
        for _ in range(len(chosen) + 1):
            name = chosen[name].parent if name in chosen else None
        if name is not None:
            return False
    return True


@given(st.integers(0, 2**31), st.integers(2, 10))
@settings(max_examples=60, deadline=None)
def test_random_preferences_never_close_a_cycle(seed, count):
    random = np.random.default_rng(seed)
    names = [f"n_{k}" for k in range(count)]
    ranked = {}
    for name in names:
        others = [other for other in names if other != name and random.random() < 0.7]
        scores = np.sort(random.random(len(others)))[::-1]
        ranked[name] = [
            Candidate(name, str(other), float(score), "supports", 0, 1, 0, 0)
            for other, score in zip(random.permutation(others), scores, strict=True)
        ]
    chosen = choose_parents(ranked)
    assert paths_end(chosen)
    # Nothing goes without that could have had a carrier outside what it carries.
    for name in set(names) - set(chosen):
        assert all(descends_from(candidate.parent, name, chosen) for candidate in ranked[name])


def test_two_things_that_seem_to_carry_each_other_leave_the_less_certain_without_a_carrier():
    ranked = {
        "a_1": [Candidate("a_1", "b_2", 0.9, "supports", 0, 1, 0, 0)],
        "b_2": [Candidate("b_2", "a_1", 0.8, "supports", 0, 1, 0, 0)],
    }
    assert set(choose_parents(ranked)) == {"a_1"}


def test_what_hangs_in_the_air_has_an_unknown_carrier_and_the_edge_says_how_far_the_floor_is():
    lonely = solid("box_2", (0, 0, 2.0), (0.3, 0.3, 2.2))
    for entities in ([FLOOR, lonely], [lonely]):
        assert choose_parents(Ours(GraphParameters()).ranked_candidates(entities)) == {}
    link = unknown_support(lonely, [FLOOR, lonely])
    assert (link.source, link.target, link.relation, link.confidence) == (SCENE_NODE, "box_2", "unknown", 0.0)
    assert "floor_1" in link.because and "2.00 m" in link.because
    assert unknown_support(lonely, [lonely]).because == NOTHING_BELOW
