//! The trade-off between the order of a bank and its error.

/// The error of a bank in normalised time (h = 1).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Figures {
    /// gamma = ||K||, the H-infinity norm of the error system.
    pub gamma: f64,
    /// Root mean square of the error per fast sample, `||K||_2 / sqrt(M)`.
    pub rms_error: f64,
}

/// A point of the trade-off between order and error.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct OrderErrorPoint {
    /// Number of states.
    pub order: usize,
    /// The error of the best bank found with at most so many states.
    #[serde(flatten)]
    pub figures: Figures,
    /// Excess over the full bank in decibels of the quantity that the method minimises: gamma (`iir`) or the
    /// mean-square error (`h2`).
    pub loss_db: f64,
}

/// The result of an order search.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct OrderReduction {
    /// The bank of the method, not reduced.
    pub full: OrderErrorPoint,
    /// The bank chosen.
    pub reduced: OrderErrorPoint,
    /// The order/error trade-off: all orders searched, ascending. All orders below the full one where that
    /// is cheap.
    pub orders: Vec<OrderErrorPoint>,
}
