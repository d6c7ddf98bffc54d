#!/usr/bin/env bash
# Compiles tests/test.c against both forms of the library with the system's compiler, and runs it.
#
#   ./test.sh [FOLDER]      of libhybank.so and libhybank.a; builds them without one
set -euo pipefail
libraries=${1:+$(realpath "$1")}
cd "$(dirname "$0")"
if [ -z "$libraries" ]; then
    cargo build --quiet
    libraries=${CARGO_TARGET_DIR:-$PWD/../target}/debug
fi
# Tools that read headers know old C: MATLAB's loadlibrary, cffi.
for standard in c89 c99; do
    cc -x c -std=$standard -Wall -Wextra -Werror -pedantic -fsyntax-only include/hybank.h
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
flags=(-std=c99 -Wall -Wextra -Werror -pedantic -O1 -Iinclude tests/test.c)
cc "${flags[@]}" -o "$work/shared" -L"$libraries" -lhybank -Wl,-rpath,"$libraries"
cc "${flags[@]}" -o "$work/static" "$libraries/libhybank.a" -lpthread -ldl -lm
for form in shared static; do
    echo "== $form library"
    "$work/$form" "$work/bank.json"
done
