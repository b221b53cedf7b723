"""Systems on which nothing was installed: roots that debootstrap makes, in which this checkout is set up."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
SOURCE = "opt/scenewright"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.geteuid() != 0 or shutil.which("debootstrap") is None, reason="needs root and debootstrap"),
]
GIGABYTES = 7  # What a root with its environment, and pip's own copies while it installs, take.


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """Yield a folder for a root, which goes when the test ends: pytest would keep gigabytes of each."""
    free = shutil.disk_usage(tmp_path).free / 1e9
    if free < GIGABYTES:
        pytest.skip(f"{GIGABYTES} GB are needed for a root, {free:.0f} are free in {tmp_path}")
    yield tmp_path / "root"
    shutil.rmtree(tmp_path / "root", ignore_errors=True)


def fresh_root(folder: Path, suite: str, packages: tuple[str, ...] = ()) -> Path:
    """Return a new Debian with the certificates of this machine and a copy of the checkout's files."""
    include = ",".join(("ca-certificates", "make", *packages))
    subprocess.run(["debootstrap", "--variant=minbase", f"--include={include}", suite, folder], check=True)
    certificates = "etc/ssl/certs/ca-certificates.crt"
    shutil.copy(Path("/", certificates), folder / certificates)
    shutil.copy("/etc/resolv.conf", folder / "etc/resolv.conf")
    files = subprocess.run(["git", "ls-files", "-z"], cwd=REPOSITORY, check=True, capture_output=True, text=True)
    for name in files.stdout.split("\0"):
        if name and (REPOSITORY / name).is_file():
            (folder / SOURCE / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(REPOSITORY / name, folder / SOURCE / name)
    return folder


def inside(root: Path, command: str, user: str = "root") -> subprocess.CompletedProcess[str]:
    """Run a command in the checkout of a root, with this machine's folders of wheels; mounts end with it."""
    shared = [Path(name) for name in os.environ.get("PIP_FIND_LINKS", "").split() if Path(name).is_dir()]
    mounts = [f"mount -t proc proc {root}/proc", f"mount --bind /dev {root}/dev"]
    for folder in shared:
        (root / folder.relative_to("/")).mkdir(parents=True, exist_ok=True)
        mounts.append(f"mount --bind {folder} {root}{folder}")
    shell = f"cd /{SOURCE} && export HOME=/tmp/home && mkdir -p $HOME && {command}"
    script = " && ".join([*mounts, f"exec chroot --userspec={user} {root} /bin/bash -c '{shell}'"])
    return subprocess.run(["unshare", "--mount", "bash", "-c", script], capture_output=True, text=True)


def docker_steps() -> list[str]:
    return re.findall(r"(?m)^RUN (.*)$", (REPOSITORY / "Dockerfile").read_text())


@pytest.mark.parametrize(
    ("suite", "commands"),
    [("bookworm", docker_steps()), ("trixie", ["make setup"])],
    ids=["the steps of the Dockerfile", "Python 3.13, pybullet compiled"],
)
def test_setup_as_root(folder: Path, suite: str, commands: list[str]) -> None:
    root = fresh_root(folder, suite)
    for command in (*commands, ".venv/bin/scenewright doctor"):
        done = inside(root, command)
        assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"


def test_a_user_is_told_what_to_install(folder: Path) -> None:
    root = fresh_root(folder, "bookworm")
    done = inside(root, "make setup VENV=/tmp/venv", user="nobody")
    assert done.returncode == 2 and "sudo apt-get install python3 python3-venv" in done.stderr, done.stderr


def test_a_user_sets_up_once_it_is_there(folder: Path) -> None:
    packages = ("python3", "python3-venv", "libusb-1.0-0", "libgomp1", "libgl1", "libegl1", "libidn2-0")
    root = fresh_root(folder, "bookworm", packages)
    inside(root, f"chown -R nobody /{SOURCE}")
    for command in ("make setup", ".venv/bin/scenewright doctor"):
        done = inside(root, command, user="nobody")
        assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
