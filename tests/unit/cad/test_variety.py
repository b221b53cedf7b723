"""What is kept of a ranking has room for many models."""

from __future__ import annotations

from scenewright.stages.cad.variety import varied


def model_of(entry: tuple[str, int]) -> str:
    return entry[0]


def test_a_model_that_fills_the_ranking_leaves_the_second_half_to_others() -> None:
    ranked = [("bin", k) for k in range(10)] + [("own", 10), ("box", 11), ("own", 12)]
    assert varied(ranked, 6, model_of) == [("bin", 0), ("bin", 1), ("bin", 2), ("own", 10), ("box", 11), ("own", 12)]


def test_models_take_turns_and_equals_go_by_rank() -> None:
    ranked = [("a", 0), ("a", 1), ("b", 2), ("b", 3), ("c", 4), ("c", 5)]
    assert varied(ranked, 4, model_of) == [("a", 0), ("a", 1), ("b", 2), ("c", 4)]


def test_of_one_model_the_best_stay() -> None:
    ranked = [("a", k) for k in range(9)]
    assert varied(ranked, 3, model_of) == ranked[:3]
    assert varied(ranked, 20, model_of) == ranked
