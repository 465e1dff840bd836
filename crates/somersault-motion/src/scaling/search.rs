//! Gauss–Newton over the configurations of all frames and what they have in common.

use super::{ScalingError, ScalingOptions};
use crate::fit::{FitError, Loss, MarkerSet, Targets};
use crate::noise::standard_deviation;
use nalgebra::{Cholesky, DMatrix, DVector, Matrix3, Matrix3xX, SymmetricEigen, Vector3};
use rayon::prelude::*;
use somersault_core::cancel::CancellationToken;
use somersault_multibody::{Axes, Data, Joint, Model, Positions, Transform};

/// What is sought.
#[derive(Debug, Clone)]
pub(super) struct State {
    /// Logarithm of the size of the whole.
    pub(super) size: f64,
    /// Of each group over that of the whole.
    pub(super) proportions: Vec<f64>,
    /// Of each marker, in the axes of its body, m.
    pub(super) offsets: Vec<Vector3<f64>>,
    /// Of each frame.
    pub(super) configurations: Vec<Vec<f64>>,
}

/// The body of a state.
pub(super) struct Body {
    pub(super) model: Model,
    pub(super) scales: Vec<Vector3<f64>>,
    /// Where markers are on it without their offsets, and with them.
    pub(super) nominal: Vec<Vector3<f64>>,
    pub(super) points: Vec<Vector3<f64>>,
}

/// The quadratic model of the cost: common unknowns, and those of the frames.
struct Quadratic {
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    frames: Vec<Block>,
}

/// Of one frame.
struct Block {
    cost: f64,
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    /// A row for each unknown of the frame, a column for each common one; without columns if they were not requested.
    mixed: DMatrix<f64>,
    /// What the frame adds to the Hessian and the gradient of the common unknowns.
    common: (DMatrix<f64>, DVector<f64>),
}

/// What derivatives are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Purpose {
    /// A step of one frame.
    Frame,
    /// A step of all unknowns.
    Step,
    /// Covariances: limits do not count, which hold joints on one side only, and rates of balls take the place of those of their hinges, which
    /// may be fewer than three where axes coincide.
    Covariances,
}

/// The quadratic model without the unknowns of the frames.
struct Eliminated {
    frames: Vec<Block>,
    covariance: DMatrix<f64>,
}

/// What is known at the minimum.
pub(super) struct Posterior {
    /// Covariance of the common unknowns.
    pub(super) covariance: DMatrix<f64>,
    /// Standard deviations of the configurations of each frame, along v.
    pub(super) deviations: Vec<Vec<f64>>,
    /// Unknowns that the data determine.
    pub(super) n_determined: f64,
}

/// How a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    Converged,
    IterationLimit,
    NoProgress,
}

/// A search from a state.
pub(super) struct Search<'a> {
    pub(super) model: &'a Model,
    pub(super) markers: &'a MarkerSet,
    /// For each body and axis the number of its group.
    pub(super) groups: &'a [[Option<usize>; 3]],
    pub(super) options: &'a ScalingOptions,
    pub(super) targets: &'a [Targets],
    /// Along which points are measured.
    pub(super) axes: &'a [Vector3<f64>],
    pub(super) token: &'a CancellationToken,
    pub(super) state: State,
    /// Standard deviation of a coordinate that counts once.
    pub(super) noise: f64,
    pub(super) iterations: usize,
}

/// Decrease of the cost, half a squared number of standard deviations, that is nothing: of the whole, and of a frame.
const SMALL: f64 = 1e-4;
const SMALL_OF_FRAME: f64 = 1e-7;
/// Damping at the start, at least, and where it is given up.
const DAMPING: [f64; 3] = [1e-3, 1e-9, 1e10];
/// Steps of a frame, at most, between those of the common unknowns.
const MAX_STEPS: usize = 50;
/// Diagonal entries of a normal matrix that damping takes them for, in fractions of the largest.
const FLOOR: f64 = 1e-4;
/// Eigenvalues of the normal matrix of a frame, scaled to a unit diagonal, that are taken as zero.
const SINGULAR: f64 = 1e-10;
/// Logarithms of sizes are within it.
const MAX_LOGARITHM: f64 = 4.0;
/// Standard deviation of joints beyond their limits, rad or m.
const LIMIT: f64 = 0.1;

impl Search<'_> {
    /// Number of common unknowns: the size, the groups, and offsets where they are sought.
    fn n_common(&self) -> usize {
        let n_offsets = if self.options.offset_deviation > 0.0 { self.markers.markers().len() } else { 0 };
        1 + self.state.proportions.len() + 3 * n_offsets
    }

    /// Standard deviations of the common unknowns before the markers are looked at.
    pub(super) fn prior_deviations(&self) -> DVector<f64> {
        let n_groups = self.state.proportions.len();
        DVector::from_fn(self.n_common(), |i, _| match i {
            0 => self.options.size_deviation,
            i if i <= n_groups => self.options.group_deviation,
            _ => self.options.offset_deviation,
        })
    }

    fn common(&self, state: &State) -> DVector<f64> {
        let offsets = state.offsets.iter().flat_map(|offset| offset.iter());
        let all = std::iter::once(&state.size).chain(&state.proportions).chain(offsets);
        DVector::from_iterator(self.n_common(), all.take(self.n_common()).copied())
    }

    /// Distances from which on points count less.
    pub(super) fn loss(&self) -> Loss {
        self.options.threshold.map_or(Loss::Squares, |threshold| Loss::Huber(threshold * self.noise))
    }

    /// The body of a state.
    pub(super) fn body(&self, state: &State) -> Result<Body, ScalingError> {
        let scale = |group: Option<usize>| (state.size + group.map_or(0.0, |g| state.proportions[g])).exp();
        let scales: Vec<Vector3<f64>> = self.groups.iter().map(|of| of.map(scale).into()).collect();
        let model = self.model.scaled(&scales)?;
        let markers = self.markers.markers();
        let nominal: Vec<_> = markers.iter().map(|m| m.point.component_mul(&scales[m.body])).collect();
        let points = nominal.iter().zip(&state.offsets).map(|(point, offset)| point + offset).collect();
        Ok(Body { model, scales, nominal, points })
    }

    /// The residuals of the markers of a frame, along the axes that count.
    pub(super) fn residuals(
        &self,
        body: &Body,
        data: &mut Data,
        frame: usize,
        q: &[f64],
    ) -> Result<Vec<Option<Vector3<f64>>>, ScalingError> {
        let positions = body.model.positions(data, q)?;
        let residual = |k: usize| -> Result<Option<Vector3<f64>>, ScalingError> {
            let Some(target) = self.targets[frame][k] else { return Ok(None) };
            let place = positions.pose(self.markers.markers()[k].body)?.point(&body.points[k]);
            Ok(Some(self.along_axes(&(place - target.point))))
        };
        (0..body.points.len()).map(residual).collect()
    }

    /// A vector without its part across the plane of a planar model.
    pub(super) fn along_axes(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        self.axes.iter().map(|axis| axis * axis.dot(vector)).sum()
    }

    /// What the squared distance of marker `k` counts in a frame.
    pub(super) fn weight(&self, frame: usize, k: usize) -> f64 {
        let recorded = self.targets[frame][k].map_or(0.0, |target| target.weight);
        self.markers.markers()[k].weight * recorded
    }

    /// How far joints of a frame are beyond their limits, with their degrees of freedom.
    fn beyond_limits(&self, q: &[f64]) -> impl Iterator<Item = (usize, f64)> {
        (1..self.model.n_bodies()).filter_map(|i| {
            let [lower, upper] = self.model.limits(i)?;
            let value = q[self.model.positions_of(i).next()?];
            let beyond = value - value.max(lower).min(upper);
            (beyond != 0.0).then_some((self.model.velocities_of(i).next()?, beyond / LIMIT))
        })
    }

    /// The cost of a frame.
    pub(super) fn frame_cost(
        &self,
        body: &Body,
        data: &mut Data,
        frame: usize,
        q: &[f64],
    ) -> Result<f64, ScalingError> {
        let loss = self.loss();
        let mut cost: f64 = self.beyond_limits(q).map(|(_, beyond)| 0.5 * beyond * beyond).sum();
        for (k, residual) in self.residuals(body, data, frame, q)?.into_iter().enumerate() {
            let Some(residual) = residual else { continue };
            let (value, _) = loss.evaluate(residual.norm_squared());
            cost += 0.5 * self.weight(frame, k) * value / self.noise.powi(2);
        }
        Ok(cost)
    }

    /// Whether the body is not out of all proportion.
    fn is_possible(state: &State) -> bool {
        let within = |x: &f64| (state.size + x).abs() < MAX_LOGARITHM;
        within(&0.0) && state.proportions.iter().all(within)
    }

    /// What the common unknowns add to the cost.
    fn prior_cost(&self, state: &State) -> f64 {
        0.5 * self.common(state).component_div(&self.prior_deviations()).norm_squared()
    }

    /// Cost, gradient and Hessian without second derivatives of a frame.
    fn block(
        &self,
        body: &Body,
        data: &mut Data,
        frame: usize,
        q: &[f64],
        purpose: Purpose,
        trust: Option<&[f64]>,
    ) -> Result<Block, ScalingError> {
        let (n, loss) = (self.model.n_velocities(), self.loss());
        let m = if purpose == Purpose::Frame { 0 } else { self.n_common() };
        let mut found = Block {
            cost: 0.0,
            hessian: DMatrix::zeros(n, n),
            gradient: DVector::zeros(n),
            mixed: DMatrix::zeros(n, m),
            common: (DMatrix::zeros(m, m), DVector::zeros(m)),
        };
        for (rate, beyond) in self.beyond_limits(q).filter(|_| purpose != Purpose::Covariances) {
            found.cost += 0.5 * beyond * beyond;
            found.gradient[rate] += beyond / LIMIT;
            found.hessian[(rate, rate)] += LIMIT.powi(-2);
        }
        let mut jacobian = DMatrix::zeros(6, n);
        let mut by_common: Vec<(usize, Vector3<f64>)> = Vec::new();
        let mut row = DVector::zeros(n);
        let positions = body.model.positions(data, q)?;
        for (k, marker) in self.markers.markers().iter().enumerate() {
            let Some(target) = self.targets[frame][k] else { continue };
            let pose = positions.pose(marker.body)?;
            let place = pose.point(&body.points[k]);
            let error = self.along_axes(&(place - target.point));
            let (value, slope) = loss.evaluate(error.norm_squared());
            let weight = self.weight(frame, k) / self.noise.powi(2);
            found.cost += 0.5 * weight * value;
            let weight = weight * slope * trust.map_or(1.0, |trust| trust[k]);
            let at = Transform::translation(body.points[k]);
            positions.jacobian_into(marker.body, &at, Axes::World, &mut jacobian)?;
            if purpose == Purpose::Covariances {
                self.turn_balls(&positions, marker.body, &place, &mut jacobian)?;
            }
            if purpose != Purpose::Frame {
                self.by_common(body, &positions, k, &mut by_common)?;
            }
            for axis in self.axes {
                let residual = axis.dot(&error);
                for (x, column) in row.iter_mut().zip(jacobian.column_iter()) {
                    *x = axis.dot(&column.fixed_rows::<3>(0));
                }
                found.hessian.ger(weight, &row, &row, 1.0);
                found.gradient.axpy(weight * residual, &row, 1.0);
                for (i, direction) in &by_common {
                    let x = weight * axis.dot(direction);
                    found.common.1[*i] += x * residual;
                    found.mixed.column_mut(*i).axpy(x, &row, 1.0);
                    for (j, other) in &by_common {
                        found.common.0[(*i, *j)] += x * axis.dot(other);
                    }
                }
            }
        }
        Ok(found)
    }

    /// The derivatives of the place of marker `k` by the common unknowns that move it.
    fn by_common(
        &self,
        body: &Body,
        positions: &Positions<'_>,
        k: usize,
        out: &mut Vec<(usize, Vector3<f64>)>,
    ) -> Result<(), ScalingError> {
        out.clear();
        let marker = &self.markers.markers()[k];
        let mut carried = Some((marker.body, body.nominal[k]));
        while let Some((i, point)) = carried {
            let rotation = positions.pose(i)?.rotation;
            out.push((0, rotation * point));
            for axis in 0..3 {
                if let Some(group) = self.groups[i][axis] {
                    out.push((1 + group, rotation.column(axis) * point[axis]));
                }
            }
            carried = body.model.parent(i).map(|parent| (parent, *body.model.links()[i].origin()));
        }
        let first = 1 + self.state.proportions.len() + 3 * k;
        if first < self.n_common() {
            let rotation = positions.pose(marker.body)?.rotation;
            out.extend((0..3).map(|axis| (first + axis, rotation.column(axis).into())));
        }
        Ok(())
    }

    /// The quadratic model at the state.
    fn linearize(&self, purpose: Purpose, trust: Option<&[Vec<f64>]>) -> Result<Quadratic, ScalingError> {
        let body = self.body(&self.state)?;
        let deviations = self.prior_deviations();
        let common = self.common(&self.state);
        let mut hessian = DMatrix::from_diagonal(&deviations.map(|x| x.powi(-2)));
        let mut gradient = common.zip_map(&deviations, |x, deviation| x / (deviation * deviation));
        let frames = self.state.configurations.par_iter().enumerate();
        let block = |data: &mut Data, (i, q): (usize, &Vec<f64>)| {
            self.block(&body, data, i, q, purpose, trust.map(|trust| trust[i].as_slice()))
        };
        let frames: Vec<Block> =
            frames.map_init(|| Data::new(&body.model), block).collect::<Result<_, _>>()?;
        for block in &frames {
            hessian += &block.common.0;
            gradient += &block.common.1;
        }
        Ok(Quadratic { hessian, gradient, frames })
    }

    /// For each frame what its points count: less where linearisation does not follow how uncertain orientations are.
    ///
    /// A body whose orientation has the covariance C turns a lever p by ½ (C − tr(C) 1) p in the mean beyond what is linear. Of all levers on the way to the
    /// marker together that is taken for noise: what is uncertain in a frame by itself, about a prior of 1 rad, for that of one frame; what sizes and
    /// offsets leave uncertain, which is the same in all frames, for noise that no number of them makes less.
    fn followed(
        &self,
        Eliminated { frames, covariance }: &Eliminated,
    ) -> Result<Vec<Vec<f64>>, ScalingError> {
        let body = self.body(&self.state)?;
        let (n, n_frames) = (self.model.n_velocities(), self.targets.len() as f64);
        let mut data = Data::new(&body.model);
        let mut jacobian = DMatrix::zeros(6, n);
        let mut all = Vec::with_capacity(frames.len());
        for ((frame, q), block) in self.state.configurations.iter().enumerate().zip(frames) {
            let mut trust = vec![1.0; body.points.len()];
            if let Some(known) = Cholesky::new(&block.hessian + DMatrix::identity(n, n)) {
                let positions = body.model.positions(&mut data, q)?;
                let by_common = known.solve(&block.mixed);
                let of_common = &by_common * covariance * by_common.transpose();
                let mut orientations = Vec::with_capacity(self.model.n_bodies());
                for i in 0..self.model.n_bodies() {
                    positions.jacobian_into(i, &Transform::identity(), Axes::World, &mut jacobian)?;
                    self.turn_balls(&positions, i, &positions.pose(i)?.translation, &mut jacobian)?;
                    let turns: Matrix3xX<f64> = jacobian.fixed_rows::<3>(3).into_owned();
                    let alone: Matrix3<f64> = &turns * known.solve(&turns.transpose());
                    let in_common: Matrix3<f64> = &turns * &of_common * turns.transpose();
                    orientations.push([alone, in_common]);
                }
                for (k, marker) in self.markers.markers().iter().enumerate() {
                    let mut beyond = [Vector3::zeros(); 2];
                    let mut carried = Some((marker.body, body.points[k]));
                    while let Some((i, point)) = carried {
                        let lever = positions.pose(i)?.rotation * point;
                        for (beyond, c) in beyond.iter_mut().zip(&orientations[i]) {
                            *beyond += ((c * lever - lever * c.trace()) * 0.5).abs();
                        }
                        carried =
                            body.model.parent(i).map(|parent| (parent, *body.model.links()[i].origin()));
                    }
                    let variance = self.noise.powi(2) / self.weight(frame, k).max(f64::MIN_POSITIVE);
                    let added = beyond[0].norm_squared() + n_frames * beyond[1].norm_squared();
                    trust[k] = variance / (variance + added);
                }
            }
            all.push(trust);
        }
        Ok(all)
    }

    /// Replaces the derivatives of a point on `body` by hinges that make a ball by those by rotations about the axes of the world.
    fn turn_balls(
        &self,
        positions: &Positions<'_>,
        body: usize,
        point: &Vector3<f64>,
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), ScalingError> {
        let mut carried = Some(body);
        while let Some(i) = carried {
            carried = self.model.parent(i);
            let Some(hinges) = ball(self.model, i) else { continue };
            let arm = point - positions.pose(i)?.translation;
            for (hinge, axis) in hinges.into_iter().zip([Vector3::x(), Vector3::y(), Vector3::z()]) {
                jacobian.fixed_view_mut::<3, 1>(0, hinge).copy_from(&axis.cross(&arm));
                jacobian.fixed_view_mut::<3, 1>(3, hinge).copy_from(&axis);
            }
        }
        Ok(())
    }

    /// The step to the minimum of a quadratic model with damping of the common unknowns, these and those of each frame, and the decrease that it
    /// predicts; none where the matrix is not positive definite.
    fn step(model: &Quadratic, damping: f64) -> Option<(DVector<f64>, Vec<DVector<f64>>, f64)> {
        let mut hessian = model.hessian.clone();
        let added = hessian.diagonal() * damping;
        hessian.set_diagonal(&(hessian.diagonal() + &added));
        let mut gradient = model.gradient.clone();
        let mut factors = Vec::with_capacity(model.frames.len());
        for block in &model.frames {
            // frames are at their minima: what they do not determine stays
            let (inverse, _) = pseudo_inverse(&block.hessian);
            let solved = &inverse * &block.mixed;
            hessian.gemm_tr(-1.0, &block.mixed, &solved, 1.0);
            gradient.gemv_tr(-1.0, &solved, &block.gradient, 1.0);
            factors.push(inverse);
        }
        let common = -Cholesky::new(hessian)?.solve(&gradient);
        let step = |(block, inverse): (&Block, &DMatrix<f64>)| {
            -(inverse * (&block.gradient + &block.mixed * &common))
        };
        let steps = model.frames.iter().zip(&factors).map(step).collect();
        let predicted = damped_decrease(&common, &gradient, &added);
        predicted.is_finite().then_some((common, steps, predicted))
    }

    /// The state with its common unknowns moved by a step.
    fn advanced(&self, common: &DVector<f64>) -> State {
        let mut state = self.state.clone();
        let n_groups = state.proportions.len();
        state.size += common[0];
        state.proportions.iter_mut().zip(common.iter().skip(1)).for_each(|(x, step)| *x += step);
        let offsets = state.offsets.iter_mut().flat_map(|offset| offset.iter_mut());
        offsets.zip(common.iter().skip(1 + n_groups)).for_each(|(x, step)| *x += step);
        state
    }

    fn displaced(&self, q: &[f64], step: &DVector<f64>) -> Result<Vec<f64>, ScalingError> {
        let mut moved = q.to_vec();
        self.model.displace(q, step.as_slice(), &mut moved)?;
        self.model.normalize(&mut moved)?;
        Ok(moved)
    }

    /// Brings the configurations of a state to the minima of their frames, from where `steps` lead if that is nearer. Returns the cost of all.
    fn settle_frames(&self, state: &mut State, steps: Option<&[DVector<f64>]>) -> Result<f64, ScalingError> {
        let body = self.body(state)?;
        let settle = |data: &mut Data, (i, q): (usize, &mut Vec<f64>)| {
            if let Some(steps) = steps {
                let moved = self.displaced(q, &steps[i])?;
                if self.frame_cost(&body, data, i, &moved)? < self.frame_cost(&body, data, i, q)? {
                    *q = moved;
                }
            }
            self.settle_frame(&body, data, i, q)
        };
        let frames = state.configurations.par_iter_mut().enumerate();
        let costs: Vec<f64> =
            frames.map_init(|| Data::new(&body.model), settle).collect::<Result<_, ScalingError>>()?;
        Ok(self.prior_cost(state) + costs.iter().sum::<f64>())
    }

    /// Brings the configuration of a frame to its minimum. Returns its cost.
    fn settle_frame(
        &self,
        body: &Body,
        data: &mut Data,
        frame: usize,
        q: &mut Vec<f64>,
    ) -> Result<f64, ScalingError> {
        let [mut damping, least, most] = DAMPING;
        let mut block = self.block(body, data, frame, q, Purpose::Frame, None)?;
        for _ in 0..MAX_STEPS {
            if self.token.is_cancelled() {
                return Err(FitError::Interrupted.into());
            }
            let diagonal = block.hessian.diagonal();
            let floor = (FLOOR * diagonal.amax()).max(f64::MIN_POSITIVE);
            let added = diagonal.map(|x| damping * x.max(floor));
            let mut damped = block.hessian.clone();
            damped.set_diagonal(&(diagonal + &added));
            let step = Cholesky::new(damped).map(|factor| -factor.solve(&block.gradient));
            let Some(step) = step else {
                damping *= 10.0;
                if damping > most {
                    break;
                }
                continue;
            };
            let predicted = damped_decrease(&step, &block.gradient, &added);
            if predicted < SMALL_OF_FRAME.max(1e-14 * block.cost) || damping > most {
                break;
            }
            let moved = self.displaced(q, &step)?;
            let found = self.frame_cost(body, data, frame, &moved)?;
            if found < block.cost {
                damping = if block.cost - found > 0.5 * predicted {
                    (0.1 * damping).max(least)
                } else {
                    2.0 * damping
                };
                *q = moved;
                block = self.block(body, data, frame, q, Purpose::Frame, None)?;
            } else {
                damping *= 10.0;
            }
        }
        Ok(block.cost)
    }

    /// Goes to a minimum at this noise: steps of the common unknowns, each with frames at their minima.
    pub(super) fn minimize(&mut self) -> Result<End, ScalingError> {
        let [mut damping, least, most] = DAMPING;
        let mut state = self.state.clone();
        let mut cost = self.settle_frames(&mut state, None)?;
        self.state = state;
        for _ in 0..self.options.max_iterations {
            self.iterations += 1;
            let model = self.linearize(Purpose::Step, None)?;
            loop {
                if damping > most {
                    return Ok(End::NoProgress);
                }
                let Some((common, steps, predicted)) = Self::step(&model, damping) else {
                    damping *= 10.0;
                    continue;
                };
                if predicted < SMALL.max(1e-14 * cost) {
                    return Ok(End::Converged);
                }
                let mut trial = self.advanced(&common);
                let found = if Self::is_possible(&trial) {
                    self.settle_frames(&mut trial, Some(&steps))?
                } else {
                    f64::INFINITY
                };
                if found < cost {
                    damping = match (cost - found) / predicted {
                        x if x > 0.75 => (0.1 * damping).max(least),
                        x if x < 0.25 => 4.0 * damping,
                        _ => damping,
                    };
                    (self.state, cost) = (trial, found);
                    break;
                }
                damping *= 10.0;
            }
        }
        Ok(End::IterationLimit)
    }

    /// Covariances at the minimum; none where they are not finite.
    pub(super) fn posterior(&self) -> Result<Option<Posterior>, ScalingError> {
        let Some(first) = self.eliminate(None)? else { return Ok(None) };
        // of each common unknown the fraction that is not the prior's
        let prior = self.prior_deviations().map(|x| x * x);
        let told = first.covariance.diagonal().component_div(&prior).map(|x| 1.0 - x);
        let rank = |block: &Block| pseudo_inverse(&block.hessian).1 as f64;
        let n_determined = first.frames.iter().map(rank).sum::<f64>() + told.sum();
        let trust = self.followed(&first)?;
        let Some(Eliminated { frames, covariance }) = self.eliminate(Some(&trust))? else { return Ok(None) };
        let deviations = frames.iter().map(|block| {
            let (inverse, _) = pseudo_inverse(&block.hessian);
            let by_common = &inverse * &block.mixed;
            let of_common = &by_common * &covariance;
            let variance = |i: usize| inverse[(i, i)] + of_common.row(i).dot(&by_common.row(i));
            (0..inverse.nrows()).map(|i| standard_deviation(variance(i))).collect()
        });
        Ok(Some(Posterior { deviations: deviations.collect(), covariance, n_determined }))
    }

    /// The covariance of the common unknowns, with those of the frames eliminated, where points count as `trust` says; none where it is not finite.
    fn eliminate(&self, trust: Option<&[Vec<f64>]>) -> Result<Option<Eliminated>, ScalingError> {
        let Quadratic { mut hessian, frames, .. } = self.linearize(Purpose::Covariances, trust)?;
        for block in &frames {
            let (inverse, _) = pseudo_inverse(&block.hessian);
            hessian.gemm_tr(-1.0, &block.mixed, &(&inverse * &block.mixed), 1.0);
        }
        Ok(Cholesky::new(hessian).map(|factor| Eliminated { frames, covariance: factor.inverse() }))
    }
}

/// The rates of three hinges at one place, with nothing between them, of which the last carries body `i`; none of another body.
fn ball(model: &Model, i: usize) -> Option<[usize; 3]> {
    let hinge = |i: usize| {
        let is_hinge = matches!(model.joint(i), Some(Joint::Revolute { .. })) && model.mimic(i).is_none();
        is_hinge.then(|| model.velocities_of(i).start)
    };
    let above = |i: usize| {
        let parent = model.parent(i)?;
        let is_frame = model.links()[parent].mass_properties().mass == 0.0;
        (is_frame && *model.links()[i].origin() == Vector3::zeros()).then_some(parent)
    };
    let second = above(i)?;
    let first = above(second)?;
    Some([hinge(first)?, hinge(second)?, hinge(i)?])
}

/// By how much a quadratic model falls along the part `step` of a step to the minimum with `damping` added to the diagonal.
fn damped_decrease(step: &DVector<f64>, gradient: &DVector<f64>, damping: &DVector<f64>) -> f64 {
    let held: f64 = step.iter().zip(damping.iter()).map(|(x, added)| added * x * x).sum();
    0.5 * (held - step.dot(gradient))
}

/// The inverse of a normal matrix in the directions that it determines, and how many these are.
fn pseudo_inverse(matrix: &DMatrix<f64>) -> (DMatrix<f64>, usize) {
    let scale = matrix.diagonal().map(|x| if x > 0.0 { x.sqrt().recip() } else { 0.0 });
    let n = matrix.nrows();
    let unit = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let mut found = SymmetricEigen::new(unit);
    let rank = found.eigenvalues.iter().filter(|x| **x > SINGULAR).count();
    found.eigenvalues.apply(|x| *x = if *x > SINGULAR { x.recip() } else { 0.0 });
    let inverse = found.recompose();
    (DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]), rank)
}
