#!/usr/bin/env bash
# Builds the source package and the wheel for Python, and runs docs/python.md from each in a clean environment.
#
# tools/wheel.sh PYTHON [FOLDER]    FOLDER holds the tree that is published, `target/release-candidate` by default;
#                                   tools/release.sh makes it. The packages are in FOLDER/dist
#
# maturin refuses a wheel whose symbols are newer than the manylinux tag that it gives it; auditwheel shows the tag.
set -euo pipefail
# The newest tag is manylinux_2_35: the glibc of Ubuntu 22.04.
newest=35
python=${1:?tools/wheel.sh PYTHON [FOLDER]}
cd "$(dirname "$0")/.."
root=$PWD
build=${CARGO_TARGET_DIR:-$PWD/target}
folder=$(realpath "${2:-$build/release-candidate}")
# Both builds of the extension share what is compiled, outside of the source package.
export CARGO_TARGET_DIR="$build"
unset PYO3_NO_PYTHON
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$python" -m venv "$work/tools"
"$work/tools/bin/pip" --quiet --disable-pip-version-check install 'maturin>=1.9,<2' auditwheel
rm -rf "$folder/dist"
(cd "$folder" && "$work/tools/bin/maturin" sdist --out dist >/dev/null)
(cd "$folder" && "$work/tools/bin/maturin" build --quiet --profile dist --out dist)
"$work/tools/bin/auditwheel" show "$folder"/dist/*.whl | tee "$work/audit"
tag=$(tr '\n' ' ' <"$work/audit" | sed -n 's/.*following platform tag: *"manylinux_2_\([0-9]*\)_.*/\1/p')
if [ -z "$tag" ] || [ "$tag" -gt "$newest" ]; then
    echo "wheel: newer than manylinux_2_$newest; build it on an older Linux" >&2
    exit 1
fi
for package in "$folder"/dist/*.tar.gz "$folder"/dist/*.whl; do
    "$python" -m zipfile -l "$package" >"$work/list" 2>/dev/null || tar -tzf "$package" >"$work/list"
    for file in LICENSE-MIT LICENSE-APACHE hybank/py.typed hybank/__init__.pyi; do
        grep -q "$file" "$work/list" || { echo "wheel: $package has no $file" >&2; exit 1; }
    done
    du -h --apparent-size "$package"
    rm -rf "$work/clean"
    "$python" -m venv "$work/clean"
    # What docs/python.md uses, and the package itself, which brings NumPy.
    "$work/clean/bin/pip" --quiet --disable-pip-version-check install "$package" \
        pytest scipy soundfile matplotlib distributed zarr control h5py
    (cd "$work" && "$work/clean/bin/python" -m pytest --quiet -c /dev/null --rootdir "$work" -p no:cacheprovider \
        "$root/python/tests/test_docs.py")
done
