//! Partials of the dynamics of trees: against dual numbers, against differences, and their identities.

use nalgebra::{DMatrix, Vector3};
use num_dual::{Dual64, HyperDual64};
use somersault::multibody::{
    Data, DerivativeData, DynamicsError, Force, Joint, LaneData, Link, MassProperties, Model, ModelBuilder,
    Partials, SecondDerivativeData, Split,
};
use somersault_core::argument::ArgumentError;
use somersault_core::lanes::InstructionSet;
use somersault_testkit::trees::{Case, Random, cases};

fn duals(x: &[f64]) -> Vec<Dual64> {
    x.iter().map(|&x| Dual64::from_re(x)).collect()
}

fn constant(wrenches: &[Force<f64>]) -> Vec<Force<Dual64>> {
    wrenches
        .iter()
        .map(|w| Force::new(w.linear.map(Dual64::from_re), w.angular.map(Dual64::from_re)))
        .collect()
}

/// Which argument a partial is taken by.
#[derive(Clone, Copy, PartialEq, Debug)]
enum By {
    Q,
    V,
    Input,
}

/// The matrix of partials of `f(q, v, input)` by dual numbers, one direction at a time.
fn by_duals(
    model: &Model<Dual64>,
    (q, v, input): (&[f64], &[f64], &[f64]),
    by: By,
    mut f: impl FnMut(&[Dual64], &[Dual64], &[Dual64]) -> Vec<Dual64>,
) -> DMatrix<f64> {
    let n = model.n_velocities();
    let mut out = DMatrix::zeros(n, n);
    for k in 0..n {
        let (mut q_, mut v_, mut input_) = (duals(q), duals(v), duals(input));
        match by {
            By::Q => {
                let mut step = vec![Dual64::from_re(0.0); n];
                step[k].eps = 1.0;
                model.displace(&duals(q), &step, &mut q_).unwrap();
            }
            By::V => v_[k].eps = 1.0,
            By::Input => input_[k].eps = 1.0,
        }
        for (i, x) in f(&q_, &v_, &input_).iter().enumerate() {
            out[(i, k)] = x.eps;
        }
    }
    out
}

/// Largest entry of the difference, relative to the largest entry of the expected matrix.
fn off(found: &DMatrix<f64>, expected: &DMatrix<f64>) -> f64 {
    if expected.is_empty() { 0.0 } else { (found - expected).amax() / expected.amax().max(1e-300) }
}

/// 1e-10, or 100 ε cond(M) where that is more: what elimination by M leaves.
fn tolerance(model: &Model, q: &[f64]) -> f64 {
    let mut data = Data::new(model);
    let m = model.mass_matrix(&mut data, q).unwrap();
    if m.is_empty() {
        return 1e-10;
    }
    let eigenvalues = m.symmetric_eigenvalues();
    f64::max(1e-10, 100.0 * f64::EPSILON * eigenvalues.max() / eigenvalues.min())
}

const ALL: [By; 3] = [By::Q, By::V, By::Input];

fn pick<'a>(p: &Partials<'a>, by: By) -> &'a DMatrix<f64> {
    match by {
        By::Q => p.q,
        By::V => p.v,
        By::Input => p.input,
    }
}

#[test]
fn partials_of_inverse_dynamics_equal_dual_numbers() {
    for (seed, Case { model, q, v, a, wrenches, .. }) in cases(60).enumerate() {
        let mut work = DerivativeData::new(&model);
        let found = model.inverse_dynamics_partials(&mut work, &q, &v, &a, &wrenches).unwrap();
        let mut data = Data::new(&model);
        let torque = model.inverse_dynamics(&mut data, &q, &v, &a, &wrenches).unwrap();
        for (x, y) in found.value.iter().zip(torque) {
            assert!((x - y).abs() < 1e-11 * (1.0 + y.abs()), "seed {seed}: {x} {y}");
        }
        let (dual, outer) = (model.cast::<Dual64>(), constant(&wrenches));
        let mut data = Data::new(&dual);
        for by in ALL {
            let exact = by_duals(&dual, (&q, &v, &a), by, |q, v, a| {
                dual.inverse_dynamics(&mut data, q, v, a, &outer).unwrap().to_vec()
            });
            let off = off(pick(&found, by), &exact);
            assert!(off < 1e-12, "seed {seed}, {by:?}: {off:e}");
        }
    }
}

#[test]
fn partials_of_forward_dynamics_equal_dual_numbers() {
    for (seed, Case { model, q, v, a, wrenches, .. }) in cases(60).enumerate() {
        let mut work = DerivativeData::new(&model);
        let found = model.forward_dynamics_partials(&mut work, &q, &v, &a, &wrenches).unwrap();
        let (dual, outer) = (model.cast::<Dual64>(), constant(&wrenches));
        let mut data = Data::new(&dual);
        for by in ALL {
            let exact = by_duals(&dual, (&q, &v, &a), by, |q, v, torque| {
                dual.forward_dynamics(&mut data, q, v, torque, &outer).unwrap().to_vec()
            });
            let off = off(pick(&found, by), &exact);
            assert!(off < tolerance(&model, &q), "seed {seed}, {by:?}: {off:e}");
        }
    }
}

#[test]
fn partials_of_hybrid_dynamics_equal_dual_numbers_for_any_split() {
    for (seed, Case { model, q, v, a, wrenches, mut random }) in cases(60).enumerate() {
        let split = Split::new((0..a.len()).map(|_| random.below(2) == 1).collect());
        let mut work = DerivativeData::new(&model);
        let found = model.hybrid_dynamics_partials(&mut work, &split, &q, &v, &a, &wrenches).unwrap();
        let (dual, outer) = (model.cast::<Dual64>(), constant(&wrenches));
        let mut data = Data::new(&dual);
        for by in ALL {
            let exact = by_duals(&dual, (&q, &v, &a), by, |q, v, known| {
                let (mut a, mut torque) = (known.to_vec(), known.to_vec());
                dual.hybrid_dynamics(&mut data, &split, q, v, &mut a, &mut torque, &outer).unwrap();
                let both = a.iter().zip(&torque).zip(split.active());
                both.map(|((a, torque), active)| if *active { *torque } else { *a }).collect()
            });
            let off = off(pick(&found, by), &exact);
            assert!(off < tolerance(&model, &q), "seed {seed}, {by:?}: {off:e}");
        }
    }
}

/// wᵀ ∂τ/∂(q, v, a) and its derivatives along rows of (dq, dv, da), by the partials over dual numbers, one direction at a time.
pub(crate) fn contracted(
    model: &Model<Dual64>,
    [q, v, a, weights]: [&[f64]; 4],
    wrenches: &[Force<Dual64>],
    directions: &[f64],
) -> Vec<f64> {
    let state: Vec<f64> = [q, v, a].concat();
    let mut work = DerivativeData::new(model);
    let mut rows = Vec::new();
    let still = vec![0.0; state.len()];
    for (k, direction) in std::iter::once(&still[..]).chain(directions.chunks(state.len())).enumerate() {
        let moved: Vec<_> = state.iter().zip(direction).map(|(x, d)| Dual64::new(*x, *d)).collect();
        let (q, rest) = moved.split_at(q.len());
        let (v, a) = rest.split_at(v.len());
        let found = model.inverse_dynamics_partials(&mut work, q, v, a, wrenches).unwrap();
        for column in [found.q, found.v, found.input].iter().flat_map(|matrix| matrix.column_iter()) {
            let sum: Dual64 = column.iter().zip(weights).map(|(x, w)| *x * *w).sum();
            rows.push(if k == 0 { sum.re } else { sum.eps });
        }
    }
    rows
}

/// Directions that displace q, v and a at random, as rows of changes of their numbers.
pub(crate) fn random_directions(model: &Model, q: &[f64], random: &mut Random, count: usize) -> Vec<f64> {
    let (n, dual) = (model.n_velocities(), model.cast::<Dual64>());
    let mut rows = Vec::new();
    for _ in 0..count {
        let step: Vec<_> = random.numbers(n, 1.0).into_iter().map(|d| Dual64::new(0.0, d)).collect();
        let mut moved = duals(q);
        dual.displace(&duals(q), &step, &mut moved).unwrap();
        rows.extend(moved.iter().map(|q| q.eps));
        rows.extend(random.numbers(2 * n, 1.0));
    }
    rows
}

#[test]
fn second_derivatives_of_inverse_dynamics_are_those_over_dual_numbers() {
    for (seed, Case { model, q, v, a, wrenches, mut random }) in cases(60).enumerate() {
        let n = model.n_velocities();
        // a group of lanes and a part of one, fewer than there are lanes, and none
        for count in [11, 2, 0] {
            let directions = random_directions(&model, &q, &mut random, count);
            let weights = random.numbers(n, 2.0);
            let state = [&q[..], &v, &a, &weights];
            let expected = contracted(&model.cast(), state, &constant(&wrenches), &directions);
            let size = expected.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
            for set in InstructionSet::supported() {
                let mut data = SecondDerivativeData::with_instructions(set);
                let mut rows = vec![f64::NAN; (count + 1) * 3 * n];
                model
                    .inverse_dynamics_second_derivatives(
                        &mut data,
                        &q,
                        &v,
                        &a,
                        &wrenches,
                        &weights,
                        &directions,
                        &mut rows,
                    )
                    .unwrap();
                for (found, expected) in rows.iter().zip(&expected) {
                    let off = (found - expected).abs() / size;
                    assert!(off < 1e-13, "seed {seed}, {count} directions, {}: {off:e}", set.name());
                }
            }
        }
    }
}

/// Three hinges as a chain, a star and a fork: trees of one size.
fn trees_of_one_size() -> [Model; 3] {
    let hinge = Joint::Revolute { axis: Vector3::z() };
    let mass = MassProperties::point(1.0, Vector3::new(0.2, -0.5, 0.1));
    [["base", "a", "b"], ["base", "base", "base"], ["base", "a", "a"]].map(|parents| {
        let mut builder = ModelBuilder::new();
        builder.add(Link::root("base", Joint::Fixed, mass)).unwrap();
        for (name, parent) in ["a", "b", "c"].into_iter().zip(parents) {
            builder.add(Link::child(name, parent, hinge, mass).at(Vector3::x())).unwrap();
        }
        builder.build().unwrap()
    })
}

/// What is zero between branches of one tree is not so in another.
#[test]
fn a_workspace_for_another_tree_of_the_same_size_is_refused() {
    let models = trees_of_one_size();
    let (q, v, a) = ([0.3, -0.4, 0.9], [1.0, 2.0, -1.0], [0.5, 0.1, 0.2]);
    for (i, own) in models.iter().enumerate() {
        for (j, other) in models.iter().enumerate() {
            let (mut data, mut work) = (Data::new(own), DerivativeData::new(own));
            let (mut lanes, mut matrices) = (LaneData::new(own), [0.0; 18]);
            let refused = [
                other.mass_matrix(&mut data, &q).err(),
                other.inverse_dynamics_partials(&mut work, &q, &v, &a, &[]).err(),
                other.forward_dynamics_partials(&mut work, &q, &v, &a, &[]).err(),
                other.mass_matrix_many(&mut lanes, &[q, q].concat(), &mut matrices).err(),
            ];
            for error in refused {
                assert_eq!(error.is_some(), i != j, "{i} {j}: {error:?}");
                assert!(error.is_none_or(|error| matches!(error, DynamicsError::ForeignData)));
            }
        }
    }
}

#[test]
fn a_workspace_of_second_derivatives_serves_any_model() {
    let models = trees_of_one_size();
    let mut random = Random::new(5);
    let others = cases(6).map(|Case { model, q, .. }| (model, q));
    let models = models.into_iter().map(|model| (model, vec![0.3, -0.4, 0.9])).chain(others);
    let mut data = SecondDerivativeData::default();
    for (model, q) in models {
        let n = model.n_velocities();
        let directions = random_directions(&model, &q, &mut random, 3);
        let [v, a, weights] = [(); 3].map(|()| random.numbers(n, 1.0));
        let mut rows = [(); 2].map(|()| vec![f64::NAN; 4 * 3 * n]);
        for (data, rows) in [&mut data, &mut SecondDerivativeData::default()].into_iter().zip(&mut rows) {
            model
                .inverse_dynamics_second_derivatives(data, &q, &v, &a, &[], &weights, &directions, rows)
                .unwrap();
        }
        assert_eq!(rows[0], rows[1]);
    }
}

#[test]
fn a_tree_without_freedom_has_no_second_derivatives() {
    let mut builder = ModelBuilder::new();
    builder.add(Link::root("base", Joint::Fixed, MassProperties::massless())).unwrap();
    let model = builder.build().unwrap();
    let mut data = SecondDerivativeData::default();
    let mut differentiate = |directions: &[f64], rows: &mut [f64]| {
        model.inverse_dynamics_second_derivatives(&mut data, &[], &[], &[], &[], &[], directions, rows)
    };
    differentiate(&[], &mut []).unwrap();
    assert!(differentiate(&[1.0], &mut []).is_err() && differentiate(&[], &mut [0.0]).is_err());
}

#[test]
fn second_derivatives_refuse_lengths_that_do_not_fit() {
    let Some(Case { model, q, v, a, .. }) = cases(20).find(|case| case.v.len() > 1) else {
        panic!("a tree with two degrees of freedom")
    };
    let (n, length) = (v.len(), q.len() + 2 * v.len());
    let mut data = SecondDerivativeData::default();
    let mut refused = |q: &[f64], v: &[f64], a: &[f64], weights: &[f64], directions: usize, rows: usize| {
        let (directions, mut rows) = (vec![0.0; directions], vec![0.0; rows]);
        let data = &mut data;
        match model.inverse_dynamics_second_derivatives(data, q, v, a, &[], weights, &directions, &mut rows) {
            Err(DynamicsError::Argument(ArgumentError::Length { argument, .. })) => argument,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(refused(&q[1..], &v, &a, &v, length, 6 * n), "q");
    assert_eq!(refused(&q, &v[1..], &a, &v, length, 6 * n), "v");
    assert_eq!(refused(&q, &v, &a[1..], &v, length, 6 * n), "a");
    assert_eq!(refused(&q, &v, &a, &v[1..], length, 6 * n), "weights");
    assert_eq!(refused(&q, &v, &a, &v, length + 1, 6 * n), "directions");
    assert_eq!(refused(&q, &v, &a, &v, length, 6 * n + 1), "rows");
}

#[test]
fn partials_equal_central_differences() {
    // Steps of h and h/2 with Richardson's extrapolation leave O(h⁴) and rounding.
    const H: f64 = 2e-3;
    for (seed, Case { model, q, v, a, wrenches, mut random }) in cases(40).enumerate() {
        let n = model.n_velocities();
        let split = Split::new((0..n).map(|_| random.below(2) == 1).collect());
        let direction = random.numbers(n, 1.0);
        let along = |by, p: &Partials<'_>| pick(p, by) * nalgebra::DVector::from_column_slice(&direction);
        let (mut data, mut work) = (Data::new(&model), DerivativeData::new(&model));
        for by in ALL {
            let mut at = |h: f64, hybrid: bool| {
                let step: Vec<f64> = direction.iter().map(|x| x * h).collect();
                let sum = |x: &[f64]| x.iter().zip(&step).map(|(x, d)| x + d).collect::<Vec<f64>>();
                let (mut q_, mut v_, mut a_) = (q.clone(), v.clone(), a.clone());
                match by {
                    By::Q => model.displace(&q, &step, &mut q_).unwrap(),
                    By::V => v_ = sum(&v),
                    By::Input => a_ = sum(&a),
                }
                if !hybrid {
                    let torque = model.inverse_dynamics(&mut data, &q_, &v_, &a_, &wrenches).unwrap();
                    return nalgebra::DVector::from_column_slice(torque);
                }
                let mut torque = a_.clone();
                model.hybrid_dynamics(&mut data, &split, &q_, &v_, &mut a_, &mut torque, &wrenches).unwrap();
                nalgebra::DVector::from_fn(n, |k, _| if split.active()[k] { torque[k] } else { a_[k] })
            };
            for hybrid in [false, true] {
                let mut slope = |h: f64| (at(h, hybrid) - at(-h, hybrid)) / (2.0 * h);
                let difference = (slope(0.5 * H) * 4.0 - slope(H)) / 3.0;
                let exact = if hybrid {
                    let p = model.hybrid_dynamics_partials(&mut work, &split, &q, &v, &a, &wrenches).unwrap();
                    along(by, &p)
                } else {
                    let p = model.inverse_dynamics_partials(&mut work, &q, &v, &a, &wrenches).unwrap();
                    along(by, &p)
                };
                let off = (difference - &exact).norm() / exact.norm().max(1e-300);
                assert!(n == 0 || off < 1e-6, "seed {seed}, {by:?}, hybrid {hybrid}: {off:e}");
            }
        }
    }
}

#[test]
fn partials_of_hybrid_dynamics_are_those_of_forward_and_inverse_dynamics_at_its_ends() {
    for (seed, Case { model, q, v, a, wrenches, .. }) in cases(20).enumerate() {
        let n = model.n_velocities();
        let (mut work, mut other) = (DerivativeData::new(&model), DerivativeData::new(&model));
        for active in [false, true] {
            let split = Split::new(vec![active; n]);
            let hybrid = model.hybrid_dynamics_partials(&mut work, &split, &q, &v, &a, &wrenches).unwrap();
            let end = if active {
                model.inverse_dynamics_partials(&mut other, &q, &v, &a, &wrenches).unwrap()
            } else {
                model.forward_dynamics_partials(&mut other, &q, &v, &a, &wrenches).unwrap()
            };
            for by in ALL {
                assert!(off(pick(&hybrid, by), pick(&end, by)) < 1e-12, "seed {seed}, {by:?}, {active}");
            }
        }
    }
}

#[test]
fn partials_of_centre_of_mass_and_momentum_equal_dual_numbers() {
    for (seed, Case { model, q, v, .. }) in cases(60).enumerate() {
        let n = model.n_velocities();
        let mut work = DerivativeData::new(&model);
        let found = model.momentum_partials(&mut work, &q, &v).unwrap();
        let dual = model.cast::<Dual64>();
        let mut data = Data::new(&dual);
        let scale = 1.0 + found.q.iter().chain(found.v).fold(0.0, |m: f64, x| m.max(x.abs()));
        for k in 0..n {
            let mut step = vec![Dual64::from_re(0.0); n];
            step[k].eps = 1.0;
            let mut moved = duals(&q);
            dual.displace(&duals(&q), &step, &mut moved).unwrap();
            let centroidal = dual.centroidal(&mut data, &moved).unwrap();
            let momentum = centroidal.momentum(&duals(&v)).unwrap();
            let center = centroidal.center_of_mass;
            for i in 0..3 {
                assert!((center[i].eps - found.center_of_mass_q[(i, k)]).abs() < 1e-13, "seed {seed}");
                let exact = [momentum.linear[i].eps, momentum.angular[i].eps];
                for (row, exact) in [(i, exact[0]), (i + 3, exact[1])] {
                    let off = (found.q[(row, k)] - exact).abs() / scale;
                    assert!(off < 1e-12, "seed {seed}, row {row}, column {k}: {off:e}");
                }
            }
        }
        let mut data = Data::new(&model);
        let centroidal = model.centroidal(&mut data, &q).unwrap();
        assert_eq!(found.v, centroidal.matrix, "seed {seed}");
        assert_eq!(found.momentum, centroidal.momentum(&v).unwrap(), "seed {seed}");
    }
}

#[test]
fn second_derivatives_exist_by_dual_numbers_through_the_partials() {
    // ∂²τ/∂q_j∂q_k along q ⊕ ε e_j ⊕ δ e_k two ways: duals through the analytic partials, hyper-dual numbers.
    let Case { model, q, v, a, .. } = cases(5).last().unwrap();
    let n = model.n_velocities();
    let (dual, hyper) = (model.cast::<Dual64>(), model.cast::<HyperDual64>());
    let (mut work, mut data) = (DerivativeData::new(&dual), Data::new(&hyper));
    let lift = |x: &[f64]| x.iter().map(|&x| HyperDual64::from_re(x)).collect::<Vec<_>>();
    for j in 0..n {
        let mut step = vec![Dual64::from_re(0.0); n];
        step[j].eps = 1.0;
        let mut moved = duals(&q);
        dual.displace(&duals(&q), &step, &mut moved).unwrap();
        let p = dual.inverse_dynamics_partials(&mut work, &moved, &duals(&v), &duals(&a), &[]).unwrap();
        for k in 0..n {
            let (mut first, mut second) = (lift(&vec![0.0; n]), lift(&vec![0.0; n]));
            first[j].eps1 = 1.0;
            second[k].eps2 = 1.0;
            let (mut once, mut twice) = (lift(&q), lift(&q));
            hyper.displace(&lift(&q), &first, &mut once).unwrap();
            hyper.displace(&once, &second, &mut twice).unwrap();
            let torque = hyper.inverse_dynamics(&mut data, &twice, &lift(&v), &lift(&a), &[]).unwrap();
            for i in 0..n {
                let (found, exact) = (p.q[(i, k)].eps, torque[i].eps1eps2);
                assert!(
                    (found - exact).abs() < 1e-10 * (1.0 + exact.abs()),
                    "{i}, {j}, {k}: {found} {exact}"
                );
            }
        }
    }
}

#[test]
fn derivatives_refuse_bad_arguments() {
    let model = cases(3).last().unwrap().model;
    let n = model.n_velocities();
    let (q, v) = (model.neutral(), vec![0.0; n]);
    let mut work = DerivativeData::new(&model);
    let short = &v[1..];
    let length =
        |argument| DynamicsError::Argument(ArgumentError::Length { argument, expected: n, found: n - 1 });
    let split = Split::new(vec![true; n]);
    assert_eq!(model.inverse_dynamics_partials(&mut work, &q, &v, short, &[]).unwrap_err(), length("a"));
    assert_eq!(model.forward_dynamics_partials(&mut work, &q, &v, short, &[]).unwrap_err(), length("torque"));
    assert_eq!(
        model.hybrid_dynamics_partials(&mut work, &split, &q, &v, short, &[]).unwrap_err(),
        length("known")
    );
    assert_eq!(model.momentum_partials(&mut work, &q, short).unwrap_err(), length("v"));
    let mut foreign = DerivativeData::new(&cases(1).last().unwrap().model);
    let refused = model.hybrid_dynamics_partials(&mut foreign, &split, &q, &v, &v, &[]);
    assert_eq!(refused.unwrap_err(), DynamicsError::ForeignData);

    // Two point masses on coincident hinges: the outer one meets no inertia along its own axis.
    let hinge = Joint::Revolute { axis: Vector3::z() };
    let mut builder = ModelBuilder::new();
    let point = MassProperties::point(1.0, Vector3::z());
    builder.add(Link::root("inner", hinge, point)).unwrap();
    builder.add(Link::child("outer", "inner", hinge, point)).unwrap();
    let model = builder.build().unwrap();
    let mut work = DerivativeData::new(&model);
    let refused = model.forward_dynamics_partials(&mut work, &[0.0; 2], &[0.0; 2], &[0.0; 2], &[]);
    assert_eq!(refused.unwrap_err(), DynamicsError::Singular { joint: "outer".into() });
}

#[test]
fn a_workspace_of_partials_carries_nothing_over() {
    let Case { model, q, v, a, wrenches, mut random } = cases(12).last().unwrap();
    let split = Split::new((0..a.len()).map(|_| random.below(2) == 1).collect());
    let mut fresh = DerivativeData::new(&model);
    let p = model.hybrid_dynamics_partials(&mut fresh, &split, &q, &v, &a, &wrenches).unwrap();
    let first = (p.value.to_vec(), p.q.clone(), p.v.clone(), p.input.clone());
    let mut work = DerivativeData::new(&model);
    let other = Random::new(1).numbers(a.len(), 1.0);
    model.forward_dynamics_partials(&mut work, &model.neutral(), &other, &other, &[]).unwrap();
    model.momentum_partials(&mut work, &q, &other).unwrap();
    let p = model.hybrid_dynamics_partials(&mut work, &split, &q, &v, &a, &wrenches).unwrap();
    assert_eq!(first, (p.value.to_vec(), p.q.clone(), p.v.clone(), p.input.clone()));
}
