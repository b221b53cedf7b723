#!/usr/bin/env bash
# Creates the virtual environment given as $1 from requirements.lock. Run by `make setup`; BASE_PYTHON names a Python.
set -euo pipefail
venv="$1"
cd "$(dirname "$0")/.."

stop() {
    echo "scenewright: $*" >&2
    exit 5
}
version_of() { "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null; }
choose_python() {
    python=""
    for candidate in ${BASE_PYTHON:-python3.11 python3 python3.12 python3.13}; do
        case "$(command -v "$candidate" >/dev/null && version_of "$candidate")" in
        3.11 | 3.12 | 3.13)
            python="$candidate"
            return
            ;;
        esac
    done
}

choose_python
package="$(basename "${python:-python3}")"
[ -n "$python" ] || [ -z "${BASE_PYTHON:-}" ] || stop "$BASE_PYTHON is no Python 3.11, 3.12 or 3.13: give one by BASE_PYTHON"
if [ -e "$venv/bin/python" ]; then
    there="$(version_of "$venv/bin/python" || true)"
    [ -n "$there" ] || stop "$venv/bin/python does not run: remove the folder $venv"
    # Whoever chose a Python once need not name it again.
    case "${BASE_PYTHON:+$(version_of "$python")}" in
    "" | "$there") python="$venv/bin/python" ;;
    *) stop "$venv is of Python $there: remove it, or name another folder (make VENV=folder ...)" ;;
    esac
fi

# What apt has to bring: packages by what shows that they are there.
missing=()
[ -n "$python" ] || missing+=(python3 python3-venv)
if [ -n "$python" ]; then
    "$python" -c 'import ensurepip, venv' 2>/dev/null || missing+=("$package-venv")
    # pybullet has a wheel for 3.11 alone and is compiled for the others.
    if [ "$(version_of "$python")" != 3.11 ]; then
        command -v c++ >/dev/null || missing+=(g++)
        "$python" -c 'import os, sysconfig; open(os.path.join(sysconfig.get_path("include"), "Python.h"))' 2>/dev/null ||
            missing+=("$package-dev")
    fi
fi
for library in libusb-1.0:libusb-1.0-0 libgomp:libgomp1 libGL:libgl1 libEGL:libegl1 libidn2:libidn2-0; do # of open3d
    ldconfig -p 2>/dev/null | grep -q "${library%%:*}\.so" || missing+=("${library#*:}")
done
if [ ${#missing[@]} -gt 0 ]; then
    if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then
        stop "${missing[*]} are missing: run: sudo apt-get install ${missing[*]}"
    fi
    echo "installing ${missing[*]} ..." >&2
    { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}"; } >/dev/null ||
        stop "apt-get could not install ${missing[*]}: see above"
    if [ -z "$python" ]; then
        choose_python
        [ -n "$python" ] || stop "no Python 3.11, 3.12 or 3.13 in this system's archive: install one, name it by BASE_PYTHON"
        exec bash "$0" "$venv" # its headers may be missing now
    fi
fi

NEEDED=5 # GB
free=$(($(df -Pk "$(dirname "$venv")" | awk 'NR == 2 {print $4}') / 1000000))
[ -e "$venv/.installed" ] || [ "$free" -ge "$NEEDED" ] || stop "$NEEDED GB are needed for $venv, $free are free there"

[ "$python" = "$venv/bin/python" ] || "$python" -m venv "$venv" || stop "$venv could not be made: see above"
pip() {
    "$venv/bin/python" -m pip --disable-pip-version-check --no-input install --quiet --no-warn-script-location "$@" ||
        stop "pip could not install: see above. Behind a proxy set HTTPS_PROXY; without a network see docs/INSTALL.md"
}
# torch first and by itself: nothing else may pull a CUDA build in.
torch="$(grep '^torch==' requirements.lock)"
echo "installing $torch ..." >&2
pip ${TORCH_INDEX:+--index-url "$TORCH_INDEX"} "$torch"
compiled=""
[ "$(version_of "$python")" = 3.11 ] || compiled=", of which pybullet is compiled: minutes"
echo "installing $(($(wc -l <requirements.lock) - 1)) other packages$compiled ..." >&2
pip -r requirements.lock
pip --no-deps --no-build-isolation -e .
"$venv/bin/python" -c 'import importlib.util as u; raise SystemExit(u.find_spec("torchvision") is not None)' ||
    stop "torchvision is installed and breaks what uses torch: run: $venv/bin/python -m pip uninstall torchvision"
