//! One frame: Levenberg–Marquardt over bounds.

use super::estimate::{Estimate, Unknowns};
use super::problem::Target;
use super::quadratic::{Activity, BoundedQuadratic};
use super::{FitError, FitOptions, Loss, MarkerSet};
use nalgebra::{DMatrix, DVector, SymmetricEigen, Vector3};
use serde::{Deserialize, Serialize};
use somersault_multibody::{Axes, Data, DynamicsError, Model, Transform};

/// How the fit of a frame ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum FitStatus {
    /// No unknown moves any more, the cost falls by less than 1e-12 of itself, or there is none but rounding.
    Converged,
    /// The iterations allowed were not enough; the estimate is the best of them.
    IterationLimit,
    /// No step makes the distances smaller, though the last was not small; the estimate is the best there was.
    NoProgress,
    /// The frame has no marker; the estimate is that of the frame before.
    NoMarkers,
    /// The search converged, but the model fits the mirror image of the markers with less than half of the residual: an axis is
    /// mirrored, or left and right are exchanged.
    Mirrored,
    /// The search converged, but the residuals are larger than the noise allows, by five standard deviations of χ².
    Misfit,
}

impl FitStatus {
    /// All there are, and their names.
    pub const ALL: [(Self, &'static str); 6] = [
        (Self::Converged, "converged"),
        (Self::IterationLimit, "iteration_limit"),
        (Self::NoProgress, "no_progress"),
        (Self::NoMarkers, "no_markers"),
        (Self::Mirrored, "mirrored"),
        (Self::Misfit, "misfit"),
    ];
}

/// What is known of an unknown of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum UnknownStatus {
    /// The markers determine it.
    Determined,
    /// No marker of the frame does, or only together with others: the value is where the search began, or near it.
    Undetermined,
    /// It is at one of its limits, as the markers have it.
    AtLimit,
    /// It is held by one of its limits: the markers would have it beyond by more than three standard deviations.
    BeyondLimit,
    /// It was given.
    Given,
}

impl UnknownStatus {
    /// All there are, and their names.
    pub const ALL: [(Self, &'static str); 5] = [
        (Self::Determined, "determined"),
        (Self::Undetermined, "undetermined"),
        (Self::AtLimit, "at_limit"),
        (Self::BeyondLimit, "beyond_limit"),
        (Self::Given, "given"),
    ];
}

/// The fit of one frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameFit {
    /// How the search ended.
    pub status: FitStatus,
    /// Scale, configuration and weights.
    pub estimate: Estimate,
    /// Distance of each marker of the model to the measured one, m; none where it is missing.
    pub residuals: Vec<Option<f64>>,
    /// Root mean square of the residuals, m; none without markers.
    pub rms: Option<f64>,
    /// The minimum of ½ Σ c ρ.
    pub cost: f64,
    /// Iterations made.
    pub iterations: usize,
    /// What is known of each unknown: scale, rates of the root, rates of the joints or weights.
    pub unknowns: Vec<UnknownStatus>,
    /// Covariance of the unknowns by linearisation, σ² (Jᵀ W J)⁺ on the active constraints: scale, rates of
    /// the root in its own axes, rates of the joints or weights. Unknowns at a bound have zeros, those that the markers do not
    /// determine an infinite variance and no covariances. Absent without markers, and, if the noise is not known, where
    /// measured coordinates are not more than what they determine.
    pub covariance: Option<DMatrix<f64>>,
}

impl FrameFit {
    /// Whether the search converged on markers that determine every unknown, and neither limits nor mirrored axes contradict them.
    pub fn success(&self) -> bool {
        let known = |status: &UnknownStatus| match status {
            UnknownStatus::Determined | UnknownStatus::AtLimit | UnknownStatus::Given => true,
            UnknownStatus::Undetermined | UnknownStatus::BeyondLimit => false,
        };
        self.status == FitStatus::Converged && self.unknowns.iter().all(known)
    }

    /// Root mean square of the residuals that there are.
    pub fn rms_of(residuals: &[Option<f64>]) -> Option<f64> {
        let present: Vec<f64> = residuals.iter().flatten().map(|r| r * r).collect();
        (!present.is_empty()).then(|| (present.iter().sum::<f64>() / present.len() as f64).sqrt())
    }
}

/// Root mean square of the residuals of each marker over the frames that have it, m.
pub(crate) fn rms_of_markers<'a>(
    frames: impl Iterator<Item = &'a [Option<f64>]> + Clone,
) -> Vec<Option<f64>> {
    let n = frames.clone().next().map_or(0, <[_]>::len);
    let of = |k: usize| {
        let found: Vec<f64> = frames.clone().filter_map(|residuals| residuals[k]).collect();
        let squares: f64 = found.iter().map(|r| r * r).sum();
        (!found.is_empty()).then(|| (squares / found.len() as f64).sqrt())
    };
    (0..n).map(of).collect()
}

/// Room for the fit of frames of one model.
pub(super) struct FrameFitter<'a> {
    model: &'a Model,
    markers: &'a MarkerSet,
    options: &'a FitOptions,
    pub(super) unknowns: Unknowns,
    data: Data,
    /// 6 × degrees of freedom, of a marker and of the root.
    of_marker: DMatrix<f64>,
    of_root: DMatrix<f64>,
    /// √weight times derivative of the place of a marker by each unknown that moves it.
    moved: Vec<(usize, Vector3<f64>)>,
    /// √weight times residuals.
    residual: DVector<f64>,
    /// Jᵀ W J and Jᵀ W e.
    normal: DMatrix<f64>,
    pub(super) gradient: Vec<f64>,
    program: BoundedQuadratic,
}

/// What the markers of a frame say of its unknowns.
struct Determined {
    /// (Jᵀ W J)⁺ on what is free and determined.
    inverse: DMatrix<f64>,
    status: Vec<UnknownStatus>,
    /// Directions that are determined.
    rank: usize,
}

/// How good a minimum is.
struct Examined {
    unknowns: Vec<UnknownStatus>,
    covariance: Option<DMatrix<f64>>,
    /// Whether the residuals are beyond the noise.
    is_misfit: bool,
}

/// Where a search ends before it has converged.
#[derive(Debug, Clone, Copy)]
pub(super) struct Until {
    /// Iterations, at most and no more than the options allow.
    pub(super) iterations: usize,
    /// The step would lower the cost by a fraction of less.
    pub(super) share: f64,
    /// The cost is above it, and no step of [`MAX_DECREASE_RATIO`] times the predicted decrease would bring it below.
    pub(super) below: f64,
}

impl Until {
    /// No sooner.
    pub(super) const CONVERGED: Self = Self { iterations: usize::MAX, share: 1e-12, below: f64::INFINITY };
}

/// A search is given up where a decrease of the cost this many times as large as predicted would not be enough.
const MAX_DECREASE_RATIO: f64 = 4.0;
/// Distances taken as zero, in fractions of the coordinates.
const NO_DISTANCE: f64 = 1e-11;
/// Eigenvalues of the normal matrix, scaled to a unit diagonal, that are taken as zero.
const SINGULAR: f64 = 1e-12;
/// Diagonal entries of the normal matrix that are taken as zero, in fractions of the largest: a marker nearer to a joint's axis than 10⁻¹⁰ of the
/// length of a limb.
const UNSEEN: f64 = 1e-20;
/// Displacement from a limit, rad or m, and fraction by which the cost may differ there, where other unknowns stand in for the one at it.
const INWARD: f64 = 0.1;
const REPLACED: f64 = 1e-9;
/// Standard deviations by which χ² is a misfit, and by which the markers are beyond a limit.
const MISFIT: f64 = 5.0;
const BEYOND: f64 = 3.0;
/// Damping at the start, and where it is given up.
const DAMPING: [f64; 2] = [1e-4, 1e12];

impl<'a> FrameFitter<'a> {
    pub(super) fn new(model: &'a Model, markers: &'a MarkerSet, options: &'a FitOptions) -> Self {
        let unknowns = Unknowns::new(model, options);
        let n = unknowns.n();
        let rows = 3 * markers.markers().len();
        let mut program = BoundedQuadratic::new(n);
        if let Some(first) = unknowns.weights_at() {
            program.summed[first..].fill(true);
        }
        Self {
            model,
            markers,
            options,
            unknowns,
            data: Data::new(model),
            of_marker: DMatrix::zeros(6, model.n_velocities()),
            of_root: DMatrix::zeros(6, model.n_velocities()),
            moved: Vec::with_capacity(n),
            residual: DVector::zeros(rows),
            normal: DMatrix::zeros(n, n),
            gradient: vec![0.0; n],
            program,
        }
    }

    /// Bounds the scale to one value.
    pub(super) fn fix_scale(&mut self, scale: f64) {
        (self.unknowns.lower[0], self.unknowns.upper[0]) = (scale, scale);
    }

    /// Lays the model in the posture of `estimate` over the markers.
    pub(super) fn align(
        &mut self,
        targets: &[Option<Target>],
        estimate: &mut Estimate,
    ) -> Result<(), DynamicsError> {
        let positions = self.model.positions(&mut self.data, &estimate.q)?;
        let root = positions.pose(0)?.translation;
        let mut pairs = Vec::new();
        for (marker, target) in self.markers.markers().iter().zip(targets) {
            if let Some(target) = target {
                pairs.push((positions.pose(marker.body)?.point(&marker.point) - root, target.point));
            }
        }
        let bounds = [self.unknowns.lower[0], self.unknowns.upper[0]];
        super::align::align(self.model, estimate, &root, &pairs, bounds);
        Ok(())
    }

    /// The minimum from `start`. `targets` has an entry for each marker of the model.
    pub(super) fn fit(&mut self, targets: &[Option<Target>], start: &Estimate) -> Result<FrameFit, FitError> {
        let mut estimate = start.clone();
        let (status, iterations, cost) = self.minimize(targets, &mut estimate, Until::CONVERGED)?;
        let residuals = self.distances(targets, &estimate)?;
        let rms = FrameFit::rms_of(&residuals);
        if rms.is_none() {
            let unknowns = vec![UnknownStatus::Undetermined; self.unknowns.n()];
            return Ok(FrameFit {
                status,
                estimate,
                residuals,
                rms,
                cost,
                iterations,
                unknowns,
                covariance: None,
            });
        }
        let Examined { unknowns, covariance, is_misfit } = self.examine(targets, &estimate)?;
        let status = if is_misfit && status == FitStatus::Converged { FitStatus::Misfit } else { status };
        Ok(FrameFit { status, estimate, residuals, rms, cost, iterations, unknowns, covariance })
    }

    /// Half the sum of squares of markers that are off by a fraction of their distance from their centre, weighted.
    pub(super) fn cost_of_share(&self, targets: &[Option<Target>], share: f64) -> f64 {
        let present = || targets.iter().flatten().map(|target| target.point);
        let n = present().count().max(1) as f64;
        let centre = present().sum::<Vector3<f64>>() / n;
        let squared = present().map(|y| (y - centre).norm_squared()).sum::<f64>() / n * share * share;
        let of = |(marker, target): (&super::Marker, &Option<Target>)| {
            target.map_or(0.0, |y| 0.5 * marker.weight * y.weight * self.options.loss.evaluate(squared).0)
        };
        self.markers.markers().iter().zip(targets).map(of).sum()
    }

    /// `estimate` ← the minimum, or where the search is to end before. Returns how it ended, after how many iterations, and the
    /// cost.
    pub(super) fn minimize(
        &mut self,
        targets: &[Option<Target>],
        estimate: &mut Estimate,
        until: Until,
    ) -> Result<(FitStatus, usize, f64), DynamicsError> {
        if targets.iter().all(Option::is_none) {
            return Ok((FitStatus::NoMarkers, 0, 0.0));
        }
        let mut trial = estimate.clone();
        let mut damping = DAMPING[0];
        let mut cost = self.linearize(targets, estimate)?;
        let max_iterations = self.options.max_iterations.min(until.iterations);
        let none = self.no_cost(targets);
        for iteration in 1..=max_iterations {
            loop {
                let predicted = self.step(estimate, damping);
                let Some(predicted) = predicted else {
                    damping *= 10.0;
                    if damping > DAMPING[1] {
                        return Ok((FitStatus::NoProgress, iteration, cost));
                    }
                    continue;
                };
                if predicted <= (until.share * cost).max(none)
                    || cost - MAX_DECREASE_RATIO * predicted > until.below
                {
                    return Ok((FitStatus::Converged, iteration, cost));
                }
                let step = self.program.solution.as_slice();
                let small = step.iter().all(|x| x.abs() <= self.options.step_tol);
                self.unknowns.advance(self.model, estimate, step, &mut trial)?;
                let found = self.cost(targets, &trial)?;
                // what a small step changes is lost in the rounding of the cost
                if small || found < cost {
                    let gain = (cost - found) / predicted;
                    std::mem::swap(estimate, &mut trial);
                    cost = self.linearize(targets, estimate)?;
                    if small {
                        return Ok((FitStatus::Converged, iteration, cost));
                    }
                    if gain > 0.75 {
                        damping = (damping * 0.1).max(1e-10);
                    } else if gain < 0.25 {
                        damping *= 4.0;
                    }
                    break;
                }
                if predicted <= 1e-13 * cost {
                    return Ok((FitStatus::Converged, iteration, cost));
                }
                damping *= 10.0;
                if damping > DAMPING[1] {
                    return Ok((FitStatus::NoProgress, iteration, cost));
                }
            }
        }
        Ok((FitStatus::IterationLimit, max_iterations, cost))
    }

    /// The cost of a perfect fit, which angles that no marker determines would take indefinitely to lower.
    fn no_cost(&self, targets: &[Option<Target>]) -> f64 {
        let of = |(marker, target): (&super::Marker, &Option<Target>)| {
            target.map_or(0.0, |y| 0.5 * marker.weight * y.weight * (NO_DISTANCE * y.point.amax()).powi(2))
        };
        self.markers.markers().iter().zip(targets).map(of).sum()
    }

    /// Solves for a step and returns by how much the quadratic model falls; none where that has no minimum.
    fn step(&mut self, estimate: &Estimate, damping: f64) -> Option<f64> {
        let program = &mut self.program;
        let n = self.gradient.len();
        let largest = (0..n).fold(0.0_f64, |a, i| a.max(self.normal[(i, i)]));
        program.hessian.copy_from(&self.normal);
        program.gradient.copy_from_slice(&self.gradient);
        let mut sum = 0.0;
        for i in 0..n {
            // unknowns that no marker sees stay where they are
            program.hessian[(i, i)] +=
                damping * self.normal[(i, i)].max(1e-4 * largest).max(f64::MIN_POSITIVE);
            if let Some(value) = self.unknowns.value(estimate, i) {
                program.lower[i] = (self.unknowns.lower[i] - value).min(0.0);
                program.upper[i] = (self.unknowns.upper[i] - value).max(0.0);
                sum += if program.summed[i] { value } else { 0.0 };
            }
        }
        if self.unknowns.weights_at().is_some() {
            program.sum_bound = (1.0 - sum).max(0.0);
        }
        program.solve().ok()?;
        let step = &program.solution;
        let mut predicted = -step.dot(&program.gradient);
        for (j, column) in self.normal.column_iter().enumerate() {
            let below: f64 = (j + 1..n).map(|i| column[i] * step[i]).sum();
            predicted -= (0.5 * column[j] * step[j] + below) * step[j];
        }
        predicted.is_finite().then_some(predicted)
    }

    /// ½ Σ c ρ(‖e‖²).
    pub(super) fn cost(
        &mut self,
        targets: &[Option<Target>],
        estimate: &Estimate,
    ) -> Result<f64, DynamicsError> {
        let positions = self.model.positions(&mut self.data, &estimate.q)?;
        let root = positions.pose(0)?.translation;
        let mut cost = 0.0;
        for (marker, target) in self.markers.markers().iter().zip(targets) {
            let Some(target) = target else { continue };
            let arm = positions.pose(marker.body)?.point(&marker.point) - root;
            let squared = (root + arm * estimate.scale - target.point).norm_squared();
            cost += 0.5 * marker.weight * target.weight * self.options.loss.evaluate(squared).0;
        }
        Ok(cost)
    }

    /// Distances of the markers that are there.
    fn distances(
        &mut self,
        targets: &[Option<Target>],
        estimate: &Estimate,
    ) -> Result<Vec<Option<f64>>, DynamicsError> {
        let positions = self.model.positions(&mut self.data, &estimate.q)?;
        let root = positions.pose(0)?.translation;
        let distance = |(marker, target): (&super::Marker, &Option<Target>)| {
            let Some(target) = target else { return Ok(None) };
            let arm = positions.pose(marker.body)?.point(&marker.point) - root;
            Ok(Some((root + arm * estimate.scale - target.point).norm()))
        };
        self.markers.markers().iter().zip(targets).map(distance).collect()
    }

    /// Residuals, normal matrix and gradient; returns the cost.
    ///
    /// With x = r + s d the derivative by the scale is d, by rates J_root + s (J_marker − J_root): of the rates
    /// of the root's place d does not depend.
    fn linearize(&mut self, targets: &[Option<Target>], estimate: &Estimate) -> Result<f64, DynamicsError> {
        let n_root = self.unknowns.root.1;
        let weights_at = self.unknowns.weights_at();
        let scale = estimate.scale;
        let positions = self.model.positions(&mut self.data, &estimate.q)?;
        let root = positions.pose(0)?.translation;
        positions.jacobian_into(0, &Transform::identity(), Axes::World, &mut self.of_root)?;
        let n_direct = if weights_at.is_some() { n_root } else { self.of_root.ncols() };
        let mut cost = 0.0;
        self.normal.fill(0.0);
        self.gradient.fill(0.0);
        for (k, (marker, target)) in self.markers.markers().iter().zip(targets).enumerate() {
            let Some(target) = target else {
                self.residual.rows_mut(3 * k, 3).fill(0.0);
                continue;
            };
            let arm = positions.pose(marker.body)?.point(&marker.point) - root;
            let error = root + arm * scale - target.point;
            let (loss, slope) = self.options.loss.evaluate(error.norm_squared());
            cost += 0.5 * marker.weight * target.weight * loss;
            let weight = (marker.weight * target.weight * slope).sqrt();
            let frame = Transform::translation(marker.point);
            positions.jacobian_into(marker.body, &frame, Axes::World, &mut self.of_marker)?;
            let (of_root, of_marker) = (self.of_root.as_slice(), self.of_marker.as_slice());
            let by_rate = |rate: usize| {
                let (root, marker) = (&of_root[6 * rate..][..3], &of_marker[6 * rate..][..3]);
                Vector3::new(
                    weight * (root[0] + scale * (marker[0] - root[0])),
                    weight * (root[1] + scale * (marker[1] - root[1])),
                    weight * (root[2] + scale * (marker[2] - root[2])),
                )
            };
            self.moved.clear();
            self.moved.push((0, arm * weight));
            for rate in 0..n_direct {
                let by = by_rate(rate);
                // most joints are not between the root and the marker
                if by != Vector3::zeros() {
                    self.moved.push((1 + rate, by));
                }
            }
            if let (Some(first), Some(base)) = (weights_at, self.unknowns.base()) {
                for (w, direction) in base.directions().column_iter().enumerate() {
                    let mut by = Vector3::zeros();
                    for (j, factor) in direction.iter().enumerate() {
                        by += by_rate(n_root + j) * *factor;
                    }
                    self.moved.push((first + w, by));
                }
            }
            let residual = error * weight;
            self.residual.fixed_rows_mut::<3>(3 * k).copy_from(&residual);
            let n = self.gradient.len();
            for (first, (j, by)) in self.moved.iter().enumerate() {
                self.gradient[*j] += by.x * residual.x + by.y * residual.y + by.z * residual.z;
                let column = &mut self.normal.as_mut_slice()[j * n..][..n];
                for (i, other) in &self.moved[first..] {
                    column[*i] += by.x * other.x + by.y * other.y + by.z * other.z;
                }
            }
        }
        Ok(cost)
    }

    /// What the normal matrix of the last linearisation, at the minimum, determines. None where the quadratic model has no minimum.
    ///
    /// On the free unknowns, in directions that keep an active sum, the matrix scaled to a unit diagonal is taken apart by its
    /// eigenvalues. What is below [`SINGULAR`] is a direction in which no marker moves; an unknown with a part in
    /// one of these is not determined, and the variance of the others does not depend on the choice of the inverse.
    fn determined(&mut self, estimate: &Estimate) -> Option<Determined> {
        // the active set of a step without length
        self.step(estimate, DAMPING[0])?;
        let program = &self.program;
        let n = self.gradient.len();
        let entry = |i: usize, j: usize| self.normal[(i.max(j), i.min(j))];
        let largest = (0..n).fold(0.0_f64, |largest, i| largest.max(entry(i, i)));
        // room for all, so that the number of allocations does not depend on what is free
        let mut free = Vec::with_capacity(n);
        free.extend((0..n).filter(|&i| program.activity()[i] == Activity::Free));
        let m = free.len();
        // columns that no marker moves stay as they are: scaled, their rounding would look like something
        let is_seen = |i: usize| entry(i, i) > UNSEEN * largest;
        let scale =
            DVector::from_fn(
                m,
                |a, _| if is_seen(free[a]) { entry(free[a], free[a]).sqrt().recip() } else { 0.0 },
            );
        let mut scaled = DMatrix::from_fn(m, m, |a, b| scale[a] * entry(free[a], free[b]) * scale[b]);
        // the direction across an active sum, which is held
        let held = |a: usize| program.sum_is_active() && program.summed[free[a]];
        let mut across = DVector::from_fn(m, |a, _| if held(a) { scale[a] } else { 0.0 });
        across /= across.norm().max(f64::MIN_POSITIVE);
        let mut moved = DVector::zeros(m);
        moved.gemv(1.0, &scaled, &across, 0.0);
        let twice = across.dot(&moved);
        scaled.ger(-1.0, &across, &moved, 1.0);
        scaled.ger(-1.0, &moved, &across, 1.0);
        scaled.ger(twice, &across, &across, 1.0);
        // a matrix without entries has no decomposition
        let eigen = (m > 0).then(|| SymmetricEigen::new(scaled));
        let pairs = || eigen.iter().flat_map(|e| e.eigenvalues.iter().zip(e.eigenvectors.column_iter()));
        let greatest = pairs().fold(0.0_f64, |a, (x, _)| a.max(*x));
        let mut inverse = DMatrix::zeros(n, n);
        let mut status = vec![UnknownStatus::Determined; n];
        let mut rank = 0;
        let mut along = DVector::zeros(m);
        for (value, vector) in pairs() {
            let is_held = across.dot(&vector).abs() > 1.0 - SINGULAR.sqrt();
            if *value > SINGULAR * greatest {
                rank += 1;
                along.cmpy(1.0, &vector, &scale, 0.0);
                for (b, y) in along.iter().enumerate() {
                    let mut column = inverse.column_mut(free[b]);
                    for (a, x) in along.iter().enumerate() {
                        column[free[a]] += x * y / value;
                    }
                }
            } else if !is_held {
                for a in (0..m).filter(|&a| vector[a].abs() > SINGULAR.sqrt()) {
                    status[free[a]] = UnknownStatus::Undetermined;
                }
            }
        }
        for (i, activity) in program.activity().iter().enumerate() {
            match activity {
                Activity::Free => {}
                _ if self.unknowns.lower[i] == self.unknowns.upper[i] => status[i] = UnknownStatus::Given,
                Activity::Lower | Activity::Upper => status[i] = UnknownStatus::AtLimit,
            }
        }
        Some(Determined { inverse, status, rank })
    }

    /// What is known of the unknowns, their covariance, and whether the residuals are beyond the noise.
    fn examine(
        &mut self,
        targets: &[Option<Target>],
        estimate: &Estimate,
    ) -> Result<Examined, DynamicsError> {
        self.linearize(targets, estimate)?;
        let Some(Determined { mut inverse, mut status, rank }) = self.determined(estimate) else {
            let unknowns = vec![UnknownStatus::Undetermined; self.unknowns.n()];
            return Ok(Examined { unknowns, covariance: None, is_misfit: false });
        };
        let n_measured = 3 * targets.iter().flatten().count();
        let n_over = n_measured.saturating_sub(rank) as f64;
        let squares = self.residual.norm_squared();
        let variance = match self.options.noise {
            Some(noise) => Some(noise * noise),
            None if n_over > 0.0 => Some(squares / n_over),
            None => None,
        };
        // outliers, which another loss is for, are no misfit
        let known = self.options.noise.filter(|_| self.options.loss == Loss::Squares);
        let is_misfit =
            known.is_some_and(|noise| squares > noise * noise * (n_over + MISFIT * (2.0 * n_over).sqrt()));
        let Some(variance) = variance else {
            return Ok(Examined { unknowns: status, covariance: None, is_misfit });
        };
        let rounding = self.no_cost(targets);
        let mut dependent = Vec::new();
        for i in 0..status.len() {
            if status[i] != UnknownStatus::AtLimit {
                continue;
            }
            // what the minimum would fall by, were there no limit
            let coupling = |j: usize| self.normal[(i.max(j), i.min(j))];
            let taken = |j: usize| {
                (0..status.len()).map(|k| inverse[(j, k)] * coupling(k)).sum::<f64>() * coupling(j)
            };
            let curvature = self.normal[(i, i)] - (0..status.len()).map(taken).sum::<f64>();
            // where free unknowns move the markers alike, the limit holds nothing and what is left of the curvature is rounding
            if curvature <= SINGULAR * self.normal[(i, i)] {
                let step = |j: usize| -(0..status.len()).map(|k| inverse[(j, k)] * coupling(k)).sum::<f64>();
                dependent.push((i, DVector::from_fn(status.len(), |j, _| step(j))));
                continue;
            }
            let gain = self.gradient[i] * self.gradient[i] / curvature;
            if gain > BEYOND * BEYOND * variance + 2.0 * rounding {
                status[i] = UnknownStatus::BeyondLimit;
            }
        }
        inverse *= variance;
        let diagonal = self.normal.diagonal();
        for (i, alike) in dependent {
            if !self.is_replaced(targets, estimate, i, &alike)? {
                continue;
            }
            let takes_part = |j: usize| alike[j].abs() * diagonal[j].sqrt() > (SINGULAR * diagonal[i]).sqrt();
            for j in (0..status.len()).filter(|&j| j == i || takes_part(j)) {
                status[j] = UnknownStatus::Undetermined;
            }
        }
        for i in (0..status.len()).filter(|&i| status[i] == UnknownStatus::Undetermined) {
            inverse.row_mut(i).fill(0.0);
            inverse.column_mut(i).fill(0.0);
            inverse[(i, i)] = f64::INFINITY;
        }
        Ok(Examined { unknowns: status, covariance: Some(inverse), is_misfit })
    }

    /// Whether free unknowns stand in for one at its limit, and not for small displacements alone: [`INWARD`] of the limit the others, which
    /// begin `alike` for a displacement of 1, find a minimum of the same cost. A straight knee, which is the turn of a hip to first order,
    /// leaves a higher one.
    fn is_replaced(
        &mut self,
        targets: &[Option<Target>],
        estimate: &Estimate,
        i: usize,
        alike: &DVector<f64>,
    ) -> Result<bool, DynamicsError> {
        let Some(value) = self.unknowns.value(estimate, i) else { return Ok(false) };
        let bounds = (self.unknowns.lower[i], self.unknowns.upper[i]);
        let room = (0.5 * (bounds.1 - bounds.0)).min(INWARD);
        let displacement = if value - bounds.0 < bounds.1 - value { room } else { -room };
        let mut step = alike * displacement;
        step[i] = displacement;
        let mut inward = estimate.clone();
        self.unknowns.advance(self.model, estimate, step.as_slice(), &mut inward)?;
        let held = self.unknowns.value(&inward, i).unwrap_or(value);
        (self.unknowns.lower[i], self.unknowns.upper[i]) = (held, held);
        let cost = self.cost(targets, estimate)?;
        let found = self.minimize(targets, &mut inward, Until::CONVERGED);
        (self.unknowns.lower[i], self.unknowns.upper[i]) = bounds;
        let (_, _, found) = found?;
        Ok((found - cost).abs() <= REPLACED * cost + self.no_cost(targets))
    }

    /// First and second derivative of the frame's minimum by its scale, which is fixed: the second is that of
    /// Gauss and Newton, H_ss − H_sf H_ff⁻¹ H_fs over what is free.
    pub(super) fn derivatives_by_scale(
        &mut self,
        targets: &[Option<Target>],
        estimate: &Estimate,
    ) -> Result<[f64; 2], DynamicsError> {
        self.linearize(targets, estimate)?;
        let curvature = match self.determined(estimate) {
            Some(Determined { inverse, .. }) => {
                let coupling = self.normal.column(0);
                self.normal[(0, 0)] - coupling.dot(&(inverse * coupling))
            }
            None => self.normal[(0, 0)],
        };
        Ok([self.gradient[0], curvature])
    }
}
