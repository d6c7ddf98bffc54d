#!/usr/bin/env bash
# Builds the page and uses it in headless Chromium: a design, its errors, downloads, sound. Skipped, aloud, where
# the target, Node.js or Chromium is not there.
#
#   HYBANK=PROGRAM       also compares the downloaded bank with what this hybank designs, and proves it with it
#   PICTURES=FOLDER      also writes what the page looks like
set -euo pipefail
cd "$(dirname "$0")"
skip() {
    echo "SKIPPED: the playground: $*"
    exit 0
}
rustup target add wasm32-wasip1 >/dev/null 2>&1 || skip "Rust's wasm32-wasip1 cannot be installed"
command -v node >/dev/null || skip "no Node.js"
browser=""
for name in chromium chromium-browser google-chrome; do
    if "$name" --version >/dev/null 2>&1; then browser=$name && break; fi
done
[ -n "$browser" ] || skip "no Chromium"
./build.sh
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
node test/page.mjs "$browser" "$PWD/dist/hybank.html" "$work"
