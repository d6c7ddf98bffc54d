//! The face of all letters. With the feature `png` it is carried along, so that a picture is the same
//! wherever it is drawn.

use plotters::style::{FontDesc, IntoFont};

/// Letters of so many enlarged pixels.
pub(super) fn letters(size: u32) -> FontDesc<'static> {
    #[cfg(feature = "png")]
    register();
    ("sans-serif", size).into_font()
}

#[cfg(feature = "png")]
fn register() {
    use plotters::style::{FontStyle, register_font};
    static REGISTERED: std::sync::Once = std::sync::Once::new();
    REGISTERED.call_once(|| {
        // A face that cannot be read fails where it is drawn, with a message.
        let _ = register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular());
    });
}
