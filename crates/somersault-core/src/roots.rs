//! Sign changes of a function between two points.
//!
//! What is sought is where a predicate changes, so the end of the bracket is as much a result as its
//! middle: [`bracket`] returns the last point found on the near side and the first found on the far
//! side. A value counts as near or far by the predicate f < 0, so that a zero belongs to the side of the
//! positive values.
//!
//! T. R. Chandrupatla, Adv. Eng. Softw. 28 (1997) 145: inverse quadratic interpolation where three values
//! show it to be safe, bisection elsewhere.

/// Narrows a sign change of `f` between `near` and `far`, each a point and its value, to `tolerance`.
///
/// `guess` is the first point tried, if it lies between the two. Returns a point of the near side and one
/// of the far side no more than twice `tolerance` apart, which must exceed the spacing of the numbers there.
///
/// Cost: about 6 to 9 evaluations where `f` is smooth, at most 200; after that the bracket is still
/// valid, but may be wider than asked. An error of `f` ends the search.
pub fn bracket<E>(
    mut f: impl FnMut(f64) -> Result<f64, E>,
    near: (f64, f64),
    far: (f64, f64),
    guess: f64,
    tolerance: f64,
) -> Result<(f64, f64), E> {
    let far_is_negative = far.1 < 0.0;
    // (x1, f1) is the newest point, (x2, f2) lies across the sign change, (x3, f3) was left behind.
    let ((mut x1, mut f1), (mut x2, mut f2)) = (far, near);
    let mut fraction = (guess - x1) / (x2 - x1);
    for _ in 0..200 {
        let least = tolerance / (x2 - x1).abs();
        // A bracket of zero or unordered width gives a NaN or an infinity here, and ends as well.
        if least.is_nan() || least >= 0.5 {
            break;
        }
        if fraction.is_nan() {
            fraction = 0.5;
        }
        let x = x1 + fraction.clamp(least, 1.0 - least) * (x2 - x1);
        let value = f(x)?;
        let (x3, f3);
        if (value < 0.0) == (f1 < 0.0) {
            (x3, f3) = (x1, f1);
        } else {
            (x3, f3) = (x2, f2);
            (x2, f2) = (x1, f1);
        }
        (x1, f1) = (x, value);
        let (xi, phi) = ((x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2));
        fraction = if phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi {
            f1 / (f2 - f1) * f3 / (f2 - f3) + (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2)
        } else {
            0.5
        };
    }
    Ok(if (f1 < 0.0) == far_is_negative { (x2, x1) } else { (x1, x2) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    fn find(f: impl Fn(f64) -> f64, a: f64, b: f64, guess: f64) -> ((f64, f64), u32) {
        let mut calls = 0;
        let counted = |x| {
            calls += 1;
            Ok::<_, Infallible>(f(x))
        };
        let Ok(found) = bracket(counted, (a, f(a)), (b, f(b)), guess, 4.0 * f64::EPSILON * b.abs());
        (found, calls)
    }

    #[test]
    fn a_smooth_root_takes_nine_evaluations_and_its_far_side_is_far() {
        for (root, guess) in [(0.3, 0.5), (1e-3, 0.9), (0.999, 0.1), (0.5, f64::NAN)] {
            let f = |x: f64| (x - root) * (2.0 + x) + (x - root).powi(3);
            for sign in [1.0, -1.0] {
                let ((near, far), calls) = find(|x| sign * f(x), 0.0, 1.0, guess);
                assert!((near - root).abs() < 2e-15 && (far - root).abs() < 2e-15, "{near} {far}");
                assert_eq!(sign * f(far) < 0.0, sign < 0.0, "the far side of {root}");
                assert!(calls <= 12, "{calls}");
            }
        }
    }

    #[test]
    fn a_jump_and_a_flat_root_are_bracketed() {
        let ((near, far), calls) = find(|x| if x < 0.37 { 1.0 } else { -2.0 }, 0.0, 1.0, 0.5);
        assert!(near < 0.37 && far >= 0.37 && far - near < 2e-15 && calls < 120, "{calls}");
        let ((near, far), calls) = find(|x| (0.25 - x).powi(9), 0.0, 1.0, 0.5);
        assert!(near <= far && (far - 0.25).abs() < 1e-6 && calls < 200, "{near} {far} {calls}");
    }

    #[test]
    fn a_root_at_the_near_end_is_found_there() {
        let ((near, far), _) = find(|x| -x, 0.0, 1.0, 0.5);
        assert!(near == 0.0 && far > 0.0 && far < 2e-15);
    }
}
