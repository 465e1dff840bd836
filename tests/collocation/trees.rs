//! Trees as expressions: what they are, and the arcs that are made of them.

use crate::solution_methods::chain;
use nalgebra::{DMatrix, Matrix3, Vector3};
use num_dual::{Dual64, HyperDual64};
use somersault_core::Scalar;
use somersault_core::cancel::CancellationToken;
use somersault_core::scalar::constant;
use somersault_expr::{Block, ExprError, ExprFunction, Traced};
use somersault_multibody::models::TwoLinkArm;
use somersault_multibody::{Data, Joint, Link, MassProperties, Model, ModelBuilder};
use somersault_nlp::Flow;
use somersault_ocp::arcs::{Polish, Polished, Verdict};
use somersault_ocp::collocation::{
    AtUnitQuaternions, Collocation, Dynamics, Interval, Mesh, Phase, Point, Problem, Stacked, Terms,
    TracedFunction, TreeDynamics, VectorFunction,
};
use somersault_ocp::solver::{SolutionMethod, Solver, SolverResult, StartFrom};
use somersault_testkit::trees::{Random, random_configuration, random_tree};
use std::f64::consts::{FRAC_PI_2, PI};

/// ½ Σ wᵢ uᵢ².
struct Effort(Vec<f64>);

impl Terms for Effort {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let parts = at.control.iter().zip(&self.0).map(|(u, w)| *u * *u * constant(0.5 * w));
        parts.fold(T::zero(), |sum, part| sum + part)
    }
}

/// A random tree of few bodies with some degrees of freedom driven, and a place to look at it.
fn random_dynamics(seed: u64, most: usize) -> (TreeDynamics, Vec<f64>, Random) {
    let mut random = Random::new(seed);
    let model = loop {
        let n = 1 + random.below(most);
        let model = random_tree(&mut random, n, 0.5).unwrap();
        if model.n_velocities() > 0 {
            break model;
        }
    };
    let n = model.n_velocities();
    let actuated: Vec<usize> = (0..n).filter(|_| random.below(3) > 0).collect();
    let mut at = random_configuration(&mut random, &model).unwrap();
    at.extend(random.numbers(n, 2.0));
    at.extend(random.numbers(actuated.len(), 3.0));
    (TreeDynamics::try_new(&model, &actuated).unwrap(), at, random)
}

/// Value, Jacobian and weighted Hessian.
fn evaluated(
    f: &mut dyn VectorFunction,
    at: &[f64],
    w: &[f64],
) -> (DMatrix<f64>, DMatrix<f64>, DMatrix<f64>) {
    let (m, n) = (f.n_outputs(), at.len());
    let (mut values, mut by, mut hessian) = (vec![0.0; m], DMatrix::zeros(m, n), DMatrix::zeros(n, n));
    f.evaluate(at, &mut values).unwrap();
    f.jacobian(at, &mut by).unwrap();
    f.add_hessian(at, w, &mut hessian).unwrap();
    hessian.fill_lower_triangle_with_upper_triangle();
    (DMatrix::from_vec(m, 1, values), by, hessian)
}

/// What is recorded at the first of some points is the function at all of them.
fn assert_same(function: &mut dyn VectorFunction, points: &[&[f64]], w: &[f64], what: &str) {
    let mut graph = TracedFunction::try_new(&function.expressions(points[0]).unwrap()).unwrap();
    // elsewhere than where it was recorded
    let moved: Vec<f64> = points[0].iter().enumerate().map(|(k, x)| x + 1e-2 * (k as f64).sin()).collect();
    for at in points.iter().copied().chain([&moved[..]]) {
        let (found, known) = (evaluated(&mut graph, at, w), evaluated(function, at, w));
        // measured: values bit for bit, Hessians to 5·10⁻¹¹ of their largest entry
        for (found, known, rounding) in
            [(found.0, known.0, 1e-12), (found.1, known.1, 1e-11), (found.2, known.2, 1e-10)]
        {
            let error = (&found - &known).amax() / known.amax().max(1.0);
            assert!(error <= rounding, "{what}: {error}");
        }
    }
}

#[test]
fn expressions_of_random_trees_are_their_dynamics() {
    for seed in 0..20 {
        let (mut tree, at, mut random) = random_dynamics(seed, 3);
        let w = random.numbers(tree.n_states(), 1.0);
        // where branches would be taken, if there were any
        let mut rest = vec![0.0; at.len()];
        rest[..tree.model().n_positions()].copy_from_slice(&tree.model().neutral());
        assert_same(&mut tree, &[&at, &rest], &w, &format!("tree {seed}"));
    }
}

#[test]
fn expressions_of_joints_that_follow_others_are_their_dynamics() {
    let mut builder = Model::builder();
    for link in chain(4, 9.81).links() {
        let follows = link.name() == "3";
        builder.add(if follows { link.clone().following("1", -0.5, 0.2) } else { link.clone() }).unwrap();
    }
    let mut tree = TreeDynamics::try_new(&builder.build().unwrap(), &[0, 1]).unwrap();
    let mut random = Random::new(7);
    let (at, w) = (random.numbers(8, 1.0), random.numbers(6, 1.0));
    assert_same(&mut tree, &[&at, &[0.0; 8]], &w, "geared chain");
}

#[test]
fn functions_beside_a_tree_are_stacked_and_see_unit_quaternions() {
    let (tree, mut at, mut random) = random_dynamics(3, 2);
    let n = tree.n_states();
    let beside = ExprFunction::record(vec![Block::new("arguments", [at.len()])], &at, |x| {
        let square = x[..n].iter().fold(constant(0.0), |sum: Traced, x| sum + *x * *x * *x);
        Ok::<_, ExprError>(vec![square * x[n - 1]])
    });
    let beside = Box::new(TracedFunction::try_new(&beside.unwrap()).unwrap());
    let quaternions = tree.quaternions();
    assert!(!quaternions.is_empty());
    at[quaternions[0]] += 0.3;
    let beside = AtUnitQuaternions::new(beside, at.len(), quaternions);
    let all: Vec<usize> = (0..at.len()).collect();
    let mut stacked = Stacked::new(vec![(Box::new(tree), all.clone()), (Box::new(beside), all)]);
    let w = random.numbers(n + 1, 1.0);
    assert_same(&mut stacked, &[&at], &w, "stacked");
}

/// λᵀf of a tree over any scalar.
fn product<T: Scalar>(model: &Model<T>, tree: &TreeDynamics, at: &[T], costates: &[f64]) -> T {
    let (q, rest) = at.split_at(model.n_positions());
    let (v, u) = rest.split_at(model.n_velocities());
    let mut torque = vec![T::zero(); v.len()];
    tree.actuated().iter().zip(u).for_each(|(&dof, u)| torque[dof] = *u);
    let mut rates = vec![T::zero(); q.len()];
    model.position_rates(q, v, &mut rates).unwrap();
    let mut unit = q.to_vec();
    model.normalize(&mut unit).unwrap();
    let mut data = Data::new(model);
    rates.extend(model.forward_dynamics(&mut data, &unit, v, &torque, &[]).unwrap());
    rates.iter().zip(costates).fold(T::zero(), |sum, (rate, costate)| sum + *rate * constant(*costate))
}

#[test]
fn derivatives_of_a_hamiltonian_are_those_of_duals_and_differences() {
    for seed in 100..110 {
        let (tree, at, mut random) = random_dynamics(seed, 3);
        let model = tree.model();
        let costates = random.numbers(tree.n_states(), 1.0);
        let mut graph = TracedFunction::try_new(&tree.expressions(&at).unwrap()).unwrap();
        let (_, by, hessian) = evaluated(&mut graph, &at, &costates);
        let gradient = by.tr_mul(&DMatrix::from_column_slice(costates.len(), 1, &costates));
        let (dual, hyper): (Model<Dual64>, Model<HyperDual64>) = (model.cast(), model.cast());
        let size = 1.0 + gradient.amax().max(hessian.amax());
        for j in 0..at.len() {
            let mut x: Vec<Dual64> = at.iter().map(|x| Dual64::from_re(*x)).collect();
            x[j].eps = 1.0;
            let exact = product(&dual, &tree, &x, &costates).eps;
            assert!((gradient[j] - exact).abs() < 1e-12 * size, "{seed}, {j}: {} {exact}", gradient[j]);
            let [more, less] = [1e-5, -1e-5].map(|h| {
                let mut x = at.clone();
                x[j] += h;
                product(model, &tree, &x, &costates)
            });
            assert!((gradient[j] - (more - less) / 2e-5).abs() < 1e-7 * size, "{seed}, {j}");
            for i in 0..=j {
                let mut x: Vec<HyperDual64> = at.iter().map(|x| HyperDual64::from_re(*x)).collect();
                (x[i].eps1, x[j].eps2) = (1.0, 1.0);
                let exact = product(&hyper, &tree, &x, &costates).eps1eps2;
                assert!((hessian[(i, j)] - exact).abs() < 1e-11 * size, "{seed}, {i} {j}");
            }
        }
    }
}

fn solve(phase: Phase, method: SolutionMethod, tolerance: f64) -> SolverResult {
    let mut problem = Problem::try_new(phase).unwrap();
    let mut solver = Solver { method, ..Solver::default() };
    solver.collocation.tolerance = tolerance;
    solver.solve(&mut problem, StartFrom::Guess, &mut |_| Flow::Continue, &CancellationToken::new()).unwrap()
}

fn polished(phase: Phase) -> Polished {
    solve(phase, SolutionMethod::Indirect, 1e-6).polished.unwrap()
}

fn arm(duration: f64) -> Phase {
    let tree = TreeDynamics::try_fully_actuated(&TwoLinkArm::default().model().unwrap()).unwrap();
    Phase::of_tree(tree, Effort(vec![1.0, 0.5]))
        .initial_state([-FRAC_PI_2, 0.05, 0.0, 0.0])
        .final_state([FRAC_PI_2, 0.05, 0.0, 0.0])
        .horizon(0.0, duration)
}

#[test]
fn the_arm_of_the_thesis_is_posed_once_and_solved_in_three_ways() {
    let exact = polished(arm(2.0));
    assert_eq!(exact.verdict, Verdict::StrictMinimum);
    assert!(exact.residual < 1e-10);
    let collocation = solve(arm(2.0), SolutionMethod::Collocation, 1e-6).report;
    let splines = solve(arm(2.0), SolutionMethod::Shooting, 1e-5).report;
    assert!((collocation.cost / exact.cost - 1.0).abs() < 1e-6, "{} {}", collocation.cost, exact.cost);
    assert!((splines.cost / exact.cost - 1.0).abs() < 1e-5, "{} {}", splines.cost, exact.cost);
}

/// Kelly 2017, equations 6.1 and 6.2, written out: 1 kg, 0.3 kg at 0.5 m.
struct CartPole;

impl Dynamics for CartPole {
    fn n_states(&self) -> usize {
        4
    }
    fn n_controls(&self) -> usize {
        1
    }
    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        let (c, [angle, speed, spin], u) =
            (constant::<T>, [at.state[1], at.state[2], at.state[3]], at.control[0]);
        let (sin, cos) = angle.sin_cos();
        let below = sin * sin * c(0.3) + c(1.0);
        let swing = sin * spin * spin * c(0.15);
        rates.copy_from_slice(&[
            speed,
            spin,
            (swing + u + cos * sin * c(0.3 * 9.81)) / below,
            -(swing * cos + u * cos + sin * c(1.3 * 9.81)) / (below * c(0.5)),
        ]);
    }
}

fn cart_pole() -> Model {
    let mut builder = ModelBuilder::new().with_gravity(-9.81 * Vector3::y());
    let (slider, hinge) = (Joint::Prismatic { axis: Vector3::x() }, Joint::Revolute { axis: Vector3::z() });
    builder.add(Link::root("cart", slider, MassProperties::point(1.0, Vector3::zeros()))).unwrap();
    builder.add(Link::child("pole", "cart", hinge, MassProperties::point(0.3, -0.5 * Vector3::y()))).unwrap();
    builder.build().unwrap()
}

fn swing_up(phase: Phase) -> Phase {
    phase.initial_state([0.0; 4]).final_state([1.0, PI, 0.0, 0.0]).horizon(0.0, 2.0)
}

#[test]
fn a_tree_and_its_equations_written_out_have_the_same_extremal() {
    let tree = TreeDynamics::try_new(&cart_pole(), &[0]).unwrap();
    let tree = polished(swing_up(Phase::of_tree(tree, Effort(vec![1.0]))));
    let hand = polished(swing_up(Phase::new(CartPole, Effort(vec![1.0]))));
    assert_eq!((&tree.verdict, &hand.verdict), (&Verdict::StrictMinimum, &Verdict::StrictMinimum));
    assert!(tree.residual < 1e-10 && hand.residual < 1e-10);
    assert!((tree.cost / hand.cost - 1.0).abs() < 1e-12, "{} {}", tree.cost, hand.cost);
    for t in [0.3, 1.1, 1.9] {
        let (a, b) = (tree.at(t).unwrap(), hand.at(t).unwrap());
        let pairs = a.state.iter().chain(&a.costate).zip(b.state.iter().chain(&b.costate));
        pairs.for_each(|(a, b)| assert!((a - b).abs() < 1e-9 * (1.0 + a.abs()), "{t}: {a} {b}"));
    }
}

#[test]
fn a_bounded_force_on_a_tree_has_arcs_at_its_bounds() {
    let posed = || {
        let tree = TreeDynamics::try_new(&cart_pole(), &[0]).unwrap();
        swing_up(Phase::of_tree(tree, Effort(vec![1.0]))).control_bounds([Interval::new(-12.0, 12.0)])
    };
    let found = polished(posed());
    assert!(found.verdict.is_certified() && found.residual < 1e-10, "{}", found.verdict);
    assert!(found.arcs.len() > 2);
    let collocation = solve(posed(), SolutionMethod::Collocation, 1e-6).report;
    assert!((found.cost / collocation.cost - 1.0).abs() < 1e-6, "{} {}", found.cost, collocation.cost);
}

fn turned_chain(n: usize) -> Polished {
    let tree = TreeDynamics::try_fully_actuated(&chain(n, 9.81)).unwrap();
    let last: Vec<f64> = (0..2 * n).map(|k| if k < n { 0.5 } else { 0.0 }).collect();
    polished(Phase::of_tree(tree, Effort(vec![1.0; n])).initial_state(vec![0.0; 2 * n]).final_state(last))
}

#[test]
fn a_chain_of_driven_hinges_is_polished() {
    let found = turned_chain(2);
    assert!(found.verdict == Verdict::StrictMinimum && found.residual < 1e-10, "{}", found.verdict);
}

#[test]
#[ignore = "long form of `a_chain_of_driven_hinges_is_polished`: four hinges, 5 s: `make studies` runs it"]
fn a_chain_of_four_driven_hinges_is_polished() {
    let found = turned_chain(4);
    assert!(found.verdict == Verdict::StrictMinimum && found.residual < 1e-10, "{}", found.verdict);
}

fn refused(phase: Phase) -> String {
    let mut problem = Problem::try_new(phase).unwrap();
    let search = Collocation { max_meshes: 1, ..Collocation::default() };
    let mesh = Mesh::try_uniform(6, 3).unwrap();
    let report = search.solve(&mut problem, &[mesh], &mut |_| Flow::Continue).unwrap();
    match Polish::default().polish(&mut problem, &report).unwrap().verdict {
        Verdict::Refused { reason } => reason,
        verdict => panic!("{verdict}"),
    }
}

/// A tree with an effort that grows where the first entry of its state is above a half.
struct Dearer;

impl Terms for Dearer {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let square = at.control[0] * at.control[0];
        if at.state[0] > constant(0.5) { square * constant(2.0) } else { square }
    }
}

#[test]
fn a_body_on_a_plane_is_polished() {
    let mut builder = ModelBuilder::new().with_gravity(Vector3::zeros());
    let body = MassProperties { mass: 1.0, center: Vector3::zeros(), inertia: Matrix3::identity() };
    builder.add(Link::root("body", Joint::Planar, body)).unwrap();
    let tree = TreeDynamics::try_fully_actuated(&builder.build().unwrap()).unwrap();
    let pushed = Phase::of_tree(tree, Effort(vec![1.0; 3])).initial_state([0.0; 6]);
    let found = polished(pushed.final_state([1.0, 2.0, 1.0, 0.0, 0.0, 0.0]));
    // ẍ = u in each of three numbers: 6 d²
    assert!(found.verdict == Verdict::StrictMinimum && found.residual < 1e-10, "{}", found.verdict);
    assert!((found.cost - 36.0).abs() < 1e-9, "{}", found.cost);
}

#[test]
fn what_cannot_be_polished_of_a_tree_says_why() {
    let slid = |terms: Dearer| {
        let mut builder = ModelBuilder::new().with_gravity(Vector3::zeros());
        let block = MassProperties::point(1.0, Vector3::zeros());
        builder.add(Link::root("block", Joint::Prismatic { axis: Vector3::x() }, block)).unwrap();
        let tree = TreeDynamics::try_fully_actuated(&builder.build().unwrap()).unwrap();
        Phase::of_tree(tree, terms).initial_state([0.0, 0.0]).final_state([1.0, 0.0])
    };
    // expressions hold on one side of a branch, and are NaN on the other
    let reason = refused(slid(Dearer));
    assert!(!reason.is_empty(), "{reason}");
}
