//! Exponents and vectors against linear systems, extended precision and the literature; splittings and subspaces.

use crate::common::{Linear, Random, START, arm_nodes};
use nalgebra::{DMatrix, DVector, dmatrix, dvector};
use somersault_ftla::flow::{FlowError, FlowTolerances, VariationalFlow};
use somersault_ftla::placement::rank_held_costates;
use somersault_ftla::spectrum::{
    Spectrum, SpectrumError, Splitting, SplittingDims, Subspace, TimeDirection, diagnose, spectra, spectrum,
};
use somersault_ftla::system::{ArmMinimumTorque, LinearRegulator, VectorField};
use std::f64::consts::{FRAC_PI_2, SQRT_2};

const TIGHT: FlowTolerances = FlowTolerances { relative: 1e-14, absolute: 1e-16 };
const ARM_DIMS: SplittingDims = SplittingDims { stable: 2, center: 4, unstable: 2 };

/// Orthogonal, from a fixed seed.
fn rotation(n: usize, seed: u64) -> DMatrix<f64> {
    let mut random = Random::new(seed);
    let columns: Vec<_> = (0..n).map(|_| DVector::from_fn(n, |_, _| random.unit())).collect();
    let basis: Vec<_> = Subspace::spanned_by(n, &columns).basis().collect();
    DMatrix::from_columns(&basis)
}

#[test]
fn symmetric_linear_fields_have_their_eigenvalues_whatever_their_spread() {
    // singular values span e^500 at the last time
    let rates = dvector![-30.0, -1.0, 0.5, 20.0];
    let q = rotation(4, 4);
    let system = Linear(&q * DMatrix::from_diagonal(&rates) * q.transpose());
    let flow = VariationalFlow::try_new(&system, TIGHT).expect("in range");
    let origin = DVector::zeros(4);
    for (direction, sign) in [(TimeDirection::Forward, 1.0), (TimeDirection::Backward, -1.0)] {
        for s in spectra(&flow, &origin, direction, &[0.1, 1.0, 10.0]).expect("linear") {
            for i in 0..4 {
                assert!(
                    (s.exponents[i] - sign * rates[i]).abs() < 1e-11 * 30.0,
                    "{direction:?} {}: {i}",
                    s.time
                );
                assert!(
                    (s.vectors.column(i).dot(&q.column(i)).abs() - 1.0).abs() < 1e-12,
                    "{direction:?} {i}"
                );
            }
        }
    }
    let flow = VariationalFlow::try_new(&LinearRegulator, TIGHT).expect("in range");
    let s = spectrum(&flow, &DVector::zeros(2), TimeDirection::Forward, 40.0).expect("linear");
    assert!((s.exponents[1] - SQRT_2).abs() < 1e-12 && (s.exponents[0] + SQRT_2).abs() < 1e-12);
}

#[test]
fn vectors_and_exponents_are_covariant_under_rotations() {
    let mut random = Random::new(9);
    let a = DMatrix::from_fn(4, 4, |_, _| 3.0 * random.unit());
    let q = rotation(4, 10);
    let (plain, turned) = (Linear(a.clone()), Linear(&q * a * q.transpose()));
    let origin = DVector::zeros(4);
    for direction in [TimeDirection::Forward, TimeDirection::Backward] {
        let of = |system: &Linear| {
            let flow = VariationalFlow::try_new(system, TIGHT).expect("in range");
            spectrum(&flow, &origin, direction, 2.5).expect("linear")
        };
        let (one, two) = (of(&plain), of(&turned));
        assert!((&one.exponents - &two.exponents).amax() < 1e-11);
        for i in 0..4 {
            let overlap = (&q * one.vectors.column(i)).dot(&two.vectors.column(i));
            assert!((overlap.abs() - 1.0).abs() < 1e-10, "{direction:?} {i}: {overlap}");
        }
    }
}

/// tests/reference/exponents.py, 60 digits.
const REFERENCE: [(f64, [f64; 4]); 4] = [
    (1.0, [0.386835296802606, 0.562286173201768, 5.40164844816846, 8.14916237220599]),
    (2.0, [0.394746429866988, 0.520276312392858, 4.14612466842201, 4.4682202552221]),
    (3.5, [0.362443777472533, 0.461019426201522, 2.93710197024761, 3.61274932616804]),
    (5.0, [0.293676890574938, 0.428228058800708, 2.71509930623798, 3.27130256991292]),
];

#[test]
fn all_eight_exponents_of_the_arm_are_right_to_1e_8_at_five_seconds() {
    let arm = ArmMinimumTorque::default();
    let flow = VariationalFlow::try_new(&arm, TIGHT).expect("in range");
    let times = REFERENCE.map(|(t, _)| t);
    let found =
        spectra(&flow, &DVector::from_row_slice(&START), TimeDirection::Forward, &times).expect("regular");
    for (s, (t, positive)) in found.iter().zip(REFERENCE) {
        for (i, reference) in positive.into_iter().enumerate() {
            assert!((s.exponents[4 + i] - reference).abs() < 1e-10, "{t}, {i}: {}", s.exponents[4 + i]);
            assert!((s.exponents[3 - i] + reference).abs() < 1e-10, "{t}, −{i}: {}", s.exponents[3 - i]);
        }
        assert!(s.pairing_defect() < 1e-10, "{t}: {:e}", s.pairing_defect());
    }
    // what a plain decomposition makes of the same matrix
    let phi = flow.transition(&DVector::from_row_slice(&START), 5.0).expect("regular").matrix;
    let plain = phi.singular_values()[7].ln() / 5.0;
    assert!((plain + REFERENCE[3].1[3]).abs() > 1e-8, "{plain}");
}

#[test]
fn all_eight_exponents_are_those_of_extended_precision_at_both_ends_and_the_middle() {
    let arm = ArmMinimumTorque::default();
    let flow = VariationalFlow::try_new(&arm, TIGHT).expect("in range");
    let nodes = arm_nodes();
    // the literals of another program in 60 digits
    for (found, literal) in
        crate::extended::exponents(&DVector::from_row_slice(&START), 5.0)[4..].iter().zip(REFERENCE[3].1)
    {
        assert!((found - literal).abs() < 1e-13, "{found} {literal}");
    }
    let panels = [
        (nodes[0].1.clone(), 1.0),
        (nodes[20].1.clone(), 1.0),
        (nodes[20].1.clone(), -1.0),
        (nodes[40].1.clone(), -1.0),
    ];
    for (p, sign) in panels {
        let direction = if sign > 0.0 { TimeDirection::Forward } else { TimeDirection::Backward };
        for mut s in spectra(&flow, &p, direction, &[1.0, 2.5, 5.0]).expect("regular") {
            s.exponents.as_mut_slice().sort_by(f64::total_cmp);
            for (found, expected) in s.exponents.iter().zip(crate::extended::exponents(&p, sign * s.time)) {
                assert!((found - expected).abs() < 1e-8, "{direction:?} {}: {found}, {expected}", s.time);
            }
        }
    }
}

/// The same script with the nodes of tests/reference/arm_nodes.txt, over ten seconds.
const ALONG_NODES: [f64; 4] = [0.170930667245478, 0.366193707870553, 2.44973248446746, 2.6598381683833];

#[test]
fn all_eight_exponents_along_the_nodes_of_a_motion_are_right_to_1e_8_at_ten_seconds() {
    let arm = ArmMinimumTorque::default();
    let flow = VariationalFlow::try_new(&arm, TIGHT).expect("in range");
    let nodes = arm_nodes();
    let segments = nodes.windows(2).map(|pair| flow.transition(&pair[0].1, pair[1].0 - pair[0].0));
    let links = segments.collect::<Result<Vec<_>, FlowError>>().expect("regular");
    let s = Spectrum::of_factors(&links);
    for (i, reference) in ALONG_NODES.into_iter().enumerate() {
        assert!((s.exponents[4 + i] - reference).abs() < 1e-10, "{i}: {}", s.exponents[4 + i]);
        assert!((s.exponents[3 - i] + reference).abs() < 1e-10, "−{i}: {}", s.exponents[3 - i]);
    }
    assert!(s.exponents[7] - s.exponents[0] > 53.0 / 10.0, "σ₁/σ₈ is above 1e23");
}

#[test]
fn the_arm_splits_into_two_four_and_two_with_gaps_above_two() {
    let arm = ArmMinimumTorque::default();
    let flow = VariationalFlow::try_new(&arm, TIGHT).expect("in range");
    let nodes = arm_nodes();
    let times: Vec<f64> = (1..=20).map(|k| 0.25 * k as f64).collect();
    // the four panels of Figure 10.1
    let (start, middle, end) = (nodes[0].1.clone(), nodes[20].1.clone(), nodes[40].1.clone());
    let panels = [
        (start, TimeDirection::Forward),
        (middle.clone(), TimeDirection::Forward),
        (middle, TimeDirection::Backward),
        (end, TimeDirection::Backward),
    ];
    for (p, direction) in panels {
        let found = spectra(&flow, &p, direction, &times).expect("regular");
        let diagnosis = diagnose(&found, 10.0).expect("not empty");
        assert_eq!(diagnosis.dims, ARM_DIMS, "{direction:?}: {diagnosis}");
        assert!(diagnosis.is_partially_hyper_sensitive());
        assert!(
            diagnosis.to_string().starts_with("partially hyper-sensitive: 2 stable, 4 centre and 2 unstable")
        );
        for s in found.iter().filter(|s| (0.75..=4.25).contains(&s.time)) {
            let rates = s.rates();
            let sorted = {
                let mut r: Vec<f64> = rates.iter().copied().collect();
                r.sort_by(f64::total_cmp);
                r[6] - r[5]
            };
            assert!(sorted > 2.0, "{direction:?} {}: {sorted}", s.time);
            assert!(s.pairing_defect() < 1e-9);
        }
    }
}

#[test]
fn subspaces_of_the_arm_contain_the_field_and_leave_costates_one_and_three_free() {
    let arm = ArmMinimumTorque::default();
    let flow = VariationalFlow::try_new(&arm, TIGHT).expect("in range");
    let middle = arm_nodes()[20].1.clone();
    let [forward, backward] = [TimeDirection::Forward, TimeDirection::Backward]
        .map(|direction| spectrum(&flow, &middle, direction, 3.5).expect("regular"));
    let splitting = Splitting::try_new(ARM_DIMS, forward, backward).expect("they add up");
    let h = arm.field(middle.as_slice());
    assert_eq!(splitting.stable().dim(), 2);
    assert_eq!(splitting.unstable().dim(), 2);
    assert_eq!(splitting.center().dim(), 4);
    assert!(splitting.center().angle_to(&h) < 2e-2, "{}", splitting.center().angle_to(&h));
    // the centre is in both, the fast subspaces are apart from it
    for larger in [splitting.center_stable(), splitting.center_unstable()] {
        assert!(splitting.center().angles(&larger).iter().all(|a| *a < 1e-12));
    }
    assert!(splitting.stable().angles(&splitting.unstable())[0] > 1e-3);
    // at the start, λ₁ and λ₃ are the costates to hold: (10.1)
    let start =
        spectrum(&flow, &DVector::from_row_slice(&START), TimeDirection::Forward, 3.5).expect("regular");
    let slow: Vec<_> = (0..6).map(|j| start.vectors.column(j).into_owned()).collect();
    let ranked = rank_held_costates(&Subspace::spanned_by(8, &slow)).expect("few choices");
    println!("{ranked:?}");
    assert_eq!(ranked.len(), 6);
    assert_eq!(ranked[0].0, vec![0, 2], "{ranked:?}");
}

#[test]
fn subspaces_know_their_angles_complements_and_intersections() {
    let e = |i: usize| DVector::from_fn(4, |j, _| if i == j { 1.0 } else { 0.0 });
    let small = 1e-9f64;
    let a = Subspace::spanned_by(4, &[e(0), e(1), e(0) + e(1)]);
    assert_eq!(a.dim(), 2);
    let b = Subspace::spanned_by(4, &[e(0) * small.cos() + e(2) * small.sin(), e(1) * 0.6 + e(3) * 0.8]);
    let angles = a.angles(&b);
    assert!((angles[0] - 1e-9).abs() < 1e-15 && (angles[1] - 0.8f64.asin()).abs() < 1e-14, "{angles:?}");
    assert!((a.angle_to(&(e(1) + e(2))) - FRAC_PI_2 / 2.0).abs() < 1e-15);
    let both = a.complement();
    assert!(both.dim() == 2 && both.angles(&a).iter().all(|x| (x - FRAC_PI_2).abs() < 1e-15));
    let c = Subspace::spanned_by(4, &[e(1), e(2), e(3)]);
    let common = a.intersection(&c);
    assert!(common.dim() == 1 && common.angle_to(&e(1)) < 1e-15);
    assert_eq!(Subspace::spanned_by(4, &[]).angles(&a), Vec::<f64>::new());
    assert_eq!(Subspace::spanned_by(4, &[]).complement().dim(), 4);
}

/// ẋ = 10(y − x), ẏ = x(28 − z) − y, ż = xy − 8z/3.
struct Lorenz;

impl VectorField for Lorenz {
    #[inline(always)]
    fn dimension(&self) -> usize {
        3
    }

    fn field_into(&self, p: &[f64], h: &mut [f64]) {
        let [x, y, z] = [p[0], p[1], p[2]];
        h.copy_from_slice(&[10.0 * (y - x), x * (28.0 - z) - y, x * y - 8.0 / 3.0 * z]);
    }

    fn jacobian_into(&self, p: &[f64], d: &mut DMatrix<f64>) {
        let [x, y, z] = [p[0], p[1], p[2]];
        d.copy_from(&dmatrix![-10.0, 10.0, 0.0; 28.0 - z, -1.0, -x; y, x, -8.0 / 3.0]);
    }

    fn conserved(&self, _: &[f64]) -> Option<f64> {
        None
    }
}

#[test]
fn lorenz_exponents_are_those_of_the_literature() {
    // Sprott, Chaos and Time-Series Analysis (2003): 0.9056, 0, −14.5723; over 1000 units within about 0.02
    let flow = VariationalFlow::try_new(&Lorenz, FlowTolerances { relative: 1e-10, absolute: 1e-12 })
        .expect("in range");
    let p = flow.state(&dvector![1.0, 1.0, 20.0], 50.0).expect("bounded");
    let s = spectrum(&flow, &p, TimeDirection::Forward, 1000.0).expect("bounded");
    assert!((s.exponents[2] - 0.9056).abs() < 0.02, "{}", s.exponents);
    assert!(s.exponents[1].abs() < 0.01 && (s.exponents[0] + 14.5723).abs() < 0.02, "{}", s.exponents);
    // the trace of the Jacobian is constant
    assert!((s.exponents.sum() + 10.0 + 1.0 + 8.0 / 3.0).abs() < 1e-9, "{}", s.exponents.sum());
}

/// H = ½(p_x² + p_y² + x² + y²) + x²y − y³/3.
struct HenonHeiles;

impl VectorField for HenonHeiles {
    #[inline(always)]
    fn dimension(&self) -> usize {
        4
    }

    fn field_into(&self, p: &[f64], h: &mut [f64]) {
        let [x, y] = [p[0], p[1]];
        h.copy_from_slice(&[p[2], p[3], -x - 2.0 * x * y, -y - x * x + y * y]);
    }

    fn jacobian_into(&self, p: &[f64], d: &mut DMatrix<f64>) {
        let (x, y) = (2.0 * p[0], 2.0 * p[1]);
        let rows = [[0., 0., 1., 0.], [0., 0., 0., 1.], [-1. - y, -x, 0., 0.], [-x, -1. + y, 0., 0.]];
        (0..4).for_each(|i| (0..4).for_each(|j| d[(i, j)] = rows[i][j]));
    }

    fn conserved(&self, p: &[f64]) -> Option<f64> {
        let square: f64 = p.iter().map(|x| x * x).sum();
        Some(0.5 * square + p[0] * p[0] * p[1] - p[1].powi(3) / 3.0)
    }
}

#[test]
fn henon_heiles_is_chaotic_where_the_literature_says_so_and_its_exponents_pair() {
    // Skokos, Lect. Notes Phys. 790 (2010): at H = 1/8 the orbit from (0, −0.25, 0.42, 0) is chaotic with a largest exponent
    // near 0.047, that from (0, 0.55, 0.2417, 0) regular, whose exponent goes down with ln t / t
    let flow = VariationalFlow::try_new(&HenonHeiles, FlowTolerances { relative: 1e-11, absolute: 1e-13 });
    let flow = flow.expect("in range").with_max_steps(1_000_000);
    let of = |p: DVector<f64>| spectrum(&flow, &p, TimeDirection::Forward, 20_000.0).expect("bounded");
    // rounding decides how long one orbit stays near the regular ones, over 20 000 units a quarter of the exponent
    let chaotic: Vec<_> =
        (0..16).map(|k| of(dvector![0.0, -0.25 + 1e-9 * f64::from(k), 0.42, 0.0])).collect();
    let mean = chaotic.iter().map(|s| s.exponents[3]).sum::<f64>() / 16.0;
    let r = of(dvector![0.0, 0.55, 0.2417, 0.0]);
    println!("{mean} {}", r.exponents);
    assert!((0.037..0.057).contains(&mean), "{mean}");
    assert!(r.exponents[3] < 0.001, "{}", r.exponents);
    for s in chaotic.iter().chain([&r]) {
        assert!(s.pairing_defect() < 1e-7, "{:e}", s.pairing_defect());
    }
}

#[test]
fn misuse_is_a_typed_error() {
    let flow = VariationalFlow::try_new(&LinearRegulator, TIGHT).expect("in range");
    let origin = DVector::zeros(2);
    assert!(spectrum(&flow, &origin, TimeDirection::Forward, 0.0).is_err());
    assert!(spectra(&flow, &origin, TimeDirection::Backward, &[1.0, -1.0]).is_err());
    assert!(spectra(&flow, &origin, TimeDirection::Forward, &[2.0, 1.0]).is_err());
    assert_eq!(diagnose(&[], 1.0).err(), Some(SpectrumError::Empty));
    let s = spectrum(&flow, &origin, TimeDirection::Forward, 1.0).expect("linear");
    let dims = SplittingDims { stable: 1, center: 1, unstable: 1 };
    assert!(matches!(
        Splitting::try_new(dims, s.clone(), s),
        Err(SpectrumError::Direction { argument: "backward" })
    ));
    assert!(matches!(dims.check(2), Err(SpectrumError::Dimensions { expected: 2, .. })));
}

#[test]
fn slow_problems_are_not_called_hyper_sensitive_and_fast_ones_completely_so() {
    let flow = VariationalFlow::try_new(&LinearRegulator, TIGHT).expect("in range");
    let found = spectra(&flow, &DVector::zeros(2), TimeDirection::Forward, &[1.0, 2.0, 4.0]).expect("linear");
    let long = diagnose(&found, 40.0).expect("not empty");
    assert_eq!(long.dims, SplittingDims { stable: 1, center: 0, unstable: 1 });
    assert!(long.is_hyper_sensitive() && !long.is_partially_hyper_sensitive());
    assert!(long.to_string().starts_with("completely hyper-sensitive: 1 stable"), "{long}");
    let short = diagnose(&found, 1.0).expect("not empty");
    assert!(!short.is_hyper_sensitive() && short.to_string().starts_with("not hyper-sensitive"));
}
