//! The variables of a file: their names, classes and shapes.

use super::element::{COMPRESSED, Inflater, MATRIX, Numbers, Order, Tag, unreadable};
use crate::io::PcmFormat;
use std::fmt;
use std::io::{Read, Seek, SeekFrom};

/// Bytes before the first variable.
pub(super) const HEADER: usize = 128;
/// Maximum number of channels, the same as in a WAV header.
const MOST_CHANNELS: u64 = 65_535;

/// Most bytes of the shape and of the name of a variable.
const MOST_HEADER: u64 = 4096;

/// What a file says of a variable.
#[derive(Debug, Clone)]
pub(super) struct Variable {
    pub(super) name: String,
    class: u8,
    pub(super) is_complex: bool,
    shape: Vec<u64>,
    place: Place,
}

/// Where the element of a variable is.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// Of its first byte after the tag.
    offset: u64,
    size: u64,
    is_compressed: bool,
}

/// All variables in their order.
pub(super) fn variables(file: &mut (impl Read + Seek), order: Order) -> Result<Vec<Variable>, String> {
    let mut all = Vec::new();
    let mut offset = HEADER as u64;
    loop {
        file.seek(SeekFrom::Start(offset)).map_err(unreadable)?;
        let Some(tag) = Tag::read(file, order).map_err(unreadable)? else { return Ok(all) };
        offset += Tag::BYTES;
        let place = Place { offset, size: tag.size, is_compressed: tag.kind == COMPRESSED };
        if [MATRIX, COMPRESSED].contains(&tag.kind) {
            let found = place.open(file, order, |reader| Variable::read(reader, order, place));
            all.extend(found.map_err(|problem| format!("variable {}: {problem}", all.len() + 1))?);
        }
        offset += tag.after();
    }
}

impl Place {
    /// Calls `read` with what comes after the tag of the variable, which it inflates.
    fn open<T>(
        self,
        file: &mut (impl Read + Seek),
        order: Order,
        read: impl FnOnce(&mut dyn Read) -> Result<T, String>,
    ) -> Result<T, String> {
        file.seek(SeekFrom::Start(self.offset)).map_err(unreadable)?;
        let mut bytes = file.take(self.size);
        if !self.is_compressed {
            return read(&mut bytes);
        }
        let mut inflater = Inflater::new(bytes);
        match Tag::read(&mut inflater, order).map_err(unreadable)? {
            Some(tag) if tag.kind == MATRIX => read(&mut inflater.take(tag.size)),
            _ => Err("it holds no variable; save it again".into()),
        }
    }
}

impl Variable {
    /// From its first elements; `None` for data of MATLAB's own that have no name.
    fn read(reader: &mut dyn Read, order: Order, place: Place) -> Result<Option<Self>, String> {
        let mut reader = reader;
        let mut next = |what: &str| -> Result<Vec<u8>, String> {
            let tag = Tag::read(&mut reader, order).map_err(unreadable)?;
            let tag = tag.ok_or_else(|| format!("its {what} is missing; copy it again"))?;
            tag.content(&mut reader, MOST_HEADER)
        };
        let words = |bytes: Vec<u8>| -> Vec<u32> {
            let word = |bytes: &[u8]| bytes.try_into().map_or(0, |bytes| order.u32(bytes));
            bytes.chunks_exact(4).map(word).collect()
        };
        let flags = words(next("class")?).first().copied().ok_or("its class is missing; save it again")?;
        let shape = words(next("shape")?).into_iter().map(u64::from).collect();
        let name = String::from_utf8_lossy(&next("name")?).into_owned();
        let (class, is_complex) = ((flags & 0xFF) as u8, flags & 0x800 != 0);
        let is_named = !name.is_empty();
        Ok(is_named.then_some(Self { name, class, is_complex, shape, place }))
    }

    /// Parts of a sample.
    pub(super) fn parts(&self) -> usize {
        1 + usize::from(self.is_complex)
    }

    /// The numbers of the first `parts` parts.
    pub(super) fn numbers(
        &self,
        file: &mut (impl Read + Seek),
        order: Order,
        parts: usize,
    ) -> Result<Vec<Numbers>, String> {
        let count = self.count().ok_or_else(|| format!("the shape {} is too large", self.shape_text()))?;
        self.place.open(file, order, |reader| {
            Self::read(reader, order, self.place)?;
            let mut reader = reader;
            (0..parts).map(|_| Numbers::read(&mut reader, order, count)).collect()
        })
    }

    fn count(&self) -> Option<u64> {
        self.shape.iter().try_fold(1u64, |product, size| product.checked_mul(*size))
    }

    /// Rows and columns; further axes have one element.
    fn rows_and_columns(&self) -> Option<(u64, u64)> {
        match self.shape[..] {
            [rows, columns, ref more @ ..] if more.iter().all(|&size| size == 1) => Some((rows, columns)),
            _ => None,
        }
    }

    /// True for numbers and arrays of them.
    fn is_numeric(&self) -> bool {
        (6..=15).contains(&self.class)
    }

    /// True for more than one number.
    pub(super) fn is_array(&self) -> bool {
        self.is_numeric() && self.count() != Some(1)
    }

    pub(super) fn is_number(&self) -> bool {
        self.is_numeric() && self.count() == Some(1)
    }

    /// Where the rows are the channels.
    pub(super) fn rows_are_channels(&self) -> bool {
        self.rows_and_columns().is_some_and(|(rows, columns)| rows <= columns)
    }

    pub(super) fn channels(&self) -> u64 {
        self.rows_and_columns().map_or(0, |(rows, columns)| rows.min(columns))
    }

    pub(super) fn frames(&self) -> u64 {
        self.rows_and_columns().map_or(0, |(rows, columns)| rows.max(columns))
    }

    /// Refuses what has no channels and frames.
    pub(super) fn check_shape(&self) -> Result<(), String> {
        let shape = self.shape_text();
        if self.rows_and_columns().is_none() {
            return Err(format!(
                "it has the shape {shape}; give (samples x channels) or (channels x samples)"
            ));
        }
        match self.channels() {
            channels if !(1..=MOST_CHANNELS).contains(&channels) => {
                Err(format!("the shape {shape} has {channels} channels; it may be 1 to {MOST_CHANNELS}"))
            }
            _ => Ok(()),
        }
    }

    /// The format of its samples.
    pub(super) fn format(&self) -> Result<PcmFormat, String> {
        match self.class {
            6 => Ok(PcmFormat::F64Le),
            7 => Ok(PcmFormat::F32Le),
            8 => Ok(PcmFormat::S8),
            9 => Ok(PcmFormat::U8),
            10 => Ok(PcmFormat::S16Le),
            12 => Ok(PcmFormat::S32Le),
            _ => Err(format!(
                "it is {}; save double, single, int8, uint8, int16 or int32, for example double(x)",
                self.class_name()
            )),
        }
    }

    fn class_name(&self) -> &'static str {
        match self.class {
            1 => "a cell array",
            2 => "a struct",
            3 | 16 | 17 => "an object",
            4 => "text",
            5 => "a sparse matrix",
            6 => "double",
            7 => "single",
            8 => "int8",
            9 => "uint8",
            10 => "int16",
            11 => "uint16",
            12 => "int32",
            13 => "uint32",
            14 => "int64",
            15 => "uint64",
            _ => "of an unknown class",
        }
    }

    fn shape_text(&self) -> String {
        self.shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(" x ")
    }
}

/// Name, shape and class.
impl fmt::Display for Variable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let complex = if self.is_complex { "complex " } else { "" };
        write!(f, "{} ({}, {complex}{})", self.name, self.shape_text(), self.class_name())
    }
}
