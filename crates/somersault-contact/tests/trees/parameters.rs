//! Derivatives by what describes a tree, by knots of joint forces, and of trees with driven joints: differences of runs.

use crate::gradients::{between, column, differentiate, error, error_by_state, reached, touching_links};
use crate::{Torques, in_contact, passive};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use somersault_contact::contacts::Contact;
use somersault_contact::event::EventKind;
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::models::HoppingLeg;
use somersault_contact::sensitivity::{Differentiation, Parameter, SensitivityError, SensitivityRun};
use somersault_contact::surface::HalfSpace;
use somersault_contact::tree::{LinkContact, TreeInContact};
use somersault_integrators::driver::{Adaptive, Steps, TimeGrid};
use somersault_integrators::events::Location;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_integrators::state::State;
use somersault_multibody::motion::{
    Between, BodyWrenches, JointDrive, Knots, TorqueProfile, TreeForces, TreeState, TreeSystem,
};
use somersault_multibody::{Force, Joint, Link, MassProperties, Model, Split, TreeParameter, Velocities};
use std::sync::Arc;

/// The error of the last column of a derivative against differences of the runs of systems that a number makes.
fn error_by_number(
    (model, start, grid): (&Model, &TreeState, TimeGrid),
    found: &DVector<f64>,
    end: &TreeState,
    step: f64,
    run: impl Fn(f64, &TreeState, TimeGrid) -> (TreeState, Vec<f64>),
) -> f64 {
    let difference = |step: f64| between(model, end, &[step, -step].map(|by| run(by, start, grid)));
    error(found, &difference(step), &difference(0.5 * step), step)
}

/// The leg with other numbers.
fn leg(change: impl Fn(&mut HoppingLeg)) -> HoppingLeg {
    let mut leg = HoppingLeg::example().unwrap();
    change(&mut leg);
    leg
}

fn leg_runs(leg: &HoppingLeg, start: &TreeState, grid: TimeGrid) -> (TreeState, Vec<f64>) {
    let system = leg.system().unwrap();
    reached(&in_contact(&system), start, grid)
}

#[test]
fn derivatives_by_masses_centres_inertias_and_lengths_are_differences_of_runs() {
    let example = HoppingLeg::example().unwrap().system().unwrap();
    let (system, start) = (in_contact(&example), example.start().unwrap());
    let grid = TimeGrid::try_new(0.0, 0.3, 5e-4).unwrap();
    let (thigh, shank) = (1, 2);
    let placed = |i: usize| *example.model.links()[i].origin() / example.model.links()[i].origin().norm();
    let along = *example.model.links()[shank].mass_properties();
    let along = along.center / along.center.norm();
    let axis = match example.model.joint(shank).unwrap() {
        Joint::Revolute { axis } => *axis,
        other => panic!("{other:?}"),
    };
    type Change = fn(&mut HoppingLeg, f64);
    let cases: [(TreeParameter, f64, Change); 6] = [
        (TreeParameter::Mass(0), 1e-3, |leg, by| leg.masses[0] += by),
        (TreeParameter::Mass(shank), 1e-4, |leg, by| leg.masses[2] += by),
        (TreeParameter::Center(shank, along), 1e-5, |leg, by| leg.centers[1] += by),
        (TreeParameter::Inertia(thigh, axis * axis.transpose()), 1e-6, |leg, by| leg.moments[1] += by),
        (TreeParameter::Placement(shank, placed(shank)), 1e-6, |leg, by| leg.lengths[1] += by),
        (TreeParameter::Placement(thigh, placed(thigh)), 1e-6, |leg, by| leg.lengths[0] += by),
    ];
    let found = differentiate(&system, &start, cases.map(|(of, ..)| Parameter::Tree(of)), grid);
    let kinds: Vec<_> = found.run.events.iter().map(|e| e.kind).collect();
    for kind in [EventKind::TouchDown, EventKind::Stick, EventKind::Slip, EventKind::Release] {
        assert!(kinds.contains(&kind), "{kinds:?}");
    }
    let end = found.run.state.base();
    for (i, (of, step, change)) in cases.iter().enumerate() {
        let run = |by: f64, start: &TreeState, grid| leg_runs(&leg(|leg| change(leg, by)), start, grid);
        let of_run = (&example.model, &start, grid);
        let worst = error_by_number(of_run, &column(&found, 10 + i), &end, *step, run);
        assert!(worst < 1e-7, "{of:?}: {worst:e}");
    }
}

/// A tree with another description of one link.
fn with(model: &Model, of: &TreeParameter, by: f64) -> Model {
    let mut builder = Model::builder().with_gravity(*model.gravity());
    for (i, link) in model.links().iter().enumerate() {
        let mut mass = *link.mass_properties();
        let mut origin = *link.origin();
        if i == of.body() {
            match of {
                TreeParameter::Mass(_) => mass.mass += by,
                TreeParameter::Center(_, direction) => mass.center += direction * by,
                TreeParameter::Inertia(_, tensor) => mass.inertia += tensor * by,
                TreeParameter::Placement(_, direction) => origin += direction * by,
            }
        }
        let made = match link.parent() {
            Some(parent) => Link::child(link.name(), parent, *link.joint(), mass),
            None => Link::root(link.name(), *link.joint(), mass),
        };
        let made = link
            .mimic()
            .iter()
            .fold(made, |made, mimic| made.following(mimic.leader.clone(), mimic.multiplier, mimic.offset));
        builder.add(made.at(origin).turned(*link.orientation())).unwrap();
    }
    builder.build().unwrap()
}

#[test]
fn derivatives_of_links_that_touch_by_what_describes_them_are_differences_of_runs() {
    let (model, on_surfaces, pair, start) = touching_links();
    let touching = |model: &Model, start: &TreeState, grid| {
        let tree = TreeSystem::new(model, passive());
        reached(&TreeInContact::try_new(tree, on_surfaces.to_vec(), vec![pair.clone()]).unwrap(), start, grid)
    };
    let tree = TreeSystem::new(&model, passive());
    let system = TreeInContact::try_new(tree, on_surfaces.to_vec(), vec![pair.clone()]).unwrap();
    let grid = TimeGrid::try_new(0.0, 0.25, 5e-4).unwrap();
    let tensor = Matrix3::new(0.5, 0.2, -0.1, 0.2, 0.7, 0.3, -0.1, 0.3, 0.4);
    let cases = [
        (TreeParameter::Mass(1), 1e-4),
        (TreeParameter::Center(0, Vector3::new(0.3, -0.5, 0.8)), 1e-5),
        (TreeParameter::Inertia(2, tensor), 1e-6),
        (TreeParameter::Placement(1, Vector3::new(0.6, 0.3, -0.7)), 1e-6),
        (TreeParameter::Placement(2, Vector3::new(-0.2, 0.9, 0.1)), 1e-6),
        (TreeParameter::Placement(0, Vector3::new(0.4, 0.1, 0.8)), 1e-6),
    ];
    let found = differentiate(&system, &start, cases.map(|(of, _)| Parameter::Tree(of)), grid);
    assert!(found.run.event_count > 4, "{}", found.run.event_count);
    let end = found.run.state.base();
    for (i, (of, step)) in cases.iter().enumerate() {
        let run = |by: f64, start: &TreeState, grid| touching(&with(&model, of, by), start, grid);
        let worst = error_by_number((&model, &start, grid), &column(&found, 30 + i), &end, *step, run);
        assert!(worst < 1e-7, "{of:?}: {worst:e}");
    }
}

/// An arm on a cart whose second hinge follows the first; its tip slides on the ground. The tree, its contact, and where it starts.
pub(crate) fn following_arm() -> (Model, LinkContact, TreeState) {
    let rod = |mass: f64| MassProperties::rod(mass, Vector3::zeros(), Vector3::x() * 0.4);
    let hinge = Joint::Revolute { axis: Vector3::y() };
    let cart = MassProperties::point(1.5, Vector3::zeros());
    let mut builder = Model::builder();
    builder
        .add(Link::root("cart", Joint::Prismatic { axis: Vector3::x() }, cart).at(Vector3::z() * 0.5))
        .unwrap();
    builder.add(Link::child("upper", "cart", hinge, rod(0.7))).unwrap();
    let lower = Link::child("lower", "upper", hinge, rod(0.4)).at(Vector3::x() * 0.4);
    builder.add(lower.following("upper", 0.6, 0.2)).unwrap();
    let law = ContactLaw::from(CompliantLaw::try_new(5e3, 20.0).unwrap());
    let law = law.with_friction(CoulombFriction::try_new(0.3, 4e3, 30.0).unwrap());
    let tip = Contact::try_new(Vector3::x() * 0.4, Arc::new(HalfSpace::ground()), law).unwrap();
    let model = builder.build().unwrap();
    let start = model.state(&[0.0, 0.2], &[0.6, 0.5]).unwrap();
    (model, LinkContact::new("tip", "lower", tip), start)
}

#[test]
fn derivatives_of_joints_that_follow_others_are_differences_of_runs() {
    let (model, tip, start) = following_arm();
    fn touching<'m>(model: &'m Model, tip: &LinkContact) -> TreeInContact<'m, Torques> {
        TreeInContact::try_new(TreeSystem::new(model, passive()), vec![tip.clone()], vec![]).unwrap()
    }
    let grid = TimeGrid::try_new(0.0, 0.4, 5e-4).unwrap();
    let cases = [
        (TreeParameter::Mass(2), 1e-4),
        (TreeParameter::Placement(2, Vector3::new(0.6, 0.0, -0.7)), 1e-6),
        (TreeParameter::Placement(1, Vector3::z()), 1e-6),
    ];
    let system = touching(&model, &tip);
    let found = differentiate(&system, &start, cases.map(|(of, _)| Parameter::Tree(of)), grid);
    assert!(found.run.event_count > 2, "{}", found.run.event_count);
    let worst = error_by_state(&system, &start, &found, grid);
    assert!(worst < 1e-7, "by the state: {worst:e}");
    let end = found.run.state.base();
    for (i, (of, step)) in cases.iter().enumerate() {
        let run =
            |by: f64, start: &TreeState, grid| reached(&touching(&with(&model, of, by), &tip), start, grid);
        let worst = error_by_number((&model, &start, grid), &column(&found, 4 + i), &end, *step, run);
        assert!(worst < 1e-7, "{of:?}: {worst:e}");
    }
}

/// The leg in contact, its hip driven at some acceleration that holds it and its knee under a profile.
fn driven<'m>(
    leg: &HoppingLeg,
    model: &'m Model,
    profile: TorqueProfile,
) -> TreeInContact<'m, TorqueProfile, impl JointDrive + use<'m>> {
    let split = Split::try_active(model, &["thigh"]).unwrap();
    let motion = |t: f64, q: &[f64], v: &[f64], out: &mut [f64]| {
        out[3] = 400.0 * (0.5 + 0.2 * (20.0 * t).sin() - q[3]) - 30.0 * v[3] + 2.0 * v[2] * q[4];
    };
    let tree = TreeSystem::new(model, profile).driven(split, motion).unwrap();
    TreeInContact::try_new(tree, leg.contacts().unwrap(), vec![]).unwrap()
}

pub(crate) fn knots() -> Knots {
    Knots::try_new(&[0.0, 0.06, 0.11, 0.15, 0.2, 0.3], Between::Line).unwrap()
}

pub(crate) fn profile(by: f64) -> TorqueProfile {
    let knee = [2.0, 14.0, 12.0 + by, -3.0, 1.0, 5.0];
    TorqueProfile::try_new(knots(), DMatrix::from_fn(5, 6, |k, i| if k == 4 { knee[i] } else { 0.0 }))
        .unwrap()
}

/// The leg with a driven hip, and its start.
pub(crate) fn driven_leg(
    model: &Model,
) -> (TreeInContact<'_, TorqueProfile, impl JointDrive + use<'_>>, TreeState) {
    let leg = HoppingLeg::example().unwrap();
    let (q, v) = leg.start();
    let start = model.state(&q, &v).unwrap();
    (driven(&leg, model, profile(0.0)), start)
}

#[test]
fn derivatives_of_a_leg_with_a_driven_joint_are_differences_of_runs() {
    let example = HoppingLeg::example().unwrap();
    let model = example.model().unwrap();
    let (system, start) = driven_leg(&model);
    let grid = TimeGrid::try_new(0.0, 0.25, 5e-4).unwrap();
    let placed = model.links()[2].origin() / model.links()[2].origin().norm();
    let by = [
        Parameter::JointForceAt(4, knots(), 2),
        Parameter::Tree(TreeParameter::Mass(2)),
        Parameter::Tree(TreeParameter::Placement(2, placed)),
        Parameter::JointForce(3),
        Parameter::normal(0, "stiffness"),
    ];
    let found = differentiate(&system, &start, by, grid);
    let kinds: Vec<_> = found.run.events.iter().map(|e| e.kind).collect();
    assert!(kinds.contains(&EventKind::TouchDown) && kinds.contains(&EventKind::Slip), "{kinds:?}");
    assert_eq!(found.run.state.base(), reached(&system, &start, grid).0);
    let worst = error_by_state(&system, &start, &found, grid);
    assert!(worst < 1e-7, "by the state: {worst:e}");
    // The force of a joint that is driven moves nothing.
    assert!(found.parameters.column(3).iter().all(|x| *x == 0.0));
    let end = found.run.state.base();
    let of_run = (&model, &start, grid);
    let by_knot =
        |by: f64, start: &TreeState, grid| reached(&driven(&example, &model, profile(by)), start, grid);
    let worst = error_by_number(of_run, &column(&found, 10), &end, 1e-3, by_knot);
    assert!(worst < 1e-7, "by a knot: {worst:e}");
    type Change = fn(&mut HoppingLeg, f64);
    let cases: [(usize, f64, Change); 2] =
        [(1, 1e-4, |leg, by| leg.masses[2] += by), (2, 1e-6, |leg, by| leg.lengths[1] += by)];
    for (i, step, change) in cases {
        let run = |by: f64, start: &TreeState, grid| {
            let leg = leg(|leg| change(leg, by));
            let model = leg.model().unwrap();
            reached(&driven(&leg, &model, profile(0.0)), start, grid)
        };
        let worst = error_by_number(of_run, &column(&found, 10 + i), &end, step, run);
        assert!(worst < 1e-7, "by parameter {i}: {worst:e}");
    }
}

/// A mass on a slider is pushed by x = Σ of the integrals of the profile, of degree two between held values and three on lines:
/// exact by a method of order 4 in steps that end at the knots, wherever they are.
#[test]
fn steps_end_at_the_knots_of_a_profile() {
    let mut builder = Model::builder().with_gravity(Vector3::zeros());
    let mass = MassProperties::point(2.0, Vector3::zeros());
    let joint = Joint::Prismatic { axis: Vector3::x() };
    builder.add(Link::root("mass", joint, mass)).unwrap();
    let model = builder.build().unwrap();
    let times = [0.0, 0.137, 0.311, 0.4];
    let forces = [4.0, -6.0, 2.0, 3.0];
    for between in [Between::Line, Between::Hold] {
        let (mut x, mut v) = (0.0, 0.5);
        for i in 0..3 {
            let h = times[i + 1] - times[i];
            let slope = if between == Between::Line { (forces[i + 1] - forces[i]) / h } else { 0.0 };
            x += h * v + h * h * (forces[i] / 2.0 + h * slope / 6.0) / 2.0;
            v += h * (forces[i] + h * slope / 2.0) / 2.0;
        }
        // After the last knot its force stays.
        (x, v) = (x + 0.1 * v + 0.005 * forces[3] / 2.0, v + 0.1 * forces[3] / 2.0);
        let profile = TorqueProfile::try_new(
            Knots::try_new(&times, between).unwrap(),
            DMatrix::from_row_slice(1, 4, &forces),
        );
        let tree = TreeSystem::new(&model, Box::new(profile.unwrap()) as Torques);
        let system = TreeInContact::try_new(tree, vec![], vec![]).unwrap();
        let start = system.unstretched(model.state(&[0.0], &[0.5]).unwrap());
        let fixed: Steps = TimeGrid::try_new(0.0, 0.5, 0.03).unwrap().into();
        let adapted = Steps::adapted((0.0, 0.5), Adaptive::default());
        for (method, steps) in [(Method::Rk4, fixed), (Method::Rkmk5, fixed), (Method::Rkmk8, adapted)] {
            let end = Run::new(&system, method, steps).locating(Location::default()).from(&start).unwrap();
            let State { configuration, rate } = end.state.base();
            let errors = [configuration.as_slice()[0] - x, rate.as_slice()[0] - v];
            assert!(errors.iter().all(|error| error.abs() < 1e-14), "{between:?} {method}: {errors:?}");
        }
    }
}

/// A wind that pushes the first body.
struct Wind;

impl TreeForces for Wind {
    fn add_torque(&self, _: f64, _: &[f64], _: &[f64], _: &mut [f64]) {}
    fn wrenches(&self) -> Option<&dyn BodyWrenches> {
        Some(self)
    }
}

impl BodyWrenches for Wind {
    fn add_wrenches(&self, _: f64, _: &Velocities<'_>, wrenches: &mut [Force<f64>]) {
        wrenches[0].linear.x += 1.0;
    }
}

#[test]
fn parameters_that_a_tree_does_not_have_are_refused() {
    let example = HoppingLeg::example().unwrap().system().unwrap();
    let (system, start) = (in_contact(&example), example.start().unwrap());
    let grid = TimeGrid::try_new(0.0, 0.01, 1e-3).unwrap();
    let reason = |by: Parameter| {
        let by = Differentiation::by([by]);
        SensitivityRun::new(&system, &by, Method::Rkmk8, grid).from(&start).unwrap_err().reason
    };
    let skew = Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for of in [
        TreeParameter::Mass(3),
        TreeParameter::Center(0, Vector3::repeat(f64::NAN)),
        TreeParameter::Inertia(0, skew),
        TreeParameter::Placement(7, Vector3::x()),
    ] {
        assert!(matches!(reason(Parameter::Tree(of)), SensitivityError::Tree(_)), "{of:?}");
    }
    assert!(matches!(
        reason(Parameter::JointForceAt(4, knots(), 6)),
        SensitivityError::NoKnot { n: 6, found: 6 }
    ));
    assert!(matches!(reason(Parameter::JointForceAt(5, knots(), 0)), SensitivityError::NoJoint { .. }));
    let blown: Torques = Box::new(Wind);
    let blown =
        TreeInContact::try_new(TreeSystem::new(&example.model, blown), example.contacts.clone(), vec![]);
    let by = Differentiation::by([Parameter::Tree(TreeParameter::Placement(1, Vector3::x()))]);
    let blown = blown.unwrap();
    let found = SensitivityRun::new(&blown, &by, Method::Rkmk8, grid).from(&start).unwrap_err().reason;
    assert!(matches!(found, SensitivityError::Tree(_)), "{found}");
}
