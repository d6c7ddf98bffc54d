//! Maps of numbers as other programs write them: OpenEXR, TIFF with floats or wide integers, NumPy arrays.

use super::Image;
use super::source::Source;
use crate::files::InputError;
use exr::meta::MetaData;
use exr::prelude::{ReadChannels, ReadLayers, read};
use npyz::{Deserialize, NpyFile, Order};
use std::io::Cursor;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};

type Decoded = Result<Image, InputError>;

/// Names of the channel with the depth among those of an OpenEXR file.
const DEPTHS: [&str; 5] = ["Z", "depth", "Depth", "depth.Z", "Depth.Z"];

pub(super) fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01])
}

pub(super) fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x93NUMPY")
}

fn is_tiff(bytes: &[u8]) -> bool {
    bytes.starts_with(b"II*\0") || bytes.starts_with(b"MM\0*")
}

/// An OpenEXR file: the channel with the depth, the only channel, or red, green and blue.
pub(super) fn exr(file: &Source<'_>) -> Decoded {
    let wrong = |e: exr::error::Error| file.wrong(e.to_string());
    let head = MetaData::read_from_buffered(Cursor::new(file.bytes), false).map_err(wrong)?;
    let mut sizes = head.headers.iter().map(|header| header.layer_size);
    sizes.try_for_each(|size| file.check_size(size.0, size.1))?;
    let layers = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
    let layer = layers.all_attributes().from_buffered(Cursor::new(file.bytes)).map_err(wrong)?.layer_data;
    let all = &layer.channel_data.list;
    let named = |name: &str| all.iter().find(|channel| channel.name.eq(name));
    let depth = DEPTHS.iter().find_map(|name| named(name)).or(all.first().filter(|_| all.len() == 1));
    let chosen = match (depth, ["R", "G", "B"].map(named)) {
        (Some(depth), _) => vec![depth],
        (None, [Some(red), Some(green), Some(blue)]) => vec![red, green, blue],
        _ => {
            let names: Vec<String> = all.iter().map(|channel| channel.name.to_string()).collect();
            return Err(file.wrong(format!(
                "the channels are {}; one named Z, a single channel, or R, G and B are read",
                names.join(", ")
            )));
        }
    };
    let size = (layer.size.0, layer.size.1);
    let values: Vec<Vec<f32>> = chosen.iter().map(|c| c.sample_data.values_as_f32().collect()).collect();
    if values.iter().any(|values| values.len() != size.0 * size.1) {
        return Err(file.wrong("a channel has fewer samples than the layer has pixels".into()));
    }
    let data = (0..size.0 * size.1).flat_map(|p| values.iter().map(move |channel| channel[p])).collect();
    Ok(Image::from_values(size, chosen.len(), data))
}

/// A TIFF file with numbers that no other image has: floats, or integers of 32 bits. `None` of another
/// file.
pub(super) fn tiff(file: &Source<'_>) -> Result<Option<Image>, InputError> {
    if !is_tiff(file.bytes) {
        return Ok(None);
    }
    let wrong = |e: tiff::TiffError| file.wrong(e.to_string());
    let mut decoder = Decoder::new(Cursor::new(file.bytes)).map_err(wrong)?;
    let (width, height) = decoder.dimensions().map_err(wrong)?;
    let size = (width as usize, height as usize);
    let channels = match decoder.colortype().map_err(wrong)? {
        ColorType::Gray(16..) => 1,
        ColorType::RGB(16..) => 3,
        _ => return Ok(None),
    };
    file.check_size(size.0, size.1)?;
    // As many bytes as so many pixels take at most.
    let mut limits = Limits::default();
    limits.decoding_buffer_size = size.0 * size.1 * channels * 8;
    limits.intermediate_buffer_size = limits.intermediate_buffer_size.max(limits.decoding_buffer_size);
    let mut decoder = decoder.with_limits(limits);
    let data: Vec<f32> = match decoder.read_image().map_err(wrong)? {
        DecodingResult::F16(values) => values.into_iter().map(f32::from).collect(),
        DecodingResult::F32(values) => values,
        DecodingResult::F64(values) => values.into_iter().map(|v| v as f32).collect(),
        DecodingResult::U32(values) => values.into_iter().map(|v| v as f32).collect(),
        DecodingResult::I32(values) => values.into_iter().map(|v| v as f32).collect(),
        DecodingResult::I16(values) => values.into_iter().map(f32::from).collect(),
        _ => return Ok(None),
    };
    match data.len() == size.0 * size.1 * channels {
        true => Ok(Some(Image::from_values(size, channels, data))),
        false => Err(file.wrong(format!("it has {} values for {width} x {height} pixels", data.len()))),
    }
}

/// A NumPy array of rows and columns, of any real numbers; dimensions of one are left out.
pub(super) fn npy(file: &Source<'_>) -> Decoded {
    let wrong = |e: std::io::Error| file.wrong(e.to_string());
    let array = NpyFile::new(file.bytes).map_err(wrong)?;
    let shape = array.shape().to_vec();
    let sides: Vec<usize> = shape.iter().filter(|side| **side != 1).map(|side| *side as usize).collect();
    let (height, width) = match (&sides[..], &shape[..]) {
        ([height, width], _) => (*height, *width),
        (_, [height, width]) => (*height as usize, *width as usize),
        _ => return Err(file.wrong(format!("the array has the shape {shape:?}; a map has rows and columns"))),
    };
    file.check_size(width, height)?;
    let is_by_columns = array.order() == Order::Fortran;
    let numbers = floats::<f32>(array, |v| v)
        .or_else(|array| floats::<f64>(array, |v| v as f32))
        .or_else(|array| floats::<u8>(array, f32::from))
        .or_else(|array| floats::<u16>(array, f32::from))
        .or_else(|array| floats::<i16>(array, f32::from))
        .or_else(|array| floats::<u32>(array, |v| v as f32))
        .or_else(|array| floats::<i32>(array, |v| v as f32))
        .or_else(|array| floats::<i64>(array, |v| v as f32));
    let numbers = match numbers {
        Ok(numbers) => numbers.map_err(wrong)?,
        Err(array) => {
            return Err(file.wrong(format!("numbers of the type {} are not read", array.dtype().descr())));
        }
    };
    if numbers.is_empty() || numbers.len() != width * height {
        return Err(file.wrong(format!("it has {} values for {width} x {height} pixels", numbers.len())));
    }
    let at = |p: usize| if is_by_columns { numbers[p % width * height + p / width] } else { numbers[p] };
    Ok(Image::from_values((width, height), 1, (0..numbers.len()).map(at).collect()))
}

type Bytes<'a> = NpyFile<&'a [u8]>;

/// The numbers of an array of this type, or the array again if its numbers have another one.
fn floats<'a, T: Deserialize>(
    array: Bytes<'a>,
    float: impl Fn(T) -> f32,
) -> Result<std::io::Result<Vec<f32>>, Bytes<'a>> {
    Ok(array.try_data::<T>()?.map(|number| number.map(&float)).collect())
}

#[cfg(test)]
mod tests {
    use crate::image::{MOST_PIXELS, read_image, read_map};
    use exr::prelude::{WritableImage, *};
    use npyz::WriterBuilder;
    use std::path::Path;

    const VALUES: [f32; 6] = [1.5, -2.0, 0.25, 1e6, f32::INFINITY, 7.0];

    fn write_exr(path: &Path, names: &[&str]) {
        let channel = |name: &&str| {
            let sign = if *name == "Z" || *name == "Y" { 1.0 } else { -1.0 };
            let values = VALUES.map(|v| sign * v).to_vec();
            AnyChannel::new(*name, FlatSamples::F32(values))
        };
        let channels = AnyChannels::sort(names.iter().map(channel).collect());
        let layer = Layer::new((3, 2), LayerAttributes::named("l"), Encoding::FAST_LOSSLESS, channels);
        Image::from_layer(layer).write().to_file(path).unwrap();
    }

    fn write_npy(path: &Path, shape: &[u64], order: npyz::Order, values: &[f32]) {
        let mut bytes = Vec::new();
        let options = npyz::WriteOptions::new().default_dtype().shape(shape).order(order);
        let mut writer = options.writer(&mut bytes).begin_nd().unwrap();
        writer.extend(values.iter().copied()).unwrap();
        writer.finish().unwrap();
        std::fs::write(path, bytes).unwrap();
    }

    #[test]
    fn every_format_gives_the_same_map() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        let is_read = |name: &str| {
            assert_eq!(read_map(&at(name), MOST_PIXELS).unwrap(), (3, 2, VALUES.to_vec()), "{name}");
        };
        for names in [&["Z", "R", "G"][..], &["Y"]] {
            write_exr(&at("a.exr"), names);
            is_read("a.exr");
        }
        let mut bytes = std::io::Cursor::new(Vec::new());
        let mut encoder = tiff::encoder::TiffEncoder::new(&mut bytes).unwrap();
        encoder.write_image::<tiff::encoder::colortype::Gray32Float>(3, 2, &VALUES).unwrap();
        std::fs::write(at("a.tiff"), bytes.into_inner()).unwrap();
        is_read("a.tiff");
        write_npy(&at("a.npy"), &[2, 3], npyz::Order::C, &VALUES);
        is_read("a.npy");
        write_npy(&at("a.npy"), &[1, 2, 3, 1], npyz::Order::C, &VALUES);
        is_read("a.npy");
        let [a, b, c, d, e, f] = VALUES;
        write_npy(&at("a.npy"), &[2, 3], npyz::Order::Fortran, &[a, d, b, e, c, f]);
        is_read("a.npy");
    }

    #[test]
    fn colours_of_floats_are_photographs() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        write_exr(&path, &["R", "G", "B"]);
        let image = read_image(&path, MOST_PIXELS).unwrap();
        assert_eq!((image.channels(), image.data()[3]), (3, 2.0 * 255.0));
    }

    #[test]
    fn what_is_no_map_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        let message = |name: &str| read_map(&at(name), MOST_PIXELS).unwrap_err().to_string();
        write_exr(&at("a.exr"), &["U", "V"]);
        assert!(message("a.exr").contains("the channels are U, V"), "{}", message("a.exr"));
        write_npy(&at("a.npy"), &[6], npyz::Order::C, &VALUES);
        assert!(message("a.npy").contains("shape [6]"), "{}", message("a.npy"));
        for (name, start) in
            [("b.exr", &[0x76, 0x2f, 0x31, 0x01][..]), ("b.npy", b"\x93NUMPY\x01"), ("b.tif", b"II*\0")]
        {
            std::fs::write(at(name), start).unwrap();
            assert!(message(name).contains(name), "{}", message(name));
        }
    }
}
