//! Formulas over any scalar, recorded: their values, derivatives and branches.

use nalgebra::{ComplexField, Matrix3, RealField, Vector3};
use num_dual::Dual64;
use num_traits::{Num, Signed};
use somersault_core::Scalar;
use somersault_core::random::SplitMix64;
use somersault_core::scalar::constant;
use somersault_expr::{ArgumentError, Block, ExprError, ExprFunction, Traced};

fn record<const N: usize>(at: [f64; N], formula: impl Fn(&[Traced]) -> Vec<Traced>) -> ExprFunction {
    ExprFunction::record(vec![Block::new("x", [N])], &at, |x| Ok::<_, ExprError>(formula(x)))
        .expect("a graph")
}

fn values(f: &ExprFunction, at: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; f.n_outputs()];
    f.evaluator().evaluate(at, &mut out).expect("lengths fit");
    out
}

/// What a scalar has, of two numbers between 0.1 and 0.9.
fn functions<T: Scalar>(x: T, y: T) -> Vec<T> {
    let c = constant::<T>;
    vec![
        x + y,
        x - y,
        x * y,
        x / y,
        -x,
        ComplexField::sqrt(x),
        ComplexField::cbrt(x),
        ComplexField::exp(x),
        ComplexField::exp2(x),
        ComplexField::exp_m1(x),
        ComplexField::ln(x),
        ComplexField::ln_1p(x),
        ComplexField::log2(x),
        ComplexField::log10(x),
        ComplexField::log(x, y + c(2.0)),
        ComplexField::sin(x),
        ComplexField::cos(x),
        ComplexField::sin_cos(x).0,
        ComplexField::sin_cos(x).1,
        ComplexField::tan(x),
        ComplexField::asin(x),
        ComplexField::acos(x),
        ComplexField::atan(x),
        ComplexField::sinh(x),
        ComplexField::cosh(x),
        ComplexField::tanh(x),
        ComplexField::asinh(x),
        ComplexField::acosh(x + T::one()),
        ComplexField::atanh(x),
        ComplexField::powi(x, 3),
        ComplexField::powf(x, y),
        ComplexField::powc(x, y),
        ComplexField::recip(x),
        ComplexField::mul_add(x, y, c(3.0)),
        ComplexField::modulus(-x),
        ComplexField::modulus_squared(x),
        ComplexField::scale(x, y),
        ComplexField::unscale(x, y),
        ComplexField::hypot(x, y),
        ComplexField::conjugate(x),
        RealField::atan2(x, y),
        RealField::max(x, c(2.0)),
        RealField::min(x, c(2.0)),
        RealField::clamp(x, c(-1.0), c(1.0)),
        T::two_pi() * x + T::e() * T::frac_pi_8() - T::ln_10(),
    ]
}

/// What duals do not have, or have a derivative of that is not wanted.
fn steps<T: Scalar>(x: T, y: T) -> Vec<T> {
    let c = constant::<T>;
    vec![
        ComplexField::floor(x),
        ComplexField::ceil(x),
        ComplexField::trunc(x),
        ComplexField::fract(x),
        x % y,
        ComplexField::abs(x),
        Signed::signum(&x),
        RealField::copysign(y, x),
        RealField::max(x, y),
        RealField::min(x, y),
        RealField::clamp(x, c(-1.0), c(1.0)),
        ComplexField::argument(x),
    ]
}

#[test]
fn recorded_functions_have_the_values_and_derivatives_of_their_formula() {
    let mut random = SplitMix64::new(1);
    let f = record([0.5, 0.4], |x| functions(x[0], x[1]));
    let jacobian = f.jacobian().unwrap();
    for _ in 0..20 {
        let at = [0.1 + 0.8 * random.unit(), 0.1 + 0.8 * random.unit()];
        let close = |a: f64, b: f64| (a - b).abs() <= 4e-15 * (1.0 + b.abs());
        for (k, (found, direct)) in values(&f, &at).iter().zip(functions(at[0], at[1])).enumerate() {
            assert!(close(*found, direct), "{k}: {found} {direct}");
        }
        let mut entries = vec![0.0; jacobian.sparsity().entries().count()];
        jacobian.evaluator().evaluate(&at, &mut entries).unwrap();
        let mut dense = vec![[0.0; 2]; f.n_outputs()];
        jacobian.sparsity().entries().zip(entries).for_each(|((i, j), d)| dense[i][j] = d);
        for j in 0..2 {
            let mut x = at.map(Dual64::from_re);
            x[j].eps = 1.0;
            for (k, dual) in functions(x[0], x[1]).iter().enumerate() {
                assert!(close(dense[k][j], dual.eps), "{k} by {j}: {} {}", dense[k][j], dual.eps);
            }
        }
    }
}

#[test]
fn recorded_steps_are_those_of_numbers() {
    let f = record([0.5, 0.4], |x| steps(x[0], x[1]));
    let mut random = SplitMix64::new(2);
    for _ in 0..200 {
        let at = [6.0 * random.unit() - 3.0, 0.1 + random.unit()];
        let direct = steps(at[0], at[1]);
        for (k, (found, direct)) in values(&f, &at).iter().zip(direct).enumerate() {
            assert!((found - direct).abs() < 1e-14, "{k} at {at:?}: {found} {direct}");
        }
    }
}

#[test]
fn a_branch_holds_where_it_was_recorded_and_is_nan_elsewhere() {
    let branch = |x: &[Traced]| vec![if x[0] > x[1] { x[0] * x[0] } else { x[1] }, x[1] + constant(1.0)];
    let (above, below) = (record([2.0, 1.0], branch), record([1.0, 2.0], branch));
    assert_eq!(values(&above, &[3.0, -1.0]), [9.0, 0.0]);
    assert!(values(&above, &[-1.0, 3.0]).iter().all(|x| x.is_nan()));
    assert_eq!(values(&below, &[-1.0, 3.0]), [3.0, 4.0]);
    assert!(values(&below, &[3.0, -1.0]).iter().all(|x| x.is_nan()));
    // derivatives are those of the branch, and no more entries
    assert_eq!(above.jacobian().unwrap().sparsity().entries().collect::<Vec<_>>(), [(0, 0), (1, 1)]);
    assert_eq!(above.hessian().unwrap().sparsity().entries().collect::<Vec<_>>(), [(0, 0)]);
    // constants are compared while it is recorded
    let plain = record([2.0], |x| vec![if constant::<Traced>(1.0) < constant(2.0) { x[0] } else { -x[0] }]);
    assert_eq!((values(&plain, &[f64::MAX]), plain.n_instructions()), (vec![f64::MAX], 0));
    let finite = record([2.0], |x| vec![if ComplexField::is_finite(&x[0]) { x[0] } else { constant(0.0) }]);
    assert_eq!(values(&finite, &[5.0]), [5.0]);
    assert!(values(&finite, &[f64::INFINITY])[0].is_nan());
}

#[test]
fn algorithms_of_nalgebra_are_recorded_with_their_pivots() {
    let solve = |x: &[Traced]| {
        let matrix = Matrix3::from_column_slice(&x[..9]);
        matrix.lu().solve(&Vector3::from_column_slice(&x[9..])).expect("regular").as_slice().to_vec()
    };
    let at = [1.0, 4.0, 2.0, 3.0, 1.0, 0.5, -1.0, 2.0, 6.0, 1.0, 2.0, 3.0];
    let f = record(at, solve);
    let moved = at.map(|x| x + 0.01);
    let exact = Matrix3::from_column_slice(&moved[..9]).lu().solve(&Vector3::from_column_slice(&moved[9..]));
    for (found, exact) in values(&f, &moved).iter().zip(&exact.unwrap()) {
        assert!((found - exact).abs() < 1e-15);
    }
    // another row would be the pivot
    let mut other = at;
    other[0] = 9.0;
    assert!(values(&f, &other).iter().all(|x| x.is_nan()));
}

#[test]
fn what_is_wrong_is_said_and_numbers_of_other_recordings_are_none() {
    let block = || vec![Block::new("x", [1])];
    let short = ExprFunction::record(block(), &[], |x| Ok::<_, ExprError>(x.to_vec())).unwrap_err();
    assert!(
        matches!(short, ExprError::Argument(ArgumentError::Length { expected: 1, found: 0, .. })),
        "{short}"
    );
    let failed = ExprFunction::record(block(), &[1.0], |_| Err(ExprError::Cancelled)).unwrap_err();
    assert_eq!(failed, ExprError::Cancelled);
    let mut kept = None;
    record([1.0], |x| {
        // one within the other
        let inner = record([3.0], |y| vec![y[0] * y[0]]);
        assert_eq!(values(&inner, &[4.0]), [16.0]);
        vec![x[0]]
    });
    ExprFunction::record(block(), &[1.0], |x| {
        kept = Some(x[0]);
        Ok::<_, ExprError>(vec![x[0]])
    })
    .unwrap();
    let kept = kept.unwrap();
    let foreign =
        ExprFunction::record(block(), &[1.0], |x| Ok::<_, ExprError>(vec![x[0] + kept])).unwrap_err();
    assert!(matches!(foreign, ExprError::Foreign { .. }), "{foreign}");
    assert!(nalgebra::try_convert::<Traced, f64>(kept).is_none());
    let outside = kept + kept;
    assert!(nalgebra::try_convert::<Traced, f64>(outside).is_some_and(f64::is_nan));
    assert!(Traced::from_str_radix("2.5", 10).is_ok_and(|x| x.to_string() == "2.5"));
}
