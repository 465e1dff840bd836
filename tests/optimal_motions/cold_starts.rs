//! Pendulums on a cart, found from straight lines.
//!
//! The cart moves by a spline, the pendulums are passive and integrated by Runge–Kutta steps. Their states at nodes are
//! variables (multiple shooting), and the end is a constraint, not a penalty. A straight line from start to end, at rest
//! all the way, is all a solver is told.

use nalgebra::{Matrix3, Vector3};
use somersault_core::spline::UniformBasis;
use somersault_multibody::joint_motion::{Condition, EigenpostureBase, End, SplineMotion};
use somersault_multibody::models::CartPendulum;
use somersault_multibody::{Joint, Link, MassProperties, Model, Split};
use somersault_nlp::{Bounds, Flow, Globalisation, NlpSolver, Report, Sqp};
use somersault_ocp::dynamics::{CartPendulumDynamics, HybridDynamics, Tree};
use somersault_ocp::problem::{At, Loss, MotionProblem};
use somersault_ocp::shooting::{Duration, Phase, Shooting, ShootingOptions, Start};
use somersault_ocp::term::{Displacement, Entries, Part};
use somersault_ocp::transcription::Transcription;
use somersault_ocp::verification::verify;
use std::f64::consts::PI;
use std::time::Instant;

/// From rest to rest, the cart first among the positions; least ½ ∫ F² dt.
struct Task {
    name: &'static str,
    from: Vec<f64>,
    to: Vec<f64>,
    duration: f64,
    n_coefficients: usize,
    n_steps: usize,
    n_segments: usize,
    /// With the exact Hessian and a filter, or that of Gauss and Newton and a merit function.
    exact: bool,
}

impl Task {
    fn problem<D: HybridDynamics + Clone + 'static>(&self, dynamics: D) -> MotionProblem<Shooting<D>> {
        let n = self.from.len();
        let at = |end, derivative, value| Condition { end, derivative, value };
        let conditions = [
            at(End::Start, 0, self.from[0]),
            at(End::Start, 1, 0.0),
            at(End::Finish, 0, self.to[0]),
            at(End::Finish, 1, 0.0),
        ];
        let basis = UniformBasis::try_new(5, self.n_coefficients).unwrap();
        let phase = Phase {
            motion: SplineMotion::try_new(basis, EigenpostureBase::joints(1), &conditions).unwrap(),
            n_steps: self.n_steps,
            duration: Duration::Fixed(self.duration),
            n_segments: self.n_segments,
        };
        let start = Start::fixed(&self.from, &vec![0.0; n]);
        let shooting =
            Shooting::try_new(dynamics.clone(), start, vec![phase], ShootingOptions::default()).unwrap();
        let sizes = shooting.outline().sizes;
        let pendulums: Vec<usize> = (1..n).collect();
        let zero = || Bounds { lower: vec![0.0; n - 1], upper: vec![0.0; n - 1] };
        let force = Entries::try_new(&sizes, Part::Torque, &[0]).unwrap();
        let rates = Entries::try_new(&sizes, Part::Velocity, &pendulums).unwrap();
        MotionProblem::builder(shooting)
            .lagrange(force, Loss::half_squares(1))
            .and_then(|p| {
                p.constrain(At::End, Displacement::try_new(dynamics, &self.to, &pendulums)?, zero())
            })
            .and_then(|p| p.constrain(At::End, rates, zero()))
            .map(|p| if self.exact { p.with_exact_hessian() } else { p })
            .and_then(|p| p.build())
            .unwrap()
    }

    /// Cart and angles along straight lines, rates zero.
    fn straight<D: HybridDynamics>(&self, shooting: &Shooting<D>) -> Vec<f64> {
        let layout = shooting.layout();
        let mut z = vec![0.0; layout.n_variables];
        let last = (self.n_coefficients - 1) as f64;
        let line: Vec<f64> = (0..self.n_coefficients)
            .map(|k| self.from[0] + (self.to[0] - self.from[0]) * k as f64 / last)
            .collect();
        z[layout.parameters[0].clone()]
            .copy_from_slice(&shooting.motions().next().unwrap().parameters_of(&line));
        for (s, lifted) in (1..).zip(&layout.lifted) {
            let share = f64::from(s) / self.n_segments as f64;
            let ends = self.from.iter().zip(&self.to).skip(1);
            z[lifted.clone()].iter_mut().zip(ends).for_each(|(z, (from, to))| *z = share * (to - from));
        }
        z
    }

    /// Solves, and asserts that the motion is one: by its residuals, and by integrating it anew.
    fn expect_solved<D: HybridDynamics + Clone + 'static>(&self, dynamics: D, model: &Model) -> Report {
        let mut problem = self.problem(dynamics);
        let z = self.straight(problem.transcription());
        let began = Instant::now();
        let globalisation = if self.exact { Globalisation::Filter } else { Globalisation::Merit };
        let solver = Sqp { globalisation, ..Sqp::default() };
        let report = solver.solve(&mut problem, &z.into(), &mut |_| Flow::Continue).unwrap();
        let shooting = problem.transcription_mut();
        let verification = verify(shooting, model, &report.z).unwrap();
        let node = shooting.node(shooting.outline().n_nodes() - 1);
        let apart = node.position.iter().zip(&self.to).map(|(q, to)| (q - to).abs());
        let end = apart.chain(node.velocity.iter().map(|v| v.abs())).fold(0.0, f64::max);
        println!(
            "{:28} {} steps, {:.2} s, cost {:.6}, residual {:.1e}, end {end:.1e}: {}",
            self.name,
            report.iterations,
            began.elapsed().as_secs_f64(),
            report.cost,
            report.residuals.max(),
            verification.sentence(1e-4, None)
        );
        assert!(report.status.is_converged(), "{}: {}", self.name, report.status);
        assert!(report.residuals.max() < 1e-8, "{}: {:?}", self.name, report.residuals);
        assert!(end < 1e-7, "{}: {end}", self.name);
        assert!(verification.largest_defect() < 1e-6, "{}", verification.largest_defect());
        assert!(verification.terminal_error < 1e-4, "{}", verification.terminal_error);
        report
    }
}

#[test]
fn other_cart_pendulums_are_solved_from_straight_lines() {
    let system = |cart_mass, mass, length, gravity| CartPendulum { cart_mass, mass, length, gravity };
    let task = |name, from: [f64; 2], to: [f64; 2], duration| Task {
        name,
        from: from.to_vec(),
        to: to.to_vec(),
        duration,
        n_coefficients: 20,
        n_steps: 240,
        n_segments: 12,
        exact: false,
    };
    for (system, task) in [
        (system(1.4, 0.7, 0.6, 9.81), task("short, swing-up", [0.0, PI], [0.0, 0.0], 1.6)),
        (system(3.0, 0.4, 1.7, 9.81), task("long, swing-up to the side", [-1.0, PI], [0.5, 0.0], 3.0)),
        (system(0.5, 2.0, 0.9, 1.62), task("heavy, on the moon", [0.3, PI], [-0.4, 0.0], 4.0)),
        (system(2.0, 1.0, 0.5, 9.81), task("crane, hanging to hanging", [0.0, PI], [2.0, PI], 1.5)),
        (system(2.0, 1.0, 0.8, 9.81), task("upright to upright", [-1.0, 0.0], [1.0, 0.0], 2.0)),
        (system(1.0, 0.3, 0.4, 9.81), task("swing-down", [0.0, 0.0], [1.0, PI], 1.8)),
        (system(1.0, 0.3, 0.4, 9.81), task("a whole turn", [0.0, PI], [0.0, -PI], 2.0)),
    ] {
        let dynamics = CartPendulumDynamics::try_new(system).unwrap();
        task.expect_solved(dynamics, &system.model().unwrap());
    }
}

/// A cart with two rods; angles from the upright, the second from the first.
fn double_pendulum() -> Model {
    let hinge = Joint::Revolute { axis: Vector3::y() };
    // uniform and thin, about its middle
    let rod = |mass: f64, length: f64| {
        let across = mass * length * length / 12.0;
        MassProperties {
            mass,
            center: Vector3::new(0.0, 0.0, length / 2.0),
            inertia: Matrix3::from_diagonal(&Vector3::new(across, across, 0.0)),
        }
    };
    let cart = MassProperties::point(1.0, Vector3::zeros());
    let mut builder = Model::builder();
    for link in [
        Link::root("cart", Joint::Prismatic { axis: Vector3::x() }, cart),
        Link::child("lower", "cart", hinge, rod(0.4, 0.5)),
        Link::child("upper", "lower", hinge, rod(0.3, 0.6)).at(Vector3::new(0.0, 0.0, 0.5)),
    ] {
        builder.add(link).unwrap();
    }
    builder.build().unwrap()
}

#[test]
#[ignore = "Gauss–Newton steps from a straight line, of which `other_cart_pendulums_are_solved_from_straight_lines` is the short form, 10 s: `make studies` runs it"]
fn a_double_pendulum_on_a_cart_is_swung_up_from_a_straight_line() {
    let model = double_pendulum();
    let split = Split::new(vec![true, false, false]);
    let task = Task {
        name: "double pendulum, swing-up",
        from: vec![0.0, PI, 0.0],
        to: vec![0.0; 3],
        duration: 2.0,
        n_coefficients: 16,
        n_steps: 800,
        n_segments: 40,
        exact: false,
    };
    task.expect_solved(Tree::try_new(model.clone(), split).unwrap(), &model);
}

#[test]
fn exact_hessians_swing_a_double_pendulum_up() {
    swing_up_with_exact_hessians(&[(1.6, 20)]);
}

#[test]
#[ignore = "long form of `exact_hessians_swing_a_double_pendulum_up`, 10 s: `make studies` runs it"]
fn exact_hessians_swing_a_double_pendulum_up_over_horizons_and_segments() {
    swing_up_with_exact_hessians(&[(1.6, 20), (2.0, 40)]);
}

/// Some twenty steps for any horizon and number of segments; they decide which of many minima is found. Gauss–Newton
/// steps do not arrive in 1.6 s after 150.
fn swing_up_with_exact_hessians(horizons_and_segments: &[(f64, usize)]) {
    let model = double_pendulum();
    for &(duration, n_segments) in horizons_and_segments {
        let split = Split::new(vec![true, false, false]);
        let task = Task {
            name: "double pendulum, exact",
            from: vec![0.0, PI, 0.0],
            to: vec![0.0; 3],
            duration,
            n_coefficients: 16,
            n_steps: 800,
            n_segments,
            exact: true,
        };
        let report = task.expect_solved(Tree::try_new(model.clone(), split).unwrap(), &model);
        assert!(report.iterations <= 40, "{duration} s, {n_segments} segments: {}", report.iterations);
    }
}
