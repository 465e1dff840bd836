//! Trees with ball and free joints: derivatives, ends, guesses, and the fastest turn of a rigid body.

use super::derivatives::check;
use nalgebra::{DMatrix, Matrix3, Vector3};
use num_dual::{Dual64, HyperDual64};
use somersault_core::Scalar;
use somersault_multibody::{Data, Joint, Link, MassProperties, Model, ModelBuilder};
use somersault_nlp::Flow;
use somersault_ocp::arcs::{Polish, Polished, Verdict};
use somersault_ocp::collocation::{
    Collocation, CollocationError, CollocationReport, CollocationStatus, Dynamics, Ends, Guess, Interval,
    Linkage, Mesh, Phase, Point, Problem, Terms, TreeDynamics, VectorFunction,
};
use somersault_testkit::trees::{Random, random_configuration, random_tree};
use std::f64::consts::{PI, TAU};

/// Least time for the costs, and constraints in which every state occurs.
#[derive(Clone, Copy)]
enum Cost {
    Time,
    Effort,
    Tangle,
}

impl Terms for Cost {
    fn n_path_constraints(&self) -> usize {
        usize::from(matches!(self, Self::Tangle))
    }
    fn n_end_constraints(&self) -> usize {
        self.n_path_constraints()
    }
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let effort = at.control.iter().fold(T::zero(), |sum, &u| sum + u * u);
        let half: T = nalgebra::convert(0.5);
        match self {
            Self::Time => T::zero(),
            Self::Effort => effort * half,
            Self::Tangle => effort + wave(at.state) * at.control[0],
        }
    }
    fn path_constraints<T: Scalar>(&self, at: &Point<'_, T>, values: &mut [T]) {
        values.iter_mut().for_each(|value| *value = wave(at.state));
    }
    fn end_cost<T: Scalar>(&self, ends: &Ends<'_, T>) -> T {
        match self {
            Self::Time => ends.final_time - ends.initial_time,
            Self::Effort => T::zero(),
            Self::Tangle => wave(ends.final_state) * ends.initial_state[0],
        }
    }
    fn end_constraints<T: Scalar>(&self, ends: &Ends<'_, T>, values: &mut [T]) {
        values.iter_mut().for_each(|value| *value = wave(ends.final_state) + wave(ends.initial_state));
    }
}

/// Something of which all entries have curvature.
fn wave<T: Scalar>(x: &[T]) -> T {
    let weighed = x.iter().zip(1..).map(|(x, k)| *x * nalgebra::convert::<f64, T>(0.3 * f64::from(k)));
    weighed.fold(T::zero(), |sum, x| sum + x).sin()
}

/// q̇ and v̇ by the arithmetic of another scalar.
fn rates<T: Scalar>(model: &Model<T>, x: &[T], u: &[T], actuated: &[usize]) -> Vec<T> {
    let (q, v) = x.split_at(model.n_positions());
    let mut torque = vec![T::zero(); v.len()];
    actuated.iter().zip(u).for_each(|(k, u)| torque[*k] = *u);
    let (mut unit, mut rates) = (q.to_vec(), vec![T::zero(); q.len()]);
    model.normalize(&mut unit).unwrap();
    model.position_rates(q, v, &mut rates).unwrap();
    let mut data = Data::new(model);
    rates.extend(model.forward_dynamics(&mut data, &unit, v, &torque, &[]).unwrap());
    rates
}

#[test]
fn derivatives_of_random_trees_with_ball_and_free_joints_are_those_of_dual_numbers() {
    let mut random = Random::new(5);
    for _ in 0..6 {
        let model = random_tree(&mut random, 4, 0.2).unwrap();
        let n = model.n_velocities();
        let actuated: Vec<usize> = (0..n).filter(|k| k % 2 == 0).collect();
        let mut tree = TreeDynamics::try_new(&model, &actuated).unwrap();
        let mut x = random_configuration(&mut random, &model).unwrap();
        // a quaternion of another norm is the same orientation
        for first in tree.quaternions() {
            x[first..first + 4].iter_mut().for_each(|x| *x *= 1.3);
        }
        x.extend(random.numbers(n, 1.0));
        let (n_states, u) = (x.len(), random.numbers(actuated.len(), 1.0));
        assert_eq!([n_states, u.len()], [tree.n_states(), tree.n_controls()]);
        let arguments: Vec<f64> = x.iter().chain(&u).copied().collect();
        let n_arguments = arguments.len();
        let weights = random.numbers(n_states, 1.0);
        let (mut jacobian, mut hessian) =
            (DMatrix::zeros(n_states, n_arguments), DMatrix::zeros(n_arguments, n_arguments));
        let mut values = vec![0.0; n_states];
        tree.evaluate(&arguments, &mut values).unwrap();
        tree.jacobian(&arguments, &mut jacobian).unwrap();
        tree.add_hessian(&arguments, &weights, &mut hessian).unwrap();
        let scale = 1.0 + jacobian.amax();
        let dual: Model<Dual64> = model.cast();
        let hyper: Model<HyperDual64> = model.cast();
        for j in 0..n_arguments {
            let mut moved: Vec<Dual64> = arguments.iter().map(|x| Dual64::from_re(*x)).collect();
            moved[j].eps = 1.0;
            let found = rates(&dual, &moved[..n_states], &moved[n_states..], &actuated);
            for (i, found) in found.iter().enumerate() {
                assert!((found.re - values[i]).abs() < 1e-9 * scale);
                assert!((found.eps - jacobian[(i, j)]).abs() < 1e-9 * scale, "{i} by {j}");
            }
            for i in 0..=j {
                let mut moved: Vec<HyperDual64> =
                    arguments.iter().map(|x| HyperDual64::from_re(*x)).collect();
                moved[j].eps1 = 1.0;
                moved[i].eps2 = 1.0;
                let found = rates(&hyper, &moved[..n_states], &moved[n_states..], &actuated);
                let found: f64 = found.iter().zip(&weights).map(|(y, w)| y.eps1eps2 * w).sum();
                let error = (found - hessian[(i, j)]).abs();
                assert!(error < 1e-8 * (scale + found.abs()), "{i}, {j}: {error}");
            }
        }
    }
}

#[test]
fn rates_of_positions_are_those_of_displacements_and_derivatives_go_back() {
    let mut random = Random::new(7);
    for _ in 0..20 {
        let model = random_tree(&mut random, 5, 0.0).unwrap();
        let (n, m) = (model.n_positions(), model.n_velocities());
        let q = random_configuration(&mut random, &model).unwrap();
        let (v, h) = (random.numbers(m, 1.0), 1e-5);
        let mut found = vec![0.0; n];
        model.position_rates(&q, &v, &mut found).unwrap();
        let [ahead, behind] = [h, -h].map(|h| {
            let step: Vec<f64> = v.iter().map(|v| h * v).collect();
            let mut out = vec![0.0; n];
            model.displace(&q, &step, &mut out).unwrap();
            out
        });
        let differences = ahead.iter().zip(&behind).map(|(a, b)| (a - b) / (2.0 * h));
        assert!(found.iter().zip(differences).all(|(a, b)| (a - b).abs() < 1e-8));
        // gᵀ q̇ = (Nᵀ g)ᵀ v
        let (g, mut along) = (random.numbers(n, 1.0), vec![0.0; m]);
        model.derivatives_along(&q, &g, &mut along).unwrap();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        assert!((dot(&g, &found) - dot(&along, &v)).abs() < 1e-12);
    }
}

/// A rigid body of unit inertia on a ball joint.
fn ball() -> Model {
    let mass = MassProperties { mass: 1.0, center: Vector3::zeros(), inertia: Matrix3::identity() };
    let mut builder = ModelBuilder::new().with_gravity(Vector3::zeros());
    builder.add(Link::root("hub", Joint::Spherical, mass)).unwrap();
    builder.build().unwrap()
}

fn turning(cost: Cost) -> Phase {
    Phase::of_tree(TreeDynamics::try_fully_actuated(&ball()).unwrap(), cost)
}

#[test]
fn derivatives_of_programs_with_quaternions_are_exact() {
    let mut random = Random::new(11);
    let model = random_tree(&mut random, 3, 0.1).unwrap();
    let tree = TreeDynamics::try_fully_actuated(&model).unwrap();
    let [n, m] = [model.n_positions(), model.n_velocities()];
    let mut last = random_configuration(&mut random, &model).unwrap();
    last.extend(vec![0.0; m]);
    let mut phase = Phase::of_tree(tree, Cost::Tangle)
        .final_state(last.clone())
        .horizon(0.0, Interval::new(1.0, 2.0))
        .path_bounds([Interval::new(-1.0, 1.0)])
        .end_bounds([Interval::fixed(0.1)]);
    // orientations free at the start need their norms, those given at the end leave them free
    check(&mut Problem::try_new(phase).unwrap(), &[Mesh::try_uniform(1, 2).unwrap()]);
    let mut first = model.neutral();
    first.extend(vec![0.1; m]);
    phase = turning(Cost::Tangle)
        .initial_state([0.0, 0.0, 0.0, 1.0, 0.1, 0.2, 0.3])
        .path_bounds([Interval::new(-1.0, 1.0)])
        .end_bounds([Interval::fixed(0.1)]);
    check(&mut Problem::try_new(phase).unwrap(), &[Mesh::try_uniform(2, 2).unwrap()]);
    assert_eq!(n, first.len() - m);
}

fn solved(phases: Vec<Phase>, links: Vec<Linkage>, tolerance: f64) -> CollocationReport {
    with_problem(phases, links, tolerance).1
}

fn with_problem(phases: Vec<Phase>, links: Vec<Linkage>, tolerance: f64) -> (Problem, CollocationReport) {
    let meshes = vec![Mesh::try_uniform(20, 3).unwrap(); phases.len()];
    let mut problem = Problem::try_of_phases(phases, links).unwrap();
    let collocation = Collocation { tolerance, ..Collocation::default() };
    let found = collocation.solve(&mut problem, &meshes, &mut |_| Flow::Continue).unwrap();
    assert_eq!(found.status, CollocationStatus::Converged);
    (problem, found)
}

fn polished(phase: Phase, tolerance: f64) -> Polished {
    let (mut problem, report) = with_problem(vec![phase], Vec::new(), tolerance);
    Polish::default().polish(&mut problem, &report).unwrap()
}

/// Bilimoria and Wie's turn by 180° in least time, J. Guid. Control Dyn. 16 (1993), 446: 3.24308327745233 by multi-arc shooting.
fn fastest(phase: Phase, last: [f64; 4], start: f64, tolerance: f64) -> CollocationReport {
    solved(vec![fast(phase, last, start)], Vec::new(), tolerance)
}

fn fast(phase: Phase, last: [f64; 4], start: f64) -> Phase {
    let sine = |a: f64, halves: f64, s: f64| a * (halves * PI * s).sin();
    let rows: Vec<f64> = (0..9).map(|i| f64::from(i) / 8.0).collect();
    let state =
        |s: &f64| vec![0.0, 0.0, 0.0, 0.0, sine(0.5, 2.0, *s), sine(0.5, 1.0, *s), sine(1.6, 1.0, *s)];
    let guess = Guess {
        times: rows.iter().map(|s| start + 3.3 * s).collect(),
        states: rows.iter().map(state).collect(),
        controls: vec![vec![0.0; 3]; 9],
        parameters: Vec::new(),
    };
    phase
        .initial_state([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        .final_state(last.into_iter().chain([0.0; 3]))
        .horizon(start, Interval::new(start + 1.0, start + 6.0))
        .control_bounds([Interval::new(-1.0, 1.0); 3])
        .guess(guess)
}

/// The same body by hand.
struct Body;

impl Dynamics for Body {
    fn n_states(&self) -> usize {
        7
    }
    fn n_controls(&self) -> usize {
        3
    }
    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        let half: T = nalgebra::convert(0.5);
        let [x, y, z, w, a, b, c] = std::array::from_fn(|k| at.state[k]);
        rates[0] = half * (w * a + y * c - z * b);
        rates[1] = half * (w * b + z * a - x * c);
        rates[2] = half * (w * c + x * b - y * a);
        rates[3] = -half * (x * a + y * b + z * c);
        rates[4..].copy_from_slice(at.control);
    }
}

#[test]
fn the_fastest_half_turn_is_that_of_bilimoria_and_wie_whatever_the_sign_or_the_time() {
    let exact = 3.24308327745233;
    let found = fastest(turning(Cost::Time), [0.0, 0.0, 1.0, 0.0], 0.0, 1e-4);
    assert!((found.cost - exact).abs() < 1e-6, "{}", found.cost - exact);
    let other = fastest(turning(Cost::Time), [0.0, 0.0, -1.0, 0.0], 0.0, 1e-4);
    assert_eq!(found.cost, other.cost);
    let later = fastest(turning(Cost::Time), [0.0, 0.0, 1.0, 0.0], 1e4, 1e-4);
    assert!((found.cost - later.cost).abs() < 1e-9);
    let by_hand = Phase::new(Body, Cost::Time).quaternions([0]);
    assert!((fastest(by_hand, [0.0, 0.0, 1.0, 0.0], 0.0, 1e-4).cost - found.cost).abs() < 1e-9);
    // the costate is orthogonal to the quaternion, whose norm stays
    let phase = &found.phases[0];
    for (x, costate) in phase.states.iter().zip(&phase.costates) {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).take(4).map(|(a, b)| a * b).sum::<f64>();
        assert!((dot(x, x) - 1.0).abs() < 1e-5 && dot(x, costate).abs() < 1e-4);
    }
}

#[test]
fn a_half_turn_from_a_straight_line_leaves_the_turn_about_the_axis() {
    let phase = turning(Cost::Time)
        .initial_state([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        .final_state([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
        .horizon(0.0, Interval::new(1.0, 6.0))
        .control_bounds([Interval::new(-1.0, 1.0); 3]);
    let found = solved(vec![phase], Vec::new(), 1e-4);
    assert!((found.cost - 3.24308327745233).abs() < 1e-6, "{}: {:?}", found.cost, found.history);
    // the turn about the axis is an extremal: a saddle
    let saddle = &found.history[0];
    assert!(saddle.is_start && (saddle.cost - 2.0 * PI.sqrt()).abs() < 1e-3, "{}", saddle.cost);
    assert!(found.origin.contains("saddle of cost 3.54"), "{}", found.origin);
}

#[test]
fn phases_continue_an_orientation_and_ends_may_be_free() {
    let rest = [Interval::fixed(0.0); 3];
    let open = |v: [Interval; 3]| [Interval::FREE; 4].into_iter().chain(v);
    let at = |half: f64, v: [Interval; 3]| {
        [0.0, 0.0, half.sin(), half.cos()].map(Interval::fixed).into_iter().chain(v)
    };
    // a right angle there in a second, and from there to two; both signs are in use
    let there = turning(Cost::Effort)
        .initial_state(at(0.0, rest))
        .final_state(at(PI + PI / 4.0, [Interval::FREE; 3]));
    let back = turning(Cost::Effort).horizon(1.0, 2.0).final_state(at(PI / 2.0, rest));
    let found = solved(vec![there, back], Linkage::continuous(0, 1, 7), 1e-6);
    // 12 d²/T³ ½ from rest to rest over π in two seconds
    assert!((found.cost - 0.5 * 12.0 * PI * PI / 8.0).abs() < 1e-6, "{}", found.cost);
    // or the second phase says where it starts, or both do
    let anything = [Interval::FREE; 3];
    let middle = |half: f64| at(half, anything).collect::<Vec<_>>();
    for first in [open(anything).collect(), middle(PI / 4.0)] {
        let there = turning(Cost::Effort).initial_state(at(0.0, rest)).final_state(first);
        let back = turning(Cost::Effort).horizon(1.0, 2.0).initial_state(middle(PI + PI / 4.0));
        let legs = vec![there, back.final_state(at(PI / 2.0, rest))];
        let other = solved(legs, Linkage::continuous(0, 1, 7), 1e-6);
        assert!((found.cost - other.cost).abs() < 1e-8);
    }
    // from an orientation that is free
    let spin = [0.0, 0.0, 1.0].map(Interval::fixed);
    let stopped = turning(Cost::Effort).initial_state(open(spin)).final_state(at(1.0, rest));
    assert!((solved(vec![stopped], Vec::new(), 1e-6).cost - 0.5).abs() < 1e-8);
}

#[test]
fn what_is_no_quaternion_is_refused() {
    let given =
        |q: [f64; 4]| Problem::try_new(turning(Cost::Effort).final_state(q.into_iter().chain([0.0; 3])));
    let error = given([0.0, 0.0, 0.9, 0.0]).err().unwrap();
    assert!(matches!(error, CollocationError::NotUnit { argument: "final_state", .. }), "{error}");
    assert!(error.to_string().contains("q_hub_x"), "{error}");
    assert!(given([0.0; 4]).is_err());
    // four digits are enough
    assert!(given([0.0, 0.0, 0.5547, 0.8321]).is_ok());
    for first in [vec![4], vec![0, 2], vec![9]] {
        let phase = Phase::new(Body, Cost::Effort).quaternions(first);
        assert!(matches!(Problem::try_new(phase), Err(CollocationError::Quaternions { .. })));
    }
}

#[test]
fn the_fastest_half_turn_is_polished_to_the_last_digits_and_is_a_minimum() {
    let found = polished(fast(turning(Cost::Time), [0.0, 0.0, 1.0, 0.0], 0.0), 1e-4);
    assert!(found.verdict == Verdict::StrictMinimum && found.residual < 1e-10, "{}", found.verdict);
    assert!((found.cost - 3.24308327745233).abs() < 1e-13, "{}", found.cost);
    assert_eq!(found.arcs.len(), 6);
    // the norm of a quaternion stays, and its costate is orthogonal to it
    for t in [0.0, 0.7, 1.9, 3.2] {
        let at = found.at(t).unwrap();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).take(4).map(|(a, b)| a * b).sum::<f64>();
        assert!((dot(&at.state, &at.state) - 1.0).abs() < 1e-12 && dot(&at.state, &at.costate).abs() < 1e-12);
    }
}

/// q̇ = ½ q ω with ω for a control, whose least effort is a turn about one axis at one rate.
struct Spin;

impl Dynamics for Spin {
    fn n_states(&self) -> usize {
        4
    }
    fn n_controls(&self) -> usize {
        3
    }
    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        let (q, w) = (at.state, at.control);
        let half: T = nalgebra::convert(0.5);
        rates[0] = (q[3] * w[0] + q[1] * w[2] - q[2] * w[1]) * half;
        rates[1] = (q[3] * w[1] + q[2] * w[0] - q[0] * w[2]) * half;
        rates[2] = (q[3] * w[2] + q[0] * w[1] - q[1] * w[0]) * half;
        rates[3] = -(q[0] * w[0] + q[1] * w[1] + q[2] * w[2]) * half;
    }
}

#[test]
fn a_quaternion_of_four_numbers_is_turned_though_its_norm_is_given_at_both_ends() {
    let phase = Phase::new(Spin, Cost::Effort).initial_state([0.0, 0.0, 0.0, 1.0]).final_state([
        0.0,
        0.0,
        0.5f64.sqrt(),
        0.5f64.sqrt(),
    ]);
    let found = solved(vec![phase], Vec::new(), 1e-6);
    assert!((found.cost - PI * PI / 8.0).abs() < 1e-8, "{}", found.cost);
    let steps: usize = found.history.iter().map(|mesh| mesh.iterations).sum();
    assert!(steps < 60, "{:?}", found.history);
}

#[test]
fn turns_beyond_a_whole_one_have_a_conjugate_point_after_a_whole_one() {
    // geodesics of rotations: great circles of the quaternions, which meet again at −q, after a turn by 2π
    let spun = |turns: f64| {
        let angle = |s: f64| 0.5 * turns * TAU * s;
        let rows: Vec<f64> = (0..33).map(|i| f64::from(i) / 32.0).collect();
        let guess = Guess {
            times: rows.clone(),
            states: rows.iter().map(|s| vec![0.0, 0.0, angle(*s).sin(), angle(*s).cos()]).collect(),
            controls: vec![vec![0.0, 0.0, turns * TAU]; 33],
            parameters: Vec::new(),
        };
        let phase = Phase::new(Spin, Cost::Effort)
            .quaternions([0])
            .initial_state([0.0, 0.0, 0.0, 1.0])
            .final_state([0.0, 0.0, angle(1.0).sin(), angle(1.0).cos()])
            .guess(guess);
        let found = polished(phase, 1e-6);
        assert!((found.cost - 0.5 * (turns * TAU).powi(2)).abs() < 1e-9, "{}", found.cost);
        found.verdict
    };
    assert_eq!(spun(0.9), Verdict::StrictMinimum);
    let Verdict::ConjugatePoint { time } = spun(1.25) else { panic!("no conjugate point") };
    assert!((time - 0.8).abs() < 1e-8, "{time}");
}

#[test]
fn a_body_that_turns_freely_at_its_end_is_polished() {
    // what remains free: the orientation at the end, with a cost, and the rates
    struct Aim;
    impl Terms for Aim {
        fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
            Cost::Effort.running_cost(at)
        }
        fn end_cost<T: Scalar>(&self, ends: &Ends<'_, T>) -> T {
            let x = ends.final_state;
            (x[0] - nalgebra::convert(0.5)).powi(2) + (x[1] - nalgebra::convert(0.1)).powi(2) + x[4] * x[4]
        }
    }
    let mass = MassProperties {
        mass: 1.0,
        center: Vector3::zeros(),
        inertia: Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 2.5)),
    };
    let mut builder = ModelBuilder::new().with_gravity(Vector3::zeros());
    builder.add(Link::root("hub", Joint::Spherical, mass)).unwrap();
    let tree = TreeDynamics::try_fully_actuated(&builder.build().unwrap()).unwrap();
    let phase = || {
        Phase::of_tree(tree.clone(), Aim).initial_state([0.0, 0.0, 0.0, 1.0, 0.3, 0.0, 0.0]).horizon(0.0, 1.0)
    };
    let found = polished(phase(), 1e-6);
    assert!(found.verdict == Verdict::StrictMinimum && found.residual < 1e-10, "{}", found.verdict);
    let fine = solved(vec![phase()], Vec::new(), 1e-9);
    assert!((found.cost - fine.cost).abs() < 1e-9, "{} {}", found.cost, fine.cost);
}
