"""The tree of plans: what they share is there once, every end is there."""

from __future__ import annotations

from scenewright.stages.kit.drawing.plan_tree import MOST_BRANCHES, Branch, plan_tree


def texts(figure) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_shared_steps_are_drawn_once_and_every_reason_is_there():
    steps = (("a", "open door"), ("b", "pick cup"), ("c", "place cup"))
    found = texts(
        plan_tree([Branch(steps[:1], "no path"), Branch(steps[:2], "too wide"), Branch(steps, "done")], "Plans")
    )
    assert found.count("open door") == 1 and found.count("pick cup") == 1 and found.count("place cup") == 1
    assert [text for text in found if text[0].isdigit()] == ["3: done", "2: too wide", "1: no path"]


def test_the_last_of_many_are_shown_with_their_numbers():
    figure = plan_tree([Branch(((k, str(k)),), f"reason {k}") for k in range(MOST_BRANCHES + 5)], "Plans")
    found = texts(figure)
    assert "6: reason 5" in found and "5: reason 4" not in found
    assert f"({'the last'} {MOST_BRANCHES}, 5 before)" in figure.get_suptitle()


def test_no_plan_is_an_empty_tree():
    assert texts(plan_tree([], "Plans")) == ["start"]
