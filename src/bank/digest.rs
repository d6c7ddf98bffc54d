//! The digest of a bank file. It detects every change of the content, even one too small to invalidate the
//! proof.
//!
//! It is the SHA-256 of a canonical form of the document, so that layout does not matter: a table is `{`,
//! its members in the order of their keys' bytes, and `}`; a member is key and value; a list is `[`, its
//! items and `]`; a text or key is `"`, its length in bytes as eight bytes and its bytes; a number is `#`
//! and the eight bytes of the double that it reads as; true and false are `t` and `f`. Lengths and doubles
//! are big-endian. Members that are null, and at the top `digest` and `meta`, are left out. The file holds
//! `"digest": "sha256:<64 hexadecimal digits>"`.

use sha2::{Digest as _, Sha256};

use crate::spec::document::{Kind, Node};

/// In front of the digits.
const ALGORITHM: &str = "sha256:";

/// The digest of a document as the file writes it.
pub(super) fn digest(document: &Node) -> String {
    let mut hasher = Sha256::new();
    absorb(&mut hasher, document, &["digest", "meta"]);
    let digits = hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect::<String>();
    ALGORITHM.to_owned() + &digits
}

/// Whether a text has the form of a digest.
pub(super) fn is_digest(text: &str) -> bool {
    let digits = text.strip_prefix(ALGORITHM).unwrap_or_default();
    digits.len() == 64 && digits.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'))
}

fn absorb(hasher: &mut Sha256, node: &Node, left_out: &[&str]) {
    match &node.kind {
        Kind::Null | Kind::Date => {}
        Kind::Boolean(value) => hasher.update(if *value { b"t" } else { b"f" }),
        Kind::Integer(value) => number(hasher, *value as f64),
        Kind::Number(value) => number(hasher, *value),
        Kind::Text(value) => text(hasher, value),
        Kind::List(items) => {
            hasher.update(b"[");
            items.iter().for_each(|item| absorb(hasher, item, &[]));
            hasher.update(b"]");
        }
        Kind::Table(entries) => {
            let counts = |key: &str, value: &Node| value.kind != Kind::Null && !left_out.contains(&key);
            let mut entries: Vec<_> = entries.iter().filter(|e| counts(&e.key, &e.value)).collect();
            entries.sort_by(|a, b| a.key.as_bytes().cmp(b.key.as_bytes()));
            hasher.update(b"{");
            for entry in entries {
                text(hasher, &entry.key);
                absorb(hasher, &entry.value, &[]);
            }
            hasher.update(b"}");
        }
    }
}

fn number(hasher: &mut Sha256, value: f64) {
    hasher.update(b"#");
    hasher.update(value.to_bits().to_be_bytes());
}

fn text(hasher: &mut Sha256, value: &str) {
    hasher.update(b"\"");
    hasher.update((value.len() as u64).to_be_bytes());
    hasher.update(value.as_bytes());
}
