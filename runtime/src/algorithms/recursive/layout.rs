//! Where things lie when a state-space bank runs, and its coefficients in that order.

use super::delay_lines::{DelayLines, DelayedInput};
use crate::BuildError;
use crate::aligned::Aligned;
use crate::simd::{
    ColumnTile, FirKernel, Polyphase, Recursion, RecursionForm, SectionVector, Tiling, group_lanes,
};

/// Where things lie: in a history of frames of N inputs, and in rows of S states.
pub(super) struct HistoryLayout {
    /// Of the recursion.
    lanes: usize,
    channels: usize,
    inputs: Tiling,
    /// S.
    states: usize,
    state_rows: Tiling,
    /// Place of each state among the S.
    places: Vec<usize>,
    parallel: bool,
}

impl HistoryLayout {
    /// For N channels and M phases, and a recursion in vectors of `lanes`.
    pub(super) fn new(
        delay_lines: &DelayLines,
        channels: usize,
        ratio: usize,
        lanes: usize,
        kernel: FirKernel<f64>,
    ) -> Result<Self, BuildError> {
        let order = delay_lines.a.len();
        let history = delay_lines.history();
        let len = (history + 1)
            .checked_mul(channels)
            .filter(|&len| len <= u32::MAX as usize / 64)
            .ok_or(BuildError::TooLong { history, channels })?;
        let sections = delay_lines.sections();
        let parallel = sections.is_some();
        let places =
            sections.map_or_else(|| (0..order).collect(), |twos| section_places(&twos, order, lanes));
        let states = places
            .iter()
            .max()
            .map_or(0, |place| place + 1)
            .next_multiple_of((2 * lanes).max(group_lanes::<f64>()));
        // Without states this output matrix is not used.
        let state_rows = kernel.tiling(states.max(group_lanes::<f64>()), states, ratio);
        Ok(Self {
            lanes,
            channels,
            inputs: kernel.tiling(channels, len, ratio),
            states,
            state_rows,
            places,
            parallel,
        })
    }

    fn place(&self, (channel, frames): DelayedInput) -> u32 {
        (self.inputs.history - frames * self.channels + channel) as u32
    }

    /// The state at each place; `None` for padding.
    fn occupants(&self) -> Vec<Option<usize>> {
        let mut occupants = vec![None; self.states.max(self.state_rows.hop)];
        self.places.iter().enumerate().for_each(|(state, &place)| occupants[place] = Some(state));
        occupants
    }

    pub(super) fn feedthrough(
        &self,
        delay_lines: &DelayLines,
        ratio: usize,
        kernel: FirKernel<f64>,
    ) -> Polyphase<f64> {
        let n = self.channels;
        let tap =
            |e: usize, p: usize| delay_lines.taps.get(&(n - 1 - e % n, e / n)).map_or(0.0, |taps| taps[p]);
        Polyphase::new(kernel, self.inputs, ratio, tap)
    }

    pub(super) fn output_matrix(
        &self,
        delay_lines: &DelayLines,
        ratio: usize,
        kernel: FirKernel<f64>,
    ) -> Polyphase<f64> {
        let occupants = self.occupants();
        let last = occupants.len() - 1;
        let factor = |e: usize, p: usize| occupants[last - e].map_or(0.0, |state| delay_lines.c[state][p]);
        Polyphase::new(kernel, self.state_rows, ratio, factor)
    }

    pub(super) fn recursion(&self, delay_lines: &DelayLines) -> Recursion {
        let columns = Columns { layout: self, delay_lines, occupants: self.occupants() };
        let form = if self.parallel {
            let vectors = (0..self.states).step_by(2 * self.lanes);
            RecursionForm::Sections(vectors.map(|first| columns.section_vector(first)).collect())
        } else {
            RecursionForm::Dense(columns.tiles())
        };
        Recursion { states: self.states, form }
    }
}

/// The columns of A and B, as the recursion takes them.
struct Columns<'a> {
    layout: &'a HistoryLayout,
    delay_lines: &'a DelayLines,
    occupants: Vec<Option<usize>>,
}

impl Columns<'_> {
    /// Factors of `count` places from `first` on, taken from one factor for each state.
    fn column(&self, factor: impl Fn(usize) -> f64, first: usize, count: usize) -> Vec<f64> {
        let places = self.occupants[first..first + count].iter();
        places.map(|state| state.map_or(0.0, &factor)).collect()
    }

    fn section_vector(&self, first: usize) -> SectionVector {
        let lanes = self.layout.lanes;
        // What the states from `to` on take from those from `from` on, lane by lane.
        let a = |to: usize, from: usize| {
            let pairs = self.occupants[to..to + lanes].iter().zip(&self.occupants[from..from + lanes]);
            pairs.map(|(i, j)| i.zip(*j).map_or(0.0, |(i, j)| self.delay_lines.a[i][j]))
        };
        let (p, q) = (first, first + lanes);
        let mut coefficients: Vec<f64> = a(p, p).chain(a(p, q)).chain(a(q, p)).chain(a(q, q)).collect();
        let mut inputs = Vec::new();
        for (&input, factors) in &self.delay_lines.b {
            let column: Vec<f64> = self.column(|state| factors[state], first, 2 * lanes);
            if column.iter().any(|&factor| factor != 0.0) {
                inputs.push(self.layout.place(input));
                coefficients.extend(column);
            }
        }
        SectionVector { inputs, coefficients: Aligned::from_slice(&coefficients) }
    }

    fn tiles(&self) -> Vec<ColumnTile> {
        let mut tiles = Vec::new();
        let mut first = 0;
        while first < self.layout.states {
            let left = (self.layout.states - first) / self.layout.lanes;
            let vectors = (1 << left.ilog2()).min(ColumnTile::WIDEST);
            tiles.push(self.tile(first, vectors));
            first += vectors * self.layout.lanes;
        }
        tiles
    }

    /// Columns of zeros are left out, so that triangles and blocks cost less than full matrices.
    fn tile(&self, first: usize, vectors: usize) -> ColumnTile {
        let (mut inputs, mut columns, mut coefficients) = (Vec::new(), Vec::new(), Vec::new());
        let mut keep = |list: &mut Vec<u32>, place: u32, column: Vec<f64>| {
            if column.iter().any(|&factor| factor != 0.0) {
                list.push(place);
                coefficients.extend(column);
            }
        };
        let count = vectors * self.layout.lanes;
        for (&input, factors) in &self.delay_lines.b {
            keep(&mut inputs, self.layout.place(input), self.column(|i| factors[i], first, count));
        }
        for (j, &place) in self.layout.places.iter().enumerate() {
            keep(&mut columns, place as u32, self.column(|i| self.delay_lines.a[i][j], first, count));
        }
        ColumnTile { first, vectors, inputs, columns, coefficients: Aligned::from_slice(&coefficients) }
    }
}

/// Places of the states of sections: L first ones, their L partners, and so on.
fn section_places(sections: &[(usize, Option<usize>)], order: usize, lanes: usize) -> Vec<usize> {
    let mut places = vec![0; order];
    for (s, &(one, other)) in sections.iter().enumerate() {
        let place = s / lanes * 2 * lanes + s % lanes;
        places[one] = place;
        if let Some(other) = other {
            places[other] = place + lanes;
        }
    }
    places
}
