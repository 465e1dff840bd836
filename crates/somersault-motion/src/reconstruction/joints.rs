//! Joint motions as cubic splines of time, with their derivatives.
//!
//! Each degree of freedom of the joints has a channel φ(t), a uniform cubic spline. Of hinges and slides it is the position;
//! three channels make the rotation vector of a ball joint against a fixed reference, R = R₀ exp(φ), whose velocity in
//! the axes of the child is v = J_r(φ) φ̇. The coefficients of a knot lie side by side, so that those which act at one
//! time are one run of numbers.

use super::ReconstructionError;
use nalgebra::{DMatrix, Matrix3, UnitQuaternion, Vector3};
use somersault_core::lie::so3;
use somersault_core::spline::UniformBasis;
use somersault_multibody::Model;

/// Basis functions that act at one time.
pub(super) const ACTIVE: usize = 4;

/// The values and rates of all channels at one time.
#[derive(Debug, Clone)]
pub(super) struct Channels {
    pub(super) value: Vec<f64>,
    pub(super) rate: Vec<f64>,
}

/// The basis functions that act at a time, with one of their derivatives, and the number of the first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Acting {
    pub(super) first: usize,
    pub(super) factors: [f64; ACTIVE],
}

#[derive(Debug, Clone)]
struct Ball {
    channel: usize,
    position: usize,
    reference: UnitQuaternion<f64>,
}

/// The splines of all joints but the root's.
#[derive(Debug, Clone)]
pub(super) struct JointSplines {
    basis: UniformBasis,
    start: f64,
    duration: f64,
    /// Numbers of the root in q and in v.
    root: (usize, usize),
    n_channels: usize,
    /// Channel and place in q.
    scalars: Vec<(usize, usize)>,
    balls: Vec<Ball>,
}

impl JointSplines {
    /// Splines over `[start, start + duration]` with `n_intervals` intervals; ball joints turn about their rotation in `q`.
    pub(super) fn try_new(
        model: &Model,
        q: &[f64],
        (start, duration): (f64, f64),
        n_intervals: usize,
    ) -> Result<Self, ReconstructionError> {
        let root = (model.positions_of(0).len(), model.velocities_of(0).len());
        let (mut scalars, mut balls) = (Vec::new(), Vec::new());
        for i in 1..model.n_bodies() {
            let (at, rates) = (model.positions_of(i), model.velocities_of(i));
            let channel = rates.start.saturating_sub(root.1);
            match (at.len(), rates.len()) {
                (0, 0) => {}
                (1, 1) => scalars.push((channel, at.start)),
                (4, 3) => {
                    balls.push(Ball { channel, position: at.start, reference: so3::normalized_xyzw(&q[at]) })
                }
                _ => {
                    let joint = model.joint(i).map_or("", |joint| joint.kind().name);
                    let body = model.name(i).unwrap_or_default().to_owned();
                    return Err(ReconstructionError::Joint { body, joint });
                }
            }
        }
        let basis = UniformBasis::try_new(3, n_intervals + 3)?;
        Ok(Self { basis, start, duration, root, n_channels: model.n_velocities() - root.1, scalars, balls })
    }

    /// The limits that `model` states, of each channel.
    pub(super) fn limits(&self, model: &Model) -> Vec<Option<[f64; 2]>> {
        let mut limits = vec![None; self.n_channels];
        for i in 1..model.n_bodies() {
            let velocities = model.velocities_of(i);
            if velocities.len() == 1
                && let Some(channel) = velocities.start.checked_sub(self.root.1)
            {
                limits[channel] = model.limits(i);
            }
        }
        limits
    }

    pub(super) fn n_channels(&self) -> usize {
        self.n_channels
    }

    /// Coefficients of each channel.
    pub(super) fn n_knots(&self) -> usize {
        self.basis.n_coefficients()
    }

    /// Time between knots, s.
    pub(super) fn spacing(&self) -> f64 {
        self.duration / self.basis.n_intervals() as f64
    }

    /// Time from the first knot to the last, s.
    pub(super) fn duration(&self) -> f64 {
        self.duration
    }

    /// Time since the start and until the end, s.
    pub(super) fn apart_from_ends(&self, t: f64) -> [f64; 2] {
        let passed = t - self.start;
        [passed, self.duration - passed]
    }

    pub(super) fn channels(&self) -> Channels {
        Channels { value: vec![0.0; self.n_channels], rate: vec![0.0; self.n_channels] }
    }

    /// The coefficients of joints that rest as in `q`.
    pub(super) fn at_rest(&self, q: &[f64]) -> Vec<f64> {
        let mut posture = vec![0.0; self.n_channels];
        for (channel, at) in &self.scalars {
            posture[*channel] = q[*at];
        }
        for Ball { channel, position, reference } in &self.balls {
            let turned = so3::log(&(reference.inverse() * so3::normalized_xyzw(&q[*position..position + 4])));
            posture[*channel..channel + 3].copy_from_slice(turned.as_slice());
        }
        posture.repeat(self.n_knots())
    }

    /// The basis functions at `t`, or their `derivative`-th derivative by time.
    pub(super) fn acting(&self, t: f64, derivative: usize) -> Acting {
        let mut factors = [0.0; ACTIVE];
        let first = self.basis.evaluate((t - self.start) / self.duration, derivative, &mut factors);
        let scale = self.duration.powi(-(derivative as i32));
        Acting { first, factors: factors.map(|x| x * scale) }
    }

    fn combine(&self, coefficients: &[f64], acting: &Acting, out: &mut [f64]) {
        let n = self.n_channels;
        out.fill(0.0);
        for (k, factor) in acting.factors.iter().enumerate() {
            let row = &coefficients[(acting.first + k) * n..(acting.first + k + 1) * n];
            out.iter_mut().zip(row).for_each(|(sum, c)| *sum += factor * c);
        }
    }

    /// Writes positions and velocities of the joints at `t`, the numbers of q and v after those of the root, and keeps
    /// the channels in `room`.
    pub(super) fn evaluate(
        &self,
        coefficients: &[f64],
        t: f64,
        room: &mut Channels,
        q: &mut [f64],
        v: &mut [f64],
    ) {
        self.combine(coefficients, &self.acting(t, 0), &mut room.value);
        self.combine(coefficients, &self.acting(t, 1), &mut room.rate);
        for (channel, at) in &self.scalars {
            q[at - self.root.0] = room.value[*channel];
            v[*channel] = room.rate[*channel];
        }
        for Ball { channel, position, reference } in &self.balls {
            let (value, rate) = (of_ball(&room.value, *channel), of_ball(&room.rate, *channel));
            let at = position - self.root.0;
            q[at..at + 4].copy_from_slice((reference * so3::exp(&value)).coords.as_slice());
            v[*channel..channel + 3].copy_from_slice(so3::dexp(&-value, &rate).as_slice());
        }
    }

    /// Writes the accelerations of the joints at `t`.
    pub(super) fn accelerations(&self, coefficients: &[f64], t: f64, room: &mut Channels, out: &mut [f64]) {
        self.combine(coefficients, &self.acting(t, 0), &mut room.value);
        self.combine(coefficients, &self.acting(t, 1), &mut room.rate);
        self.combine(coefficients, &self.acting(t, 2), out);
        for Ball { channel, .. } in &self.balls {
            let (value, rate) = (of_ball(&room.value, *channel), of_ball(&room.rate, *channel));
            let [turn, drift] = ball_partials(&value, &rate);
            let acceleration = turn * of_ball(out, *channel) + drift * rate;
            out[*channel..channel + 3].copy_from_slice(acceleration.as_slice());
        }
    }

    /// The largest rotation of a ball joint from its reference that coefficients hold, rad: within a turn of it the channels
    /// describe all rotations.
    pub(super) fn largest_turn(&self, coefficients: &[f64]) -> f64 {
        let of_knot = |knot: &[f64]| {
            self.balls.iter().map(|ball| of_ball(knot, ball.channel).norm()).fold(0.0, f64::max)
        };
        coefficients.chunks_exact(self.n_channels.max(1)).map(of_knot).fold(0.0, f64::max)
    }

    /// Derivatives by channels and their rates, of what has derivatives by displacements of the joints and by their
    /// velocities.
    pub(super) fn by_channels(
        &self,
        at: &Channels,
        by_shape: &mut [Vector3<f64>],
        by_rate: &mut [Vector3<f64>],
    ) {
        for Ball { channel, .. } in &self.balls {
            let [turn, drift] = ball_partials(&of_ball(&at.value, *channel), &of_ball(&at.rate, *channel));
            let columns = |of: &[Vector3<f64>]| {
                Matrix3::from_columns(&[of[*channel], of[channel + 1], of[channel + 2]])
            };
            let (shape, rate) = (columns(by_shape), columns(by_rate));
            let (of_value, of_rate) = (shape * turn + rate * drift, rate * turn);
            for k in 0..3 {
                by_shape[channel + k] = of_value.column(k).into_owned();
                by_rate[channel + k] = of_rate.column(k).into_owned();
            }
        }
    }

    /// Derivatives by channels, in place, of what has derivatives by displacements of the joints.
    pub(super) fn by_displacements(&self, at: &Channels, by_shape: &mut [Vector3<f64>]) {
        for Ball { channel, .. } in &self.balls {
            let turn = so3::right_jacobian(&of_ball(&at.value, *channel));
            let shape =
                Matrix3::from_columns(&[by_shape[*channel], by_shape[channel + 1], by_shape[channel + 2]]);
            for (k, column) in (shape * turn).column_iter().enumerate() {
                by_shape[channel + k] = column.into_owned();
            }
        }
    }

    /// The covariance with displacements of the joints where `covariance` has that with channels, from row and column `first` on: J C Jᵀ, in place.
    pub(super) fn of_displacements(&self, at: &Channels, covariance: &mut DMatrix<f64>, first: usize) {
        for Ball { channel, .. } in &self.balls {
            let turn = so3::right_jacobian(&of_ball(&at.value, *channel));
            let rows = turn * covariance.rows(first + channel, 3);
            covariance.rows_mut(first + channel, 3).copy_from(&rows);
            let columns = covariance.columns(first + channel, 3) * turn.transpose();
            covariance.columns_mut(first + channel, 3).copy_from(&columns);
        }
    }
}

fn of_ball(channels: &[f64], first: usize) -> Vector3<f64> {
    Vector3::from_column_slice(&channels[first..first + 3])
}

/// J_r(φ), and ∂(J_r(φ) φ̇)/∂φ.
fn ball_partials(value: &Vector3<f64>, rate: &Vector3<f64>) -> [Matrix3<f64>; 2] {
    [so3::right_jacobian(value), -so3::dexp_partials(&-value, rate)]
}
