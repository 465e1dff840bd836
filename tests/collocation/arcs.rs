//! Arcs found, polished and certified, against costs that are known.

use crate::known::{ALL, Known};
use somersault_expr::{Block, ExprFunction, Symbol};
use somersault_nlp::Flow;
use somersault_ocp::arcs::{Arc, ControlKind, Polish, Polished, Verdict};
use somersault_ocp::collocation::{
    Collocation, CollocationReport, CollocationStatus, Guess, Interval, Mesh, Phase, PhaseRows,
    PhaseSolution, Problem,
};
use std::f64::consts::PI;

type Formula = for<'g> fn(&[Symbol<'g>], &[Symbol<'g>], Symbol<'g>) -> Vec<Symbol<'g>>;
type EndFormula = for<'g> fn(&[Symbol<'g>], &[Symbol<'g>], [Symbol<'g>; 2]) -> Vec<Symbol<'g>>;

/// A phase of formulas over (x, u, t) and (x(t₀), x(t_f), t₀, t_f).
fn traced([n, m]: [usize; 2], dynamics: Formula, path: Formula, ends: EndFormula) -> Phase {
    let blocks = || vec![Block::new("x", [n]), Block::new("u", [m]), Block::new("t", [])];
    let function = |formula: Formula| {
        ExprFunction::trace(blocks(), |s| formula(&s[0], &s[1], s[2][0])).expect("a graph")
    };
    let both = vec![Block::new("x0", [n]), Block::new("xf", [n]), Block::new("t0", []), Block::new("tf", [])];
    let ends = ExprFunction::trace(both, |s| ends(&s[0], &s[1], [s[2][0], s[3][0]])).expect("a graph");
    Phase::try_traced([&function(dynamics), &function(path), &ends], m, 0).expect("a phase")
}

fn no_path<'g>(_: &[Symbol<'g>], _: &[Symbol<'g>], t: Symbol<'g>) -> Vec<Symbol<'g>> {
    vec![t.constant(0.0)]
}

fn no_end<'g>(_: &[Symbol<'g>], _: &[Symbol<'g>], [t, _]: [Symbol<'g>; 2]) -> Vec<Symbol<'g>> {
    vec![t.constant(0.0)]
}

fn duration<'g>(_: &[Symbol<'g>], _: &[Symbol<'g>], [start, end]: [Symbol<'g>; 2]) -> Vec<Symbol<'g>> {
    vec![end - start]
}

fn line(duration: f64, from: &[f64], to: &[f64], control: &[f64]) -> Guess {
    Guess {
        times: vec![0.0, duration],
        states: vec![from.to_vec(), to.to_vec()],
        controls: vec![control.to_vec(); 2],
        parameters: Vec::new(),
    }
}

fn block() -> Phase {
    traced([2, 1], |x, u, _| vec![x[1], u[0]], no_path, duration)
        .initial_state([0.0, 0.0])
        .final_state([1.0, 0.0])
        .control_bounds([Interval::new(-1.0, 1.0)])
        .horizon(0.0, Interval::new(0.1, 10.0))
        .guess(line(3.0, &[0.0, 0.0], &[1.0, 0.0], &[0.0]))
}

fn oscillator() -> Phase {
    traced([2, 1], |x, u, _| vec![x[1], u[0] - x[0]], no_path, duration)
        .initial_state([5.0, 0.0])
        .final_state([0.0, 0.0])
        .control_bounds([Interval::new(-1.0, 1.0)])
        .horizon(0.0, Interval::new(1.0, 30.0))
}

fn fuel() -> Phase {
    traced([2, 2], |x, u, _| vec![x[1], u[0] - u[1]], |_, u, _| vec![u[0] + u[1]], no_end)
        .initial_state([0.0, 0.0])
        .final_state([1.0, 0.0])
        .control_bounds([Interval::new(0.0, 1.0); 2])
        .horizon(0.0, 3.0)
}

fn dwell() -> Phase {
    traced([1, 1], |_, u, _| vec![u[0]], |x, _, _| vec![x[0] * x[0]], no_end)
        .initial_state([1.0])
        .final_state([0.5])
        .control_bounds([Interval::new(-1.0, 1.0)])
        .horizon(0.0, 2.0)
}

fn ceiling(height: f64) -> Phase {
    traced([2, 1], |x, u, _| vec![x[1], u[0]], |x, u, _| vec![0.5 * u[0] * u[0], x[0]], no_end)
        .initial_state([0.0, 1.0])
        .final_state([0.0, -1.0])
        .path_bounds([Interval::at_most(height)])
}

fn van_der_pol(floor: f64) -> Phase {
    traced(
        [2, 1],
        |x, u, _| vec![x[1], x[1] * (1.0 - x[0] * x[0]) - x[0] + u[0]],
        |x, u, _| vec![0.5 * (x[0] * x[0] + x[1] * x[1] + u[0] * u[0])],
        no_end,
    )
    .initial_state([1.0, 0.0])
    .state_bounds([Interval::FREE, Interval::at_least(floor)])
    .horizon(0.0, 5.0)
}

fn brachistochrone() -> Phase {
    traced([3, 1], |x, u, _| vec![x[2] * u[0].cos(), x[2] * u[0].sin(), 9.81 * u[0].sin()], no_path, duration)
        .initial_state([0.0, 0.0, 0.0])
        .final_state([Interval::fixed(10.0), Interval::fixed(5.0), Interval::FREE])
        .horizon(0.0, Interval::new(0.1, 20.0))
        .guess(line(2.0, &[0.0, 0.0, 0.0], &[10.0, 5.0, 9.9], &[0.5]))
}

fn slope() -> Phase {
    traced(
        [3, 1],
        |x, u, _| vec![x[2] * u[0].cos(), x[2] * u[0].sin(), u[0].sin()],
        |x, _, t| vec![t.constant(0.0), x[1] - 0.5 * x[0]],
        duration,
    )
    .initial_state([0.0, 0.0, 0.0])
    .final_state([Interval::fixed(1.0), Interval::FREE, Interval::FREE])
    .path_bounds([Interval::at_most(0.1)])
    .horizon(0.0, Interval::new(0.1, 20.0))
    .guess(line(2.0, &[0.0, 0.0, 0.0], &[1.0, 0.5, 1.0], &[0.5]))
}

fn regulator() -> Phase {
    traced(
        [1, 1],
        |x, u, _| vec![u[0] - x[0] * x[0] * x[0]],
        |x, u, _| vec![0.5 * (x[0] * x[0] + u[0] * u[0])],
        no_end,
    )
    .initial_state([1.0])
    .final_state([1.5])
    .horizon(0.0, 40.0)
}

fn pendulum() -> Phase {
    traced([2, 1], |x, u, _| vec![x[1], 4.0 * u[0] - 9.81 / 0.5 * x[0].sin()], no_path, duration)
        .initial_state([0.0, 0.0])
        .final_state([PI, 0.0])
        .control_bounds([Interval::new(-2.0, 2.0)])
        .horizon(0.0, Interval::new(0.5, 5.0))
}

/// ẋ = u, ½ ∫ u² − x²: past its conjugate time π no extremal is a minimum.
fn repelled(duration: f64) -> Phase {
    traced([1, 1], |_, u, _| vec![u[0]], |x, u, _| vec![0.5 * (u[0] * u[0] - x[0] * x[0])], no_end)
        .initial_state([1.0])
        .final_state([0.5])
        .horizon(0.0, duration)
}

/// Attitude as a quaternion, J = 1, |uᵢ| ≤ 1, half a turn about z.
fn reorientation() -> Phase {
    traced(
        [7, 3],
        |x, u, _| {
            let (q, w) = (&x[..4], &x[4..]);
            vec![
                -0.5 * (q[1] * w[0] + q[2] * w[1] + q[3] * w[2]),
                0.5 * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1]),
                0.5 * (q[0] * w[1] + q[3] * w[0] - q[1] * w[2]),
                0.5 * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0]),
                u[0],
                u[1],
                u[2],
            ]
        },
        no_path,
        duration,
    )
    .initial_state([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    .final_state(
        [Some(0.0), Some(0.0), Some(0.0), None, Some(0.0), Some(0.0), Some(0.0)]
            .map(|end| end.map_or(Interval::FREE, Interval::fixed)),
    )
    .control_bounds([Interval::new(-1.0, 1.0); 3])
    .horizon(0.0, Interval::new(0.5, 10.0))
    .guess(Guess {
        times: vec![0.0, 0.8, 1.7, 2.5, 3.4],
        states: [0.0f64, 0.3, 0.9, 1.3, 0.5 * PI]
            .iter()
            .zip([0.0, 0.15, 0.0, -0.15, 0.0])
            .map(|(a, tilt)| vec![a.cos(), tilt, tilt, a.sin(), 0.0, 0.0, 0.0])
            .collect(),
        controls: vec![
            vec![1.0, 0.5, 1.0],
            vec![-1.0, 1.0, 1.0],
            vec![-1.0, -1.0, 0.1],
            vec![-1.0, 1.0, -1.0],
            vec![1.0, -0.5, -1.0],
        ],
        parameters: Vec::new(),
    })
}

fn orbit() -> Phase {
    traced(
        [3, 1],
        |x, u, t| {
            let (r, v, w) = (x[0], x[1], x[2]);
            let push = 0.1405 / (1.0 - 0.0749 * t);
            vec![v, w * w / r - 1.0 / (r * r) + push * u[0].sin(), -(v * w) / r + push * u[0].cos()]
        },
        no_path,
        |_, x, _| vec![-x[0], x[1], x[2] - 1.0 / x[0].sqrt()],
    )
    .initial_state([1.0, 0.0, 1.0])
    .end_bounds([Interval::fixed(0.0); 2])
    .horizon(0.0, 3.32)
    .guess(Guess {
        times: vec![0.0, 1.6, 1.7, 3.32],
        states: vec![vec![1.0, 0.0, 1.0], vec![1.2, 0.3, 0.9], vec![1.25, 0.3, 0.85], vec![1.5, 0.0, 0.8]],
        controls: vec![vec![0.5], vec![1.5], vec![4.5], vec![5.8]],
        parameters: Vec::new(),
    })
}

fn goddard(speed: f64) -> Phase {
    traced(
        [3, 1],
        |x, u, _| {
            let (r, v, m) = (x[0], x[1], x[2]);
            let drag = 310.0 * v * v * (-500.0 * (r - 1.0)).exp();
            vec![v, (3.5 * u[0] - drag) / m - 1.0 / (r * r), -7.0 * u[0]]
        },
        no_path,
        |_, x, _| vec![-x[0]],
    )
    .initial_state([1.0, 0.0, 1.0])
    .final_state([Interval::FREE, Interval::FREE, Interval::fixed(0.6)])
    .state_bounds([Interval::FREE, Interval::at_most(speed), Interval::FREE])
    .control_bounds([Interval::new(0.0, 1.0)])
    .horizon(0.0, Interval::new(0.05, 1.0))
    .guess(line(0.2, &[1.0, 0.05, 1.0], &[1.01, 0.05, 0.6], &[0.3]))
}

/// Fuller's problem, whose controls chatter into a singular arc of order 2.
fn fuller() -> Phase {
    traced([2, 1], |x, u, _| vec![x[1], u[0]], |x, _, _| vec![x[0] * x[0]], no_end)
        .initial_state([1.0, 0.0])
        .control_bounds([Interval::new(-1.0, 1.0)])
        .horizon(0.0, 6.0)
}

/// ẋ = t u, ½ ∫ u² from 0 to 1 in a second: u = 3t.
fn of_time() -> Phase {
    traced([1, 1], |_, u, t| vec![t * u[0]], |_, u, _| vec![0.5 * u[0] * u[0]], no_end)
        .initial_state([0.0])
        .final_state([1.0])
}

/// ẋ = u, T + ½ ∫ u² from 0 to 1: T = 1/√2.
fn effort_and_time() -> Phase {
    traced([1, 1], |_, u, _| vec![u[0]], |_, u, _| vec![0.5 * u[0] * u[0]], duration)
        .initial_state([0.0])
        .final_state([1.0])
        .horizon(0.0, Interval::new(0.1, 10.0))
        .guess(line(1.0, &[0.0], &[1.0], &[1.0]))
}

/// ẋ = u + p, ½ p² + ½ ∫ u² from 0 to 1 in a second: u = p = ½.
fn with_parameter() -> Phase {
    let blocks =
        || vec![Block::new("x", [1]), Block::new("u", [1]), Block::new("p", [1]), Block::new("t", [])];
    let dynamics = ExprFunction::trace(blocks(), |s| vec![s[1][0] + s[2][0]]).expect("a graph");
    let path = ExprFunction::trace(blocks(), |s| vec![0.5 * s[1][0] * s[1][0]]).expect("a graph");
    let names = ["x0", "xf", "p", "t0", "tf"].map(|name| Block::new(name, [1]));
    let ends = ExprFunction::trace(names.to_vec(), |s| vec![0.5 * s[2][0] * s[2][0]]).expect("a graph");
    Phase::try_traced([&dynamics, &path, &ends], 1, 1)
        .expect("a phase")
        .initial_state([0.0])
        .final_state([1.0])
}

/// What is expected of a polished motion.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Expected {
    Minimum,
    FirstOrder,
}

use Expected::{FirstOrder, Minimum};

struct Case {
    name: &'static str,
    phase: fn() -> Phase,
    /// Bounds of the intervals of a mesh of about so many.
    mesh: fn(usize) -> Mesh,
    cost: f64,
    /// Digits of the cost that is known.
    tolerance: f64,
    /// A letter for each control, Lower, Upper, Interior or Singular; * where a bound of the state holds, ^ where costates jump.
    shape: &'static str,
    expected: Expected,
}

fn uniform(intervals: usize) -> Mesh {
    Mesh::try_uniform(intervals, 3).expect("a mesh")
}

/// Intervals that grow by 1.35 from both ends, as a hyper-sensitive motion needs.
fn graded(intervals: usize) -> Mesh {
    let half = (intervals / 2).max(30);
    let lengths = (0..half).map(|k| 1.35f64.powi(k.min(24) as i32)).collect::<Vec<_>>();
    let lengths = lengths.iter().chain(lengths.iter().rev());
    let total: f64 = lengths.clone().sum();
    let mut bounds = vec![0.0];
    for length in lengths {
        bounds.push(bounds[bounds.len() - 1] + length / total);
    }
    bounds[2 * half] = 1.0;
    Mesh::try_new(bounds, vec![3; 2 * half]).expect("a mesh")
}

const CASES: &[Case] = &[
    case("least time, double integrator", block, 2.0, 1e-13, "U L", Minimum),
    case("least time, oscillator", oscillator, 7.937_411_720_585_108, 1e-13, "L U L U", Minimum),
    case("least fuel", fuel, 3.0 - 2.236_067_977_499_79, 1e-13, "UL LL LU", Minimum),
    case("least square", dwell, 0.375, 1e-13, "L S U", FirstOrder),
    case("Bryson and Denham, 0.3", || ceiling(0.3), 2.0, 1e-12, "I", Minimum),
    case("Bryson and Denham, 0.2", || ceiling(0.2), 2.24, 1e-12, "I ^I", FirstOrder),
    case("Bryson and Denham, 1/9", || ceiling(1.0 / 9.0), 4.0, 1e-12, "I ^I* I", FirstOrder),
    case("van der Pol above −0.4", || van_der_pol(-0.4), 1.476_850_671_192_52, 2e-14, "I ^I* I", FirstOrder),
    // speed follows from height, so that neighbouring extremals do not reach all states and conjugate points have no meaning
    case("brachistochrone", brachistochrone, 1.801_295_483_013_72, 1e-14, "I", FirstOrder),
    case("brachistochrone over a slope", slope, 1.834_003_222_847_19, 1e-14, "I ^I* I", FirstOrder),
    Case { mesh: graded, ..case("hyper-sensitive", regulator, 3.362_056_904_943, 1e-12, "I", Minimum) },
    case("least time, pendulum", pendulum, 2.196_809_250_472, 1e-13, "U L U L", Minimum),
    case("repelled from the origin", || repelled(3.0), -7.927_616_542_515_18, 1e-12, "I", Minimum),
    case("reorientation", reorientation, 3.243_083_277_452_33, 1e-13, REORIENTATIONS, Minimum),
    case("orbit transfer", orbit, -1.525_277_700_648_58, 1e-13, "I", Minimum),
    case("Goddard", || goddard(f64::INFINITY), -1.012_836_918_317_48, 5e-14, "U S L", FirstOrder),
    case("Goddard below 0.1", || goddard(0.1), -1.012_576_324_656_93, 5e-14, "U S ^I* L", FirstOrder),
    case("equations of the time", of_time, 1.5, 1e-13, "I", Minimum),
    case("effort and time", effort_and_time, std::f64::consts::SQRT_2, 1e-13, "I", Minimum),
    case("a parameter", with_parameter, 0.25, 1e-13, "I", Minimum),
];

/// Motions of the same cost, of which a mesh leads to one.
const REORIENTATIONS: &str = "LUU LLU ULU ULL UUL LUL or UUU LUU LLU LLL ULL UUL";

const fn case(
    name: &'static str,
    phase: fn() -> Phase,
    cost: f64,
    tolerance: f64,
    shape: &'static str,
    expected: Expected,
) -> Case {
    Case { name, phase, mesh: uniform, cost, tolerance, shape, expected }
}

fn shape(polished: &Polished) -> String {
    let arc = |arc: &Arc| {
        let letter = |kind: &ControlKind| match kind {
            ControlKind::Lower => 'L',
            ControlKind::Upper => 'U',
            ControlKind::Interior => 'I',
            ControlKind::Singular => 'S',
        };
        let jump = if arc.jumps.is_empty() { "" } else { "^" };
        let contact = if arc.contact.is_some() { "*" } else { "" };
        format!("{jump}{}{contact}", arc.kind.controls.iter().map(letter).collect::<String>())
    };
    polished.arcs.iter().map(arc).collect::<Vec<_>>().join(" ")
}

/// Collocation on one mesh.
fn collocated(phase: Phase, mesh: Mesh) -> (Problem, CollocationReport) {
    let mut problem = Problem::try_new(phase).expect("a problem");
    let search = Collocation { max_meshes: 1, ..Collocation::default() };
    let report = search.solve(&mut problem, &[mesh], &mut |_| Flow::Continue).expect("a report");
    (problem, report)
}

fn polished(phase: Phase, mesh: Mesh) -> Polished {
    let (mut problem, report) = collocated(phase, mesh);
    Polish::default().polish(&mut problem, &report).expect("a result")
}

fn check_all(intervals: usize) {
    let mut wrong = Vec::new();
    for Case { name, phase, mesh, cost, tolerance, shape: expected_shape, expected } in CASES {
        let found = polished(phase(), mesh(intervals));
        let verdict = match found.verdict {
            Verdict::StrictMinimum => Some(Minimum),
            Verdict::FirstOrder { .. } => Some(FirstOrder),
            _ => None,
        };
        let error = (found.cost - cost).abs();
        let is_right = verdict == Some(*expected)
            && expected_shape.split(" or ").any(|expected| shape(&found) == expected);
        if !(is_right && error <= tolerance * cost.abs() && found.residual <= 1e-13) {
            let (residual, verdict) = (found.residual, &found.verdict);
            let shape = shape(&found);
            wrong.push(format!("{name}: {shape}, error {error:.1e}, residual {residual:.1e}, {verdict}"));
        }
    }
    assert!(wrong.is_empty(), "{intervals} intervals:\n{}", wrong.join("\n"));
}

#[test]
fn costs_are_exact_and_certified() {
    check_all(20);
}

#[test]
#[ignore = "long form of costs_are_exact_and_certified, 10 s: meshes of 40 and 80 intervals; `make studies` runs it"]
fn costs_are_exact_and_certified_on_all_meshes() {
    [40, 80].into_iter().for_each(check_all);
}

#[test]
fn times_of_switches_and_costates_are_those_of_closed_forms() {
    let found = polished(block(), uniform(20));
    assert!((found.arcs[0].end - 1.0).abs() < 1e-13);
    let at = found.at(0.5).expect("an extremal");
    assert!((at.state[0] - 0.125).abs() < 1e-14 && (at.state[1] - 0.5).abs() < 1e-14);
    assert!((at.costate[0] + 1.0).abs() < 1e-13 && (at.costate[1] + 0.5).abs() < 1e-13);
    assert_eq!(at.control, [1.0]);
    let arcs = polished(oscillator(), uniform(20)).arcs;
    for (arc, length) in arcs.iter().zip([0.166_860_173_22, PI, PI, 1.487_366_240_18]) {
        assert!((arc.end - arc.start - length).abs() < 1e-11);
    }
    let arcs = polished(goddard(0.1), uniform(20)).arcs;
    for (arc, end) in
        arcs.iter().zip([0.023_509_684_041, 0.059_737_380_901, 0.101_571_348_425, 0.202_047_440_57])
    {
        assert!((arc.end - end).abs() < 1e-11);
    }
    assert_eq!(arcs[2].contact.as_deref(), Some("state 1"));
}

/// x = a cos t + b sin t with u = ẋ = −λ, put in the place of what collocation found.
#[test]
fn a_conjugate_point_is_located() {
    let end = 3.5f64;
    let (a, b) = (1.0, (0.5 - end.cos()) / end.sin());
    let (mut problem, mut report) =
        collocated(repelled(end).control_bounds([Interval::new(-50.0, 50.0)]), uniform(20));
    let mesh = uniform(20);
    let times = report.phases[0].times.clone();
    let (mut states, mut rates): (Vec<_>, Vec<_>) =
        times.iter().map(|t| (vec![a * t.cos() + b * t.sin()], vec![b * t.cos() - a * t.sin()])).unzip();
    states[0][0] = 1.0;
    let costates = rates.iter().map(|u| vec![-u[0]]).collect();
    let n = mesh.n_points();
    rates.truncate(n);
    let rows = PhaseRows {
        states,
        controls: rates,
        costates,
        path_multipliers: vec![Vec::new(); n],
        hamiltonian: vec![0.0; n],
        parameters: Vec::new(),
    };
    report.status = CollocationStatus::MeshLimit;
    report.phases = vec![PhaseSolution::try_new(mesh, (0.0, end), rows).expect("a solution")];
    let found = Polish::default().polish(&mut problem, &report).expect("a result");
    assert!((found.cost - 3.093_892_021_875_77).abs() < 1e-12, "{}", found.cost);
    let Verdict::ConjugatePoint { time } = found.verdict else { panic!("{}", found.verdict) };
    assert!((time - PI).abs() < 1e-8, "{time}");
    assert!(!found.verdict.is_certified());
}

#[test]
fn a_shift_in_time_changes_nothing() {
    let shifted = |start: f64| {
        let guess = Guess { times: vec![start, start + 3.0], ..line(3.0, &[0.0, 0.0], &[1.0, 0.0], &[0.0]) };
        block().horizon(start, Interval::new(start + 0.1, start + 10.0)).guess(guess)
    };
    let found = [0.0, 1e4].map(|start| polished(shifted(start), uniform(21)));
    assert_eq!(found[0].verdict, found[1].verdict);
    let lengths = found.each_ref().map(|f| f.arcs.iter().map(|arc| arc.end - arc.start).collect::<Vec<_>>());
    for (a, b) in lengths[0].iter().zip(&lengths[1]) {
        assert!((a - b).abs() < 1e-11);
    }
}

#[test]
fn what_is_not_covered_is_refused_with_a_reason() {
    let reason = |polished: Polished| match polished.verdict {
        Verdict::Refused { reason } => reason,
        verdict => panic!("{verdict}"),
    };
    let chattering = reason(polished(fuller(), uniform(40)));
    assert!(chattering.contains("order 2"), "{chattering}");
    // a uniform mesh does not resolve the ends of a hyper-sensitive motion
    assert!(!polished(regulator(), uniform(20)).verdict.is_certified());
}

#[test]
fn formulas_over_any_scalar_have_arcs() {
    let names = [
        "least time, oscillator",
        "Bryson and Denham, 0.2",
        "least square, singular arc",
        "Kelly's cart-pole",
    ];
    for known in ALL.iter().filter(|known| names.contains(&known.name)) {
        let mut problem = Known::problem(known);
        let report = Collocation::default()
            .solve(&mut problem, &[known.mesh()], &mut |_| Flow::Continue)
            .expect("a report");
        let found = Polish::default().polish(&mut problem, &report).expect("a result");
        assert!(found.verdict.is_certified() && found.residual < 1e-10, "{}: {}", known.name, found.verdict);
        assert!((found.cost - known.cost).abs() < 1e-9 * known.cost, "{}: {}", known.name, found.cost);
    }
}

#[test]
fn the_turn_about_the_eigenaxis_is_not_certified() {
    let straight = reorientation().guess(line(
        3.5,
        &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        &[0.0, 0.0, 0.0],
    ));
    let found = polished(straight, uniform(20));
    assert!(found.cost < 3.5 || !found.verdict.is_certified(), "{} {}", found.cost, found.verdict);
}
