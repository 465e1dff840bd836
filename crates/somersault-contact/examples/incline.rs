//! Where a block rests on an incline: tan α/μ from 0.1 to 1.1, damping ratios of friction from 0.02 to 1, from
//! rest, thrown up and thrown down, on one point, as a box on four points, and under a normal force that varies.
//!
//! `cargo run --release -p somersault-contact --example incline` takes a few minutes and prints, for each kind of
//! block, the largest drift between 90 and 100 s of those that Coulomb's law holds, and how far those that it does
//! not hold are from uniform acceleration.

use nalgebra::Vector3;
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::stretches::WithStretches;
use somersault_contact::surface::HalfSpace;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::{Adaptive, Steps};
use somersault_integrators::events::Location;
use somersault_integrators::force::{ForceModel, Wrench};
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_integrators::state::RigidBodyState;
use std::error::Error;
use std::sync::Arc;

const MASS: f64 = 1.3;
const MU: f64 = 0.4;
const STIFFNESS: f64 = 1e4;
const GRAVITY: f64 = 9.81;

#[derive(Debug, Clone, Copy)]
enum Kind {
    Point,
    Box,
    Varying,
}

/// A block on a slope: the ground stays z = 0 and the weight turns.
fn block(
    kind: Kind,
    angle: f64,
    ratio: f64,
    swing: f64,
) -> Result<BodyInContact<impl ForceModel>, Box<dyn Error>> {
    let body = RigidBody::try_box(MASS, Vector3::new(0.2, 0.2, 0.1))?;
    let points: &[Vector3<f64>] = match kind {
        Kind::Point | Kind::Varying => &[Vector3::new(0.0, 0.0, 0.0)],
        Kind::Box => &[
            Vector3::new(0.1, 0.1, -0.05),
            Vector3::new(0.1, -0.1, -0.05),
            Vector3::new(-0.1, 0.1, -0.05),
            Vector3::new(-0.1, -0.1, -0.05),
        ],
    };
    let count = points.len() as f64;
    let friction = CoulombFriction::from_damping_ratio(MU, STIFFNESS / count, MASS / count, ratio)?;
    let law = CompliantLaw::from_frequency(MASS / count, 120.0, 0.3)?;
    let law = ContactLaw::from(law).with_friction(friction);
    let ground = Arc::new(HalfSpace::ground());
    let contacts: Result<Vec<_>, _> =
        points.iter().map(|point| Contact::try_new(*point, ground.clone(), law.clone())).collect();
    let (sin, cos) = angle.sin_cos();
    let weight = move |t: f64, body: &RigidBody, _: &RigidBodyState| {
        let push = GRAVITY * cos * (1.0 + swing * (7.0 * t).sin());
        Wrench { force: Vector3::new(GRAVITY * sin, 0.0, -push) * body.mass(), torque: Vector3::zeros() }
    };
    Ok(BodyInContact::new(body, (weight, Contacts::new(contacts?))))
}

fn main() -> Result<(), Box<dyn Error>> {
    let location = Location { keep_events: false, ..Location::default() };
    for kind in [Kind::Point, Kind::Box, Kind::Varying] {
        let (mut worst, mut held, mut slid, mut most_events, mut steps) = (0.0f64, 0, 0.0f64, 0, 0);
        for tenths in 1..=11 {
            for ratio in [0.02, 0.05, 0.1, 0.2, 0.5, 1.0] {
                for thrown in [0.0, -0.5, 0.5] {
                    let part = f64::from(tenths) / 10.0;
                    let part = if tenths == 10 { 0.99 } else { part };
                    let angle = (part * MU).atan();
                    let swing = if matches!(kind, Kind::Varying) { 0.9 * (1.0 - part).max(0.0) } else { 0.0 };
                    let block = block(kind, angle, ratio, swing)?;
                    let system = WithStretches(&block);
                    let mut start = RigidBodyState::default();
                    let height = if matches!(kind, Kind::Box) { 0.05 } else { 0.0 };
                    start.configuration.position.z = height - GRAVITY * angle.cos() / (120.0 * 120.0);
                    start.rate.linear.x = thrown;
                    let start = system.unstretched(start);
                    let run = |from: &_, interval| {
                        let steps = Steps::adapted(interval, Adaptive::default());
                        Run::new(&system, Method::Rkmk8B, steps).locating(location).from(from)
                    };
                    let at_90 = run(&start, (0.0, 90.0)).map_err(|e| e.reason)?;
                    let at_100 = run(&at_90.state, (90.0, 100.0)).map_err(|e| e.reason)?;
                    let drift = position(&at_100.state) - position(&at_90.state);
                    most_events = most_events.max(at_90.event_count + at_100.event_count);
                    steps += at_90.steps + at_100.steps;
                    if part < 1.0 {
                        worst = worst.max(drift.abs());
                        held += u32::from(drift.abs() < 1e-9);
                        if drift.abs() >= 1e-9 {
                            println!("{kind:?} {part} {ratio} {thrown}: {drift:e}");
                        }
                    } else {
                        let pull = GRAVITY * (angle.sin() - MU * angle.cos());
                        let v = velocity(&at_90.state);
                        let expected = 10.0 * v + 50.0 * pull;
                        slid = slid.max((drift / expected - 1.0).abs());
                        if v < 0.9 * pull * 89.0 {
                            println!("{kind:?} {part} {ratio} {thrown}: slides at {v} m/s only");
                        }
                    }
                }
            }
        }
        println!(
            "{kind:?}: {held} of 180 held, drift at most {worst:.1e} m; sliding off by {slid:.1e}; at most {most_events} events; {steps} steps"
        );
    }
    Ok(())
}

type State = somersault_integrators::state::State<
    somersault_integrators::augmented::Augmented<somersault_integrators::state::Pose>,
>;

fn position(state: &State) -> f64 {
    state.base().position().x
}

fn velocity(state: &State) -> f64 {
    state.base().velocity().x
}
