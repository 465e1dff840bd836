//! What several of these tests share.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use somersault_core::Scalar;
use somersault_core::random::SplitMix64;
use somersault_ftla::cold_start::ArmTravel;
use somersault_ftla::continuation::{Continuation, ContinuationResult};
use somersault_ftla::system::{PosedProblem, StateCostate, VectorField};
use somersault_multibody::models::TwoLinkArm;
use somersault_ocp::collocation::{Dynamics, Interval, Phase, Point, Problem, Terms};

/// Numbers in [−1, 1) from a fixed seed.
pub(crate) struct Random(SplitMix64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    pub(crate) fn unit(&mut self) -> f64 {
        2.0 * self.0.unit() - 1.0
    }
}

/// The largest difference of two entries.
pub(crate) fn matrix_gap(a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
    (a - b).amax()
}

/// The arm as the thesis writes it, (8.2) corrected, (8.3), (8.7).
#[derive(Clone, Copy)]
pub(crate) struct ArmProblem {
    pub(crate) arm: TwoLinkArm,
    pub(crate) weights: [f64; 2],
    pub(crate) limits: [f64; 2],
}

impl ArmProblem {
    pub(crate) fn system(self) -> StateCostate<PosedProblem> {
        within(self, &self.limits.map(|limit| [-limit, limit]))
    }
}

pub(crate) fn arm_problem(arm: TwoLinkArm, weights: [f64; 2]) -> StateCostate<PosedProblem> {
    ArmProblem { arm, weights, limits: [f64::INFINITY; 2] }.system()
}

/// The state–costate system of formulas, with controls between bounds.
pub(crate) fn within<F>(formula: F, bounds: &[[f64; 2]]) -> StateCostate<PosedProblem>
where
    F: Dynamics + Terms + Clone + 'static,
{
    let bounds: Vec<_> = bounds.iter().map(|[lower, upper]| Interval::new(*lower, *upper)).collect();
    let phase = Phase::new(formula.clone(), formula).control_bounds(bounds);
    StateCostate::of_problem(&Problem::try_new(phase).expect("a problem")).expect("a system")
}

/// No bounds of one control.
pub(crate) const FREE: [[f64; 2]; 1] = [[f64::NEG_INFINITY, f64::INFINITY]];

fn k<T: Scalar>(x: f64) -> T {
    nalgebra::convert(x)
}

impl Dynamics for ArmProblem {
    fn n_states(&self) -> usize {
        4
    }

    fn n_controls(&self) -> usize {
        2
    }

    fn rates<T: Scalar>(&self, at: &Point<'_, T>, f: &mut [T]) {
        let (x, u) = (at.state, at.control);
        let TwoLinkArm { masses: [m1, m2], lengths: [l1, l2], damping: [c1, c2] } = self.arm;
        let (i1, i2) = (m1 * l1 * l1 / 12.0, m2 * l2 * l2 / 12.0);
        let (s, c, w1, w2) = (x[1].sin(), x[1].cos(), x[2], x[3]);
        let coupling = k::<T>(m2 * l1 * l2);
        let m11 = k::<T>(m1 / 4.0 * l1 * l1 + m2 * (l1 * l1 + l2 * l2 / 4.0) + i1 + i2) + coupling * c;
        let m12 = k::<T>(m2 * l2 * l2 / 4.0 + i2) + coupling * c * k(0.5);
        let m22 = k::<T>(m2 * l2 * l2 / 4.0 + i2);
        let half = coupling * k(0.5) * s;
        let bias =
            Vector2::new(-half * w2 * (w1 * k(2.0) + w2) + k::<T>(c1) * w1, half * w1 * w1 + k::<T>(c2) * w2);
        let a =
            Matrix2::new(m22, -m12, -m12, m11) * (Vector2::new(u[0], u[1]) - bias) / (m11 * m22 - m12 * m12);
        f.copy_from_slice(&[w1, w2, a.x, a.y]);
    }
}

impl Terms for ArmProblem {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let u = at.control;
        (u[0] * u[0] * k(self.weights[0]) + u[1] * u[1] * k(self.weights[1])) * k(0.5)
    }
}

/// Start of the thesis' motion: the first node of tests/reference/arm_nodes.txt, its rounding of the rates removed.
pub(crate) const START: [f64; 8] = [
    -std::f64::consts::FRAC_PI_2,
    0.05,
    0.0,
    0.0,
    -0.20342284657942628,
    -0.013000184725439342,
    -1.3301476310359088,
    -0.12234910357574813,
];

/// The thesis' motion by 41 nodes, as tests/ftla/extremals.rs finds it: time and p.
pub(crate) fn arm_nodes() -> Vec<(f64, DVector<f64>)> {
    let text = include_str!("../reference/arm_nodes.txt");
    let numbers =
        |line: &str| line.split(' ').map(|x| x.parse::<f64>().expect("a number")).collect::<Vec<_>>();
    text.lines().map(numbers).map(|row| (row[0], DVector::from_column_slice(&row[1..]))).collect()
}

/// The thesis' problem with another fold and another θ₂ at the end.
pub(crate) fn arm_motion(fold: f64, unfolded: f64) -> ContinuationResult {
    let thesis = ArmTravel::default();
    let travel = ArmTravel { fold, last: [thesis.last[0], unfolded], ..thesis };
    travel.solve(&Continuation::default()).expect("well posed").continued
}

/// ẋ = A x.
pub(crate) struct Linear(pub(crate) DMatrix<f64>);

impl VectorField for Linear {
    fn dimension(&self) -> usize {
        self.0.nrows()
    }

    fn field_into(&self, p: &[f64], h: &mut [f64]) {
        h.copy_from_slice((&self.0 * DVector::from_column_slice(p)).as_slice());
    }

    fn jacobian_into(&self, _: &[f64], d: &mut DMatrix<f64>) {
        d.copy_from(&self.0);
    }

    fn conserved(&self, _: &[f64]) -> Option<f64> {
        None
    }
}
