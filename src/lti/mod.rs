//! Discrete-time state-space systems: Gramians, norms, Riccati equations. Knows no filter bank.
