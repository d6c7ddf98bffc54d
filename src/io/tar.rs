//! The files of an archive (tar), as SigMF packs recordings.

use super::IoError;
use crate::messages::Quoted;
use std::io::{self, Read, Seek, SeekFrom};
use tar::{Archive, Entry};

const BLOCK: u64 = 512;
/// Most files of an archive.
const MOST_FILES: usize = 65_536;
/// Most bytes of all heads, long names and attributes: 1 KiB per file.
const MOST_HEAD_BYTES: u64 = 1 << 26;

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

/// The plain files of an archive called `file`, in their order.
///
/// ```
/// let mut head = tar::Header::new_ustar();
/// head.set_size(3);
/// let mut archive = tar::Builder::new(Vec::new());
/// archive.append_data(&mut head, "notes.txt", &b"two"[..])?;
/// let bytes = archive.into_inner()?;
/// let files = hybank::io::tar_files(&mut std::io::Cursor::new(&bytes), "recording.sigmf")?;
/// assert_eq!((files.len(), files[0].name.as_str()), (1, "notes.txt"));
/// assert_eq!(bytes[files[0].offset as usize..][..files[0].size as usize], *b"two");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`IoError::Malformed`] with the byte at which something is wrong, or the system's refusal.
pub fn tar_files(archive: &mut (impl Read + Seek), file: &str) -> Result<Vec<TarFile>, IoError> {
    let system = |error| IoError::system(file, "read it")(error);
    let end = archive.seek(SeekFrom::End(0)).map_err(system)?;
    archive.rewind().map_err(system)?;
    let mut files = Vec::new();
    let mut offset = 0;
    let mut archive = Archive::new(Heads { archive, left: MOST_HEAD_BYTES });
    for entry in archive.entries_with_seek().map_err(system)? {
        let problem = match entry {
            Ok(entry) if contents_end(&entry).is_none_or(|last| last > end) => {
                "the file that begins here is longer than the archive; copy it again".to_owned()
            }
            Ok(_) if files.len() == MOST_FILES => "more than 65536 files; pack one recording".to_owned(),
            Ok(entry) => {
                files.extend(plain_file(&entry));
                // Some writers leave out the padding of the last file.
                offset = (entry.raw_file_position() + entry.size()).next_multiple_of(BLOCK);
                continue;
            }
            Err(error) if error.raw_os_error().is_some() => return Err(system(error)),
            Err(error) => {
                format!(
                    "{}; copy the archive again, or pack the recording with tar",
                    Quoted(error.to_string())
                )
            }
        };
        return Err(IoError::malformed(file, "a SigMF archive (tar)")(format!("byte {offset}: {problem}")));
    }
    Ok(files)
}

fn contents_end(entry: &Entry<'_, impl Read>) -> Option<u64> {
    entry.raw_file_position().checked_add(entry.size())
}

/// None for folders, links and attributes.
fn plain_file(entry: &Entry<'_, impl Read>) -> Option<TarFile> {
    let kind = entry.header().entry_type();
    let name = String::from_utf8_lossy(&entry.path_bytes()).into_owned();
    (kind.is_file() || kind.is_contiguous()).then(|| TarFile {
        name,
        offset: entry.raw_file_position(),
        size: entry.size(),
    })
}

/// An archive of which only the heads are read. A name that claims gigabytes ends in an error, not in
/// memory.
struct Heads<R> {
    archive: R,
    left: u64,
}

impl<R: Read> Read for Heads<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.left == 0 {
            return Err(io::Error::other("names and attributes take more than 64 MiB"));
        }
        let count = (&mut self.archive).take(self.left).read(bytes)?;
        self.left -= count as u64;
        Ok(count)
    }
}

impl<R: Seek> Seek for Heads<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.archive.seek(to)
    }
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
        head[257..265].copy_from_slice(b"ustar\x0000");
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
        assert!(refused(&archive[..1700]).contains("byte 1536: failed to read entire block"));
        archive[1536] = b'c';
        assert!(refused(&archive).contains("byte 1536: archive header checksum mismatch"));
        assert!(tar_files(&mut Cursor::new(b""), "x.sigmf").unwrap().is_empty());
    }

    #[test]
    fn names_of_gigabytes_are_refused() {
        struct Endless(u64);
        impl Read for Endless {
            fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
                let head = packed("././@LongLink", b'L', b"");
                let mut head: Vec<u8> = head[..512].to_vec();
                head[124..136].copy_from_slice(b"77777777777\0");
                head[148..156].fill(b' ');
                let sum: u64 = head.iter().map(|&byte| u64::from(byte)).sum();
                head[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
                let at = |k: u64| head.get(k as usize).copied().unwrap_or(b'x');
                bytes.iter_mut().zip(self.0..).for_each(|(byte, k)| *byte = at(k));
                self.0 += bytes.len() as u64;
                Ok(bytes.len())
            }
        }
        impl Seek for Endless {
            fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
                match to {
                    SeekFrom::Start(at) => self.0 = at,
                    SeekFrom::Current(by) => self.0 = (self.0 as i64 + by) as u64,
                    SeekFrom::End(_) => return Ok(1 << 40),
                }
                Ok(self.0)
            }
        }
        let refused = tar_files(&mut Endless(0), "x.sigmf").unwrap_err().to_string();
        assert!(refused.contains("byte 0: names and attributes take more than 64 MiB"), "{refused}");
    }
}
