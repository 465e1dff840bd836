//! What follows from the minimum: the frames, and what is constant in a flight, with standard deviations.

use super::ReconstructionError;
use super::attitude::{Attitude, Flown, flight_of, read_orientation, turn_of};
use super::flight::{FlightFrame, Quantity, ReconstructedFlight};
use super::joints::Channels;
use super::normal::{Linearized, Placed};
use super::search::Search;
use super::unknowns::Estimate;
use crate::noise::standard_deviation;
use nalgebra::{DMatrix, DMatrixView, DVector, Matrix3, Matrix3xX, RowDVector, UnitQuaternion, Vector3};
use somersault_core::lie::so3::hat;
use somersault_multibody::counting::{BodyAngles, Counting, turns_about_z};
use somersault_multibody::flight::{Flight, FlightData, TakeOff};
use somersault_multibody::{Data, Model};
use std::f64::consts::TAU;

/// Displacement for the derivative of the moment of inertia, rad or m.
const DISPLACEMENT: f64 = 1e-5;
/// Between orientations from which turns are counted, at most, s: 0.3 rad at 15 rad/s.
const BETWEEN: f64 = 0.02;
/// Part of the momentum that must be horizontal for its direction to be that of the somersault.
const HORIZONTAL: f64 = 0.3;

/// Makes the results of a flight of this model.
pub(super) struct Report<'a> {
    pub(super) model: &'a Model,
}

impl Report<'_> {
    /// All frames.
    pub(super) fn frames(
        &self,
        search: &mut Search<'_>,
        estimate: &Estimate,
        covariance: &DMatrix<f64>,
        at: &Linearized,
    ) -> Result<Vec<FlightFrame>, ReconstructionError> {
        let model = self.model;
        let all = 0..search.observed.times.len();
        let knots = 0..search.flown.splines.n_knots();
        let residuals = search.flown.residuals(search.observed, estimate, all.clone(), &at.placed);
        let reference = search.observed.times[search.observed.reference];
        let flight = flight_of(model, reference, estimate)?;
        let travelling = self.travelling(estimate, at);
        let turned = self.turned(search, estimate)?;
        let (mut data, mut flight_data) = (Data::new(model), FlightData::new(model));
        let n_linear = model.joint(0).map_or(0, |joint| joint.kind().n_linear);
        let mut found = Vec::with_capacity(all.len());
        for i in all {
            let (attitude, placed, t) = (&at.attitudes[i], &at.placed[i], search.observed.times[i]);
            let Search { flown, room, .. } = search;
            let layout = flown.layout;
            let n = covariance.nrows();
            let by_attitude = attitude.by_unknowns.as_ref().map_or_else(|| Matrix3xX::zeros(n), Clone::clone);
            // angular velocity, in axes of the root and then of the world
            let rate = flown.rate(&flight, estimate, t, &attitude.orientation, room)?;
            let mut by_rate = rate.by_orientation * &by_attitude;
            for (k, turn) in layout.momentum().zip(&layout.turns) {
                let mut column = by_rate.column_mut(k);
                column += rate.by_momentum * turn;
            }
            flown.add_channels(&mut by_rate, &Matrix3::identity(), &rate, t, &knots);
            let by_rate = placed.turn * (by_rate - hat(&rate.angular_velocity) * &by_attitude);
            // configuration and velocity: those at scale 1 with the centre of mass at rest in the origin, moved and stretched
            flown.pose(estimate, t, &attitude.orientation, room);
            let (mut q, mut v) = (room.q.clone(), room.v.clone());
            let still = TakeOff {
                time: t,
                center_of_mass: Vector3::zeros(),
                velocity: Vector3::zeros(),
                angular_momentum: estimate.momentum,
            };
            Flight::try_new(model, still)?.complete(&mut flight_data, t, &mut q, &mut v)?;
            let center = flown.center_of_mass(estimate, reference, t);
            let velocity = self.velocity_at(estimate, t - reference);
            let placement = model.placement(0);
            let (axes, origin) =
                placement.map_or((Matrix3::identity(), Vector3::zeros()), |p| (p.rotation, p.translation));
            let place = axes.tr_mul(&(center - placed.center * estimate.scale - origin));
            let carried = placed.turn.tr_mul(&velocity);
            for k in 0..n_linear {
                q[k] = place[k];
                v[k] = v[k] * estimate.scale + carried[k];
            }
            let direction = estimate.momentum.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::y);
            let inertia = inertia_of(model, &mut data, &q, &placed.turn)? * estimate.scale.powi(2);
            let moment = direction.dot(&(inertia * direction));
            let by_moment =
                self.moment_gradient(search, estimate, &q, t, &direction, attitude, placed, &mut data)?;
            // products with the covariance, which is large, all at once
            let mut rows = DMatrix::zeros(7, n);
            rows.fixed_rows_mut::<3>(0).copy_from(&by_rate);
            rows.fixed_rows_mut::<3>(3).copy_from(&by_attitude);
            rows.row_mut(6).copy_from(&by_moment);
            let spread = &rows * covariance;
            let covariances = &spread * rows.transpose();
            let of_attitude = covariances.fixed_view::<3, 3>(3, 3).into_owned();
            let Search { flown, room, .. } = search;
            let of_frame =
                self.frame_covariance(flown, covariance, t, &spread.rows(3, 3), &of_attitude, &room.channels);
            let by_turn = self.counting().gradients(&travelling[i])[0];
            let inclination_deviation = standard_deviation(by_turn.dot(&(of_attitude * by_turn)));
            found.push(FlightFrame {
                time: t,
                q,
                v,
                covariance: of_frame,
                center_of_mass: center,
                angular_velocity: Quantity {
                    value: placed.turn * rate.angular_velocity,
                    deviation: Vector3::from_fn(|k, _| standard_deviation(covariances[(k, k)])),
                },
                moment_of_inertia: moment,
                moment_of_inertia_deviation: standard_deviation(covariances[(6, 6)]),
                inertia,
                inclination: turned[i].0.somersault,
                inclination_deviation,
                somersaults: (turned[i].0.somersault - turned[0].0.somersault) / TAU,
                twists: (turned[i].0.twist - turned[0].0.twist) / TAU,
                tilt: turned[i].0.tilt,
                residuals: residuals[i].iter().map(|r| r.map(|r| r.norm())).collect(),
            });
        }
        if search.flown.layout.is_planar {
            found.iter_mut().zip(&turned).for_each(|(frame, (_, angle))| frame.q[2] = *angle);
        }
        Ok(found)
    }

    /// The body's angles in each frame, and the angle of a planar root. Whole turns are counted from orientations at most `BETWEEN` apart, which the
    /// flight has between frames that are further.
    fn turned(
        &self,
        search: &mut Search<'_>,
        estimate: &Estimate,
    ) -> Result<Vec<(BodyAngles, f64)>, ReconstructionError> {
        let frames = &search.observed.times;
        let (mut times, mut places) = (vec![frames[0]], vec![0]);
        for pair in frames.windows(2) {
            let apart = pair[1] - pair[0];
            let n = (apart / BETWEEN).ceil().max(1.0) as usize;
            times.extend((1..n).map(|k| pair[0] + apart * k as f64 / n as f64).chain([pair[1]]));
            places.push(times.len() - 1);
        }
        let reference = places[search.observed.reference];
        let Search { flown, room, .. } = search;
        let path = flown.attitudes(estimate, &times, reference, None, room)?;
        let orientations = || path.iter().map(|attitude| attitude.orientation);
        let angles = self.counting().along(&travelling(self.model, &estimate.momentum, orientations()));
        let about_normal = turns_about_z(orientations());
        Ok(places.into_iter().map(|i| (angles[i], about_normal[i])).collect())
    }

    fn velocity_at(&self, estimate: &Estimate, t: f64) -> Vector3<f64> {
        estimate.velocity + self.model.gravity() * (estimate.gravity * t)
    }

    /// Of the orientation and the joints at `t`, along v, where `of_attitude` is that of the orientation and `spread` its covariance with all
    /// unknowns.
    fn frame_covariance(
        &self,
        flown: &Flown<'_>,
        covariance: &DMatrix<f64>,
        t: f64,
        spread: &DMatrixView<'_, f64>,
        of_attitude: &Matrix3<f64>,
        channels: &Channels,
    ) -> DMatrix<f64> {
        let layout = flown.layout;
        let n = layout.n_channels;
        let acting = flown.splines.acting(t, 0);
        let at = |k: usize, c: usize| layout.coefficients() + (acting.first + k) * n + c;
        let turning = if layout.is_planar { 2..3 } else { 0..3 };
        let n_turns = turning.len();
        let mut found = DMatrix::zeros(n_turns + n, n_turns + n);
        for (row, k) in turning.clone().enumerate() {
            for (column, l) in turning.clone().enumerate() {
                found[(row, column)] = of_attitude[(k, l)];
            }
            for c in 0..n {
                let sum: f64 =
                    acting.factors.iter().enumerate().map(|(i, x)| x * spread[(k, at(i, c))]).sum();
                (found[(row, n_turns + c)], found[(n_turns + c, row)]) = (sum, sum);
            }
        }
        for a in 0..n {
            for b in 0..n {
                let mut sum = 0.0;
                for (i, x) in acting.factors.iter().enumerate() {
                    for (j, y) in acting.factors.iter().enumerate() {
                        sum += x * y * covariance[(at(i, a), at(j, b))];
                    }
                }
                found[(n_turns + a, n_turns + b)] = sum;
            }
        }
        flown.splines.of_displacements(channels, &mut found, n_turns);
        found
    }

    /// The derivatives of the moment of inertia about the axis of the momentum by the unknowns.
    fn moment_gradient(
        &self,
        search: &Search<'_>,
        estimate: &Estimate,
        q: &[f64],
        t: f64,
        direction: &Vector3<f64>,
        attitude: &Attitude,
        placed: &Placed,
        data: &mut Data,
    ) -> Result<RowDVector<f64>, ReconstructionError> {
        let Search { flown, room, .. } = search;
        let (model, layout, splines) = (self.model, flown.layout, flown.splines);
        let squared = estimate.scale.powi(2);
        let n_linear = model.joint(0).map_or(0, |joint| joint.kind().n_linear);
        let mut moved = q.to_vec();
        let mut step = vec![0.0; model.n_velocities()];
        let mut by_v = Vec::with_capacity(step.len() - n_linear);
        for k in n_linear..step.len() {
            let mut at = |h: f64| -> Result<f64, ReconstructionError> {
                step[k] = h;
                model.displace(q, &step, &mut moved)?;
                step[k] = 0.0;
                let orientation = read_orientation(layout.is_planar, &moved);
                let turn = turn_of(model, &orientation);
                let inertia = inertia_of(model, data, &moved, &turn)?;
                Ok(direction.dot(&(inertia * direction)) * squared)
            };
            by_v.push((at(DISPLACEMENT)? - at(-DISPLACEMENT)?) / (2.0 * DISPLACEMENT));
        }
        let n_turns = layout.turns.len();
        let mut gradient = RowDVector::zeros(layout.n(splines.n_knots()));
        if let Some(by) = &attitude.by_unknowns {
            let mut of_turn = Vector3::zeros();
            for k in 0..n_turns {
                of_turn += layout.displacement(k) * by_v[k];
            }
            gradient += of_turn.transpose() * by;
        }
        let mut by_channel: Vec<Vector3<f64>> = by_v[n_turns..].iter().map(|x| Vector3::x() * *x).collect();
        splines.by_displacements(&room.channels, &mut by_channel);
        let acting = splines.acting(t, 0);
        for (k, factor) in acting.factors.iter().enumerate() {
            for (c, by) in by_channel.iter().enumerate() {
                gradient[layout.coefficients() + (acting.first + k) * layout.n_channels + c] += factor * by.x;
            }
        }
        let inertia = inertia_of(model, data, q, &placed.turn)? * squared;
        let turned = inertia * direction;
        let across = (turned - direction * direction.dot(&turned)) * (2.0 / estimate.momentum.norm());
        for (k, turn) in layout.momentum().zip(&layout.turns) {
            gradient[k] += across.dot(turn);
        }
        if let Some(k) = layout.scale() {
            gradient[k] += 2.0 * direction.dot(&turned) / estimate.scale;
        }
        Ok(gradient)
    }

    fn counting(&self) -> Counting {
        counting_of(self.model)
    }

    /// The root in the frame of travel, in each frame.
    fn travelling(&self, estimate: &Estimate, at: &Linearized) -> Vec<UnitQuaternion<f64>> {
        travelling(self.model, &estimate.momentum, at.attitudes.iter().map(|attitude| attitude.orientation))
    }

    /// Momentum, take-off, scale and gravity with their covariance.
    pub(super) fn summarize(
        &self,
        search: &Search<'_>,
        estimate: &Estimate,
        covariance: &DMatrix<f64>,
        at: &Linearized,
        flight: &mut ReconstructedFlight,
    ) {
        let layout = search.flown.layout;
        let times = &search.observed.times;
        let t = times[0] - times[search.observed.reference];
        let gravity = self.model.gravity();
        let squared = estimate.scale.powi(2);
        let mut rows = DMatrix::zeros(11, covariance.nrows());
        let mut add = |first: usize, k: usize, column: Vector3<f64>| {
            let mut view = rows.fixed_view_mut::<3, 1>(first, k);
            view += column;
        };
        for (k, turn) in layout.momentum().zip(&layout.turns) {
            add(0, k, turn * squared);
        }
        for (k, axis) in layout.center().zip(&layout.axes) {
            add(3, k, *axis);
        }
        for (k, axis) in layout.velocity().zip(&layout.axes) {
            add(3, k, axis * t);
            add(6, k, *axis);
        }
        if let Some(k) = layout.gravity() {
            add(3, k, gravity * (0.5 * t * t));
            add(6, k, gravity * t);
            rows[(10, k)] = 1.0;
        }
        if let Some(k) = layout.scale() {
            let mut view = rows.fixed_view_mut::<3, 1>(0, k);
            view += estimate.momentum * (2.0 * estimate.scale);
            rows[(9, k)] = 1.0;
        }
        flight.covariance = &rows * covariance * rows.transpose();
        let deviation = |k: usize| standard_deviation(flight.covariance[(k, k)]);
        let three = |first: usize| Vector3::from_fn(|k, _| deviation(first + k));
        let center = search.flown.center_of_mass(estimate, times[search.observed.reference], times[0]);
        let velocity = self.velocity_at(estimate, t);
        flight.angular_momentum = Quantity { value: estimate.momentum * squared, deviation: three(0) };
        flight.center_of_mass = Quantity { value: center, deviation: three(3) };
        flight.velocity = Quantity { value: velocity, deviation: three(6) };
        flight.scale[1] = deviation(9);
        flight.gravity[1] = deviation(10);
        if layout.has_gravity {
            flight.seen_gravity = flight.gravity;
        }
        // along the gravity of the estimate
        let down = gravity * estimate.gravity;
        let up = -velocity.dot(&down);
        flight.height = if up > 0.0 { 0.5 * up * up / down.norm().powi(3) } else { 0.0 };
        let orientations = self.travelling(estimate, at);
        let counting = self.counting();
        let last = orientations.len() - 1;
        let [start, end] = [0, last].map(|i| counting.gradients(&orientations[i]));
        for (k, angle) in [0, 2].into_iter().enumerate() {
            let mut row = DVector::zeros(covariance.nrows());
            for (i, sign, gradient) in [(last, 1.0, end[angle]), (0, -1.0, start[angle])] {
                if let Some(by) = &at.attitudes[i].by_unknowns {
                    row += by.tr_mul(&(gradient * sign));
                }
            }
            flight.turns_deviation[k] = standard_deviation(row.dot(&(covariance * &row))) / TAU;
        }
    }
}

/// Orientations of the root in its joint frame, seen in the world turned about the vertical, so that the axis of the somersault is lateral to
/// the body in the first of them.
pub(crate) fn travelling(
    model: &Model,
    momentum: &Vector3<f64>,
    orientations: impl IntoIterator<Item = UnitQuaternion<f64>>,
) -> Vec<UnitQuaternion<f64>> {
    let counting = counting_of(model);
    let placement = model.placement(0).map_or(Matrix3::identity(), |p| p.rotation);
    let mut travel = None;
    let in_travel = |orientation: UnitQuaternion<f64>| {
        let travel = travel.get_or_insert_with(|| {
            let left = placement * (orientation * counting.axes * Vector3::y());
            let level = Vector3::new(momentum.x, momentum.y, 0.0);
            let axis = if level.norm() > HORIZONTAL * momentum.norm() {
                level * level.dot(&left).signum()
            } else {
                Vector3::new(left.x, left.y, 0.0)
            };
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -(-axis.x).atan2(axis.y))
        });
        *travel * counting.axes.inverse() * orientation
    };
    orientations.into_iter().map(in_travel).collect()
}

/// The body's axes, x forward and z along it, in those of the root: those of the world at the neutral configuration.
pub(crate) fn counting_of(model: &Model) -> Counting {
    let placement = model.placement(0).map_or(Matrix3::identity(), |p| p.rotation);
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(placement.transpose());
    Counting { axes: UnitQuaternion::from_rotation_matrix(&rotation) }
}

/// The inertia about the centre of mass of the model with its joints locked, in axes of the world.
fn inertia_of(
    model: &Model,
    data: &mut Data,
    q: &[f64],
    turn: &Matrix3<f64>,
) -> Result<Matrix3<f64>, ReconstructionError> {
    let rates = model.velocities_of(0);
    let matrix = model.centroidal(data, q)?.matrix;
    let mut inertia = Matrix3::zeros();
    if rates.len() == 3 {
        // about the normal alone
        let normal = turn.column(2);
        let momentum = matrix.fixed_view::<3, 1>(3, rates.end - 1).into_owned();
        inertia = momentum * normal.transpose();
    } else {
        for (k, axis) in turn.column_iter().enumerate() {
            inertia += matrix.fixed_view::<3, 1>(3, rates.end - 3 + k) * axis.transpose();
        }
    }
    Ok(inertia)
}
