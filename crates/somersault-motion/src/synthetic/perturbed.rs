//! A flight flown again with other joints and another momentum.

use super::curve::FoldCurve;
use super::{Perturbation, SyntheticError, synthetic_markers};
use crate::analysis::DiveFaults;
use crate::fit::MarkerSet;
use crate::recording::{MarkerRecording, expect_times, uniform_times};
use nalgebra::Vector3;
use somersault_core::argument::{expect_finite, expect_least, expect_length};
use somersault_core::lie::so3;
use somersault_core::roots;
use somersault_integrators::driver::TimeGrid;
use somersault_integrators::methods::RungeKuttaMuntheKaas4;
use somersault_integrators::run::Run;
use somersault_integrators::solution::Recorder;
use somersault_multibody::flight::{Flight, FlightSystem, TakeOff};
use somersault_multibody::{Data, Group, Joint, Model};

/// A flight that synthetic dives are made of.
#[derive(Debug, Clone)]
pub struct SyntheticFlight {
    model: Model,
    curve: FoldCurve,
    duration: f64,
    n_frames: usize,
    /// Orientation of the root in the first frame: numbers of q.
    orientation: Vec<f64>,
    /// Centre of mass in the first and the last frame.
    ends: [Vector3<f64>; 2],
    /// Mean over the flight, by differences.
    momentum: Vector3<f64>,
    /// How far the root turns about the momentum, rad.
    turned: f64,
}

/// A **synthetic** dive.
#[derive(Debug, Clone, PartialEq)]
pub struct SyntheticDive {
    /// At equal distances from 0, s.
    pub times: Vec<f64>,
    /// Configurations, one after the other.
    pub positions: Vec<f64>,
    /// What made it.
    pub perturbation: Perturbation,
    /// About the centre of mass, world axes, kg m²/s.
    pub angular_momentum: Vector3<f64>,
}

/// Steps of the integration from frame to frame.
const STEPS: u64 = 8;
/// What rotation a momentum may miss, rad.
const AIM_TOL: f64 = 1e-9;
/// Secants to the momentum, at most, and the largest multiple of that of the flight which they may lead to. Then it is
/// looked for at equal distances on both sides of 1: so far apart, and at least so many on each side.
const SECANTS: usize = 30;
const FURTHEST: f64 = 10.0;
const APART: f64 = 0.02;
const SIDE: usize = 20;
/// The width to which a multiple is narrowed.
const NARROW: f64 = 1e-13;

impl SyntheticFlight {
    /// Of configurations at `times`, one after the other, of a `model` with a floating or planar root and other
    /// joints of one coordinate. At least five frames, less than a half turn apart; the dives have as many.
    pub fn try_new(model: &Model, times: &[f64], positions: &[f64]) -> Result<Self, SyntheticError> {
        const LEAST: usize = 5;
        expect_least("times", times.len(), LEAST)?;
        expect_times(times)?;
        let (n_q, n_frames) = (model.n_positions(), times.len());
        expect_length("positions", positions.len(), n_frames.saturating_mul(n_q))?;
        expect_finite("positions", positions)?;
        let turning = model.joint(0).map_or(0..0, |joint| joint.kind().orientation());
        let mut data = Data::new(model);
        let mut v = vec![0.0; model.n_velocities()];
        let frames: Vec<&[f64]> = positions.chunks_exact(n_q).collect();
        let mut momentum = Vector3::zeros();
        for (times, pair) in times.windows(2).zip(frames.windows(2)) {
            model.difference(pair[0], pair[1], &mut v)?;
            momentum += model.centroidal(&mut data, pair[0])?.momentum(&v)?.angular / (times[1] - times[0]);
        }
        momentum /= (n_frames - 1) as f64;
        let mut center = |q: &[f64]| Ok::<_, SyntheticError>(model.positions(&mut data, q)?.center_of_mass());
        let ends = [center(frames[0])?, center(frames[n_frames - 1])?];
        // refuses models that cannot fly
        let take_off = TakeOff {
            time: 0.0,
            center_of_mass: ends[0],
            velocity: Vector3::zeros(),
            angular_momentum: momentum,
        };
        Flight::try_new(model, take_off)?;
        let curve = FoldCurve::try_new(model, times, positions)?;
        let turned = turned(model, positions, &momentum);
        // one that turns by less than this is not aimed by its momentum
        let turns = turned.abs() > 1e-3;
        if !turns {
            return Err(SyntheticError::NoMomentum);
        }
        let (model, orientation) = (model.clone(), frames[0][turning].to_vec());
        let duration = times[n_frames - 1] - times[0];
        Ok(Self { model, curve, duration, n_frames, orientation, ends, momentum, turned })
    }

    /// The model that flies.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The flight with this perturbation, whose angular momentum is a multiple of the flight's.
    ///
    /// Of several multiples that turn the root as far it is the one that secants from 1 meet, or else the nearest to 1 that
    /// lies between two of those at distances of 0.02 which miss on different sides: up to 0.4, and as much further as the rotation
    /// requested is a multiple of the flight's.
    ///
    /// Cost: some 30 000 evaluations of the flight for 60 frames where secants meet it, up to fifteen times as many where
    /// they do not, and forty where the flight is to turn twice as far.
    pub fn perturb(&self, perturbation: &Perturbation) -> Result<SyntheticDive, SyntheticError> {
        perturbation.validate()?;
        self.curve.expect_delay(perturbation.exit_delay)?;
        let target = self.turned + self.turned.signum() * perturbation.over_rotation;
        let fly = |factor: f64| {
            let dive = self.fly(perturbation, factor)?;
            Ok::<_, SyntheticError>((turned(&self.model, &dive.positions, &self.momentum) - target, dive))
        };
        // in the plane the rotation is linear in the momentum, and the second secant meets it
        let mut before: Option<(f64, f64)> = None;
        let (mut factor, mut first, mut best) = (1.0, f64::NAN, f64::INFINITY);
        for _ in 0..SECANTS {
            let (miss, dive) = fly(factor)?;
            if miss.abs() < AIM_TOL {
                return Ok(dive);
            }
            best = best.min(miss.abs());
            let slope = match before {
                Some((other, missed)) => (miss - missed) / (factor - other),
                None => {
                    first = miss;
                    self.turned
                }
            };
            before = Some((factor, miss));
            factor -= miss / slope;
            // in space it need not be monotonic
            if factor.is_nan() || factor.abs() > FURTHEST {
                break;
            }
        }
        let mut ends = [(1.0, first); 2];
        let further = (perturbation.over_rotation / (self.turned * APART)).abs().min(FURTHEST / APART);
        let side = SIDE + further.ceil() as usize;
        for k in 1..=side {
            for (end, sign) in ends.iter_mut().zip([1.0, -1.0]) {
                let near = *end;
                let factor = 1.0 + sign * APART * k as f64;
                *end = (factor, fly(factor)?.0);
                best = best.min(end.1.abs());
                if near.1 * end.1 <= 0.0 {
                    let miss = |factor| fly(factor).map(|(miss, _)| miss);
                    let middle = 0.5 * (near.0 + end.0);
                    let (_, found) = roots::bracket(miss, near, *end, middle, NARROW)?;
                    let (miss, dive) = fly(found)?;
                    // a sign may also change where a step turns by more than half a turn
                    if miss.abs() < AIM_TOL {
                        return Ok(dive);
                    }
                    best = best.min(miss.abs());
                }
            }
        }
        Err(SyntheticError::NotAimed { reach: APART * side as f64, miss: best })
    }

    /// Flies with a momentum that is `factor` times that of the flight.
    fn fly(&self, perturbation: &Perturbation, factor: f64) -> Result<SyntheticDive, SyntheticError> {
        let duration = self.duration * (1.0 + perturbation.duration);
        let [start, end] = self.ends;
        let take_off = TakeOff {
            time: 0.0,
            center_of_mass: start,
            velocity: (end - start) / duration - self.model.gravity() * (0.5 * duration),
            angular_momentum: self.momentum * factor,
        };
        let flight = Flight::try_new(&self.model, take_off)?;
        let shape = |t: f64, q: &mut [f64], v: &mut [f64]| {
            self.curve.joints_into(perturbation, duration, t, q, v);
        };
        let system = FlightSystem::new(flight, &shape);
        let first = system.state(&self.orientation)?;
        let grid = TimeGrid::try_with_steps(0.0, duration, STEPS * (self.n_frames as u64 - 1))?;
        let mut recorder = Recorder::new(0.0, &first, STEPS);
        Run::by_stepper(&system, &RungeKuttaMuntheKaas4, grid).observed_by(&mut recorder).from(&first)?;
        let times = uniform_times(&[0.0, duration], self.n_frames);
        let mut positions = Vec::with_capacity(self.n_frames * self.model.n_positions());
        let mut room = somersault_integrators::system::System::workspace(&system);
        for (t, state) in times.iter().zip(&recorder.into_solution().states) {
            positions.extend_from_slice(system.complete(&mut room, *t, state)?.0);
        }
        Ok(SyntheticDive {
            times,
            positions,
            perturbation: *perturbation,
            angular_momentum: take_off.angular_momentum,
        })
    }
}

impl SyntheticDive {
    /// Its faults.
    pub fn faults(&self, model: &Model) -> Result<DiveFaults, SyntheticError> {
        Ok(DiveFaults::of(model, &self.times, &self.positions)?)
    }

    /// Where markers of the model were, with noise: [`synthetic_markers`].
    pub fn markers(
        &self,
        model: &Model,
        markers: &MarkerSet,
        noise: f64,
        seed: u64,
    ) -> Result<MarkerRecording, SyntheticError> {
        synthetic_markers(model, markers, &self.times, &self.positions, noise, seed)
    }
}

/// How far the root turns about the direction of the momentum, rad: in the plane its angle, in space the sum of
/// the parts of the steps along it.
fn turned(model: &Model, positions: &[f64], momentum: &Vector3<f64>) -> f64 {
    let frames: Vec<&[f64]> = positions.chunks_exact(model.n_positions()).collect();
    if model.joint(0).map(Joint::group) == Some(Group::PlanarMotions) {
        return frames[frames.len() - 1][2] - frames[0][2];
    }
    let axis = momentum.normalize();
    let rotation = |q: &[f64]| so3::from_xyzw(&q[3..7]);
    frames.windows(2).map(|w| so3::log(&(rotation(w[1]) * rotation(w[0]).inverse())).dot(&axis)).sum()
}
