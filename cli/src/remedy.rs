//! The options of this program that remedy an error of the library. The library itself names keys of the
//! spec and fields, because its errors are also read in Python, in C and in a browser.

use hybank::calibrate::{CalibrateError, Warning};
use hybank::design::DesignError;
use hybank::files::FileError;
use hybank::interchange::ExportError;
use hybank::io::IoError;
use hybank::pipeline::PipelineError;
use hybank::track::{AlignError, TrackError};
use hybank::verify::VerifyError;
use std::any::Any;
use std::fmt::Display;

/// The text of an error or a warning, followed by the option that remedies it.
pub(super) fn explained(error: &(impl Display + 'static)) -> String {
    option(error).map_or_else(|| error.to_string(), |option| format!("{error}; {option}"))
}

fn option(error: &dyn Any) -> Option<&'static str> {
    let of_file = |error: &FileError| match error {
        FileError::Exists { .. } => Some("--force replaces it"),
        FileError::Special { .. } => Some("or write to `-` and redirect"),
        _ => None,
    };
    None.or_else(|| of_file(error.downcast_ref()?))
        .or_else(|| match error.downcast_ref()? {
            IoError::File(error) => of_file(error),
            _ => None,
        })
        .or_else(|| match error.downcast_ref()? {
            PipelineError::File(error) | PipelineError::Io(IoError::File(error)) => of_file(error),
            _ => None,
        })
        .or_else(|| of_design(error.downcast_ref()?))
        .or_else(|| of_proof(error.downcast_ref()?))
        .or_else(|| of_calibration(error.downcast_ref()?))
        .or_else(|| match error.downcast_ref()? {
            Warning::CutoffExplains { .. } => Some("--fit takes that list"),
            _ => None,
        })
        .or_else(|| match error.downcast_ref()? {
            ExportError::NoIntegers { .. } => Some("`hybank design --method fir --bits B` designs them"),
            ExportError::Offset { .. } => Some("--input-bits B does"),
            ExportError::NoWords => Some("leave out --input-bits"),
            _ => None,
        })
        .or_else(|| match error.downcast_ref()? {
            AlignError::Ambiguous { .. } => Some("--within says so"),
            AlignError::Spec(error) => of_calibration(error),
            _ => None,
        })
        .or_else(|| match error.downcast_ref()? {
            TrackError::NoTapSlopes => Some("`hybank design --tracking affine` designs such taps"),
            _ => None,
        })
}

fn of_design(error: &DesignError) -> Option<&'static str> {
    match error {
        DesignError::TooLong { .. } | DesignError::TooLarge { .. } => Some("--no-limit runs it all the same"),
        DesignError::StoppedWithoutBank { .. } => Some("--no-limit runs it to its end"),
        DesignError::Verify(error) => of_proof(error),
        _ => None,
    }
}

fn of_proof(error: &VerifyError) -> Option<&'static str> {
    match error {
        VerifyError::NoCertificate => {
            Some("`hybank design` writes one, and `hybank verify --search` searches for one")
        }
        VerifyError::WideBox => Some("the box is that of --delay-box, --gain-box and --cutoff-box"),
        _ => None,
    }
}

fn of_calibration(error: &CalibrateError) -> Option<&'static str> {
    match error {
        CalibrateError::ComplexSamples { .. } => Some("--tone names them, or finds them with `auto`"),
        CalibrateError::AmbiguousZone { .. } => Some("--tone takes it"),
        CalibrateError::NotIdentifiable | CalibrateError::CutoffLooksLikeDelay { .. } => {
            Some("--fit takes what is fitted")
        }
        _ => None,
    }
}
