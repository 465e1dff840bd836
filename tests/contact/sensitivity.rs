//! The derivative of a motion through its events: closed forms, differences of located runs, order,
//! symplecticity, composition, where there is none, bad input.

use crate::located_differences::{
    RKMK8, agrees_with_differences, components, difference, differentiate, located,
};
use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::event::EventKind;
use somersault_contact::laws::compliant::{CompliantLaw, damping_ratio, restitution};
use somersault_contact::models::{BouncingBall, SpinningTop};
use somersault_contact::sensitivity::{
    Differentiation, Parameter, SensitivityRun, Variational, VariedPose, VariedState,
};
use somersault_contact::surface::{
    CylindricalSurface, HalfSpace, SignedDistance, Solid, SphericalSurface, Surface,
};
use somersault_core::lie::so3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::{Adaptive, Flow, Observer, Step, Steps, TimeGrid};
use somersault_integrators::events::Frozen;
use somersault_integrators::force::{Drag, Gravity, Spring, Wrench};
use somersault_integrators::methods::{
    AdamsBashforth4, DormandPrince, Heun, Method, RungeKuttaMuntheKaas, RungeKuttaMuntheKaas4,
};
use somersault_integrators::state::RigidBodyState;
use somersault_integrators::stepper::Stepper;
use somersault_integrators::variation::Tangent;
use somersault_testkit::bouncing_ball;
use somersault_testkit::order::slope;
use std::sync::Arc;

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
    [Parameter::normal(0, "stiffness"), Parameter::normal(0, "damping"), Parameter::Mass, down]
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
        let parameters =
            [Parameter::normal(0, "stiffness"), Parameter::normal(0, "damping"), Parameter::Mass];
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
        let times = found.event_times.row(0);
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
    [
        Parameter::normal(0, "stiffness"),
        Parameter::normal(0, "damping"),
        Parameter::Mass,
        Parameter::InertiaScale,
        down,
    ]
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

// --------------------------------------------------------------------------------- structure and order

/// Whether `ok` holds for each of the events, seen as the columns before and after it.
struct Jumps(Vec<(VariedState, Option<VariedState>)>, u64);

impl Observer<VariedPose> for Jumps {
    fn observe(&mut self, step: &mut Step<'_, VariedPose>) -> Flow {
        if let Some((_, after @ None)) = self.0.last_mut()
            && step.index == self.1 + 1
        {
            *after = Some(step.before.clone());
        }
        self.0.push((step.after.clone(), None));
        self.1 = step.index;
        Flow::Continue
    }
}

#[test]
fn columns_jump_by_the_saltation_matrix_at_touch_down_and_not_at_release() {
    let ball = ball(&BALL);
    let grid = TimeGrid::try_new(0.0, 1.3, 1e-2).unwrap();
    let mut jumps = Jumps(Vec::new(), 0);
    let (start, by) = (ball.at(DROP.x, DROP.v), Differentiation::by(ball_parameters()));
    let run = SensitivityRun::by_stepper(&ball.system, &by, &RKMK8, grid);
    let found = run.observed_by(&mut jumps).from(&start).unwrap();
    let kinds: Vec<EventKind> = found.run.events.iter().map(|e| e.kind).collect();
    use EventKind::{Release, TouchDown};
    assert_eq!(kinds, [TouchDown, Release, TouchDown, Release]);
    for event in &found.run.events {
        let (before, after) = jumps.0.iter().find(|(before, _)| before.body() == event.state).unwrap();
        let after = after.as_ref().unwrap();
        assert_eq!(before.body(), after.body());
        for (k, (before, after)) in before.columns().zip(after.columns()).enumerate() {
            assert_eq!(before.displacement, after.displacement);
            // δv⁺ = δv⁻ − (c/m) n (n · δx).
            let mut expected = before.rate;
            if event.kind == TouchDown {
                expected.linear.z -= BALL.damping / BALL.mass * before.displacement.linear.z;
                assert!(
                    (after.rate.linear - expected.linear).norm() < 1e-13 * (1.0 + expected.linear.norm())
                );
            } else {
                assert_eq!(before, after, "column {k}");
            }
        }
    }
}

#[test]
fn the_motion_is_to_the_bit_what_it_is_without_sensitivities() {
    let (system, start) = top(TOP_DAMPING, 0, 0.0);
    let found = differentiate(&system, &start, &top_parameters(), (0.0, 0.3), 2e-4).unwrap();
    let run = located(system, &start, 0.3, 2e-4);
    assert_eq!((found.run.state, found.run.steps, found.run.trials), (run.state, run.steps, run.trials));
    assert_eq!(found.run.events.len(), run.events.len());
    for (a, b) in found.run.events.iter().zip(&run.events) {
        assert_eq!((a.t, a.guard, a.kind, a.impulse, a.state), (b.t, b.guard, b.kind, b.impulse, b.state));
    }
}

#[test]
fn derivatives_over_two_intervals_compose() {
    let (system, start) = top(TOP_DAMPING, 0, 0.0);
    let by = top_parameters();
    let run =
        |start: &RigidBodyState, from, to| differentiate(&system, start, &by, (from, to), 1e-4).unwrap();
    let whole = run(&start, 0.0, 0.1);
    // In flight, in contact, and below the surface before the last touch-down.
    for middle in [0.02, 0.03, 0.1033] {
        let end = 0.11;
        let whole = if end > 0.1 { run(&start, 0.0, end) } else { whole.clone() };
        let first = run(&start, 0.0, middle);
        let second = run(&first.run.state, middle, end);
        let state = second.state * first.state;
        let parameters = second.state * &first.parameters + &second.parameters;
        let error = (state - whole.state).norm() / whole.state.norm();
        let parameter_error = (parameters - &whole.parameters).norm() / whole.parameters.norm();
        println!("{middle}: {error:.1e} {parameter_error:.1e}");
        assert!(error < 1e-10 && parameter_error < 1e-10, "{middle}: {error:e} {parameter_error:e}");
    }
}

/// The symplectic form of ℝ³ × SO(3) in the spatial trivialisation, Ω(1, 2) = δp₁ · δq₂ − δp₂ · δq₁ +
/// L · (δφ₁ × δφ₂), as a matrix on (δx, δφ, δv, δω): p = (m v, L), L = R I Rᵀ ω.
fn symplectic_form(body: &RigidBody, x: &RigidBodyState) -> SMatrix<f64, 12, 12> {
    let r = x.orientation().to_rotation_matrix().into_inner();
    let inertia = r * body.inertia().tensor() * r.transpose();
    let momentum = inertia * x.angular_velocity();
    // δL = δφ × L + R I Rᵀ(δω − δφ × ω).
    let from_turn = inertia * so3::hat(x.angular_velocity()) - so3::hat(&momentum);
    let mut momenta = SMatrix::<f64, 6, 12>::zeros();
    momenta.fixed_view_mut::<3, 3>(0, 6).fill_diagonal(body.mass());
    momenta.fixed_view_mut::<3, 3>(3, 3).copy_from(&from_turn);
    momenta.fixed_view_mut::<3, 3>(3, 9).copy_from(&inertia);
    let places = SMatrix::<f64, 6, 12>::identity();
    let mut form = momenta.transpose() * places - places.transpose() * momenta;
    // L · (a × b) = aᵀ (−L̂) b … = a · (b × L).
    let mut turns = form.fixed_view_mut::<3, 3>(3, 3);
    turns -= so3::hat(&momentum);
    form
}

#[test]
fn the_derivative_of_an_undamped_motion_is_symplectic_through_events() {
    let (system, mut start) = top(0.0, 0, 0.0);
    start.configuration.position.z = 0.052;
    let mut errors = Vec::new();
    for dt in [4e-4, 2e-4] {
        let found = differentiate(&system, &start, &[], (0.0, 0.2), dt).unwrap();
        assert!(found.run.events.len() >= 8, "{}", found.run.events.len());
        let d = &found.state;
        let (before, after) =
            (symplectic_form(&system.body, &start), symplectic_form(&system.body, &found.run.state));
        let error = (d.transpose() * after * d - before).norm() / before.norm();
        // Ω is not degenerate, and the derivative is far from the identity.
        assert!(before.determinant().abs() > 1e-40 && (d - SMatrix::<f64, 12, 12>::identity()).norm() > 10.0);
        println!("{dt}: {error:.1e}, ‖D‖ = {:.1e}", d.norm());
        errors.push(error);
    }
    assert!(errors[1] < 1e-9 && errors[0] > 0.0, "{errors:?}");
    // With damping it is not: the check can fail.
    let (damped, _) = top(TOP_DAMPING, 0, 0.0);
    let d = differentiate(&damped, &start, &[], (0.0, 0.2), 2e-4).unwrap();
    let after = symplectic_form(&damped.body, &d.run.state);
    let before = symplectic_form(&damped.body, &start);
    assert!((d.state.transpose() * after * d.state - before).norm() > 1e-3 * before.norm());
}

#[test]
fn sensitivities_have_the_order_of_the_method() {
    fn check<M>(stepper: &M, bases: [u32; 4])
    where
        M: for<'a, 'b> Stepper<Frozen<'b, Variational<'a, BodyInContact<Gravity>>>>,
    {
        let order = f64::from(M::INFO.orders.rotation_with_torque.unwrap());
        let (system, start) = top(TOP_DAMPING, 0, 0.0);
        let exact = differentiate(&system, &start, &top_parameters(), (0.0, 0.1), 1e-5).unwrap();
        let mut points = [const { Vec::new() }; 3];
        for base in bases {
            let mut errors = [0.0; 3];
            for i in 0..5 {
                let dt = 0.1 / f64::from(base + base * i / 10);
                let grid = TimeGrid::try_new(0.0, 0.1, dt).unwrap();
                let by = Differentiation::by(top_parameters());
                let found = SensitivityRun::by_stepper(&system, &by, stepper, grid).from(&start).unwrap();
                errors[0] += (found.state - exact.state).norm_squared();
                errors[1] += (found.parameters - &exact.parameters).norm_squared();
                errors[2] += (found.event_times - &exact.event_times).norm_squared();
            }
            for (points, error) in points.iter_mut().zip(errors) {
                points.push((0.1 / f64::from(base), error.sqrt()));
            }
        }
        let found = points.each_ref().map(|p| slope(p));
        println!("{} order {order}: {found:.2?} {:?}", M::INFO.name, points.each_ref().map(|p| p[3].1));
        assert!(found.iter().all(|f| (f - order).abs() < 0.4), "{order}: {found:?} {points:?}");
    }
    check(&Heun, [800, 1600, 3200, 6400]);
    check(&RungeKuttaMuntheKaas4, [200, 400, 800, 1600]);
    check(&RungeKuttaMuntheKaas(DormandPrince), [100, 200, 400, 800]);
    check(&AdamsBashforth4 { start_up: Default::default() }, [800, 1600, 3200, 6400]);
}

// ---------------------------------------------------------------------------------- surfaces and forces

/// z = a (x² + y²)/2 taken as a level set with a unit gradient near it; its second derivative is not given.
#[derive(Debug)]
struct Bowl;

impl Surface for Bowl {
    fn signed_distance(&self, point: &Vector3<f64>) -> SignedDistance {
        // The distance from the sphere of radius 2 that the bowl is.
        let span = point - Vector3::new(0.0, 0.0, 2.0);
        let length = span.norm();
        SignedDistance { distance: 2.0 - length, gradient: -span / length }
    }
    fn lipschitz(&self) -> f64 {
        1.0
    }
}

fn wind(_: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
    let force = Vector3::new(0.3 * x.position().y.sin(), -0.2 * x.velocity().x, 0.1 * body.mass());
    Wrench { force, torque: x.angular_velocity() * -0.01 }
}

type Wind = ((Gravity, (Spring, Drag)), fn(f64, &RigidBody, &RigidBodyState) -> Wrench);

/// A box with four corners over a bowl, a hill and a log, on a spring, in a wind. Columns: the start, k and
/// c of the first corner, the mass and the linear drag.
fn corners(k: usize, epsilon: f64) -> (BodyInContact<Wind>, RigidBodyState) {
    let mut change = [0.0; 4];
    if k >= 12 {
        change[k - 12] = epsilon;
    }
    let hill = SphericalSurface::try_new(Vector3::new(0.0, 0.0, -3.0), 2.95, Solid::Inside).unwrap();
    let log = CylindricalSurface::try_new(
        Vector3::new(0.1, 0.0, -0.6),
        Vector3::new(0.3, 1.0, 0.1),
        0.5,
        Solid::Inside,
    )
    .unwrap();
    let surfaces: [Arc<dyn Surface>; 4] = [Arc::new(Bowl), Arc::new(hill), Arc::new(log), Arc::new(Bowl)];
    let contacts = surfaces.into_iter().enumerate().map(|(i, surface)| {
        let (a, b) = ([0.2, -0.2][i % 2], [0.15, -0.15][i / 2]);
        let (stiffness, damping) = if i == 0 { (300.0 + change[0], 3.0 + change[1]) } else { (250.0, 2.0) };
        let law = CompliantLaw::try_new(stiffness, damping).unwrap();
        Contact::try_new(Vector3::new(a, b, -0.1), surface, law).unwrap()
    });
    let body = RigidBody::try_new(
        1.2 + change[2],
        *RigidBody::try_box(1.2, Vector3::new(0.4, 0.3, 0.2)).unwrap().inertia(),
    )
    .unwrap();
    let spring = Spring {
        anchor: Vector3::new(0.3, 0.1, 0.8),
        attachment: Vector3::new(0.1, 0.0, 0.1),
        stiffness: 4.0,
        damping: 0.3,
        rest_length: 0.4,
    };
    let drag = Drag { linear: 0.2 + change[3], quadratic: 0.1, angular: 0.01 };
    let forces: Wind = ((Gravity::earth(), (spring, drag)), wind);
    let mut start = RigidBodyState::new(
        Vector3::new(0.05, -0.02, 0.35),
        so3::exp(&Vector3::new(0.2, -0.1, 0.3)),
        Vector3::new(0.3, 0.1, -0.2),
        Vector3::new(0.5, -0.4, 0.3),
    );
    start = Tangent::unit(k).moved(&start, epsilon);
    (BodyInContact::new(body, (forces, Contacts::new(contacts.collect()))), start)
}

#[test]
fn the_derivative_on_curved_surfaces_under_forces_is_the_difference_of_located_runs() {
    let drag =
        Parameter::Force(Arc::new(|_, _, x| Wrench { force: -x.velocity(), torque: Vector3::zeros() }));
    let by = [Parameter::normal(0, "stiffness"), Parameter::normal(0, "damping"), Parameter::Mass, drag];
    let (system, start) = corners(0, 0.0);
    let found = differentiate(&system, &start, &by, (0.0, 0.8), 1e-3).unwrap();
    println!("{:?}", found.run.events.iter().map(|e| (e.t, e.guard, e.kind)).collect::<Vec<_>>());
    assert!((0..4).all(|i| found.run.events.iter().any(|e| e.guard == i)));
    let steps = [[1e-5; 12].as_slice(), &[1e-2, 1e-4, 1e-4, 1e-4]].concat();
    agrees_with_differences(&found, corners, &steps, (0.8, 1e-3), 1e-6);
}

#[test]
fn points_that_touch_down_at_once_have_a_derivative() {
    // The lower corners of a box that falls flat, against differences that make them touch one by one.
    let flat = |k: usize, epsilon: f64| {
        let corner = |i: usize| {
            let point = Vector3::new([0.2, -0.2][i % 2], [0.15, -0.15][i / 2], -0.1);
            let law = CompliantLaw::try_new(300.0, 3.0).unwrap();
            Contact::try_new(point, Arc::new(HalfSpace::ground()), law).unwrap()
        };
        let body = RigidBody::try_box(1.2, Vector3::new(0.4, 0.3, 0.2)).unwrap();
        let contacts = Contacts::new((0..4).map(corner).collect());
        let start = RigidBodyState::new(
            Vector3::new(0.0, 0.0, 0.3),
            UnitQuaternion::identity(),
            Vector3::new(0.1, 0.0, -0.5),
            Vector3::zeros(),
        );
        (BodyInContact::new(body, (Gravity::earth(), contacts)), Tangent::unit(k).moved(&start, epsilon))
    };
    let (system, start) = flat(0, 0.0);
    let found = differentiate(&system, &start, &[], (0.0, 0.25), 1e-3).unwrap();
    assert_eq!(found.run.events.len(), 4);
    assert!(found.run.events.iter().all(|e| e.t == found.run.events[0].t));
    let base = found.run.state;
    for k in 0..12 {
        // The order of the touch-downs changes at zero: a kink of second order, so that the error falls as ε.
        let errors = [1e-4, 1e-5].map(|epsilon| {
            let run = |e: f64| {
                let (system, start) = flat(k, e);
                components(&base, &located(system, &start, 0.25, 1e-3).state)
            };
            ((run(epsilon) - run(-epsilon)) / (2.0 * epsilon) - found.state.column(k)).norm()
        });
        println!("column {k}: {errors:?}");
        assert!(errors[1] < 1e-3 && errors[1] < 0.2 * errors[0] + 1e-8, "column {k}: {errors:?}");
    }
}

#[test]
fn the_derivative_by_name_and_with_adapted_steps_is_that_by_the_stepper() {
    let (system, start) = top(TOP_DAMPING, 0, 0.0);
    let by = Differentiation::by(top_parameters());
    let grid = TimeGrid::try_new(0.0, 0.1, 1e-4).unwrap();
    let named = |method, steps: Steps| SensitivityRun::new(&system, &by, method, steps).from(&start).unwrap();
    let own = SensitivityRun::by_stepper(&system, &by, &RKMK8, grid).from(&start).unwrap();
    let same = named(Method::Rkmk8, grid.into());
    assert_eq!((same.state, &same.parameters), (own.state, &own.parameters));
    assert_eq!((same.run.state, same.event_times), (own.run.state, own.event_times.clone()));
    let settings = Adaptive { max_step: 1e-3, ..Adaptive::with_tolerances(1e-10, 1e-12) };
    let steps = Steps::adapted((0.0, 0.1), settings);
    let adapted = SensitivityRun::by_embedded_stepper(&system, &by, &RKMK8, steps).from(&start).unwrap();
    let error = (adapted.state - own.state).norm() / own.state.norm();
    let time_error = (adapted.event_times - &own.event_times).norm() / own.event_times.norm();
    println!("{error:.1e} {time_error:.1e} in {} steps", adapted.run.steps);
    assert!(error < 1e-8 && time_error < 1e-8 && adapted.run.steps < 400, "{error:e} {time_error:e}");
    // The named run is the same, and methods in body variables agree with those of the world.
    let again = named(Method::Rkmk8, steps);
    assert_eq!((again.state, again.run.state), (adapted.state, adapted.run.state));
    for found in [named(Method::Rkmk8B, grid.into()), named(Method::Rkmk8B, steps)] {
        let error = (found.state - own.state).norm() / own.state.norm();
        let of_parameters = (&found.parameters - &own.parameters).norm() / own.parameters.norm();
        let time_error = (&found.event_times - &own.event_times).norm() / own.event_times.norm();
        assert!(error < 1e-8 && of_parameters < 1e-8 && time_error < 1e-8, "{error:e} {time_error:e}");
    }
}
