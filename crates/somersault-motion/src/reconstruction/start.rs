//! Where the search for a flight begins: at fits of single frames, which know no law of flight.

use super::ReconstructionError;
use super::attitude::read_orientation;
use super::joints::JointSplines;
use super::unknowns::Estimate;
use crate::frame_fits::FrameFits;
use nalgebra::Vector3;
use somersault_core::lie::so3;
use somersault_multibody::{Data, Model};

/// Half of the time over which velocities are estimated, s.
const SPAN: f64 = 0.05;
/// And of that over which the centre of mass is.
const WIDE_SPAN: f64 = 0.25;

/// Where the search begins: joints at rest as in the reference frame, the momentum of a rigid body that turns as the root does
/// about that frame, the centre of mass on the parabola nearest to those of the frames around.
pub(super) fn start_of(
    fits: &FrameFits,
    model: &Model,
    splines: &JointSplines,
    is_planar: bool,
    times: &[f64],
    reference: usize,
) -> Result<Estimate, ReconstructionError> {
    let q = fits.configuration(reference);
    let orientation = |q: &[f64]| read_orientation(is_planar, q);
    let near = |span: f64| {
        let is_near = move |i: &usize| (times[*i] - times[reference]).abs() <= span;
        (0..times.len()).filter(is_near).filter(|i| fits.has_markers(*i))
    };
    // the mean rate of turning, by least squares over the frames around, in axes of the root
    let (mut turned, mut squares) = (Vector3::zeros(), 0.0);
    for i in near(SPAN) {
        let t = times[i] - times[reference];
        let turn = so3::log(&(orientation(q).inverse() * orientation(fits.configuration(i))));
        turned += turn * t;
        squares += t * t;
    }
    let rate: Vector3<f64> = if squares > 0.0 { turned / squares } else { Vector3::zeros() };
    let mut v = vec![0.0; model.n_velocities()];
    let rates = model.velocities_of(0);
    let angular = if is_planar { &rate.as_slice()[2..] } else { rate.as_slice() };
    v[rates.end - angular.len()..rates.end].copy_from_slice(angular);
    let mut data = Data::new(model);
    let momentum = model.centroidal(&mut data, q)?.momentum(&v)?.angular;
    // the line through c − ½ g t²
    let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
    let mut right = [Vector3::zeros(); 2];
    for i in near(WIDE_SPAN) {
        let t = times[i] - times[reference];
        let point = fits.centers()[i] - model.gravity() * (0.5 * t * t);
        n += 1.0;
        sum += t;
        squares += t * t;
        right[0] += point;
        right[1] += point * t;
    }
    let determinant = n * squares - sum * sum;
    let (center, velocity) = if determinant > 0.0 {
        let center = (right[0] * squares - right[1] * sum) / determinant;
        (center, (right[1] * n - right[0] * sum) / determinant)
    } else {
        (fits.centers()[reference], Vector3::zeros())
    };
    Ok(Estimate {
        orientation: orientation(q),
        momentum,
        center,
        velocity,
        scale: fits.scale(),
        gravity: 1.0,
        coefficients: splines.at_rest(q),
    })
}
