//! When a phase begins and ends.

/// Both ends as times since an origin: far from zero, times themselves would lose the digits of a duration.
#[derive(Debug, Clone, Copy)]
pub(super) struct Horizon {
    origin: f64,
    start: f64,
    end: f64,
}

impl Horizon {
    /// From one time since an origin to another.
    pub(super) fn since(origin: f64, start: f64, end: f64) -> Self {
        Self { origin, start, end }
    }

    /// t₀ and t_f.
    pub(super) fn ends(&self) -> (f64, f64) {
        (self.origin + self.start, self.origin + self.end)
    }

    /// Both since another origin.
    pub(super) fn ends_since(&self, origin: f64) -> [f64; 2] {
        let shift = self.origin - origin;
        [shift + self.start, shift + self.end]
    }

    /// t_f − t₀.
    pub(super) fn duration(&self) -> f64 {
        self.end - self.start
    }

    /// When a fraction of the duration has passed.
    pub(super) fn time(&self, fraction: f64) -> f64 {
        self.origin + (self.start + fraction * self.duration())
    }

    /// Which fraction of the duration has passed at t.
    pub(super) fn fraction(&self, t: f64) -> f64 {
        (t - self.origin - self.start) / self.duration()
    }
}
