"""Files from outside come in by one door (schemas/outside.py); whoever reads without it is listed, with a reason."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
FOLDERS = ("cli", "stages", "schemas")
DOOR = "schemas/outside.py"
NAMES = {
    "open",
    "os.open",
    "os.fdopen",
    "json.load",
    "json.loads",
    "tomllib.load",
    "tomllib.loads",
    "csv.reader",
    "csv.DictReader",
    "Image.open",
    "cv2.imread",
    "sqlite3.connect",
    "zipfile.ZipFile",
    "ElementTree.parse",
    "ElementTree.fromstring",
    "ET.parse",
    "ET.fromstring",
    "np.fromfile",
    "np.loadtxt",
    "np.genfromtxt",
    "np.memmap",
    "onnxruntime.InferenceSession",
    "o3d.io.read_triangle_mesh",
    "trimesh.load",
    "linecache.getlines",
}
METHODS = {"open", "read_text", "read_bytes", "model_validate_json", "parse_raw"}
"""Of paths, archives and models, whatever they are called."""
LAST_WORDS = {name.split(".")[-1] for name in NAMES} | METHODS
WORTH_PARSING = re.compile(rf"\b(?:{'|'.join(LAST_WORDS)})\s*\(")
"""What a file without any of it need not be parsed for."""

OURS = "a file of this repository, or of an installed package"
WRITES = "flushes, locks or appends to what this process writes"
KERNEL = "the kernel's own"
PARSED = "parses bytes that the door, or a message of bounded size, gave"
WITHIN = "an entry of an archive, whose size is checked"
PARENT = "what the process that started this one asks"
MADE = "what this process, or a child of it, has just written"
BOUNDED = "a container read piece by piece, regular files only, with bounds of its own"
PICTURE = "a picture whose size is looked at before it is decoded"
DEVICE = "the null device"
CACHE = "what this program keeps for itself; what cannot be read is asked for anew"
WORLD = "no file: a method of this name, of a simulator or a format"
SERVICE = "a message of a service, cut at the largest body"

TAUGHT = "what the maker of a training's data has written"

WITHOUT_THE_DOOR: dict[str, dict[str, str]] = {
    "cli/streams.py": {"os.open": DEVICE},
    "cli/viewing/desk/desk.py": {"read_text": OURS},
    "cli/viewing/desk/server.py": {"model_validate_json": PARSED},
    "stages/kit/viewing/page/library.py": {"open": OURS, "zipfile.ZipFile": OURS},
    "stages/kit/viewing/page/page_canvas.py": {"read_text": OURS},
    "schemas/base.py": {"model_validate_json": PARSED},
    "schemas/plugins.py": {"open": OURS},
    "stages/disparity/training/raft_stereo/kept_pairs.py": {"cv2.imread": TAUGHT},
    "stages/engine/code/digests.py": {"json.loads": CACHE, "read_text": CACHE},
    "stages/engine/code/program.py": {"read_text": OURS},
    "stages/ingest/layouts/record3d/recording.py": {"zipfile.ZipFile": BOUNDED},
    "stages/kit/compiled.py": {"read_bytes": OURS},
    "stages/kit/exports.py": {"read_text": OURS},
    "stages/kit/formats/mosd_frames.py": {"cv2.imread": PICTURE},
    "stages/kit/training/run.py": {"json.loads": MADE, "read_text": MADE},
    "stages/segment/networks/metadata.py": {"zipfile.ZipFile": PARSED},
    "stages/segment/training/network/samples.py": {"json.loads": TAUGHT, "read_text": TAUGHT},
    "stages/splat/training/word_probabilities/asked_places.py": {"json.loads": TAUGHT, "read_text": TAUGHT},
    "stages/splat/training/words/lexicon.py": {"read_text": OURS, "tomllib.loads": OURS},
    "stages/suture/training/needle_evidence/train.py": {"json.loads": TAUGHT, "read_text": TAUGHT},
    "stages/suture/training/network/train.py": {"read_bytes": MADE},
    "stages/suture/training/network/views.py": {"cv2.imread": TAUGHT},
    "schemas/vocabulary.py": {"open": OURS, "tomllib.load": OURS},
    "stages/cutting/recording/server.py": {"model_validate_json": PARSED, "read_bytes": OURS},
    "stages/predicates/teacher/terminal.py": {"model_validate_json": PARSED},
    "stages/edit/edits_file.py": {"os.open": WRITES, "tomllib.loads": PARSED},
    "stages/engine/batch/folder_lock.py": {"os.open": WRITES},
    "stages/engine/batch/processes.py": {"open": KERNEL},
    "stages/engine/batch/ray_executor.py": {"model_validate_json": PARSED},
    "stages/engine/batch/results.py": {"model_validate_json": PARSED, "os.open": WRITES},
    "stages/engine/batch/scene_log.py": {"open": MADE},
    "stages/engine/batch/scene_run.py": {"os.open": WRITES},
    "stages/engine/batch/storage.py": {"model_validate_json": SERVICE},
    "stages/engine/batch/warm.py": {"json.loads": MADE},
    "stages/engine/batch/warm_worker.py": {"json.loads": PARENT},
    "stages/engine/chain.py": {"json.loads": MADE},
    "stages/engine/collection.py": {"os.open": WRITES},
    "stages/engine/forking.py": {"open": MADE, "os.open": DEVICE, "os.fdopen": MADE},
    "stages/engine/keys.py": {"json.loads": MADE},
    "stages/engine/known_models.py": {"open": OURS, "tomllib.load": OURS},
    "stages/engine/memory_limit.py": {"read_text": KERNEL},
    "stages/engine/model_cache.py": {"open": WRITES},
    "stages/engine/store.py": {"open": WRITES, "os.open": WRITES},
    "stages/fuse/annotated_scan.py": {"json.loads": PARSED},
    "stages/ingest/folders/calibration_files.py": {"json.loads": PARSED},
    "stages/ingest/layouts/colmap/model.py": {"np.memmap": BOUNDED},
    "stages/ingest/messages/json_messages.py": {"json.loads": PARSED},
    "stages/ingest/messages/log_file.py": {"os.open": BOUNDED},
    "stages/ingest/messages/rosbag2_container.py": {"open": BOUNDED},
    "stages/ingest/messages/sqlite_container.py": {"sqlite3.connect": BOUNDED, "open": BOUNDED},
    "stages/ingest/preflight/page.py": {"read_text": OURS},
    "stages/kit/formats/masks.py": {"zipfile.ZipFile": PARSED},
    "stages/kit/formats/mesh_files.py": {"trimesh.load": PARSED, "json.loads": PARSED},
    "stages/kit/formats/numpy_files.py": {"zipfile.ZipFile": PARSED, "open": WITHIN},
    "stages/kit/formats/xml_files.py": {"ElementTree.fromstring": PARSED},
    "stages/kit/language/openai_compatible.py": {"json.loads": SERVICE},
    "stages/kit/language/reply_schema.py": {"model_validate_json": PARSED},
    "stages/kit/language/transcripts.py": {"model_validate_json": PARSED, "open": WRITES},
    "stages/kit/services/connection.py": {"json.loads": SERVICE},
    "stages/kit/services/segmentation_protocol.py": {"json.loads": SERVICE},
    "stages/kit/simulation/robot_description.py": {"ElementTree.fromstring": PARSED},
    "stages/kit/simulation/shapes.py": {"ElementTree.fromstring": PARSED},
    "stages/kit/simulation/urdf_split.py": {"ElementTree.fromstring": PARSED},
    "stages/kit/tasks/fast_downward.py": {"read_text": MADE},
    "stages/library/importing/classes.py": {"tomllib.loads": OURS, "read_text": OURS},
    "stages/library/importing/loose_models.py": {"csv.reader": PARSED},
    "stages/library/importing/urdf_models.py": {"json.loads": PARSED},
    "stages/pack/language_reading.py": {"json.loads": PARSED},
    "stages/plan/correspondence.py": {"ElementTree.fromstring": PARSED},
    "stages/plan/joined_bodies.py": {"ElementTree.fromstring": PARSED},
    "stages/plan/scaled_body.py": {"ElementTree.fromstring": PARSED},
    "stages/report/figures.py": {"csv.reader": PARSED},
    "stages/report/graph_drawing.py": {"csv.DictReader": PARSED},
    "stages/report/images.py": {"Image.open": PICTURE},
    "stages/report/page.py": {"read_text": OURS},
    "stages/segment/backends/masks/backend.py": {"open": WORLD},
    "stages/segment/backends/masks/formats/npz_stacks.py": {"zipfile.ZipFile": PARSED},
    "stages/segment/backends/masks/images.py": {"Image.open": PICTURE},
    "stages/segment/backends/masks/listing.py": {"json.loads": PARSED},
    "stages/segment/backends/network/weights.py": {"json.loads": PARSED},
    "stages/segment/backends/service/reply_cache.py": {"read_bytes": CACHE},
    "stages/kit/open_words/reading/nouns.py": {"open": OURS},
    "stages/kit/open_words/embedded.py": {"json.loads": PARSED},
    "stages/splat/asked_file.py": {"model_validate_json": PARSED},
    "stages/splat/checkpoints.py": {"json.loads": PARSED},
    "stages/splat/triangulation.py": {"open": MADE},
    "stages/suture/segmentation/checkpoint.py": {"json.loads": PARSED},
    "stages/suture/truth_files.py": {"cv2.imread": PICTURE},
    "stages/synthesize/recipes.py": {"open": OURS, "tomllib.load": OURS},
    "stages/tableware/scene_files.py": {"Image.open": PICTURE},
    "stages/tableware/simulate_stage.py": {"open": WORLD},
    "stages/tableware/vision/image_files.py": {"cv2.imread": PICTURE},
    "stages/truth/stage.py": {"tomllib.loads": OURS, "read_text": OURS},
}
"""File -> call -> reason."""


def reads(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield (line, what is called) of everything that may read a file or parse what one said."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        method = node.func.attr if isinstance(node.func, ast.Attribute) else ""
        if (method or getattr(node.func, "id", "")) not in LAST_WORDS:
            continue
        name = ast.unparse(node.func)
        if name not in NAMES and method not in METHODS:
            continue
        modes = [
            word.value for word in (*node.args, *(k.value for k in node.keywords)) if isinstance(word, ast.Constant)
        ]
        if any(mode in ("w", "wb", "a", "ab", "x", "xb") for mode in modes):
            continue
        yield node.lineno, name if name in NAMES else method


def found_reads() -> dict[str, dict[str, int]]:
    """Return file -> call -> first line, over the whole program."""
    found: dict[str, dict[str, int]] = defaultdict(dict)
    for folder in FOLDERS:
        for path in sorted((REPOSITORY / folder).rglob("*.py")):
            text = path.read_text()
            for line, what in reads(ast.parse(text)) if WORTH_PARSING.search(text) else ():
                found[path.relative_to(REPOSITORY).as_posix()].setdefault(what, line)
    found.pop(DOOR)
    return dict(found)


def test_whoever_reads_without_the_door_is_listed() -> None:
    found = {(file, what): line for file, calls in found_reads().items() for what, line in calls.items()}
    listed = {(file, what) for file, calls in WITHOUT_THE_DOOR.items() for what in calls}
    assert [f"{file}:{found[file, what]}: {what}" for file, what in sorted(found.keys() - listed)] == []
    assert sorted(listed - found.keys()) == []  # what is no longer there


def test_the_check_finds_reading_and_leaves_writing_alone() -> None:
    for code in (
        "open(p)",
        "open(p, 'rb')",
        "path.open()",
        "path.open('rb')",
        "p.read_text()",
        "p.read_bytes()",
        "tomllib.load(f)",
        "tomllib.loads(t)",
        "json.loads(t)",
        "os.open(p, os.O_RDONLY)",
        "zipfile.ZipFile(p)",
        "cv2.imread(p)",
        "Image.open(p)",
        "Model.model_validate_json(t)",
        "csv.reader(f)",
    ):
        assert WORTH_PARSING.search(code) and list(reads(ast.parse(code))), code
    for code in ("open(p, 'w')", "path.open('wb')", "path.open(mode='a')", "json.dumps(x)", "file_content(p, 9)"):
        assert not list(reads(ast.parse(code))), code
