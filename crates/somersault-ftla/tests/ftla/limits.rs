//! Controls that reach their bounds: crossings of the flow, its transition matrix through them, and the thesis' arm with
//! weaker motors against collocation.

use crate::common::{ArmProblem, arm_motion, arm_nodes, within};
use nalgebra::{DMatrix, DVector, Matrix2, Vector2, dvector};
use somersault_core::Scalar;
use somersault_ftla::continuation::{Continuation, Member};
use somersault_ftla::flow::{FlowTolerances, VariationalFlow};
use somersault_ftla::shooting::{End, Extremal, ShootingStatus};
use somersault_ftla::system::{
    ArmMinimumTorque, HamiltonianSystem, OptimalControlSystem, Piece, PosedProblem, Side, StateCostate,
    VectorField,
};
use somersault_multibody::models::TwoLinkArm;
use somersault_nlp::Flow;
use somersault_ocp::collocation::{
    Collocation, CollocationStatus, Dynamics, Guess, Mesh, Phase, Point, Problem, Terms, TreeDynamics,
};
use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

const TIGHT: FlowTolerances = FlowTolerances { relative: 1e-13, absolute: 1e-15 };
const LIMIT: f64 = 0.4;

/// ẋ = −x + u, |u| ≤ 0.4, ℓ = ½(x² + u²).
#[derive(Clone, Copy)]
struct Bounded;

impl Dynamics for Bounded {
    fn n_states(&self) -> usize {
        1
    }

    fn n_controls(&self) -> usize {
        1
    }

    fn rates<T: Scalar>(&self, at: &Point<'_, T>, f: &mut [T]) {
        let (x, u) = (at.state, at.control);
        f[0] = u[0] - x[0];
    }
}

impl Terms for Bounded {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let (x, u) = (at.state, at.control);
        (x[0] * x[0] + u[0] * u[0]) * nalgebra::convert::<f64, T>(0.5)
    }
}

fn bounded() -> StateCostate<PosedProblem> {
    within(Bounded, &[[-LIMIT, LIMIT]])
}

/// Where the motion from `p` with u = −0.4 reaches λ = 0.4, with (p, Φ) there, in closed form.
fn released(p: Vector2<f64>) -> (f64, Vector2<f64>, Matrix2<f64>) {
    let at = |t: f64| {
        let (down, b) = ((-t).exp(), LIMIT);
        let costate = (p[1] - 0.5 * (p[0] + b) * (1.0 - down * down) + b * (1.0 - down)) / down;
        Vector2::new((p[0] + b) * down - b, costate)
    };
    let (mut low, mut high) = (0.0, 2.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if at(middle).y > LIMIT { low = middle } else { high = middle }
    }
    (low, at(low), Matrix2::new((-low).exp(), 0.0, -low.sinh(), low.exp()))
}

#[test]
fn the_transition_matrix_passes_a_saturation_without_a_jump() {
    // while u = −0.4 the field is linear, and after it too: Φ = exp(A(T − t)) Φ(t), nothing in between
    let (p, duration) = (dvector![1.6, 0.7], 1.5);
    let (t, there, until) = released(Vector2::new(p[0], p[1]));
    let root = SQRT_2 * (duration - t);
    let a = Matrix2::new(-1.0, -1.0, -1.0, 1.0);
    let after = Matrix2::identity() * root.cosh() + a * (root.sinh() / SQRT_2);
    let (system, exact) = (bounded(), after * until);
    assert!((0.1..duration).contains(&t), "{t}");
    let flow = VariationalFlow::try_new(&system, TIGHT).expect("in range");
    let (found, work) = flow.transition_counted(&p, duration).expect("regular");
    assert_eq!(work.switches, 1);
    assert!((&found.end - after * there).amax() < 1e-12, "{}", &found.end - after * there);
    assert!((&found.matrix - exact).amax() < 1e-12 * exact.amax(), "{}", &found.matrix - exact);
    // and back
    let back = flow.transition(&found.end, -duration).expect("regular");
    assert!((back.end - &p).amax() < 1e-11 && (back.matrix * exact - Matrix2::identity()).amax() < 1e-10);
    let found = flow.switches(&p, duration).expect("regular");
    assert_eq!(found.len(), 1);
    assert!((found[0].0 - t).abs() < 1e-12 && found[0].1 == Piece::FREE, "{found:?}, {t}");
    assert_eq!(system.piece(p.as_slice()).side(0), Side::Lower);
    // the two fields agree where they meet, their Jacobians do not
    let at = |piece: &Piece| {
        let (mut h, mut d) = (DVector::zeros(2), DMatrix::zeros(2, 2));
        system.linearize_in(piece, there.as_slice(), h.as_mut_slice(), &mut d);
        (h, d)
    };
    let (one, two) = (at(&system.piece(p.as_slice())), at(&Piece::FREE));
    assert!((one.0 - two.0).amax() < 1e-15 && (one.1 - two.1).amax() > 0.5);
}

#[test]
fn saturations_are_seen_from_a_microsecond_on() {
    // a limit of u₂ a little below its peak near 1.7 s: the time at the limit goes with the root of what is cut off
    let free = ArmMinimumTorque::default();
    let flow = VariationalFlow::try_new(&free, TIGHT).expect("in range");
    let p = arm_nodes()[5].1.clone();
    let torque = |t: f64| {
        let mut u = [0.0; 2];
        free.control_into(flow.state(&p, t).expect("regular").as_slice(), &mut u).expect("two controls");
        u[1].abs()
    };
    let (mut low, mut high) = (0.1, 0.9);
    for _ in 0..60 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if torque(a) < torque(b) { low = a } else { high = b }
    }
    let (at, peak) = (low, torque(low));
    assert!((0.3..0.6).contains(&at), "{at}");
    let lengths = |cut: f64, relative: f64| {
        let limited = free.try_with_torque_limits([f64::INFINITY, peak * (1.0 - cut)]).expect("positive");
        let tolerances = FlowTolerances { relative, absolute: 1e-2 * relative };
        let flow = VariationalFlow::try_new(&limited, tolerances).expect("in range");
        let found = flow.switches(&p, 2.0 * at).expect("regular");
        found.chunks(2).map(|pair| pair[1].0 - pair[0].0).collect::<Vec<f64>>()
    };
    assert!(lengths(-1e-9, 1e-12).is_empty());
    // a tolerance finds the peak itself to no more digits than it has
    for (relative, wide, cuts) in [(1e-6, 1e-2, [1e-4, 1e-3]), (1e-12, 1e-4, [1e-10, 1e-7])] {
        let widest = lengths(wide, relative)[0];
        for cut in cuts {
            let found = lengths(cut, relative);
            assert_eq!(found.len(), 1, "{cut:e} at {relative:e}: {found:?}");
            let ratio = found[0] / widest / (cut / wide).sqrt();
            assert!((ratio - 1.0).abs() < 0.1, "{cut:e} at {relative:e}: {ratio}");
        }
    }
}

#[test]
fn the_closed_form_and_the_generic_problem_switch_alike_and_both_limits_at_once() {
    let arm = ArmMinimumTorque::default().try_with_torque_limits([0.38, 0.05]).expect("positive");
    let problem = ArmProblem { arm: *arm.arm(), weights: arm.weights(), limits: arm.torque_limits() };
    let generic = problem.system();
    let p = DVector::from_row_slice(&crate::common::START);
    let tolerances = FlowTolerances { relative: 1e-11, absolute: 1e-13 };
    let closed = VariationalFlow::try_new(&arm, tolerances).expect("in range");
    let generic = VariationalFlow::try_new(&generic, tolerances).expect("in range");
    let (one, two) =
        (closed.switches(&p, 1.5).expect("regular"), generic.switches(&p, 1.5).expect("regular"));
    assert!(one.len() >= 2 && one.len() == two.len(), "{one:?}\n{two:?}");
    for ((t, piece), (other, same)) in one.iter().zip(&two) {
        assert!((t - other).abs() < 1e-9 && piece == same, "{t} {other}");
    }
    // Φ is what differences of the flow say, and symplectic
    let found = closed.transition(&p, 1.5).expect("regular");
    assert!((generic.state(&p, 1.5).expect("regular") - &found.end).amax() < 1e-8);
    assert!(found.symplecticity_defect() < 1e-9, "{:e}", found.symplecticity_defect());
    for j in 0..8 {
        let at = |s: f64| {
            let mut q = p.clone();
            q[j] += 1e-6 * s;
            closed.state(&q, 1.5).expect("regular")
        };
        let column = (at(1.0) - at(-1.0)) / 2e-6;
        let gap = (column - found.matrix.column(j)).amax() / found.matrix.column(j).amax();
        assert!(gap < 3e-5, "column {j}: {gap:e}");
    }
}

/// The largest |u| of each joint, on a grid of 5 ms.
fn peak_torques(arm: &ArmMinimumTorque, extremal: &Extremal) -> [f64; 2] {
    let flow = VariationalFlow::try_new(arm, FlowTolerances::default()).expect("in range");
    let mut peak = [0.0f64; 2];
    for k in 0..=2000 {
        let mut u = [0.0; 2];
        let p = extremal.at(&flow, 0.005 * k as f64).expect("regular");
        arm.control_into(p.as_slice(), &mut u).expect("two controls");
        peak = [peak[0].max(u[0].abs()), peak[1].max(u[1].abs())];
    }
    peak
}

/// The thesis' motion with its torques limited to four fifths of their peaks, and the peaks.
fn limited_motion() -> (ArmMinimumTorque, Extremal, [f64; 2], f64) {
    let arm = ArmMinimumTorque::default();
    let free = arm_motion(PI, 0.05).extremal;
    let peak = peak_torques(&arm, &free);
    let fractions: Vec<f64> = free.times.iter().map(|t| t / 10.0).collect();
    let ends = [-1.0, 1.0].map(|s| End::try_state(&[s * FRAC_PI_2, 0.05, 0.0, 0.0]).expect("four states"));
    let family = |s: f64| {
        let system = arm.try_with_torque_limits(peak.map(|u| u * (1.0 - 0.2 * s))).expect("positive");
        Member { system, ends: ends.clone(), horizon: 10.0 }
    };
    let found = Continuation::default().follow(family, &fractions, &free.nodes).expect("well posed");
    assert_eq!((found.s, found.extremal.status), (1.0, ShootingStatus::Converged));
    let flow = VariationalFlow::try_new(&arm, FlowTolerances::default()).expect("in range");
    let cost = free.cost(&flow).expect("regular");
    (family(1.0).system, found.extremal, peak, cost)
}

/// ½ (u₁² + ½ u₂²), (8.7).
struct Effort;

impl Terms for Effort {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let [u1, u2] = [at.control[0], at.control[1]];
        (u1 * u1 + u2 * u2 * nalgebra::convert::<f64, T>(0.5)) * nalgebra::convert::<f64, T>(0.5)
    }
}

#[test]
fn torques_limited_to_four_fifths_of_their_peak_agree_with_collocation() {
    let (system, limited, peak, free_cost) = limited_motion();
    let [low, high] = limited.range_of(|p| system.hamiltonian(p));
    assert!(high - low < 1e-10 && limited.residual <= 1e-10, "{:e}", high - low);
    // both limits are reached
    let reached = peak_torques(&system, &limited);
    assert!((0..2).all(|i| (reached[i] / peak[i] - 0.8).abs() < 1e-12), "{reached:?} of {peak:?}");
    let flow = VariationalFlow::try_new(&system, FlowTolerances::default()).expect("in range");
    let cost = limited.cost(&flow).expect("regular");
    assert!(cost > free_cost + 1e-4, "{cost} {free_cost}");

    let dynamics = TreeDynamics::try_fully_actuated(&TwoLinkArm::default().model().expect("a model"));
    let ends = [-1.0, 1.0].map(|s| [s * FRAC_PI_2, 0.05, 0.0, 0.0]);
    let folded = |angle: f64| vec![angle, PI, PI / 10.0, 0.0];
    let limits = system.torque_limits();
    let phase = Phase::of_tree(dynamics.expect("driven joints"), Effort)
        .initial_state(ends[0])
        .final_state(ends[1])
        .horizon(0.0, 10.0)
        .control_bounds(limits.map(|u| (-u, u).into()))
        .guess(Guess {
            times: vec![0.0, 1.0, 9.0, 10.0],
            states: vec![ends[0].to_vec(), folded(-0.4 * PI), folded(0.4 * PI), ends[1].to_vec()],
            controls: vec![vec![0.0; 2]; 4],
            parameters: Vec::new(),
        });
    let collocation = Collocation { tolerance: 1e-6, ..Collocation::default() };
    let mut problem = Problem::try_new(phase).expect("well posed");
    let mesh = Mesh::try_uniform(40, 4).expect("a mesh");
    let report = collocation.solve(&mut problem, &[mesh], &mut |_| Flow::Continue).expect("regular");
    assert_eq!(report.status, CollocationStatus::Converged);
    println!("cost {cost}, collocation {}, free {free_cost}", report.cost);
    assert!((report.cost - cost).abs() < 1e-5 * cost, "{} {cost}", report.cost);
    for k in 0..=10 {
        let (t, p) = (k as f64, limited.at(&flow, k as f64).expect("regular"));
        let state = report.phases[0].state(t);
        let off = (0..4).map(|i| (state[i] - p[i]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-3, "{off:e} at {t}");
    }
}
