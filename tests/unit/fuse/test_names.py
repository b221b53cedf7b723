"""Names: what looks said against their silence, and against the size of the thing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.class_counts import class_counts
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.fuse.names import (
    BACKGROUND,
    LIKELY,
    SELDOM,
    SILENT,
    WRONG,
    Naming,
    Network,
    Rates,
    Said,
    name_of,
    networks_of,
    prior_odds,
    rates_of,
)

from tests.unit.fuse.scenes import class_id

VOCABULARY = load_vocabulary()
CHAIR, TABLE, SOFA, CUP, WALL, OBJECT = (class_id(name) for name in ("chair", "table", "sofa", "cup", "wall", "object"))
USUAL = Rates(right=0.6, wrong=WRONG, background=BACKGROUND)


def named(scores: dict[int, float], looks: float = 30.0, extent: float = 1.0, rates: Rates = USUAL) -> Naming:
    things = frozenset(e.id for e in VOCABULARY.classes if e.kind == "thing") - {OBJECT}
    return name_of(Said(looks, scores), rates.right, [Network(rates, things)], extent, VOCABULARY, OBJECT)


def chance(naming: Naming, class_name: int) -> float:
    """Posterior of a class; 0 where it is not among those that are told."""
    rows = [(naming.class_id, naming.posterior), *naming.runners_up]
    return dict(rows).get(class_name, 0.0)


def test_a_name_that_most_looks_gave() -> None:
    naming = named({CHAIR: 0.6, TABLE: 0.05})
    assert naming.class_id == CHAIR and naming.posterior >= LIKELY
    assert naming.runners_up[0][0] == TABLE
    assert named({CHAIR: 0.6, WALL: 0.3}).class_id == CHAIR, "a thing it is, whatever is behind it"


def test_silence_is_evidence_against_a_name() -> None:
    few, none = named({CHAIR: 0.05}), named({})
    assert few.class_id == OBJECT and few.rule == "no name is likely enough"
    assert none == Naming(OBJECT, 1.0, (), "nobody named it")


def test_who_says_object_doubts_every_name() -> None:
    plain, doubted = named({CHAIR: 0.4}), named({CHAIR: 0.4, OBJECT: 0.5})
    assert plain.class_id == CHAIR and chance(doubted, CHAIR) < chance(plain, CHAIR)
    assert named({OBJECT: 0.9}).rule == "nobody named it"


def test_a_thing_of_another_size_does_not_have_the_name() -> None:
    naming = named({TABLE: 0.5}, extent=0.05)
    assert naming == Naming(OBJECT, 1.0, (), "no thing of its size has its name")
    naming = named({CUP: 0.4, CHAIR: 0.3}, extent=1.0)
    assert naming.class_id == CHAIR and chance(naming, CUP) == 0.0, "the next name that it can have"
    assert named({CUP: 1.0}, extent=9.0).class_id == OBJECT, "nobody is believed beyond measure"


def test_looks_are_alike_so_that_many_do_not_make_it_certain() -> None:
    two, many, more = (chance(named({CHAIR: 0.6, TABLE: 0.2}, looks), CHAIR) for looks in (2, 50, 5000))
    assert two < many <= more < 1.0001


POSSIBLE = (CHAIR, TABLE, SOFA)
SHARES = st.fixed_dictionaries({c: st.floats(0.0, 0.3) for c in (*POSSIBLE, CUP, WALL, OBJECT)})
RATES = st.builds(Rates, st.floats(SELDOM, 1 - SILENT), st.floats(WRONG, 0.15), st.floats(BACKGROUND, 0.4))


@settings(max_examples=100, deadline=None)
@given(SHARES, RATES, st.floats(0.01, 200), st.floats(0.02, 5))
def test_posteriors_are_shares_in_order(scores: dict[int, float], rates: Rates, looks: float, extent: float) -> None:
    naming = named(scores, looks, extent, rates)
    others = [p for _, p in naming.runners_up]
    assert 0 <= naming.posterior <= 1 and others == sorted(others, reverse=True)
    assert naming.posterior + sum(others) <= 1.003
    assert naming.class_id not in dict(naming.runners_up)
    if naming.class_id != OBJECT:
        assert naming.posterior >= max([LIKELY, *others])
        assert VOCABULARY.by_id(naming.class_id).kind == "thing"
    assert naming == named(dict(reversed(scores.items())), looks, extent, rates), "in whatever order it was said"


@settings(max_examples=100, deadline=None)
@given(st.floats(0.0, 0.5), st.floats(0.0, 0.3), st.floats(0.0, 0.2), st.floats(1, 100))
def test_a_larger_score_never_makes_a_name_less_likely(score: float, other: float, more: float, looks: float) -> None:
    """Here `chair` is possible and no more than usual was said before."""
    before = named({CHAIR: score, TABLE: other}, looks)
    after = named({CHAIR: score + more, TABLE: other}, looks)
    assert after.class_id == CHAIR or before.class_id != CHAIR
    if before.class_id == CHAIR:
        assert after.posterior >= before.posterior - 1e-9


def test_rates_are_those_of_the_log_within_least_shares() -> None:
    things = frozenset({CHAIR, TABLE})
    rates = rates_of([Said(10, {CHAIR: s}) for s in (0.3, 0.5, 0.7)], things)
    assert rates == Rates(pytest.approx(0.5), WRONG, BACKGROUND)
    rates = rates_of([Said(10, {CHAIR: 0.6, TABLE: 0.2, WALL: 0.9})], things)
    assert rates.right == pytest.approx(0.6) and rates.background == pytest.approx(0.25)
    assert rates.wrong == pytest.approx(0.15)
    assert rates_of([], things) == Rates(0.5, WRONG, BACKGROUND)
    assert rates_of([Said(9, {CHAIR: 1.0})], things).right == 1 - SILENT, "masks without errors"
    assert rates_of([Said(9, {CHAIR: 0.01})], things).right == SELDOM


def heard(*networks: tuple[dict[int, float], frozenset[int]]) -> Naming:
    """Name a thing of which each network said something and knows some classes."""
    whole: dict[int, float] = {}
    for scores, _ in networks:
        whole = {c: max(whole.get(c, 0.0), scores.get(c, 0.0)) for c in whole | scores}
    told = Said(30.0, whole, tuple(scores for scores, _ in networks))
    return name_of(told, 0.6, [Network(USUAL, known) for _, known in networks], 0.5, VOCABULARY, OBJECT)


def test_a_network_that_knows_no_backpacks_says_nothing_against_one() -> None:
    backpack = class_id("backpack")
    both, without = frozenset({CHAIR, backpack}), frozenset({CHAIR})
    said = ({backpack: 0.25}, both)
    alone = heard(said)
    assert alone.class_id == backpack
    beside = heard(said, ({CHAIR: 0.3}, without))
    assert beside.class_id == backpack and chance(beside, CHAIR) >= chance(alone, CHAIR)
    assert chance(heard(said, ({CHAIR: 0.3}, both)), backpack) < chance(beside, backpack), "who knows them is heard"
    assert chance(heard(said, ({}, both)), backpack) < chance(heard(said, ({}, without)), backpack), "so is silence"


def test_networks_know_what_they_named_and_have_rates_of_their_own() -> None:
    things = [Said(10, {CHAIR: 0.5}, ({CHAIR: 0.5}, {})), Said(10, {TABLE: 0.4}, ({}, {TABLE: 0.4, WALL: 0.2}))]
    first, second = networks_of(things, frozenset({CHAIR, TABLE}))
    assert (first.knows, second.knows) == (frozenset({CHAIR}), frozenset({TABLE}))
    assert (first.rates.right, second.rates.right) == (0.5, 0.4)
    (only,) = networks_of([Said(10, {CHAIR: 0.5})], frozenset({CHAIR, TABLE}))
    assert only == Network(rates_of([Said(10, {CHAIR: 0.5})], frozenset({CHAIR})), frozenset({CHAIR}))


def test_a_mask_of_a_wall_is_silent_about_a_thing() -> None:
    assert named({CHAIR: 0.4, WALL: 0.5}) == named({CHAIR: 0.4})


def test_the_prior_is_the_share_of_annotated_things_and_the_range_of_sizes() -> None:
    counts = class_counts()
    chairs = counts.of("chair") / counts.nameless
    assert prior_odds("chair") == pytest.approx(chairs * np.log(4 / 0.05) / np.log(1.8 / 0.3))
    unknown = np.log(4 / 0.05) / np.log(4.0)
    assert prior_odds("desk") == pytest.approx(counts.of("desk") / counts.nameless * unknown), "no range is known"
    assert prior_odds("a class of one's own") == pytest.approx(counts.rare / counts.nameless * unknown)
    assert set(counts.counts) <= {entry.name for entry in VOCABULARY.classes}


def test_what_is_common_is_believed_on_one_good_look_and_what_is_rare_is_not() -> None:
    rates = Rates(0.5, WRONG, BACKGROUND)
    assert named({CHAIR: 0.5}, 1.0, rates=rates).class_id == CHAIR
    assert named({class_id("person"): 0.5}, 1.0, rates=rates).class_id == OBJECT


def test_no_name_comes_from_the_prior_alone() -> None:
    hardly = named({CHAIR: 0.01}, rates=Rates(SELDOM, WRONG, BACKGROUND))
    assert hardly.class_id == OBJECT and prior_odds("chair") > 1
