//! The variational flow against closed forms, group properties, and itself at other tolerances.

use crate::common::{Random, START};
use nalgebra::{DMatrix, DVector, Matrix2, dvector};
use somersault_core::argument::ArgumentError;
use somersault_ftla::flow::{Chain, FlowError, FlowTolerances, VariationalFlow};
use somersault_ftla::system::{
    ArmMinimumTorque, CubicRegulator, HamiltonianSystem, LinearRegulator, VectorField,
};

/// The middle of the thesis' motion, Table 10.1.
fn arm_start() -> DVector<f64> {
    DVector::from_row_slice(&[
        -0.027597, 3.068603, 0.477425, 0.009792, -0.203408, 0.019078, -0.209560, 0.019651,
    ])
}

fn tight(relative: f64) -> FlowTolerances {
    FlowTolerances { relative, absolute: 0.0 }
}

#[test]
fn linear_fields_have_the_exponential_as_transition_matrix() {
    // A² = 2: exp(At) = cosh(√2 t) + A sinh(√2 t)/√2
    let flow = VariationalFlow::try_new(&LinearRegulator, tight(1e-13)).expect("in range");
    let p = dvector![1.0, -0.3];
    for t in [1e-3, 0.4, 3.0, -2.0, 12.0] {
        let root = 2f64.sqrt();
        let a = Matrix2::new(-1.0, -1.0, -1.0, 1.0);
        let exact = Matrix2::identity() * (root * t).cosh() + a * ((root * t).sinh() / root);
        let found = flow.transition(&p, t).expect("a linear field");
        assert!((&found.matrix - exact).amax() < 2e-12 * exact.amax(), "{t}: {}", &found.matrix - exact);
        assert!((found.end - exact * &p).amax() < 2e-12 * exact.amax(), "{t}");
        assert!(
            (flow.state(&p, t).expect("a linear field") - exact * &p).amax() < 2e-12 * exact.amax(),
            "{t}"
        );
    }
    assert_eq!(flow.transition(&p, 0.0).expect("no time").matrix, Matrix2::identity());
}

#[test]
fn the_manifold_of_the_cubic_regulator_is_followed_at_order_eight() {
    // on the stable manifold ẋ = −x√(1 + x⁴): 1/x² = sinh(2t + c), from d(x⁻²)/dt = 2√(1 + x⁻⁴)
    let exact = |t: f64| (2.0 * t + 1f64.asinh()).sinh().powf(-0.5);
    let p = dvector![1.0, 2f64.sqrt() - 1.0];
    for relative in [1e-6, 1e-9, 1e-12] {
        let flow = VariationalFlow::try_new(&CubicRegulator, tight(relative)).expect("in range");
        let end = flow.state(&p, 2.0).expect("regular");
        assert!(
            (end[0] / exact(2.0) - 1.0).abs() < 2e3 * relative,
            "{relative}: {:e}",
            end[0] / exact(2.0) - 1.0
        );
        let (_, cost) = flow.cost(&p, 2.0).expect("regular");
        // V(x₀) − V(x(T)) with V = −x⁴/4 + ½A(x²)
        let v = |x: f64| {
            let y = x * x;
            -0.25 * y * y + 0.25 * (y * (1.0 + y * y).sqrt() + y.asinh())
        };
        let expected = v(1.0) - v(exact(2.0));
        assert!((cost / expected - 1.0).abs() < 20.0 * relative, "{relative}: {:e}", cost / expected - 1.0);
    }
}

#[test]
fn transition_matrices_compose_invert_and_are_differences() {
    let arm = ArmMinimumTorque::default();
    let flow = VariationalFlow::try_new(&arm, FlowTolerances { relative: 1e-13, absolute: 1e-15 })
        .expect("in range");
    let p = arm_start();
    let whole = flow.transition(&p, 1.2).expect("regular");
    let first = flow.transition(&p, 0.5).expect("regular");
    let second = flow.transition(&first.end, 0.7).expect("regular");
    let scale = whole.matrix.amax();
    assert!((&second.matrix * &first.matrix - &whole.matrix).amax() < 1e-10 * scale);
    let back = flow.transition(&first.end, -0.5).expect("regular");
    assert!((back.matrix * &first.matrix - DMatrix::<f64>::identity(8, 8)).amax() < 1e-9);
    assert!((back.end - &p).amax() < 1e-10);
    let h = 1e-5;
    for j in 0..8 {
        let at = |s: f64| {
            let mut q = p.clone();
            q[j] += s * h;
            flow.state(&q, 0.5).expect("regular")
        };
        let column = (at(-2.0) - at(2.0) + (at(1.0) - at(-1.0)) * 8.0) / (12.0 * h);
        assert!((column - first.matrix.column(j)).amax() < 1e-7 * first.matrix.amax(), "column {j}");
    }
    // Φ h(p) = h(p(T))
    let carried = &first.matrix * arm.field(p.as_slice());
    assert!((carried - arm.field(first.end.as_slice())).amax() < 1e-9);
}

#[test]
fn hamiltonian_and_symplectic_form_are_kept_to_the_tolerance() {
    let arm = ArmMinimumTorque::default();
    let p = arm_start();
    let mut before = 0.0;
    for relative in [1e-8, 1e-10, 1e-12] {
        let flow = VariationalFlow::try_new(&arm, tight(relative)).expect("in range");
        let end = flow.transition(&p, 2.0).expect("regular");
        let defect = end.symplecticity_defect();
        assert!(defect < 100.0 * relative, "{relative}: {defect:e}");
        assert!((arm.hamiltonian(end.end.as_slice()) - arm.hamiltonian(p.as_slice())).abs() < 1e3 * relative);
        assert!(before == 0.0 || defect < 0.1 * before, "{defect:e} after {before:e}");
        before = defect;
    }
    let not = somersault_ftla::flow::Transition {
        matrix: DMatrix::<f64>::identity(8, 8) * 2.0,
        duration: 0.0,
        end: p,
    };
    assert!(not.symplecticity_defect() > 0.5);
}

#[test]
fn the_transition_matrix_is_as_accurate_as_its_tolerance_says() {
    let arm = ArmMinimumTorque::default();
    let mut random = Random::new(5);
    let reference = VariationalFlow::try_new(&arm, tight(1e-14)).expect("in range");
    for relative in [1e-7, 1e-9, 1e-11] {
        let flow = VariationalFlow::try_new(&arm, tight(relative)).expect("in range");
        for _ in 0..5 {
            let p = arm_start() + DVector::from_fn(8, |_, _| 1e-3 * random.unit());
            let (found, exact) = (flow.transition(&p, 1.0), reference.transition(&p, 1.0));
            let (found, exact) = (found.expect("regular"), exact.expect("regular"));
            for j in 0..8 {
                let gap =
                    (found.matrix.column(j) - exact.matrix.column(j)).norm() / exact.matrix.column(j).norm();
                assert!(gap < 100.0 * relative, "{relative}, column {j}: {gap:e}");
            }
        }
    }
}

#[test]
fn a_chain_is_the_transition_matrix_in_factors_of_bounded_growth() {
    let arm = ArmMinimumTorque::default();
    let flow = VariationalFlow::try_new(&arm, FlowTolerances::default()).expect("in range");
    let p = arm_start();
    let mut chain = Chain::new();
    for sign in [1.0, -1.0] {
        let times = [0.5 * sign, 1.1 * sign, 1.6 * sign];
        flow.chain_into(&p, &times, 50.0, &mut chain).expect("regular");
        for (mark, &t) in times.iter().enumerate() {
            let product = chain.until(mark).iter().fold(DMatrix::identity(8, 8), |m, link| &link.matrix * m);
            let whole = flow.transition(&p, t).expect("regular");
            assert!((product - &whole.matrix).amax() < 1e-9 * whole.matrix.amax(), "{t}");
            let end = &chain.until(mark).last().expect("links").end;
            assert!((end - &whole.end).amax() < 1e-9, "{t}");
            let duration: f64 = chain.until(mark).iter().map(|l| l.duration).sum();
            assert!((duration - t).abs() < 1e-14);
        }
        assert!(chain.links().len() > 3 && chain.links().iter().all(|l| l.matrix.amax() < 500.0));
    }
}

/// ẋ = x², which is infinite at t = 1/x.
struct Blowup;

impl VectorField for Blowup {
    #[inline(always)]
    fn dimension(&self) -> usize {
        1
    }

    fn field_into(&self, p: &[f64], h: &mut [f64]) {
        h[0] = p[0] * p[0];
    }

    fn jacobian_into(&self, p: &[f64], d: &mut DMatrix<f64>) {
        d[(0, 0)] = 2.0 * p[0];
    }

    fn conserved(&self, _: &[f64]) -> Option<f64> {
        None
    }
}

/// ẋ = 1 up to x = 1, NaN beyond.
struct Cliff;

impl VectorField for Cliff {
    #[inline(always)]
    fn dimension(&self) -> usize {
        1
    }

    fn field_into(&self, p: &[f64], h: &mut [f64]) {
        h[0] = if p[0] < 1.0 { 1.0 } else { f64::NAN };
    }

    fn jacobian_into(&self, _: &[f64], d: &mut DMatrix<f64>) {
        d[(0, 0)] = 0.0;
    }

    fn conserved(&self, _: &[f64]) -> Option<f64> {
        None
    }
}

#[test]
fn runs_that_cannot_go_on_say_where_and_keep_the_last_state() {
    let one = dvector![0.5];
    let blowup = VariationalFlow::try_new(&Blowup, FlowTolerances::default()).expect("in range");
    match blowup.state(&one, 3.0) {
        Err(FlowError::StepUnderflow { t, state } | FlowError::NonFinite { t, state, .. }) => {
            assert!((t - 2.0).abs() < 1e-6 && state[0] > 1e6, "{t}, {state:?}");
        }
        other => panic!("{other:?}"),
    }
    let cliff = VariationalFlow::try_new(&Cliff, FlowTolerances::default()).expect("in range");
    match cliff.transition(&one, 3.0) {
        Err(FlowError::NonFinite { t, state, .. }) => assert!((t - 0.5).abs() < 1e-9 && state[0] < 1.0),
        other => panic!("{other:?}"),
    }
    assert!(matches!(cliff.state(&dvector![2.0], 1.0), Err(FlowError::NonFinite { source: Some(_), .. })));
    let few = blowup.with_max_steps(3).state(&one, 1.9);
    assert!(matches!(few, Err(FlowError::TooManySteps { steps: 3, .. })), "{few:?}");
}

#[test]
fn arguments_out_of_range_are_named() {
    let bad = |relative, absolute| {
        VariationalFlow::try_new(&LinearRegulator, FlowTolerances { relative, absolute }).err()
    };
    assert!(matches!(
        bad(0.0, 0.0),
        Some(FlowError::Argument(ArgumentError::OutOfRange { argument: "relative", .. }))
    ));
    assert!(matches!(
        bad(f64::NAN, 0.0),
        Some(FlowError::Argument(ArgumentError::OutOfRange { argument: "relative", .. }))
    ));
    assert!(matches!(
        bad(1e-9, -1.0),
        Some(FlowError::Argument(ArgumentError::OutOfRange { argument: "absolute", .. }))
    ));
    let flow = VariationalFlow::try_new(&LinearRegulator, FlowTolerances::default()).expect("in range");
    let p = dvector![1.0, 0.0];
    assert!(matches!(
        flow.state(&p, f64::INFINITY),
        Err(FlowError::Argument(ArgumentError::OutOfRange { argument: "duration", .. }))
    ));
    let nan = dvector![f64::NAN, 0.0];
    assert!(matches!(
        flow.state(&nan, 1.0),
        Err(FlowError::Argument(ArgumentError::OutOfRange { argument: "p", .. }))
    ));
    let mut chain = Chain::new();
    for times in [&[][..], &[1.0, 0.5], &[-1.0, 1.0], &[0.0, 1.0], &[f64::NAN]] {
        let error = flow.chain_into(&p, times, 1e3, &mut chain);
        assert!(
            matches!(error, Err(FlowError::Argument(ArgumentError::OutOfRange { argument: "times", .. }))),
            "{times:?}"
        );
    }
    assert!(matches!(
        flow.chain_into(&p, &[1.0], 1.0, &mut chain),
        Err(FlowError::Argument(ArgumentError::OutOfRange { argument: "growth", .. }))
    ));
}

#[test]
fn tolerances_bound_the_error_of_a_step_and_not_of_a_run() {
    // what a run may be off by: each of its steps by the tolerance, carried on by the Φ that follows it
    let arm = ArmMinimumTorque::default();
    let p = DVector::from_row_slice(&START);
    let exact = VariationalFlow::try_new(&arm, FlowTolerances { relative: 1e-14, absolute: 1e-16 });
    let exact = exact.expect("in range").transition(&p, 2.0).expect("regular");
    for relative in [1e-6, 1e-9, 1e-11] {
        let tolerances = FlowTolerances { relative, absolute: 1e-2 * relative };
        let flow = VariationalFlow::try_new(&arm, tolerances).expect("in range");
        let (found, work) = flow.transition_counted(&p, 2.0).expect("regular");
        let off = (&found.end - &exact.end).amax();
        // the largest entry of Φ over any part of the way is near that over the whole
        let carried = exact.matrix.amax() * p.amax() * relative * work.steps as f64;
        println!("{relative:e}: {off:e} of {carried:e}, {} steps", work.steps);
        assert!(off < carried, "{relative:e}: {off:e}, {} steps, {carried:e}", work.steps);
    }
}
