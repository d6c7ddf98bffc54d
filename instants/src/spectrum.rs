//! The spectrum of the analog signal, as nodes of a quadrature.

use hybank_core::units::{CyclesPerFastPeriod, FastPeriods};
use hybank_linalg::GAUSS_LEGENDRE;
use std::ops::Range;

/// Most cycles of e^{2 pi j f t} over a panel of eight nodes: the rule is exact to 2e-15 there.
const CYCLES_PER_PANEL: f64 = 0.5;
/// Fewest panels up to the highest frequency of all, half a cycle per fast period, for front ends that
/// change on the way.
const LEAST_PANELS: f64 = 16.0;

/// A frequency with its share of the power of the signal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// Above 0; its mirror frequency is meant, too.
    pub frequency: CyclesPerFastPeriod,
    /// Share of the power. The shares of a spectrum have the sum 1.
    pub power: f64,
}

/// The spectrum of a signal of power 1.
///
/// Integrals over it are sums over its nodes. They hold for times up to [`Spectrum::longest`].
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    nodes: Vec<Node>,
    longest: FastPeriods,
}

impl Spectrum {
    /// Flat in a band, for times up to `longest`.
    pub fn flat(band: Range<CyclesPerFastPeriod>, longest: FastPeriods) -> Self {
        Self::of_pieces([(band, 1.0)], longest)
    }

    /// Of constant density in each of some bands, for times up to `longest`. Densities are relative.
    pub fn of_pieces(
        pieces: impl IntoIterator<Item = (Range<CyclesPerFastPeriod>, f64)>,
        longest: FastPeriods,
    ) -> Self {
        let mut nodes: Vec<Node> =
            pieces.into_iter().flat_map(|(band, density)| piece(band, density, longest)).collect();
        let power: f64 = nodes.iter().map(|node| node.power).sum();
        nodes.iter_mut().for_each(|node| node.power /= power);
        Self { nodes, longest }
    }

    /// The nodes, by frequency.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The longest time between two instants for which integrals hold.
    pub fn longest(&self) -> FastPeriods {
        self.longest
    }
}

fn piece(
    Range { start: CyclesPerFastPeriod(low), end: CyclesPerFastPeriod(high) }: Range<CyclesPerFastPeriod>,
    density: f64,
    longest: FastPeriods,
) -> Vec<Node> {
    let cycles = (high - low) * longest.0;
    let panels = (cycles / CYCLES_PER_PANEL).max(2.0 * LEAST_PANELS * (high - low)).ceil().max(1.0) as usize;
    let width = (high - low) / panels as f64;
    let node = |panel: usize, (part, share): (f64, f64)| Node {
        frequency: CyclesPerFastPeriod(low + (panel as f64 + part) * width),
        power: density * share * width,
    };
    (0..panels).flat_map(|panel| GAUSS_LEGENDRE.map(|of_rule| node(panel, of_rule))).collect()
}
