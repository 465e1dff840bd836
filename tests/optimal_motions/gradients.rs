//! Gradients of shooting equal automatic differentiation of the same recursion, written once more with dual numbers.

use crate::systems::{chain, floating, scattered, weights};
use nalgebra::DVector;
use num_dual::Dual64;
use somersault_core::Scalar;
use somersault_multibody::joint_motion::{EigenpostureBase, SplineMotion};
use somersault_multibody::{Data, Model, Split};
use somersault_nlp::{Bounds, Nlp};
use somersault_ocp::dynamics::{CartPendulumDynamics, HybridDynamics, Tree};
use somersault_ocp::problem::{At, Loss, MotionProblem, Sweep};
use somersault_ocp::shooting::{Drive, Duration, Phase, Scheme, Shooting, ShootingOptions, Start};
use somersault_ocp::term::{Displacement, Entries, Momentum, MomentumPart, Part, PointPosition};
use somersault_ocp::transcription::Transcription;

/// One phase from a free start, with a free duration.
struct Case {
    model: Model,
    split: Split,
    motion: SplineMotion,
    scheme: Scheme,
    drive: Drive,
    n_steps: usize,
    position: Vec<f64>,
    velocity: Vec<f64>,
}

const TARGET_WEIGHT: f64 = 3.0;

impl Case {
    fn new((model, split): (Model, Split), scheme: Scheme, n_steps: usize) -> Self {
        let (mut position, velocity) = (model.neutral(), scattered(model.n_velocities(), 5.0));
        let turned = model.clone();
        let push: Vec<f64> = scattered(model.n_velocities(), 2.0).iter().map(|x| 0.4 * x).collect();
        turned.displace(&model.neutral(), &push, &mut position).unwrap();
        let motion = weights(9);
        Self { model, split, motion, scheme, drive: Drive::Motion, n_steps, position, velocity }
    }

    fn shooting(&self, n_segments: usize) -> Shooting<Tree> {
        let phase = Phase {
            motion: self.motion.clone(),
            n_steps: self.n_steps,
            duration: Duration::Free { lower: 0.2, upper: 3.0 },
            n_segments,
        };
        let start = Start::free(&self.position, &self.velocity);
        let dynamics = Tree::try_new(self.model.clone(), self.split.clone()).unwrap();
        let options = ShootingOptions { scheme: self.scheme, drive: self.drive.clone() };
        Shooting::try_new(dynamics, start, vec![phase], options).unwrap()
    }

    /// ½ w ‖q(N) ⊖ q_f‖² + ½ w ‖v(N)‖² + ∫ ½ ‖τ‖² + ½ ‖ẇ‖² + t dt.
    fn problem(&self, shooting: Shooting<Tree>) -> MotionProblem<Shooting<Tree>> {
        let n = self.model.n_velocities();
        let sizes = shooting.outline().sizes;
        let all: Vec<usize> = (0..n).collect();
        let weighted = || Loss::HalfSquares { weights: vec![TARGET_WEIGHT; n], target: vec![0.0; n] };
        let dynamics = shooting.dynamics().clone();
        let reference = self.model.neutral();
        MotionProblem::builder(shooting)
            .mayer(At::End, Displacement::try_new(dynamics, &reference, &all).unwrap(), weighted())
            .and_then(|p| p.mayer(At::End, Entries::all(&sizes, Part::Velocity), weighted()))
            .and_then(|p| p.lagrange(Entries::all(&sizes, Part::Torque), Loss::half_squares(n)))
            .and_then(|p| p.lagrange(Entries::all(&sizes, Part::ChannelRate), Loss::half_squares(2)))
            .and_then(|p| p.lagrange(Entries::all(&sizes, Part::Time), Loss::Linear { weights: vec![1.0] }))
            .and_then(|p| p.build())
            .unwrap()
    }

    /// The same cost, written anew over any scalar.
    fn cost<T: Scalar>(&self, z: &[T]) -> T {
        let constant = |x: f64| nalgebra::convert::<f64, T>(x);
        let model: Model<T> = self.model.cast();
        let n = model.n_velocities();
        let passive: Vec<usize> = (0..n).filter(|k| !self.split.active()[*k]).collect();
        let n_p = self.motion.n_parameters();
        let (psi, rest) = z.split_at(2 * passive.len());
        let (p, duration) = (&rest[..n_p], rest[n_p]);
        let mut coefficients: Vec<T> = self.motion.offset().iter().map(|x| constant(*x)).collect();
        for (coefficient, parameter, factor) in self.motion.dependences() {
            coefficients[coefficient] += p[parameter] * constant(factor);
        }
        let basis = self.motion.basis();
        let channels = |share: f64, derivative: usize| -> Vec<T> {
            let mut values = vec![0.0; basis.n_active()];
            let first = basis.evaluate(share, derivative, &mut values);
            let scale = (0..derivative).fold(T::one(), |s, _| s / duration);
            (0..self.motion.n_channels())
                .map(|c| {
                    let own = &coefficients[c * basis.n_coefficients() + first..];
                    values.iter().zip(own).fold(T::zero(), |s, (b, c)| s + *c * constant(*b)) * scale
                })
                .collect()
        };
        let base = self.motion.base();
        let joints = |share: f64, derivative: usize| -> Vec<T> {
            let weights = channels(share, derivative);
            (0..base.n_joints())
                .map(|j| {
                    let start = if derivative == 0 { base.fundamental()[j] } else { 0.0 };
                    let directions = base.directions();
                    weights
                        .iter()
                        .enumerate()
                        .fold(constant(start), |s, (i, w)| s + *w * constant(directions[(j, i)]))
                })
                .collect()
        };
        let driven: Vec<usize> = match &self.drive {
            Drive::Motion => (0..n).filter(|k| self.split.active()[*k]).collect(),
            Drive::Torque { dofs } => dofs.clone(),
        };
        let mut data = Data::new(&model);
        // completes a passive state, and gives accelerations and torques
        let mut evaluate = |q: &mut [T], v: &mut [T], share: f64| -> (Vec<T>, Vec<T>) {
            let (mut a, mut tau) = (vec![T::zero(); n], vec![T::zero(); n]);
            let given = joints(share, 0);
            if let Drive::Torque { .. } = self.drive {
                driven.iter().zip(given).for_each(|(k, x)| tau[*k] = x);
            } else {
                let offset = model.n_positions() - n;
                for (i, k) in driven.iter().enumerate() {
                    q[k + offset] = given[i];
                    v[*k] = joints(share, 1)[i];
                    a[*k] = joints(share, 2)[i];
                }
            }
            model.hybrid_dynamics(&mut data, &self.split, q, v, &mut a, &mut tau, &[]).unwrap();
            (a, tau)
        };
        let part = |values: &[T]| -> Vec<T> {
            let mut all = vec![T::zero(); n];
            passive.iter().zip(values).for_each(|(k, x)| all[*k] = *x);
            all
        };
        let moved = |q: &[T], d: &[T]| -> Vec<T> {
            let mut out = q.to_vec();
            let mut d = d.to_vec();
            driven.iter().filter(|k| self.split.active()[**k]).for_each(|k| d[*k] = T::zero());
            model.displace(q, &d, &mut out).unwrap();
            out
        };
        let combine = |terms: &[(f64, &[T])]| -> Vec<T> {
            (0..n).map(|k| terms.iter().fold(T::zero(), |s, (f, x)| s + x[k] * constant(*f))).collect()
        };
        let start: Vec<T> = self.position.iter().map(|x| constant(*x)).collect();
        let mut q = moved(&start, &part(&psi[..passive.len()]));
        let mut v: Vec<T> = self.velocity.iter().map(|x| constant(*x)).collect();
        part(&psi[passive.len()..]).iter().enumerate().for_each(|(k, x)| v[k] += *x);
        let steps = self.n_steps;
        let h = duration / constant(steps as f64);
        let scaled = |x: Vec<T>| -> Vec<T> { x.into_iter().map(|x| x * h).collect() };
        let mut cost = T::zero();
        let gregory = |k: usize| match k.min(steps - k) {
            _ if self.scheme == Scheme::ExplicitEuler => f64::from(u8::from(k < steps)),
            0 => 3.0 / 8.0,
            1 => 7.0 / 6.0,
            2 => 23.0 / 24.0,
            _ => 1.0,
        };
        let half = constant(0.5);
        for k in 0..=steps {
            let share = k as f64 / steps as f64;
            let (a, tau) = evaluate(&mut q, &mut v, share);
            let squares = tau.iter().chain(&channels(share, 1)).fold(T::zero(), |s, x| s + *x * *x);
            cost += (squares * half + duration * constant(share)) * h * constant(gregory(k));
            if k == steps {
                break;
            }
            let between = (k as f64 + 0.5) / steps as f64;
            let next = (k + 1) as f64 / steps as f64;
            let mut plus = |base: &[T], v0: &[T], d: Vec<T>, dv: Vec<T>, share: f64| {
                let mut q = moved(base, &scaled(d));
                let mut v: Vec<T> = v0.iter().zip(scaled(dv)).map(|(v, d)| *v + d).collect();
                let (a, _) = evaluate(&mut q, &mut v, share);
                (q, v, a)
            };
            if self.scheme == Scheme::ExplicitEuler {
                q = moved(&q, &scaled(v.clone()));
                v = v.iter().zip(scaled(a)).map(|(v, d)| *v + d).collect();
                continue;
            }
            let (q2, v2, a2) = plus(&q, &v, combine(&[(0.5, &v)]), combine(&[(0.5, &a)]), between);
            let (_, v3, a3) = plus(&q, &v, combine(&[(0.5, &v2)]), combine(&[(0.5, &a2)]), between);
            let (_, v4, a4) = plus(&q2, &v, combine(&[(1.0, &v3), (-0.5, &v)]), combine(&[(1.0, &a3)]), next);
            let twelfth = 1.0 / 12.0;
            let first =
                combine(&[(3.0 * twelfth, &v), (2.0 * twelfth, &v2), (2.0 * twelfth, &v3), (-twelfth, &v4)]);
            let second =
                combine(&[(-twelfth, &v), (2.0 * twelfth, &v2), (2.0 * twelfth, &v3), (3.0 * twelfth, &v4)]);
            q = moved(&moved(&q, &scaled(first)), &scaled(second));
            let push = combine(&[(1.0 / 6.0, &a), (1.0 / 3.0, &a2), (1.0 / 3.0, &a3), (1.0 / 6.0, &a4)]);
            v = v.iter().zip(scaled(push)).map(|(v, d)| *v + d).collect();
        }
        let mut end = vec![T::zero(); n];
        let reference: Vec<T> = self.model.neutral().iter().map(|x| constant(*x)).collect();
        model.difference(&reference, &q, &mut end).unwrap();
        let squares = end.iter().chain(&v).fold(T::zero(), |s, x| s + *x * *x);
        cost + squares * half * constant(TARGET_WEIGHT)
    }

    fn z(&self) -> Vec<f64> {
        let n_passive = self.split.active().iter().filter(|active| !**active).count();
        let n = 2 * n_passive + self.motion.n_parameters();
        let mut z: Vec<f64> = scattered(n, 1.0).iter().map(|x| 0.3 * x).collect();
        z.push(0.7);
        z
    }

    fn expect_gradient(&self) {
        let z = self.z();
        let mut problem = self.problem(self.shooting(1));
        assert_eq!(problem.structure().variables.len(), z.len());
        let cost = problem.evaluate(&z, &mut []).unwrap();
        let mut gradient = vec![0.0; z.len()];
        problem.differentiate(&z, &mut gradient, &mut []).unwrap();
        let scale = gradient.iter().fold(1.0_f64, |s, g| s.max(g.abs()));
        for k in 0..z.len() {
            let along: Vec<Dual64> =
                z.iter().enumerate().map(|(i, x)| Dual64::new(*x, f64::from(u8::from(i == k)))).collect();
            let expected = self.cost(&along);
            assert!((cost - expected.re).abs() < 1e-11 * expected.re.abs(), "{cost} {}", expected.re);
            assert!(
                (gradient[k] - expected.eps).abs() < 1e-11 * scale,
                "{k}: {} {}",
                gradient[k],
                expected.eps
            );
        }
    }
}

#[test]
fn euler_gradient_of_the_chain_equals_dual_numbers() {
    Case::new(chain(), Scheme::ExplicitEuler, 25).expect_gradient();
}

#[test]
fn runge_kutta_gradient_of_the_chain_equals_dual_numbers() {
    Case::new(chain(), Scheme::RungeKutta4, 12).expect_gradient();
}

#[test]
fn euler_gradient_of_the_floating_body_equals_dual_numbers() {
    Case::new(floating(), Scheme::ExplicitEuler, 25).expect_gradient();
}

#[test]
fn lie_group_gradient_of_the_floating_body_equals_dual_numbers() {
    Case::new(floating(), Scheme::RungeKutta4, 12).expect_gradient();
}

#[test]
fn gradient_by_torques_equals_dual_numbers() {
    let (model, split) = chain();
    let passive = Split::new(vec![false; split.active().len()]);
    let mut case = Case::new((model, passive), Scheme::RungeKutta4, 12);
    case.drive = Drive::Torque { dofs: vec![1, 3] };
    case.expect_gradient();
}

/// A problem with all that has derivatives: lifted states, two phases of free duration with different bases, point,
/// path and integral constraints.
fn everything(system: (Model, Split), same_base: bool, sweep: Sweep) -> MotionProblem<Shooting<Tree>> {
    let case = Case::new(system, Scheme::RungeKutta4, 9);
    let second = if same_base {
        SplineMotion::try_new(*case.motion.basis(), case.motion.base().clone(), &[]).unwrap()
    } else {
        let base = EigenpostureBase::try_new(&[[0.0, 0.1], [1.0, 0.0], [0.3, 1.0]]).unwrap();
        SplineMotion::try_new(*case.motion.basis(), base, &[]).unwrap()
    };
    let duration = Duration::Free { lower: 0.1, upper: 2.0 };
    let phases = vec![
        Phase { motion: case.motion.clone(), n_steps: 9, duration, n_segments: 3 },
        Phase { motion: second, n_steps: 8, duration, n_segments: 2 },
    ];
    let dynamics = Tree::try_new(case.model.clone(), case.split.clone()).unwrap();
    let start = Start::free(&case.position, &case.velocity);
    let shooting = Shooting::try_new(dynamics, start, phases, ShootingOptions::default()).unwrap();
    let sizes = shooting.outline().sizes;
    let bounds = |n: usize| Bounds { lower: vec![-1.0; n], upper: vec![1.0; n] };
    let (n, last) = (sizes.n_velocities, case.model.n_bodies() - 1);
    let tip = case.model.name(last).unwrap().to_owned();
    let tip =
        PointPosition::try_new(case.model.clone(), &tip, nalgebra::Vector3::new(0.1, 0.2, 0.3)).unwrap();
    MotionProblem::builder(shooting)
        .with_sweep(sweep)
        .mayer(At::End, tip.clone(), Loss::half_squares(3))
        .and_then(|p| p.lagrange(Entries::all(&sizes, Part::Torque), Loss::half_squares(n)))
        .and_then(|p| p.constrain(At::EveryNodeOf(1), tip, bounds(3)))
        .and_then(|p| {
            let momentum = Momentum::new(case.model.clone(), MomentumPart::Angular);
            p.constrain(At::StartOf(1), momentum, bounds(3))
        })
        .and_then(|p| {
            p.constrain_integral(At::EveryNode, Entries::all(&sizes, Part::Acceleration), bounds(n))
        })
        .and_then(|p| p.constrain(At::Node(5), Entries::all(&sizes, Part::ChannelSecondRate), bounds(2)))
        .and_then(|p| p.constrain(At::End, Entries::all(&sizes, Part::Time), bounds(1)))
        .and_then(|p| p.constrain_variables("sum", &[(3, 2.0), (5, -1.0), (3, 0.5)], 0.0, 1.0))
        .and_then(|p| p.build())
        .unwrap()
}

fn start_of(problem: &MotionProblem<Shooting<Tree>>) -> Vec<f64> {
    let mut z: Vec<f64> =
        scattered(problem.structure().variables.len(), 3.0).iter().map(|x| 0.3 * x).collect();
    for variable in problem.transcription().layout().durations.iter().flatten() {
        z[*variable] = 0.5;
    }
    z
}

fn differentiated(problem: &mut MotionProblem<Shooting<Tree>>, z: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let structure = problem.structure().clone();
    let mut constraints = vec![0.0; structure.constraints.len()];
    problem.evaluate(z, &mut constraints).unwrap();
    let (mut gradient, mut jacobian) = (vec![0.0; z.len()], vec![0.0; structure.jacobian.n_entries()]);
    problem.differentiate(z, &mut gradient, &mut jacobian).unwrap();
    (gradient, jacobian)
}

#[test]
fn adjoint_and_forward_jacobians_are_equal() {
    for (system, same_base) in [(chain(), true), (chain(), false), (floating(), false)] {
        let mut by_adjoint = everything(system.clone(), same_base, Sweep::Adjoint);
        let mut by_tangents = everything(system, same_base, Sweep::Forward);
        let z = start_of(&by_adjoint);
        let ((_, a), (_, f)) = (differentiated(&mut by_adjoint, &z), differentiated(&mut by_tangents, &z));
        let scale = a.iter().fold(1.0_f64, |s, x| s.max(x.abs()));
        for (k, row, column) in by_adjoint.structure().jacobian.entries() {
            assert!((a[k] - f[k]).abs() < 1e-12 * scale, "({row}, {column}): {} {}", a[k], f[k]);
        }
    }
}

#[test]
fn jacobians_equal_central_differences_and_have_no_entry_outside_of_their_pattern() {
    for (system, same_base) in [(chain(), true), (floating(), false)] {
        let mut problem = everything(system, same_base, Sweep::Forward);
        let z = start_of(&problem);
        let (gradient, jacobian) = differentiated(&mut problem, &z);
        let pattern = problem.structure().jacobian.clone();
        let mut values = [vec![0.0; pattern.n_rows], vec![0.0; pattern.n_rows]];
        let step = 2e-6;
        for j in 0..z.len() {
            let costs = [step, -step].map(|h| {
                let mut moved = z.clone();
                moved[j] += h;
                problem.evaluate(&moved, &mut values[usize::from(h < 0.0)]).unwrap()
            });
            let slope = (costs[0] - costs[1]) / (2.0 * step);
            assert!((gradient[j] - slope).abs() < 1e-6 * (1.0 + slope.abs()), "{j} {} {slope}", gradient[j]);
            for i in 0..pattern.n_rows {
                let found = pattern.value(&jacobian, i, j);
                let slope = (values[0][i] - values[1][i]) / (2.0 * step);
                let name = &problem.constraint_names()[i];
                assert!((found - slope).abs() < 2e-6 * (1.0 + slope.abs()), "{name}, {j}: {found} {slope}");
            }
        }
    }
}

#[test]
fn closed_gaps_are_closed() {
    for system in [chain(), floating()] {
        let mut problem = everything(system, true, Sweep::Forward);
        let mut z = start_of(&problem);
        problem.transcription_mut().close_gaps(&mut z).unwrap();
        let shooting = problem.transcription();
        let links = 2 * shooting.outline().sizes.n_channels;
        let n_state = shooting.layout().lifted[0].len();
        // what the channels do where the second phase begins stays
        let linked = 3 * n_state..3 * n_state + links;
        for (i, defect) in shooting.defects().iter().enumerate().filter(|(i, _)| !linked.contains(i)) {
            assert!(defect.abs() < 1e-12, "{i}: {defect}");
        }
    }
}

#[test]
fn a_motion_without_a_value_does_not_spoil_the_next() {
    for scheme in [Scheme::ExplicitEuler, Scheme::RungeKutta4] {
        let mut shooting = Case::new(chain(), scheme, 9).shooting(2);
        let z = scattered(shooting.outline().n_variables(), 3.0);
        let wild: Vec<f64> = z.iter().map(|z| 1e160 * z).collect();
        shooting.rollout(&z).unwrap();
        let defects = shooting.defects().to_vec();
        assert!(shooting.rollout(&wild).is_err());
        shooting.rollout(&z).unwrap();
        assert_eq!(shooting.defects(), defects);
    }
}

#[test]
fn gauss_newton_is_the_sum_of_squared_tangents() {
    // residuals by their own constraints: H = Σ ω_k J_kᵀ J_k of the torques at every node
    let case = Case::new(floating(), Scheme::RungeKutta4, 8);
    let shooting = case.shooting(2);
    let (sizes, n) = (shooting.outline().sizes, shooting.outline().n_variables());
    let m = sizes.n_torques;
    let free = Bounds::free(m);
    let torque = Entries::all(&sizes, Part::Torque);
    let mut problem = MotionProblem::builder(shooting)
        .lagrange(torque.clone(), Loss::HalfSquares { weights: vec![2.5; m], target: vec![0.3; m] })
        .and_then(|p| p.constrain(At::EveryNode, torque, free))
        .and_then(|p| p.build())
        .unwrap();
    let z = start_of(&problem);
    let (_, jacobian) = differentiated(&mut problem, &z);
    let structure = problem.structure().clone();
    let mut hessian = vec![0.0; structure.hessian.n_entries()];
    problem.hessian(&z, 2.0, &[], &mut hessian).unwrap();
    let n_defects = problem.transcription().outline().n_defects();
    let mut expected = nalgebra::DMatrix::<f64>::zeros(n, n);
    for row in n_defects..structure.constraints.len() {
        let weight = problem.transcription().weight((row - n_defects) / m);
        let row = DVector::from_fn(n, |j, _| structure.jacobian.value(&jacobian, row, j));
        expected += &row * row.transpose() * (2.0 * 2.5 * weight);
    }
    for j in 0..n {
        for i in 0..=j {
            let found = structure.hessian.value(&hessian, i, j);
            assert!((found - expected[(i, j)]).abs() < 1e-10 * expected.amax(), "({i}, {j})");
        }
    }
}

#[test]
fn the_closed_form_of_the_cart_pendulum_equals_its_tree() {
    let parameters =
        somersault_multibody::models::CartPendulum { cart_mass: 1.3, mass: 0.6, length: 0.7, gravity: 3.7 };
    let mut closed = CartPendulumDynamics::try_new(parameters).unwrap();
    let mut tree = Tree::try_new(parameters.model().unwrap(), Split::new(vec![true, false])).unwrap();
    for seed in 0..20 {
        let x = scattered(6, f64::from(seed));
        let (q, v, known) = (&x[..2], &x[2..4], &x[4..]);
        let (mut a, mut b) = ([0.0; 2], [0.0; 2]);
        closed.calc(q, v, known, &mut a).unwrap();
        tree.calc(q, v, known, &mut b).unwrap();
        let (mut da, mut db) = ([0.0; 12], [0.0; 12]);
        closed.calc_diff(q, v, known, &mut da).unwrap();
        tree.calc_diff(q, v, known, &mut db).unwrap();
        for (a, b) in a.iter().chain(&da).zip(b.iter().chain(&db)) {
            assert!((a - b).abs() < 1e-13 * (1.0 + b.abs()), "{seed}: {a} {b}");
        }
    }
}
