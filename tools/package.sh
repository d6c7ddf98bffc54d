#!/usr/bin/env bash
# Packages for people who have no compiler, in target/package:
#
#   hybank_VERSION_ARCHITECTURE.deb    both programs, manual pages, completions, licences
#   hybank-VERSION-TARGET.tar.gz       the same files; both programs without any shared library where the musl target is
#
# tools/package.sh [--profile NAME]    the profile of the programs, dist unless given
set -euo pipefail
cd "$(dirname "$0")/.."
profile=dist
if [ "${1:-}" = --profile ]; then profile=$2; fi
case $profile in dev) folder=debug ;; *) folder=$profile ;; esac

version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' Cargo.toml)
host=$(rustc -vV | sed -n 's/^host: //p')
static=${host%%-*}-unknown-linux-musl
target=$host
# Without a target of its own the build shares what is compiled already.
build=${CARGO_TARGET_DIR:-target}
chosen=()
programs=$build/$folder
if rustup target list --installed 2>/dev/null | grep -qx "$static"; then
    target=$static
    chosen=(--target "$static")
    programs=$build/$static/$folder
else
    echo "package: the target $static is not installed (rustup target add $static); the programs use the C library" >&2
fi

cargo build --quiet --profile "$profile" "${chosen[@]}" --target-dir "$build" -p hybank-cli -p hybank-ibr

out=target/package
tree=$out/tree
rm -rf "$tree"
mkdir -p "$tree"/usr/bin "$tree"/usr/share/{man/man1,doc/hybank,bash-completion/completions,zsh/vendor-completions,fish/vendor_completions.d}
install -m 755 "$programs/hybank" "$programs/hybank-ibr" "$tree/usr/bin"
"$programs/hybank" man "$tree/usr/share/man/man1"
gzip -9nf "$tree"/usr/share/man/man1/*.1
"$programs/hybank" completions bash >"$tree/usr/share/bash-completion/completions/hybank"
"$programs/hybank" completions zsh >"$tree/usr/share/zsh/vendor-completions/_hybank"
"$programs/hybank" completions fish >"$tree/usr/share/fish/vendor_completions.d/hybank.fish"
install -m 644 LICENSE-APACHE LICENSE-MIT README.md CHANGELOG.md "$tree/usr/share/doc/hybank"

tar -C "$tree" --owner=0 --group=0 --sort=name -czf "$out/hybank-$version-$target.tar.gz" usr
echo "$out/hybank-$version-$target.tar.gz"

if ! command -v dpkg-deb >/dev/null; then
    echo "package: no dpkg-deb, so no .deb" >&2
    exit 0
fi
architecture=$(dpkg --print-architecture)
# The lowest version of the C library whose symbols the programs use.
libc=$(objdump -T "$tree"/usr/bin/* 2>/dev/null | grep -o 'GLIBC_[0-9.]*' | sort -Vu | tail -1 | cut -d_ -f2 || true)
mkdir "$tree/DEBIAN"
cat >"$tree/DEBIAN/control" <<CONTROL
Package: hybank
Version: $version
Architecture: $architecture
Maintainer: The hybank authors <hybank@localhost>
Section: science
Priority: optional
Installed-Size: $(du -sk "$tree/usr" | cut -f1)
${libc:+Depends: libc6 (>= $libc), libgcc-s1
}Description: hybrid multirate filter banks
 Designs and runs filter banks that make several slow converters with
 fractional delays work as one fast converter, with proven error bounds.
CONTROL
dpkg-deb --root-owner-group --build "$tree" "$out/hybank_${version}_$architecture.deb" >/dev/null
echo "$out/hybank_${version}_$architecture.deb"
