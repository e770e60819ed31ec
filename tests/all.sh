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

# The generator of transport problems in CARPAINT_DATA is Python with NumPy.
if [ -z "${CARPAINT_PYTHON:-}" ] && [ -d "$CARPAINT_DATA" ]; then
  if python3 -c 'import numpy' 2>/dev/null; then
    CARPAINT_PYTHON=python3
  else
    CARPAINT_PYTHON="$PWD/target/test-python/bin/python"
    if ! "$CARPAINT_PYTHON" -c 'import numpy' 2>/dev/null; then
      echo "installing NumPy into target/test-python"
      if ! python3 -c 'import ensurepip' 2>/dev/null; then
        { apt-get update -qq && apt-get install -y -qq python3-venv; } >/dev/null
      fi
      python3 -m venv target/test-python
      "$CARPAINT_PYTHON" -m pip install --quiet --disable-pip-version-check numpy
    fi
  fi
  export CARPAINT_PYTHON
fi

echo "== Rust: unit, property, oracle, stability and end-to-end tests"
cargo test --quiet

echo "== Browser: the bundle's shader and the GLB"
tests/browser/run.sh
