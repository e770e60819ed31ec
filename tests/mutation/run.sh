#!/usr/bin/env bash
# Breaks the rooms color, transport, paint and blend in every way that cargo-mutants knows, and counts what the tests
# notice. Arguments go to cargo-mutants, for example `--shard 0/8` or `--re src/color/lab.rs`.
#
# The four rooms need no other, so they are copied, with their unit tests and the part of the stability suite that is
# about them, into a crate of their own in target/mutation, the suite compiled into the unit tests: a broken variant is
# then one short compilation. Needs `cargo install cargo-mutants --locked`.
set -euo pipefail
cd "$(dirname "$0")/../.."

rooms="color transport paint blend"
suites="blends bounds color realisation reflectance transport"
crate="${CARPAINT_MUTATION:-target/mutation}"
rm -rf "$crate/src" "$crate/.cargo"
mkdir -p "$crate/src" "$crate/.cargo"
cp Cargo.lock .clippy.toml "$crate/"
cp .cargo/mutants.toml "$crate/.cargo/"

{
  echo '//! The rooms whose arithmetic everything else stands on.'
  echo '#![allow(missing_docs, dead_code)]'
  echo 'extern crate self as carpaint;'
  for room in $rooms; do
    cp -r "src/$room" "$crate/src/"
    echo "pub mod $room;"
  done
  echo '#[cfg(test)] mod paints;'
  cp tests/stability/paints.rs "$crate/src/"
  for suite in $suites; do
    mkdir -p "$crate/src/suite/$suite"
    cp "tests/stability/$suite.rs" "$crate/src/suite/$suite/mod.rs"
    if [ -d "tests/stability/$suite" ]; then cp -r "tests/stability/$suite/." "$crate/src/suite/$suite/"; fi
    # Tables that tests read stand where the tests look for them: beside the suite, and where unit tests see it.
    cp tests/stability/*.txt "$crate/src/suite/$suite/"
    echo "#[cfg(test)] #[path = \"suite/$suite/mod.rs\"] mod suite_$suite;"
  done
  mkdir -p "$crate/tests/stability"
  cp tests/stability/*.txt "$crate/tests/stability/"
} > "$crate/src/lib.rs"

# The manifest without its programs, examples and other tests, and without the dependencies that these rooms never name.
awk '/^\[\[/ { skip = 1 } /^\[[^[]/ { skip = 0 } !skip && !/^default-run/' Cargo.toml | while IFS= read -r line; do
  case "$line" in
    "["*) section="$line" ;;
    [a-z]*" = "*)
      name="${line%% = *}"
      case "$section" in
        *dependencies*) grep -rqE "(^|[^a-z_:])${name//-/_}(::|;)" "$crate/src" || continue ;;
      esac ;;
  esac
  printf '%s\n' "$line"
done > "$crate/Cargo.toml"
printf '\n[workspace]\n' >> "$crate/Cargo.toml"

# A six-hundredth of the random problems: what a break does to transport shows in the first hundred. The tests left out
# take seconds each and say again, of more cases, what others say.
export CARPAINT_FUZZ="${CARPAINT_FUZZ:-300}" PROPTEST_CASES="${PROPTEST_CASES:-64}" CARGO_PROFILE_DEV_DEBUG=0
slow="smaller_and_smaller in_a_white_furnace_a_cert slices_of_paints_cost every_solver_certifies tiles_have_the_grain
  ten_thousand_steps a_paint_at_the_limit"
cd "$crate"
# shellcheck disable=SC2046
exec cargo mutants --in-place --timeout 120 "$@" -- --lib -- $(printf -- '--skip %s ' $slow)
