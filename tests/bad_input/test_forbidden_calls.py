"""What no file of the project may call, tests and documentation included: whatever runs or unpacks what it reads."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
FOLDERS = ("cli", "stages", "schemas", "benchmarks", "tests", "docs")
MODULES = {"pickle", "cPickle", "_pickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "tarfile", "telnetlib"}
CALLS = {
    "eval",
    "exec",
    "compile",
    "__import__",
    "os.system",
    "os.popen",
    "tempfile.mktemp",
    "yaml.load",
    "yaml.full_load",
    "yaml.unsafe_load",
    "yaml.load_all",
    "pickle.load",
    "pickle.loads",
    "pandas.read_pickle",
    "pd.read_pickle",
    "minidom.parse",
    "minidom.parseString",
}
METHODS = {"extractall", "read_pickle", "unsafe_load"}
"""Calls of these names on anything: archives are never unpacked to the paths they name."""
READERS = {
    "trimesh.load": {"stages/kit/formats/mesh_files.py"},
    "trimesh.load_mesh": set(),
    "ElementTree.parse": set(),
    "np.load": {
        "stages/segment/training/network/samples.py",
        "stages/segment/training/tabletop_pairs/train.py",
        "stages/splat/training/words/samples.py",
    },
}
"""Calls that code which reads users' files leaves to one guarded reader of ours."""

LAST_WORDS = {name.split(".")[-1] for name in {*CALLS, *READERS}} | METHODS | {"load", "YAML", "extract"}
"""Last words of every call that is looked at."""
WORTH_PARSING = re.compile(rf"\b(?:(?:{'|'.join(LAST_WORDS)})\s*\(|shell\s*=|{'|'.join(MODULES)})")
"""What a file without any of it need not be parsed for: that takes most of the time."""


def dangers(tree: ast.AST, readers: dict[str, bool]) -> Iterator[tuple[int, str]]:
    """Yield (line, what) of what is forbidden; `readers`: guarded call -> whether this file may make it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = {alias.name.split(".")[0] for alias in node.names} if isinstance(node, ast.Import) else set()
            names |= {(node.module or "").split(".")[0]} if isinstance(node, ast.ImportFrom) else set()
            for name in sorted(names & MODULES):
                yield node.lineno, f"import {name}"
        if not isinstance(node, ast.Call):
            continue
        last = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if last not in LAST_WORDS and not any(keyword.arg == "shell" for keyword in node.keywords):
            continue
        name = ast.unparse(node.func)
        keywords = {keyword.arg: ast.unparse(keyword.value) for keyword in node.keywords}
        if name in CALLS or last in METHODS:
            yield node.lineno, name
        if keywords.get("shell", "False") != "False":
            yield node.lineno, f"{name}(shell=...)"
        if name in ("np.load", "numpy.load") and keywords.get("allow_pickle") != "False":
            yield node.lineno, f"{name} without allow_pickle=False"
        if name == "torch.load" and keywords.get("weights_only") != "True":
            yield node.lineno, "torch.load without weights_only=True"
        if name in ("YAML", "ruamel.yaml.YAML") and keywords.get("typ") not in ("'safe'", "'rt'"):
            yield node.lineno, "YAML without typ='safe'"
        if name in ("pycolmap.extract", "zipfile.extract"):
            yield node.lineno, name
        if readers.get(name) is False:
            yield node.lineno, f"{name} outside of its reader"


def test_no_file_calls_what_is_forbidden() -> None:
    found, files = [], 0
    for folder in FOLDERS:
        for path in sorted((REPOSITORY / folder).rglob("*.py")):
            name = path.relative_to(REPOSITORY).as_posix()
            checked = name.startswith(("stages/", "cli/", "schemas/"))
            readers = {call: name in allowed for call, allowed in READERS.items()} if checked else {}
            files += 1
            text = path.read_text()
            if WORTH_PARSING.search(text):
                found += [f"{name}:{line}: {what}" for line, what in dangers(ast.parse(text), readers)]
    assert found == []
    assert files > 200


@pytest.mark.parametrize(
    "code",
    [
        "import pickle",
        "from pickle import loads",
        "import joblib as j",
        "eval('1')",
        "exec(x)",
        "os.system('ls')",
        "subprocess.run('ls', shell=True)",
        "np.load(p)",
        "np.load(p, allow_pickle=True)",
        "torch.load(p)",
        "torch.load(p, weights_only=False)",
        "yaml.load(f, Loader=yaml.Loader)",
        "archive.extractall(p)",
        "YAML()",
        "zipfile.ZipFile(p).extractall()",
        "trimesh.load(p)",
        "__import__('os')",
        "yaml.unsafe_load(f)",
    ],
)
def test_the_check_itself_finds_them(code: str) -> None:
    assert WORTH_PARSING.search(code)
    assert list(dangers(ast.parse(code), dict.fromkeys(READERS, False)))


@pytest.mark.parametrize(
    "code",
    [
        "np.load(p, allow_pickle=False)",
        "torch.load(p, weights_only=True)",
        "yaml.safe_load(f)",
        "YAML(typ='safe')",
        "subprocess.run(['ls'])",
        "re.compile('x')",
        "model.eval()",
        "json.loads(t)",
    ],
)
def test_the_check_leaves_the_rest_alone(code: str) -> None:
    assert not list(dangers(ast.parse(code), {}))
