//! Dives seen in a mirror.
//!
//! The plane of symmetry of the standing body, y = 0, takes the right to the left. A turn by θ about an axis a becomes one by
//! θ about (−a_x, a_y, −a_z): somersaults stay, tilt and twists change their sign. A body whose name begins with `right_`
//! becomes the one whose name begins with `left_`, and its angles those of that body, but for a sign where the two axes are
//! opposite.

use crate::{Dive, DiveError};
use nalgebra::Vector3;
use somersault_core::argument::ArgumentError;
use somersault_multibody::models::{Dimension, Diver};
use somersault_multibody::{DynamicsError, Joint, Model};

impl Dive {
    /// The mirror image: right and left exchanged in all postures, and the twists the other way round. The variables of its
    /// program mean the same, so that mirror images of dives have the same z.
    pub fn mirrored(&self) -> Result<Self, DiveError> {
        let image = |posture: &Vec<f64>| mirror_image(&self.diver, posture);
        let postures = self.postures.iter().map(image).collect::<Result<_, _>>()?;
        Ok(Self { postures, twists: -self.twists, ..self.clone() })
    }
}

/// Joint angles of the mirror image of a posture, rad; in the plane those of the posture.
pub fn mirror_image(diver: &Diver, posture: &[f64]) -> Result<Vec<f64>, DiveError> {
    match diver.dimension {
        Dimension::Planar => Ok(posture.to_vec()),
        Dimension::Spatial => Ok(Mirror::try_new(&diver.model()?)?.image(posture)?),
    }
}

/// For each joint angle the one that it becomes the image of, and a sign.
struct Mirror(Vec<(usize, f64)>);

impl Mirror {
    /// Of a tree whose root floats and whose other joints are hinges.
    fn try_new(model: &Model) -> Result<Self, DynamicsError> {
        let n_root = model.velocities_of(0).len();
        let mut partners = Vec::with_capacity(model.n_velocities() - n_root);
        for body in 1..model.n_bodies() {
            let other = model.name(body).map_or(Ok(body), |name| match name.split_once('_') {
                Some(("right", part)) => model.body(&format!("left_{part}")),
                Some(("left", part)) => model.body(&format!("right_{part}")),
                Some(_) | None => Ok(body),
            })?;
            let own = hinge(model, body).zip(hinge(model, other));
            for (dof, partner) in model.velocities_of(body).zip(model.velocities_of(other)) {
                debug_assert_eq!(dof - n_root, partners.len());
                let sign = own
                    .map_or(1.0, |(own, other)| Vector3::new(-other.x, other.y, -other.z).dot(&own).signum());
                partners.push((partner - n_root, sign));
            }
        }
        Ok(Self(partners))
    }

    fn image(&self, angles: &[f64]) -> Result<Vec<f64>, DynamicsError> {
        if angles.len() != self.0.len() {
            let (expected, found) = (self.0.len(), angles.len());
            return Err(ArgumentError::Length { argument: "postures", expected, found }.into());
        }
        Ok(self.0.iter().map(|(partner, sign)| sign * angles[*partner]).collect())
    }
}

/// The axis of a hinge.
fn hinge(model: &Model, body: usize) -> Option<Vector3<f64>> {
    model.joint(body).and_then(Joint::hinge).copied()
}
