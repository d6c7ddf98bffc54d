//! From a spec to a bank: exact equivalence, blocking, IIR, H2 and FIR design, certificates.
