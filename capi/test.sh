#!/usr/bin/env bash
# Builds the library, compiles tests/test.c against both forms of it with the system's compiler, and runs it.
set -euo pipefail
cd "$(dirname "$0")"
target=${CARGO_TARGET_DIR:-$PWD/target}
cargo build --quiet --target-dir "$target"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
flags=(-std=c99 -Wall -Wextra -Werror -pedantic -O1 -Iinclude tests/test.c)
cc "${flags[@]}" -o "$work/shared" -L"$target/debug" -lhybank -Wl,-rpath,"$target/debug"
cc "${flags[@]}" -o "$work/static" "$target/debug/libhybank.a" -lpthread -ldl -lm
for form in shared static; do
    echo "== $form library"
    "$work/$form" "$work/bank.json"
done
