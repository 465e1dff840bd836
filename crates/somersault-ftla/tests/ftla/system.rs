//! State–costate systems: one problem written in three ways, differences, the thesis' appendix F, and what is refused.

use crate::common::{ArmProblem, FREE, Random, arm_problem, matrix_gap, within};
use nalgebra::{DMatrix, DVector, dvector};
use somersault_core::Scalar;
use somersault_core::argument::ArgumentError;
use somersault_ftla::system::{
    ArmMinimumTorque, CubicRegulator, HamiltonianSystem, LinearRegulator, OptimalControlSystem, Piece,
    PosedProblem, StateCostate, SystemError, TreeMinimumTorque, VectorField,
};
use somersault_multibody::models::TwoLinkArm;
use somersault_multibody::{Data, Joint, Link, Model, ModelBuilder};
use somersault_ocp::collocation::{Dynamics, Point, Terms};
use somersault_testkit::trees as testkit;

/// The Jacobian by central differences of fourth order.
fn differences(system: &impl VectorField, p: &DVector<f64>) -> DMatrix<f64> {
    let (h, n) = (1e-3, p.len());
    let mut d = DMatrix::<f64>::zeros(n, n);
    for j in 0..n {
        let at = |s: f64| {
            let mut q = p.clone();
            q[j] += s * h;
            system.field(q.as_slice())
        };
        d.set_column(j, &((at(-2.0) - at(2.0) + (at(1.0) - at(-1.0)) * 8.0) / (12.0 * h)));
    }
    d
}

/// h = J ∇H with ∇H by central differences.
fn field_of_hamiltonian(system: &impl HamiltonianSystem, p: &DVector<f64>) -> DVector<f64> {
    let (h, n) = (1e-3, p.len() / 2);
    DVector::from_fn(2 * n, |i, _| {
        let (j, sign) = if i < n { (i + n, 1.0) } else { (i - n, -1.0) };
        let at = |s: f64| {
            let mut q = p.clone();
            q[j] += s * h;
            system.hamiltonian(q.as_slice())
        };
        sign * (at(-2.0) - at(2.0) + (at(1.0) - at(-1.0)) * 8.0) / (12.0 * h)
    })
}

#[test]
fn the_arm_in_closed_form_is_the_generic_problem_and_the_tree() {
    let mut random = Random::new(8);
    for case in 0..50 {
        let arm = TwoLinkArm {
            masses: [0.5 + random.unit().abs(), 0.5 + random.unit().abs()],
            lengths: [1.0 + random.unit().abs(), 0.5 + random.unit().abs()],
            damping: [random.unit().abs(), random.unit().abs()],
        };
        let weights = [0.5 + random.unit().abs(), 0.5 + random.unit().abs()];
        let closed = ArmMinimumTorque::try_new(arm, weights).expect("in range");
        let generic = arm_problem(arm, weights);
        let tree = TreeMinimumTorque::try_new(&arm.model().expect("a model"), &weights).expect("fits");
        let p = DVector::from_fn(8, |_, _| 2.0 * random.unit());
        let (h, d) = closed.linearize(p.as_slice());
        assert!(
            (&h - closed.field(p.as_slice())).amax() == 0.0
                && (&d - closed.jacobian(p.as_slice())).amax() == 0.0
        );
        let (hs, ds) = (h.amax(), d.amax());
        assert!((&h - generic.field(p.as_slice())).amax() < 1e-12 * hs, "{case}: generic field");
        assert!((&h - tree.field(p.as_slice())).amax() < 1e-12 * hs, "{case}: field of the tree");
        assert!(matrix_gap(&d, &generic.jacobian(p.as_slice())) < 1e-12 * ds, "{case}: generic Jacobian");
        assert!(matrix_gap(&d, &tree.jacobian(p.as_slice())) < 1e-12 * ds, "{case}: Jacobian of the tree");
        assert!(matrix_gap(&d, &differences(&closed, &p)) < 1e-7 * ds, "{case}: differences");
        assert!((&h - field_of_hamiltonian(&closed, &p)).amax() < 1e-7 * hs, "{case}: ∇H");
        for hamiltonian in [generic.hamiltonian(p.as_slice()), tree.hamiltonian(p.as_slice())] {
            assert!((hamiltonian - closed.hamiltonian(p.as_slice())).abs() < 1e-12 * (1.0 + hs), "{case}: H");
        }
        let mut u = [[0.0; 2]; 3];
        closed.control_into(p.as_slice(), &mut u[0]).expect("two controls");
        generic.control_into(p.as_slice(), &mut u[1]).expect("two controls");
        tree.control_into(p.as_slice(), &mut u[2]).expect("two controls");
        for other in &u[1..] {
            assert!((u[0][0] - other[0]).abs() + (u[0][1] - other[1]).abs() < 1e-11 * hs, "{case}: controls");
        }
        for cost in [generic.running_cost(p.as_slice()), tree.running_cost(p.as_slice())] {
            assert!((cost - closed.running_cost(p.as_slice())).abs() < 1e-11 * (1.0 + cost), "{case}: cost");
        }
    }
}

/// Any tree of three joints by its forward dynamics over the scalar, ½ Σ γᵢuᵢ².
#[derive(Clone)]
struct Chain {
    model: Model,
    weights: [f64; 3],
}

impl Dynamics for Chain {
    fn n_states(&self) -> usize {
        6
    }

    fn n_controls(&self) -> usize {
        3
    }

    fn rates<T: Scalar>(&self, at: &Point<'_, T>, f: &mut [T]) {
        let (x, u) = (at.state, at.control);
        let model: Model<T> = self.model.cast();
        let mut data = Data::new(&model);
        let (q, v) = x.split_at(3);
        f[..3].copy_from_slice(v);
        f[3..].copy_from_slice(model.forward_dynamics(&mut data, q, v, u, &[]).expect("regular"));
    }
}

impl Terms for Chain {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let u = at.control;
        let weighed = |i: usize| u[i] * u[i] * nalgebra::convert::<f64, T>(0.5 * self.weights[i]);
        (0..3).fold(T::zero(), |sum, i| sum + weighed(i))
    }
}

/// Three bodies under gravity, on two hinges askew and a slider, one branching off the first.
fn branched(random: &mut testkit::Random) -> Model {
    let mut builder = ModelBuilder::new();
    let hinge = |random: &mut testkit::Random| Joint::Revolute { axis: random.vector(1.0) };
    let (one, two) = (hinge(random), hinge(random));
    let slider = Joint::Prismatic { axis: random.vector(1.0) };
    builder.add(Link::root("one", one, random.body()).with_damping(0.3)).expect("a root");
    builder.add(Link::child("two", "one", two, random.body()).at(random.vector(1.0))).expect("a child");
    let link = Link::child("three", "one", slider, random.body()).at(random.vector(1.0)).with_damping(0.1);
    builder.add(link).expect("a child");
    builder.build().expect("a tree")
}

#[test]
fn a_random_tree_is_its_forward_dynamics_through_expressions_end_to_end() {
    let mut random = testkit::Random::new(12);
    let (mut cut, mut steps) = (0, 0);
    for case in 0..10 {
        let model = branched(&mut random);
        let weights = [0.6, 1.3, 0.9];
        for limits in [[f64::INFINITY; 3], [0.5, f64::INFINITY, 1.0]] {
            let tree = TreeMinimumTorque::try_new(&model, &weights).expect("fits");
            let tree = tree.try_with_torque_limits(&limits).expect("positive");
            let chain = Chain { model: model.clone(), weights };
            let generic = within(chain, &limits.map(|limit| [-limit, limit]));
            let p = DVector::<f64>::from_column_slice(&random.numbers(12, 1.0));
            let (h, d) = tree.linearize(p.as_slice());
            assert!((&h - generic.field(p.as_slice())).amax() < 1e-11 * h.amax(), "{case}: field");
            assert!(matrix_gap(&d, &generic.jacobian(p.as_slice())) < 1e-10 * d.amax(), "{case}: Jacobian");
            assert!(
                (tree.hamiltonian(p.as_slice()) - generic.hamiltonian(p.as_slice())).abs() < 1e-11 * h.amax(),
                "{case}: H"
            );
            assert_eq!(tree.piece(p.as_slice()), generic.piece(p.as_slice()), "{case}");
            let margins = [
                tree.margins(&tree.piece(p.as_slice()), p.as_slice()),
                generic.margins(&tree.piece(p.as_slice()), p.as_slice()),
            ];
            for i in (0..margins[0].len()).filter(|&i| margins[0][i].is_finite()) {
                assert!(
                    (margins[0][i] - margins[1][i]).abs() < 1e-10 * (1.0 + margins[0][i].abs()),
                    "{case}"
                );
            }
            cut += usize::from(tree.piece(p.as_slice()) != Piece::FREE);
            steps += usize::from(tree.n_switches() == 3);
        }
    }
    assert!(cut > 5 && steps == 10);
}

#[test]
fn a_tree_with_a_passive_joint_is_hamiltonian_and_drives_the_others_only() {
    let mut random = testkit::Random::new(13);
    for case in 0..10 {
        let model = branched(&mut random);
        let tree = TreeMinimumTorque::try_new(&model, &[1.0; 3]).expect("fits");
        let tree = tree.try_with_passive(1).expect("others are driven");
        let p = DVector::<f64>::from_column_slice(&random.numbers(12, 0.5));
        let (h, d) = tree.linearize(p.as_slice());
        assert!((&h - field_of_hamiltonian(&tree, &p)).amax() < 1e-6 * h.amax(), "{case}: ∇H");
        assert!(matrix_gap(&d, &differences(&tree, &p)) < 1e-6 * d.amax(), "{case}: differences");
        let mut u = [1.0; 3];
        tree.control_into(p.as_slice(), &mut u).expect("three joints");
        assert!(u[1] == 0.0 && u[0] != 0.0 && u[2] != 0.0);
    }
    let one = |tree: TreeMinimumTorque| tree.try_with_passive(0).and_then(|t| t.try_with_passive(1));
    let tree = TreeMinimumTorque::try_new(&branched(&mut random), &[1.0; 3]).expect("fits");
    assert!(one(tree).and_then(|t| t.try_with_passive(2)).is_err());
}

/// Two bodies under gravity, the first on `joint`, the second on a hinge askew if there is one.
fn rooted(random: &mut testkit::Random, joint: Joint, hinge: bool) -> Model {
    let mut builder = ModelBuilder::new();
    builder.add(Link::root("one", joint, random.body()).with_damping(0.2)).expect("a root");
    if hinge {
        let axis = Joint::Revolute { axis: random.vector(1.0) };
        builder.add(Link::child("two", "one", axis, random.body()).at(random.vector(1.0))).expect("a child");
    }
    builder.build().expect("a tree")
}

/// A tree in coordinates of its own: Hamiltonian, D by differences, v the velocity of its configuration, and v̇ that of
/// forward dynamics. `place` makes a configuration of coordinates.
fn assert_charted(random: &mut testkit::Random, model: &Model, place: impl Fn(&[f64]) -> Vec<f64>) {
    let n = model.n_velocities();
    let tree = TreeMinimumTorque::try_new(model, &vec![0.7; n]).expect("fits");
    // small rotations go by series, large ones by the closed form
    for (case, size) in [0.0, 0.3, 0.9, 1.3].into_iter().enumerate() {
        let mut p = DVector::<f64>::from_column_slice(&random.numbers(4 * n, 0.5));
        (0..n).for_each(|i| p[i] *= 2.0 * size);
        let (h, d) = tree.linearize(p.as_slice());
        assert!((&h - field_of_hamiltonian(&tree, &p)).amax() < 1e-8 * h.amax(), "{case}: ∇H");
        assert!(matrix_gap(&d, &differences(&tree, &p)) < 1e-8 * d.amax(), "{case}: differences");
        let (c, v) = (&p.as_slice()[..n], &p.as_slice()[n..2 * n]);
        let moved = |step: f64| place(&(0..n).map(|i| c[i] + step * h[i]).collect::<Vec<_>>());
        let mut along = vec![0.0; n];
        model.difference(&moved(-1e-4), &moved(1e-4), &mut along).expect("lengths fit");
        assert!((0..n).all(|i| (along[i] / 2e-4 - v[i]).abs() < 1e-6), "{case}: {along:?} along {v:?}");
        let mut u = vec![0.0; n];
        tree.control_into(p.as_slice(), &mut u).expect("n controls");
        let mut data = Data::new(model);
        let a = model.forward_dynamics(&mut data, &place(c), v, &u, &[]).expect("regular");
        assert!((0..n).all(|i| (a[i] - h[n + i]).abs() < 1e-11 * h.amax()), "{case}: forward dynamics");
    }
}

#[test]
fn ball_planar_and_free_joints_are_hamiltonian_in_their_charts() {
    let mut random = testkit::Random::new(14);
    let turned = |phi: &[f64]| {
        let q = nalgebra::UnitQuaternion::from_scaled_axis(nalgebra::Vector3::from_column_slice(phi));
        q.coords.as_slice().to_vec()
    };
    let ball = rooted(&mut random, Joint::Spherical, true);
    assert_charted(&mut random, &ball, |c| [turned(&c[..3]), vec![c[3]]].concat());
    let planar = rooted(&mut random, Joint::Planar, true);
    assert_charted(&mut random, &planar, <[f64]>::to_vec);
    let free = rooted(&mut random, Joint::Free, false);
    assert_charted(&mut random, &free, |c| [c[..3].to_vec(), turned(&c[3..])].concat());
}

/// The third row of D at the thesis' parameters, as appendix F prints it, (F.54)–(F.61).
fn appendix_f(p: &DVector<f64>) -> [f64; 8] {
    let (th, w1, w2, l3, l4) = (p[1], p[2], p[3], p[6], p[7]);
    let s = |k: f64| (k * th).sin();
    let c = |k: f64| (k * th).cos();
    let (w1s, w2s, cs) = (w1 * w1, w2 * w2, th.cos());
    let d32 = -(9330.0 * w1s * c(1.0) + 9330.0 * w2s * c(1.0) + 19872.0 * w1 * s(2.0) - 3888.0 * w1 * s(4.0)
        + 8812800.0 * l3 * s(2.0)
        + 933120.0 * l3 * s(3.0)
        - 30585600.0 * l4 * s(2.0)
        + 933120.0 * l3 * s(4.0)
        - 31492800.0 * l4 * s(3.0)
        - 1866240.0 * l4 * s(4.0)
        + 219600.0 * w1s * c(2.0)
        + 3645.0 * w1s * c(3.0)
        - 37260.0 * w1s * c(4.0)
        + 3645.0 * w2s * c(3.0)
        - 1215.0 * w1s * c(5.0)
        - 1215.0 * w2s * c(5.0)
        + 3144960.0 * l3 * s(1.0)
        - 106142400.0 * l4 * s(1.0)
        - 111780.0 * w1s
        + 18660.0 * w1 * w2 * c(1.0)
        + 7290.0 * w1 * w2 * c(3.0)
        - 2430.0 * w1 * w2 * c(5.0))
        / (20.0 * (9.0 * c(2.0) - 23.0).powi(3));
    let d33 = -3.0 * (10.0 * w1 * s(1.0) + 10.0 * w2 * s(1.0) + 60.0 * w1 * cs * s(1.0) - 4.0)
        / (10.0 * (9.0 * cs * cs - 16.0));
    let d34 = s(1.0) * (3.0 * w1 + 3.0 * w2) / (9.0 * s(1.0) * s(1.0) + 7.0);
    let square = (9.0 * cs * cs - 16.0).powi(2);
    let d37 = -(2592.0 * cs * cs + 864.0 * cs + 108.0) / square;
    let d38 = (5184.0 * cs * cs + 29160.0 * cs + 4716.0) / square;
    [0.0, d32, d33, d34, 0.0, 0.0, d37, d38]
}

#[test]
fn the_third_row_of_the_jacobian_is_that_of_appendix_f() {
    let mut random = Random::new(3);
    let arm = ArmMinimumTorque::default();
    for case in 0..200 {
        let p = DVector::from_fn(8, |_, _| 3.0 * random.unit());
        let (d, printed) = (arm.jacobian(p.as_slice()), appendix_f(&p));
        let scale = printed.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        for j in 0..8 {
            assert!((d[(2, j)] - printed[j]).abs() < 1e-13 * scale, "{case}: d3{}", j + 1);
        }
    }
}

/// Regulators, general costs and bounds in one scalar: ẋ = drift(x) + u + skew u², ℓ = ½x² + cost(u).
#[derive(Clone, Copy)]
struct Scalar1 {
    cubic: bool,
    cost: Cost,
}

#[derive(Clone, Copy)]
enum Cost {
    Square,
    Cosh,
    Nothing,
    NotANumber,
    NoValue,
}

impl Dynamics for Scalar1 {
    fn n_states(&self) -> usize {
        1
    }

    fn n_controls(&self) -> usize {
        1
    }

    fn rates<T: Scalar>(&self, at: &Point<'_, T>, f: &mut [T]) {
        let (x, u) = (at.state, at.control);
        let drift = if self.cubic { x[0] * x[0] * x[0] } else { x[0] };
        f[0] = u[0] - drift;
    }
}

impl Terms for Scalar1 {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let (x, u) = (at.state, at.control);
        let half: T = nalgebra::convert(0.5);
        let control = match self.cost {
            Cost::Square => u[0] * u[0] * half,
            Cost::Cosh => u[0].cosh() - T::one(),
            Cost::Nothing => T::zero(),
            Cost::NotANumber => u[0] * nalgebra::convert::<f64, T>(f64::NAN),
            Cost::NoValue => u[0] * u[0] * half + nalgebra::convert::<f64, T>(f64::NAN),
        };
        x[0] * x[0] * half + control
    }
}

fn scalar(cubic: bool, cost: Cost, bounds: [[f64; 2]; 1]) -> StateCostate<PosedProblem> {
    within(Scalar1 { cubic, cost }, &bounds)
}

#[test]
fn the_regulators_are_their_problems() {
    let mut random = Random::new(1);
    for _ in 0..50 {
        let p = dvector![2.0 * random.unit(), 2.0 * random.unit()];
        let (linear, cubic) = (scalar(false, Cost::Square, FREE), scalar(true, Cost::Square, FREE));
        assert!((linear.field(p.as_slice()) - LinearRegulator.field(p.as_slice())).amax() < 1e-14);
        assert!((linear.jacobian(p.as_slice()) - LinearRegulator.jacobian(p.as_slice())).amax() < 1e-14);
        assert!((linear.hamiltonian(p.as_slice()) - LinearRegulator.hamiltonian(p.as_slice())).abs() < 1e-14);
        assert!((cubic.field(p.as_slice()) - CubicRegulator.field(p.as_slice())).amax() < 1e-13);
        assert!((cubic.jacobian(p.as_slice()) - CubicRegulator.jacobian(p.as_slice())).amax() < 1e-13);
        assert!((cubic.hamiltonian(p.as_slice()) - CubicRegulator.hamiltonian(p.as_slice())).abs() < 1e-13);
        assert!((cubic.running_cost(p.as_slice()) - CubicRegulator.running_cost(p.as_slice())).abs() < 1e-14);
        let mut u = [0.0; 1];
        CubicRegulator.control_into(p.as_slice(), &mut u).expect("one control");
        assert!((u[0] - cubic.control(p.as_slice()).expect("convex")[0]).abs() < 1e-15);
    }
}

#[test]
fn a_general_convex_cost_is_minimised_and_differentiated() {
    // ℓ(u) = cosh u − 1: sinh u* = −λ
    let mut random = Random::new(2);
    let system = scalar(true, Cost::Cosh, FREE);
    for case in 0..50 {
        let p = dvector![2.0 * random.unit(), 60.0 * random.unit()];
        let u = system.control(p.as_slice()).expect("convex")[0];
        assert!((u + p[1].asinh()).abs() < 1e-14 * (1.0 + u.abs()), "{case}: {u}");
        let gap = matrix_gap(&system.jacobian(p.as_slice()), &differences(&system, &p));
        assert!(gap < 1e-8 * system.jacobian(p.as_slice()).amax(), "{case}: {gap:e}");
    }
}

#[test]
fn bounds_cut_the_control_off_and_leave_the_jacobian() {
    let system = scalar(false, Cost::Square, [[-0.4, 0.3]]);
    for costate in [-2.0, -0.5, -0.2, 0.1, 0.6, 3.0f64] {
        let p = dvector![0.7, costate];
        let expected = (-costate).clamp(-0.4, 0.3);
        assert_eq!(system.control(p.as_slice()).expect("convex")[0], expected);
        let slope = if expected == -costate { -1.0 } else { 0.0 };
        assert_eq!(system.jacobian(p.as_slice())[(0, 1)], slope);
        assert!(matrix_gap(&system.jacobian(p.as_slice()), &differences(&system, &p)) < 1e-9);
    }
    // the arm in closed form against the problem with bounds
    let arm = ArmMinimumTorque::default().try_with_torque_limits([0.6, 0.2]).expect("positive");
    let problem = ArmProblem { arm: *arm.arm(), weights: arm.weights(), limits: arm.torque_limits() };
    let generic = problem.system();
    let mut random = Random::new(11);
    let mut cut = 0;
    for _ in 0..40 {
        let p = DVector::from_fn(8, |i, _| if i > 5 { 0.2 * random.unit() } else { random.unit() });
        let mut u = [0.0; 2];
        arm.control_into(p.as_slice(), &mut u).expect("two controls");
        assert!(u[0].abs() <= 0.6 && u[1].abs() <= 0.2);
        cut += usize::from(u[0].abs() == 0.6) + usize::from(u[1].abs() == 0.2);
        let (h, d) = (arm.field(p.as_slice()), arm.jacobian(p.as_slice()));
        assert!((&h - generic.field(p.as_slice())).amax() < 1e-12 * h.amax());
        assert!(matrix_gap(&d, &generic.jacobian(p.as_slice())) < 1e-12 * d.amax());
        assert!((arm.hamiltonian(p.as_slice()) - generic.hamiltonian(p.as_slice())).abs() < 1e-12 * h.amax());
    }
    assert!(cut > 10);
}

#[test]
fn a_singular_control_hessian_is_an_error() {
    let p = dvector![0.3, 0.2];
    let nothing = scalar(false, Cost::Nothing, FREE);
    assert_eq!(
        nothing.control(p.as_slice()),
        Err(SystemError::SingularControlHessian { control: 0, pivot: 0.0 })
    );
    assert_eq!(
        nothing.fault(p.as_slice()),
        Some(SystemError::SingularControlHessian { control: 0, pivot: 0.0 })
    );
    assert!(nothing.field(p.as_slice())[0].is_nan() && nothing.jacobian(p.as_slice())[0].is_nan());
    let nan = scalar(false, Cost::NotANumber, FREE);
    assert_eq!(nan.fault(p.as_slice()), Some(SystemError::NonFinite));
    // a cost without a value has no least control, whatever its slopes are
    let nowhere = scalar(false, Cost::NoValue, FREE);
    assert_eq!(nowhere.control(p.as_slice()), Err(SystemError::NonFinite));
    assert!(nowhere.field(p.as_slice())[0].is_nan() && nowhere.jacobian(p.as_slice())[0].is_nan());
}

#[test]
fn parameters_out_of_range_are_named() {
    let arm = TwoLinkArm::default();
    let light = TwoLinkArm { masses: [0.5, 0.0], ..arm };
    let error = ArmMinimumTorque::try_new(light, [1.0, 0.5]).expect_err("no mass");
    assert_eq!(error.to_string(), "`masses` must be positive and finite, found 0");
    assert!(ArmMinimumTorque::try_new(arm, [f64::NAN, 1.0]).is_err());
    assert!(ArmMinimumTorque::try_new(TwoLinkArm { damping: [-0.1, 0.0], ..arm }, [1.0, 1.0]).is_err());
    assert!(ArmMinimumTorque::default().try_with_torque_limits([0.0, 1.0]).is_err());
    let model = arm.model().expect("a model");
    let error = TreeMinimumTorque::try_new(&model, &[1.0]).expect_err("too few");
    let expected = ArgumentError::Length { argument: "weights", expected: 2, found: 1 };
    assert_eq!(error, SystemError::Argument(expected));
    let mut short = [0.0; 1];
    let p = DVector::<f64>::zeros(8);
    assert!(ArmMinimumTorque::default().control_into(p.as_slice(), &mut short).is_err());
}
