#!/usr/bin/env bash
# Installs what the tests need and runs them all. `cargo test` alone is the part that needs only Rust.
#
# CARPAINT_DATA names a folder with real measurements (default ../shared). Tests that need it say so when they skip;
# with CI=true nothing skips.
set -euo pipefail
cd "$(dirname "$0")/.."

export CARPAINT_DATA="${CARPAINT_DATA:-$(cd .. && pwd)/shared}"
if [ ! -d "$CARPAINT_DATA" ]; then
  if [ "${CI:-}" = true ]; then
    echo "CARPAINT_DATA ($CARPAINT_DATA) is not there, and with CI=true nothing is skipped" >&2
    exit 1
  fi
  echo "note: $CARPAINT_DATA is not there; tests on real measurements will skip and say so"
fi

# Slices of another generator are made by a Python with NumPy: CARPAINT_PYTHON, else one of our own beside the builds.
if [ -f "$CARPAINT_DATA/peers/ot/gen.py" ] && [ -z "${CARPAINT_PYTHON:-}" ]; then
  if python3 -c 'import numpy' 2>/dev/null; then
    CARPAINT_PYTHON=python3
  else
    [ -x target/python/bin/python ] || python3 -m venv target/python
    target/python/bin/pip install --quiet numpy
    CARPAINT_PYTHON="$PWD/target/python/bin/python"
  fi
  export CARPAINT_PYTHON
fi

echo "== Rust: unit, property, oracle, stability and end-to-end tests"
cargo test --quiet

echo "== Browser: the bundle's shader and the GLB"
tests/browser/run.sh
