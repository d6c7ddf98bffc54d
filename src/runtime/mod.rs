//! Running a bank: kernels, reconstructor, pipeline. No allocation on the hot path, no design code.
