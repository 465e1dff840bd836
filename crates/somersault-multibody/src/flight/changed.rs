//! A flight flown again with a change: what would have been.
//!
//! The joints of a flight are known at times, with their velocities. [`JointCurves`] are the cubic Hermite interpolants h of them, and a
//! [`FlightChange`] makes another joint motion of the same diver, in a flight whose duration is D instead of D₀:
//!
//! ```text
//! s(t) = h(τ) ⊕ α w(τ) d,   τ = t₀ + r (t − t₀) − δ σ(x),   r = D₀/D,   x = (t₀ + r (t − t₀) − t_h)/(t_o − t_h)
//! ```
//! The numbers of hinges and slides are added, and a ball is turned by exp(α w d) in the axes of its body. Between samples i and i + 1 a ball is at
//!
//! ```text
//! R(x) = R_i exp θ(x),   θ(0) = 0,   θ(1) = log(R_iᵀ R_{i+1}),   θ′(0) = ω_i h,   θ′(1) = J_r(θ(1))⁻¹ ω_{i+1} h
//! ```
//! with θ a cubic, h the time between the samples and ω the velocity in the axes of the body.
//!
//! From t_h to t_o a posture is held. With σ(x) = 3x² − 2x³ it is held longer by δ, and all that follows is later by δ; what comes after the
//! last sample is taken to come to rest with 0.05 s. The posture is moved by α along d; w rises from 0 to 1 while it is taken, and falls while
//! it is left. The momentum is (1 + ε) L. A flight that rises higher by Δ lasts until the centre of mass is where it was at the end, and all
//! joints take their time in proportion.
//!
//! The orientation follows from the momentum ([`Flight`]), in the steps of [`step`](super::step). Their derivatives are exact, and so are those of
//! the last orientation by δ, α and ε, but that ḧ, which jumps at the samples, is there that of one side:
//!
//! ```text
//! ∂s/∂δ = −ḣ σ,  ∂ṡ/∂δ = −ḧ σ − ḣ σ̇;   ∂s/∂α = w d,  ∂ṡ/∂α = ẇ d;   ∂L/∂ε = L
//! ```
//! Those of a ball are displacements in the axes of its body: ∂ω/∂α has − w d × exp(−α w d) ω beside ẇ d.

use super::step::{NODES, StageRate, StepDerivative, turn};
use super::{Flight, FlightData, FlightError, TakeOff};
use crate::counting::turns_about_z;
use crate::error::DynamicsError;
use crate::joint::Group;
use crate::model::Model;
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::argument::{ArgumentError, expect_finite, expect_least, expect_length, expect_range};
use somersault_core::lie::so3::{self, normalized_xyzw};
use std::f64::consts::TAU;

/// Joints of a flight at times, and between them: hinges, slides and balls.
#[derive(Debug, Clone, PartialEq)]
pub struct JointCurves {
    times: Vec<f64>,
    /// Rows without the root.
    positions: Vec<f64>,
    velocities: Vec<f64>,
    n_positions: usize,
    n_velocities: usize,
    tracks: Vec<Track>,
}

/// Where a row has a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Track {
    /// A hinge or a slide.
    Number { q: usize, v: usize },
    /// The quaternion of a ball, and its velocity.
    Ball { q: usize, v: usize },
}

/// While a posture is held, and what of it changes.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldPosture {
    /// When it begins to be taken, is taken, begins to be left and is left, s, rising.
    pub times: [f64; 4],
    /// d, for each degree of freedom after the root's.
    pub direction: Vec<f64>,
}

/// What is to be different in a flight.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FlightChange {
    /// δ, by how much later the held posture is left, s; earlier where it is negative.
    pub opening: f64,
    /// α, by how much the held posture is moved along its direction, rad or m.
    pub posture: f64,
    /// ε, by which fraction of it the angular momentum is larger.
    pub momentum: f64,
    /// Δ, by how much higher the centre of mass rises, m.
    pub height: f64,
}

/// A flight as it is with a change.
#[derive(Debug, Clone, PartialEq)]
pub struct ChangedFlight {
    /// As many as the samples of the joints, s.
    pub times: Vec<f64>,
    /// Configurations, one after the other; the angle of a planar root counts whole turns.
    pub positions: Vec<f64>,
    /// Velocities.
    pub velocities: Vec<f64>,
    /// Orientations of the root in its joint frame.
    pub orientations: Vec<UnitQuaternion<f64>>,
    /// Those after each step, the first at the start: some 5 ms apart, so that turns can be counted between times that are further.
    pub path: Vec<UnitQuaternion<f64>>,
    /// Displacement of the last orientation in axes of the root by δ, α and ε.
    pub by_change: [Vector3<f64>; N_CHANGES],
    /// Derivatives of the joints in the last configuration by δ and α; ε does not move them.
    pub joints_by_change: [Vec<f64>; 2],
}

/// Changes with exact derivatives: δ, α and ε.
pub const N_CHANGES: usize = 3;

/// The longest step, s: 0.08 rad at 15 rad/s.
const LONGEST_STEP: f64 = 0.0051;
/// The longest flight, s: some hundred thousand steps.
const LONGEST: f64 = 500.0;
/// Between the times of a posture that is taken and left, at least, s.
const SHORTEST: f64 = 1e-3;
/// In which time joints come to rest after the last sample, s.
const REST: f64 = 0.05;
/// By which fraction of the time a posture is held this may become longer or shorter: τ rises as long as δ σ̇ < 1, σ̇ ≤ 3/2.
const WARPED: f64 = 0.6;

/// h, ḣ and ḧ of a number.
type Jet = [f64; 3];

/// A ball: its rotation, its velocity and the rate of that, in the axes of the body.
struct BallJet {
    rotation: UnitQuaternion<f64>,
    velocity: Vector3<f64>,
    acceleration: Vector3<f64>,
}

/// σ, rising from 0 at `from` to 1 at `to`, and its derivatives.
fn smooth(t: f64, [from, to]: [f64; 2]) -> Jet {
    let h = to - from;
    let x = (t - from) / h;
    let curved = if (0.0..=1.0).contains(&x) { (6.0 - 12.0 * x) / (h * h) } else { 0.0 };
    let x = x.clamp(0.0, 1.0);
    [x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x) / h, curved]
}

/// The cubic from 0 to `b`, with slopes `u` and `v` at the ends, at x; and its derivatives by x.
fn cubic(b: f64, u: f64, v: f64, x: f64) -> Jet {
    // u x + c x² + d x³
    let (c, d) = (3.0 * b - 2.0 * u - v, u + v - 2.0 * b);
    [x * (u + x * (c + x * d)), u + x * (2.0 * c + 3.0 * d * x), 2.0 * c + 6.0 * d * x]
}

impl JointCurves {
    /// Curves through configurations and velocities of the joints of `model` after its root, one row after the other, at rising times.
    pub fn try_new(
        model: &Model,
        times: Vec<f64>,
        positions: Vec<f64>,
        velocities: Vec<f64>,
    ) -> Result<Self, FlightError> {
        let tracks = tracks(model)?;
        let n_positions = model.n_positions() - model.positions_of(0).end;
        let n_velocities = model.n_velocities() - model.velocities_of(0).end;
        let checked = || -> Result<(), DynamicsError> {
            expect_least("times", times.len(), 2)?;
            expect_finite("times", &times)?;
            expect_range("times", times[times.len() - 1] - times[0], "a flight of at most 500 s", |x| {
                x <= LONGEST
            })?;
            if let Some(k) = times.windows(2).position(|pair| pair[1] <= pair[0]) {
                let allowed = "rising";
                return Err(
                    ArgumentError::OutOfRange { argument: "times", allowed, found: times[k + 1] }.into()
                );
            }
            for (argument, rows, n) in
                [("positions", &positions, n_positions), ("velocities", &velocities, n_velocities)]
            {
                expect_length(argument, rows.len(), n * times.len())?;
                expect_finite(argument, rows)?;
            }
            for (body, link) in model.links().iter().enumerate().skip(1) {
                let Some(at) = link.joint().kind().quaternion() else { continue };
                let from = model.positions_of(body).start - model.positions_of(0).end;
                let is_none = |row: &[f64]| row[from + at.start..from + at.end].iter().all(|x| *x == 0.0);
                if positions.chunks_exact(n_positions).any(is_none) {
                    return Err(DynamicsError::NoRotation { joint: link.name().to_owned() });
                }
            }
            Ok(())
        };
        checked()?;
        Ok(Self { times, positions, velocities, n_positions, n_velocities, tracks })
    }

    /// First and last time, s.
    pub fn interval(&self) -> [f64; 2] {
        [self.times[0], self.times[self.times.len() - 1]]
    }

    /// The same with the joints displaced by as much at all times, a number for each degree of freedom: balls in the axes of their bodies.
    pub fn displaced(&self, by: &[f64]) -> Result<Self, DynamicsError> {
        expect_length("by", by.len(), self.n_velocities)?;
        expect_finite("by", by)?;
        let mut moved = self.clone();
        for track in &self.tracks {
            match *track {
                Track::Number { q, v } => {
                    moved.positions.chunks_exact_mut(self.n_positions).for_each(|row| row[q] += by[v]);
                }
                Track::Ball { q, v } => {
                    let turn = so3::exp(&Vector3::from_column_slice(&by[v..v + 3]));
                    for row in moved.positions.chunks_exact_mut(self.n_positions) {
                        let turned = normalized_xyzw(&row[q..q + 4]) * turn;
                        row[q..q + 4].copy_from_slice(turned.coords.as_slice());
                    }
                    // velocities are in axes that are displaced
                    for row in moved.velocities.chunks_exact_mut(self.n_velocities) {
                        let velocity = turn.inverse() * Vector3::from_column_slice(&row[v..v + 3]);
                        row[v..v + 3].copy_from_slice(velocity.as_slice());
                    }
                }
            }
        }
        Ok(moved)
    }

    /// The sample before `t` and what part of the way to the next it is, with the time between both; none after the last sample.
    fn place(&self, t: f64) -> Option<(usize, f64, f64)> {
        let last = self.times.len() - 1;
        if t > self.times[last] {
            return None;
        }
        let i = self.times.partition_point(|time| *time <= t).clamp(1, last) - 1;
        let h = self.times[i + 1] - self.times[i];
        Some((i, (t - self.times[i]) / h, h))
    }

    /// By how much what moves with velocity 1 at the last sample moves until `t`, as it comes to rest.
    fn rest(&self, t: f64) -> Jet {
        let left = (-(t - self.interval()[1]) / REST).exp();
        [REST * (1.0 - left), left, -left / REST]
    }

    /// A number at `t`, from its places in the rows.
    fn number(&self, q: usize, v: usize, t: f64) -> Jet {
        let position = |i: usize| self.positions[i * self.n_positions + q];
        let velocity = |i: usize| self.velocities[i * self.n_velocities + v];
        let Some((i, x, h)) = self.place(t) else {
            let last = self.times.len() - 1;
            let [moved, rate, curved] = self.rest(t).map(|x| x * velocity(last));
            return [position(last) + moved, rate, curved];
        };
        let start = position(i);
        let [moved, rate, curved] = cubic(position(i + 1) - start, velocity(i) * h, velocity(i + 1) * h, x);
        [start + moved, rate / h, curved / (h * h)]
    }

    /// A ball at `t`, from its places in the rows.
    fn ball(&self, q: usize, v: usize, t: f64) -> BallJet {
        let rotation = |i: usize| normalized_xyzw(&self.positions[i * self.n_positions + q..][..4]);
        let velocity =
            |i: usize| Vector3::from_column_slice(&self.velocities[i * self.n_velocities + v..][..3]);
        let Some((i, x, h)) = self.place(t) else {
            let last = self.times.len() - 1;
            let [moved, rate, curved] = self.rest(t).map(|x| velocity(last) * x);
            return BallJet {
                rotation: rotation(last) * so3::exp(&moved),
                velocity: rate,
                acceleration: curved,
            };
        };
        let start = rotation(i);
        let to = so3::log(&(start.inverse() * rotation(i + 1)));
        let from_slope = velocity(i) * h;
        let to_slope = so3::right_jacobian_inverse(&to) * (velocity(i + 1) * h);
        let [mut angle, mut rate, mut curved] = [Vector3::zeros(); 3];
        for k in 0..3 {
            [angle[k], rate[k], curved[k]] = cubic(to[k], from_slope[k], to_slope[k], x);
        }
        rate /= h;
        curved /= h * h;
        BallJet {
            rotation: start * so3::exp(&angle),
            velocity: so3::dexp(&-angle, &rate),
            acceleration: so3::dexp(&-angle, &curved) - so3::dexp_partials(&-angle, &rate) * rate,
        }
    }
}

/// Where rows without the root have each joint after it.
fn tracks(model: &Model) -> Result<Vec<Track>, FlightError> {
    let [root_q, root_v] = [model.positions_of(0).end, model.velocities_of(0).end];
    let mut tracks = Vec::with_capacity(model.n_bodies() - 1);
    for (body, link) in model.links().iter().enumerate().skip(1) {
        let [q, v] = [model.positions_of(body).start - root_q, model.velocities_of(body).start - root_v];
        match (link.joint().group(), link.joint().n_velocities()) {
            (Group::Vector, 0) => (),
            (Group::Vector, 1) => tracks.push(Track::Number { q, v }),
            (Group::Rotations, _) => tracks.push(Track::Ball { q, v }),
            (Group::Vector | Group::PlanarMotions | Group::Motions, _) => {
                let body = link.name().to_owned();
                return Err(FlightError::Joint { body, joint: link.joint().kind().name });
            }
        }
    }
    Ok(tracks)
}

impl HeldPosture {
    /// w and its derivatives at τ.
    fn weight(&self, t: f64) -> Jet {
        let [begins, held, left, ends] = self.times;
        let [rise, rising, rise_curved] = smooth(t, [begins, held]);
        let [fall, falling, fall_curved] = smooth(t, [left, ends]);
        let stays = 1.0 - fall;
        let curved = rise_curved * stays - 2.0 * rising * falling - rise * fall_curved;
        [rise * stays, rising * stays - rise * falling, curved]
    }

    fn check(&self, curves: &JointCurves) -> Result<(), DynamicsError> {
        expect_length("direction", self.direction.len(), curves.n_velocities)?;
        expect_finite("direction", &self.direction)?;
        expect_finite("phase", &self.times)?;
        let [start, end] = curves.interval();
        let mut before = start;
        for (k, t) in self.times.iter().enumerate() {
            let is_allowed = |t: f64| t <= end && if k == 0 { t >= before } else { t >= before + SHORTEST };
            expect_range("phase", *t, "rising by at least 1 ms, within the flight", is_allowed)?;
            before = *t;
        }
        Ok(())
    }
}

/// A flight whose joints are known, to be flown again.
#[derive(Debug, Clone)]
pub struct KnownFlight<'m> {
    flight: Flight<'m>,
    orientation: UnitQuaternion<f64>,
    curves: JointCurves,
    held: HeldPosture,
}

/// The joint motion of a change: its time, and what it adds.
struct Changed<'k> {
    known: &'k KnownFlight<'k>,
    change: FlightChange,
    /// r.
    pace: f64,
}

impl Changed<'_> {
    /// Positions and velocities at `t`, and their derivatives by δ and α.
    fn evaluate(&self, t: f64, q: &mut [f64], v: &mut [f64], by: &mut [[Vec<f64>; 2]; 2]) {
        let KnownFlight { curves, held, .. } = self.known;
        let FlightChange { opening, posture, .. } = self.change;
        let start = curves.interval()[0];
        let regular = start + self.pace * (t - start);
        let [_, begins, ends, _] = held.times;
        let [sigma, slope, _] = smooth(regular, [begins, ends]);
        let (tau, rate) = (regular - opening * sigma, self.pace * (1.0 - opening * slope));
        let [weight, weight_rate, weight_curved] = held.weight(tau);
        for track in &curves.tracks {
            match *track {
                Track::Number { q: at, v: k } => {
                    let along = held.direction[k];
                    let mut jet = curves.number(at, k, tau);
                    for (x, w) in jet.iter_mut().zip([weight, weight_rate, weight_curved]) {
                        *x += posture * along * w;
                    }
                    let [position, velocity, acceleration] = jet;
                    q[at] = position;
                    v[k] = velocity * rate;
                    by[0][0][k] = -velocity * sigma;
                    by[0][1][k] = -(acceleration * sigma * rate + velocity * slope * self.pace);
                    by[1][0][k] = weight * along;
                    by[1][1][k] = weight_rate * along * rate;
                }
                Track::Ball { q: at, v: k } => {
                    let along = Vector3::from_column_slice(&held.direction[k..k + 3]);
                    let BallJet { rotation, velocity, acceleration } = curves.ball(at, k, tau);
                    let turn = so3::exp(&(along * (posture * weight)));
                    // of h in the axes that it is turned into
                    let (own, own_rate) = (turn.inverse() * velocity, turn.inverse() * acceleration);
                    let added = along * (posture * weight_rate);
                    let velocity = own + added;
                    let acceleration = own_rate + own.cross(&added) + along * (posture * weight_curved);
                    q[at..at + 4].copy_from_slice((rotation * turn).coords.as_slice());
                    let back = acceleration * (sigma * rate) + velocity * (slope * self.pace);
                    let [[opened, opened_rate], [moved, moved_rate]] = &mut *by;
                    for (out, column) in [
                        (&mut v[k..k + 3], velocity * rate),
                        (&mut opened[k..k + 3], -velocity * sigma),
                        (&mut opened_rate[k..k + 3], -back),
                        (&mut moved[k..k + 3], along * weight),
                        (
                            &mut moved_rate[k..k + 3],
                            (along * weight_rate - along.cross(&own) * weight) * rate,
                        ),
                    ] {
                        out.copy_from_slice(column.as_slice());
                    }
                }
            }
        }
    }
}

impl<'m> KnownFlight<'m> {
    /// The flight of `model` from `take_off`, at the first time of the curves, with the root at `orientation` as q has it.
    pub fn try_new(
        model: &'m Model,
        take_off: TakeOff,
        orientation: &[f64],
        curves: JointCurves,
        held: HeldPosture,
    ) -> Result<Self, FlightError> {
        let flight = Flight::try_new(model, take_off)?;
        let at = flight.orientation();
        let checked = || -> Result<(), DynamicsError> {
            expect_length("orientation", orientation.len(), at.len())?;
            expect_finite("orientation", orientation)?;
            let n_velocities = model.n_velocities() - flight.n_root();
            expect_length("degrees of freedom of the curves", curves.n_velocities, n_velocities)?;
            expect_length("numbers of the curves", curves.n_positions, model.n_positions() - at.end)?;
            held.check(&curves)
        };
        checked()?;
        let orientation = if flight.is_planar {
            so3::exp(&(Vector3::z() * orientation[0]))
        } else {
            normalized_xyzw(orientation)
        };
        Ok(Self { flight, orientation, curves, held })
    }

    /// Where it comes from.
    pub fn take_off(&self) -> &TakeOff {
        self.flight.take_off()
    }

    /// The held posture.
    pub fn held(&self) -> &HeldPosture {
        &self.held
    }

    /// How much later, or earlier, the held posture may be left, s: 0.6 of the time it is held.
    pub fn longest_delay(&self) -> f64 {
        let [_, held, left, _] = self.held.times;
        WARPED * (left - held)
    }

    /// Take-off and duration of the flight with a change.
    fn take_off_with(&self, change: &FlightChange) -> Result<(TakeOff, f64), DynamicsError> {
        let own = self.flight.take_off();
        let [start, end] = self.curves.interval();
        let duration = end - start;
        let mut take_off = *own;
        take_off.angular_momentum *= 1.0 + change.momentum;
        if change.height == 0.0 {
            return Ok((take_off, duration));
        }
        let down = self.flight.model().gravity();
        let gravity = down.norm();
        let allowed = "0 without gravity, else so that the centre of mass rises and reaches its last height";
        let refused =
            || ArgumentError::OutOfRange { argument: "height", allowed, found: change.height }.into();
        let Some(up) = (-down).try_normalize(f64::MIN_POSITIVE) else { return Err(refused()) };
        let before = own.velocity.dot(&up);
        // v²/2g is how far it rises
        let squared = before * before + 2.0 * gravity * change.height;
        if !(before > 0.0 && squared > 0.0) {
            return Err(refused());
        }
        let after = squared.sqrt();
        let rise = duration * (before - 0.5 * gravity * duration);
        let remaining = after * after - 2.0 * gravity * rise;
        if !(remaining >= 0.0 && remaining.is_finite()) {
            return Err(refused());
        }
        take_off.velocity += up * (after - before);
        Ok((take_off, (after + remaining.sqrt()) / gravity))
    }

    /// Flies with a change. δ is at most 0.6 of the time that the posture is held, to either side.
    pub fn fly(&self, change: &FlightChange) -> Result<ChangedFlight, FlightError> {
        let longest = self.longest_delay();
        let checked = || -> Result<(TakeOff, f64), DynamicsError> {
            let FlightChange { opening, posture, momentum, height } = change;
            for (argument, number) in
                [("opening", opening), ("posture", posture), ("momentum", momentum), ("height", height)]
            {
                expect_finite(argument, [number])?;
            }
            let allowed = "at most 1 to either side: twice as much, or none";
            expect_range("momentum", *momentum, allowed, |x| x.abs() <= 1.0)?;
            let largest = self.held.direction.iter().fold(1.0_f64, |largest, x| largest.max(x.abs()));
            let allowed = "so small that no joint turns by more than 2π";
            expect_range("posture", *posture, allowed, |x| x.abs() * largest <= TAU)?;
            let allowed = "at most 0.6 of the time that the posture is held, to either side";
            expect_range("opening", *opening, allowed, |x| x.abs() <= longest)?;
            let (take_off, duration) = self.take_off_with(change)?;
            expect_range("height", duration, "a flight of at most 500 s", |x| x <= LONGEST)?;
            Ok((take_off, duration))
        };
        let (take_off, duration) = checked()?;
        let model = self.flight.model();
        let flight = Flight::try_new(model, take_off)?;
        let [start, end] = self.curves.interval();
        let changed = Changed { known: self, change: *change, pace: (end - start) / duration };
        let (at, root_v) = (flight.orientation(), flight.n_root());
        let root_q = at.end;
        let n = self.curves.n_velocities;
        let none = || [vec![0.0; n], vec![0.0; n]];
        let mut by = [none(), none()];
        let mut data = FlightData::new(model);
        let (mut q, mut v) = (model.neutral(), vec![0.0; model.n_velocities()]);
        let mut current = self.orientation;
        let mut by_change = [Vector3::zeros(); N_CHANGES];
        let mut found = ChangedFlight {
            times: self.curves.times.iter().map(|t| start + (t - start) / changed.pace).collect(),
            positions: Vec::new(),
            velocities: Vec::new(),
            orientations: Vec::new(),
            path: vec![self.orientation],
            by_change,
            joints_by_change: none(),
        };
        let mut ends = Vec::with_capacity(found.times.len());
        for i in 0..found.times.len() {
            let to = found.times[i];
            let from = found.times[i.saturating_sub(1)];
            let n_steps = ((to - from) / LONGEST_STEP).ceil() as usize;
            let h = (to - from) / n_steps.max(1) as f64;
            for step in 0..n_steps {
                let t = from + h * step as f64;
                let mut derivative = StepDerivative::zero();
                let mut by_stage = [[Vector3::zeros(); N_CHANGES]; super::step::STAGES];
                let stage = |i: usize, orientation: &UnitQuaternion<f64>| {
                    changed.evaluate(t + h * NODES[i], &mut q[root_q..], &mut v[root_v..], &mut by);
                    flight.write_orientation(orientation, &mut q[at.clone()]);
                    let rate = flight.derivatives(&mut data, &q, &v)?;
                    for (out, [of_s, of_v]) in by_stage[i].iter_mut().zip(&by) {
                        let columns =
                            rate.by_shape.iter().zip(rate.by_shape_velocity).zip(of_s.iter().zip(of_v));
                        *out = columns.fold(Vector3::zeros(), |sum, ((a, b), (x, y))| sum + a * *x + b * *y);
                    }
                    by_stage[i][2] = rate.by_angular_momentum * self.flight.take_off().angular_momentum;
                    Ok::<_, DynamicsError>(StageRate {
                        angular_velocity: rate.angular_velocity,
                        by_orientation: rate.by_orientation,
                    })
                };
                current = turn(&current, h, stage, Some(&mut derivative))?;
                found.path.push(current);
                for (k, column) in by_change.iter_mut().enumerate() {
                    *column = derivative.by_start * *column;
                    for (matrix, by) in derivative.by_stage.iter().zip(&by_stage) {
                        *column += matrix * by[k];
                    }
                }
            }
            changed.evaluate(to, &mut q[root_q..], &mut v[root_v..], &mut by);
            flight.write_orientation(&current, &mut q[at.clone()]);
            flight.complete(&mut data, to, &mut q, &mut v)?;
            ends.push(found.path.len() - 1);
            found.positions.extend_from_slice(&q);
            found.velocities.extend_from_slice(&v);
            found.orientations.push(current);
        }
        if flight.is_planar {
            let turns = turns_about_z(found.path.iter().copied());
            for (row, end) in found.positions.chunks_exact_mut(model.n_positions()).zip(ends) {
                row[at.start] = turns[end];
            }
        }
        let [[opening, _], [posture, _]] = by;
        found.by_change = by_change;
        found.joints_by_change = [opening, posture];
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builder::ModelBuilder;
    use crate::flight::{FlightSystem, ShapeMotion};
    use crate::joint::Joint;
    use crate::link::{Link, MassProperties};
    use crate::models::{BallJointedDiver, Diver, Posture};
    use somersault_integrators::driver::{Adaptive, Steps};
    use somersault_integrators::methods::{Dop853, RungeKuttaMuntheKaas};
    use somersault_integrators::run::Run;
    use somersault_integrators::system::System;

    const DURATION: f64 = 1.2;

    /// Folded and unfolded by a square of a sine, and arms that swing apart in space.
    struct Fold {
        tracks: Vec<Track>,
        open: Vec<f64>,
        closed: Vec<f64>,
        n_velocities: usize,
    }

    /// A model, its configuration in posture A, and how it folds.
    fn bodies() -> [(Model, Vec<f64>, Fold); 3] {
        let of = |model: Model, [open, closed]: [Vec<f64>; 2]| {
            let root = model.positions_of(0).len();
            let fold = Fold {
                tracks: tracks(&model).unwrap(),
                open: open[root..].to_vec(),
                closed: closed[root..].to_vec(),
                n_velocities: model.n_velocities() - model.velocities_of(0).len(),
            };
            (model, open, fold)
        };
        let postures = [Posture::A, Posture::H];
        let hinged =
            |diver: Diver| of(diver.model().unwrap(), postures.map(|p| diver.configuration(p).unwrap()));
        let balls = BallJointedDiver::new(Diver::spatial());
        let with_balls = of(balls.model().unwrap(), postures.map(|p| balls.configuration(p).unwrap()));
        [hinged(Diver::planar()), hinged(Diver::spatial()), with_balls]
    }

    fn set(out: &mut [f64], vector: &Vector3<f64>) {
        out.copy_from_slice(vector.as_slice());
    }

    impl ShapeMotion for Fold {
        fn evaluate(&self, t: f64, q: &mut [f64], v: &mut [f64]) {
            let w = std::f64::consts::PI / DURATION;
            let (folded, folding) = ((w * t).sin().powi(2), w * (2.0 * w * t).sin());
            let wobble = |k: usize| (0.1 * (3.0 * t + k as f64).sin(), 0.3 * (3.0 * t + k as f64).cos());
            for track in &self.tracks {
                match *track {
                    Track::Number { q: at, v: k } => {
                        let (swing, rate) = wobble(k);
                        q[at] = self.open[at] + (self.closed[at] - self.open[at]) * folded + swing;
                        v[k] = (self.closed[at] - self.open[at]) * folding + rate;
                    }
                    Track::Ball { q: at, v: k } => {
                        let [open, closed] =
                            [&self.open, &self.closed].map(|row| normalized_xyzw(&row[at..at + 4]));
                        let to = so3::log(&(open.inverse() * closed));
                        let (swing, rate) = wobble(k);
                        let axis = Vector3::new(0.6, 0.0, 0.8);
                        let swung = so3::exp(&(axis * swing));
                        let turned = open * so3::exp(&(to * folded)) * swung;
                        q[at..at + 4].copy_from_slice(turned.coords.as_slice());
                        set(&mut v[k..k + 3], &(swung.inverse() * to * folding + axis * rate));
                    }
                }
            }
        }
    }

    const TIMES: [f64; 4] = [0.1, 0.4, 0.8, 1.1];

    fn known<'m>(model: &'m Model, open: &[f64], shape: &Fold) -> KnownFlight<'m> {
        let (n_q, n_v) = (shape.open.len(), shape.n_velocities);
        let times: Vec<f64> = (0..=120).map(|i| 0.01 * f64::from(i)).collect();
        let (mut positions, mut velocities) = (vec![0.0; n_q * times.len()], vec![0.0; n_v * times.len()]);
        let rows = positions.chunks_exact_mut(n_q).zip(velocities.chunks_exact_mut(n_v));
        for (t, (q, v)) in times.iter().zip(rows) {
            shape.evaluate(*t, q, v);
        }
        let curves = JointCurves::try_new(model, times, positions, velocities).unwrap();
        let take_off = TakeOff {
            time: 0.0,
            center_of_mass: Vector3::new(0.0, 0.0, 11.0),
            velocity: Vector3::new(1.0, 0.0, 4.0),
            angular_momentum: Vector3::new(1.0, 45.0, 2.0),
        };
        let at = model.joint(0).unwrap().kind().orientation();
        let direction = (0..n_v).map(|k| if k < 3 { 1.0 } else { 0.3 }).collect();
        let held = HeldPosture { times: TIMES, direction };
        KnownFlight::try_new(model, take_off, &open[at], curves, held).unwrap()
    }

    /// The joints with a change, written down once more: of the motion itself, not of its samples.
    struct Again<'s> {
        shape: &'s Fold,
        direction: Vec<f64>,
        change: FlightChange,
        pace: f64,
    }

    impl ShapeMotion for Again<'_> {
        fn evaluate(&self, t: f64, q: &mut [f64], v: &mut [f64]) {
            let step = |t: f64, a: f64, b: f64| {
                let x = ((t - a) / (b - a)).clamp(0.0, 1.0);
                (x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x) / (b - a))
            };
            let [a, b, c, d] = TIMES;
            let (sigma, slope) = step(self.pace * t, b, c);
            let tau = self.pace * t - self.change.opening * sigma;
            let rate = self.pace * (1.0 - self.change.opening * slope);
            let ((rise, rising), (fall, falling)) = (step(tau, a, b), step(tau, c, d));
            self.shape.evaluate(tau.min(DURATION), q, v);
            // as far as what moves with velocity 1 at the end still moves
            let left = if tau > DURATION { (-(tau - DURATION) / 0.05).exp() } else { 1.0 };
            let moved = 0.05 * (1.0 - left);
            let (weight, weight_rate) = (rise * (1.0 - fall), rising * (1.0 - fall) - rise * falling);
            for track in &self.shape.tracks {
                match *track {
                    Track::Number { q: at, v: k } => {
                        let more = self.change.posture * self.direction[k];
                        q[at] += v[k] * moved + more * weight;
                        v[k] = (v[k] * left + more * weight_rate) * rate;
                    }
                    Track::Ball { q: at, v: k } => {
                        let more =
                            Vector3::from_column_slice(&self.direction[k..k + 3]) * self.change.posture;
                        let own = Vector3::from_column_slice(&v[k..k + 3]);
                        let added = so3::exp(&(more * weight));
                        let turned = normalized_xyzw(&q[at..at + 4]) * so3::exp(&(own * moved)) * added;
                        q[at..at + 4].copy_from_slice(turned.coords.as_slice());
                        set(&mut v[k..k + 3], &((added.inverse() * own * left + more * weight_rate) * rate));
                    }
                }
            }
        }
    }

    const CHANGES: [FlightChange; 5] = [
        FlightChange { opening: 0.0, posture: 0.0, momentum: 0.0, height: 0.0 },
        FlightChange { opening: 0.1, posture: 0.0, momentum: 0.0, height: 0.0 },
        FlightChange { opening: -0.15, posture: 0.2, momentum: 0.0, height: 0.0 },
        FlightChange { opening: 0.0, posture: -0.2, momentum: 0.07, height: 0.0 },
        FlightChange { opening: 0.05, posture: 0.1, momentum: -0.05, height: 0.2 },
    ];

    #[test]
    fn changes_are_those_that_another_integrator_flies() {
        for (model, open, shape) in bodies() {
            let known = known(&model, &open, &shape);
            for change in CHANGES {
                let found = known.fly(&change).unwrap();
                let end = found.times[found.times.len() - 1];
                let pace = DURATION / end;
                let own = known.take_off();
                // the height of the rise is v²/2g, and the flight ends where it did
                let up = (own.velocity.z.powi(2) + 2.0 * 9.81 * change.height).sqrt();
                let fallen = |v: f64, t: f64| v * t - 0.5 * 9.81 * t * t;
                let gravity = model.gravity().norm();
                assert!((gravity - 9.81).abs() < 0.01);
                assert!((fallen(up, end) - fallen(own.velocity.z, DURATION)).abs() < 0.01);
                let take_off = TakeOff {
                    angular_momentum: own.angular_momentum * (1.0 + change.momentum),
                    velocity: Vector3::new(1.0, 0.0, up),
                    ..*own
                };
                let direction = known.held().direction.clone();
                let again = Again { shape: &shape, direction, change, pace };
                let system = FlightSystem::new(Flight::try_new(&model, take_off).unwrap(), &again);
                let at = model.joint(0).unwrap().kind().orientation();
                let start = system.state(&open[at.clone()]).unwrap();
                let control = Adaptive { max_step: 0.01, ..Adaptive::with_tolerances(1e-9, 1e-9) };
                let steps = Steps::adapted((0.0, end), control);
                let run =
                    Run::by_embedded_stepper(&system, &RungeKuttaMuntheKaas(Dop853), steps).from(&start);
                let mut workspace = system.workspace();
                let (q, _) = system.complete(&mut workspace, end, &run.unwrap().state).unwrap();
                let last = &found.positions[found.positions.len() - q.len()..];
                let turned = |q: &[f64]| match at.len() {
                    1 => so3::exp(&(Vector3::z() * q[at.start])),
                    _ => normalized_xyzw(&q[at.clone()]),
                };
                let apart = turned(q).angle_to(&turned(last));
                // steps of 5 ms of order 4, and what the samples leave of the joints
                assert!(apart < 2e-5, "{change:?}: {apart}");
                // joints, and the place of the root
                let mut apart = vec![0.0; model.n_velocities()];
                model.difference(q, last, &mut apart).unwrap();
                let place = q[..at.start].iter().zip(last).map(|(a, b)| a - b);
                let joints = apart[model.velocities_of(0).end..].iter().copied();
                for (k, off) in place.chain(joints).enumerate() {
                    assert!(off.abs() < 0.01 * change.height + 1e-5, "{change:?} {k}: {off}");
                }
            }
        }
    }

    #[test]
    fn derivatives_are_differences() {
        for (model, open, shape) in bodies() {
            let known = known(&model, &open, &shape);
            for at in [CHANGES[0], CHANGES[4]] {
                let found = known.fly(&at).unwrap();
                let last = found.orientations.len() - 1;
                let n_root = model.velocities_of(0).len();
                for k in 0..N_CHANGES {
                    let h = 1e-5;
                    let with = |h: f64| {
                        let mut change = at;
                        *[&mut change.opening, &mut change.posture, &mut change.momentum][k] += h;
                        known.fly(&change).unwrap()
                    };
                    let (more, less) = (with(h), with(-h));
                    let turn =
                        so3::log(&(less.orientations[last].inverse() * more.orientations[last])) / (2.0 * h);
                    let off = (turn - found.by_change[k]).norm();
                    // ḧ jumps at the samples, where stages are
                    let tolerance = [2e-3, 1e-6, 1e-6][k];
                    assert!(off < tolerance * turn.norm().max(1.0), "{k}: {turn} {}", found.by_change[k]);
                    let Some(joints) = found.joints_by_change.get(k) else { continue };
                    let row = |flown: &ChangedFlight| {
                        flown.positions[flown.positions.len() - model.n_positions()..].to_vec()
                    };
                    let mut apart = vec![0.0; model.n_velocities()];
                    model.difference(&row(&less), &row(&more), &mut apart).unwrap();
                    for (apart, by) in apart[n_root..].iter().zip(joints) {
                        assert!((apart / (2.0 * h) - by).abs() < 1e-4);
                    }
                }
            }
        }
    }

    #[test]
    fn what_a_flight_does_not_take_is_refused() {
        let [(model, open, shape), _, (with_balls, ..)] = bodies();
        let known = known(&model, &open, &shape);
        let message = |change: FlightChange| known.fly(&change).unwrap_err().to_string();
        assert!(
            message(FlightChange { opening: 0.25, ..CHANGES[0] }).contains("`opening` must be at most 0.6")
        );
        assert!(
            message(FlightChange { opening: f64::NAN, ..CHANGES[0] }).contains("`opening` must be finite")
        );
        assert!(
            message(FlightChange { momentum: 1.5, ..CHANGES[0] }).contains("`momentum` must be at most 1")
        );
        assert!(message(FlightChange { posture: -7.0, ..CHANGES[0] }).contains("`posture` must be so small"));
        for height in [-5.0, -f64::MAX, 1e300] {
            assert!(message(FlightChange { height, ..CHANGES[0] }).contains("`height`"), "{height}");
        }
        let n = shape.open.len();
        let rows = |times: &[f64], n_numbers: usize| {
            JointCurves::try_new(&model, times.to_vec(), vec![0.0; n_numbers], vec![0.0; n_numbers])
                .map(|_| ())
        };
        for (times, numbers, named) in [
            (&[0.0][..], n, "`times`"),
            (&[0.0, 0.0], 2 * n, "`times` must be rising"),
            (&[0.0, f64::INFINITY], 2 * n, "`times`"),
            (&[0.0, 501.0], 2 * n, "500 s"),
            (&[0.0, 1.0], n, "`positions`"),
        ] {
            let error = rows(times, numbers).unwrap_err().to_string();
            assert!(error.contains(named), "{error}");
        }
        for times in [[0.1, 0.1, 0.8, 1.1], [-0.1, 0.4, 0.8, 1.1], [0.1, 0.4, 0.8, 1.3]] {
            let held = HeldPosture { times, ..known.held().clone() };
            let again = KnownFlight::try_new(&model, *known.take_off(), &[0.0], known.curves.clone(), held);
            assert!(again.unwrap_err().to_string().contains("`phase` must be rising"));
        }
        let other = KnownFlight::try_new(
            &model,
            *known.take_off(),
            &[0.0; 4],
            known.curves.clone(),
            known.held().clone(),
        );
        assert!(other.unwrap_err().to_string().contains("`orientation`"));
        let zeros = |n: usize| vec![0.0; 2 * n];
        let of = |model: &Model| {
            let n = [
                model.n_positions() - model.positions_of(0).len(),
                model.n_velocities() - model.velocities_of(0).len(),
            ];
            JointCurves::try_new(model, vec![0.0, 1.0], zeros(n[0]), zeros(n[1]))
        };
        assert!(of(&with_balls).unwrap_err().to_string().contains("quaternion of joint `pelvis`"));
        let mass = MassProperties::rod(1.0, Vector3::zeros(), Vector3::x());
        let mut builder = ModelBuilder::new();
        builder.add(Link::root("hub", Joint::Free, mass)).unwrap();
        builder.add(Link::child("other", "hub", Joint::Free, mass)).unwrap();
        assert!(of(&builder.build().unwrap()).unwrap_err().to_string().contains("that of `other` is free"));
    }
}
