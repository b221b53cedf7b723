#!/usr/bin/env bash
# Creates the virtual environment given as $1 from requirements.lock. Run by `make setup`.
set -euo pipefail
venv="$1"
cd "$(dirname "$0")/.."

python=""
for candidate in python3.11 python3; do
    if command -v "$candidate" >/dev/null && "$candidate" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))'; then
        python="$candidate"
        break
    fi
done

# What apt has to bring: packages by what shows that they are there.
missing=()
[ -n "$python" ] || missing+=(python3.11 python3.11-venv)
if [ -n "$python" ] && ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then missing+=(python3-venv); fi
if ! ldconfig -p 2>/dev/null | grep -q 'libusb-1\.0\.so'; then missing+=(libusb-1.0-0); fi   # open3d
if ! ldconfig -p 2>/dev/null | grep -q 'libgomp\.so'; then missing+=(libgomp1); fi           # open3d
if ! ldconfig -p 2>/dev/null | grep -q 'libGL\.so'; then missing+=(libgl1); fi               # open3d
if [ ${#missing[@]} -gt 0 ]; then
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        apt-get update -qq
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}"
        [ -n "$python" ] || python=python3.11
    else
        echo "scenewright needs: ${missing[*]}. Run: sudo apt-get install ${missing[*]}" >&2
        exit 5
    fi
fi

"$python" -m venv "$venv"
pip=("$venv/bin/python" -m pip --disable-pip-version-check install --quiet --no-warn-script-location)
# torch first and by itself: nothing else may pull a CUDA build in.
if [ -n "${TORCH_INDEX:-}" ]; then
    "${pip[@]}" --index-url "$TORCH_INDEX" "$(grep '^torch==' requirements.lock)"
else
    "${pip[@]}" "$(grep '^torch==' requirements.lock)"
fi
"${pip[@]}" -r requirements.lock
"${pip[@]}" --no-deps --no-build-isolation -e . 2>/dev/null
"$venv/bin/python" -c 'import importlib.util as u; assert u.find_spec("torchvision") is None, "torchvision must not be installed"'
