//! Packed floats of this machine's byte order are read and written where they lie; all others are converted.

use hybank_runtime::{
    FrameSink, FrameSource, Isa, PcmFormat, PcmFrames, PcmOutput, Precision, SampleLayout, SideBySide,
};

const NATIVE: PcmFormat = PcmFormat::F32Le.native();
const FOREIGN: PcmFormat = if cfg!(target_endian = "big") { PcmFormat::F32Le } else { PcmFormat::F32Be };

fn frames(format: PcmFormat, channels: usize, bytes: &[u8]) -> PcmFrames<'_> {
    PcmFrames { layout: SampleLayout::packed(format), channels, bytes }
}

fn loaded(frames: &PcmFrames<'_>) -> Vec<f32> {
    let mut samples = vec![0.0; frames.frames() * frames.channels];
    frames.load_f32(Isa::detect(), 0, &mut samples);
    samples
}

#[test]
fn frames_are_read_where_they_lie() {
    let numbers = [1.0f32, -0.5, 0.25, 2.0, 3.0];
    let bytes: &[u8] = bytemuck::cast_slice(&numbers);
    let whole = frames(NATIVE, 2, bytes);
    // The last sample is no frame.
    assert_eq!(whole.in_memory_f32().unwrap(), &numbers[..4]);
    assert_eq!(whole.in_memory_f32().unwrap().as_ptr(), numbers.as_ptr());
    assert_eq!(whole.in_memory_f32().unwrap(), loaded(&whole));
    for apart in
        [frames(FOREIGN, 2, bytes), frames(NATIVE, 2, &bytes[1..]), frames(PcmFormat::S16Le, 2, bytes)]
    {
        assert!(apart.in_memory_f32().is_none());
    }
    assert!(whole.in_memory_f64().is_none());
    assert!(SideBySide::new(&[whole, whole][..]).in_memory_f32().is_none());
    assert!(whole.part(1).in_memory_f32().is_none());
}

#[test]
fn samples_are_written_where_they_lie() {
    let mut numbers = [0.0f64; 4];
    let native = PcmFormat::F64Le.native();
    let mut output = PcmOutput::packed(native, bytemuck::cast_slice_mut(&mut numbers));
    assert!(output.slots_f32(0..1).is_none());
    output.slots_f64(1..3).unwrap().copy_from_slice(&[0.5, -2.0]);
    output.store_f64(Isa::detect(), 3, &[7.0]);
    output.select(1);
    assert!(output.slots_f64(0..1).is_none());
    assert_eq!(numbers, [0.0, 0.5, -2.0, 7.0]);
    let mut empty = PcmOutput::packed(native, &mut []);
    empty.select(1);
    assert!(empty.slots_f64(0..0).is_none());
    let mut bytes = [0u8; 9];
    assert!(PcmOutput::packed(PcmFormat::S16Le, &mut bytes).slots_f32(0..1).is_none());
}

#[test]
fn formats_have_a_native_order_and_a_precision() {
    for format in PcmFormat::ALL {
        let native = format.native();
        assert_eq!(
            (native.native(), native.bytes(), native.is_float()),
            (native, format.bytes(), format.is_float())
        );
        let has_more_digits = matches!(format.bytes(), 4 | 8) && !(format.is_float() && format.bytes() == 4);
        assert_eq!(Precision::of(format) == Precision::Double, has_more_digits, "{format}");
    }
    assert_eq!(PcmFormat::S16Be.native(), PcmFormat::S16Le.native());
    assert_eq!(PcmFormat::U8.native(), PcmFormat::U8);
}
