"""Every figure of README.md and docs/ comes from docs/results/*.json."""

from __future__ import annotations

import json
import re
import tomllib
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from benchmarks.figures.content import Experiment, FiguresError, load_experiment, load_experiments
from benchmarks.figures.lines import IN_TEXT
from benchmarks.figures.pages import ROOT, homes, pages, render
from benchmarks.figures.unmarked import CLEARLY_MEASURED, GIVEN, GIVEN_MARKER, MEASURED, unmarked

RESULTS = ROOT / "docs" / "results"
WORDS = 700
"""README welcomes; the rest stands in docs/."""


@pytest.fixture(scope="module")
def experiments() -> dict[str, Experiment]:
    return load_experiments(RESULTS)


@pytest.mark.parametrize("page", pages(ROOT), ids=lambda page: str(page.relative_to(ROOT)))
def test_a_page_shows_the_figures_of_the_json(page: Path, experiments: dict[str, Experiment]) -> None:
    text = page.read_text()
    assert render(text, experiments, homes(ROOT, page)) == text, "run `make figures`"


@pytest.mark.parametrize("page", pages(ROOT), ids=lambda page: str(page.relative_to(ROOT)))
def test_what_looks_measured_stands_in_a_marker(page: Path) -> None:
    text = page.read_text()
    pattern = MEASURED if page.name == "README.md" or page.parent == RESULTS else CLEARLY_MEASURED
    assert [f"line {line}: {figure}" for line, figure in unmarked(text, pattern)] == []
    assert {match["reason"] for match in GIVEN_MARKER.finditer(text)} <= set(GIVEN)


def test_texts_of_the_json_name_figures_instead_of_repeating_them(experiments: dict[str, Experiment]) -> None:
    repeated = {
        f"{name}.json, {part}: {figure}"
        for name, experiment in experiments.items()
        for part in ("simulated", "knows", "does_not_show", "notes")
        for _, figure in unmarked(IN_TEXT.sub("", str(experiment.about.get(part, ""))))
    }
    assert repeated == set()


@pytest.mark.parametrize("page", sorted(set(RESULTS.glob("*.md")) - {RESULTS / "index.md"}), ids=lambda page: page.name)
def test_a_page_of_results_begins_with_what_it_does_not_show(page: Path) -> None:
    shown = [line for line in page.read_text().splitlines() if line and not line.startswith(("#", "<!--"))]
    assert shown[0].startswith("**What this does not show.**")


@pytest.mark.parametrize("page", sorted(RESULTS.glob("*.md")), ids=lambda page: page.name)
def test_no_table_stands_before_what_its_figures_do_not_show(page: Path) -> None:
    """Of experiments that have their page here: a page may hold several."""
    markers = re.findall(r"<!-- (about|table|rows) (\w+)", page.read_text())
    told = {name for kind, name in markers if kind == "about"}
    for place, (kind, name) in enumerate(markers):
        assert kind == "about" or name not in told or ("about", name) in markers[:place], name


def test_every_experiment_has_one_page(experiments: dict[str, Experiment]) -> None:
    about = Counter(name for page in RESULTS.glob("*.md") for name in re.findall(r"<!-- about (\w+)", page.read_text()))
    assert about == Counter(list(experiments))


def test_words_are_of_experiments_that_are_there(experiments: dict[str, Experiment]) -> None:
    assert set(tomllib.loads((RESULTS / "words.toml").read_text())) <= set(experiments)


def test_every_page_of_results_is_linked_from_the_index() -> None:
    index = (RESULTS / "index.md").read_text()
    assert [
        page.name for page in RESULTS.glob("*.md") if page.name != "index.md" and f"({page.name})" not in index
    ] == []


def test_readme_is_short() -> None:
    text = re.sub(r"<!--.*?-->", "", (ROOT / "README.md").read_text(), flags=re.DOTALL)
    text = re.sub(r"\]\([^)]*\)", "]", text)
    words = [word for word in text.split() if re.search(r"\w", word)]
    assert len(words) <= WORDS


CONTENT: dict[str, Any] = {
    "experiment": "brushes",
    "title": "Brushes",
    "date": "2026-01-02",
    "commit": "abc1234",
    "machine": "a machine",
    "command": "make brushes",
    "simulated": "the paint",
    "knows": "the wall",
    "does_not_show": "More than {ours/wall/time bare} says.",
    "figures": {
        "ours/wall/time": {"value": 3.25, "low": 3.0, "high": 3.5, "cases": 4, "unit": "s"},
        "ours/fence/time": {"value": 12, "low": None, "high": None, "cases": 2, "unit": "s"},
        "theirs/wall/time": {"value": 8.5, "low": None, "high": None, "cases": 4, "unit": "s"},
    },
}
TABLE = '<!-- table brushes\nlabels = ["arm", "where"]\nrows = ["*/wall", "ours/fence"]\ncolumns = ["time"]\n-->\n'


def brushes(folder: Path, **changes: object) -> dict[str, Experiment]:
    file = folder / "brushes.json"
    file.write_text(json.dumps(CONTENT | changes))
    return {"brushes": load_experiment(file, {})}


def test_a_table_says_intervals_cases_and_where_none_was_measured(tmp_path: Path) -> None:
    text = render(f"{TABLE}old\n<!-- /table -->", brushes(tmp_path), {})
    assert "| arm | where | n | time [s] |" in text
    assert "| ours | wall | 4 | 3.2 [3.0, 3.5] |" in text
    assert "| theirs | wall | 4 | 8.5 |" in text
    assert "| ours | fence | 2 | 12.0 |" in text
    assert "where none stands, none was measured" in text
    assert "Simulated: the paint. The method may know: the wall. 2026-01-02, commit abc1234." in text
    assert "old" not in text


def test_words_name_arms_cases_and_what_a_case_is(tmp_path: Path) -> None:
    brushes(tmp_path)
    (tmp_path / "words.toml").write_text('[brushes]\na_case = "walls"\n[brushes.names]\nfence = "garden fence"\n')
    text = render(f"{TABLE}<!-- /table -->", load_experiments(tmp_path), {})
    assert "| ours | garden fence | 2 | 12.0 |" in text
    assert "*n: walls; " in text


def test_in_a_column_of_several_units_every_figure_has_its_own(tmp_path: Path) -> None:
    figures = CONTENT["figures"] | {
        "theirs/wall/time": {"value": 2, "low": None, "high": None, "cases": 3, "unit": "count"}
    }
    text = render(f"{TABLE}<!-- /table -->", brushes(tmp_path, figures=figures), {})
    assert "| ours | wall | 4 | 3.25 [3.0, 3.5] s |" in text
    assert "| theirs | wall | 3 | 2 of 3 |" in text


def test_on_the_page_of_the_experiment_the_origin_is_said_once(tmp_path: Path) -> None:
    text = render(f"<!-- about brushes -->\n<!-- /about -->\n{TABLE}<!-- /table -->", brushes(tmp_path), {})
    assert text.startswith("<!-- about brushes -->\n**What this does not show.** More than 3.25 says.\n")
    assert text.count("the paint") == 1


@pytest.mark.parametrize(
    ("spec", "shown"),
    [
        ("brushes:ours/wall/time", "3.25 s [3.0, 3.5]"),
        ("brushes:ours/wall/time bare", "3.25"),
        ("brushes:ours/wall/time .1", "3.2 s [3.0, 3.5]"),
        ("brushes:ours/fence/time cases", "12 s (2 cases; interval not measured)"),
    ],
)
def test_a_figure_in_a_line(tmp_path: Path, spec: str, shown: str) -> None:
    assert (
        render(f"takes <!--f {spec}-->?<!--/f-->.", brushes(tmp_path), {}) == f"takes <!--f {spec}-->{shown}<!--/f-->."
    )


def test_headlines_link_the_page_and_say_what_was_simulated_once(tmp_path: Path) -> None:
    spec = '"wall" = ["brushes", "ours/wall/time", "theirs/wall/time"]\n"fence" = ["brushes", "ours/fence/time"]\n'
    text = render(f"<!-- headlines\n{spec}-->\n<!-- /headlines -->", brushes(tmp_path), {"brushes": "b.md"})
    assert (
        "| [wall](b.md) [s] | 3.25 [3.0, 3.5] | theirs 8.50 (interval not measured) | 4 cases | the paint; the wall"
        in text
    )
    assert "| [fence](b.md) [s] | 12 (interval not measured) | – | 2 cases | ″ | 2026-01-02 |" in text


def test_headlines_for_one_screen_say_it_in_few_words(tmp_path: Path) -> None:
    spec = (
        '"wall" = { figures = ["brushes", "ours/wall/time", "theirs/wall/time"], simulated = "paint", rival = "B" }\n'
        '"fence" = { figures = ["brushes", "ours/fence/time"], simulated = "″" }\n'
    )
    text = render(f"<!-- headlines\n{spec}-->\n<!-- /headlines -->", brushes(tmp_path), {"brushes": "b.md"})
    assert "| figure | ours | beside it | cases | simulated | measured |" in text
    assert "| [wall](b.md) [s] | 3.25 [3.0, 3.5] | B 8.50 [–] | 4 cases | paint | 2026-01-02 |" in text
    assert "| [fence](b.md) [s] | 12 [–] | – | 2 cases | ″ | 2026-01-02 |" in text


def test_the_index_of_results_is_one_screen() -> None:
    table = re.search(r"^\| figure .*?(?=<!-- /headlines)", (RESULTS / "index.md").read_text(), re.M | re.S)
    assert table is not None
    rows = table[0].splitlines()[2:]
    assert len(rows) <= 24, "one row a system, so that all stand on one screen"
    assert max(len(re.sub(r"\]\([^)]*\)", "]", row)) for row in rows) <= 160, "a row is one line"


@pytest.mark.parametrize(
    "text",
    [
        "<!--f brushes:ours/roof/time-->3<!--/f-->",
        "<!--f combs:ours/wall/time-->3<!--/f-->",
        "<!-- table brushes\nrows = ['ours/roof']\ncolumns = ['time']\n-->\n<!-- /table -->",
        "<!-- table brushes\nrows = ['*/wall']\ncolumns = ['price']\n-->\n<!-- /table -->",
        "<!-- table brushes\nrow = ['*/wall']\ncolumns = ['time']\n-->\n<!-- /table -->",
        "<!-- table brushes\nlabels = ['arm']\nrows = ['*/wall']\ncolumns = ['time']\n-->\n<!-- /table -->",
        "<!-- about combs -->\n<!-- /about -->",
    ],
)
def test_a_marker_of_what_is_not_there_is_an_error(tmp_path: Path, text: str) -> None:
    with pytest.raises(FiguresError):
        render(text, brushes(tmp_path), {})


@pytest.mark.parametrize(
    "changes",
    [
        {"does_not_show": ""},
        {"experiment": "combs"},
        {"figures": {"ours/time": {"value": 1, "low": None, "high": None, "cases": None, "unit": ""}}},
        {"figures": {"ours/wall/time": {"value": 1, "low": 0, "high": None, "cases": None, "unit": ""}}},
        {"figures": {"ours/wall/time": {"value": 1}}},
    ],
)
def test_a_file_of_another_form_is_refused(tmp_path: Path, changes: dict[str, object]) -> None:
    with pytest.raises(FiguresError, match=r"brushes\.json"):
        brushes(tmp_path, **changes)


@pytest.mark.parametrize(
    "text",
    ["it reads 76.0 here", "about 0.96.", "88 % of them", "11 of 23 found", "in 34 ms", "3 times faster", "5 mm off"],
)
def test_measured_figures_are_recognised(text: str) -> None:
    assert list(unmarked(text))


@pytest.mark.parametrize(
    "text",
    [
        "twenty rooms, seeds 1000 to 1019",
        "`--voxel-size 0.02`",
        "```\nmake x VOXEL=0.02\n```",
        "table 7.1 and 7.2, section 2.4",
        "<!--given aim-->85 %<!--/given-->",
        "<!--f a:b/c/d-->85 %<!--/f-->",
        "[page](results/v1.2.md)",
    ],
)
def test_the_rest_is_left_alone(text: str) -> None:
    assert list(unmarked(text)) == []
