"""`scenewright doctor`: what is there, what is missing, how to get it."""

from __future__ import annotations

import ctypes.util
import importlib
import os
import shutil
import sys
from dataclasses import dataclass

from scenewright.schemas.places import checkout
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.engine.model_cache import cache_folder, cached_models
from scenewright.stages.kit.library_versions import library_version

SYSTEM_LIBRARIES = {
    "libusb-1.0-0": "usb-1.0",
    "libgomp1": "gomp",
    "libgl1": "GL",
    "libegl1": "EGL",
    "libidn2-0": "idn2",
}
"""Debian's package -> library; open3d loads all of them."""
CORE = {
    "typer": ("typer", "every command"),
    "pydantic": ("pydantic", "every command"),
    "numpy": ("numpy", "every step"),
    "scipy": ("scipy", "every step"),
    "numba": ("numba", "compiled kernels of most steps"),
    "opencv-python-headless": ("cv2", "pictures"),
    "mcap": ("mcap", "MCAP logs"),
    "rosbags": ("rosbags", "ROS bags"),
    "torch": ("torch", "networks of segment, disparity and suture"),
    "pycolmap": ("pycolmap", "poses --bundle-adjustment, a splat's points from images alone"),
    "trimesh": ("trimesh", "meshes"),
    "open3d": ("open3d", "ray casting at meshes"),
    "python-fcl": ("fcl", "distances between solids"),
    "embreex": ("embreex", "faster rays of plan"),
    "shapely": ("shapely", "outlines of surfaces"),
    "networkx": ("networkx", "contact graphs"),
    "pybullet": ("pybullet", "physics of urdf, plan, tableware and agent"),
    "ompl": ("ompl", "motion planning"),
    "matplotlib": ("matplotlib", "plots"),
    "psutil": ("psutil", "memory and processes of a batch"),
}
"""Distribution -> module, and what needs it."""
EXTRAS = {
    "rerun-sdk": ("rerun", "viewing artifacts: pip install rerun-sdk"),
    "ray": ("ray", "batches on a cluster: pip install ray"),
    "mujoco": ("mujoco", "opening scene.mjcf.xml: pip install mujoco"),
    "coacd": ("coacd", "library add cuts up hollow collision shapes: pip install coacd"),
    "atheris": ("atheris", "make fuzz: pip install atheris"),
}
"""Distribution -> module, and what it is for; the steps declare further ones (`Stage.extras`)."""


@dataclass(frozen=True)
class Check:
    """One line of the diagnosis."""

    name: str
    found: str
    remedy: str = ""
    required: bool = True

    @property
    def sound(self) -> bool:
        """Whether nothing has to be done."""
        return not self.remedy


def _import_check(distribution: str, module: str, remedy: str, required: bool) -> Check:
    version = library_version(distribution)
    if version == "absent":
        return Check(distribution, "absent", remedy, required)
    try:
        importlib.import_module(module)
    except Exception as error:
        return Check(distribution, f"{version}, does not import: {error}", remedy, required)
    return Check(distribution, version, required=required)


def diagnose() -> list[Check]:
    """Check Python, system libraries, core and extra packages, memory and disk."""
    checks = []
    python = ".".join(map(str, sys.version_info[:3]))
    supported = (3, 11) <= sys.version_info[:2] <= (3, 13)
    checks.append(Check("python", python, "" if supported else "use Python 3.11, 3.12 or 3.13"))
    for package, library in SYSTEM_LIBRARIES.items():
        found = ctypes.util.find_library(library)
        checks.append(Check(package, found or "absent", "" if found else f"open3d: apt-get install {package}"))
    for name, (module, purpose) in CORE.items():
        remedy = "make setup" if checkout() else f"pip install {name}"
        checks.append(_import_check(name, module, f"{purpose}: {remedy}", True))
    torchvision = library_version("torchvision")
    if torchvision != "absent":
        checks.append(Check("torchvision", torchvision, "pip uninstall torchvision (it breaks transformers)", False))
    checks += [_import_check(name, module, hint, False) for name, (module, hint) in EXTRAS.items()]
    declared = {extra.distribution: extra for stage in all_stages().values() for extra in stage.extras}
    checks += [_import_check(name, extra.module, extra.remedy, False) for name, extra in declared.items()]
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    checks.append(Check("memory", f"{memory:.0f} GiB", "" if memory >= 4 else "4 GiB are needed", False))
    cached = cached_models()
    size = sum(model.bytes for model in cached) / 1e6
    checks.append(Check("cached models", f"{len(cached)}, {size:.1f} MB in {cache_folder()}", required=False))
    free = shutil.disk_usage(".").free / 2**30
    checks.append(Check("free disk here", f"{free:.0f} GiB", "" if free >= 2 else "free 2 GiB", False))
    return checks
