#!/usr/bin/env bash
# Installs what the browser tests need, makes their inputs, and runs them.
set -euo pipefail
cd "$(dirname "$0")"

if ! command -v node >/dev/null; then
  echo "the browser tests need Node.js 20 or newer" >&2
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
