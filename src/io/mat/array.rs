//! An array of a file.

use super::element::{self, Numbers, Order};
use super::variable::{HEADER, Variable, variables};
use crate::io::{IoError, PcmFormat, SampleLayout, StreamHeader};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Variables that a message names.
const MOST_NAMED: usize = 8;

/// An array of samples in a MATLAB file.
#[derive(Debug)]
pub struct MatArray {
    pub(super) variable: Variable,
    rate: Option<f64>,
    pub(super) order: Order,
    pub(super) format: PcmFormat,
    /// Columns of real and, for complex samples, imaginary parts, as stored.
    pub(super) parts: Vec<Numbers>,
}

impl MatArray {
    /// Reads the variable called `wanted`, or the only array of a file called `file`.
    ///
    /// # Errors
    /// [`IoError::Malformed`] for other files and for variables that are no captures.
    pub fn read(file: &mut (impl Read + Seek), wanted: Option<&str>, name: &str) -> Result<Self, IoError> {
        let fault = |problem: String| IoError::Malformed {
            file: name.to_owned(),
            kind: "a MATLAB file of samples",
            problem,
        };
        let order = header(file).map_err(fault)?;
        let all = variables(file, order).map_err(fault)?;
        let variable = chosen(&all, wanted, name).map_err(fault)?.clone();
        let of_variable = |problem: String| fault(format!("variable {}: {problem}", variable.name));
        let format = variable.format().map_err(of_variable)?;
        variable.check_shape().map_err(of_variable)?;
        let parts = variable.numbers(file, order, variable.parts()).map_err(of_variable)?;
        let rate = rate(file, order, &all).map_err(fault)?;
        Ok(Self { variable, rate, order, format, parts })
    }

    /// Name of the variable.
    pub fn name(&self) -> &str {
        &self.variable.name
    }

    /// Channels.
    pub fn channels(&self) -> usize {
        self.variable.channels() as usize
    }

    /// Samples of each channel.
    pub fn frames(&self) -> u64 {
        self.variable.frames()
    }

    /// As the header of an input.
    pub fn stream_header(&self) -> StreamHeader {
        let real = StreamHeader::real(SampleLayout::packed(self.format), self.channels());
        let is_complex = self.variable.is_complex;
        StreamHeader { is_complex, rate: self.rate, promised: Some(self.frames()), ..real }
    }
}

/// The byte order, from the header of the file.
fn header(file: &mut (impl Read + Seek)) -> Result<Order, String> {
    const REMEDY: &str =
        "save it in MATLAB with save(\"x.mat\", \"x\", \"-v7\") or in Python with scipy.io.savemat";
    let mut bytes = [0; HEADER];
    let filled = file.seek(SeekFrom::Start(0)).and_then(|_| element::fill(file, &mut bytes));
    let filled = filled.map_err(|error| format!("cannot read its header: {error}"))?;
    if bytes.starts_with(b"\x89HDF") || bytes.starts_with(b"MATLAB 7.3") {
        return Err(format!("it is of version 7.3 (HDF5), which is not read; {REMEDY}"));
    }
    if filled < HEADER {
        return Err(format!("it has {filled} bytes, and the header alone has {HEADER}; {REMEDY}"));
    }
    let (version, order) = match &bytes[126..] {
        b"IM" => ([bytes[125], bytes[124]], Order::Little),
        b"MI" => ([bytes[124], bytes[125]], Order::Big),
        _ => return Err(format!("bytes 126 and 127 are not IM or MI as in version 5; {REMEDY}")),
    };
    if version == [1, 0] { Ok(order) } else { Err(format!("its version {version:?} is not 5; {REMEDY}")) }
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
        return found.ok_or_else(|| format!("it has no variable {wanted}; it holds {}", list(&everything)));
    }
    let arrays: Vec<&Variable> = all.iter().filter(|variable| variable.is_array()).collect();
    match arrays[..] {
        [only] => Ok(only),
        [] => Err(format!(
            "it holds no array of samples but {}; save one as double or single",
            list(&everything)
        )),
        [first, ..] => Err(format!("it holds {}; choose one, as {file}:{}", list(&arrays), first.name)),
    }
}

/// The number called fs, if there is one greater than 0.
fn rate(file: &mut (impl Read + Seek), order: Order, all: &[Variable]) -> Result<Option<f64>, String> {
    let named = |variable: &&Variable| {
        let name = variable.name.to_ascii_lowercase();
        variable.is_number() && ["fs", "samplerate", "sample_rate"].contains(&name.as_str())
    };
    let Some(variable) = all.iter().find(named) else { return Ok(None) };
    let numbers = variable.numbers(file, order, 1)?;
    let rate = numbers.first().and_then(|numbers| numbers.get(0, order));
    Ok(rate.filter(|rate| rate.is_finite() && *rate > 0.0))
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
