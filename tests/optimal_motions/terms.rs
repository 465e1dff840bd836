//! Terms that are not in the gradient tests, and what the user's do to a solve.

use crate::systems::{chain, floating, scattered, weights};
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::spline::UniformBasis;
use somersault_multibody::joint_motion::{EigenpostureBase, JointMotionError, SplineMotion};
use somersault_multibody::models::{CartPendulum, TwoLinkArm};
use somersault_multibody::{Model, ModelError};
use somersault_nlp::{Flow, Nlp, NlpSolver, Report, SolverError, Sqp, Status};
use somersault_ocp::OcpError;
use somersault_ocp::dynamics::{CartPendulumDynamics, Tree};
use somersault_ocp::problem::{At, Loss, MotionProblem};
use somersault_ocp::shooting::{Phase, Shooting, ShootingOptions, Start};
use somersault_ocp::swing_up::CartPendulumProblem;
use somersault_ocp::term::{
    AxisDirection, BodyOrientation, Entries, Function, Node, NodeGradient, Part, Term, wrong_derivative,
};
use somersault_ocp::transcription::Transcription;
use std::cell::Cell;

#[test]
fn an_axis_without_a_direction_and_links_without_a_length_are_refused() {
    let refused = AxisDirection::try_new(floating().0, "trunk", Vector3::zeros()).map(|_| ()).unwrap_err();
    assert_eq!(refused, OcpError::Zero { argument: "axis".into() });
    for length in [0.0, -0.5, f64::NAN, f64::INFINITY] {
        let refused = TwoLinkArm { lengths: [2.0, length], ..TwoLinkArm::default() }.model().unwrap_err();
        assert!(
            matches!(refused, ModelError::NotPositive { argument: "lengths", ref name, .. } if name == "lower"),
            "{length} {refused}"
        );
    }
}

#[test]
fn sizes_beyond_all_memory_are_refused() {
    let refused = CartPendulumProblem { n_steps: 100_000_000, ..CartPendulumProblem::default() }
        .swing_up()
        .map(|_| ())
        .unwrap_err();
    assert!(matches!(refused, OcpError::TooLarge { ref argument, .. } if argument == "n_steps"), "{refused}");
    let refused = CartPendulumProblem::with_parameters(1_000_000_000).swing_up().map(|_| ()).unwrap_err();
    assert!(matches!(refused, OcpError::Motion(JointMotionError::TooManyCoefficients { .. })), "{refused}");
    let basis = UniformBasis::try_new(5, 9).unwrap();
    let motion = SplineMotion::try_new(basis, EigenpostureBase::joints(1), &[]).unwrap();
    for (n_steps, n_segments, argument) in
        [(1_000_000_000, 1, "n_steps"), (1_000_000, 1_000_000_000, "n_segments")]
    {
        let phase = Phase { n_segments, ..Phase::new(motion.clone(), n_steps, 1.0) };
        let start = Start::fixed(&[0.0, 0.1], &[0.0; 2]);
        let dynamics = CartPendulumDynamics::try_new(CartPendulum::default()).unwrap();
        let refused = Shooting::try_new(dynamics, start, vec![phase], ShootingOptions::default());
        let refused = refused.map(|_| ()).unwrap_err();
        let names = |found: &str| found == argument;
        assert!(
            matches!(refused, OcpError::TooLarge { argument: ref found, .. }
                | OcpError::OutOfRange { argument: ref found, .. } if names(found)),
            "{refused}"
        );
    }
}

#[test]
fn a_start_whose_motion_diverges_is_named_by_its_parameters() {
    let mut swing_up = CartPendulumProblem::default().swing_up().unwrap();
    let refused = swing_up.start_on_motion(&[1e200; 5]).unwrap_err();
    assert_eq!(refused, OcpError::Diverges { argument: "parameters".into() });
}

fn node<'a>(position: &'a [f64], velocity: &'a [f64]) -> Node<'a> {
    Node {
        time: 0.4,
        position,
        velocity,
        acceleration: &[],
        torque: &[],
        channel: &[],
        channel_rate: &[],
        channel_second_rate: &[],
    }
}

/// Expects the pull-back of each row by position and velocity to equal central differences at a node.
fn expect_gradient(model: &Model, term: &mut dyn Term) {
    let n = model.n_velocities();
    let mut position = model.neutral();
    let push: Vec<f64> = scattered(n, 2.0).iter().map(|x| 0.4 * x).collect();
    model.displace(&model.neutral(), &push, &mut position).unwrap();
    let velocity = scattered(n, 3.0);
    let mut evaluate = |q: &[f64], v: &[f64]| {
        let mut rows = vec![0.0; term.n_rows()];
        term.evaluate(&node(q, v), &mut rows).unwrap();
        rows
    };
    let step = 1e-5;
    let slopes: Vec<[Vec<f64>; 2]> = (0..n)
        .map(|k| {
            let along = |by_position: bool, h: f64| {
                let (mut q, mut v, mut d) = (position.clone(), velocity.clone(), vec![0.0; n]);
                if by_position {
                    d[k] = h;
                    model.displace(&position, &d, &mut q).unwrap();
                } else {
                    v[k] += h;
                }
                (q, v)
            };
            [true, false].map(|by_position| {
                let [(q, v), (q_less, v_less)] = [step, -step].map(|h| along(by_position, h));
                let (more, less) = (evaluate(&q, &v), evaluate(&q_less, &v_less));
                more.iter().zip(&less).map(|(a, b)| (a - b) / (2.0 * step)).collect()
            })
        })
        .collect();
    evaluate(&position, &velocity);
    for row in 0..term.n_rows() {
        let mut gradient =
            NodeGradient { position: vec![0.0; n], velocity: vec![0.0; n], ..NodeGradient::default() };
        let mut y = vec![0.0; term.n_rows()];
        y[row] = 1.0;
        term.pull_back(&node(&position, &velocity), &y, &mut gradient).unwrap();
        for (k, slopes) in slopes.iter().enumerate() {
            for (found, slopes) in [gradient.position[k], gradient.velocity[k]].into_iter().zip(slopes) {
                let name = term.name();
                assert!((found - slopes[row]).abs() < 1e-8, "{name} {row}, {k}: {found} {}", slopes[row]);
            }
        }
    }
}

#[test]
fn gradients_of_directions_and_orientations_equal_differences() {
    for ((model, _), body) in [(floating(), "leg"), (floating(), "trunk"), (chain(), "c")] {
        let axis = Vector3::new(0.3, -0.8, 1.4);
        expect_gradient(&model, &mut AxisDirection::try_new(model.clone(), body, axis).unwrap());
        let target = UnitQuaternion::from_scaled_axis(Vector3::new(0.4, -0.2, 0.7));
        expect_gradient(&model, &mut BodyOrientation::try_new(model.clone(), body, target).unwrap());
    }
}

#[test]
fn gradients_of_functions_equal_differences() {
    let (model, split) = floating();
    // the last two positions are hinges, whose displacements are differences
    let rows = |node: &Node<'_>, rows: &mut [f64]| {
        let (q, v) = (node.position, node.velocity);
        rows[0] = q[7].sin() * v[0];
        rows[1] = q[8] * q[8] + v[6] * v[7];
        Ok(())
    };
    let pull_back = |node: &Node<'_>, y: &[f64], gradient: &mut NodeGradient| {
        let (q, v) = (node.position, node.velocity);
        gradient.position[6] += y[0] * q[7].cos() * v[0];
        gradient.position[7] += y[1] * 2.0 * q[8];
        gradient.velocity[0] += y[0] * q[7].sin();
        gradient.velocity[6] += y[1] * v[7];
        gradient.velocity[7] += y[1] * v[6];
        Ok(())
    };
    expect_gradient(&model, &mut Function::new("given", 2, rows, pull_back));
    let dynamics = Tree::try_new(model.clone(), split).unwrap();
    let parts = [Part::Velocity];
    expect_gradient(&model, &mut Function::by_differences("differences", 2, dynamics, true, &parts, rows));
}

#[test]
fn a_wrong_gradient_of_a_term_is_named() {
    let (model, split) = floating();
    let dynamics = || Tree::try_new(model.clone(), split.clone()).unwrap();
    let rows = |node: &Node<'_>, rows: &mut [f64]| {
        rows.copy_from_slice(&[node.position[7].sin(), node.velocity[6] * node.velocity[7]]);
        Ok(())
    };
    let (position, velocity) = (model.neutral(), scattered(model.n_velocities(), 3.0));
    for (factor, expected) in [(1.0, None), (1.01, Some("∂(row 1)/∂(velocity[6])"))] {
        let pull_back = move |node: &Node<'_>, y: &[f64], gradient: &mut NodeGradient| {
            gradient.position[6] += y[0] * node.position[7].cos();
            gradient.velocity[6] += factor * y[1] * node.velocity[7];
            gradient.velocity[7] += y[1] * node.velocity[6];
            Ok(())
        };
        let mut term = Function::new("the user's", 2, rows, pull_back).compared_by(dynamics());
        let node = node(&position, &velocity);
        let own = term.wrong_derivative(&node).unwrap();
        let any = wrong_derivative(&mut term, &node, &dynamics()).unwrap();
        assert_eq!(own, any);
        assert_eq!(own.as_ref().map(|wrong| wrong.entry.as_str()), expected);
        if let Some(wrong) = own {
            assert!((wrong.found - 1.01 * wrong.expected).abs() < 1e-6 * wrong.expected.abs(), "{wrong}");
            assert!(wrong.to_string().starts_with("the gradient of `the user's` must be its derivative"));
        }
    }
}

thread_local! {
    /// Calls of the user's function until it fails.
    static CALLS: Cell<usize> = const { Cell::new(usize::MAX) };
}

/// Half the squares of channel rates less 3, and (channel − 1)² of the user's, who knows no value beyond 0.7 at the end.
fn with_user() -> MotionProblem<Shooting<Tree>> {
    let (model, split) = chain();
    let phase = Phase::new(weights(9), 10, 1.0);
    let start = Start::fixed(&model.neutral(), &vec![0.0; model.n_velocities()]);
    let dynamics = Tree::try_new(model, split).unwrap();
    let shooting = Shooting::try_new(dynamics, start, vec![phase], ShootingOptions::default()).unwrap();
    let sizes = shooting.outline().sizes;
    let rows = |node: &Node<'_>, rows: &mut [f64]| {
        let left = CALLS.get();
        CALLS.set(left.saturating_sub(1));
        if left == 0 {
            return Err("the user's file is gone".into());
        }
        let x = node.channel[0];
        rows[0] = if x > 0.7 { f64::NAN } else { x - 1.0 };
        Ok(())
    };
    let pull_back = |_: &Node<'_>, y: &[f64], gradient: &mut NodeGradient| {
        gradient.channel[0] += y[0];
        Ok(())
    };
    let user = Function::new("the user's", 1, rows, pull_back);
    let rates = Loss::HalfSquares { weights: vec![1e-3; 2], target: vec![3.0; 2] };
    MotionProblem::builder(shooting)
        .lagrange(Entries::all(&sizes, Part::ChannelRate), rates)
        .and_then(|p| p.mayer(At::End, user, Loss::half_squares(1)))
        .and_then(|p| p.build())
        .unwrap()
}

/// Solves from zero, and returns the least cost that was seen too.
fn solve() -> (Result<Report, SolverError>, f64) {
    let mut problem = with_user();
    let z = vec![0.0; problem.structure().variables.len()];
    let mut least = f64::INFINITY;
    let outcome = Sqp { max_iterations: 60, ..Sqp::default() }.solve(&mut problem, &z.into(), &mut |at| {
        least = least.min(at.cost);
        Flow::Continue
    });
    (outcome, least)
}

#[test]
fn nan_of_a_users_term_is_stepped_back_from_and_the_best_iterate_kept() {
    CALLS.set(usize::MAX);
    let (outcome, least) = solve();
    let report = outcome.unwrap();
    println!("{} after {} steps: {}", report.status, report.iterations, report.cost);
    // the least cost lies where there is none
    assert!(!report.status.is_converged());
    assert!(report.iterations > 0 && report.cost == least, "{} {least}", report.cost);
    assert_eq!(with_user().evaluate(&report.z, &mut []).unwrap(), report.cost);
}

#[test]
fn an_error_of_a_users_term_ends_the_solve_with_the_error_and_the_best_iterate() {
    CALLS.set(6);
    let (outcome, least) = solve();
    CALLS.set(usize::MAX);
    let Err(SolverError::Failed { source, report }) = outcome else { panic!("{outcome:?}") };
    assert_eq!(source.to_string(), "the user's file is gone");
    assert_eq!(report.status, Status::Failed);
    assert_eq!(report.cost, least);
}
