#!/usr/bin/env bash
# Installs what the browser tests need, makes their inputs, and runs them.
set -euo pipefail
cd "$(dirname "$0")"

if ! command -v npm >/dev/null; then
  echo "installing Node.js"
  { apt-get update -qq && apt-get install -y -qq nodejs npm; } >/dev/null
fi
if [ "$(node --print 'process.versions.node.split(".")[0] >= 20')" != true ]; then
  echo "the browser tests need Node.js 20 or newer, this is $(node --version)" >&2
  exit 1
fi
if [ -z "${CHROMIUM:-}" ] && ! command -v chromium >/dev/null && ! command -v chromium-browser >/dev/null; then
  echo "installing chromium"
  { apt-get update -qq && apt-get install -y -qq chromium; } >/dev/null
fi
[ -d node_modules/playwright-core ] && [ node_modules -nt package-lock.json ] || npm ci --no-audit --no-fund --silent

export CARPAINT_FIXTURES="${CARPAINT_FIXTURES:-$PWD/../../target/browser-fixtures}"
mkdir -p "$CARPAINT_FIXTURES"
cargo run --quiet --example export_fixture -- "$CARPAINT_FIXTURES"
node --test --test-timeout=300000
