//! The iterations of a placement at one averaging time.

use super::{Method, Placement, PlacementResult, PlacementStatus};
use crate::flow::{FlowError, VariationalFlow};
use crate::spectrum::{Spectrum, Subspace, slow_subspace, spectrum};
use crate::system::VectorField;
use nalgebra::{DMatrix, DVector};

/// Angle below which Newton's method is tried, rad.
const NEAR: f64 = 0.01;

pub(super) struct Search<'a, S> {
    pub(super) placement: &'a Placement,
    pub(super) flow: &'a VariationalFlow<'a, S>,
    /// Entries of p that are solved for.
    pub(super) solved: Vec<usize>,
    pub(super) iterations: usize,
    pub(super) flow_evaluations: usize,
}

/// A point with the fast directions there.
#[derive(Clone)]
struct Point {
    p: DVector<f64>,
    h: DVector<f64>,
    spectrum: Spectrum,
    fast: Subspace,
    angle: f64,
}

impl<S: VectorField> Search<'_, S> {
    fn point(&mut self, p: &DVector<f64>, time: f64) -> Result<Point, FlowError> {
        self.flow_evaluations += 1;
        let spectrum = spectrum(self.flow, p, self.placement.direction, time)?;
        let slow = slow_subspace(&spectrum, self.placement.dims);
        let h = self.flow.system().field(p.as_slice());
        let angle = slow.angle_to(&h);
        Ok(Point { p: p.clone(), h, spectrum, fast: slow.complement(), angle })
    }

    /// Places for one averaging time.
    pub(super) fn at(&mut self, p: &DVector<f64>, time: f64) -> PlacementResult {
        let done = |point: Option<Point>, status| PlacementResult {
            p: point.as_ref().map_or_else(|| p.clone(), |q| q.p.clone()),
            angle: point.as_ref().map_or(f64::NAN, |q| q.angle),
            spectrum: point.map(|q| q.spectrum),
            status,
            time,
            iterations: 0,
            flow_evaluations: 0,
        };
        let mut best = match self.point(p, time) {
            Ok(point) => point,
            Err(error) => return done(None, PlacementStatus::Flow(error)),
        };
        let mut near = NEAR;
        let mut slope = None;
        for _ in 0..self.placement.max_iterations {
            if best.angle <= self.placement.tolerance {
                return done(Some(best), PlacementStatus::Placed);
            }
            self.iterations += 1;
            let next = match self.placement.method {
                Method::FixedPoint => self.with_basis_held(&best, time),
                // Newton's basin is small; outside of it holding the basis is the better step
                Method::Newton if best.angle > near => self.with_basis_held(&best, time),
                Method::Newton => match self.newton(&best, time, &mut slope) {
                    Err(PlacementStatus::Stalled | PlacementStatus::Flow(_)) => {
                        near = 0.1 * best.angle;
                        self.with_basis_held(&best, time)
                    }
                    other => other,
                },
            };
            match next {
                Ok(point) => best = point,
                Err(status) => return done(Some(best), status),
            }
        }
        let placed = best.angle <= self.placement.tolerance;
        done(Some(best), if placed { PlacementStatus::Placed } else { PlacementStatus::MaxIterations })
    }

    /// Wᵀ D by the costates solved for.
    fn slope(&self, fast: &Subspace, p: &DVector<f64>) -> DMatrix<f64> {
        let jacobian = self.flow.system().jacobian(p.as_slice());
        let mut slope = DMatrix::zeros(fast.dim(), self.solved.len());
        for (j, &entry) in self.solved.iter().enumerate() {
            let projected = fast.project(&jacobian.column(entry).into_owned());
            slope.set_column(j, &projected);
        }
        slope
    }

    fn moved(&self, p: &DVector<f64>, step: &DVector<f64>, fraction: f64) -> DVector<f64> {
        let mut p = p.clone();
        self.solved.iter().zip(step.iter()).for_each(|(&entry, d)| p[entry] += fraction * d);
        p
    }

    /// One round of algorithms 1 and 2: Wᵀh = 0 by Newton's method with W held.
    fn with_basis_held(&mut self, at: &Point, time: f64) -> Result<Point, PlacementStatus> {
        let mut p = at.p.clone();
        let size = at.h.norm();
        for _ in 0..20 {
            let residual = -at.fast.project(&self.flow.system().field(p.as_slice()));
            if residual.norm() <= 1e-3 * self.placement.tolerance * size {
                break;
            }
            let step =
                self.slope(&at.fast, &p).lu().solve(&residual).ok_or(PlacementStatus::SingularCostates)?;
            p = self.moved(&p, &step, 1.0);
        }
        self.point(&p, time).map_err(PlacementStatus::Flow)
    }

    /// ŴᵀP h in the basis of `frame`.
    fn residual(frame: &Subspace, at: &Point) -> DVector<f64> {
        let zero = DVector::zeros(at.h.len());
        let projected = at.fast.basis().fold(zero, |sum, w| sum + &w * w.dot(&at.h));
        frame.project(&projected)
    }

    fn slope_by_differences(
        &mut self,
        frame: &Subspace,
        at: &Point,
        time: f64,
    ) -> Result<DMatrix<f64>, PlacementStatus> {
        let residual = Self::residual(frame, at);
        let n = at.p.len() / 2;
        let costates = at.p.rows(n, n).amax();
        let mut slope = DMatrix::zeros(frame.dim(), frame.dim());
        for j in 0..frame.dim() {
            let entry = self.solved[j];
            // costates that are all zero say nothing of their size
            let size = if costates > 0.0 { at.p[entry].abs().max(0.1 * costates) } else { 1e-6 };
            let step = 1e-7 * size;
            let mut p = at.p.clone();
            p[entry] += step;
            let beside = self.point(&p, time).map_err(PlacementStatus::Flow)?;
            let change = Self::residual(frame, &beside) - &residual;
            slope.set_column(j, &(change / (p[entry] - at.p[entry])));
        }
        Ok(slope)
    }

    /// One damped step; `slope` is that of the last step, corrected by what the step did (Broyden), or none.
    fn newton(
        &mut self,
        at: &Point,
        time: f64,
        slope: &mut Option<(Subspace, DMatrix<f64>)>,
    ) -> Result<Point, PlacementStatus> {
        if let Some((frame, old)) = slope.take()
            && let Some(step) = old.clone().lu().solve(&-Self::residual(&frame, at))
            && let Ok(next) = self.point(&self.moved(&at.p, &step, 1.0), time)
            && next.angle < 0.2 * at.angle
        {
            let corrected = updated(old, &step, &Self::residual(&frame, &next));
            *slope = Some((frame, corrected));
            return Ok(next);
        }
        let frame = at.fast.clone();
        let fresh = self.slope_by_differences(&frame, at, time)?;
        let full = fresh
            .clone()
            .lu()
            .solve(&-Self::residual(&frame, at))
            .ok_or(PlacementStatus::SingularCostates)?;
        let mut fraction = 1.0;
        let mut failure = PlacementStatus::Stalled;
        while fraction > 1e-3 {
            match self.point(&self.moved(&at.p, &full, fraction), time) {
                Ok(next) if next.angle < (1.0 - 0.1 * fraction) * at.angle => {
                    if fraction == 1.0 {
                        let corrected = updated(fresh, &full, &Self::residual(&frame, &next));
                        *slope = Some((frame, corrected));
                    }
                    return Ok(next);
                }
                Ok(_) => failure = PlacementStatus::Stalled,
                Err(error) => failure = PlacementStatus::Flow(error),
            }
            fraction *= 0.4;
        }
        Err(failure)
    }
}

/// Broyden's correction: a full step should have left no residual, and left `residual`.
fn updated(slope: DMatrix<f64>, step: &DVector<f64>, residual: &DVector<f64>) -> DMatrix<f64> {
    let square = step.norm_squared();
    if square > 0.0 { slope + residual * step.transpose() / square } else { slope }
}
