//! The derivative of a motion through its events: closed forms, differences of located runs, order,
//! symplecticity, composition, where there is none, bad input.

use nalgebra::{DMatrix, SMatrix, SVector, UnitQuaternion, Vector3};
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::driver::integrate_hybrid;
use somersault_contact::event::{EventKind, Interruption, Located, Location};
use somersault_contact::hybrid::Frozen;
use somersault_contact::law::{CompliantLaw, damping_ratio, restitution};
use somersault_contact::models::{BouncingBall, SpinningTop};
use somersault_contact::sensitivity::{
    Differentiation, Parameter, Sensitivities, SensitivityError, Undifferentiated, VariedState,
    integrate_with_sensitivities,
};
use somersault_contact::surface::{Cylinder, HalfSpace, SignedDistance, Solid, Sphere, Surface};
use somersault_core::so3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::{Flow, IntegrateError, Observer, Step, TimeGrid};
use somersault_integrators::force::{Drag, ForceModel, Gravity, Spring, Wrench};
use somersault_integrators::methods::{
    AdamsBashforth4, Dop853, DormandPrince, Heun, RungeKuttaMuntheKaas, RungeKuttaMuntheKaas4,
};
use somersault_integrators::state::{Configuration, Pose, RigidBodyState, Twist};
use somersault_integrators::variation::{Tangent, Varied};
use somersault_testkit::bouncing_ball;
use somersault_testkit::order::slope;
use std::sync::Arc;

const RKMK8: RungeKuttaMuntheKaas<Dop853> = RungeKuttaMuntheKaas(Dop853);
type Column = SVector<f64, 12>;

fn differentiate<F: ForceModel>(
    system: &BodyInContact<F>,
    start: &RigidBodyState,
    by: &[Parameter],
    interval: (f64, f64),
    dt: f64,
) -> Result<Sensitivities, Box<Undifferentiated>> {
    let grid = TimeGrid::try_new(interval.0, interval.1, dt).unwrap();
    let by = Differentiation::by(by);
    integrate_with_sensitivities(&RKMK8, system, start, &by, &grid, &Location::default(), &mut ())
}

fn located<F: ForceModel>(
    system: BodyInContact<F>,
    start: &RigidBodyState,
    end: f64,
    dt: f64,
) -> Located<Pose> {
    let grid = TimeGrid::try_new(0.0, end, dt).unwrap();
    let frozen = Frozen::new(system, 0.0, start);
    integrate_hybrid(&frozen, &RKMK8, start, &grid, &Location::default(), &mut ()).unwrap()
}

/// From one state to another, in the twelve components.
fn components(from: &RigidBodyState, to: &RigidBodyState) -> Column {
    let mut displacement = Twist::default();
    to.configuration.difference(&from.configuration, &mut displacement);
    let rate = Twist {
        linear: to.velocity() - from.velocity(),
        angular: to.angular_velocity() - from.angular_velocity(),
    };
    Tangent { displacement, rate }.components()
}

/// A central difference of order 4 by Richardson's extrapolation of two.
fn difference<const N: usize>(step: f64, at: impl Fn(f64) -> SVector<f64, N>) -> SVector<f64, N> {
    let central = |h: f64| (at(h) - at(-h)) / (2.0 * h);
    (central(0.5 * step) * 4.0 - central(step)) / 3.0
}

/// Whether every column agrees with the differences of located runs, of their states and event times, to
/// `tolerance` of the column's size.
///
/// `varied(k, ε)` is the problem changed by ε in column k, by whose `steps` differences are taken.
fn agrees_with_differences<F: ForceModel>(
    found: &Sensitivities,
    varied: impl Fn(usize, f64) -> (BodyInContact<F>, RigidBodyState),
    steps: &[f64],
    (end, dt): (f64, f64),
    tolerance: f64,
) {
    const EVENTS: usize = 24;
    let base = {
        let (system, start) = varied(0, 0.0);
        located(system, &start, end, dt)
    };
    assert_eq!(base.state, found.run.state);
    assert_eq!(found.parameters.ncols() + 12, steps.len());
    assert!(base.events.len() <= EVENTS);
    let mut worst: f64 = 0.0;
    for (k, &step) in steps.iter().enumerate() {
        let run = |epsilon: f64| {
            let (system, start) = varied(k, epsilon);
            let run = located(system, &start, end, dt);
            assert_eq!(run.events.len(), base.events.len(), "column {k}");
            run
        };
        let states = difference(step, |e| components(&base.state, &run(e).state));
        let times = difference(step, |e| {
            let run = run(e);
            SVector::<f64, EVENTS>::from_fn(|i, _| run.events.get(i).map_or(0.0, |event| event.t))
        });
        let column = if k < 12 { found.state.column(k) } else { found.parameters.column(k - 12) };
        let error = (column - states).norm() / column.norm();
        let event_times = found.event_times.row(k).transpose();
        let scale = event_times.norm().max(f64::MIN_POSITIVE);
        let time_error = (event_times - times.rows(0, base.events.len())).norm() / scale;
        println!("column {k}: {:.3e}, error {error:.1e}, of the event times {time_error:.1e}", column.norm());
        let time_error = if scale > 1e-12 { time_error } else { times.norm() };
        worst = worst.max(error).max(time_error);
    }
    println!("worst {worst:.1e}");
    assert!(worst < tolerance, "{worst:e}");
}

// ---------------------------------------------------------------------------------------------- ball

const BALL: bouncing_ball::BouncingBall =
    bouncing_ball::BouncingBall { mass: 1.0, stiffness: 400.0, damping: 4.0, gravity: 9.81 };
const DROP: bouncing_ball::Motion = bouncing_ball::Motion { x: 0.5, v: 0.0 };

fn ball(constants: &bouncing_ball::BouncingBall) -> BouncingBall {
    let law = CompliantLaw::try_new(constants.stiffness, constants.damping).unwrap();
    BouncingBall::try_new(constants.mass, 0.1, law).unwrap()
}

fn ball_parameters() -> [Parameter; 4] {
    let down = Parameter::uniform_acceleration(-Vector3::z());
    [Parameter::Stiffness(0), Parameter::Damping(0), Parameter::Mass, down]
}

#[test]
fn the_derivative_of_the_bouncing_ball_is_that_of_its_closed_form() {
    for end in [0.35, 0.6, 1.3, 2.6] {
        let (_, switches) = BALL.run(DROP, end);
        let ball = ball(&BALL);
        let found =
            differentiate(&ball.system, &ball.at(DROP.x, DROP.v), &ball_parameters(), (0.0, end), 1e-3)
                .unwrap();
        assert_eq!(found.run.events.len(), switches.len());
        // Height, velocity, k, c, m, g.
        let steps = [1e-3, 1e-3, 1.0, 1e-2, 1e-3, 1e-2];
        let (state, parameters) = (&found.state, &found.parameters);
        let columns = [
            (state[(2, 2)], state[(8, 2)]),
            (state[(2, 8)], state[(8, 8)]),
            (parameters[(2, 0)], parameters[(8, 0)]),
            (parameters[(2, 1)], parameters[(8, 1)]),
            (parameters[(2, 2)], parameters[(8, 2)]),
            (parameters[(2, 3)], parameters[(8, 3)]),
        ];
        for (k, ((x, v), step)) in columns.into_iter().zip(steps).enumerate() {
            let exact = difference(0.1 * step, |e| {
                let (mut constants, mut start) = (BALL, DROP);
                *[
                    &mut start.x,
                    &mut start.v,
                    &mut constants.stiffness,
                    &mut constants.damping,
                    &mut constants.mass,
                    &mut constants.gravity,
                ][k] += e;
                let end = constants.run(start, end).0;
                SVector::<f64, 2>::new(end.x, end.v)
            });
            let error = (SVector::<f64, 2>::new(x, v) - exact).norm() / exact.norm();
            println!("{end} {} events, column {k}: {exact:?} {error:.1e}", switches.len());
            assert!(error < 1e-9, "{end} {k}: {x} {v} {exact}");
        }
    }
}

#[test]
fn the_derivative_of_a_central_impact_is_that_of_its_restitution() {
    // v⁺ = −e v⁻ with ln e = −2 ζ h(ζ), h = arccos ζ/√(1 − ζ²), h' = (ζ h − 1)/(1 − ζ²), ζ = c/(2√(k m)).
    let (mass, stiffness, speed) = (2.0, 5e3, 1.5);
    for e in [0.9, 0.5, 0.2] {
        let law = CompliantLaw::from_restitution(mass, stiffness, e).unwrap();
        let contact = Contact::try_new(Vector3::zeros(), Arc::new(HalfSpace::ground()), law).unwrap();
        let body = RigidBody::try_box(mass, Vector3::repeat(0.1)).unwrap();
        let system = BodyInContact::new(body, ((), Contacts::new(vec![contact])));
        let parameters = [Parameter::Stiffness(0), Parameter::Damping(0), Parameter::Mass];
        let found = differentiate(&system, &at(0.01, -speed), &parameters, (0.0, 0.2), 1e-4).unwrap();
        let ratio = damping_ratio(e).unwrap();
        assert!((restitution(ratio).unwrap() - e).abs() < 1e-14);
        let half_phase = ratio.acos() / (1.0 - ratio * ratio).sqrt();
        let slope = -2.0 * (half_phase + ratio * (ratio * half_phase - 1.0) / (1.0 - ratio * ratio));
        let per_ratio = e * slope * speed;
        let expected = [
            (found.state[(8, 8)], -e),
            (found.state[(8, 2)], 0.0),
            (found.parameters[(8, 0)], -per_ratio * ratio / (2.0 * stiffness)),
            (found.parameters[(8, 1)], per_ratio * ratio / law.damping()),
            (found.parameters[(8, 2)], -per_ratio * ratio / (2.0 * mass)),
        ];
        for (k, (found, expected)) in expected.into_iter().enumerate() {
            assert!((found - expected).abs() < 1e-10 * speed, "{e} {k}: {found} {expected}");
        }
        // The time of touch-down is height over speed.
        let times = found.event_times.column(0);
        assert!((times[2] - 1.0 / speed).abs() < 1e-14 && (times[8] - 0.01 / speed.powi(2)).abs() < 1e-14);
    }
}

// ----------------------------------------------------------------------------------------------- top

const TOP_STIFFNESS: f64 = 0.2 * 98_696.044_010_893_58;
const TOP_DAMPING: f64 = 0.2 * 2.0 * 314.159_265_358_979_3 * 0.1;

/// The top of the thesis, column `k` of it changed by ε: the twelve of the start, k, c, m, I and g.
fn top(damping: f64, k: usize, epsilon: f64) -> (BodyInContact<Gravity>, RigidBodyState) {
    let mut change = [0.0; 5];
    if k >= 12 {
        change[k - 12] = epsilon;
    }
    let [stiffness_change, damping_change, mass_change, inertia_change, gravity_change] = change;
    let moments = Vector3::new(0.817e-4, 0.817e-4, 1.6e-4) * (1.0 + inertia_change);
    let body = RigidBody::try_principal(0.2 + mass_change, moments).unwrap();
    let law = CompliantLaw::try_new(TOP_STIFFNESS + stiffness_change, damping + damping_change).unwrap();
    let tip = Contact::try_new(Vector3::new(0.0, 0.0, -0.05), Arc::new(HalfSpace::ground()), law).unwrap();
    let gravity = Gravity { acceleration: Vector3::new(0.0, 0.0, -9.81 - gravity_change) };
    let system = BodyInContact::new(body, (gravity, Contacts::new(vec![tip])));
    (system, Tangent::unit(k).moved(&SpinningTop::thesis().unwrap().start, epsilon))
}

fn top_parameters() -> [Parameter; 5] {
    let down = Parameter::uniform_acceleration(-Vector3::z());
    [Parameter::Stiffness(0), Parameter::Damping(0), Parameter::Mass, Parameter::InertiaScale, down]
}

#[test]
fn the_derivative_of_the_top_over_one_second_is_the_difference_of_located_runs() {
    let (system, start) = top(TOP_DAMPING, 0, 0.0);
    assert_eq!(system.body, SpinningTop::thesis().unwrap().system.body);
    let found = differentiate(&system, &start, &top_parameters(), (0.0, 1.0), 1e-4).unwrap();
    assert_eq!(found.run.events.len(), 7);
    let steps = [[1e-5; 3], [1e-5; 3], [1e-4; 3], [1e-3; 3]];
    let steps = [steps.as_flattened(), &[1.0, 1e-3, 1e-5, 1e-5, 1e-3]].concat();
    agrees_with_differences(&found, |k, e| top(TOP_DAMPING, k, e), &steps, (1.0, 1e-4), 1e-6);
}

fn at(z: f64, velocity: f64) -> RigidBodyState {
    let mut state = RigidBodyState::default();
    (state.configuration.position.z, state.rate.linear.z) = (z, velocity);
    state
}
