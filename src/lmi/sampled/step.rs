//! The iteration record of the sampled solver.

/// One line of the iteration record. The objective is in scaled units (`t` for the worst case, the
/// mean square for the secondary objective).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Objective at the start of the step.
    pub objective: f64,
    /// Mean complementarity, `sum <S_l, Z_l>` over the total order.
    pub mu: f64,
    /// Norm of the dual equality residual.
    pub dual_residual: f64,
    /// Step length of the taps.
    pub alpha_primal: f64,
    /// Step length of the dual matrices.
    pub alpha_dual: f64,
    /// Diagonal shift that the Newton matrix needed (0 nearly always).
    pub shift: f64,
}
