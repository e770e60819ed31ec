#!/usr/bin/env bash
# Breaks the rooms color, transport, paint and blend in every way that cargo-mutants knows, and counts what the tests
# notice. Arguments go to cargo-mutants, for example `--shard 0/8` or `--file src/color/lab.rs`.
#
# The four rooms need no other, so they are copied, with their unit tests and the part of the stability suite that is
# about them, into a crate of their own in target/mutation: a broken variant then builds in seconds, not in minutes.
# Needs `cargo install cargo-mutants --locked`.
set -euo pipefail
cd "$(dirname "$0")/../.."

rooms="color transport paint blend"
suites="blends color paints realisation reflectance transport"
crate="${CARPAINT_MUTATION:-target/mutation}"
rm -rf "$crate/src" "$crate/tests" "$crate/.cargo"
mkdir -p "$crate/src" "$crate/tests/stability" "$crate/.cargo"
cp Cargo.lock .clippy.toml "$crate/"
cp .cargo/mutants.toml "$crate/.cargo/"

{ echo '//! The rooms whose arithmetic everything else stands on.'; } > "$crate/src/lib.rs"
for room in $rooms; do
  cp -r "src/$room" "$crate/src/"
  printf '#[allow(missing_docs)]\npub mod %s;\n' "$room" >> "$crate/src/lib.rs"
done
cp -r tests/stability/. "$crate/tests/stability/"
echo '//! The part of the stability suite that is about these rooms.' > "$crate/tests/stability/main.rs"
for suite in $suites; do echo "mod $suite;" >> "$crate/tests/stability/main.rs"; done

# The manifest without its programs, examples and other tests; dependencies and profiles stay as they are.
awk '/^\[\[/ { skip = 1 } /^\[[^[]/ { skip = 0 } !skip && !/^default-run/' Cargo.toml > "$crate/Cargo.toml"
printf '\n[workspace]\n' >> "$crate/Cargo.toml"

# A twentieth of a per cent of the random problems: what a break does to transport shows in the first hundred.
export CARPAINT_FUZZ="${CARPAINT_FUZZ:-300}" PROPTEST_CASES="${PROPTEST_CASES:-64}"
cd "$crate"
exec cargo mutants --in-place --jobs 1 "$@"
