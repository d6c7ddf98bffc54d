//! Meshes and clouds of points in PLY files, text or binary: corners, and polygons as triangles.

use super::Mesh;
use hybank_core::messages::Quoted;
use nalgebra::Vector3;

/// The end of the header.
const END: &[u8] = b"end_header";

/// How a number is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

impl Kind {
    fn of(name: &str) -> Result<Self, String> {
        Ok(match name {
            "char" | "int8" => Self::Signed(1),
            "short" | "int16" => Self::Signed(2),
            "int" | "int32" => Self::Signed(4),
            "uchar" | "uint8" => Self::Unsigned(1),
            "ushort" | "uint16" => Self::Unsigned(2),
            "uint" | "uint32" => Self::Unsigned(4),
            "float" | "float32" => Self::Float(4),
            "double" | "float64" => Self::Float(8),
            _ => return Err(format!("the type \"{}\" of a property is unknown", Quoted(name))),
        })
    }

    /// A number from its bytes, the lowest first.
    fn value(self, bytes: [u8; 8]) -> f64 {
        let whole = u64::from_le_bytes(bytes);
        match self {
            Self::Signed(count) => ((whole as i64) << (64 - 8 * count) >> (64 - 8 * count)) as f64,
            Self::Unsigned(_) => whole as f64,
            Self::Float(4) => f64::from(f32::from_bits(whole as u32)),
            Self::Float(_) => f64::from_bits(whole),
        }
    }

    fn size(self) -> usize {
        let (Self::Signed(size) | Self::Unsigned(size) | Self::Float(size)) = self;
        size
    }
}

/// A property of an element; of a list also the kind of its length.
struct Property {
    name: String,
    length: Option<Kind>,
    kind: Kind,
}

struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

/// The numbers after the header.
enum Numbers<'a> {
    Words(std::str::SplitAsciiWhitespace<'a>),
    Bytes { rest: &'a [u8], is_little: bool },
}

impl Numbers<'_> {
    fn next(&mut self, kind: Kind) -> Option<f64> {
        match self {
            Self::Words(words) => words.next()?.parse().ok(),
            Self::Bytes { rest, is_little } => {
                let (bytes, after) = rest.split_at_checked(kind.size())?;
                *rest = after;
                let mut all = [0; 8];
                all[..bytes.len()].copy_from_slice(bytes);
                if !*is_little {
                    all[..bytes.len()].reverse();
                }
                Some(kind.value(all))
            }
        }
    }

    /// The numbers of a property: one, or those of a list.
    fn property(&mut self, property: &Property, into: &mut Vec<f64>) -> Option<()> {
        let count = property.length.map_or(Some(1.0), |kind| self.next(kind))?;
        into.clear();
        (0..count as usize).try_for_each(|_| self.next(property.kind).map(|value| into.push(value)))
    }
}

pub(super) fn decode(bytes: &[u8]) -> Result<Mesh, String> {
    let end = bytes.windows(END.len()).position(|part| part == END).ok_or("it is no PLY file")?;
    let header = std::str::from_utf8(&bytes[..end]).map_err(|_| "its header is no text")?;
    let line_end = bytes[end..].iter().position(|byte| *byte == b'\n').map_or(bytes.len(), |at| end + at + 1);
    let body = &bytes[line_end..];
    let format = header.lines().find_map(|line| line.strip_prefix("format ")).unwrap_or("").trim();
    let mut numbers = match format {
        "ascii 1.0" => {
            let text = std::str::from_utf8(body).map_err(|_| "it is no text, as its header says")?;
            Numbers::Words(text.split_ascii_whitespace())
        }
        "binary_little_endian 1.0" => Numbers::Bytes { rest: body, is_little: true },
        "binary_big_endian 1.0" => Numbers::Bytes { rest: body, is_little: false },
        other => return Err(format!("the format \"{}\" is unknown", Quoted(other))),
    };
    let (mut mesh, mut found) = (Mesh::default(), Vec::new());
    for element in elements(header)? {
        for number in 0..element.count {
            let mut point = Vector3::repeat(f64::NAN);
            for property in &element.properties {
                numbers.property(property, &mut found).ok_or_else(|| {
                    format!("{} {number} of {} is cut off or no number", Quoted(&element.name), element.count)
                })?;
                match (element.name.as_str(), property.name.as_str()) {
                    ("vertex", name) => {
                        if let (Some(axis), [value]) =
                            (["x", "y", "z"].iter().position(|n| *n == name), &found[..])
                        {
                            point[axis] = *value;
                        }
                    }
                    ("face", "vertex_indices" | "vertex_index") => mesh.add_polygon(&found),
                    _ => (),
                }
            }
            if element.name == "vertex" {
                mesh.corners.push(point);
            }
        }
    }
    mesh.checked()
}

fn elements(header: &str) -> Result<Vec<Element>, String> {
    let mut elements: Vec<Element> = Vec::new();
    for line in header.lines() {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let property = match words[..] {
            ["element", name, count] => {
                let count =
                    count.parse().map_err(|_| format!("\"{}\" is no number of elements", Quoted(count)))?;
                elements.push(Element { name: name.into(), count, properties: Vec::new() });
                continue;
            }
            ["property", "list", length, kind, name] => {
                Property { name: name.into(), length: Some(Kind::of(length)?), kind: Kind::of(kind)? }
            }
            ["property", kind, name] => Property { name: name.into(), length: None, kind: Kind::of(kind)? },
            _ => continue,
        };
        elements.last_mut().ok_or("a property stands before all elements")?.properties.push(property);
    }
    // Nothing would end a long list of them.
    let empty = elements.iter().find(|element| element.properties.is_empty() && element.count > 0);
    let empty = empty.map(|element| format!("element \"{}\" has no property", Quoted(&element.name)));
    empty.map_or(Ok(elements), Err)
}
