//! Samples in and out: WAV, raw PCM, whole-file writers.
