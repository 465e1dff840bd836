//! Lyapunov exponents of a long motion: the rates at which the axes of an orthonormal frame stretch, as the frame is carried along
//! and made orthonormal again where it has been stretched or shrunk a hundredfold.
//!
//! References: G. Benettin, L. Galgani, A. Giorgilli and J.-M. Strelcyn, *Lyapunov characteristic exponents for smooth dynamical
//! systems and for Hamiltonian systems*, Meccanica 15 (1980); J. L. Kaplan and J. A. Yorke, Lect. Notes Math. 730 (1979).

use super::growth::Growth;
use super::{ExponentConvergence, GROWTH};
use crate::flow::{Factor, FlowError, VariationalFlow, Work};
use crate::product::orthonormalise;
use crate::system::{Piece, VectorField};
use nalgebra::{DMatrix, DVector};
use somersault_core::argument::ArgumentError;
use somersault_core::random::SplitMix64;

/// A long motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LongRun {
    /// How long it is, transient included; negative backward in time.
    pub duration: f64,
    /// The part of it that exponents leave out, as the motion approaches its attractor and the frame its directions there.
    pub transient: f64,
    /// How many times exponents are noted, evenly over it.
    pub samples: usize,
    /// What errors may be relative to the largest rate.
    pub tolerance: f64,
}

/// Samples from which a law of growth can be told.
const LEAST_SAMPLES: usize = 32;

/// More are a slip.
const MOST_SAMPLES: usize = 1_000_000;

/// Exponents that are noted at most, 80 MB.
const MOST_NOTED: usize = 10_000_000;

/// An orthonormal frame in general position, always the same one. Axes of the space may stay in subspaces of slower growth: those of
/// a shear do.
fn any_frame(n: usize) -> DMatrix<f64> {
    let mut random = SplitMix64::new(1);
    let mut frame = DMatrix::from_fn(n, n, |_, _| random.unit() - 0.5);
    orthonormalise::<2>(&mut frame, |_, _, _| ());
    frame
}

fn expect_room(argument: &'static str, samples: usize, dimension: usize) -> Result<(), ArgumentError> {
    if samples.saturating_mul(dimension) <= MOST_NOTED {
        return Ok(());
    }
    let allowed = "at most 10 000 000 over the dimension";
    Err(ArgumentError::OutOfRange { argument, allowed, found: samples as f64 })
}

impl LongRun {
    /// Of this length, without its first tenth, with 512 samples and errors of a hundredth.
    pub fn new(duration: f64) -> Self {
        Self { duration, transient: 0.1, samples: 512, tolerance: 0.01 }
    }

    fn check(&self) -> Result<(), ArgumentError> {
        let out_of = |argument, allowed, found| ArgumentError::OutOfRange { argument, allowed, found };
        if !self.duration.is_finite() || self.duration == 0.0 {
            return Err(out_of("duration", "finite and not zero", self.duration));
        }
        if !(0.0..=0.9).contains(&self.transient) {
            return Err(out_of("transient", "a part from 0 to 0.9 of the duration", self.transient));
        }
        if !(self.tolerance > 0.0 && self.tolerance.is_finite()) {
            return Err(out_of("tolerance", "positive and finite", self.tolerance));
        }
        if !(LEAST_SAMPLES..=MOST_SAMPLES).contains(&self.samples) {
            return Err(out_of("samples", "from 32 to 1 000 000", self.samples as f64));
        }
        Ok(())
    }

    /// The spectrum along the motion from `p`, up to where the motion ends early.
    pub fn spectrum<S: VectorField>(
        &self,
        flow: &VariationalFlow<'_, S>,
        p: &DVector<f64>,
    ) -> Result<LyapunovSpectrum, FlowError> {
        self.check()?;
        let n = p.len();
        expect_room("samples", self.samples, n)?;
        let step = self.duration / self.samples as f64;
        let times: Vec<f64> = (1..=self.samples).map(|k| step * k as f64).collect();
        let mut frame = any_frame(n);
        let mut carried = frame.clone();
        let (mut logs, mut noted) = (DVector::<f64>::zeros(n), Vec::new());
        let (mut state, mut sizes, mut h, mut d) = (p.clone(), 0.0, DVector::zeros(n), DMatrix::zeros(n, n));
        let (work, ended) = flow.factors(p, &times, GROWTH, |factor| match factor {
            Factor::Link(link) => {
                link.matrix.mul_to(&frame, &mut carried);
                orthonormalise::<2>(&mut carried, |i, j, part| {
                    if i == j {
                        logs[i] += part.ln();
                    }
                });
                std::mem::swap(&mut frame, &mut carried);
                state = link.end;
            }
            Factor::Mark(mark) => {
                noted.push(logs.clone());
                let t = flow.start() + times[mark];
                flow.system().linearize_at(t, &Piece::FREE, state.as_slice(), h.as_mut_slice(), &mut d);
                sizes += d.norm() / (n as f64).sqrt();
            }
        });
        if let Err(error @ FlowError::Argument(_)) = ended {
            return Err(error);
        }
        let count = noted.len();
        let times = times[..count].iter().map(|t| t.abs()).collect();
        let scale = (count > 0).then(|| sizes / count as f64);
        Ok(LyapunovSpectrum::of(self, (times, noted), scale, ended.err(), state, work))
    }
}

/// Lyapunov exponents of a long motion, in descending order.
#[derive(Debug, Clone, PartialEq)]
pub struct LyapunovSpectrum {
    /// Times since the start, ascending also backward in time.
    pub times: Vec<f64>,
    /// The exponents over the time from the end of the transient to each of the times, a row for each; NaN before it.
    pub history: DMatrix<f64>,
    /// The last of them, 1/s; NaN where there are none.
    pub exponents: DVector<f64>,
    /// Estimated errors, 1/s.
    pub errors: DVector<f64>,
    /// By which law the axes stretch.
    pub growths: Vec<Growth>,
    /// Whether the exponents have converged.
    pub convergence: ExponentConvergence,
    /// Why the motion ended early, if it did.
    pub ended: Option<FlowError>,
    /// The last state.
    pub state: DVector<f64>,
    /// What it cost.
    pub work: Work,
}

impl LyapunovSpectrum {
    fn of(
        run: &LongRun,
        (times, noted): (Vec<f64>, Vec<DVector<f64>>),
        scale: Option<f64>,
        ended: Option<FlowError>,
        state: DVector<f64>,
        work: Work,
    ) -> Self {
        let (count, n) = (times.len(), state.len());
        // the samples that the transient takes of those that there are
        let skipped = (run.transient * count as f64).floor() as usize;
        let (start, before) = match skipped.checked_sub(1) {
            Some(last) => (times[last], noted[last].clone()),
            None => (0.0, DVector::zeros(n)),
        };
        let exponent = |k: usize, i: usize| (noted[k][i] - before[i]) / (times[k] - start);
        let found = |i: usize| if count > skipped { exponent(count - 1, i) } else { f64::NAN };
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&i, &j| found(j).total_cmp(&found(i)));
        let history =
            DMatrix::from_fn(count, n, |k, i| if k < skipped { f64::NAN } else { exponent(k, order[i]) });
        let growths: Vec<_> = order
            .iter()
            .map(|&i| Growth::of(&times, &noted.iter().map(|logs| logs[i]).collect::<Vec<_>>()))
            .collect();
        let exponents = DVector::from_fn(n, |i, _| found(order[i]));
        let errors = DVector::from_fn(n, |i, _| growths[i].error.max((exponents[i] - growths[i].rate).abs()));
        let convergence = ExponentConvergence::of(&growths, errors.as_slice(), run.tolerance, scale);
        Self { times, history, exponents, errors, growths, convergence, ended, state, work }
    }

    /// Whether the motion reached its end and the exponents have converged.
    pub fn is_converged(&self) -> bool {
        self.ended.is_none() && self.convergence == ExponentConvergence::Converged
    }

    /// The dimension of the attractor by Kaplan and Yorke: where the sum of the exponents, taken in descending order, becomes negative.
    /// The dimension of the space where it does not, and NaN where there are no exponents.
    pub fn kaplan_yorke_dimension(&self) -> f64 {
        if self.exponents.iter().any(|exponent| exponent.is_nan()) {
            return f64::NAN;
        }
        let mut sum = 0.0;
        for (i, &exponent) in self.exponents.iter().enumerate() {
            if sum + exponent < 0.0 {
                return i as f64 + sum / exponent.abs();
            }
            sum += exponent;
        }
        self.exponents.len() as f64
    }
}
