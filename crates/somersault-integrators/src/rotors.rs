//! Rotors that exchange angular momentum with the body that carries them: reaction wheels and control moment gyros.
//!
//! With H the sum of the angular momenta of the rotors about their axes, body frame, the total angular momentum is R (I* ω + H), and
//!
//! ```text
//! I* ω' = (I* ω + H) × ω − H' + M           (body frame)
//! ```
//!
//! so that rotors are a model of a torque, H × ω − H', on a body of the inertia I* ([`ReactionWheels::carrier`]).
//!
//! *Reaction wheels* with axes a_i, moments J_i about them, speeds Ω_i relative to the body and torques u_i of their motors have
//!
//! ```text
//! h_i = J_i (Ω_i + a_i·ω),    h_i' = u_i,    H = Σ a_i h_i,    I* = I − Σ J_i a_i a_iᵀ
//! ```
//!
//! with I the inertia of the body with its wheels. *Control moment gyros*, on a single gimbal each, hold |h_i| constant and turn it about
//! the axis of the gimbal, with the rate g_i of a gimbal whose own inertia is neglected, from the direction s_i at the angle 0:
//!
//! ```text
//! H = Σ h_i (s_i cos γ_i + (g_i × s_i) sin γ_i),    γ_i' = given,    I* = I
//! ```
//!
//! Torques and rates of gimbals are schedules: functions of time with a known integral, so that h_i and γ_i are functions of time too and the
//! state is that of the body alone.
//!
//! Source: P. C. Hughes, *Spacecraft Attitude Dynamics*, Wiley 1986, §3.5 and §6.

use crate::body::{BodyError, RigidBody};
use crate::force::{ForceModel, Reach, Wrench, WrenchBound};
use crate::state::{RigidBodyState, Twist};
use crate::variation::Tangent;
use nalgebra::Vector3;
use somersault_core::Inertia;
use somersault_core::argument::{
    ArgumentError, expect_direction, expect_finite, expect_least, expect_length, expect_not_negative,
};
use somersault_core::interval::{first_between, fraction_between, nearest};

/// A function of time that is linear between given times, and constant before the first and after the last.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearSchedule {
    times: Vec<f64>,
    values: Vec<f64>,
    /// From t = 0 to each of the times.
    integrals: Vec<f64>,
    /// The times at which it is not smooth.
    kinks: Vec<f64>,
}

impl LinearSchedule {
    /// The same at all times.
    pub fn constant(value: f64) -> Self {
        Self { times: vec![0.0], values: vec![value], integrals: vec![0.0], kinks: Vec::new() }
    }

    /// Linear between `times`, which increase.
    ///
    /// Adapted steps end at these times, and so do all steps of runs that locate events; with other fixed steps a method keeps its order
    /// where the times are points of the grid.
    pub fn try_new(times: Vec<f64>, values: Vec<f64>) -> Result<Self, ArgumentError> {
        expect_least("times", times.len(), 1)?;
        expect_length("values", values.len(), times.len())?;
        expect_finite("times", &times)?;
        expect_finite("values", &values)?;
        if let Some(pair) = times.windows(2).find(|pair| pair[0] >= pair[1]) {
            let allowed = "increasing";
            return Err(ArgumentError::OutOfRange { argument: "times", allowed, found: pair[1] });
        }
        let mut integrals = vec![0.0];
        for i in 1..times.len() {
            let part = 0.5 * (values[i] + values[i - 1]) * (times[i] - times[i - 1]);
            integrals.push(integrals[i - 1] + part);
        }
        let bends = |i: &usize| {
            let around = &values[i.saturating_sub(1)..values.len().min(i + 2)];
            around.iter().any(|value| *value != values[*i])
        };
        let kinks = (0..times.len()).filter(bends).map(|i| times[i]).collect();
        let mut schedule = Self { times, values, integrals, kinks };
        let origin = schedule.integral(0.0);
        schedule.integrals.iter_mut().for_each(|x| *x -= origin);
        match schedule.integrals.iter().find(|integral| !integral.is_finite()) {
            Some(&found) => {
                let allowed = "of a finite integral over `times`";
                Err(ArgumentError::OutOfRange { argument: "values", allowed, found })
            }
            None => Ok(schedule),
        }
    }

    /// The times.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The values there.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The value at time `t`.
    pub fn value(&self, t: f64) -> f64 {
        let Self { times, values, .. } = self;
        match times.partition_point(|x| *x <= t) {
            0 => values[0],
            i if i == times.len() => values[i - 1],
            i => {
                let after = fraction_between(t, times[i - 1], times[i]);
                (1.0 - after) * values[i - 1] + after * values[i]
            }
        }
    }

    /// The integral from 0 to `t`.
    pub fn integral(&self, t: f64) -> f64 {
        let from = self.times.partition_point(|x| *x <= t).max(1) - 1;
        let (start, before) = (self.times[from], self.values[from]);
        // before the first time the value is constant too
        self.integrals[from] + 0.5 * (before + self.value(t)) * (t - start)
    }

    /// The first time on the way from `t` to `end` at which it is not smooth: a time of the schedule, unless the values before and after
    /// are the same.
    pub(crate) fn next_kink(&self, t: f64, end: f64) -> Option<f64> {
        first_between(&self.kinks, t, end)
    }

    /// The largest magnitude.
    pub(crate) fn largest(&self) -> f64 {
        self.values.iter().fold(0.0, |most, x| x.abs().max(most))
    }
}

/// Angular momentum in the body as a function of time.
pub trait RotorMomentum {
    /// H and H', body frame, at time `t`.
    fn momentum(&self, t: f64) -> (Vector3<f64>, Vector3<f64>);

    /// Bounds of |H| and |H'| at all times; `None` where H grows without end.
    fn momentum_bound(&self) -> Option<(f64, f64)>;

    /// As [`ForceModel::next_stop`].
    fn next_stop(&self, t: f64, end: f64) -> Option<f64>;
}

/// The torque of rotors on the body that carries them, R (H × ω − H').
#[derive(Debug, Clone, PartialEq)]
pub struct Rotors<M>(pub M);

impl<M: RotorMomentum> ForceModel for Rotors<M> {
    fn wrench(&self, t: f64, _: &RigidBody, x: &RigidBodyState) -> Wrench {
        let (momentum, change) = self.0.momentum(t);
        let torque = (x.orientation() * momentum).cross(x.angular_velocity()) - x.orientation() * change;
        Wrench { force: Vector3::zeros(), torque }
    }
    fn bound(&self, _: &RigidBody, reach: &Reach) -> Option<WrenchBound> {
        let (momentum, change) = self.0.momentum_bound()?;
        Some(WrenchBound { force: 0.0, torque: momentum * reach.spin + change })
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        self.0.next_stop(t, end)
    }
    fn wrench_variation(&self, t: f64, _: &RigidBody, x: &RigidBodyState, along: &Tangent<Twist>) -> Wrench {
        let (momentum, change) = self.0.momentum(t);
        let turn = &along.displacement.angular;
        let momentum = x.orientation() * momentum;
        let torque = turn.cross(&momentum).cross(x.angular_velocity()) + momentum.cross(&along.rate.angular)
            - turn.cross(&(x.orientation() * change));
        Wrench { force: Vector3::zeros(), torque }
    }
    fn mass_derivative(&self, _: f64, _: &RigidBody, _: &RigidBodyState) -> Wrench {
        Wrench::default()
    }
}

/// A reaction wheel.
#[derive(Debug, Clone, PartialEq)]
pub struct ReactionWheel {
    axis: Vector3<f64>,
    inertia: f64,
    momentum: f64,
    torque: LinearSchedule,
}

impl ReactionWheel {
    /// A wheel with its axis in the body frame, of any length, its moment about that (kg m²), its angular momentum h at t = 0 (N m s) and
    /// the torque of its motor (N m).
    pub fn try_new(
        axis: Vector3<f64>,
        inertia: f64,
        momentum: f64,
        torque: LinearSchedule,
    ) -> Result<Self, ArgumentError> {
        let axis = expect_direction("axis", axis)?;
        expect_not_negative("inertia", inertia)?;
        expect_finite("momentum", &[momentum])?;
        Ok(Self { axis, inertia, momentum, torque })
    }

    /// Unit vector along the axis, body frame.
    pub fn axis(&self) -> &Vector3<f64> {
        &self.axis
    }

    /// J, kg m².
    pub fn inertia(&self) -> f64 {
        self.inertia
    }

    /// h at time `t`, N m s.
    pub fn momentum(&self, t: f64) -> f64 {
        self.momentum + self.torque.integral(t)
    }

    /// The torque of the motor, N m.
    pub fn torque(&self) -> &LinearSchedule {
        &self.torque
    }
}

/// Reaction wheels of one body.
#[derive(Debug, Clone, PartialEq)]
pub struct ReactionWheels(pub Vec<ReactionWheel>);

impl ReactionWheels {
    /// The body that they act on, of the inertia I − Σ J a aᵀ, from the body with its wheels.
    ///
    /// Errors where that is no inertia of a body: the wheels have too large moments.
    pub fn carrier(&self, body: &RigidBody) -> Result<RigidBody, BodyError> {
        let tensor = self.0.iter().fold(*body.inertia().tensor(), |rest, wheel| {
            rest - wheel.axis * wheel.axis.transpose() * wheel.inertia
        });
        RigidBody::try_new(body.mass(), Inertia::try_tensor(tensor)?)
    }
}

impl RotorMomentum for ReactionWheels {
    fn momentum(&self, t: f64) -> (Vector3<f64>, Vector3<f64>) {
        self.0.iter().fold(Default::default(), |(momentum, change): (Vector3<f64>, Vector3<f64>), wheel| {
            (momentum + wheel.axis * wheel.momentum(t), change + wheel.axis * wheel.torque.value(t))
        })
    }
    fn momentum_bound(&self) -> Option<(f64, f64)> {
        // the momentum of a wheel that is driven grows
        let is_driven = |wheel: &ReactionWheel| wheel.torque.largest() > 0.0;
        let momentum = self.0.iter().map(|wheel| wheel.momentum.abs()).sum();
        (!self.0.iter().any(is_driven)).then_some((momentum, 0.0))
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        nearest(t, self.0.iter().map(|wheel| wheel.torque.next_kink(t, end)))
    }
}

/// A control moment gyro on a single gimbal.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlMomentGyro {
    spin: Vector3<f64>,
    across: Vector3<f64>,
    gimbal: Vector3<f64>,
    momentum: f64,
    angle: f64,
    rate: LinearSchedule,
}

impl ControlMomentGyro {
    /// A gyro with the axis of its gimbal and that of its rotor at the angle 0, which are perpendicular within 1e-9, in the body frame and of
    /// any length, its angular momentum (N m s), the angle of the gimbal at t = 0 (rad) and the rate of that (rad/s).
    pub fn try_new(
        gimbal: Vector3<f64>,
        spin: Vector3<f64>,
        momentum: f64,
        angle: f64,
        rate: LinearSchedule,
    ) -> Result<Self, ArgumentError> {
        let gimbal = expect_direction("gimbal", gimbal)?;
        let spin = expect_direction("spin", spin)?;
        let along = gimbal.dot(&spin);
        if along.abs() > 1e-9 {
            let allowed = "perpendicular to `gimbal`, their cosine within 1e-9 of 0";
            return Err(ArgumentError::OutOfRange { argument: "spin", allowed, found: along });
        }
        expect_finite("momentum", &[momentum])?;
        expect_finite("angle", &[angle])?;
        Ok(Self { across: gimbal.cross(&spin), spin, gimbal, momentum, angle, rate })
    }

    /// Unit vector along the axis of the gimbal, body frame.
    pub fn gimbal(&self) -> &Vector3<f64> {
        &self.gimbal
    }

    /// Unit vector along the axis of the rotor at the angle 0, body frame.
    pub fn spin(&self) -> &Vector3<f64> {
        &self.spin
    }

    /// Angular momentum of the rotor, N m s.
    pub fn momentum(&self) -> f64 {
        self.momentum
    }

    /// Angle of the gimbal at time `t`, rad.
    pub fn angle(&self, t: f64) -> f64 {
        self.angle + self.rate.integral(t)
    }

    /// Rate of the gimbal, rad/s.
    pub fn rate(&self) -> &LinearSchedule {
        &self.rate
    }
}

/// Control moment gyros of one body.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlMomentGyros(pub Vec<ControlMomentGyro>);

impl RotorMomentum for ControlMomentGyros {
    fn momentum(&self, t: f64) -> (Vector3<f64>, Vector3<f64>) {
        self.0.iter().fold(Default::default(), |(momentum, change): (Vector3<f64>, Vector3<f64>), gyro| {
            let (s, c) = gyro.angle(t).sin_cos();
            let (along, across) = (gyro.spin * c + gyro.across * s, gyro.across * c - gyro.spin * s);
            (momentum + along * gyro.momentum, change + across * (gyro.momentum * gyro.rate.value(t)))
        })
    }
    fn momentum_bound(&self) -> Option<(f64, f64)> {
        Some(self.0.iter().fold((0.0, 0.0), |(momentum, change), gyro| {
            let size = gyro.momentum.abs();
            (momentum + size, change + size * gyro.rate.largest())
        }))
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        nearest(t, self.0.iter().map(|gyro| gyro.rate.next_kink(t, end)))
    }
}
