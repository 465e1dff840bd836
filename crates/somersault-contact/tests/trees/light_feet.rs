//! Light feet on stiff ground: an implicit method with steps as long as the motion allows.
//!
//! The foot weighs 1 g, so that the contact and the leg's damping make rates λ of 10⁵/s: explicit methods are stable for steps
//! of up to 2.8/|λ|.

use crate::orders::median_order;
use crate::slider::Slider;
use crate::{Torques, passive};
use crate::{gradients::touching_links, in_contact};
use nalgebra::{DMatrix, Matrix3, UnitQuaternion, Vector3};
use somersault_contact::contacts::Contact;
use somersault_contact::event::EventKind::{self, Release, Slip, Stick, TouchDown};
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::{ContactLaw, ContactMode};
use somersault_contact::models::HoppingLeg;
use somersault_contact::sensitivity::{Differentiation, Parameter, SensitivityRun, TreeSensitivities};
use somersault_contact::surface::HalfSpace;
use somersault_contact::tree::{LinkContact, TouchingState, TreeInContact};
use somersault_integrators::augmented::Augmented;
use somersault_integrators::driver::{Adaptive, IntegrateError, Steps, TimeGrid};
use somersault_integrators::events::{Hybrid, Interruption, Located, Location};
use somersault_integrators::methods::Method;
use somersault_integrators::partials::Partials;
use somersault_integrators::run::Run;
use somersault_integrators::state::State;
use somersault_integrators::stepper::StepError;
use somersault_multibody::motion::{Coordinates, TreeForces, TreeSystem};
use somersault_multibody::{Joint, Link, MassProperties, Model};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// A body of 60 kg on a foot of 1 g.
const LIGHT: Slider = Slider { body: 60.0, foot: 1e-3, spring: 2e4, damping: 100.0, ground: 1e5, loss: 60.0 };

/// Against matrix exponentials, which have eleven digits of such equations.
#[test]
fn a_light_foot_on_a_slider_takes_steps_of_the_motion_at_order_5() {
    let model = LIGHT.model();
    let tree = TreeSystem::new(&model, Box::new(LIGHT) as Torques);
    let system = TreeInContact::try_new(tree, LIGHT.contacts(), vec![]).unwrap();
    let start = system.unstretched(model.state(&[0.55, 0.0], &[0.3, 0.0]).unwrap());
    let (times, end) = LIGHT.reference(&Slider::heights(&start), 1.5);
    // Of heights and rates, and the largest of the times of events.
    let errors_of = |steps: u64, location: Location| {
        let grid = TimeGrid::try_with_steps(0.0, 1.5, steps).unwrap();
        let run = Run::new(&system, Method::Radau5, grid).locating(location).from(&start).unwrap();
        assert_eq!((run.events.len(), times.len()), (7, 7), "{steps}");
        let late = run.events.iter().zip(&times).map(|(event, t)| (event.t - t).abs()).fold(0.0, f64::max);
        ((Slider::heights(&run.state) - end).norm(), late)
    };
    // The explicit limit is 2.8 m/(c + c_leg), 17 µs.
    let limit = 2.8 * LIGHT.foot / (LIGHT.loss + LIGHT.damping);
    let (error, late) = errors_of(375, Location::default());
    assert!(1.5 / 375.0 > 200.0 * limit && error < 1e-8 && late < 3e-9, "{error:e} {late:e}");
    let error = |k: i32| {
        let steps = (100.0 * 2f64.powf(f64::from(k) / 4.0)).round() as u64;
        (1.5 / steps as f64, errors_of(steps, Location::as_given()).0)
    };
    let errors: Vec<_> = (0..=11).map(error).collect();
    let order = median_order(&errors, 4, 1e-10);
    assert!((4.5..6.0).contains(&order), "{order} {errors:?}");
}

/// A [`HoppingLeg`] with a sole of 1 g that slides along the shank on a spring and damper, whose hip and knee are held by springs
/// and dampers and bent.
#[derive(Clone)]
struct Soled(HoppingLeg);

const SOLE: f64 = 1e-3;
const SPRING: f64 = 5e3;
const DAMPING: f64 = 60.0;
const GROUND: [f64; 2] = [1e5, 60.0];

impl TreeForces for Soled {
    fn add_torque(&self, t: f64, q: &[f64], v: &[f64], torque: &mut [f64]) {
        torque[3] -= 200.0 * (q[3] - 0.475) + 3.0 * v[3];
        torque[4] -= 200.0 * (q[4] + 0.992 - 0.2 * (12.0 * t).sin()) + v[4];
        torque[5] -= SPRING * q[5];
    }
}

impl Soled {
    fn new() -> Self {
        let law = CompliantLaw::try_new(GROUND[0], GROUND[1]).unwrap();
        Self(HoppingLeg { law, ..HoppingLeg::example().unwrap() })
    }

    fn model(&self) -> Model {
        let HoppingLeg { masses, moments, lengths: [hip, thigh, shank], centers, .. } = self.0;
        let down = -Vector3::y();
        let mass = |i: usize, center: f64| MassProperties {
            mass: masses[i],
            center: down * center,
            inertia: Matrix3::from_diagonal_element(moments[i]),
        };
        let hinge = Joint::Revolute { axis: Vector3::z() };
        let plane = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
        let mut builder = Model::builder();
        builder.add(Link::root("body", Joint::Planar, mass(0, 0.0)).turned(plane)).unwrap();
        builder.add(Link::child("thigh", "body", hinge, mass(1, centers[0])).at(down * hip)).unwrap();
        builder.add(Link::child("shank", "thigh", hinge, mass(2, centers[1])).at(down * thigh)).unwrap();
        let along = Joint::Prismatic { axis: down };
        let sole = Link::child("sole", "shank", along, MassProperties::point(SOLE, Vector3::zeros()));
        builder.add(sole.at(down * shank).with_damping(DAMPING)).unwrap();
        builder.build().unwrap()
    }

    fn on<'m>(&self, model: &'m Model) -> TreeInContact<'m, Torques> {
        let law = ContactLaw::from(self.0.law).with_friction(self.0.friction);
        let foot = Contact::try_new(Vector3::zeros(), Arc::new(HalfSpace::ground()), law).unwrap();
        let foot = LinkContact::new("foot", "sole", foot);
        let forces: Torques = Box::new(self.clone());
        TreeInContact::try_new(TreeSystem::new(model, forces), vec![foot], vec![]).unwrap()
    }

    fn start(&self, system: &TreeInContact<'_, Torques>) -> TouchingState {
        let (q, v) = self.0.start();
        let beside = |numbers: &[f64]| [numbers, &[0.0]].concat();
        system.unstretched(system.model().state(&beside(&q), &beside(&v)).unwrap())
    }
}

/// Positions and rates of all joints.
fn numbers(x: &TouchingState) -> Vec<f64> {
    [x.configuration.0.as_slice(), x.rate.base.as_slice()].concat()
}

/// Of the difference of two states, relative to the second one.
fn relative(x: &TouchingState, y: &TouchingState) -> f64 {
    let norm = |numbers: &[f64]| numbers.iter().map(|x| x * x).sum::<f64>().sqrt();
    let (x, y) = (numbers(x), numbers(y));
    let difference: Vec<f64> = x.iter().zip(&y).map(|(x, y)| x - y).collect();
    norm(&difference) / norm(&y)
}

/// Against adapted steps of an explicit method: two stances with seven events.
#[test]
fn a_light_sole_on_hinges_takes_steps_of_the_motion() {
    let leg = Soled::new();
    let model = leg.model();
    let system = leg.on(&model);
    let start = leg.start(&system);
    let limit = 2.8 * SOLE / (GROUND[1] + DAMPING);
    let adapted = |method, tolerance| {
        let steps = Steps::adapted((0.0, 0.6), Adaptive::with_tolerances(tolerance, tolerance));
        Run::new(&system, method, steps).locating(Location::default()).from(&start).unwrap()
    };
    let reference = adapted(Method::Rkmk8, 1e-10);
    let kinds: Vec<_> = reference.events.iter().map(|event| event.kind).collect();
    assert_eq!(kinds, [TouchDown, Stick, Slip, Release, TouchDown, Slip, Release]);
    let same = |run: &Located<Augmented<Coordinates>, EventKind>, within: f64| {
        assert_eq!(run.events.iter().map(|event| event.kind).collect::<Vec<_>>(), kinds);
        let pairs = run.events.iter().zip(&reference.events);
        let late = pairs.map(|(a, b)| (a.t - b.t).abs()).fold(0.0, f64::max);
        assert!(late < within, "{late:e}");
        relative(&run.state, &reference.state)
    };
    // Adapted: the error follows the tolerance, in a tenth of the steps and fewer.
    for (tolerance, steps) in [(1e-4, 200), (1e-6, 500), (1e-8, 1_500)] {
        let run = adapted(Method::Radau5, tolerance);
        let error = same(&run, tolerance);
        assert!(
            error < 0.1 * tolerance && run.steps < steps,
            "{tolerance:e}: {error:e}, {} steps",
            run.steps
        );
    }
    let explicit = adapted(Method::Rkmk5, 1e-6).steps;
    assert!(explicit > 15_000, "{explicit}");
    // Fixed: 20 to 80 times as long as an explicit method's at most.
    let fixed = |times: f64| {
        let grid = TimeGrid::try_new(0.0, 0.6, times * limit).unwrap();
        let run = Run::new(&system, Method::Radau5, grid).locating(Location::default()).from(&start).unwrap();
        (times, same(&run, 1e-7))
    };
    let errors: Vec<_> = (0..=8).map(|k| fixed(80.0 * 2f64.powf(-f64::from(k) / 4.0))).collect();
    assert!(errors[0].1 < 1e-7 && errors[8].1 < 1e-10, "{errors:?}");
    let order = median_order(&errors, 4, 1e-11);
    assert!((4.3..6.0).contains(&order), "{order} {errors:?}");
}

/// The largest entry of a difference of two matrices, in parts of the largest of its row.
fn largest_difference(found: &DMatrix<f64>, expected: &DMatrix<f64>) -> f64 {
    let rows = (found - expected).row_iter().map(|row| row.amax()).collect::<Vec<_>>();
    rows.iter().zip(expected.row_iter()).map(|(off, row)| off / row.amax().max(1.0)).fold(0.0, f64::max)
}

fn check_partials<H: Hybrid>(system: &H, mode: &H::Mode, x: &State<H::Configuration>) {
    let (mut found, mut expected) = (Partials::new(x), Partials::new(x));
    let mut w = system.workspace();
    system.partials_in(mode, &mut w, 0.1, x, &mut found);
    expected.by_differences(x, |x, slope| system.acceleration_in(mode, &mut w, 0.1, x, slope));
    for of in [Partials::by_displacement, Partials::by_rate] {
        let off = largest_difference(of(&found), of(&expected));
        assert!(off < 2e-4, "{mode:?}: {off:e}");
    }
}

/// Of a sole in stance, and of links with spherical and free joints that touch a carried surface, the ground and each other.
#[test]
fn partials_of_trees_in_contact_are_their_differences() {
    let leg = Soled::new();
    let model = leg.model();
    let system = leg.on(&model);
    let (q, v) = ([0.1, 0.57, 0.1, 0.45, -0.9, 0.01], [0.3, -0.2, 0.5, -1.0, 2.0, 0.1]);
    let mut x = system.unstretched(model.state(&q, &v).unwrap());
    x.rate.variables[0] = Vector3::new(1e-3, 0.0, 0.0);
    for mode in [ContactMode::Open, ContactMode::Closed, ContactMode::Slip] {
        check_partials(&system, &vec![mode], &x);
    }
    let (model, on_surfaces, pair, start) = touching_links();
    let tree = TreeSystem::new(&model, passive());
    let system = TreeInContact::try_new(tree, on_surfaces.into(), vec![pair]).unwrap();
    let mut x = system.unstretched(start);
    x.rate.variables.fill(Vector3::new(1e-3, 2e-3, -1e-3));
    for mode in [[ContactMode::Closed; 3], [ContactMode::Slip, ContactMode::Open, ContactMode::Slip]] {
        check_partials(&system, &mode.to_vec(), &x);
    }
}

/// The columns of the implicit method are those of an explicit one.
#[test]
fn derivatives_by_the_implicit_method_are_those_of_an_explicit_one() {
    let leg = HoppingLeg::example().unwrap().system().unwrap();
    let system = in_contact(&leg);
    let by = Differentiation::by([Parameter::normal(0, "stiffness"), Parameter::JointForce(4)]);
    let found = |method, h| -> TreeSensitivities {
        let grid = TimeGrid::try_new(0.0, 0.06, h).unwrap();
        SensitivityRun::new(&system, &by, method, grid).from(&leg.start().unwrap()).unwrap()
    };
    let (implicit, explicit) = (found(Method::Radau5, 5e-4), found(Method::Rkmk8, 5e-4));
    assert!(implicit.run.event_count == 2 && explicit.run.event_count == 2);
    for (a, b) in [(&implicit.state, &explicit.state), (&implicit.parameters, &explicit.parameters)] {
        let off = largest_difference(a, b);
        assert!(off < 1e-7, "{off:e}");
    }
}

/// Where Newton's method does not solve the equation of a step, adapted steps shorten and fixed ones are divided, and the error of a
/// run that ends there says so.
#[test]
fn an_unsolved_step_is_made_shorter_or_named() {
    let model = LIGHT.model();
    // The leg's force is a number at the first times only.
    let broken: Torques = Box::new(|t: f64, _: &[f64], _: &[f64], torque: &mut [f64]| {
        torque[1] += if t < 0.01 { 0.0 } else { f64::NAN };
    });
    let system = TreeInContact::try_new(TreeSystem::new(&model, broken), LIGHT.contacts(), vec![]).unwrap();
    let start = system.unstretched(model.state(&[0.55, 0.0], &[0.3, 0.0]).unwrap());
    let adapted = Steps::adapted((0.0, 1.0), Adaptive::default());
    for steps in [adapted, TimeGrid::try_new(0.0, 1.0, 4e-3).unwrap().into()] {
        let run = Run::new(&system, Method::Radau5, steps).locating(Location::default());
        let broken = run.from(&start).unwrap_err();
        let unsolved = matches!(
            broken.reason,
            Interruption::Integrate(IntegrateError::Step(StepError::NotConverged { method: "radau5", .. }))
        );
        assert!(unsolved && broken.so_far.t > 0.0 && broken.so_far.t < 0.01, "{broken}");
    }
}
