//! Butcher tableaux of explicit Runge–Kutta methods, with error estimates and dense output.
//!
//! ```text
//! u_i = h Σ_{j<i} a_ij K_j,   q_i = exp(u_i) qₙ,   K_i = dexp⁻¹_{u_i}(velocity at stage i)
//! ```
//! A tableau says which stages enter where; [`crate::methods::RungeKuttaMuntheKaas`] takes it to the
//! group. Rows are kept without their zeros, so that a coefficient that is zero costs nothing.
//!
//! Sources of the coefficients: P. Bogacki and L. F. Shampine, Appl. Math. Lett. 2 (1989) 321;
//! J. R. Dormand and P. J. Prince, J. Comput. Appl. Math. 6 (1980) 19; the dense output of the latter
//! by L. F. Shampine, Math. Comp. 46 (1986) 135; DOP853 with its estimates and its dense output from
//! E. Hairer, S. P. Nørsett and G. Wanner, *Solving Ordinary Differential Equations I* (1993),
//! sections II.5, II.6 and II.10.
//!
//! Methods of few stages are constants, [`RUNGE_KUTTA_4`] and [`COMMUTATOR_FREE_4`] beside [`EULER`]: the steppers and the
//! differentiated steps of optimal control read them.

mod classical;
mod dop853;

pub(crate) use classical::{HEUN, MIDPOINT};

pub use classical::{
    ButcherTableau, COMMUTATOR_FREE_4, Combination, CommutatorFreeTableau, EULER, Exponential, RUNGE_KUTTA_4,
};

use somersault_core::argument::{ArgumentError, expect_least, expect_length};
use std::sync::LazyLock;

/// Why a set of numbers is not the tableau of an explicit Runge–Kutta method.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TableauError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A coefficient is NaN or infinite.
    #[error("`{argument}` must be finite, found {found} in row {row}")]
    NonFinite {
        /// Name of the argument.
        argument: &'static str,
        /// Row of the coefficient, 0 for a vector.
        row: usize,
        /// Its value.
        found: f64,
    },
    /// A stage depends on itself or on a later one.
    #[error("`a` must be strictly lower triangular, found {found} in row {row}, column {column}")]
    NotExplicit {
        /// Row of the coefficient.
        row: usize,
        /// Its column.
        column: usize,
        /// Its value.
        found: f64,
    },
    /// A row does not sum to its node.
    #[error("row {row} of `{argument}` must sum to {expected}, found {found}")]
    RowSum {
        /// Name of the argument.
        argument: &'static str,
        /// The row, 0 for a vector.
        row: usize,
        /// What the sum must be.
        expected: f64,
        /// What it is.
        found: f64,
    },
}

/// Coefficients of one combination of slopes: (index of the slope, coefficient), zeros left out.
pub type SparseRow = Vec<(usize, f64)>;

/// Rounding granted to sums, relative to the sum of magnitudes.
const ROUNDING: f64 = 1e-13;

fn sparse(row: &[f64]) -> SparseRow {
    row.iter().copied().enumerate().filter(|(_, a)| *a != 0.0).collect()
}

fn check_finite(argument: &'static str, row: usize, values: &[f64]) -> Result<(), TableauError> {
    match values.iter().find(|a| !a.is_finite()) {
        Some(&found) => Err(TableauError::NonFinite { argument, row, found }),
        None => Ok(()),
    }
}

fn check_sum(argument: &'static str, row: usize, values: &[f64], expected: f64) -> Result<(), TableauError> {
    let found: f64 = values.iter().sum();
    let scale: f64 = expected.abs() + values.iter().map(|a| a.abs()).sum::<f64>();
    if (found - expected).abs() <= ROUNDING * scale.max(1.0) {
        Ok(())
    } else {
        Err(TableauError::RowSum { argument, row, expected, found })
    }
}

/// An explicit Runge–Kutta method: stages, nodes and weights.
#[derive(Debug, Clone, PartialEq)]
pub struct Tableau {
    rows: Vec<SparseRow>,
    weights: SparseRow,
    nodes: Vec<f64>,
    first_same_as_last: bool,
}

impl Tableau {
    /// A method of `b.len()` stages; `a` has one row for each, of that length or cut after the last
    /// coefficient that may differ from zero.
    ///
    /// Checks that `a` is strictly lower triangular, that each row sums to its node in `c`, and that
    /// `b` sums to one; the order is the user's to know.
    pub fn try_new<R: AsRef<[f64]>>(a: &[R], b: &[f64], c: &[f64]) -> Result<Self, TableauError> {
        let stages = b.len();
        expect_least("b", stages, 1)?;
        expect_length("a", a.len(), stages)?;
        expect_length("c", c.len(), stages)?;
        check_finite("b", 0, b)?;
        check_finite("c", 0, c)?;
        check_sum("b", 0, b, 1.0)?;
        for (i, row) in a.iter().map(AsRef::as_ref).enumerate() {
            check_finite("a", i, row)?;
            if let Some((column, &found)) = row.iter().enumerate().skip(i).find(|(_, a)| **a != 0.0) {
                return Err(TableauError::NotExplicit { row: i, column, found });
            }
            check_sum("a", i, row, c[i])?;
        }
        let rows: Vec<SparseRow> = a.iter().map(|row| sparse(row.as_ref())).collect();
        let weights = sparse(b);
        let first_same_as_last = stages > 1 && c[stages - 1] == 1.0 && rows[stages - 1] == weights;
        Ok(Self { rows, weights, nodes: c.to_vec(), first_same_as_last })
    }

    /// A method with few stages that is given as constants.
    pub(crate) fn of(ButcherTableau { nodes, rows, weights }: &ButcherTableau) -> Self {
        Self {
            rows: rows.iter().map(|row| sparse(row)).collect(),
            weights: sparse(weights.factors),
            nodes: nodes.to_vec(),
            first_same_as_last: false,
        }
    }

    /// The twelve stages of DOP853, of order 8, with the weights of its error estimate.
    pub fn dop853() -> (&'static Self, &'static ErrorWeights) {
        let pair = &*DOP853;
        (&pair.tableau, &pair.error)
    }

    /// Number of stages.
    pub fn stages(&self) -> usize {
        self.nodes.len()
    }

    /// Coefficients of stage `i < stages()`.
    #[inline]
    pub fn row(&self, i: usize) -> &[(usize, f64)] {
        &self.rows[i]
    }

    /// Time of stage `i < stages()` as a fraction of the step.
    #[inline]
    pub fn node(&self, i: usize) -> f64 {
        self.nodes[i]
    }

    /// Weights of the slopes in the step.
    #[inline]
    pub fn weights(&self) -> &[(usize, f64)] {
        &self.weights
    }

    /// Whether the last stage lies at the end of the step and so serves as the first of the next.
    #[inline]
    pub fn first_same_as_last(&self) -> bool {
        self.first_same_as_last
    }
}

/// How the error of a step is estimated from its slopes.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorWeights {
    pub(crate) main: SparseRow,
    pub(crate) correction: Option<SparseRow>,
}

impl ErrorWeights {
    /// The difference between the step and a second one with weights `embedded`, of another order.
    pub fn try_new(tableau: &Tableau, embedded: &[f64]) -> Result<Self, TableauError> {
        expect_length("embedded", embedded.len(), tableau.stages())?;
        check_finite("embedded", 0, embedded)?;
        check_sum("embedded", 0, embedded, 1.0)?;
        let mut difference: Vec<f64> = embedded.iter().map(|b| -b).collect();
        for &(j, b) in tableau.weights() {
            difference[j] += b;
        }
        Ok(Self { main: sparse(&difference), correction: None })
    }

    /// Weights of the slopes whose sum e₁ estimates the error.
    pub fn main(&self) -> &[(usize, f64)] {
        &self.main
    }

    /// Weights of a second estimate e₂ of lower order, if there is one: the error is then e₁²/√(e₁² + e₂²/100).
    pub fn correction(&self) -> Option<&[(usize, f64)]> {
        self.correction.as_deref()
    }
}

/// Polynomials b_i(θ) that make a curve of the slopes of a step: σ(θ) = h Σ b_i(θ) K_i.
///
/// Slopes are counted as stages first, then the slope at the end of the step unless it is the last
/// stage already, then extra stages that only the curve needs.
#[derive(Debug, Clone, PartialEq)]
pub struct DenseWeights {
    /// Node and row of each extra stage.
    pub(crate) extra: Vec<(f64, SparseRow)>,
    /// For each power θ, θ², … the coefficients of the slopes.
    pub(crate) powers: Vec<SparseRow>,
}

impl DenseWeights {
    /// A curve through the slopes the step has anyway: `powers[k][i]` is the coefficient of θᵏ⁺¹ in
    /// b_i(θ), for each stage i.
    pub fn try_new<R: AsRef<[f64]>>(tableau: &Tableau, powers: &[R]) -> Result<Self, TableauError> {
        expect_least("powers", powers.len(), 1)?;
        let mut at_end = vec![0.0; tableau.stages()];
        for &(j, b) in tableau.weights() {
            at_end[j] = b;
        }
        for (k, row) in powers.iter().map(AsRef::as_ref).enumerate() {
            expect_length("powers", row.len(), tableau.stages())?;
            check_finite("powers", k, row)?;
        }
        // At θ = 1 the curve must meet the step.
        for (i, expected) in at_end.into_iter().enumerate() {
            let column: Vec<f64> = powers.iter().map(|row| row.as_ref()[i]).collect();
            check_sum("powers", i, &column, expected)?;
        }
        Ok(Self { extra: Vec::new(), powers: powers.iter().map(|row| sparse(row.as_ref())).collect() })
    }
}

/// A method with all that belongs to it.
#[derive(Debug)]
pub(crate) struct Pair {
    pub(crate) tableau: Tableau,
    pub(crate) error: ErrorWeights,
    pub(crate) dense: DenseWeights,
}

/// Bogacki and Shampine's pair of orders 3 and 2; its curve is the cubic Hermite interpolant.
pub(crate) static BOGACKI_SHAMPINE: LazyLock<Pair> = LazyLock::new(|| {
    let tableau = Tableau {
        rows: vec![
            vec![],
            vec![(0, 0.5)],
            vec![(1, 0.75)],
            vec![(0, 2.0 / 9.0), (1, 1.0 / 3.0), (2, 4.0 / 9.0)],
        ],
        weights: vec![(0, 2.0 / 9.0), (1, 1.0 / 3.0), (2, 4.0 / 9.0)],
        nodes: vec![0.0, 0.5, 0.75, 1.0],
        first_same_as_last: true,
    };
    // The estimate is the difference to b̂ = (7/24, 1/4, 1/3, 1/8).
    let main = vec![(0, -5.0 / 72.0), (1, 1.0 / 12.0), (2, 1.0 / 9.0), (3, -1.0 / 8.0)];
    let powers = vec![
        vec![(0, 1.0)],
        vec![(0, -4.0 / 3.0), (1, 1.0), (2, 4.0 / 3.0), (3, -1.0)],
        vec![(0, 5.0 / 9.0), (1, -2.0 / 3.0), (2, -8.0 / 9.0), (3, 1.0)],
    ];
    Pair {
        tableau,
        error: ErrorWeights { main, correction: None },
        dense: DenseWeights { extra: Vec::new(), powers },
    }
});

/// Dormand and Prince's pair of orders 5 and 4, with Shampine's curve of order 4.
pub(crate) static DORMAND_PRINCE: LazyLock<Pair> = LazyLock::new(|| {
    let weights = vec![
        (0, 35.0 / 384.0),
        (2, 500.0 / 1113.0),
        (3, 125.0 / 192.0),
        (4, -2187.0 / 6784.0),
        (5, 11.0 / 84.0),
    ];
    let tableau = Tableau {
        rows: vec![
            vec![],
            vec![(0, 1.0 / 5.0)],
            vec![(0, 3.0 / 40.0), (1, 9.0 / 40.0)],
            vec![(0, 44.0 / 45.0), (1, -56.0 / 15.0), (2, 32.0 / 9.0)],
            vec![
                (0, 19_372.0 / 6561.0),
                (1, -25_360.0 / 2187.0),
                (2, 64_448.0 / 6561.0),
                (3, -212.0 / 729.0),
            ],
            vec![
                (0, 9017.0 / 3168.0),
                (1, -355.0 / 33.0),
                (2, 46_732.0 / 5247.0),
                (3, 49.0 / 176.0),
                (4, -5103.0 / 18_656.0),
            ],
            weights.clone(),
        ],
        weights,
        nodes: vec![0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0],
        first_same_as_last: true,
    };
    let main = vec![
        (0, 71.0 / 57_600.0),
        (2, -71.0 / 16_695.0),
        (3, 71.0 / 1920.0),
        (4, -17_253.0 / 339_200.0),
        (5, 22.0 / 525.0),
        (6, -1.0 / 40.0),
    ];
    let powers = vec![
        vec![(0, 1.0)],
        vec![
            (0, -8_048_581_381.0 / 2_820_520_608.0),
            (2, 131_558_114_200.0 / 32_700_410_799.0),
            (3, -1_754_552_775.0 / 470_086_768.0),
            (4, 127_303_824_393.0 / 49_829_197_408.0),
            (5, -282_668_133.0 / 205_662_961.0),
            (6, 40_617_522.0 / 29_380_423.0),
        ],
        vec![
            (0, 8_663_915_743.0 / 2_820_520_608.0),
            (2, -68_118_460_800.0 / 10_900_136_933.0),
            (3, 14_199_869_525.0 / 1_410_260_304.0),
            (4, -318_862_633_887.0 / 49_829_197_408.0),
            (5, 2_019_193_451.0 / 616_988_883.0),
            (6, -110_615_467.0 / 29_380_423.0),
        ],
        vec![
            (0, -12_715_105_075.0 / 11_282_082_432.0),
            (2, 87_487_479_700.0 / 32_700_410_799.0),
            (3, -10_690_763_975.0 / 1_880_347_072.0),
            (4, 701_980_252_875.0 / 199_316_789_632.0),
            (5, -1_453_857_185.0 / 822_651_844.0),
            (6, 69_997_945.0 / 29_380_423.0),
        ],
    ];
    Pair {
        tableau,
        error: ErrorWeights { main, correction: None },
        dense: DenseWeights { extra: Vec::new(), powers },
    }
});

/// Dormand and Prince's method of order 8 with Hairer's estimates of orders 5 and 3 and his curve of
/// degree 7.
pub(crate) static DOP853: LazyLock<Pair> = LazyLock::new(dop853::pair);

#[cfg(test)]
mod tests {
    use super::*;

    fn dot(row: &[(usize, f64)], f: impl Fn(usize) -> f64) -> f64 {
        row.iter().map(|&(j, a)| a * f(j)).sum()
    }

    fn pairs() -> [(&'static str, &'static Pair, i32); 3] {
        [("rkmk3", &BOGACKI_SHAMPINE, 3), ("rkmk5", &DORMAND_PRINCE, 5), ("rkmk8", &DOP853, 8)]
    }

    #[test]
    fn rows_sum_to_their_nodes() {
        for (name, pair, _) in pairs() {
            let t = &pair.tableau;
            for i in 0..t.stages() {
                assert!((dot(t.row(i), |_| 1.0) - t.node(i)).abs() < 2e-14, "{name}, row {i}");
                assert!(t.row(i).iter().all(|(j, _)| *j < i), "{name}, row {i}");
            }
            for (node, row) in &pair.dense.extra {
                assert!((dot(row, |_| 1.0) - node).abs() < 2e-14, "{name}, extra stage at {node}");
            }
        }
    }

    #[test]
    fn weights_integrate_powers_up_to_the_order() {
        for (name, pair, order) in pairs() {
            let t = &pair.tableau;
            for k in 0..order {
                let sum = dot(t.weights(), |j| t.node(j).powi(k));
                assert!((sum - 1.0 / f64::from(k + 1)).abs() < 1e-14, "{name}: b·c^{k} = {sum}");
            }
            let next = dot(t.weights(), |j| t.node(j).powi(order));
            assert!((next - 1.0 / f64::from(order + 1)).abs() > 1e-6, "{name} is of order {order}, not more");
        }
    }

    /// The tall trees: b A^k c^m over k and m within the order.
    #[test]
    fn nested_sums_meet_their_order_conditions() {
        for (name, pair, order) in pairs() {
            let t = &pair.tableau;
            for m in 1..order {
                let mut inner: Vec<f64> = (0..t.stages()).map(|j| t.node(j).powi(m)).collect();
                let mut expected = 1.0 / f64::from(m + 1);
                for depth in 0..order - m {
                    let sum = dot(t.weights(), |j| inner[j]);
                    assert!((sum - expected).abs() < 1e-14, "{name}: b A^{depth} c^{m} = {sum}, {expected}");
                    inner = (0..t.stages()).map(|i| dot(t.row(i), |j| inner[j])).collect();
                    expected /= f64::from(m + depth + 2);
                }
            }
        }
    }

    #[test]
    fn error_weights_vanish_on_what_the_lower_order_integrates() {
        for ((name, pair, _), order) in pairs().into_iter().zip([2, 4, 5]) {
            let rows = [Some((&pair.error.main, order)), pair.error.correction.as_ref().map(|c| (c, 3))];
            for (row, order) in rows.into_iter().flatten() {
                for k in 0..order {
                    let sum = dot(row, |j| pair.tableau.node(j).powi(k));
                    assert!(sum.abs() < 1e-14, "{name}: e·c^{k} = {sum}");
                }
                assert!(
                    dot(row, |j| pair.tableau.node(j).powi(order)).abs() > 1e-6,
                    "{name} estimates something"
                );
            }
        }
    }

    #[test]
    fn curves_integrate_powers_up_to_their_order_at_any_time() {
        for ((name, pair, _), order) in pairs().into_iter().zip([3, 4, 7]) {
            let t = &pair.tableau;
            let mut nodes: Vec<f64> = (0..t.stages()).map(|i| t.node(i)).collect();
            if !t.first_same_as_last() {
                nodes.push(1.0);
            }
            nodes.extend(pair.dense.extra.iter().map(|(node, _)| node));
            for theta in [0.2, 0.5, 0.9, 1.0_f64] {
                for k in 0..order {
                    let (mut sum, mut power) = (0.0, 1.0);
                    for row in &pair.dense.powers {
                        power *= theta;
                        sum += power * dot(row, |j| nodes[j].powi(k));
                    }
                    let expected = theta.powi(k + 1) / f64::from(k + 1);
                    assert!((sum - expected).abs() < 2e-13, "{name}, θ = {theta}, c^{k}: {sum} {expected}");
                }
            }
        }
    }

    #[test]
    fn a_tableau_that_is_none_is_refused_by_name() {
        let heun = [vec![], vec![1.0]];
        assert!(Tableau::try_new(&heun, &[0.5, 0.5], &[0.0, 1.0]).is_ok());
        let no_stages: [Vec<f64>; 0] = [];
        for (error, message) in [
            (Tableau::try_new(&no_stages, &[], &[]), "`b` must have at least 1 entries, found 0"),
            (Tableau::try_new(&heun, &[0.5, 0.5], &[0.0]), "`c` must have 2 entries, found 1"),
            (Tableau::try_new(&heun[..1], &[0.5, 0.5], &[0.0, 1.0]), "`a` must have 2 entries, found 1"),
            (Tableau::try_new(&heun, &[0.5, 0.6], &[0.0, 1.0]), "row 0 of `b` must sum to 1, found 1.1"),
            (Tableau::try_new(&heun, &[0.5, 0.5], &[0.0, 0.9]), "row 1 of `a` must sum to 0.9, found 1"),
            (
                Tableau::try_new(&[vec![], vec![f64::NAN]], &[0.5, 0.5], &[0.0, 1.0]),
                "`a` must be finite, found NaN in row 1",
            ),
            (
                Tableau::try_new(&[vec![0.0, 0.5], vec![1.0]], &[0.5, 0.5], &[0.5, 1.0]),
                "`a` must be strictly lower triangular, found 0.5 in row 0, column 1",
            ),
        ] {
            assert_eq!(error.unwrap_err().to_string(), message);
        }
        let tableau = Tableau::try_new(&heun, &[0.5, 0.5], &[0.0, 1.0]).unwrap();
        assert!(ErrorWeights::try_new(&tableau, &[1.0]).is_err());
        assert!(ErrorWeights::try_new(&tableau, &[1.0, 0.0]).is_ok());
        assert!(DenseWeights::try_new(&tableau, &[[1.0, 0.0], [-0.5, 0.4]]).is_err());
        assert!(DenseWeights::try_new(&tableau, &[[1.0, 0.0], [-0.5, 0.5]]).is_ok());
    }

    #[test]
    fn the_last_stage_is_the_next_first_where_the_tableau_has_it_so() {
        assert!(BOGACKI_SHAMPINE.tableau.first_same_as_last());
        assert!(DORMAND_PRINCE.tableau.first_same_as_last());
        assert!(!DOP853.tableau.first_same_as_last());
        let b = [2.0 / 9.0, 1.0 / 3.0, 4.0 / 9.0, 0.0];
        let a = [vec![], vec![0.5], vec![0.0, 0.75], b[..3].to_vec()];
        let user = Tableau::try_new(&a, &b, &[0.0, 0.5, 0.75, 1.0]).unwrap();
        assert_eq!(user, BOGACKI_SHAMPINE.tableau);
    }
}
