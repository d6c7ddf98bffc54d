//! Formats of numbers in the byte order of this machine, and their digits.

use hybank_runtime::{PcmFormat, Precision};

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
