//! The pose of the root that lays a model of given shape over markers.
//!
//! For the sums of squares s² Σ‖d − d̄‖² and Σ‖y − ȳ‖² the scale is taken that makes them equal, and the rotation that
//! makes Σ y·(R d) largest: by singular values in space, by one arctangent in a plane.
//!
//! Source: S. Umeyama, *Least-squares estimation of transformation parameters between two point patterns*, IEEE Trans.
//! Pattern Anal. Mach. Intell. 13 (1991), 376–380. His scale shrinks a model whose posture differs; that of the
//! spreads does not.

use super::Estimate;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use somersault_core::lie::so3;
use somersault_multibody::{Group, Model, Turning};

/// Moves the root of `estimate`, and its scale within `bounds`. `pairs` are d, from the root in the axes of the world, and y;
/// `root` is where the root's origin is now. Roots that neither float nor move in a plane stay.
pub(super) fn align(
    model: &Model,
    estimate: &mut Estimate,
    root: &Vector3<f64>,
    pairs: &[(Vector3<f64>, Vector3<f64>)],
    bounds: [f64; 2],
) {
    let (Some(joint), Some(placement)) = (model.joint(0), model.placement(0)) else { return };
    let floats = match joint.group() {
        Group::Motions | Group::PlanarMotions => true,
        Group::Vector | Group::Rotations => false,
    };
    if !floats || pairs.is_empty() {
        return;
    }
    let n = pairs.len() as f64;
    let mean =
        pairs.iter().fold((Vector3::zeros(), Vector3::zeros()), |(a, b), (d, y)| (a + d / n, b + y / n));
    let centred = || pairs.iter().map(|(d, y)| (d - mean.0, y - mean.1));
    let spread = centred().fold((0.0, 0.0), |(a, b), (d, y)| (a + d.norm_squared(), b + y.norm_squared()));
    let scale = (spread.1 / spread.0).sqrt();
    if scale.is_finite() && scale > 0.0 {
        estimate.scale = scale.clamp(bounds[0], bounds[1]);
    }
    let covariance: Matrix3<f64> = centred().map(|(d, y)| y * d.transpose()).sum();
    let axes = placement.rotation;
    let kind = joint.kind();
    let turn = match kind.turning {
        Turning::None => return,
        Turning::Angle => {
            // in the axes of the plane
            let flat = axes.transpose() * covariance * axes;
            let angle = (flat[(1, 0)] - flat[(0, 1)]).atan2(flat[(0, 0)] + flat[(1, 1)]);
            estimate.q[kind.n_linear] += angle;
            Rotation3::from_axis_angle(&nalgebra::Unit::new_unchecked(axes.column(2).into_owned()), angle)
        }
        Turning::Rotation => {
            let Some(turn) = nearest_rotation(&covariance) else { return };
            let relative = Rotation3::from_matrix_unchecked(axes.transpose() * turn.matrix() * axes);
            let q = &mut estimate.q[kind.orientation()];
            let old = so3::from_xyzw(q);
            let new = UnitQuaternion::from_rotation_matrix(&relative) * old;
            q.copy_from_slice(new.coords.as_slice());
            turn
        }
    };
    let target = mean.1 - turn * mean.0 * estimate.scale;
    let moved = axes.transpose() * (target - root);
    for k in 0..kind.n_linear {
        estimate.q[k] += moved[k];
    }
}

/// The rotation R with the largest trace of Rᵀ M.
fn nearest_rotation(m: &Matrix3<f64>) -> Option<Rotation3<f64>> {
    let svd = m.try_svd(true, true, f64::EPSILON, 100)?;
    let (mut u, v_t) = (svd.u?, svd.v_t?);
    if (u.determinant() * v_t.determinant()) < 0.0 {
        // the axis of the least singular value, which comes last
        u.column_mut(2).neg_mut();
    }
    Some(Rotation3::from_matrix_unchecked(u * v_t))
}
