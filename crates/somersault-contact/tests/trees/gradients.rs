//! Derivatives of motions of trees through contacts: differences of runs, and the derivative of a body.

use crate::scenes::{chain, chain_start};
use crate::{RKMK8, Torques, passive};
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, UnitQuaternion, Vector3};
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::event::EventKind;
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::models::HoppingLeg;
use somersault_contact::sensitivity::{
    Differentiation, Parameter, SensitivityError, SensitivityRun, Side, TreeSensitivities, Undifferentiated,
};
use somersault_contact::surface::{HalfSpace, Solid, SphericalSurface};
use somersault_contact::tree::{LinkContact, LinkPair, TreeInContact};
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::TimeGrid;
use somersault_integrators::events::Location;
use somersault_integrators::force::Gravity;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_integrators::state::{Configuration, Rate, RigidBodyState};
use somersault_integrators::variation::Tangent;
use somersault_multibody::motion::{JointDrive, Rates, TreeForces, TreeState, TreeSystem};
use somersault_multibody::{Joint, Link, MassProperties, Model};
use std::sync::Arc;

fn moved(x: &TreeState, along: &Tangent<Rates>, by: f64) -> TreeState {
    let mut x = x.clone();
    x.configuration.drift(&along.displacement, by);
    x.rate.axpy(by, &along.rate);
    x
}

/// The end of a run and the times of its events.
pub(crate) fn reached<F: TreeForces, D: JointDrive>(
    system: &TreeInContact<'_, F, D>,
    start: &TreeState,
    grid: TimeGrid,
) -> (TreeState, Vec<f64>) {
    let run = Run::by_stepper(system, &RKMK8, grid).locating(Location::as_given());
    let run = run.from(&system.unstretched(start.clone())).unwrap();
    (run.state.base(), run.events.iter().map(|e| e.t).collect())
}

/// The components of the way from one state to another, and of the change of the times of events, as the columns have them.
pub(crate) fn between(model: &Model, at: &TreeState, ends: &[(TreeState, Vec<f64>); 2]) -> DVector<f64> {
    let [(a, times_a), (b, times_b)] = ends;
    assert_eq!(times_a.len(), times_b.len());
    let mut numbers = vec![0.0; 2 * model.n_velocities()];
    for ((x, _), sign) in ends.iter().zip([1.0, -1.0]) {
        let mut displacement = at.rate.clone();
        x.configuration.difference(&at.configuration, &mut displacement);
        let mut rate = x.rate.clone();
        rate.axpy(-1.0, &at.rate);
        let [way, change] = model.joint_tangent(at, (&displacement, &rate)).unwrap();
        numbers.iter_mut().zip([way, change].concat()).for_each(|(n, x)| *n += sign * x);
    }
    assert!(a.configuration.is_finite() && b.configuration.is_finite());
    numbers.extend(times_a.iter().zip(times_b).map(|(a, b)| a - b));
    DVector::from_vec(numbers)
}

/// One column of a derivative and of the times of events.
pub(crate) fn column(found: &TreeSensitivities, k: usize) -> DVector<f64> {
    let n = found.state.ncols();
    let of_state =
        if k < n { found.state.column(k).into_owned() } else { found.parameters.column(k - n).into_owned() };
    let mut numbers = of_state.as_slice().to_vec();
    numbers.extend(found.event_times.column(k).iter());
    DVector::from_vec(numbers)
}

/// The largest error of a column against the difference of two steps, over its size.
pub(crate) fn error(found: &DVector<f64>, coarse: &DVector<f64>, fine: &DVector<f64>, step: f64) -> f64 {
    // By Richardson: of the fourth order.
    let difference = (fine * 8.0 - coarse) / (6.0 * step);
    (found - &difference).amax() / found.amax()
}

/// The largest error of all columns by the initial state.
pub(crate) fn error_by_state<F: TreeForces, D: JointDrive>(
    system: &TreeInContact<'_, F, D>,
    start: &TreeState,
    found: &TreeSensitivities,
    grid: TimeGrid,
) -> f64 {
    let (model, n) = (system.model(), system.model().n_velocities());
    let end = &found.run.state.base();
    let of = |k: usize| {
        let unit = |i: usize| if i == k { 1.0 } else { 0.0 };
        let (way, change): (Vec<f64>, Vec<f64>) =
            ((0..n).map(unit).collect(), (n..2 * n).map(unit).collect());
        let along = model.tangent(start, &way, &change).unwrap();
        let difference = |step: f64| {
            between(model, end, &[step, -step].map(|by| reached(system, &moved(start, &along, by), grid)))
        };
        let found = column(found, k);
        // The more it reacts, the shorter is the step.
        let step = 4e-4 / (10.0 + found.amax());
        error(&found, &difference(step), &difference(0.5 * step), step)
    };
    (0..2 * n).map(of).fold(0.0, f64::max)
}

pub(crate) fn differentiate<F: TreeForces, D: JointDrive>(
    system: &TreeInContact<'_, F, D>,
    start: &TreeState,
    by: impl Into<Vec<Parameter>>,
    grid: TimeGrid,
) -> TreeSensitivities {
    let by = Differentiation::by(by);
    SensitivityRun::by_stepper(system, &by, &RKMK8, grid).locating(Location::as_given()).from(start).unwrap()
}

#[test]
fn derivatives_of_a_bouncing_chain_are_differences_of_runs() {
    let (model, contacts) = chain();
    let with = |law: CompliantLaw| {
        let law = |c: &LinkContact| {
            let ground = Arc::new(HalfSpace::ground());
            let contact = Contact::try_new(*c.contact().shape().centre(), ground, law).unwrap();
            LinkContact::new(c.name(), c.link(), contact)
        };
        TreeInContact::try_new(TreeSystem::new(&model, passive()), contacts.iter().map(law).collect(), vec![])
            .unwrap()
    };
    let law = |stiffness, damping| with(CompliantLaw::try_new(stiffness, damping).unwrap());
    let system = law(2e4, 8.0);
    let start = chain_start(&system).base();
    let grid = TimeGrid::try_new(0.0, 0.5, 5e-4).unwrap();
    let of = |name: &'static str| [0, 1, 2].map(|i| Parameter::normal(i, name));
    let found = differentiate(&system, &start, [of("stiffness"), of("damping")].concat(), grid);
    assert!(found.run.event_count > 6, "{}", found.run.event_count);
    // With columns or without, the motion is the same.
    assert_eq!(found.run.state.base(), reached(&system, &start, grid).0);
    let worst = error_by_state(&system, &start, &found, grid);
    assert!(worst < 1e-7, "by the state: {worst:e}");
    for (k, step) in [(0, 2.0), (3, 2e-3)] {
        let difference = |step: f64| {
            let ends = [step, -step].map(|by| {
                let moved = if k == 0 { law(2e4 + by, 8.0) } else { law(2e4, 8.0 + by) };
                reached(&moved, &start, grid)
            });
            between(&model, &found.run.state.base(), &ends)
        };
        let all: DVector<f64> = (8 + k..11 + k).map(|k| column(&found, k)).sum();
        let worst = error(&all, &difference(step), &difference(0.5 * step), step);
        assert!(worst < 1e-7, "by the law: {worst:e}");
    }
}

/// The leg, with a constant force of a joint.
fn leg_in<'m>(leg: HoppingLeg, model: &'m Model, (joint, force): (usize, f64)) -> TreeInContact<'m, Torques> {
    let (contacts, actuators) = (leg.contacts().unwrap(), leg.system().unwrap().actuators);
    let torques: Torques = Box::new(move |t: f64, q: &[f64], v: &[f64], torque: &mut [f64]| {
        actuators.add_torque(t, q, v, torque);
        torque[joint] += force;
    });
    TreeInContact::try_new(TreeSystem::new(model, torques), contacts, vec![]).unwrap()
}

#[test]
fn derivatives_of_a_hopping_leg_are_differences_of_runs() {
    let leg = HoppingLeg::example().unwrap();
    let model = leg.model().unwrap();
    let (q, v) = leg.start();
    let start = model.state(&q, &v).unwrap();
    let grid = TimeGrid::try_new(0.0, 0.35, 5e-4).unwrap();
    let example = || HoppingLeg::example().unwrap();
    let system = leg_in(example(), &model, (0, 0.0));
    let by = [
        Parameter::normal(0, "stiffness"),
        Parameter::normal(0, "damping"),
        Parameter::friction(0, "coefficient"),
        Parameter::friction(0, "stiffness"),
        Parameter::JointForce(3),
        Parameter::JointForce(4),
    ];
    let found = differentiate(&system, &start, by, grid);
    let kinds: Vec<_> = found.run.events.iter().map(|e| e.kind).collect();
    for kind in [EventKind::TouchDown, EventKind::Stick, EventKind::Slip, EventKind::Release] {
        assert!(kinds.contains(&kind), "{kinds:?}");
    }
    assert!(found.event_times.iter().all(|t| t.is_finite()));
    let worst = error_by_state(&system, &start, &found, grid);
    assert!(worst < 1e-7, "by the state: {worst:e}");
    let law = |k: f64, c: f64| CompliantLaw::try_new(2e4 + k, 150.0 + c).unwrap();
    let friction = |mu: f64, k: f64| CoulombFriction::try_new(0.5 + mu, 1.5e4 + k, 60.0).unwrap();
    let with = |i: usize, by: f64| match i {
        0 => leg_in(HoppingLeg { law: law(by, 0.0), ..example() }, &model, (0, 0.0)),
        1 => leg_in(HoppingLeg { law: law(0.0, by), ..example() }, &model, (0, 0.0)),
        2 => leg_in(HoppingLeg { friction: friction(by, 0.0), ..example() }, &model, (0, 0.0)),
        3 => leg_in(HoppingLeg { friction: friction(0.0, by), ..example() }, &model, (0, 0.0)),
        joint => leg_in(example(), &model, (joint - 1, by)),
    };
    for (i, step) in [2.0, 1e-2, 2e-5, 2.0, 1e-4, 1e-4].into_iter().enumerate() {
        let difference = |step: f64| {
            let ends = [step, -step].map(|by| reached(&with(i, by), &start, grid));
            between(&model, &found.run.state.base(), &ends)
        };
        let worst = error(&column(&found, 10 + i), &difference(step), &difference(0.5 * step), step);
        assert!(worst < 1e-7, "by parameter {i}: {worst:e}");
    }
}

/// A body without symmetry, free, and a state of it.
fn thrown() -> (RigidBody, Model, RigidBodyState, TreeState) {
    let body = RigidBody::try_box(1.3, Vector3::new(0.2, 0.3, 0.1)).unwrap();
    let mass = MassProperties { mass: 1.3, center: Vector3::zeros(), inertia: *body.inertia().tensor() };
    let mut builder = Model::builder();
    builder.add(Link::root("body", Joint::Free, mass)).unwrap();
    let model = builder.build().unwrap();
    let start = RigidBodyState::new(
        Vector3::new(0.05, 0.02, 0.35),
        UnitQuaternion::new(Vector3::new(0.2, -0.1, 0.4)),
        Vector3::new(0.8, 0.1, -1.0),
        Vector3::new(1.0, 3.0, -2.0),
    );
    let (p, r) = (start.position(), start.orientation());
    let [u, w] = [start.velocity(), start.angular_velocity()].map(|v| r.inverse() * v);
    let q = [p.as_slice(), r.coords.as_slice()].concat();
    let of_tree = model.state(&q, &[u.as_slice(), w.as_slice()].concat()).unwrap();
    (body, model, start, of_tree)
}

/// What the tangents of a body are as motions of a free joint, in body axes: δ(Rᵀ v) = Rᵀ (δv − δφ × v).
fn in_body_axes(x: &RigidBodyState) -> SMatrix<f64, 12, 12> {
    let back = x.orientation().inverse().to_rotation_matrix().into_inner();
    let mut out = SMatrix::<f64, 12, 12>::zeros();
    for i in 0..4 {
        out.fixed_view_mut::<3, 3>(3 * i, 3 * i).copy_from(&back);
    }
    out.fixed_view_mut::<3, 3>(6, 3).copy_from(&(back * x.velocity().cross_matrix()));
    out.fixed_view_mut::<3, 3>(9, 3).copy_from(&(back * x.angular_velocity().cross_matrix()));
    out
}

#[test]
fn the_derivative_of_a_tree_of_one_body_is_that_of_the_body() {
    let (body, model, start, of_tree) = thrown();
    let compliant = ContactLaw::from(CompliantLaw::try_new(5e3, 20.0).unwrap());
    let rough = compliant.clone().with_friction(CoulombFriction::try_new(0.4, 4e3, 30.0).unwrap());
    let plane = HalfSpace::try_new(Vector3::zeros(), Vector3::new(0.1, -0.2, 1.0)).unwrap();
    let hill = SphericalSurface::try_new(Vector3::new(0.1, 0.0, -2.0), 2.0, Solid::Inside).unwrap();
    let centre = Vector3::new(0.0, -0.05, 0.02);
    let corners =
        [-1.0, 1.0].iter().flat_map(|x| [-1.0, 1.0].map(|y| Vector3::new(0.1 * x, 0.15 * y, -0.05)));
    let scenes: [Vec<Contact>; 3] = [
        corners.map(|corner| Contact::try_new(corner, Arc::new(plane), rough.clone()).unwrap()).collect(),
        vec![Contact::try_ball(centre, 0.2, Arc::new(hill), rough.clone()).unwrap()],
        vec![Contact::try_rim(centre, Vector3::new(0.1, 0.9, 0.2), 0.25, plane, rough).unwrap()],
    ];
    let grid = TimeGrid::try_new(0.0, 0.4, 5e-4).unwrap();
    let by = Differentiation::by([Parameter::normal(0, "stiffness"), Parameter::friction(0, "coefficient")]);
    for (i, contacts) in scenes.into_iter().enumerate() {
        let named = contacts.iter().enumerate();
        let named = named.map(|(k, c)| LinkContact::new(format!("c{k}"), "body", c.clone())).collect();
        let tree = TreeInContact::try_new(TreeSystem::new(&model, passive()), named, vec![]).unwrap();
        let bodies = BodyInContact::new(body, (Gravity::earth(), Contacts::new(contacts)));
        let of_body = SensitivityRun::by_stepper(&bodies, &by, &RKMK8, grid);
        let of_body = of_body.locating(Location::as_given()).from(&start).unwrap();
        let found = SensitivityRun::by_stepper(&tree, &by, &RKMK8, grid);
        let found = found.locating(Location::as_given()).from(&of_tree).unwrap();
        assert!(found.run.event_count > 1, "{i}");
        assert_eq!(found.run.event_count, of_body.run.event_count);
        let (first, last) = (in_body_axes(&start), in_body_axes(&of_body.run.state));
        let dense = |m: SMatrix<f64, 12, 12>| DMatrix::from_column_slice(12, 12, m.as_slice());
        let expected = dense(last * of_body.state);
        let carried = &found.state * dense(first);
        let worst = (&carried - &expected).amax() / expected.amax();
        assert!(worst < 1e-8, "{i}, by the state: {worst:e}");
        for k in 0..2 {
            let expected = last * of_body.parameters.column(k);
            let worst = (found.parameters.column(k) - expected).amax() / expected.amax();
            assert!(worst < 1e-8, "{i}, by parameter {k}: {worst:e}");
        }
        let times = found.event_times.columns(0, 12) * dense(first);
        for (row, expected) in times.row_iter().zip(of_body.event_times.columns(0, 12).row_iter()) {
            let worst = (row - expected).amax() / expected.amax();
            assert!(worst < 1e-8 || expected[0].is_nan(), "{i}, times of events: {worst:e}");
        }
    }
}

/// Balls on an arm that hangs on a ball joint of a free body: they hit a sphere that another body carries, and each other. The
/// tree, its contacts, and where it starts.
pub(crate) fn touching_links() -> (Model, [LinkContact; 2], LinkPair, TreeState) {
    let solid = |mass: f64, moments: [f64; 3], center: Vector3<f64>| MassProperties {
        mass,
        center,
        inertia: Matrix3::from_diagonal(&Vector3::from(moments)),
    };
    let mut builder = Model::builder().with_gravity(Vector3::new(0.3, 0.1, -2.0));
    builder
        .add(Link::root("body", Joint::Free, solid(1.5, [0.05, 0.04, 0.03], Vector3::x() * 0.02)))
        .unwrap();
    let arm = solid(0.6, [0.01, 0.012, 0.006], -Vector3::z() * 0.15);
    builder.add(Link::child("arm", "body", Joint::Spherical, arm).at(-Vector3::z() * 0.1)).unwrap();
    let other = solid(0.4, [0.006, 0.007, 0.008], Vector3::y() * 0.03);
    builder.add(Link::child("other", "body", Joint::Free, other)).unwrap();
    let model = builder.build().unwrap();
    let law = ContactLaw::from(CompliantLaw::try_new(2e3, 6.0).unwrap())
        .with_friction(CoulombFriction::try_new(0.4, 2e3, 20.0).unwrap());
    let tip = -Vector3::z() * 0.3;
    let pair = LinkPair::try_new(
        "pair",
        ("arm", Vector3::new(0.01, 0.0, -0.21), 0.045),
        ("other", Vector3::zeros(), 0.08),
        law.clone(),
    );
    let ball = SphericalSurface::try_new(Vector3::zeros(), 0.08, Solid::Inside).unwrap();
    let on = Contact::try_ball(Vector3::z() * -0.2, 0.042, Arc::new(ball), law.clone()).unwrap();
    let on = LinkContact::new("on", "arm", on).on("other");
    let ground = Contact::try_ball(tip, 0.05, Arc::new(HalfSpace::ground()), law).unwrap();
    let ground = LinkContact::new("ground", "arm", ground);
    let turn = UnitQuaternion::new(Vector3::new(0.2, -0.3, 0.1));
    let swung = UnitQuaternion::new(Vector3::new(0.1, 0.15, -0.2));
    let place = [&[0.1, -0.2, 0.55][..], turn.coords.as_slice()].concat();
    let aside = [&[0.22, 0.04, -0.33][..], swung.coords.as_slice()].concat();
    let q = [place, swung.coords.as_slice().to_vec(), aside].concat();
    let v = [0.2, -0.1, -0.8, 0.5, 0.4, -0.3, 0.3, -0.9, 0.5, -1.6, 0.2, 0.3, 0.5, -0.6, 0.9];
    let start = model.state(&q, &v).unwrap();
    (model, [on, ground], pair.unwrap(), start)
}

#[test]
fn derivatives_of_links_that_touch_are_differences_of_runs() {
    let (model, on_surfaces, pair, start) = touching_links();
    let tree = TreeSystem::new(&model, passive());
    let system = TreeInContact::try_new(tree, on_surfaces.into(), vec![pair]).unwrap();
    let grid = TimeGrid::try_new(0.0, 0.3, 5e-4).unwrap();
    let found = differentiate(&system, &start, [], grid);
    let touched: Vec<_> = (0..3).filter(|i| found.run.events.iter().any(|e| e.guard == *i)).collect();
    assert_eq!(
        touched,
        [0, 1, 2],
        "{:?}",
        found.run.events.iter().map(|e| (e.t, e.guard)).collect::<Vec<_>>()
    );
    let worst = error_by_state(&system, &start, &found, grid);
    assert!(worst < 1e-7, "{worst:e}");
}

#[test]
fn a_tree_that_grazes_has_no_derivative() {
    let mut builder = Model::builder();
    let rod = MassProperties { mass: 1.0, center: Vector3::zeros(), inertia: Matrix3::identity() };
    builder.add(Link::root("slider", Joint::Prismatic { axis: Vector3::z() }, rod)).unwrap();
    let model = builder.build().unwrap();
    let ground = Arc::new(HalfSpace::ground());
    let law = CompliantLaw::try_new(1e4, 5.0).unwrap();
    let tip = LinkContact::new("tip", "slider", Contact::try_new(Vector3::zeros(), ground, law).unwrap());
    // Thrown upwards from above through the top of the lid: its highest point is just at the surface.
    let lid = HalfSpace::try_new(Vector3::z(), -Vector3::z()).unwrap();
    let lid =
        LinkContact::new("lid", "slider", Contact::try_new(Vector3::zeros(), Arc::new(lid), law).unwrap());
    let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), vec![tip, lid], vec![]).unwrap();
    let grid = TimeGrid::try_new(0.0, 0.6, 1e-3).unwrap();
    for (above, side) in [(1e-9, Side::Touching), (-1e-9, Side::Missing)] {
        let speed = f64::sqrt(2.0 * 9.81 * (0.5 + above));
        let start = model.state(&[0.5], &[speed]).unwrap();
        let by = Differentiation::default();
        let refused = SensitivityRun::new(&system, &by, Method::Rkmk8, grid).from(&start).unwrap_err();
        let Undifferentiated { reason, so_far } = *refused;
        let SensitivityError::Grazing(grazing) = reason else { panic!("{reason}") };
        assert_eq!((grazing.guard, grazing.side), (1, side));
        assert_eq!(so_far.state.shape(), (2, 2));
    }
    let by = |parameter| {
        let by = Differentiation::by([parameter]);
        let start = model.state(&[0.5], &[0.0]).unwrap();
        SensitivityRun::new(&system, &by, Method::Rkmk8, grid).from(&start).unwrap_err().reason
    };
    for parameter in [Parameter::Mass, Parameter::InertiaScale] {
        assert!(matches!(by(parameter), SensitivityError::NotOf { .. }));
    }
    assert!(matches!(by(Parameter::JointForce(1)), SensitivityError::NoJoint { n: 1, found: 1 }));
    assert!(matches!(by(Parameter::normal(2, "stiffness")), SensitivityError::NoSuchContact { .. }));
    assert!(matches!(by(Parameter::friction(0, "coefficient")), SensitivityError::NoFriction { .. }));
}
