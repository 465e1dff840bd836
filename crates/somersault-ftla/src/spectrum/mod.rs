//! Finite-time Lyapunov exponents and vectors, and the splittings they define (thesis 9).
//!
//! With Φ(T, p) = N Σ Lᵀ and σᵢ = e^{μᵢT} the exponents are μᵢ = ln σᵢ / T and the vectors the columns of L. Columns are
//! counted from the most stable to the most unstable direction of forward time: exponents ascend forward, and descend
//! backward, where l₁⁻ is the direction of largest backward stretch.
//!
//! | Subspace | Spanned by | |
//! |---|---|---|
//! | E^s | l₁⁺ … l⁺_{n^s} | (9.5) |
//! | E^cs | l₁⁺ … l⁺_{n^s+n^c} | (9.6) |
//! | E^c | E^cs ∩ E^cu | (9.7) |
//! | E^cu | l⁻_{n^s+1} … l⁻_{2n} | (9.8) |
//! | E^u | l⁻_{n^s+n^c+1} … l⁻_{2n} | (9.9) |

mod convergence;
mod diagnosis;
mod growth;
mod long_run;
mod subspace;

pub use convergence::{ExponentConvergence, Settling, SpectraConvergence};
pub use diagnosis::{Diagnosis, Unknown, Verdict, diagnose};
pub use growth::{Growth, Law, Unsettled};
pub use long_run::{LongRun, LyapunovSpectrum};
pub use subspace::Subspace;

use crate::flow::{Chain, FlowError, Transition, VariationalFlow};
use crate::product;
use crate::system::VectorField;
use nalgebra::{DMatrix, DVector};
use somersault_core::argument::ArgumentError;

/// The direction in which a motion is followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeDirection {
    /// From t₀ on: expanding directions are unstable.
    Forward,
    /// From t_f back: expanding directions are stable.
    Backward,
}

impl TimeDirection {
    /// 1 forward, −1 backward.
    pub fn sign(self) -> f64 {
        match self {
            Self::Forward => 1.0,
            Self::Backward => -1.0,
        }
    }
}

/// Growth or decay at which a factor ends: four digits are lost in it.
const GROWTH: f64 = 1e2;

/// Exponents and vectors at one point for one averaging time.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Direction in time.
    pub direction: TimeDirection,
    /// The averaging time T > 0.
    pub time: f64,
    /// μᵢ, ascending forward and descending backward.
    pub exponents: DVector<f64>,
    /// lᵢ as columns, orthonormal.
    pub vectors: DMatrix<f64>,
    /// The exponents in the same order, with costates in the unit in which states act on them as much as they on states: those
    /// of a finite time depend on units, these not on that of the cost.
    pub balanced: DVector<f64>,
}

impl Spectrum {
    /// From the factors of Φ in the order of time; the sign of their durations gives the direction.
    ///
    /// Exponents are right to about ε Σ κ(Φ_k)/T, however far apart they are. The factors of a motion known by its nodes
    /// ([`Extremal::links`](crate::shooting::Extremal)) serve as well as those of one run.
    pub fn of_factors(links: &[Transition]) -> Self {
        let duration: f64 = links.iter().map(|link| link.duration).sum();
        let (logs, vectors) = product::decompose(links.iter().map(|link| &link.matrix));
        let balanced = match unit_of_costates(links) {
            Some(unit) => product::decompose(in_unit(links, unit).iter()).0,
            None => logs.clone(),
        };
        let time = duration.abs();
        if duration < 0.0 {
            let [exponents, balanced] = [logs, balanced].map(|logs| logs / time);
            return Self { direction: TimeDirection::Backward, time, exponents, vectors, balanced };
        }
        let n = logs.len();
        let ascending = |logs: DVector<f64>| DVector::from_fn(n, |i, _| logs[n - 1 - i] / time);
        Self {
            direction: TimeDirection::Forward,
            time,
            exponents: ascending(logs),
            vectors: DMatrix::from_fn(n, n, |i, j| vectors[(i, n - 1 - j)]),
            balanced: ascending(balanced),
        }
    }

    /// max |μᵢ + μ_{2n+1−i}|: zero for a Hamiltonian system. Of an odd number the one in the middle pairs with itself.
    pub fn pairing_defect(&self) -> f64 {
        let n = self.exponents.len();
        (0..n.div_ceil(2)).fold(0.0, |m: f64, i| m.max((self.exponents[i] + self.exponents[n - 1 - i]).abs()))
    }

    /// The exponents in forward order, ascending, whatever the direction: backward ones with their sign changed.
    pub fn rates(&self) -> DVector<f64> {
        &self.exponents * self.direction.sign()
    }
}

/// The unit of the costates in which ∂λ/∂x and ∂x/∂λ are of one size over the factors; none where the numbers are not states
/// and costates. Where one of the two is zero they never are, and the other is made as small in a unit of zero, in which
/// neither acts on the other.
fn unit_of_costates(links: &[Transition]) -> Option<f64> {
    let dimension = links.first()?.matrix.nrows();
    let n = dimension / 2;
    let size = |row: usize, column: usize| -> f64 {
        links.iter().map(|link| link.matrix.view((row, column), (n, n)).norm()).sum()
    };
    let (of_states, of_costates) = (size(n, 0), size(0, n));
    let unit = if of_states > 0.0 && of_costates > 0.0 { (of_states / of_costates).sqrt() } else { 0.0 };
    dimension.is_multiple_of(2).then_some(unit)
}

/// The matrices of factors with costates counted in `unit`.
fn in_unit(links: &[Transition], unit: f64) -> Vec<DMatrix<f64>> {
    let n = links.first().map_or(0, |link| link.matrix.nrows()) / 2;
    let factor = |i: usize, j: usize| match (i < n, j < n) {
        (true, false) => unit,
        (false, true) if unit > 0.0 => 1.0 / unit,
        (false, true) => 0.0,
        (true, true) | (false, false) => 1.0,
    };
    links.iter().map(|link| link.matrix.map_with_location(|i, j, x| x * factor(i, j))).collect()
}

/// Spectra at `p` for all averaging times `times` > 0, ascending, from one run.
pub fn spectra<S: VectorField>(
    flow: &VariationalFlow<'_, S>,
    p: &DVector<f64>,
    direction: TimeDirection,
    times: &[f64],
) -> Result<Vec<Spectrum>, FlowError> {
    let signed: Vec<f64> = times.iter().map(|t| t * direction.sign()).collect();
    if let Some(&found) = times.iter().find(|t| t.is_nan() || **t <= 0.0) {
        return Err(ArgumentError::OutOfRange { argument: "times", allowed: "positive", found }.into());
    }
    let mut chain = Chain::new();
    flow.chain_into(p, &signed, GROWTH, &mut chain)?;
    let mut h = vec![0.0; p.len()];
    let mut of_mark = |mark: usize| {
        // a system that has lost its values has been stopped: the products end with the motion
        flow.system().field_at(flow.start(), &flow.system().piece(p.as_slice()), p.as_slice(), &mut h);
        if h.iter().all(|h| h.is_finite()) {
            return Ok(Spectrum::of_factors(chain.until(mark)));
        }
        let (quantity, state) = ("field", p.as_slice().to_vec());
        Err(FlowError::NonFinite { quantity, t: 0.0, state, source: flow.system().fault(p.as_slice()) })
    };
    (0..times.len()).map(&mut of_mark).collect()
}

/// The spectrum at `p` for one averaging time.
pub fn spectrum<S: VectorField>(
    flow: &VariationalFlow<'_, S>,
    p: &DVector<f64>,
    direction: TimeDirection,
    time: f64,
) -> Result<Spectrum, FlowError> {
    if time.is_nan() || time <= 0.0 {
        return Err(ArgumentError::OutOfRange { argument: "time", allowed: "positive", found: time }.into());
    }
    let mut chain = Chain::new();
    flow.chain_into(p, &[time * direction.sign()], GROWTH, &mut chain)?;
    Ok(Spectrum::of_factors(chain.links()))
}

/// Why there is no splitting.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpectrumError {
    /// Dimensions do not add up to that of the space.
    #[error("the dimensions {stable} + {center} + {unstable} must add up to {expected}")]
    Dimensions {
        /// n^s.
        stable: usize,
        /// n^c.
        center: usize,
        /// n^u.
        unstable: usize,
        /// 2n.
        expected: usize,
    },
    /// A spectrum is of the other direction.
    #[error("`{argument}` must be a spectrum of the other direction in time")]
    Direction {
        /// Name of the argument.
        argument: &'static str,
    },
    /// There is nothing to diagnose.
    #[error("`spectra` must have at least one entry")]
    Empty,
    /// Averaging times do not ascend, or directions differ.
    #[error("`spectra` must be of one direction and for ascending times, found {before} s before {after} s")]
    Order {
        /// Averaging time of a spectrum.
        before: f64,
        /// Averaging time of the one after it.
        after: f64,
    },
    /// Spectra are not of one dimension.
    #[error("spectra must be of one dimension, found {found} beside {expected}")]
    Sizes {
        /// That of the first.
        expected: usize,
        /// That of another one.
        found: usize,
    },
    /// The horizon is no length of time.
    #[error("`horizon` must be positive and finite, found {found}")]
    Horizon {
        /// Its value.
        found: f64,
    },
}

/// (n^s, n^c, n^u).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SplittingDims {
    /// Fast contracting directions.
    pub stable: usize,
    /// Directions of slow rates.
    pub center: usize,
    /// Fast expanding directions.
    pub unstable: usize,
}

impl SplittingDims {
    /// Fails unless the three add up to `expected`.
    pub fn check(self, expected: usize) -> Result<Self, SpectrumError> {
        let Self { stable, center, unstable } = self;
        if stable.saturating_add(center).saturating_add(unstable) == expected {
            Ok(self)
        } else {
            Err(SpectrumError::Dimensions { stable, center, unstable, expected })
        }
    }

    /// How many directions expand fast in a direction of time.
    pub fn expanding(self, direction: TimeDirection) -> usize {
        match direction {
            TimeDirection::Forward => self.unstable,
            TimeDirection::Backward => self.stable,
        }
    }
}

/// The directions that do not expand fast: E^cs of a forward spectrum, E^cu of a backward one.
pub fn slow_subspace(spectrum: &Spectrum, dims: SplittingDims) -> Subspace {
    match spectrum.direction {
        TimeDirection::Forward => Subspace::of_columns(&spectrum.vectors, 0..dims.stable + dims.center),
        TimeDirection::Backward => {
            Subspace::of_columns(&spectrum.vectors, dims.stable..spectrum.vectors.ncols())
        }
    }
}

/// The subspaces at a point from which motions were followed both ways.
#[derive(Debug, Clone, PartialEq)]
pub struct Splitting {
    dims: SplittingDims,
    forward: Spectrum,
    backward: Spectrum,
}

impl Splitting {
    /// From spectra at the same point.
    pub fn try_new(
        dims: SplittingDims,
        forward: Spectrum,
        backward: Spectrum,
    ) -> Result<Self, SpectrumError> {
        if forward.direction != TimeDirection::Forward {
            return Err(SpectrumError::Direction { argument: "forward" });
        }
        if backward.direction != TimeDirection::Backward {
            return Err(SpectrumError::Direction { argument: "backward" });
        }
        let (expected, found) = (forward.exponents.len(), backward.exponents.len());
        if found != expected {
            return Err(SpectrumError::Sizes { expected, found });
        }
        Ok(Self { dims: dims.check(expected)?, forward, backward })
    }

    /// (n^s, n^c, n^u).
    pub fn dims(&self) -> SplittingDims {
        self.dims
    }

    /// E^s (9.5).
    pub fn stable(&self) -> Subspace {
        Subspace::of_columns(&self.forward.vectors, 0..self.dims.stable)
    }

    /// E^cs (9.6).
    pub fn center_stable(&self) -> Subspace {
        slow_subspace(&self.forward, self.dims)
    }

    /// E^c (9.7).
    pub fn center(&self) -> Subspace {
        self.center_stable().intersection(&self.center_unstable())
    }

    /// E^cu (9.8).
    pub fn center_unstable(&self) -> Subspace {
        slow_subspace(&self.backward, self.dims)
    }

    /// E^u (9.9).
    pub fn unstable(&self) -> Subspace {
        let first = self.dims.stable + self.dims.center;
        Subspace::of_columns(&self.backward.vectors, first..self.backward.vectors.ncols())
    }
}
