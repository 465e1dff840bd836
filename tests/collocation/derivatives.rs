//! Jacobian and Hessian of the nonlinear program against central differences.

use nalgebra::{DMatrix, DVector};
use somersault_core::Scalar;
use somersault_expr::{Block, ExprFunction};
use somersault_multibody::{models::CartPendulum, models::TwoLinkArm};
use somersault_nlp::{Nlp, Pattern};
use somersault_ocp::collocation::{
    Dynamics, Ends, Interval, Linkage, Mesh, Phase, Point, Problem, Terms, Transcription, TreeDynamics,
};

/// Equations in which everything depends on everything, the time and two parameters too.
struct Tangle;

impl Dynamics for Tangle {
    fn n_states(&self) -> usize {
        2
    }
    fn n_controls(&self) -> usize {
        2
    }
    fn n_parameters(&self) -> usize {
        2
    }
    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        let ([x, y], [u, v], [p, q], t) = (
            [at.state[0], at.state[1]],
            [at.control[0], at.control[1]],
            [at.parameters[0], at.parameters[1]],
            at.time,
        );
        rates[0] = (x * y + t * u).sin() * p + v * v * t;
        rates[1] = (x * q - y * v).cos() + u * t * t * x;
    }
}

impl Terms for Tangle {
    fn n_path_constraints(&self) -> usize {
        2
    }
    fn n_end_constraints(&self) -> usize {
        1
    }
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        (at.state[0] * at.control[1] + at.time * at.parameters[0]).sin()
            + at.control[0] * at.control[0] * at.time
    }
    fn path_constraints<T: Scalar>(&self, at: &Point<'_, T>, values: &mut [T]) {
        values[0] = at.state[0] * at.state[1] * at.time + at.parameters[1] * at.control[0];
        values[1] = (at.control[1] * at.time).sin() * at.state[1];
    }
    fn end_cost<T: Scalar>(&self, ends: &Ends<'_, T>) -> T {
        ends.initial_state[0] * ends.final_state[1] * ends.final_time * ends.parameters[0]
            + ends.initial_time.sin()
    }
    fn end_constraints<T: Scalar>(&self, ends: &Ends<'_, T>, values: &mut [T]) {
        values[0] = (ends.initial_state[1] - ends.final_state[0]) * ends.initial_time * ends.parameters[1];
    }
}

struct Effort;

impl Terms for Effort {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        at.control.iter().fold(T::zero(), |sum, &u| sum + u * u)
    }
}

fn dense(pattern: &Pattern, values: &[f64], symmetric: bool) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(pattern.n_rows, pattern.n_columns());
    for j in 0..pattern.n_columns() {
        for k in pattern.columns[j]..pattern.columns[j + 1] {
            let i = pattern.rows[k];
            matrix[(i, j)] = values[k];
            if symmetric {
                assert!(i <= j, "an entry below the diagonal");
                matrix[(j, i)] = values[k];
            }
        }
    }
    matrix
}

/// Gradient of the cost, Jacobian and Hessian of σ f + yᵀc at z.
fn derivatives(
    nlp: &mut dyn Nlp,
    z: &[f64],
    sigma: f64,
    y: &[f64],
) -> (DVector<f64>, DMatrix<f64>, DMatrix<f64>) {
    let structure = nlp.structure().clone();
    let mut constraints = vec![0.0; structure.constraints.len()];
    let (mut gradient, mut jacobian) = (vec![0.0; z.len()], vec![0.0; structure.jacobian.n_entries()]);
    let mut hessian = vec![f64::NAN; structure.hessian.n_entries()];
    nlp.evaluate(z, &mut constraints).unwrap();
    nlp.differentiate(z, &mut gradient, &mut jacobian).unwrap();
    nlp.hessian(z, sigma, y, &mut hessian).unwrap();
    let (jacobian, hessian) =
        (dense(&structure.jacobian, &jacobian, false), dense(&structure.hessian, &hessian, true));
    (DVector::from_vec(gradient), jacobian, hessian)
}

/// Both derivatives against central differences of what they are derivatives of.
pub(crate) fn check(problem: &mut Problem, meshes: &[Mesh]) {
    let mut nlp = Transcription::try_new(problem, meshes).unwrap();
    let mut z = nlp.decision_of_guess();
    // a point where nothing is special
    z.iter_mut().enumerate().for_each(|(i, z)| *z += 0.3 * (1.7 * i as f64 + 0.4).sin());
    let m = nlp.structure().constraints.len();
    let y: Vec<f64> = (0..m).map(|i| (0.9 * i as f64 + 0.2).cos()).collect();
    let sigma = 0.7;
    let (gradient, jacobian, hessian) = derivatives(&mut nlp, &z, sigma, &y);
    for j in 0..z.len() {
        let mut values = |h: f64| {
            let mut moved = z.clone();
            moved[j] += h;
            let mut constraints = vec![0.0; m];
            let cost = nlp.evaluate(&moved, &mut constraints).unwrap();
            let (gradient, jacobian, _) = derivatives(&mut nlp, &moved, sigma, &y);
            let slope = gradient * sigma + jacobian.tr_mul(&DVector::from_column_slice(&y));
            [DVector::from_element(1, cost), DVector::from_vec(constraints), slope]
        };
        // the difference of order 4
        let h = 1e-3;
        let [far, near, close, remote] = [2.0 * h, h, -h, -2.0 * h].map(&mut values);
        let difference = |k: usize| (&remote[k] - &far[k] + (&near[k] - &close[k]) * 8.0) / (12.0 * h);
        let expected = [
            DVector::from_element(1, gradient[j]),
            jacobian.column(j).into_owned(),
            hessian.column(j).into_owned(),
        ];
        for (k, name) in ["gradient", "Jacobian", "Hessian"].iter().enumerate() {
            let found = difference(k);
            let error = (&found - &expected[k]).amax();
            assert!(error < 1e-8 * (1.0 + found.amax()), "column {j} of the {name} is off by {error}");
        }
    }
}

fn tangle() -> Phase {
    Phase::new(Tangle, Tangle)
        .initial_state([0.3.into(), Interval::FREE])
        .final_state([Interval::FREE, Interval::new(-1.0, 2.0)])
        .horizon(Interval::new(0.1, 0.4), Interval::new(1.0, 3.0))
        .path_bounds([Interval::new(-1.0, 1.0), Interval::at_most(4.0)])
        .end_bounds([Interval::fixed(0.2)])
        .scales([2.0, 0.5], [3.0, 0.25])
}

#[test]
fn derivatives_of_one_phase_with_everything_free_are_exact() {
    let mesh = Mesh::try_new(vec![0.0, 0.2, 0.7, 1.0], vec![2, 4, 1]).unwrap();
    check(&mut Problem::try_new(tangle()).unwrap(), &[mesh]);
}

#[test]
fn derivatives_of_linked_phases_are_exact() {
    let second = tangle().horizon(2.0, Interval::new(2.5, 4.0)).initial_state([Interval::FREE; 2]);
    let links = Linkage::continuous(0, 1, 2);
    let mut problem = Problem::try_of_phases(vec![tangle(), second], links).unwrap();
    check(&mut problem, &[Mesh::try_uniform(2, 2).unwrap(), Mesh::try_uniform(1, 3).unwrap()]);
}

#[test]
fn derivatives_through_trees_are_exact() {
    let arm = TreeDynamics::try_fully_actuated(&TwoLinkArm::default().model().unwrap()).unwrap();
    let phase = Phase::of_tree(arm, Effort)
        .initial_state([-1.0, 0.05, 0.0, 0.0])
        .horizon(0.0, Interval::new(1.0, 2.0));
    check(&mut Problem::try_new(phase).unwrap(), &[Mesh::try_uniform(2, 2).unwrap()]);
    // only the cart is driven
    let cart = TreeDynamics::try_new(&CartPendulum::default().model().unwrap(), &[0]).unwrap();
    let phase = Phase::of_tree(cart, Effort).initial_state([0.0, 3.0, 0.0, 0.0]);
    check(&mut Problem::try_new(phase).unwrap(), &[Mesh::try_uniform(1, 3).unwrap()]);
}

/// The same problem, its functions traced into graphs.
fn traced_tangle() -> Phase {
    let point = || ["x", "u", "p"].map(|name| Block::new(name, [2])).into_iter().chain([Block::new("t", [])]);
    let dynamics = ExprFunction::trace(point().collect(), |blocks| {
        let [x, u, p, t] = blocks else { panic!("four blocks") };
        let (t, v) = (t[0], u[1]);
        vec![
            (x[0] * x[1] + t * u[0]).sin() * p[0] + v * v * t,
            (x[0] * p[1] - x[1] * v).cos() + u[0] * t * t * x[0],
        ]
    });
    let path = ExprFunction::trace(point().collect(), |blocks| {
        let [x, u, p, t] = blocks else { panic!("four blocks") };
        let t = t[0];
        vec![
            (x[0] * u[1] + t * p[0]).sin() + u[0] * u[0] * t,
            x[0] * x[1] * t + p[1] * u[0],
            (u[1] * t).sin() * x[1],
        ]
    });
    let ends = ["first", "last", "p", "times"].map(|name| Block::new(name, [2]));
    let ends = ExprFunction::trace(ends.to_vec(), |blocks| {
        let [first, last, p, times] = blocks else { panic!("four blocks") };
        vec![first[0] * last[1] * times[1] * p[0] + times[0].sin(), (first[1] - last[0]) * times[0] * p[1]]
    });
    let functions = [&dynamics.unwrap(), &path.unwrap(), &ends.unwrap()];
    Phase::try_traced(functions, 2, 2)
        .unwrap()
        .initial_state([0.3.into(), Interval::FREE])
        .final_state([Interval::FREE, Interval::new(-1.0, 2.0)])
        .horizon(Interval::new(0.1, 0.4), Interval::new(1.0, 3.0))
        .path_bounds([Interval::new(-1.0, 1.0), Interval::at_most(4.0)])
        .end_bounds([Interval::fixed(0.2)])
        .scales([2.0, 0.5], [3.0, 0.25])
}

#[test]
fn derivatives_of_traced_functions_are_those_of_duals() {
    let mesh = Mesh::try_new(vec![0.0, 0.2, 0.7, 1.0], vec![2, 4, 1]).unwrap();
    let [duals, graphs] = [tangle(), traced_tangle()].map(|phase| {
        let mut problem = Problem::try_new(phase).unwrap();
        let mut nlp = Transcription::try_new(&mut problem, std::slice::from_ref(&mesh)).unwrap();
        let mut z = nlp.decision_of_guess();
        z.iter_mut().enumerate().for_each(|(i, z)| *z += 0.3 * (1.7 * i as f64 + 0.4).sin());
        let m = nlp.structure().constraints.len();
        let y: Vec<f64> = (0..m).map(|i| (0.9 * i as f64 + 0.2).cos()).collect();
        derivatives(&mut nlp, &z, 0.7, &y)
    });
    assert!((duals.0 - graphs.0).amax() < 1e-14);
    assert!((duals.1 - graphs.1).amax() < 1e-14);
    assert!((duals.2 - graphs.2).amax() < 1e-13);
}
