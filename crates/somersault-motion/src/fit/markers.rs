//! Where markers are on a model.

use super::{FitError, expect_positive_squarable};
use nalgebra::Vector3;
use somersault_core::argument::expect_squarable;
use somersault_multibody::{DynamicsError, Model};

/// A point of a body.
#[derive(Debug, Clone, PartialEq)]
pub struct Marker {
    /// Its name, the same as in recordings.
    pub name: String,
    /// Number of the body.
    pub body: usize,
    /// Place in the axes of the body, m, at scale 1.
    pub point: Vector3<f64>,
    /// What its squared distance counts.
    pub weight: f64,
}

impl Marker {
    fn check(&self, model: &Model) -> Result<(), FitError> {
        let n_bodies = model.n_bodies();
        if self.body >= n_bodies {
            return Err(DynamicsError::NoSuchBody { found: self.body, n_bodies }.into());
        }
        expect_squarable("point", &self.point)?;
        Ok(expect_positive_squarable("weight", self.weight)?)
    }
}

/// The markers of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkerSet {
    pub(super) markers: Vec<Marker>,
}

impl MarkerSet {
    /// At least one marker, each on a body of `model`, with names that differ.
    pub fn try_new(model: &Model, markers: Vec<Marker>) -> Result<Self, FitError> {
        if markers.is_empty() {
            return Err(FitError::NoMarkers);
        }
        let mut names = std::collections::HashSet::new();
        for marker in &markers {
            if !names.insert(marker.name.as_str()) {
                return Err(FitError::DuplicateMarker { name: marker.name.clone() });
            }
            let named = |source| FitError::Marker { name: marker.name.clone(), source: Box::new(source) };
            marker.check(model).map_err(named)?;
        }
        Ok(Self { markers })
    }

    /// Markers of weight 1 by name, name of the body, and place in its axes.
    pub fn on_bodies<N: Into<String>>(
        model: &Model,
        markers: impl IntoIterator<Item = (N, impl AsRef<str>, [f64; 3])>,
    ) -> Result<Self, FitError> {
        let marker = |(name, body, point): (N, _, [f64; 3])| -> Result<Marker, FitError> {
            let body = model.body(AsRef::<str>::as_ref(&body))?;
            Ok(Marker { name: name.into(), body, point: point.into(), weight: 1.0 })
        };
        Self::try_new(model, markers.into_iter().map(marker).collect::<Result<_, _>>()?)
    }

    /// A marker of weight 1 at the origin of each body, which is the centre of its joint, by the name of the body.
    pub fn joint_centres(model: &Model) -> Result<Self, FitError> {
        let marker = |(body, link): (usize, &somersault_multibody::Link)| Marker {
            name: link.name().to_owned(),
            body,
            point: Vector3::zeros(),
            weight: 1.0,
        };
        Self::try_new(model, model.links().iter().enumerate().map(marker).collect())
    }

    /// The same with some markers moved on their bodies, by their names, m: by
    /// [`marker_offsets`](crate::reconstruction::ReconstructedFlight::marker_offsets) to where a recording shows them.
    pub fn moved<'a>(
        &self,
        offsets: impl IntoIterator<Item = (&'a str, Vector3<f64>)>,
    ) -> Result<Self, FitError> {
        let mut moved = self.clone();
        for (name, offset) in offsets {
            let found = moved.markers.iter_mut().find(|marker| marker.name == name);
            let marker = found.ok_or_else(|| FitError::NoSuchMarker { name: name.to_owned() })?;
            expect_squarable("offset", &offset)?;
            marker.point += offset;
        }
        Ok(moved)
    }

    /// The markers.
    pub fn markers(&self) -> &[Marker] {
        &self.markers
    }
}
