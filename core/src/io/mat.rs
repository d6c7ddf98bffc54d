//! Captures as MATLAB files (.mat) of versions 5 to 7.2.
//!
//! Source: MathWorks, *MAT-File Format*, level 5. The numeric arrays of a file are its captures: integers
//! and floats, real or complex, compressed or not. `x.mat:name` chooses a variable; otherwise
//! it is the only array. A number called `fs` gives the rate.

use super::array::{ArrayHeader, ArrayReader};
use super::mat_element::{COMPRESSED, MATRIX, Numbers, Tag, unreadable};
use super::{IoError, PcmFormat};
use crate::files::fill;
use crate::messages::Quoted;
use flate2::read::ZlibDecoder;
use std::fmt;
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Bytes before the first variable.
const HEADER: usize = 128;
/// Most bytes of the shape and of the name of a variable.
const MOST_HEADER: u64 = 4096;
/// Most bytes of the samples of an array, which are held in memory.
const MOST_BYTES: u64 = 1 << 31;
/// Variables that a message names.
const MOST_NAMED: usize = 8;

/// What a file says of a variable.
#[derive(Debug, Clone)]
struct Variable {
    name: String,
    class: u8,
    /// True and false.
    is_logical: bool,
    is_complex: bool,
    shape: Vec<u64>,
    element: Element,
}

/// Where the element of a variable is.
#[derive(Debug, Clone, Copy)]
struct Element {
    /// Of its first byte after the tag.
    offset: u64,
    size: u64,
    is_compressed: bool,
}

/// Opens the variable called `wanted`, or the only array of a file called `name`.
///
/// ```
/// use std::io::{Cursor, Read};
/// let file = include_bytes!("../../tests/fixtures/mat/int16.mat");
/// let mut array = hybank_core::io::open_mat(&mut Cursor::new(file), None, "int16.mat")?;
/// let header = array.header();
/// assert_eq!((header.channels, header.promised), (2, Some(40)));
/// let mut frames = Vec::new();
/// assert_eq!(array.read_to_end(&mut frames)?, 40 * header.frame_bytes());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`IoError::Malformed`] for other files and for variables that are no captures.
pub fn open_mat(
    file: &mut (impl Read + Seek),
    wanted: Option<&str>,
    name: &str,
) -> Result<ArrayReader<Cursor<Vec<u8>>>, IoError> {
    let fault = || IoError::malformed(name, "a MATLAB file of samples");
    check_header(file).map_err(fault())?;
    let all = variables(file).map_err(fault())?;
    let variable = chosen(&all, wanted, name).map_err(fault())?;
    let of_variable = |problem: String| fault()(format!("variable {}: {problem}", Quoted(&variable.name)));
    let array = variable.array().map_err(of_variable)?;
    let samples = variable.samples(file, array.format).map_err(of_variable)?;
    let rate = rate(file, &all).map_err(fault())?;
    ArrayReader::new(array, Cursor::new(samples), rate, of_variable)
}

/// Refuses files of other versions, by their header.
fn check_header(file: &mut (impl Read + Seek)) -> Result<(), String> {
    let mut bytes = [0; HEADER];
    if file.seek(SeekFrom::Start(0)).is_err() {
        return Err("its variables are in any order, which a pipe cannot give; save it to a file".to_owned());
    }
    let filled = fill(file, &mut bytes).map_err(|error| format!("cannot read its header: {error}"))?;
    if filled == HEADER && !bytes.starts_with(b"MATLAB 7.3") && bytes.ends_with(b"\x00\x01IM") {
        return Ok(());
    }
    Err("its header is not that of versions 5 to 7.2 with little-endian numbers (7.3 is HDF5); save it in MATLAB with \
         save(\"x.mat\", \"x\", \"-v7\") or in Python with scipy.io.savemat"
        .to_owned())
}

/// All variables in their order.
fn variables(file: &mut (impl Read + Seek)) -> Result<Vec<Variable>, String> {
    let mut all = Vec::new();
    let mut offset = HEADER as u64;
    loop {
        file.seek(SeekFrom::Start(offset)).map_err(unreadable)?;
        let Some(tag) = Tag::read(file).map_err(unreadable)? else { return Ok(all) };
        offset += Tag::BYTES;
        let element = Element { offset, size: tag.size, is_compressed: tag.kind == COMPRESSED };
        if [MATRIX, COMPRESSED].contains(&tag.kind) {
            let found = element.open(file, |reader| Variable::read(reader, element));
            all.extend(found.map_err(|problem| format!("variable {}: {problem}", all.len() + 1))?);
        }
        offset += tag.after();
    }
}

/// The variable that is meant.
fn chosen<'a>(all: &'a [Variable], wanted: Option<&str>, file: &str) -> Result<&'a Variable, String> {
    let list = |variables: &[&Variable]| {
        let shown: Vec<String> = variables.iter().take(MOST_NAMED).map(ToString::to_string).collect();
        let rest = if variables.len() > MOST_NAMED { ", .." } else { "" };
        if shown.is_empty() { "nothing".to_owned() } else { shown.join(", ") + rest }
    };
    let everything: Vec<&Variable> = all.iter().collect();
    if let Some(wanted) = wanted {
        let found = all.iter().find(|variable| variable.name == wanted);
        return found
            .ok_or_else(|| format!("it has no variable {}; it holds {}", Quoted(wanted), list(&everything)));
    }
    let is_array = |variable: &&Variable| variable.is_numeric() && variable.count() != Some(1);
    let arrays: Vec<&Variable> = all.iter().filter(is_array).collect();
    match arrays[..] {
        [only] => Ok(only),
        [] => Err(format!(
            "it holds no array of samples but {}; save one as double or single",
            list(&everything)
        )),
        [first, ..] => Err(format!(
            "it holds {}; choose one, as {}:{}",
            list(&arrays),
            Quoted(file),
            Quoted(&first.name)
        )),
    }
}

/// The number called fs, if there is one greater than 0.
fn rate(file: &mut (impl Read + Seek), all: &[Variable]) -> Result<Option<f64>, String> {
    let is_rate = |variable: &&Variable| {
        let name = variable.name.to_ascii_lowercase();
        let is_number = variable.is_numeric() && variable.count() == Some(1);
        is_number && ["fs", "samplerate", "sample_rate"].contains(&name.as_str())
    };
    let Some(variable) = all.iter().find(is_rate) else { return Ok(None) };
    let rate = variable.parts(file, 1)?.first().and_then(|numbers| numbers.get(0));
    Ok(rate.filter(|rate| rate.is_finite() && *rate > 0.0))
}

impl Element {
    /// Calls `read` with what comes after the tag of the variable, which it inflates.
    fn open<T>(
        self,
        file: &mut (impl Read + Seek),
        read: impl FnOnce(&mut dyn Read) -> Result<T, String>,
    ) -> Result<T, String> {
        file.seek(SeekFrom::Start(self.offset)).map_err(unreadable)?;
        let mut bytes = file.take(self.size);
        if !self.is_compressed {
            return read(&mut bytes);
        }
        let mut inflated = ZlibDecoder::new(bytes);
        match Tag::read(&mut inflated).map_err(unreadable)? {
            Some(tag) if tag.kind == MATRIX => read(&mut inflated.take(tag.size)),
            _ => Err("it holds no variable; save it again".into()),
        }
    }
}

impl Variable {
    /// From its first elements; `None` for data of MATLAB's own that have no name.
    fn read(mut reader: &mut dyn Read, element: Element) -> Result<Option<Self>, String> {
        let mut next = |what: &str| -> Result<Vec<u8>, String> {
            let tag = Tag::read(&mut reader).map_err(unreadable)?;
            let tag = tag.ok_or_else(|| format!("its {what} is missing; copy it again"))?;
            tag.content(&mut reader, MOST_HEADER)
        };
        let words = |bytes: Vec<u8>| -> Vec<u32> {
            let word = |bytes: &[u8]| bytes.try_into().map_or(0, u32::from_le_bytes);
            bytes.chunks_exact(4).map(word).collect()
        };
        let flags = words(next("class")?).first().copied().ok_or("its class is missing; save it again")?;
        let shape = words(next("shape")?).into_iter().map(u64::from).collect();
        let name = String::from_utf8_lossy(&next("name")?).into_owned();
        // The lowest byte is the class; bit 9 is the flag of logical arrays, bit 11 that of complex numbers.
        let (class, is_logical, is_complex) = ((flags & 0xFF) as u8, flags & 0x200 != 0, flags & 0x800 != 0);
        let is_named = !name.is_empty();
        Ok(is_named.then_some(Self { name, class, is_logical, is_complex, shape, element }))
    }

    /// The numbers of the first `count` parts, real and imaginary.
    fn parts(&self, file: &mut (impl Read + Seek), count: usize) -> Result<Vec<Numbers>, String> {
        let numbers = self.count().ok_or_else(|| format!("the shape {} is too large", self.shape_text()))?;
        self.element.open(file, |mut reader| {
            Self::read(reader, self.element)?;
            (0..count).map(|_| Numbers::read(&mut reader, numbers)).collect()
        })
    }

    /// All samples in the order of the file, little-endian in the format of the class. Stored numbers may
    /// have fewer bytes than their class, which changes none of them.
    fn samples(&self, file: &mut (impl Read + Seek), format: PcmFormat) -> Result<Vec<u8>, String> {
        let parts = self.parts(file, 1 + usize::from(self.is_complex))?;
        let count = self.count().unwrap_or(0);
        let bytes = count.saturating_mul((parts.len() * format.bytes()) as u64);
        if bytes > MOST_BYTES {
            return Err(format!("its samples take {bytes} bytes, more than {MOST_BYTES}; save a part of it"));
        }
        let mut samples = Vec::new();
        let memory = samples.try_reserve_exact(bytes as usize);
        memory.map_err(|_| {
            format!("its samples take {bytes} bytes of memory, more than there is; save a part of it")
        })?;
        // Integers are codes, which the format divides by its full scale.
        let full_scale = if format.is_float() { 1.0 } else { 2f64.powi(8 * format.bytes() as i32 - 1) };
        let middle = if format.is_unsigned() { full_scale } else { 0.0 };
        let mut sample = vec![0; format.bytes()];
        for k in 0..count as usize {
            for numbers in &parts {
                format.encode((numbers.get(k).unwrap_or(f64::NAN) - middle) / full_scale, &mut sample);
                samples.extend(&sample);
            }
        }
        Ok(samples)
    }

    fn count(&self) -> Option<u64> {
        self.shape.iter().try_fold(1u64, |product, size| product.checked_mul(*size))
    }

    /// True for numbers and arrays of them.
    fn is_numeric(&self) -> bool {
        (6..=15).contains(&self.class)
    }

    /// The header of its samples.
    fn array(&self) -> Result<ArrayHeader, String> {
        let Some(format) = self.class().1.filter(|_| !self.is_logical) else {
            let class = if self.is_logical { "logical" } else { self.class().0 };
            return Err(format!(
                "it is {class}; save double, single, int8 to int64 or uint8 to uint32, for example double(x)"
            ));
        };
        let shape = self.shape.clone();
        Ok(ArrayHeader { format, is_complex: self.is_complex, shape, is_column_major: true, offset: 0 })
    }

    /// The name of its class, and the format of samples of this class.
    fn class(&self) -> (&'static str, Option<PcmFormat>) {
        match self.class {
            1 => ("a cell array", None),
            2 => ("a struct", None),
            3 | 16 | 17 => ("an object", None),
            4 => ("text", None),
            5 => ("a sparse matrix", None),
            6 => ("double", Some(PcmFormat::F64Le)),
            7 => ("single", Some(PcmFormat::F32Le)),
            8 => ("int8", Some(PcmFormat::S8)),
            9 => ("uint8", Some(PcmFormat::U8)),
            10 => ("int16", Some(PcmFormat::S16Le)),
            11 => ("uint16", Some(PcmFormat::U16Le)),
            12 => ("int32", Some(PcmFormat::S32Le)),
            13 => ("uint32", Some(PcmFormat::U32Le)),
            14 => ("int64", Some(PcmFormat::S64Le)),
            15 => ("uint64", None),
            _ => ("of an unknown class", None),
        }
    }

    fn shape_text(&self) -> String {
        Quoted(self.shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(" x ")).to_string()
    }
}

/// Name, shape and class.
impl fmt::Display for Variable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let complex = if self.is_complex { "complex " } else { "" };
        write!(f, "{} ({}, {complex}{})", Quoted(&self.name), self.shape_text(), self.class().0)
    }
}

/// The file and the variable that a name such as `x.mat:name` means; `None` for names of other files.
pub fn mat_variable(path: &Path) -> Option<(PathBuf, Option<&str>)> {
    let is_mat =
        |path: &Path| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mat"));
    if is_mat(path) {
        return Some((path.to_owned(), None));
    }
    let (file, variable) = path.to_str()?.rsplit_once(':')?;
    is_mat(Path::new(file)).then(|| (file.into(), Some(variable)))
}

#[cfg(test)]
mod tests;
