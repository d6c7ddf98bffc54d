//! Complex samples (IQ) through real filters.

use crate::adapters::{ComplexInput, ComplexOutput, Part};
use crate::{Plan, ProcessError, Sample, StateError, Stream, SwapError};

/// Filters complex samples: real and imaginary parts are two real [streams](Stream) through one plan.
///
/// A complex sample is an array of its real and its imaginary part; N of them are a frame. All that is said
/// of real streams holds for each part; the offset of a channel is subtracted from both.
///
/// ```
/// use hybank_runtime::{ComplexStream, Options, Plan};
/// let plan = Plan::from_taps(&[vec![2.0, 3.0]], 2, 0, Options::default())?;
/// let mut stream = ComplexStream::new(&plan);
/// let mut output = [[0.0f32; 2]; 2];
/// stream.process(&[[1.0, -1.0]], &mut output)?;
/// assert_eq!(output, [[2.0, -2.0], [3.0, -3.0]]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct ComplexStream {
    real: Stream,
    imaginary: Stream,
}

impl ComplexStream {
    /// A stream at its beginning.
    pub fn new(plan: &Plan) -> Self {
        Self { real: Stream::new(plan), imaginary: Stream::new(plan) }
    }

    /// What the stream runs by.
    pub fn plan(&self) -> &Plan {
        self.real.plan()
    }

    /// Real numbers of the input, two per sample, that were NaN or infinite and became 0, since the
    /// beginning.
    pub fn replaced(&self) -> u64 {
        self.real.replaced() + self.imaginary.replaced()
    }

    /// Back to the beginning; gives the same bits as a new stream.
    pub fn reset(&mut self) {
        self.real.reset();
        self.imaginary.reset();
    }

    /// As [`Stream::process`]: frame k is `input[k N..][..N]`, its output `output[k M..][..M]`. Returns the
    /// complex samples written. Does not allocate.
    ///
    /// # Errors
    /// As [`Stream::process`].
    pub fn process<S: Sample>(
        &mut self,
        input: &[[S; 2]],
        output: &mut [[S; 2]],
    ) -> Result<usize, ProcessError> {
        let channels = self.plan().channels();
        if !input.len().is_multiple_of(channels) {
            return Err(ProcessError::PartialFrame { samples: input.len(), channels });
        }
        for (stream, part) in [(&mut self.real, Part::Real), (&mut self.imaginary, Part::Imaginary)] {
            let input = ComplexInput { samples: input, channels, part };
            stream.run(&input, &mut ComplexOutput { samples: output, part })?;
        }
        Ok(input.len() / channels * self.plan().ratio())
    }

    /// As [`Stream::flush`], in complex samples.
    ///
    /// # Errors
    /// As [`Stream::flush`].
    pub fn flush<S: Sample>(&mut self, output: &mut [[S; 2]]) -> Result<usize, ProcessError> {
        self.real.flush(&mut ComplexOutput { samples: output, part: Part::Real })?;
        self.imaginary.flush(&mut ComplexOutput { samples: output, part: Part::Imaginary })
    }

    /// As [`Stream::state`]: the state of the real part, then that of the imaginary part, of one length.
    pub fn state(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.real.state_bytes() + self.imaginary.state_bytes());
        self.real.save(&mut bytes);
        self.imaginary.save(&mut bytes);
        bytes
    }

    /// As [`Stream::resume`].
    ///
    /// # Errors
    /// As [`Stream::resume`].
    pub fn resume(&mut self, state: &[u8]) -> Result<(), StateError> {
        let (real, imaginary) = state.split_at(state.len() / 2);
        let (real, imaginary) = (self.real.read(real)?, self.imaginary.read(imaginary)?);
        if real.0.position != imaginary.0.position {
            return Err(StateError::Damaged);
        }
        self.real.go_on(real.0, real.1);
        self.imaginary.go_on(imaginary.0, imaginary.1);
        Ok(())
    }

    /// As [`Stream::continue_from`].
    ///
    /// # Errors
    /// As [`Stream::continue_from`].
    pub fn continue_from(&mut self, running: &Self) -> Result<(), SwapError> {
        self.real.continue_from(&running.real)?;
        self.imaginary.continue_from(&running.imaginary)
    }
}
