//! Legendre–Gauss–Radau points: tables, exactness of quadrature, differentiation and interpolation.

use somersault_ocp::collocation::Radau;

fn monomial(x: f64, degree: usize) -> f64 {
    x.powi(degree as i32)
}

/// Abramowitz and Stegun 25.4.31: nodes and weights of Radau's rule, to the digits of N = 2 and 3 in closed form.
#[test]
fn points_and_weights_are_those_of_the_tables() {
    let root6 = 6f64.sqrt();
    let cases = [
        (vec![-1.0], vec![2.0]),
        (vec![-1.0, 1.0 / 3.0], vec![0.5, 1.5]),
        (
            vec![-1.0, (1.0 - root6) / 5.0, (1.0 + root6) / 5.0],
            vec![2.0 / 9.0, (16.0 + root6) / 18.0, (16.0 - root6) / 18.0],
        ),
    ];
    for (points, weights) in cases {
        let radau = Radau::try_new(points.len()).unwrap();
        for (found, expected) in
            radau.points().iter().chain(radau.weights()).zip(points.iter().chain(&weights))
        {
            assert!((found - expected).abs() < 1e-15, "N = {}: {found} for {expected}", points.len());
        }
    }
    // E. W. Weisstein, "Radau Quadrature", MathWorld, N = 5.
    let five = Radau::try_new(5).unwrap();
    for (found, expected) in five.points().iter().zip([-1.0, -0.72048, -0.167181, 0.446314, 0.885792]) {
        assert!((found - expected).abs() < 1e-6);
    }
    for (found, expected) in five.weights().iter().zip([0.08, 0.446208, 0.623653, 0.562712, 0.287427]) {
        assert!((found - expected).abs() < 1e-6);
    }
}

#[test]
fn points_are_roots_of_the_sum_of_two_legendre_polynomials_to_1e_14() {
    for n in [1, 2, 5, 16, 40, 100, 500] {
        let radau = Radau::try_new(n).unwrap();
        assert!(radau.points().windows(2).all(|w| w[0] < w[1]));
        let sum: f64 = radau.weights().iter().sum();
        assert!((sum - 2.0).abs() < 1e-14 * (n as f64).sqrt(), "N = {n}: the weights have the sum {sum}");
        for &x in radau.points() {
            let (mut before, mut last) = (1.0, x);
            let (mut slope_before, mut slope) = (0.0, 1.0);
            for k in 1..n {
                let k = k as f64;
                let next = ((2.0 * k + 1.0) * x * last - k * before) / (k + 1.0);
                let slope_next = ((2.0 * k + 1.0) * (last + x * slope) - k * slope_before) / (k + 1.0);
                (before, last, slope_before, slope) = (last, next, slope, slope_next);
            }
            let distance = (before + last) / (slope_before + slope);
            assert!(distance.abs() < 1e-14, "N = {n}: the root at {x} is off by {distance}");
        }
    }
}

#[test]
fn quadrature_is_exact_to_degree_2n_minus_2_and_no_further() {
    for n in 1..=24 {
        let radau = Radau::try_new(n).unwrap();
        let integral = |degree| {
            let terms = radau.points().iter().zip(radau.weights());
            terms.map(|(&x, w)| w * monomial(x, degree)).sum::<f64>()
        };
        let exact = |degree: usize| if degree.is_multiple_of(2) { 2.0 / (degree as f64 + 1.0) } else { 0.0 };
        for degree in 0..=2 * n - 2 {
            let error = integral(degree) - exact(degree);
            assert!(error.abs() < 2e-15 * n as f64, "N = {n}, degree {degree}: {error}");
        }
        if n <= 8 {
            assert!((integral(2 * n - 1) - exact(2 * n - 1)).abs() > 1e-7, "N = {n} is exact too far");
        }
    }
}

#[test]
fn differentiation_is_exact_to_degree_n() {
    for n in [1, 2, 3, 5, 8, 13, 21, 40] {
        let radau = Radau::try_new(n).unwrap();
        let (d, nodes) = (radau.differentiation(), radau.state_nodes());
        assert_eq!((d.nrows(), d.ncols()), (n, n + 1));
        // entries grow like N², and rounding with them
        let tolerance = 4.0 * f64::EPSILON * (n * n) as f64 + 1e-15;
        for degree in 0..=n {
            for i in 0..n {
                let found: f64 = (0..=n).map(|j| d[(i, j)] * monomial(nodes[j], degree)).sum();
                let exact = if degree == 0 { 0.0 } else { degree as f64 * monomial(nodes[i], degree - 1) };
                assert!((found - exact).abs() < tolerance, "N = {n}, degree {degree}: {found} for {exact}");
            }
        }
    }
}

#[test]
fn integration_undoes_differentiation() {
    for n in [1, 2, 4, 9, 20] {
        let radau = Radau::try_new(n).unwrap();
        let (a, nodes) = (radau.integration(), radau.state_nodes());
        for degree in 0..n {
            for i in 0..n {
                let found: f64 = (0..n).map(|j| a[(i, j)] * monomial(nodes[j], degree)).sum();
                let power = degree + 1;
                let exact = (monomial(nodes[i + 1], power) - monomial(-1.0, power)) / power as f64;
                assert!((found - exact).abs() < 1e-14, "N = {n}, degree {degree}: {found} for {exact}");
            }
        }
    }
}

#[test]
fn interpolation_is_exact_to_the_degree_of_each_basis() {
    for n in [1, 2, 5, 12, 30] {
        let radau = Radau::try_new(n).unwrap();
        let (mut states, mut controls) = (vec![0.0; n + 1], vec![0.0; n]);
        for tau in [-1.0, -0.77, 0.0, 1.0 / 3.0, 0.9, 1.0] {
            radau.state_basis(tau, &mut states);
            radau.control_basis(tau, &mut controls);
            for degree in 0..=n {
                let value = |basis: &[f64]| -> f64 {
                    basis.iter().zip(radau.state_nodes()).map(|(b, &x)| b * monomial(x, degree)).sum()
                };
                let exact = monomial(tau, degree);
                assert!((value(&states) - exact).abs() < 1e-14, "N = {n}, degree {degree}, τ = {tau}");
                if degree < n {
                    assert!((value(&controls) - exact).abs() < 5e-14, "N = {n}, degree {degree}, τ = {tau}");
                }
            }
        }
    }
}

#[test]
fn no_points_and_too_many_are_refused() {
    assert!(Radau::try_new(0).is_err());
    assert!(Radau::try_new(501).is_err());
}
