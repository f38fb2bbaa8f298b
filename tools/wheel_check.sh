#!/usr/bin/env bash
# The distribution as others install it: built, put into an empty environment, used from an empty folder.
#   tools/wheel_check.sh [base|all]     base: without the extras `mediapipe` and `render`
# PYTHON names the interpreter. The base is installed in the locked versions, so that its size is that of
# what was tested, and not of a release of yesterday.
set -euo pipefail
cd "$(dirname "$0")/.."
checkout=$PWD
parts=${1:-all}
max_mb=505  # 450 of them are what it stands on (onnx and what it needs: 45) and code; 46 the networks
work=$(mktemp -d "${TMPDIR:-/tmp}/hicp-wheel-XXXXXX")
trap 'rm -rf "$work"' EXIT
unset PYTHONPATH
export PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1

fail() { echo "wheel: $*" >&2; exit 1; }

# Built from what git knows, not from what else lies in the checkout.
mkdir "$work/source" "$work/run"
git ls-files -z | tar --null -T - -cf - | tar -xf - -C "$work/source"
"${PYTHON:-python3}" -m venv "$work/env"
python=$work/env/bin/python
"$python" -m pip wheel -q --no-deps --wheel-dir "$work/dist" "$work/source"
wheel=$(echo "$work"/dist/hicp-*.whl)
"$python" -m zipfile -l "$wheel" > "$work/names"
for name in hicp_lib/data/detectors.json hicp_lib/data/weights/{movenet-thunder,nanodet,openpose-mobilenet}.onnx hicp_lib/data/examples/native/annotations.json hicp_lib/py.typed; do
  grep -q "^$name " "$work/names" || fail "$wheel lacks $name"
done
! grep -E "^(tests|notebooks|book|data|build)/" "$work/names" || fail "$wheel brings what is not the package"

size_mb() { du -sm --exclude 'pip*' --exclude 'setuptools*' --exclude pkg_resources "$site" | cut -f1; }
site=$("$python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
empty_mb=$(size_mb)
grep -oE '^[A-Za-z0-9._-]+==[^\\]+' environment.lock > "$work/constraints.txt"
"$python" -m pip install -q -c "$work/constraints.txt" "$wheel"
base_mb=$(($(size_mb) - empty_mb))
echo "wheel: the base install takes $base_mb MB (at most $max_mb)"
[ "$base_mb" -le "$max_mb" ] || fail "the base install is too large: du -sm $site/*"

# The network for the check is made by a package that the base must do without.
"$python" -m pip install -q -c "$work/constraints.txt" --target "$work/onnx" --no-deps onnx ml-dtypes typing-extensions
cd "$work/run"
PYTHONPATH=$work/onnx "$python" "$checkout/tools/wheel_inputs.py" "$work/run"
PATH=$work/env/bin:$PATH
export HICP_CACHE=$work/cache
# Compiled modules are put there by any Python; nothing else may be.
installed() { find "$site" -type f ! -name '*.pyc' -printf '%P %s %T@\n' | sort; }
installed > "$work/before"

hicp --version
hicp dataset create --annotations native/annotations.json --images images --out hicp --min-pixels 1 > counts.json
hicp detect --detector mmpose --model net.onnx --boxes gt --dataset hicp/basic --out found.json
hicp evaluate --annotations hicp/basic/annotations.json --detections found.json
hicp detect --detector openpose-mobilenet --dataset hicp/basic --out bodies.json
hicp import --format alphapose --predictions native/alphapose --annotations native/annotations.json --out alphapose.json
hicp evaluate --annotations native/annotations.json --detections alphapose.json | grep "AP50  *1.000" > counts.txt \
  || fail "the imported example is not found again"
hicp lift --recording rec --detector mmpose --model net.onnx --boxes image --out lifted.csv
head -1 lifted.csv | grep -q x_m || fail "lifted.csv is no table"

refused() { # EXTRA COMMAND...: one line that names the extra
  local extra=$1; shift
  "$@" > "$work/said" 2>&1 && fail "$* did not fail"
  [ "$(wc -l < "$work/said")" = 1 ] && grep -qF "pip install '.[$extra]'" "$work/said" || fail "$*: $(cat "$work/said")"
}
refused analysis hicp lift --recording rec --detector mmpose --model net.onnx --out lifted.parquet
refused render hicp scenes render scenes
refused mediapipe hicp models show --detector mediapipe
refused report hicp report

if [ "$parts" = all ]; then
  # In a second step, as most will: what comes now must not spoil what is there.
  "$python" -m pip install -q "$wheel[mediapipe,render]"
  installed > "$work/before"
  python -c 'from hicp_lib.cli.doctor import FAIL, check_opencv; import sys; sys.exit(check_opencv().status == FAIL)'
  hicp models fetch
  hicp scenes render scenes --n 2 --workers 1
  hicp detect --detector mediapipe --dataset scenes --out scenes.json
fi
installed | diff "$work/before" - || fail "something was written beside the code"
echo "wheel: sound ($parts)"
