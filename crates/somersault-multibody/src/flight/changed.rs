//! A flight flown again with a change: what would have been.
//!
//! The joints of a flight are known at times, with their velocities. [`JointCurves`] are the cubic Hermite interpolants h of them, and a
//! [`FlightChange`] makes another joint motion of the same diver, in a flight whose duration is D instead of D₀:
//!
//! ```text
//! s(t) = h(τ) + α w(τ) d,   τ = t₀ + r (t − t₀) − δ σ(x),   r = D₀/D,   x = (t₀ + r (t − t₀) − t_h)/(t_o − t_h)
//! ```
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

use super::step::{NODES, StageRate, StepDerivative, turn};
use super::{Flight, FlightData, FlightError, TakeOff};
use crate::error::DynamicsError;
use crate::model::Model;
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::argument::{ArgumentError, expect_finite, expect_least, expect_length, expect_range};
use somersault_core::lie::so3::{self, normalized_xyzw};

/// Joints of a flight at times, and between them.
#[derive(Debug, Clone, PartialEq)]
pub struct JointCurves {
    times: Vec<f64>,
    positions: Vec<f64>,
    velocities: Vec<f64>,
    n: usize,
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
    /// Configurations, one after the other.
    pub positions: Vec<f64>,
    /// Velocities.
    pub velocities: Vec<f64>,
    /// Orientations of the root in its joint frame.
    pub orientations: Vec<UnitQuaternion<f64>>,
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
/// In which time joints come to rest after the last sample, s.
const REST: f64 = 0.05;
/// By which fraction of the time a posture is held this may become longer or shorter: τ rises as long as δ σ̇ < 1, σ̇ ≤ 3/2.
const WARPED: f64 = 0.6;

/// h, ḣ and ḧ of a joint.
type Jet = [f64; 3];

/// σ, rising from 0 at `from` to 1 at `to`, and its derivatives.
fn smooth(t: f64, [from, to]: [f64; 2]) -> Jet {
    let h = to - from;
    let x = (t - from) / h;
    let curved = if (0.0..=1.0).contains(&x) { (6.0 - 12.0 * x) / (h * h) } else { 0.0 };
    let x = x.clamp(0.0, 1.0);
    [x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x) / h, curved]
}

impl JointCurves {
    /// Curves through rows of positions and velocities at rising times.
    pub fn try_new(
        times: Vec<f64>,
        positions: Vec<f64>,
        velocities: Vec<f64>,
        n: usize,
    ) -> Result<Self, DynamicsError> {
        expect_least("times", times.len(), 2)?;
        expect_finite("times", &times)?;
        expect_range("times", times[times.len() - 1] - times[0], "a flight of at most 500 s", |x| {
            x <= LONGEST
        })?;
        if let Some(k) = times.windows(2).position(|pair| pair[1] <= pair[0]) {
            let allowed = "rising";
            return Err(ArgumentError::OutOfRange { argument: "times", allowed, found: times[k + 1] }.into());
        }
        for (argument, rows) in [("positions", &positions), ("velocities", &velocities)] {
            expect_length(argument, rows.len(), n * times.len())?;
            expect_finite(argument, rows)?;
        }
        Ok(Self { times, positions, velocities, n })
    }

    /// First and last time, s.
    pub fn interval(&self) -> [f64; 2] {
        [self.times[0], self.times[self.times.len() - 1]]
    }

    /// The same with joint `k` displaced by as much at all times.
    #[must_use]
    pub fn displaced(&self, k: usize, by: f64) -> Self {
        let mut moved = self.clone();
        moved.positions.iter_mut().skip(k).step_by(self.n.max(1)).for_each(|x| *x += by);
        moved
    }

    /// Joint `k` at `t`, which comes to rest after the last sample.
    fn jet(&self, k: usize, t: f64) -> Jet {
        let last = self.times.len() - 1;
        let row = |values: &[f64], i: usize| values[i * self.n + k];
        let beyond = t - self.times[last];
        if beyond > 0.0 {
            let (rate, left) = (row(&self.velocities, last), (-beyond / REST).exp());
            let position = row(&self.positions, last) + rate * REST * (1.0 - left);
            return [position, rate * left, -rate * left / REST];
        }
        let i = self.times.partition_point(|time| *time <= t).clamp(1, last) - 1;
        let h = self.times[i + 1] - self.times[i];
        let x = (t - self.times[i]) / h;
        let [a, b] = [i, i + 1].map(|i| row(&self.positions, i));
        let [u, v] = [i, i + 1].map(|i| row(&self.velocities, i) * h);
        // a + u x + c x² + d x³
        let (c, d) = (3.0 * (b - a) - 2.0 * u - v, 2.0 * (a - b) + u + v);
        let position = a + x * (u + x * (c + x * d));
        [position, (u + x * (2.0 * c + 3.0 * d * x)) / h, (2.0 * c + 6.0 * d * x) / (h * h)]
    }
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
        expect_length("direction", self.direction.len(), curves.n)?;
        expect_finite("direction", &self.direction)?;
        expect_finite("times of the held posture", &self.times)?;
        let [start, end] = curves.interval();
        let mut before = start;
        for (k, t) in self.times.iter().enumerate() {
            let is_allowed = |t: f64| t <= end && if k == 0 { t >= before } else { t > before };
            expect_range("times of the held posture", *t, "rising, within the flight", is_allowed)?;
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
        for (k, along) in held.direction.iter().enumerate() {
            let mut jet = curves.jet(k, tau);
            for (x, w) in jet.iter_mut().zip([weight, weight_rate, weight_curved]) {
                *x += posture * along * w;
            }
            let [position, velocity, acceleration] = jet;
            q[k] = position;
            v[k] = velocity * rate;
            by[0][0][k] = -velocity * sigma;
            by[0][1][k] = -(acceleration * sigma * rate + velocity * slope * self.pace);
            by[1][0][k] = weight * along;
            by[1][1][k] = weight_rate * along * rate;
        }
    }
}

impl<'m> KnownFlight<'m> {
    /// The flight of `model` from `take_off`, at the first time of the curves, with the root at `orientation` as q has it. Joints are
    /// hinges and slides.
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
            expect_length("joints of the curves", curves.n, model.n_velocities() - flight.n_root())?;
            // in a chart of their own balls would need more
            let n_q = model.n_positions() - at.end;
            expect_length("numbers of hinges and slides", curves.n, n_q)?;
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
            expect_finite("change", [opening, posture, momentum, height])?;
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
        let n = self.curves.n;
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
            by_change,
            joints_by_change: none(),
        };
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
            found.positions.extend_from_slice(&q);
            found.velocities.extend_from_slice(&v);
            found.orientations.push(current);
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
    use crate::flight::{FlightSystem, ShapeMotion};
    use crate::models::{Diver, Posture};
    use somersault_integrators::driver::{Adaptive, Steps};
    use somersault_integrators::methods::{Dop853, RungeKuttaMuntheKaas};
    use somersault_integrators::run::Run;
    use somersault_integrators::system::System;

    const DURATION: f64 = 1.2;

    /// Folded and unfolded by a square of a sine, and arms that swing apart in space.
    struct Fold {
        open: Vec<f64>,
        closed: Vec<f64>,
    }

    impl Fold {
        fn of(diver: &Diver) -> (Model, Self) {
            let model = diver.model().unwrap();
            let root = model.positions_of(0).len();
            let [open, closed] =
                [Posture::A, Posture::H].map(|p| diver.configuration(p).unwrap()[root..].to_vec());
            (model, Self { open, closed })
        }
    }

    impl ShapeMotion for Fold {
        fn evaluate(&self, t: f64, q: &mut [f64], v: &mut [f64]) {
            let w = std::f64::consts::PI / DURATION;
            for (k, (open, closed)) in self.open.iter().zip(&self.closed).enumerate() {
                q[k] = open + (closed - open) * (w * t).sin().powi(2) + 0.1 * (3.0 * t + k as f64).sin();
                v[k] = (closed - open) * w * (2.0 * w * t).sin() + 0.3 * (3.0 * t + k as f64).cos();
            }
        }
    }

    const TIMES: [f64; 4] = [0.1, 0.4, 0.8, 1.1];

    fn known<'m>(diver: &Diver, model: &'m Model, shape: &Fold) -> KnownFlight<'m> {
        let n = shape.open.len();
        let times: Vec<f64> = (0..=120).map(|i| 0.01 * f64::from(i)).collect();
        let (mut positions, mut velocities) = (vec![0.0; n * times.len()], vec![0.0; n * times.len()]);
        for (t, (q, v)) in times.iter().zip(positions.chunks_exact_mut(n).zip(velocities.chunks_exact_mut(n)))
        {
            shape.evaluate(*t, q, v);
        }
        let curves = JointCurves::try_new(times, positions, velocities, n).unwrap();
        let take_off = TakeOff {
            time: 0.0,
            center_of_mass: Vector3::new(0.0, 0.0, 11.0),
            velocity: Vector3::new(1.0, 0.0, 4.0),
            angular_momentum: Vector3::new(1.0, 45.0, 2.0),
        };
        let at = model.joint(0).unwrap().kind().orientation();
        let direction = (0..n).map(|k| if k < 3 { 1.0 } else { 0.3 }).collect();
        let held = HeldPosture { times: TIMES, direction };
        KnownFlight::try_new(model, take_off, &diver.configuration(Posture::A).unwrap()[at], curves, held)
            .unwrap()
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
            for k in 0..q.len() {
                let more = self.change.posture * self.direction[k];
                if tau > DURATION {
                    let left = (-(tau - DURATION) / 0.05).exp();
                    q[k] += v[k] * 0.05 * (1.0 - left);
                    v[k] *= left;
                }
                q[k] += more * rise * (1.0 - fall);
                v[k] = (v[k] + more * (rising * (1.0 - fall) - rise * falling)) * rate;
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
        for diver in [Diver::planar(), Diver::spatial()] {
            let (model, shape) = Fold::of(&diver);
            let known = known(&diver, &model, &shape);
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
                let start = system.state(&diver.configuration(Posture::A).unwrap()[at.clone()]).unwrap();
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
                for (k, (a, b)) in q.iter().zip(last).enumerate().filter(|(k, _)| !at.contains(k)) {
                    assert!((a - b).abs() < 0.01 * change.height + 1e-5, "{change:?} {k}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn derivatives_are_differences() {
        for diver in [Diver::planar(), Diver::spatial()] {
            let (model, shape) = Fold::of(&diver);
            let known = known(&diver, &model, &shape);
            for at in [CHANGES[0], CHANGES[4]] {
                let found = known.fly(&at).unwrap();
                let last = found.orientations.len() - 1;
                let n_root = model.positions_of(0).len();
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
                        flown.positions[flown.positions.len() - model.n_positions() + n_root..].to_vec()
                    };
                    for ((a, b), by) in row(&more).iter().zip(row(&less)).zip(joints) {
                        assert!(((a - b) / (2.0 * h) - by).abs() < 1e-4);
                    }
                }
            }
        }
    }

    #[test]
    fn what_a_flight_does_not_take_is_refused() {
        let diver = Diver::planar();
        let (model, shape) = Fold::of(&diver);
        let known = known(&diver, &model, &shape);
        let message = |change: FlightChange| known.fly(&change).unwrap_err().to_string();
        assert!(
            message(FlightChange { opening: 0.25, ..CHANGES[0] }).contains("`opening` must be at most 0.6")
        );
        assert!(message(FlightChange { opening: f64::NAN, ..CHANGES[0] }).contains("`change`"));
        for height in [-5.0, -f64::MAX, 1e300] {
            assert!(message(FlightChange { height, ..CHANGES[0] }).contains("`height`"), "{height}");
        }
        let n = shape.open.len();
        let rows = |times: &[f64], n_numbers: usize| {
            JointCurves::try_new(times.to_vec(), vec![0.0; n_numbers], vec![0.0; n_numbers], n).map(|_| ())
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
            assert!(again.unwrap_err().to_string().contains("times of the held posture"));
        }
        let other = KnownFlight::try_new(
            &model,
            *known.take_off(),
            &[0.0; 4],
            known.curves.clone(),
            known.held().clone(),
        );
        assert!(other.unwrap_err().to_string().contains("`orientation`"));
    }
}
