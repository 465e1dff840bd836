//! Methods of few stages as constant data: what steps with them, and what differentiates such a step, reads the same numbers.
//!
//! Sources: W. Kutta, Z. Math. Phys. 46 (1901) 435; E. Celledoni, A. Marthinsen and B. Owren, Future Gener. Comput. Syst. 19
//! (2003) 341.

/// A combination of slopes Σ_j n_j/d k_j.
///
/// A step that adds n_j k_j and multiplies the sum by h/d rounds less; one that is differentiated takes the factors n_j/d.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Combination {
    /// n, whole numbers.
    pub numerators: &'static [f64],
    /// d.
    pub denominator: f64,
    /// n/d.
    pub factors: &'static [f64],
}

macro_rules! combination {
    ([$($numerator:literal),+] / $denominator:literal) => {
        Combination {
            numerators: &[$($numerator),+],
            denominator: $denominator,
            factors: &[$($numerator / $denominator),+],
        }
    };
}

/// The numbers of an explicit Runge–Kutta method, arguments of [`Tableau::try_new`](super::Tableau::try_new).
///
/// ```text
/// k_i = f(t + c_i h, x + h Σ_{j<i} a_ij k_j),   x₊ = x + h Σ_i b_i k_i
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ButcherTableau {
    /// c.
    pub nodes: &'static [f64],
    /// The rows of a, each as long as there are stages before its own.
    pub rows: &'static [&'static [f64]],
    /// b.
    pub weights: Combination,
}

/// The numbers of a commutator-free method, whose displacements follow one another as exponentials.
///
/// ```text
/// q_i = exp(h Σ_j a_ij k_j) q_from,   q₊ = … exp(h Σ_j b²_j k_j) exp(h Σ_j b¹_j k_j) q
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommutatorFreeTableau {
    /// The method that the sums of its exponentials are on a vector space; rates take it.
    pub on_vectors: ButcherTableau,
    /// How each stage but the first is reached.
    pub stages: &'static [Exponential],
    /// The exponentials of the step, the one that acts first before the others.
    pub end: &'static [Combination],
}

/// How a stage of a commutator-free method is reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exponential {
    /// The stage from which it continues, 0 for the start of the step.
    pub from: usize,
    /// Factors of the slopes of the stages before it.
    pub factors: &'static [f64],
}

/// Euler's method.
pub const EULER: CommutatorFreeTableau = CommutatorFreeTableau {
    on_vectors: ButcherTableau { nodes: &[0.0], rows: &[&[]], weights: combination!([1.0] / 1.0) },
    stages: &[],
    end: &[combination!([1.0] / 1.0)],
};

/// Runge's method of order 2 by the midpoint.
pub(crate) const MIDPOINT: ButcherTableau =
    ButcherTableau { nodes: &[0.0, 0.5], rows: &[&[], &[0.5]], weights: combination!([0.0, 1.0] / 1.0) };

/// Heun's method of order 2.
pub(crate) const HEUN: ButcherTableau =
    ButcherTableau { nodes: &[0.0, 1.0], rows: &[&[], &[1.0]], weights: combination!([1.0, 1.0] / 2.0) };

/// The classical method of order 4.
pub const RUNGE_KUTTA_4: ButcherTableau = ButcherTableau {
    nodes: &[0.0, 0.5, 0.5, 1.0],
    rows: &[&[], &[0.5], &[0.0, 0.5], &[0.0, 0.0, 1.0]],
    weights: combination!([1.0, 2.0, 2.0, 1.0] / 6.0),
};

/// The method of order 4 of Celledoni, Marthinsen and Owren.
pub const COMMUTATOR_FREE_4: CommutatorFreeTableau = CommutatorFreeTableau {
    on_vectors: RUNGE_KUTTA_4,
    stages: &[
        Exponential { from: 0, factors: &[0.5] },
        Exponential { from: 0, factors: &[0.0, 0.5] },
        Exponential { from: 1, factors: &[-0.5, 0.0, 1.0] },
    ],
    end: &[combination!([3.0, 2.0, 2.0, -1.0] / 12.0), combination!([-1.0, 2.0, 2.0, 3.0] / 12.0)],
};

#[cfg(test)]
mod tests {
    use super::super::Tableau;
    use super::*;

    #[test]
    fn constants_are_tableaus() {
        for ButcherTableau { nodes, rows, weights } in [EULER.on_vectors, MIDPOINT, HEUN, RUNGE_KUTTA_4] {
            let tableau = Tableau::try_new(rows, weights.factors, nodes).unwrap();
            assert_eq!(tableau.stages(), rows.len());
            assert!(rows.iter().enumerate().all(|(i, row)| row.len() == i));
        }
    }

    /// The classical method has order 4: all eight conditions.
    #[test]
    fn the_classical_method_meets_its_order_conditions() {
        let ButcherTableau { nodes: c, rows: a, weights } = RUNGE_KUTTA_4;
        let of_rows = |x: &[f64]| -> Vec<f64> {
            a.iter().map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum()).collect()
        };
        let squares: Vec<f64> = c.iter().map(|c| c * c).collect();
        let (once, of_squares) = (of_rows(c), of_rows(&squares));
        let twice = of_rows(&once);
        for (expected, of_stage) in [
            (1.0, &(|_| 1.0) as &dyn Fn(usize) -> f64),
            (1.0 / 2.0, &|i| c[i]),
            (1.0 / 3.0, &|i| c[i] * c[i]),
            (1.0 / 6.0, &|i| once[i]),
            (1.0 / 4.0, &|i| c[i] * c[i] * c[i]),
            (1.0 / 8.0, &|i| c[i] * once[i]),
            (1.0 / 12.0, &|i| of_squares[i]),
            (1.0 / 24.0, &|i| twice[i]),
        ] {
            let found: f64 = weights.factors.iter().enumerate().map(|(i, b)| b * of_stage(i)).sum();
            assert!((found - expected).abs() < 1e-15, "{found} {expected}");
        }
    }

    /// The exponentials that lead to each stage and to the end of the step.
    #[test]
    fn exponentials_add_up_to_the_method_on_vectors() {
        for CommutatorFreeTableau { on_vectors, stages, end } in [EULER, COMMUTATOR_FREE_4] {
            let mut reached = vec![vec![0.0; on_vectors.nodes.len()]];
            for (Exponential { from, factors }, row) in stages.iter().zip(&on_vectors.rows[1..]) {
                assert_eq!((factors.len(), *from < reached.len()), (row.len(), true));
                let mut sum = reached[*from].clone();
                sum.iter_mut().zip(*factors).for_each(|(sum, factor)| *sum += factor);
                assert_eq!(&sum[..row.len()], *row);
                reached.push(sum);
            }
            for (i, weight) in on_vectors.weights.factors.iter().enumerate() {
                let sum: f64 = end.iter().map(|exponential| exponential.factors[i]).sum();
                assert!((sum - weight).abs() < 1e-16);
            }
        }
    }
}
