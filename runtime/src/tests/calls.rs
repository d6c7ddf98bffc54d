//! Calls and banks that are refused.

use super::support::{Bank, Filters, fir_bank, rotation_bank, start};
use crate::{BuildError, Options, PcmFormat, PcmOutput, ProcessError, SideBySide, Zeros};

#[test]
fn calls_and_banks_that_do_not_fit_are_refused() {
    let bank = fir_bank(vec![vec![1.0], vec![1.0]], 2);
    let mut stream = start(&bank, Options::default()).unwrap();
    let mut out = [0.0; 3];
    for (samples, result) in [
        (3, Err(ProcessError::PartialFrame { samples: 3, channels: 2 })),
        (4, Err(ProcessError::OutputTooShort { given: 3, wanted: 4 })),
        (0, Ok(0)),
    ] {
        assert_eq!(stream.process(&[0.0; 4][..samples], &mut out), result);
    }
    let mut output = PcmOutput::packed(PcmFormat::S8, &mut []);
    let none = stream.run(&SideBySide::new(&[] as &[Zeros]), &mut output);
    assert_eq!(none, Err(ProcessError::Channels { given: 0, wanted: 2 }));

    // More samples than can be counted; the product once wrapped to 0.
    let endless = Zeros { channels: 2, frames: usize::MAX / 2 + 1 };
    let refused = stream.run(&endless, &mut out.as_mut_slice());
    assert_eq!(refused, Err(ProcessError::TooManyFrames { frames: endless.frames, ratio: 2 }));

    let refused = |bank: Bank| start(&bank, Options::default()).unwrap_err();
    assert_eq!(refused(Bank { ratio: 0, ..bank.clone() }), BuildError::NoRatio);
    assert_eq!(refused(fir_bank(vec![], 2)), BuildError::NoChannels);
    // Finite in f64, infinite in f32.
    assert!(matches!(refused(fir_bank(vec![vec![0.0, 1e300]], 2)), BuildError::NotFinite { index: 1, .. }));
    let mut wrong = rotation_bank();
    if let Filters::StateSpace(filter) = &mut wrong.filters {
        filter.c.pop();
    }
    assert!(
        refused(wrong).to_string().contains("matrix c of the state-space filters is 2 x 2; 3 x 2 is needed")
    );
}
