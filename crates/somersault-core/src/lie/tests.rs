//! What holds for all the groups, over grids of angles next to zero, to the bounds of the series and to a half turn.

use super::{se2, se3, so2, so3};
use crate::random::SplitMix64;
use nalgebra::{Isometry2, Isometry3, Matrix3, Matrix4, Matrix6, Vector2, Vector3, Vector6};
use num_dual::{Dual64, HyperDual64};
use std::f64::consts::PI;

const ANGLES: [f64; 17] = [
    0.0,
    1e-170,
    1e-12,
    1e-5,
    1e-3,
    0.1,
    0.2499,
    0.2501,
    0.4,
    0.999,
    1.001,
    2.0,
    2.449,
    2.4496,
    3.0,
    PI - 1e-6,
    PI * (1.0 - 1e-14),
];

/// Displacements (ρ, u) of all these angles.
fn displacements() -> impl Iterator<Item = [Vector3<f64>; 2]> {
    let mut random = SplitMix64::new(20);
    ANGLES.into_iter().flat_map(move |angle| {
        [0; 8].map(|_| {
            let mut vector = || Vector3::from_fn(|_, _| 2.0 * random.unit() - 1.0);
            [vector(), vector().normalize() * angle]
        })
    })
}

fn six([rho, u]: &[Vector3<f64>; 2]) -> Vector6<f64> {
    Vector6::new(rho.x, rho.y, rho.z, u.x, u.y, u.z)
}

fn dual(x: &Vector3<f64>, along: &Vector3<f64>) -> Vector3<Dual64> {
    x.zip_map(along, Dual64::new)
}

fn pair(d: &Vector6<f64>) -> [Vector3<f64>; 2] {
    [d.fixed_rows::<3>(0).into(), d.fixed_rows::<3>(3).into()]
}

fn difference(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    (a.to_homogeneous() - b.to_homogeneous()).amax()
}

#[test]
fn logarithms_invert_exponentials() {
    for d in displacements() {
        let [rho, u] = se3::log(&se3::exp(&d[0], &d[1]));
        // The linear part is divided by cos(θ/2)-like factors next to a half turn, where u has two signs.
        assert!((u - d[1]).norm() <= 1e-15 * (1.0 + d[1].norm()), "{d:?}: {u}");
        assert!((rho - d[0]).norm() < 2e-14, "{d:?}: {rho}");
        let (rho, angle) = (d[0].xy(), d[1].norm());
        let (found, turned) = se2::log(&se2::exp(&rho, angle));
        assert!((turned - angle).abs() <= 1e-15 && (found - rho).norm() < 2e-14, "{d:?}");
        assert!(
            (se2::linear_part(&se2::translation(&rho, angle + PI), angle + PI) - rho).norm() < 1e-13
                || angle > 3.0
        );
    }
}

#[test]
fn exponentials_are_those_of_matrices() {
    for [rho, u] in displacements() {
        let mut generator = Matrix4::zeros();
        generator.fixed_view_mut::<3, 3>(0, 0).copy_from(&so3::hat(&u));
        generator.fixed_view_mut::<3, 1>(0, 3).copy_from(&rho);
        let (mut term, mut sum) = (Matrix4::<f64>::identity(), Matrix4::identity());
        for k in 1..60 {
            term = term * generator / f64::from(k);
            sum += term;
        }
        assert!((se3::exp(&rho, &u).to_homogeneous() - sum).amax() < 2e-14, "{rho} {u}");
    }
}

#[test]
fn the_plane_is_part_of_space() {
    let lift = |m: &Isometry2<f64>| {
        let turn = so3::exp(&(Vector3::z() * so2::log(&m.rotation)));
        Isometry3::from_parts(m.translation.vector.push(0.0).into(), turn)
    };
    for d in displacements() {
        let (rho, angle) = (d[0].xy(), d[1].norm());
        let space = [rho.push(0.0), Vector3::z() * angle];
        assert!(difference(&lift(&se2::exp(&rho, angle)), &se3::exp(&space[0], &space[1])) < 1e-15);
        let plane = |m: Matrix6<f64>| m.select_rows(&[0, 1, 5]).select_columns(&[0, 1, 5]);
        for (own, of_space) in [
            (se2::left_jacobian(&rho, angle), se3::left_jacobian(&space[0], &space[1])),
            (se2::right_jacobian(&rho, angle), se3::right_jacobian(&space[0], &space[1])),
            (se2::left_jacobian_inverse(&rho, angle), se3::left_jacobian_inverse(&space[0], &space[1])),
            (se2::right_jacobian_inverse(&rho, angle), se3::right_jacobian_inverse(&space[0], &space[1])),
        ] {
            assert!((own - plane(of_space)).amax() < 2e-15, "{rho} {angle}");
        }
    }
}

/// J_l = Σ adᵏ/(k + 1)!, whatever the group.
#[test]
fn jacobians_are_the_series_of_the_bracket() {
    for [rho, u] in displacements() {
        let ad = se3::bracket(&rho, &u);
        let (mut term, mut sum) = (Matrix6::<f64>::identity(), Matrix6::identity());
        for k in 1..60 {
            term = term * ad / f64::from(k + 1);
            sum += term;
        }
        let left = se3::left_jacobian(&rho, &u);
        assert!((left - sum).amax() < 2e-14, "{rho} {u}: {left} {sum}");
        assert!((left * se3::left_jacobian_inverse(&rho, &u) - Matrix6::identity()).amax() < 1e-13);
        // exp(ad) = Ad(exp), J_r = Ad(exp)⁻¹ J_l
        let adjoint = se3::adjoint(&se3::exp(&rho, &u));
        assert!((adjoint - (Matrix6::identity() + ad * left)).amax() < 2e-14);
        let right = se3::right_jacobian(&rho, &u);
        assert!((adjoint * right - left).amax() < 2e-14);
        assert!((right * se3::right_jacobian_inverse(&rho, &u) - Matrix6::identity()).amax() < 1e-13);
        let of_rotation = [so3::left_jacobian(&u), so3::right_jacobian(&u)];
        for (whole, own) in [left, right].iter().zip(of_rotation) {
            assert!((whole.fixed_view::<3, 3>(3, 3) - own).amax() < 1e-15);
        }
        let inverses = [so3::left_jacobian_inverse(&u), so3::right_jacobian_inverse(&u)];
        for (own, inverse) in of_rotation.iter().zip(inverses) {
            assert!((own * inverse - Matrix3::identity()).amax() < 1e-14);
        }
        assert!((so3::left_jacobian(&u) * rho - so3::dexp(&u, &rho)).norm() < 1e-15);
        assert!((so3::left_jacobian_inverse(&u) * rho - so3::dexp_inv(&u, &rho)).norm() < 1e-15);
    }
}

/// A displacement changed along δ moves exp by J δ: the derivative that dual numbers carry.
#[test]
fn jacobians_are_the_derivatives_that_dual_numbers_carry() {
    let along = Vector6::new(0.2, -0.5, 0.3, 0.7, -0.1, 0.4);
    for d in displacements() {
        let [by_rho, by_u] = pair(&along);
        let moving = se3::exp(&dual(&d[0], &by_rho), &dual(&d[1], &by_u));
        // Ṙ = R hat(ω), ṗ = R v
        let r = moving.rotation.to_rotation_matrix().into_inner();
        let (still, rate) = (r.map(|x| x.re), r.map(|x| x.eps));
        let velocity = still.tr_mul(&moving.translation.vector.map(|x| x.eps));
        let found = six(&[velocity, so3::vee(&(still.tr_mul(&rate)))]);
        let expected = se3::right_jacobian(&d[0], &d[1]) * along;
        assert!((found - expected).norm() < 1e-14, "{d:?}: {found} {expected}");
        // and back through the logarithm, which is singular where u and −u meet
        if d[1].norm() < 3.1 {
            let [rho, u] = se3::log(&moving);
            let back = six(&[rho.map(|x| x.eps), u.map(|x| x.eps)]);
            assert!((back - along).norm() < 1e-13, "{d:?}: {back}");
        }
    }
}

#[test]
fn partials_of_both_differentials_are_those_of_dual_numbers() {
    let v = Vector3::new(-0.4, 0.7, 0.2);
    let still = v.map(Dual64::from_re);
    for [delta, u] in displacements() {
        let moving = dual(&u, &delta);
        let by_dexp = so3::dexp(&moving, &still).map(|x| x.eps);
        assert!((by_dexp - so3::dexp_partials(&u, &v) * delta).norm() < 2e-15, "{u} {delta}");
        let by_inverse = so3::dexp_inv(&moving, &still).map(|x| x.eps);
        assert!((by_inverse - so3::dexp_inv_partials(&u, &v) * delta).norm() < 2e-14, "{u} {delta}");
    }
}

/// The second derivatives of log(exp(u)) vanish, those of what is between do not.
#[test]
fn hyper_dual_numbers_go_through_and_back() {
    let (a, b) = (Vector3::new(0.3, -0.8, 0.5), Vector3::new(-0.6, 0.1, 0.9));
    for [rho, u] in displacements() {
        if u.norm() > 3.1 {
            continue;
        }
        let hyper = |x: &Vector3<f64>| Vector3::from_fn(|i, _| HyperDual64::new(x[i], a[i], b[i], 0.0));
        let [linear, angular] = se3::log(&se3::exp(&hyper(&rho), &hyper(&u)));
        for (found, x) in [(linear, rho), (angular, u)] {
            for i in 0..3 {
                assert!((found[i].re - x[i]).abs() < 1e-13 && (found[i].eps1 - a[i]).abs() < 1e-13);
                assert!(
                    (found[i].eps2 - b[i]).abs() < 1e-13 && found[i].eps1eps2.abs() < 1e-12,
                    "{rho} {u}: {found}"
                );
            }
        }
    }
}

/// By mpmath with 60 digits: Σ adᵏ/(k + 1)! times a vector, its inverse times the vector, and the quaternion.
#[test]
fn golden_digits() {
    let axis = Vector3::new(2.0, -3.0, 6.0) / 7.0;
    let rho = Vector3::new(0.4, 1.1, -0.7);
    let vector = Vector6::new(0.2, -0.5, 0.3, 0.7, -0.1, 0.4);
    let golden = [
        (
            0.001,
            [
                0.38540711240662334,
                -0.8248736981309013,
                -0.10498491908830972,
                0.6999570540852085,
                -0.09975716804744772,
                0.4001357312812066,
            ],
            [
                0.014978567350497745,
                -0.17500116768597848,
                0.7050503698980511,
                0.7000428127551013,
                -0.10024286972789137,
                0.3998642942176872,
            ],
            [0.9999998750000026, 0.00014285713690476197, -0.00021428570535714296, 0.0004285714107142859],
        ),
        (
            0.9,
            [
                0.7036551733605363,
                -0.6321043253129732,
                -0.027164814404044578,
                0.5949114332883018,
                0.08463269583677013,
                0.5273458701556178,
            ],
            [
                -0.0049709950750518,
                -0.15653757266264512,
                0.7608595468976934,
                0.7021224124180151,
                -0.32890563238504006,
                0.2848397130014749,
            ],
            [0.9004471023526769, 0.12427586688892292, -0.18641380033338437, 0.37282760066676873],
        ),
        (
            3.13,
            [
                0.7152439684889308,
                -0.003898944737218283,
                0.4698099124784756,
                0.11455202253875839,
                0.05988905585572305,
                0.6750938537482754,
            ],
            [
                0.060081098198870767,
                0.1413097190078725,
                1.0145640394987745,
                0.30632167987687237,
                -1.0097933058696114,
                0.07632945377290348,
            ],
            [0.005796294338028666, 0.285709486098536, -0.428564229147804, 0.857128458295608],
        ),
    ];
    for (angle, jacobian, inverse, quaternion) in golden {
        let u = axis * angle;
        let near = |found: Vector6<f64>, expected: [f64; 6]| (found - Vector6::from(expected)).norm() < 2e-15;
        assert!(near(se3::left_jacobian(&rho, &u) * vector, jacobian), "{angle}");
        assert!(near(se3::left_jacobian_inverse(&rho, &u) * vector, inverse), "{angle}");
        assert!(near(se3::right_jacobian(&-rho, &-u) * vector, jacobian), "{angle}");
        let q = so3::exp(&u);
        let [w, x, y, z] = quaternion;
        assert!((q.w - w).abs() < 2e-16 && (q.imag() - Vector3::new(x, y, z)).norm() < 2e-16, "{angle}");
        assert!((so3::from_xyzw(&[x, y, z, w]).coords - q.coords).norm() < 4e-16);
        assert!(
            (se2::translation(&Vector2::new(1.0, 0.0), angle)
                - Vector2::new(angle.sin(), 1.0 - angle.cos()) / angle)
                .norm()
                < 1e-13
        );
    }
}
