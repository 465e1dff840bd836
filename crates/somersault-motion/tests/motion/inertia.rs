//! The inertia of a free body from attitudes: the truth, what is not determined, and what is not allowed.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use somersault_core::Inertia;
use somersault_core::cancel::CancellationToken;
use somersault_core::lie::so3;
use somersault_core::random::SplitMix64;
use somersault_integrators::body::RigidBody;
use somersault_integrators::exact::FreeBody;
use somersault_integrators::state::RigidBodyState;
use somersault_motion::inertia::{
    InertiaEstimate, InertiaEstimateError, InertiaOptions, InertiaStatus, estimate_inertia,
    estimate_inertia_cancellable,
};
use somersault_motion::nalgebra;

/// A record of a free body in axes of no kind.
struct Tumble {
    tensor: Matrix3<f64>,
    free: FreeBody,
    times: Vec<f64>,
    seen: Vec<UnitQuaternion<f64>>,
}

/// Attitudes that err by at most √3 times the `noise` about each axis, evenly distributed.
fn tumble(moments: [f64; 3], spin: [f64; 3], noise: f64) -> Tumble {
    let axes = so3::exp(&Vector3::new(0.4, -1.1, 0.7));
    let inertia = Inertia::try_principal(moments.into()).unwrap().rotated(&axes).unwrap();
    let body = RigidBody::try_new(1.0, inertia).unwrap();
    let start = so3::exp(&Vector3::new(-0.3, 0.2, 1.5));
    let world = start * (axes * Vector3::from(spin));
    let state = RigidBodyState::new(Vector3::zeros(), start, Vector3::zeros(), world);
    let free = FreeBody::try_new(&body, &state).unwrap();
    let mut random = SplitMix64::new(7);
    let mut off = || 12f64.sqrt() * noise * (random.unit() - 0.5);
    let times: Vec<f64> = (0..80).map(|k| 0.3 * f64::from(k) + 0.1 * f64::from(k).sin()).collect();
    let attitude = |t: &f64| {
        let shaken = so3::exp(&Vector3::new(off(), off(), off()));
        free.at(*t).unwrap().orientation() * shaken
    };
    let seen = times.iter().map(attitude).collect();
    Tumble { tensor: *inertia.tensor() / moments[2], free, times, seen }
}

impl Tumble {
    fn estimate(&self) -> InertiaEstimate {
        estimate_inertia(&self.times, &self.seen, &InertiaOptions::default()).unwrap()
    }

    /// Angular velocity in the body at the first time, and the direction of the momentum.
    fn first(&self) -> (Vector3<f64>, Vector3<f64>) {
        let state = self.free.at(self.times[0]).unwrap();
        let rate = state.orientation().inverse() * state.angular_velocity();
        (rate, (state.orientation() * (self.tensor * rate)).normalize())
    }
}

#[test]
fn what_is_called_equal_is_equal_within_the_intervals() {
    let mut equal = 0;
    for k in 0..12 {
        let middle = 1.0 - 0.012 * f64::from(k);
        for (moments, noise) in [([0.3, middle, 1.0], 0.1), ([0.75 - 0.02 * f64::from(k), 0.75, 1.0], 0.03)] {
            let Tumble { times, seen, .. } = &tumble(moments, [0.4, 0.6, 0.3], noise);
            let found = estimate_inertia(times, seen, &InertiaOptions::default()).unwrap();
            if !found.success() {
                continue;
            }
            equal += usize::from(found.status == InertiaStatus::Symmetric);
            for (truth, [low, high]) in moments.into_iter().zip(found.ratio_intervals) {
                // three times the half width is some six standard deviations
                let beyond = (high - low).max(1e-3);
                assert!((low - beyond..=high + beyond).contains(&truth), "{moments:?} {noise}: {found:?}");
            }
        }
    }
    assert!(equal > 0, "none is called equal");
}

#[test]
fn exact_attitudes_give_the_inertia_to_rounding_and_noise_what_intervals_say() {
    let (moments, spin) = ([1.0, 2.0, 2.5], [0.3, 1.0, 0.4]);
    let exact = tumble(moments, spin, 0.0);
    let found = exact.estimate();
    assert!(found.success() && found.status == InertiaStatus::Identified);
    assert!((found.ratios - Vector3::new(0.4, 0.8, 1.0)).amax() < 1e-9);
    assert!((found.inertia - exact.tensor).amax() < 1e-9);
    let (rate, momentum) = exact.first();
    assert!((found.angular_velocity - rate).amax() < 1e-9);
    assert!((found.momentum_direction - momentum).amax() < 1e-9);
    let later = [found.motion.unwrap().at(50.0).unwrap(), exact.free.at(50.0).unwrap()];
    assert!(so3::angle_between(later[0].orientation(), later[1].orientation()) < 1e-7);

    let found = tumble(moments, spin, 0.01).estimate();
    assert_eq!(found.status, InertiaStatus::Identified, "{}", found.reason);
    for (interval, truth) in found.ratio_intervals.iter().zip([0.4, 0.8, 1.0]) {
        assert!(interval[0] <= truth && truth <= interval[1], "{interval:?}");
    }
    assert!((found.noise / 0.01 - 1.0).abs() < 0.2 && found.residuals.len() == 80);
    let off = (found.angular_velocity - rate).component_div(&found.angular_velocity_errors);
    assert!(off.amax() < 4.0, "{off}");
    assert!((found.momentum_direction - momentum).norm() < 4.0 * found.momentum_error);
}

#[test]
fn a_symmetric_body_has_one_axis_and_a_steady_one_no_moments() {
    let needle = tumble([1.0, 10.0, 10.0], [1.0, 0.5, 0.2], 0.01);
    let found = needle.estimate();
    assert_eq!(found.status, InertiaStatus::Symmetric, "{}", found.reason);
    assert!(found.success() && (found.ratios - Vector3::new(0.1, 1.0, 1.0)).amax() < 4e-3);
    let axis: Vector3<f64> = found.axes.column(0).into();
    assert!((needle.tensor * axis - axis * 0.1).norm() < 5e-3);
    assert!(found.axes.column(1).iter().all(|x| x.is_nan()) && found.axis_errors[0].is_infinite());

    let spin = tumble([1.0, 2.0, 2.5], [0.0, 0.0, 1.0], 0.01);
    let found = spin.estimate();
    assert!(found.status == InertiaStatus::Steady && !found.success() && found.motion.is_none());
    assert!(found.ratios.iter().all(|x| x.is_nan()));
    let (rate, momentum) = spin.first();
    let off = (found.angular_velocity - rate).component_div(&found.angular_velocity_errors);
    assert!(off.amax() < 4.0, "{off}");
    assert!((found.momentum_direction - momentum).norm() < 4.0 * found.momentum_error);
}

#[test]
fn what_is_no_free_tumble_is_no_success() {
    // from the world to the body, and too far apart
    let right = tumble([1.0, 2.0, 2.5], [0.3, 1.0, 0.4], 0.01);
    let inverse: Vec<_> = right.seen.iter().map(UnitQuaternion::inverse).collect();
    let found = estimate_inertia(&right.times, &inverse, &InertiaOptions::default()).unwrap();
    assert_eq!(found.status, InertiaStatus::Misfit, "{}", found.reason);
    let half = Rotation3::from_axis_angle(&Vector3::x_axis(), 3.0).into();
    let far: Vec<UnitQuaternion<f64>> =
        (0..80).map(|k| if k % 2 == 0 { UnitQuaternion::identity() } else { half }).collect();
    let found = estimate_inertia(&right.times, &far, &InertiaOptions::default()).unwrap();
    assert_eq!(found.status, InertiaStatus::Undersampled);
    assert!(found.reason.contains("turns by 3 rad"), "{}", found.reason);
}

#[test]
fn what_is_not_allowed_is_named() {
    let right = tumble([1.0, 2.0, 2.5], [0.3, 1.0, 0.4], 0.0);
    let (times, seen) = (&right.times[..6], &right.seen[..6]);
    let said = |times: &[f64], seen: &[UnitQuaternion<f64>], options: InertiaOptions| {
        estimate_inertia(times, seen, &options).unwrap_err().to_string()
    };
    let default = InertiaOptions::default();
    assert_eq!(said(&times[..5], &seen[..5], default), "`times` must have at least 6 entries, found 5");
    assert_eq!(said(times, &seen[..5], default), "`orientations` must have 6 entries, found 5");
    for wrong in [times[2], f64::NAN] {
        let mut times = times.to_vec();
        times[3] = wrong;
        assert_eq!(said(&times, seen, default), "`times` must be finite and increasing");
    }
    let mut broken = seen.to_vec();
    broken[1] = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(f64::NAN, 0.0, 0.0, 1.0));
    assert_eq!(said(times, &broken, default), "`orientations` must be finite, found NaN");
    let noise = InertiaOptions { noise: Some(0.0), ..default };
    assert_eq!(said(times, seen, noise), "`noise` must be positive and finite, found 0");
    let level = InertiaOptions { level: 1.0, ..default };
    assert_eq!(said(times, seen, level), "`level` must be between 0 and 1, found 1");
    let token = CancellationToken::new();
    token.cancel();
    let cancelled = estimate_inertia_cancellable(times, seen, &default, &token).unwrap_err();
    assert_eq!(cancelled, InertiaEstimateError::Cancelled);
}
