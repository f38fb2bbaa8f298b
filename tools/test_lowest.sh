#!/usr/bin/env bash
# The tests of what works without the notebooks, on the lowest versions that pyproject.toml allows.
# PYTHON names the interpreter, 3.11 if not given; uv is installed for it where there is none.
set -euo pipefail
cd "$(dirname "$0")/.."
uv=${UV:-uv}
work=$(mktemp -d "${TMPDIR:-/tmp}/hicp-lowest-XXXXXX")
trap 'rm -rf "$work"' EXIT
if ! command -v "$uv" > /dev/null; then
  python3 -m venv "$work/uv" && "$work/uv/bin/python" -m pip install -q uv
  uv=$work/uv/bin/uv
fi
extras=(--extra analysis --extra mediapipe --extra render --extra robot)
"$uv" pip compile -q --no-header --no-build --resolution lowest-direct --python-version 3.11 "${extras[@]}" \
  pyproject.toml -o "$work/lowest.txt"
grep -E '^[a-z]' "$work/lowest.txt"
"$uv" venv -q --python "${PYTHON:-3.11}" "$work/env"
# pip, since a test downloads through it; matplotlib for its photograph of a person; onnx to make networks
"$uv" pip install -q --python "$work/env/bin/python" -r "$work/lowest.txt" hypothesis matplotlib onnx pip pytest
PYTHONPATH=$PWD HICP_TESTS_WITHOUT_WEIGHTS=1 "$work/env/bin/python" -m pytest -q -p no:cacheprovider \
  --override-ini addopts= \
  tests/core/test_{cache,camera,keypoints,oks,quaternions}.py tests/datasets/test_subsets.py \
  tests/formats tests/evaluation/ap tests/evaluation/statistics \
  tests/detectors/onnx tests/detectors/weights \
  tests/lifting tests/recordings/test_{recording,tum}.py
