//! Sparse matrices filled by running the same loops twice: once for the pattern, then for the values.

use somersault_nlp::Pattern;

/// What a loop over entries writes to.
pub(super) trait Sink {
    /// Adds to an entry. Row and column are the same at every run.
    fn add(&mut self, row: usize, column: usize, value: f64);
}

/// Collects where entries are.
#[derive(Default)]
pub(super) struct Recorder(pub(super) Vec<(usize, usize)>);

impl Sink for Recorder {
    fn add(&mut self, row: usize, column: usize, _: f64) {
        self.0.push((row, column));
    }
}

/// Where the entries of a loop go, in its order; an entry whose variable is fixed goes nowhere.
#[derive(Default)]
pub(super) struct Slots {
    slots: Vec<Slot>,
}

#[derive(Clone, Copy)]
struct Slot {
    at: usize,
    factor: f64,
}

const NOWHERE: usize = usize::MAX;

impl Slots {
    /// The pattern of recorded entries and their places in it. `map` gives row, column and a factor for what is
    /// written, or nothing for entries that are dropped.
    pub(super) fn new(
        n_rows: usize,
        n_columns: usize,
        recorded: &[(usize, usize)],
        map: impl Fn(usize, usize) -> Option<(usize, usize, f64)>,
    ) -> (Pattern, Self) {
        let mapped: Vec<_> = recorded.iter().map(|&(i, j)| map(i, j)).collect();
        let kept = mapped.iter().flatten().map(|&(i, j, _)| (i, j));
        let (pattern, places) = Pattern::with_places(n_rows, n_columns, kept);
        let mut slots = vec![Slot { at: NOWHERE, factor: 0.0 }; mapped.len()];
        let written =
            slots.iter_mut().zip(&mapped).filter_map(|(slot, entry)| entry.map(|entry| (slot, entry)));
        for ((slot, (_, _, factor)), at) in written.zip(places) {
            *slot = Slot { at, factor };
        }
        (pattern, Self { slots })
    }

    /// A sink for one run, into `values` that are zero.
    pub(super) fn writer<'a>(&'a self, values: &'a mut [f64]) -> Writer<'a> {
        Writer { slots: self.slots.iter(), values }
    }
}

/// Writes values to their slots.
pub(super) struct Writer<'a> {
    slots: std::slice::Iter<'a, Slot>,
    values: &'a mut [f64],
}

impl Sink for Writer<'_> {
    #[inline(always)]
    fn add(&mut self, _: usize, _: usize, value: f64) {
        // both runs of a loop have the same entries
        if let Some(&Slot { at, factor }) = self.slots.next()
            && at != NOWHERE
        {
            self.values[at] += factor * value;
        }
    }
}
