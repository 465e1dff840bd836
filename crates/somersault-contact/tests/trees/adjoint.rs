//! Gradients by the adjoint: those of the columns, to rounding.

use crate::gradients::touching_links;
use crate::parameters::{driven_leg, following_arm, knots};
use crate::{Torques, passive};
use crate::{drops::tree, in_contact};
use nalgebra::{Matrix3, Vector3};
use somersault_contact::contacts::Contact;
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::models::HoppingLeg;
use somersault_contact::sensitivity::{
    Differentiation, EndCost, Parameter, SensitivityError, SensitivityRun, TreeGradient, TreeSensitivities,
};
use somersault_contact::surface::{HalfSpace, Surface};
use somersault_contact::tree::{LinkContact, TreeInContact};
use somersault_core::random::SplitMix64;
use somersault_integrators::driver::{Adaptive, Flow, Steps, TimeGrid};
use somersault_integrators::events::Event;
use somersault_integrators::methods::Method;
use somersault_multibody::TreeParameter;
use somersault_multibody::motion::{JointDrive, TreeForces, TreeState, TreeSystem};
use somersault_testkit::trees::Random;
use std::sync::Arc;

/// Weights of a cost of the end of a run, and of the times of its events.
struct Weights {
    motion: Vec<f64>,
    velocity: Vec<f64>,
    times: Vec<f64>,
}

impl Weights {
    /// Any, but none on events that change nothing.
    fn any(found: &TreeSensitivities) -> Self {
        let mut random = SplitMix64::new(7);
        let mut some = |n: usize| (0..n).map(|_| 2.0 * random.unit() - 1.0).collect::<Vec<f64>>();
        let n = found.state.nrows() / 2;
        let (motion, velocity, mut times) = (some(n), some(n), some(found.run.events.len()));
        for (row, time) in found.event_times.row_iter().zip(&mut times) {
            if row.iter().any(|x| x.is_nan()) {
                *time = 0.0;
            }
        }
        Self { motion, velocity, times }
    }

    fn cost(&self) -> EndCost<'_> {
        EndCost { by_motion: &self.motion, by_velocity: &self.velocity, by_event_times: &self.times }
    }

    /// The gradient that the columns have.
    fn by_columns(&self, found: &TreeSensitivities) -> TreeGradient {
        let n = found.state.nrows();
        let end: Vec<f64> = self.motion.iter().chain(&self.velocity).copied().collect();
        let of = |k: usize| {
            let column = if k < n { found.state.column(k) } else { found.parameters.column(k - n) };
            let by_end: f64 = end.iter().zip(column.iter()).map(|(w, x)| w * x).sum();
            let rows = self.times.iter().zip(found.event_times.column(k)).filter(|(w, _)| **w != 0.0);
            by_end + rows.map(|(w, x)| w * x).sum::<f64>()
        };
        let all: Vec<f64> = (0..found.event_times.ncols()).map(of).collect();
        TreeGradient { state: all[..n].to_vec(), parameters: all[n..].to_vec(), running: 0.0 }
    }
}

/// The largest difference of two gradients, in each of the two parts in units of its largest number.
fn difference(a: &TreeGradient, b: &TreeGradient) -> f64 {
    let of = |a: &[f64], b: &[f64]| {
        let size = b.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        a.iter().zip(b).map(|(a, b)| (a - b).abs() / size).fold(0.0, f64::max)
    };
    of(&a.state, &b.state).max(of(&a.parameters, &b.parameters))
}

/// How far the adjoint is from the columns.
fn against_columns<F: TreeForces, D: JointDrive>(
    system: &TreeInContact<'_, F, D>,
    start: &TreeState,
    by: &Differentiation,
    (method, steps): (Method, Steps),
) -> (f64, u64) {
    let found = SensitivityRun::new(system, by, method, steps).from(start).unwrap();
    let mut recorded = SensitivityRun::new(system, by, method, steps).recorded_from(start).unwrap();
    assert_eq!(recorded.run().state, found.run.state, "{method}");
    let times =
        |events: &[Event<_, _>]| events.iter().map(|event| (event.t, event.guard)).collect::<Vec<_>>();
    assert_eq!(times(&recorded.run().events), times(&found.run.events));
    let weights = Weights::any(&found);
    let gradient = recorded.gradient(&weights.cost(), None, &mut |_| Flow::Continue).unwrap();
    (difference(&gradient, &weights.by_columns(&found)), found.run.event_count)
}

fn of_leg() -> Vec<Parameter> {
    let laws = [
        Parameter::normal(0, "stiffness"),
        Parameter::normal(0, "damping"),
        Parameter::friction(0, "coefficient"),
        Parameter::friction(0, "stiffness"),
        Parameter::JointForce(3),
        Parameter::Tree(TreeParameter::Mass(1)),
        Parameter::Tree(TreeParameter::Center(2, Vector3::new(0.3, 0.1, -0.8))),
        Parameter::Tree(TreeParameter::Inertia(0, Matrix3::identity())),
        Parameter::Tree(TreeParameter::Placement(2, Vector3::new(0.2, 0.0, -1.0))),
        Parameter::Tree(TreeParameter::Placement(0, Vector3::z())),
    ];
    laws.into_iter().chain(Parameter::joint_forces_at(4, &knots())).collect()
}

/// All explicit Runge–Kutta methods of the table.
const METHODS: [Method; 9] = [
    Method::Euler,
    Method::Mp,
    Method::Heun,
    Method::Rk4,
    Method::Rkmk,
    Method::Rkmk3,
    Method::Rkmk5,
    Method::Rkmk8,
    Method::Cf4,
];

#[test]
fn the_adjoint_of_a_hopping_leg_is_its_columns_by_every_method() {
    let leg = HoppingLeg::example().unwrap().system().unwrap();
    let (system, start) = (in_contact(&leg), leg.start().unwrap());
    let by = Differentiation::by(of_leg());
    for method in METHODS {
        let steps = TimeGrid::try_new(0.0, 0.12, 5e-4).unwrap().into();
        let (worst, events) = against_columns(&system, &start, &by, (method, steps));
        assert!(events > 1, "{method}: {events}");
        assert!(worst < 1e-10, "{method}: {worst:e}");
    }
    let steps = Steps::adapted((0.0, 0.3), Adaptive::with_tolerances(1e-8, 1e-8));
    let (worst, events) = against_columns(&system, &start, &by, (Method::Rkmk8, steps));
    assert!(events > 3 && worst < 1e-10, "{events} {worst:e}");
}

#[test]
fn the_adjoint_of_links_that_touch_is_their_columns() {
    let (model, on_surfaces, pair, start) = touching_links();
    let spring: Torques = Box::new(|_: f64, q: &[f64], v: &[f64], torque: &mut [f64]| {
        torque[6] -= 2.0 * q[7] + 0.1 * v[6];
        torque[7] += 0.3 * v[0] * v[13];
    });
    let by = Differentiation::by([
        Parameter::normal(0, "stiffness"),
        Parameter::friction(2, "coefficient"),
        Parameter::friction(1, "damping"),
        Parameter::JointForce(2),
        Parameter::JointForce(11),
        Parameter::Tree(TreeParameter::Mass(1)),
        Parameter::Tree(TreeParameter::Center(2, Vector3::new(0.3, 0.1, -0.8))),
        Parameter::Tree(TreeParameter::Placement(1, Vector3::new(0.2, 0.4, -1.0))),
        Parameter::Tree(TreeParameter::Placement(2, Vector3::new(0.2, 0.4, -1.0))),
        Parameter::Tree(TreeParameter::Placement(0, Vector3::new(0.2, 0.4, -1.0))),
    ]);
    let steps: Steps = TimeGrid::try_new(0.0, 0.25, 1e-3).unwrap().into();
    let free =
        TreeInContact::try_new(TreeSystem::new(&model, passive()), on_surfaces.to_vec(), vec![pair.clone()]);
    let (worst, events) = against_columns(&free.unwrap(), &start, &by, (Method::Rkmk8, steps));
    assert!(events > 4 && worst < 1e-10, "{events} {worst:e}");
    // Forces that depend on the state are differentiated by differences, of which each direction has its own rounding.
    let sprung = TreeInContact::try_new(TreeSystem::new(&model, spring), on_surfaces.to_vec(), vec![pair]);
    let (worst, _) = against_columns(&sprung.unwrap(), &start, &by, (Method::Rkmk5, steps));
    assert!(worst < 1e-8, "{worst:e}");
}

/// Trees that fall onto a slope from 5 mm above it, by numbers of any of their links, joints and contacts.
#[test]
fn the_adjoint_of_random_trees_is_their_columns() {
    let mut random = Random::new(4);
    let mut all = 0;
    for case in 0..6 {
        let model = tree(&mut random, 2 + case % 3);
        let n = model.n_bodies();
        let slope = HalfSpace::try_new(Vector3::zeros(), Vector3::z() + random.vector(0.2)).unwrap();
        let slope: Arc<dyn Surface> = Arc::new(slope);
        let law = ContactLaw::from(CompliantLaw::try_new(3e3, 10.0).unwrap())
            .with_friction(CoulombFriction::try_new(random.within(0.1, 0.8), 2e3, 20.0).unwrap());
        let mut contact = |i: usize| {
            let ball = Contact::try_ball(random.vector(0.25), 0.05, slope.clone(), law.clone()).unwrap();
            LinkContact::new(format!("c{i}"), format!("b{}", i % n), ball)
        };
        let contacts: Vec<_> = (0..n + 1).map(&mut contact).collect();
        let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), contacts, vec![]).unwrap();
        let mut q = model.neutral();
        model.displace(&model.neutral(), &random.numbers(model.n_velocities(), 1.0), &mut q).unwrap();
        let v = random.numbers(model.n_velocities(), 2.0);
        let gaps = system.touches(&system.unstretched(model.state(&q, &v).unwrap()));
        q[2] += 5e-3 - gaps.iter().fold(f64::INFINITY, |least, touch| least.min(touch.gap));
        let start = model.state(&q, &v).unwrap();
        let mut body = || random.below(n);
        let [mass, center, inertia, placement] = [body(), body(), body(), body()];
        let by = Differentiation::by([
            Parameter::normal(random.below(n), "stiffness"),
            Parameter::friction(random.below(n), "coefficient"),
            Parameter::JointForce(random.below(model.n_velocities())),
            Parameter::Tree(TreeParameter::Mass(mass)),
            Parameter::Tree(TreeParameter::Center(center, random.vector(1.0))),
            Parameter::Tree(TreeParameter::Inertia(inertia, Matrix3::from_diagonal(&random.vector(1.0)))),
            Parameter::Tree(TreeParameter::Placement(placement, random.vector(1.0))),
        ]);
        let steps = TimeGrid::try_new(0.0, 0.12, 1e-3).unwrap().into();
        let (worst, events) = against_columns(&system, &start, &by, (Method::Rkmk5, steps));
        assert!(worst < 1e-10, "{case}: {worst:e}");
        all += events;
    }
    assert!(all > 12, "{all}");
}

#[test]
fn the_adjoint_of_joints_that_follow_others_is_their_columns() {
    let (model, tip, start) = following_arm();
    let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), vec![tip], vec![]).unwrap();
    let by = Differentiation::by([
        Parameter::friction(0, "coefficient"),
        Parameter::JointForce(1),
        Parameter::Tree(TreeParameter::Center(2, Vector3::new(0.3, 0.1, -0.8))),
        Parameter::Tree(TreeParameter::Placement(2, Vector3::new(0.2, 0.0, -1.0))),
    ]);
    let steps = TimeGrid::try_new(0.0, 0.4, 1e-3).unwrap().into();
    let (worst, events) = against_columns(&system, &start, &by, (Method::Rkmk8, steps));
    assert!(events > 2 && worst < 1e-10, "{events} {worst:e}");
}

#[test]
fn the_adjoint_of_a_leg_with_a_driven_joint_is_its_columns() {
    let model = HoppingLeg::example().unwrap().model().unwrap();
    let (system, start) = driven_leg(&model);
    let steps = TimeGrid::try_new(0.0, 0.25, 1e-3).unwrap().into();
    let (worst, events) =
        against_columns(&system, &start, &Differentiation::by(of_leg()), (Method::Rkmk8, steps));
    assert!(events > 3 && worst < 1e-8, "{events} {worst:e}");
}

/// ∫ q̇ dt is q, by the weights of the method and through all events.
#[test]
fn the_gradient_of_a_running_cost_is_that_of_what_it_gathers() {
    let leg = HoppingLeg::example().unwrap().system().unwrap();
    let (system, start) = (in_contact(&leg), leg.start().unwrap());
    let by = Differentiation::by(of_leg());
    let grid = TimeGrid::try_new(0.0, 0.2, 1e-3).unwrap();
    let mut recorded = SensitivityRun::new(&system, &by, Method::Rkmk8, grid).recorded_from(&start).unwrap();
    let (none, mut knee) = ([0.0; 5], [0.0; 5]);
    knee[4] = 1.0;
    let of_end = |by_motion| EndCost { by_motion, by_velocity: &none, by_event_times: &[] };
    let mut watch = |_: f64| Flow::Continue;
    let at_end = recorded.gradient(&of_end(&knee), None, &mut watch).unwrap();
    let mut integrand = |_: f64, _: &[f64], v: &[f64], [_, by_velocity]: [&mut [f64]; 2]| {
        by_velocity[4] = 1.0;
        v[4]
    };
    let gathered = recorded.gradient(&of_end(&none), Some(&mut integrand), &mut watch).unwrap();
    let way = recorded.run().state.configuration.0.as_slice()[4] - start.configuration.as_slice()[4];
    assert!((gathered.running - way).abs() < 1e-13, "{} {way}", gathered.running);
    let mut of_way = at_end.clone();
    of_way.state[4] -= 1.0;
    let worst = difference(&gathered, &of_way);
    assert!(worst < 1e-11, "{worst:e}");
}

#[test]
fn what_has_no_adjoint_is_refused() {
    let leg = HoppingLeg::example().unwrap().system().unwrap();
    let (system, start) = (in_contact(&leg), leg.start().unwrap());
    let by = Differentiation::default();
    let grid = TimeGrid::try_new(0.0, 0.02, 1e-3).unwrap();
    for (method, name) in [(Method::Ab4, "ab4"), (Method::Radau5, "radau5"), (Method::Sv, "sv")] {
        let refused = SensitivityRun::new(&system, &by, method, grid).recorded_from(&start).unwrap_err();
        assert!(refused.so_far.is_none());
        let (SensitivityError::NoAdjoint { method } | SensitivityError::Method { method }) = refused.reason
        else {
            panic!("{}", refused.reason)
        };
        assert_eq!(method, name);
    }
    let mut recorded = SensitivityRun::new(&system, &by, Method::Rkmk, grid).recorded_from(&start).unwrap();
    let none = [0.0; 5];
    let cost = EndCost { by_motion: &none, by_velocity: &none, by_event_times: &[] };
    for wrong in [
        EndCost { by_motion: &none[..4], ..cost },
        EndCost { by_velocity: &[], ..cost },
        EndCost { by_event_times: &none, ..cost },
    ] {
        let refused = recorded.gradient(&wrong, None, &mut |_| Flow::Continue).unwrap_err();
        assert!(matches!(refused, SensitivityError::Tree(_)), "{refused}");
    }
    let infinite = EndCost { by_motion: &[f64::INFINITY; 5], ..cost };
    let refused = recorded.gradient(&infinite, None, &mut |_| Flow::Continue).unwrap_err();
    assert_eq!(refused, SensitivityError::NonFinite);
    let stopped = recorded.gradient(&cost, None, &mut |_| Flow::Stop).unwrap_err();
    assert!(matches!(stopped, SensitivityError::Stopped { t } if (t - 0.019).abs() < 1e-12), "{stopped}");
}
