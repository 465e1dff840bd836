//! Where a mode ends.

/// A function of the state whose sign changes where a mode ends.
///
/// It is known by a gap φ, its rate φ̇ and a lag τ ≥ 0, and it is *inside* where
/// ```text
/// φ + τ max(φ̇, 0) < 0.
/// ```
/// With τ = 0 it is the sign of φ alone. With τ = c/k that is where a spring k and a damper c side by side push and do
/// not pull: going in, at φ < 0; coming out, while k φ + c φ̇ < 0.
///
/// Gap and rate at both ends of a step tell, without another evaluation, whether the sign may have changed
/// twice in between. Where the rate is not known it is given as zero: then a change is seen only if it
/// lasts to the end of a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Guard {
    /// φ.
    pub gap: f64,
    /// φ̇.
    pub rate: f64,
    /// τ.
    pub lag: f64,
}

impl Guard {
    /// φ + τ max(φ̇, 0), negative inside.
    ///
    /// On the surface φ = 0 and on the way in, where this is zero, it is given the least negative value: a start
    /// on the surface belongs to what follows.
    #[inline]
    pub fn margin(&self) -> f64 {
        if self.gap == 0.0 && self.rate < 0.0 {
            -f64::MIN_POSITIVE
        } else {
            self.gap + self.lag * self.rate.max(0.0)
        }
    }

    /// Whether the margin is negative.
    #[inline]
    pub fn is_inside(&self) -> bool {
        self.margin() < 0.0
    }

    /// Whether gap and rate are finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.gap.is_finite() && self.rate.is_finite()
    }
}

/// Which way a guard changes its sign: the kind of an event where a system has no names of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Crossing {
    /// It goes in.
    Enters,
    /// It comes out.
    Leaves,
}

impl Crossing {
    /// The change of a guard, from what it was before.
    pub fn of(before: &Guard) -> Self {
        if before.is_inside() { Self::Leaves } else { Self::Enters }
    }
}

/// A guard that changes its sign at the end of a step, where events are located.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GuardChange {
    /// Which guard.
    pub guard: usize,
    /// The guard at the start of the step.
    pub before: Guard,
    /// The guard at its end.
    pub after: Guard,
    /// What it gathered inside, where it comes out; zero where it goes in.
    pub impulse: f64,
}
