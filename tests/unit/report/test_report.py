"""The report page: self-contained, escaped, complete, and there when parts are missing."""

from __future__ import annotations

import base64
import html
import io
import json
import os
import re
import time
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.evaluation import Evaluation, MetricsFile, Report
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.manifest import InputRecord, Manifest, Provenance
from scenewright.schemas.segments import Segments
from scenewright.stages.kit.explaining.sources import sentences, sources_of
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.report.figures import metric_groups
from scenewright.stages.report.graph_drawing import draw_graph
from scenewright.stages.report.images import from_file
from scenewright.stages.report.parameters import ReportParameters, check_inputs
from scenewright.stages.report.provenance import made_of
from scenewright.stages.report.stage import run
from scenewright.stages.report.surfaces import map_model
from scenewright.stages.report.views import bounds_of, cut_away, oblique_view, place_labels, render, top_view

from tests.browser import ELEMENT, WEBGL, browser, needs_browser
from tests.unit.evaluate.handmade import (
    LABEL,
    ROOM,
    graph_of,
    make_cad_scene,
    make_graph,
    make_ground_truth,
    make_interactive_scene,
    make_map,
    make_plan,
    make_segments,
    make_sequence,
)

SMALL = ReportParameters(frames=2, frame_width=120, view_width=240)
HOSTILE = '<script>alert("x")</script><img src=//evil.example onerror=a>'


class Tags(HTMLParser):
    """Collects start tags, checks that they are closed in order, and keeps the text."""

    VOID = {"meta", "img", "br", "input", "circle", "rect", "path"}

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""

    def handle_starttag(self, tag, attributes):
        self.seen.append((tag, dict(attributes)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.seen.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        if tag in self.VOID:
            return
        assert self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-3:]}"
        self.open.pop()

    def handle_data(self, data):
        self.text += data


def parse(page: str) -> Tags:
    tags = Tags()
    tags.feed(page)
    assert tags.open == []
    return tags


def report(out: Path, parameters: ReportParameters = SMALL, **inputs) -> Report:
    out.mkdir()
    context = Context(output=out, seed=0, device="cpu", progress=SilentProgress())
    return run(**inputs, parameters=parameters, context=context)


def make_evaluation(root: Path, label: str = LABEL, **metrics: float | None) -> Evaluation:
    (root / "tables").mkdir(parents=True)
    (root / "plots").mkdir()
    named = {name.replace("__", "/"): value for name, value in metrics.items()}
    MetricsFile(label=label, metrics=named, notes=("a note",)).write(root / "metrics.json")
    (root / "tables" / "t.csv").write_text("class,PQ\nchair,0.123456\n")
    (root / "tables" / "t.md").write_text("### A fine table\n")
    Image.new("RGB", (80, 40), (200, 30, 30)).save(root / "plots" / "p.png")
    return Evaluation(root)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> tuple[Path, Report]:
    """Everything in one report."""
    folder = tmp_path_factory.mktemp("run")
    evaluation = make_evaluation(
        folder / "evaluation",
        map__pq=0.623,
        graph__edit_distance=2.0,
        cad__box_iou_mean=0.5,
        cad__box_iou_mean_low=0.4,
        cad__box_iou_mean_high=0.6,
    )
    (evaluation.root / "tables" / "graph_edit_distance.csv").write_text(
        "error,cost,true,predicted,true parent,predicted parent\nwrong support,2,cup_4,cup_4,desk_9,table_3\n"
        "missing detection,1,sofa_8,,floor_1,\n"
    )
    made = report(
        folder / "report",
        ground_truth=make_ground_truth(folder / "truth"),
        sequence=make_sequence(folder / "sequence"),
        segments=make_segments(folder / "segments"),
        panoptic_map=make_map(folder / "map"),
        contact_graph=make_graph(folder / "graph", graph_of(ROOM)),
        cad_scene=cad_without_models(folder / "cad"),
        interactive_scene=make_interactive_scene(folder / "scene"),
        plan=make_plan(folder / "plan"),
        evaluation=evaluation,
        baseline_evaluation=make_evaluation(folder / "baseline", label="geometric segments", map__pq=0.101),
    )
    return folder, made


def cad_without_models(root: Path):
    """A CAD scene of layout and kept meshes alone."""
    scene = make_cad_scene(root)
    kept = tuple(
        r.model_copy(update={"decision": "mesh", "chosen": None, "reason": "nothing fits"}) if r.chosen else r
        for r in scene.info.replacements
    )
    scene.info.model_copy(update={"replacements": kept}).write(root / "scene.json")
    for thing in ROOM:
        if thing.node_type != "layout":
            thing.mesh().export(root / "meshes" / f"{thing.name}.ply")
    return scene


def test_every_section_is_there_and_the_page_is_sound(whole):
    folder, made = whole
    page = (folder / "report" / "report.html").read_text()
    tags = parse(page)
    ids = {attributes.get("id") for tag, attributes in tags.seen if tag == "section"}
    assert ids == {
        "outlook",
        "walk",
        "frames",
        "map",
        "graph",
        "cad",
        "scene",
        "plan",
        "figures",
        "cost",
        "made",
        "why",
    }
    links = {attributes["href"] for tag, attributes in tags.seen if tag == "a" and attributes["href"].startswith("#")}
    assert links == {f"#{name}" for name in ids}
    for text in (
        "62.3 %",
        "10.1 %",
        "40.0 % to 60.0 %",
        "geometric segments",
        "cup_4",
        "Missing altogether: sofa_8",
        "A fine table",
        "0.123",
        "on(cup_4, table_3)",
        "first base pose blocked",
        "a note",
        "hinge 0° to 92°",
        "in cabinet_6",
    ):
        assert text in tags.text, text
    assert made.summary["sections"] == 12  # the outlook first
    assert Report(folder / "report").json_files["report.json"].read(folder / "report" / "report.json").sections


def test_reasons_of_every_entity_are_those_of_explain(whole):
    folder, _ = whole
    page = (folder / "report" / "report.html").read_text()
    section = re.search(r'<section id="why">(.*?)</section>', page, re.S)[1]
    said = {
        name: re.findall(r"<li>(.*?)</li>", rows, re.S)
        for name, rows in re.findall(r"<details><summary>(\S+) <small>.*?<ul>(.*?)</ul></details>", section, re.S)
    }
    assert set(said) >= {thing.name for thing in ROOM}
    told = sentences(sources_of([InteractiveScene(folder / "scene")]))
    for name, sentences_of_scene in told.items():
        if name in said:
            assert set(map(html.escape, sentences_of_scene)) <= set(said[name]), name
    assert any(reason.startswith("It stands on table_3, with confidence") for reason in said["cup_4"])
    assert "No model stands for it, its own mesh stays: nothing fits." in said["cup_4"]
    frame = next(attributes for tag, attributes in parse(page).seen if tag == "iframe")
    drawn = json.loads(re.search(r'<script id="document"[^>]*>(.*?)</script>', frame["srcdoc"], re.S)[1])
    assert len(drawn["because"]["cup_4"]) == len(said["cup_4"])


def test_the_mask_label_stands_beside_every_figure(whole):
    folder, _ = whole
    page = (folder / "report" / "report.html").read_text()
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", page, re.S)
    unlabelled = [c for c in captions if LABEL not in c]
    assert len(captions) > 8
    assert unlabelled == ["The true room from the same place.", "1. pick"]


def test_nothing_is_loaded_from_anywhere(whole):
    folder, _ = whole
    page = without_walk((folder / "report" / "report.html").read_text())
    without_pictures = re.sub(r"data:image/(png|jpeg);base64,[A-Za-z0-9+/=]+", "DATA", page)
    assert "http" not in without_pictures.replace("http-equiv", "")
    assert not re.search(r"""(src|href)\s*=\s*["']?(//|[a-z]+:)""", without_pictures)
    assert "url(" not in without_pictures and "@import" not in without_pictures and "<script" not in without_pictures
    tags = parse(page)
    for tag, attributes in tags.seen:
        if tag == "img":
            assert attributes["src"].startswith("data:image/")
            assert attributes["alt"]
        assert not any(name.startswith("on") for name in attributes)
    assert "default-src 'none'" in page
    assert str(folder) not in page


def without_walk(page: str) -> str:
    """The report without the page that stands in it, which has tests of its own."""
    return re.sub(r' srcdoc="[^"]*"', "", page)


def test_the_page_that_stands_in_the_report_runs_alone(whole):
    folder, _ = whole
    page = (folder / "report" / "report.html").read_text()
    (frame,) = [attributes for tag, attributes in parse(page).seen if tag == "iframe"]
    assert frame["sandbox"] == "allow-scripts" and "<script" not in page
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1]
    inner = re.search(r'Content-Security-Policy" content="([^"]*)"', frame["srcdoc"])[1]
    digests = re.findall(r"'sha256-[^']+'", inner)
    assert len(digests) == 2 and all(digest in policy for digest in digests) and "unsafe-inline' 'sha" not in policy
    drawn = json.loads(re.search(r'<script id="document"[^>]*>(.*?)</script>', frame["srcdoc"], re.S)[1])
    paths = {item["path"] for item in drawn["meshes"]}
    assert {"color", "instance", "class", "trust"} <= paths and 0 <= drawn["trust"]["cup_4"]["share"] <= 1
    assert drawn["views"][0]["name"] == "scan" and "scene" in drawn["views"][0]["hidden"]
    assert drawn["graph"]["names"] and drawn["boxes"]
    assert len(page) < 15_000_000


@needs_browser
def test_the_report_can_be_walked_into(whole):
    folder, _ = whole
    with browser(*WEBGL) as window:
        window.open((folder / "report" / "report.html").as_uri() + "#walk")
        window.run("document.querySelector('iframe.walk').scrollIntoView()")
        window.ask("POST", "/frame", {"id": {ELEMENT: window.find("iframe.walk")}})
        deadline = time.monotonic() + 60
        while not window.run("return document.body && document.body.dataset.ready && document.body.dataset.drawn"):
            assert time.monotonic() < deadline
            time.sleep(0.1)
        assert window.text("#name") == "The room"
        window.press("#trust")
        assert window.run("return document.querySelectorAll('#trusted .node').length") > 3
        assert window.complaints() == []


def test_pictures_decode_to_their_stated_size(whole):
    folder, _ = whole
    page = without_walk((folder / "report" / "report.html").read_text())
    pattern = r'<img class="\w+" src="data:image/(\w+);base64,([^"]+)" width="(\d+)" height="(\d+)"'
    pictures = re.findall(pattern, page)
    assert len(pictures) == page.count("data:image/") >= 15
    for kind, text, width, height in pictures:
        image = Image.open(io.BytesIO(base64.b64decode(text)))
        assert (image.format.lower(), image.size) == (kind, (int(width), int(height)))


def test_hostile_names_are_text(tmp_path):
    graph = graph_of(ROOM)
    nodes = tuple(n.model_copy(update={"class_name": HOSTILE}) if n.id == "cup_4" else n for n in graph.nodes)
    graph = graph.model_copy(update={"nodes": nodes})
    sequence = make_sequence(tmp_path / "sequence")
    sequence.info.model_copy(update={"source_format": HOSTILE}).write(tmp_path / "sequence" / "sequence.json")
    report(
        tmp_path / "report",
        SMALL.model_copy(update={"title": HOSTILE}),
        sequence=sequence,
        segments=make_segments(tmp_path / "segments", label=HOSTILE),
        contact_graph=make_graph(tmp_path / "graph", graph),
        plan=make_plan(tmp_path / "plan", detail=HOSTILE),
        evaluation=make_evaluation(tmp_path / "evaluation", label=HOSTILE, map__pq=0.5),
    )
    page = (tmp_path / "report" / "report.html").read_text()
    tags = parse(page)
    assert "<script" not in page
    assert all("evil" not in str(attributes.get("src")) for _, attributes in tags.seen)
    assert not any("onerror" in attributes for _, attributes in tags.seen)
    assert tags.text.count(HOSTILE) >= 6


def test_parts_that_are_missing_have_no_section(tmp_path):
    made = report(tmp_path / "report", sequence=make_sequence(tmp_path / "sequence"))
    ids = {a.get("id") for tag, a in parse((made.root / "report.html").read_text()).seen if tag == "section"}
    assert ids == {"frames", "cost", "made"}
    assert "came without manifests" in (made.root / "report.html").read_text()


def test_frames_without_segments_have_no_picture_of_them(tmp_path):
    sequence, segments = make_sequence(tmp_path / "sequence"), make_segments(tmp_path / "segments")
    with_segments = report(tmp_path / "with", sequence=sequence, segments=segments)
    file = segments.root / "segments.json"
    told = json.loads(file.read_text())
    told["frames"] = [entry | {"segments": []} for entry in told["frames"]]
    file.write_text(json.dumps(told))
    without = report(tmp_path / "without", sequence=sequence, segments=Segments(segments.root))
    assert 0 < without.summary["pictures"] < with_segments.summary["pictures"]
    text = parse((without.root / "report.html").read_text()).text
    assert "blue far)." in text and "blue far), segments." not in text


def test_an_empty_map_and_graph_are_reported(tmp_path):
    made = report(
        tmp_path / "report",
        panoptic_map=make_map(tmp_path / "map", ()),
        contact_graph=make_graph(tmp_path / "graph", graph_of(())),
    )
    page = parse((made.root / "report.html").read_text())
    assert "0 entities in a map" in page.text
    assert "relations: none" in page.text


def manifest(command: tuple[str, ...] = ("scenewright", "ingest", "--log", "a b")) -> Manifest:
    return Manifest(
        kind="sequence",
        schema_version=1,
        stage="ingest",
        key="k" * 64,
        content_digest="d" * 64,
        files=(),
        inputs=(InputRecord(role="log", kind="external", digest="e", path="../log"),),
        seed=5,
        parameters={"every": 2},
        libraries={"numpy": "2.4.6"},
        outcome="ok",
        summary={"frames": 6},
        provenance=Provenance(
            command=command,
            git_commit="c0ffee" * 7,
            git_dirty=True,
            platform="Linux",
            python="3.11",
            seconds=12.5,
            peak_memory_bytes=512_000_000,
        ),
    )


def test_times_and_commands_come_from_the_manifests(tmp_path):
    sequence = make_sequence(tmp_path / "sequence")
    sequence = type(sequence)(sequence.root, manifest=manifest())
    made = report(tmp_path / "report", sequence=sequence)
    page = parse((made.root / "report.html").read_text())
    for text in (
        "12.5 s",
        "512 MB",
        "ingest, code unknown",
        "scenewright ingest --log 'a b'",
        "d" * 64,
        "c0ffeec0ffee with local",
        "numpy 2.4.6",
        '{"every": 2}',
        "frames.mcap",
    ):
        assert text in page.text, text
    hrefs = {a["href"] for tag, a in page.seen if tag == "a"}
    assert "../sequence/frames.mcap" in hrefs


def test_folders_of_this_machine_do_not_get_into_the_page(tmp_path):
    sequence = make_sequence(tmp_path / "sequence")
    command = ("/home/someone/secret/place/cli/__main__.py", "ingest", "--log", "/home/someone/secret/place/x/log")
    made = made_of({"sequence": type(sequence)(sequence.root, manifest=manifest(command))}, tmp_path / "report")[0]
    assert made.command.startswith("scenewright ingest")
    assert "someone" not in made.command


def test_a_file_whose_name_is_no_utf8_is_shown_and_linked_by_its_bytes(tmp_path):
    sequence = make_sequence(tmp_path / "sequence")
    with open(os.fsencode(tmp_path / "sequence") + b"/odd\xff.txt", "w") as file:
        file.write("x")
    (made,) = made_of({"sequence": type(sequence)(sequence.root, manifest=manifest())}, tmp_path / "report")
    assert ("odd\\xff.txt", "../sequence/odd%FF.txt") in {(entry.name, entry.link) for entry in made.files}


def test_nothing_to_report_is_a_usage_error():
    with pytest.raises(UsageError, match="nothing to report"):
        check_inputs(SMALL, {})


def test_a_broken_picture_is_bad_input(tmp_path):
    (tmp_path / "x.png").write_bytes(b"\x89PNG\r\n\x1a\nnothing")
    with pytest.raises(BadInput, match=r"x\.png"):
        from_file(tmp_path / "x.png", "x", 100)


def test_near_walls_are_cut_away_and_things_are_not(tmp_path):
    model = map_model(make_map(tmp_path / "map"))
    bounds = bounds_of(model)
    behind = cut_away(model, np.array([0.0, 9.0, 4.0]), bounds)
    in_front = cut_away(model, np.array([0.0, -9.0, 4.0]), bounds)
    assert np.count_nonzero(in_front.instance == 2) > 0
    assert np.count_nonzero(behind.instance == 2) < np.count_nonzero(in_front.instance == 2)
    for instance in (1, 3, 4, 5, 6):
        assert np.count_nonzero(behind.instance == instance) == np.count_nonzero(model.soup.instance == instance)


def test_views_show_every_thing(tmp_path):
    model = map_model(make_map(tmp_path / "map")).by_instance()
    for view in (oblique_view(model, 320, 200), top_view(model, 320)):
        seen = set(np.unique(render(model, view).instance).tolist())
        assert {3, 4, 5, 6} <= seen
        assert np.linalg.det(view.world_from_camera[:3, :3]) == pytest.approx(1.0)


def test_labels_do_not_overlap():
    image = np.zeros((100, 300), dtype=np.int32)
    image[:, :100], image[40:60, 100:200], image[10:90, 210:300] = 1, 2, 3
    labels = place_labels(image, {1: "table 1", 2: "cup 2", 3: "chair 3"})
    assert {label.text for label in labels} == {"table 1", "cup 2", "chair 3"}
    crowded = place_labels(image, {1: "x" * 40, 2: "y" * 40, 3: "z" * 40})
    assert len(crowded) == 1
    assert all(image[label.y, label.x] for label in labels)


def test_graph_drawing_keeps_boxes_apart():
    drawn = draw_graph(graph_of(ROOM))
    boxes = [(n.x, n.y - 11, n.x + n.width, n.y + 11) for n in drawn.nodes]
    for k, a in enumerate(boxes):
        for b in boxes[k + 1 :]:
            assert not (a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3])
    assert max(b[2] for b in boxes) <= drawn.width
    assert max(b[3] for b in boxes) <= drawn.height


def test_metric_rows_pair_with_the_baseline(tmp_path):
    ours = make_evaluation(tmp_path / "a", map__pq=0.5, map__sq=None, counts__frames=10.0)
    theirs = make_evaluation(tmp_path / "b", map__sq=0.25)
    groups = dict(metric_groups(ours, theirs))
    assert [(r.name[:8], r.value, r.baseline) for r in groups["Panoptic map"]] == [
        ("Panoptic", "50.0 %", "–"),
        ("Segmenta", "–", "25.0 %"),
    ]
    assert list(groups) == ["Panoptic map", "Counts"]
