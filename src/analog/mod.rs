//! Analog front ends: transfer functions, filter families, realisations, responses.
