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

use serde::Deserialize;
use serde_json::Value;

use crate::messages::Quoted;
use crate::spec::{Refusal, refused};

use super::file::syntax;

/// In front of the digits.
const ALGORITHM: &str = "sha256:";

/// Compares the digest of a bank file with its content. Returns false if the file has no digest.
///
/// # Errors
/// [`Refusal`] if the text is not JSON, the digest is malformed, or the digest does not match the
/// content.
pub fn check_digest(text: &str, file_name: &str) -> Result<bool, Refusal> {
    checked(text.trim_start_matches('\u{feff}')).map_err(|error| error.in_file(file_name))
}

fn checked(text: &str) -> Result<bool, Refusal> {
    let document: Value = serde_json::from_str(text).map_err(|error| syntax(&error))?;
    let stated = Option::<String>::deserialize(&document["digest"]).map_err(|error| syntax(&error))?;
    let Some(stated) = stated else { return Ok(false) };
    check_form(&stated)?;
    if stated == digest(&document) {
        return Ok(true);
    }
    let rule = "it is not the digest of this content: something in the file was altered; take the original, or design the bank again";
    Err(refused("digest", rule))
}

/// The digest of a document as the file writes it.
pub(super) fn digest(document: &Value) -> String {
    let mut hasher = Sha256::new();
    absorb(&mut hasher, document, &["digest", "meta"]);
    let digits = hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect::<String>();
    ALGORITHM.to_owned() + &digits
}

/// Refuses a text that has not the form of a digest.
pub(super) fn check_form(text: &str) -> Result<(), Refusal> {
    let digits = text.strip_prefix(ALGORITHM).unwrap_or_default();
    if digits.len() == 64 && digits.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f')) {
        return Ok(());
    }
    let rule = "is no digest, which is sha256: with 64 hexadecimal digits; leave it out";
    Err(refused("digest", format!("\"{}\" {rule}", Quoted(text))))
}

fn absorb(hasher: &mut Sha256, value: &Value, left_out: &[&str]) {
    match value {
        Value::Null => {}
        Value::Bool(value) => hasher.update(if *value { b"t" } else { b"f" }),
        Value::Number(value) => number(hasher, value.as_f64().unwrap_or_default()),
        Value::String(value) => text(hasher, value),
        Value::Array(items) => {
            hasher.update(b"[");
            items.iter().for_each(|item| absorb(hasher, item, &[]));
            hasher.update(b"]");
        }
        Value::Object(entries) => {
            let mut entries = Vec::from_iter(entries);
            entries.retain(|(key, value)| !value.is_null() && !left_out.contains(&key.as_str()));
            entries.sort_by(|a, b| a.0.as_bytes().cmp(b.0.as_bytes()));
            hasher.update(b"{");
            for (key, value) in entries {
                text(hasher, key);
                absorb(hasher, value, &[]);
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
