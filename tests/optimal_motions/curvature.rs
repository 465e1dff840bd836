//! Exact Hessians of motion problems.

use crate::systems::{chain, floating, scattered, weights};
use nalgebra::Vector3;
use somersault_multibody::Split;
use somersault_multibody::joint_motion::{EigenpostureBase, SplineMotion};
use somersault_nlp::{Bounds, Curvature, Nlp};
use somersault_ocp::dynamics::Tree;
use somersault_ocp::problem::{At, Loss, MotionProblem, MotionProblemBuilder};
use somersault_ocp::shooting::{Drive, Duration, Phase, Scheme, Shooting, ShootingOptions, Start};
use somersault_ocp::term::{Displacement, Entries, Part, PointPosition};
use somersault_ocp::transcription::Transcription;

/// The chain through two phases with different bases and lifted states, all of its start free.
fn chain_in_phases(scheme: Scheme, torque: bool, duration: Duration) -> MotionProblemBuilder<Shooting<Tree>> {
    let (model, split) = chain();
    let (split, drive) = match torque {
        true => (Split::new(vec![false; 4]), Drive::Torque { dofs: vec![1, 3] }),
        false => (split, Drive::Motion),
    };
    let first = weights(8);
    let base = EigenpostureBase::try_new(&[[0.0, 0.1], [1.0, 0.0], [0.3, 1.0]]).unwrap();
    let second = SplineMotion::try_new(*first.basis(), base, &[]).unwrap();
    let phases = vec![
        Phase { motion: first, n_steps: 6, duration, n_segments: 2 },
        Phase { motion: second, n_steps: 7, duration: Duration::Fixed(0.4), n_segments: 2 },
    ];
    let dynamics = Tree::try_new(model, split).unwrap();
    let start = Start::free(&[0.1, -0.4, 0.7, 0.2], &[0.3, 0.1, -0.5, 0.4]);
    let shooting =
        Shooting::try_new(dynamics.clone(), start, phases, ShootingOptions { scheme, drive }).unwrap();
    let sizes = shooting.outline().sizes;
    let all = |part| Entries::all(&sizes, part);
    let losses = Loss::HalfSquares { weights: vec![0.7, 1.3, 0.4, 2.0], target: vec![0.3, -0.2, 0.1, 0.0] };
    let goal = Displacement::try_new(dynamics, &[0.0, 0.2, -0.3, 0.4], &[0, 1, 2, 3]).unwrap();
    MotionProblem::builder(shooting)
        .lagrange(all(Part::Torque), losses.clone())
        .and_then(|p| p.mayer(At::End, goal, losses))
        .and_then(|p| p.constrain(At::EveryNodeOf(1), all(Part::Velocity), Bounds::free(4)))
        .and_then(|p| p.constrain_integral(At::EveryNode, all(Part::Acceleration), Bounds::free(4)))
        .and_then(|p| p.constrain(At::Node(3), all(Part::ChannelRate), Bounds::free(2)))
        .and_then(|p| p.constrain_variables("sum", &[(3, 2.0), (5, -1.0)], 0.0, 1.0))
        .unwrap()
}

#[test]
fn exact_hessians_are_the_change_of_the_gradient_of_the_lagrangian() {
    for (scheme, torque) in
        [(Scheme::ExplicitEuler, false), (Scheme::RungeKutta4, false), (Scheme::RungeKutta4, true)]
    {
        let mut problem =
            chain_in_phases(scheme, torque, Duration::Fixed(0.5)).with_exact_hessian().build().unwrap();
        assert_eq!(problem.curvature(), Curvature::Exact);
        let structure = problem.structure().clone();
        let (n, m) = (structure.variables.len(), structure.constraints.len());
        let z: Vec<f64> = scattered(n, 2.0).iter().map(|x| 0.4 * x).collect();
        let (y, factor) = (scattered(m, 5.0), 0.8);
        let mut slope = |z: &[f64]| {
            let (mut c, mut g) = (vec![0.0; m], vec![0.0; n]);
            let mut jacobian = vec![0.0; structure.jacobian.n_entries()];
            problem.evaluate(z, &mut c).unwrap();
            problem.differentiate(z, &mut g, &mut jacobian).unwrap();
            g.iter_mut().for_each(|g| *g *= factor);
            structure.jacobian.add_transposed_product(&jacobian, &y, &mut g);
            g
        };
        let h = 1e-5;
        let moved =
            |j: usize, d: f64| (0..n).map(|i| z[i] + if i == j { d } else { 0.0 }).collect::<Vec<_>>();
        let columns: Vec<Vec<f64>> = (0..n)
            .map(|j| {
                let (plus, minus) = (slope(&moved(j, h)), slope(&moved(j, -h)));
                plus.iter().zip(minus).map(|(a, b)| (a - b) / (2.0 * h)).collect()
            })
            .collect();
        slope(&z);
        let mut hessian = vec![0.0; structure.hessian.n_entries()];
        problem.hessian(&z, factor, &y, &mut hessian).unwrap();
        let size = columns.iter().flatten().fold(0.0, |s: f64, x| s.max(x.abs()));
        for (j, column) in columns.iter().enumerate() {
            for (i, expected) in column[..=j].iter().enumerate() {
                let found = structure.hessian.value(&hessian, i, j);
                assert!(
                    (found - expected).abs() < 1e-7 * size,
                    "{scheme:?}, torque {torque}: ({i}, {j}) is {found}, not {expected}, largest {size}"
                );
            }
        }
    }
}

#[test]
fn what_has_no_second_derivatives_is_named() {
    let refused = |builder: MotionProblemBuilder<Shooting<Tree>>| {
        builder.with_exact_hessian().build().err().expect("refused").to_string()
    };
    let free = Duration::Free { lower: 0.1, upper: 1.0 };
    let expected = "the transcription has no second derivatives, which an exact Hessian needs";
    assert_eq!(refused(chain_in_phases(Scheme::RungeKutta4, false, free)), expected);
    let (model, split) = floating();
    let phase = Phase::new(weights(8), 4, 0.5);
    let (q, v) = (model.neutral(), vec![0.0; 8]);
    let dynamics = Tree::try_new(model, split).unwrap();
    let shooting =
        Shooting::try_new(dynamics, Start::fixed(&q, &v), vec![phase], ShootingOptions::default()).unwrap();
    assert_eq!(refused(MotionProblem::builder(shooting)), expected);
    let (model, _) = chain();
    let tip = PointPosition::try_new(model, "c", Vector3::z()).unwrap();
    let fixed = chain_in_phases(Scheme::RungeKutta4, false, Duration::Fixed(0.5));
    let named = refused(fixed.mayer(At::End, tip, Loss::half_squares(3)).unwrap());
    assert!(named.ends_with("has no second derivatives, which an exact Hessian needs"), "{named}");
    assert_ne!(named, expected);
}
