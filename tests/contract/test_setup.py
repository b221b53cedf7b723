"""What stands in the way of `make setup` is said in one line, with exit code 5, before anything is installed."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PYTHON = """#!/bin/bash
case "$*" in
*version_info*) echo VERSION ;;
*ensurepip*) exit 0 ;;
*Python.h*) exit 1 ;;
"-m venv "*) mkdir -p "$3/bin" && cp "$0" "$3/bin/python" ;;
*) echo "pip: no network" >&2 && exit 1 ;;
esac
"""
TOOLS = ("bash", "sh", "dirname", "basename", "grep", "awk", "wc", "mkdir", "cp")
LIBRARIES = "libusb-1.0.so libgomp.so libGL.so libEGL.so libidn2.so"


class Machine:
    """A checkout whose only programs are these."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.programs = folder, folder / "programs"
        self.programs.mkdir()
        for name in TOOLS:
            (self.programs / name).symlink_to(shutil.which(name) or name)
        for name in ("data/setup.sh", "requirements.lock"):
            (folder / name).parent.mkdir(exist_ok=True)
            shutil.copy(REPOSITORY / name, folder / name)
        self.program("ldconfig", f"echo {LIBRARIES}")
        self.program("df", "echo; echo disk 0 0 90000000")
        self.program("id", "echo 1000")
        self.program("c++", "")
        self.python("3.11")

    def program(self, name: str, script: str, folder: Path | None = None) -> None:
        path = (folder or self.programs) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(script if script.startswith("#!") else f"#!/bin/bash\n{script}\n")
        path.chmod(0o755)

    def python(self, version: str, folder: Path | None = None, name: str = "python3") -> None:
        self.program(name, PYTHON.replace("VERSION", version), folder)

    def set_up(self, **settings: str) -> str:
        """Return what is said on the last line."""
        done = subprocess.run(
            [self.programs / "bash", "data/setup.sh", ".venv"],
            cwd=self.folder,
            env={"PATH": str(self.programs), **settings},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 5, done.stderr
        said = [line for line in done.stderr.splitlines() if line.startswith("scenewright: ")]
        assert len(said) == 1 and "Traceback" not in done.stderr, done.stderr
        return said[0]


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


def test_no_python(machine: Machine) -> None:
    machine.python("3.9")
    assert "sudo apt-get install python3 python3-venv" in machine.set_up()
    assert "python3 is no Python 3.11, 3.12 or 3.13" in machine.set_up(BASE_PYTHON="python3")


def test_no_compiler_where_one_is_needed(machine: Machine) -> None:
    machine.python("3.12")
    (machine.programs / "c++").unlink()
    assert "sudo apt-get install g++ python3-dev" in machine.set_up()


def test_no_system_libraries(machine: Machine) -> None:
    machine.program("ldconfig", "echo libGL.so.1")
    assert "sudo apt-get install libusb-1.0-0 libgomp1 libegl1 libidn2-0" in machine.set_up()


def test_an_environment_of_another_python(machine: Machine) -> None:
    machine.python("3.12", machine.folder / ".venv/bin", "python")
    assert ".venv is of Python 3.12: remove it" in machine.set_up(BASE_PYTHON="python3")
    machine.python("3.11", machine.folder / ".venv/bin", "python")
    machine.python("3.12")
    assert "pip could not install" in machine.set_up()  # used as it is, unless another is named
    machine.program("python", "exit 127", machine.folder / ".venv/bin")
    assert ".venv/bin/python does not run" in machine.set_up()


def test_no_space(machine: Machine) -> None:
    machine.program("df", "echo; echo disk 0 0 2000000")
    assert "5 GB are needed for .venv, 2 are free there" in machine.set_up()
    assert not (machine.folder / ".venv").exists()


def test_no_network(machine: Machine) -> None:
    assert "pip could not install: see above" in machine.set_up()
