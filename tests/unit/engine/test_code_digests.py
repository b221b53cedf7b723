"""The digest of a step's code: kept until a file or folder changes, the same wherever the code lies."""

from __future__ import annotations

import importlib
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from scenewright.schemas.errors import MachineFailure
from scenewright.stages.engine.code import digests, inherited
from scenewright.stages.engine.code.places import Places
from scenewright.stages.engine.code.program import Definition, Program
from scenewright.stages.engine.discovery import all_stages

FILES = {
    "__init__.py": "",
    "measuring.py": '"""Measures."""\nfrom toybench.core import core\nLIMIT = 3\n'
    "\ndef measure():\n    return core() + LIMIT\n\ndef table():\n    return 'a table'\n",
    "core.py": '"""A core."""\nimport pkgutil\nimport toybench.parts\n\ndef core():\n'
    "    return [entry.name for entry in pkgutil.iter_modules(toybench.parts.__path__)]\n",
    "parts/__init__.py": "",
    "parts/one.py": "VALUE = 1\n",
}


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package at the top of the path, old enough to be kept, and a cache of its own."""
    for name, text in FILES.items():
        write(tmp_path / "toybench" / name, text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(digests, "SETTLED_SECONDS", -60.0)
    forget()
    yield tmp_path / "toybench"
    forget()


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def forget() -> None:
    digests._code_of.cache_clear()
    digests._program.cache_clear()


def digest() -> str:
    """What another process would find."""
    forget()
    return digests.code_of("toybench.measuring:measure").digest


def test_only_what_is_reached_counts(package: Path) -> None:
    first = digest()
    for name, before, after, counts in (
        ("measuring.py", "a table", "another table", False),
        ("core.py", "A core.", "Words.", False),
        ("measuring.py", "LIMIT = 3", "LIMIT = 4", True),
        ("parts/one.py", "VALUE = 1", "VALUE = 2", True),
    ):
        text = (package / name).read_text()
        write(package / name, text.replace(before, after))
        assert (digest() != first) == counts, name
        write(package / name, text)
    assert digest() == first


def test_a_new_file_in_a_folder_that_is_listed_counts(package: Path) -> None:
    first = digest()
    write(package / "parts" / "two.py", "VALUE = 2\n")
    assert digest() != first


def test_what_an_installed_package_declares_counts_where_its_group_is_asked_for(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(digests, "_plugins", lambda: {"scenewright.backends": ["toyplugin.hues"]})
    write(package.parent / "toyplugin" / "__init__.py", "")
    write(package.parent / "toyplugin" / "hues.py", "from toyplugin.more import VALUE\n\nBACKEND = VALUE\n")
    write(package.parent / "toyplugin" / "more.py", "VALUE = 1\n")
    before = digest()
    write(package / "core.py", 'def core():\n    return every("scenewright.backends")\n')
    asked = digest()
    write(package.parent / "toyplugin" / "more.py", "VALUE = 2\n")
    assert len({before, asked, digest()}) == 3
    write(package.parent / "toyplugin" / "hues.py", "def broken(:\n")
    digest()


def test_a_folder_that_a_user_gives_to_a_package_of_ours_counts(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the notebook on backends does: in a process of its own, after another has kept an answer without it."""
    mine = package.parent / "mine"
    write(mine / "hues.py", "VALUE = 1\n")
    write(package / "core.py", 'def core():\n    return every("scenewright.stages.urdf.exporters")\n')
    import scenewright.stages.urdf.exporters as ours

    without = digest()
    monkeypatch.setattr(ours, "__path__", [*ours.__path__, str(mine)])
    assert digests.code_of("toybench.measuring:measure").digest != without, "within one process too"
    first = digest()
    write(mine / "hues.py", "VALUE = 2\n")
    assert len({without, first, digest()}) == 3


def test_what_was_read_is_kept_and_not_read_again(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = digest()

    def refuse(*given: object) -> None:
        raise AssertionError("it was read again")

    with monkeypatch.context() as patch:
        patch.setattr(digests, "Program", refuse)
        (package / "parts" / "__pycache__").mkdir()
        assert digest() == first, "a folder of compiled code is no module"
        os.utime(package / "core.py", ns=(1, 1))
        with pytest.raises(AssertionError, match="again"):
            digest()
    assert digest() == first


def test_a_cache_that_cannot_be_written_or_read_is_done_without(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = digest()
    for file in (package.parent / "cache").rglob("*.json"):
        file.write_text('{"roots": 3')
    assert digest() == first
    (package.parent / "no folder").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(package.parent / "no folder"))
    assert digest() == first


def test_a_file_that_was_just_written_is_not_kept(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(digests, "SETTLED_SECONDS", 60.0)
    digest()
    assert not list((package.parent / "cache").rglob("*.json"))


def test_few_trees_are_kept(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    digest()
    folder = package.parent / "cache" / "scenewright" / "code"
    for number in range(digests.MOST_TREES):
        write(folder / f"tree{number}" / "a.json", "{}")
        os.utime(folder / f"tree{number}", (number, number))
    write(package / "core.py", FILES["core.py"].replace("entry.name", "entry"))
    digest()
    assert len(list(folder.iterdir())) == digests.MOST_TREES and not (folder / "tree0").exists()


def test_the_prefix_of_our_packages_does_not_count(tmp_path: Path) -> None:
    """Texts that begin the name of a module are the same before and after the packages moved below scenewright."""
    texts = []
    for name, prefix in (("a", "scenewright."), ("b", "")):
        write(tmp_path / name / "__init__.py", "")
        text = f"import importlib\n\ndef run(part):\n    return importlib.import_module(f'{prefix}stages.x.{{part}}')\n"
        write(tmp_path / name / "step.py", text)
        program = Program(Places({"scenewright": [tmp_path / name]}))
        texts.append(program.code_of([Definition("scenewright.step", "run")]).digest)
    assert texts[0] == texts[1]


def test_every_step_has_code_and_no_two_the_same() -> None:
    found = {name: digests.step_code(stage).digest for name, stage in all_stages().items()}
    assert len(set(found.values())) == len(found)


def test_changed_modules_are_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    stage = all_stages()["truth edited"]
    forget()
    code = digests.step_code(stage)
    kept = digests._kept(digests._question(digests._roots_of(stage), (), digests.added_folders()))
    if not kept:
        pytest.skip("the checkout is a moment old")
    name = sorted(code.modules)[-1]
    earlier = {"before": {**code.modules, name: "other"}, "moved": {f"{n}_moved": d for n, d in code.modules.items()}}
    monkeypatch.setattr(digests, "_kept", lambda question: {**kept, "earlier": earlier})
    assert digests.changed_modules(stage, "before") == [name]
    assert digests.changed_modules(stage, "moved") == []
    assert digests.changed_modules(stage, "never seen") == []


def test_a_fork_that_holds_older_code_refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "held.py", "")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.import_module("held")
    monkeypatch.setattr(inherited, "_modules", frozenset({"held"}))
    os.utime(tmp_path / "held.py", (1, 1))
    inherited.refuse_edited(["held", "other"])
    os.utime(tmp_path / "held.py", (time.time() + 1, time.time() + 1))
    with pytest.raises(MachineFailure, match="was edited"):
        inherited.refuse_edited(["held"])
    del sys.modules["held"]
