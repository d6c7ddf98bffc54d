//! The files of an archive (tar), as SigMF packs recordings.
//!
//! Source: POSIX.1-2017, *pax*, "ustar Interchange Format"; GNU tar for long names and sizes in base 256.

use super::IoError;
use std::io::{self, Read, Seek, SeekFrom};

const BLOCK: u64 = 512;
/// Most files of an archive.
const MOST_FILES: usize = 65_536;
/// Longest name, and longest list of attributes.
const LONGEST_NAME: u64 = 1 << 16;

/// A plain file in an archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TarFile {
    /// Its path in the archive.
    pub name: String,
    /// Where its bytes begin.
    pub offset: u64,
    /// How many there are.
    pub size: u64,
}

/// Attributes that hold for the next file.
#[derive(Debug, Default)]
struct Next {
    name: Option<String>,
    size: Option<u64>,
}

/// The plain files of an archive called `file`, in their order.
///
/// # Errors
/// [`IoError::Malformed`] with the byte at which something is wrong, or the system's refusal.
pub fn tar_files(archive: &mut (impl Read + Seek), file: &str) -> Result<Vec<TarFile>, IoError> {
    let system = |error| IoError::system(file, "read it")(error);
    let fault = |offset: u64, problem: &str| IoError::Malformed {
        file: file.to_owned(),
        kind: "a SigMF archive (tar)",
        problem: format!("byte {offset}: {problem}"),
    };
    let end = archive.seek(SeekFrom::End(0)).map_err(system)?;
    let mut files = Vec::new();
    let mut next = Next::default();
    let mut offset = 0;
    while offset < end {
        let mut head = [0; BLOCK as usize];
        archive.seek(SeekFrom::Start(offset)).map_err(system)?;
        match archive.read_exact(&mut head) {
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => {
                return Err(fault(offset, "the archive ends inside a head; copy it again"));
            }
            other => other.map_err(system)?,
        }
        if head.iter().all(|&byte| byte == 0) {
            break;
        }
        if !checks(&head) {
            return Err(fault(
                offset,
                "this is no head of a file in an archive; pack the recording with tar",
            ));
        }
        let stated = number(&head[124..136]).ok_or_else(|| fault(offset + 124, "the size is no number"))?;
        let begin = offset + BLOCK;
        let kind = head[156];
        let is_file = matches!(kind, b'0' | 0 | b'7');
        let size = next.size.filter(|_| is_file).unwrap_or(stated);
        let padded = size.checked_next_multiple_of(BLOCK).and_then(|padded| begin.checked_add(padded));
        // Some writers leave out the padding of the last file.
        let (Some(following), true) = (padded, size <= end - begin) else {
            return Err(fault(offset, "the file that begins here is longer than the archive; copy it again"));
        };
        match kind {
            b'L' | b'x' => {
                if size > LONGEST_NAME {
                    return Err(fault(offset, "the name or the attributes are longer than 65536 bytes"));
                }
                let mut bytes = vec![0; size as usize];
                archive.read_exact(&mut bytes).map_err(system)?;
                if kind == b'L' { next.name = Some(text(&bytes)) } else { next.read(&bytes) }
            }
            _ if is_file => {
                let name = next.name.take().unwrap_or_else(|| name(&head));
                files.push(TarFile { name, offset: begin, size });
                next = Next::default();
            }
            _ => {}
        }
        if files.len() > MOST_FILES {
            return Err(fault(offset, "more than 65536 files; pack one recording"));
        }
        offset = following;
    }
    Ok(files)
}

impl Next {
    /// Attributes, each `LENGTH KEY=VALUE\n`.
    fn read(&mut self, mut bytes: &[u8]) {
        while let Some(space) = bytes.iter().position(|&byte| byte == b' ') {
            let length =
                std::str::from_utf8(&bytes[..space]).ok().and_then(|digits| digits.parse::<usize>().ok());
            let Some(record) = length.filter(|&length| length > space).and_then(|length| bytes.get(..length))
            else {
                return;
            };
            bytes = &bytes[record.len()..];
            let record = text(&record[space + 1..]);
            match record.trim_end_matches('\n').split_once('=') {
                Some(("path", path)) => self.name = Some(path.to_owned()),
                Some(("size", size)) => self.size = size.parse().ok(),
                _ => {}
            }
        }
    }
}

/// Up to the first zero byte.
fn text(bytes: &[u8]) -> String {
    let length = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..length]).into_owned()
}

fn name(head: &[u8; 512]) -> String {
    let prefix = if &head[257..262] == b"ustar" { text(&head[345..500]) } else { String::new() };
    if prefix.is_empty() { text(&head[..100]) } else { format!("{prefix}/{}", text(&head[..100])) }
}

/// The checksum is the sum of all bytes, with its own taken as spaces.
fn checks(head: &[u8; 512]) -> bool {
    let sum = |bytes: &[u8]| bytes.iter().map(|&byte| u64::from(byte)).sum::<u64>();
    number(&head[148..156]) == Some(sum(&head[..148]) + 8 * u64::from(b' ') + sum(&head[156..]))
}

/// Octal digits, or eight bytes after a byte with the top bit.
fn number(field: &[u8]) -> Option<u64> {
    if field[0] & 0x80 != 0 {
        let (high, low) = field.split_at(field.len().checked_sub(8)?);
        let is_small = high.iter().enumerate().all(|(i, &byte)| byte == if i == 0 { 0x80 } else { 0 });
        return is_small.then(|| low.iter().fold(0, |value, &byte| value << 8 | u64::from(byte)));
    }
    let digits = text(field);
    let digits = digits.trim();
    if digits.is_empty() { Some(0) } else { u64::from_str_radix(digits, 8).ok() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// The head and the padded content of a file.
    fn packed(name: &str, kind: u8, content: &[u8]) -> Vec<u8> {
        let mut head = [0; 512];
        head[..name.len()].copy_from_slice(name.as_bytes());
        head[124..135].copy_from_slice(format!("{:011o}", content.len()).as_bytes());
        head[156] = kind;
        head[257..262].copy_from_slice(b"ustar");
        head[148..156].fill(b' ');
        let sum: u64 = head.iter().map(|&byte| u64::from(byte)).sum();
        head[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
        let mut bytes = [&head[..], content].concat();
        bytes.resize(bytes.len().next_multiple_of(512), 0);
        bytes
    }

    #[test]
    fn files_are_found_by_their_names_short_and_long() {
        let long = "x".repeat(300);
        let record = format!("{} path=deep/{long}\n", long.len() + 15);
        assert_eq!(record.len(), long.len() + 15);
        let archive = [
            packed("folder/", b'5', b""),
            packed("a.txt", b'0', b"first"),
            packed("././@LongLink", b'L', format!("{long}\0").as_bytes()),
            packed("cut", b'0', b"second"),
            packed("head", b'x', record.as_bytes()),
            packed("cut", 0, &[7; 600]),
            vec![0; 1024],
        ];
        let archive = archive.concat();
        let files = tar_files(&mut Cursor::new(&archive), "x.sigmf").unwrap();
        let content = |file: &TarFile| &archive[file.offset as usize..][..file.size as usize];
        let found: Vec<_> = files.iter().map(|file| (file.name.clone(), content(file).to_vec())).collect();
        let want = [
            ("a.txt".to_owned(), b"first".to_vec()),
            (long.clone(), b"second".to_vec()),
            (format!("deep/{long}"), vec![7; 600]),
        ];
        assert_eq!(found, want);
    }

    #[test]
    fn damaged_archives_are_refused_with_their_place() {
        let mut archive = [packed("a", b'0', &[1; 600]), packed("b", b'0', b"x")].concat();
        let refused = |bytes: &[u8]| tar_files(&mut Cursor::new(bytes), "x.sigmf").unwrap_err().to_string();
        assert!(refused(&archive[..900]).contains("byte 0: the file that begins here is longer"));
        assert!(refused(&archive[..1700]).contains("byte 1536: the archive ends inside a head"));
        archive[1536] = b'c';
        assert!(refused(&archive).contains("byte 1536: this is no head"));
        assert!(tar_files(&mut Cursor::new(b""), "x.sigmf").unwrap().is_empty());
    }
}
