//! What is fitted: a model with markers, and where they shall be.

use super::{FitError, FitOptions, MarkerSet};
use crate::recording::MarkerRecording;
use nalgebra::Vector3;
use somersault_core::argument::expect_squarable;
use somersault_core::cancel::CancellationToken;
use somersault_multibody::Model;

/// A model with markers, to be fitted to recordings.
///
/// ```
/// use somersault_motion::fit::{FitOptions, MarkerFit, MarkerSet};
/// use somersault_motion::recording::MarkerRecording;
/// use somersault_multibody::{Data, models::{Diver, Posture}};
///
/// let diver = Diver::planar();
/// let model = diver.model()?;
/// let markers = MarkerSet::joint_centres(&model)?;
/// // a recording of one frame: the joint centres of posture A
/// let mut data = Data::new(&model);
/// let q = diver.configuration(Posture::A)?;
/// let positions = model.positions(&mut data, &q)?;
/// let names = model.links().iter().map(|link| link.name().to_owned()).collect();
/// let points = (0..model.n_bodies()).map(|i| Ok(Some(positions.pose(i)?.translation)));
/// let points = points.collect::<Result<_, Box<dyn std::error::Error>>>()?;
/// let recording = MarkerRecording::try_new(names, vec![0.0], points)?;
///
/// let fit = MarkerFit::try_new(&model, markers, FitOptions::default())?.fit(&recording)?;
/// assert!(fit.frames[0].rms.unwrap() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct MarkerFit {
    pub(super) model: Model,
    pub(super) markers: MarkerSet,
    pub(super) options: FitOptions,
}

/// Fails once the fit is cancelled.
pub(super) fn expect_not_cancelled(token: &CancellationToken) -> Result<(), FitError> {
    if token.is_cancelled() { Err(FitError::Interrupted) } else { Ok(()) }
}

/// Where a marker was recorded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Target {
    pub(crate) point: Vector3<f64>,
    /// In the recording.
    pub(crate) weight: f64,
}

/// Of one frame, for each marker of the model.
pub(crate) type Targets = Vec<Option<Target>>;

impl MarkerFit {
    /// Fits `markers` of `model` as `options` say.
    pub fn try_new(model: &Model, markers: MarkerSet, options: FitOptions) -> Result<Self, FitError> {
        options.validate(model)?;
        Ok(Self { model: model.clone(), markers, options })
    }

    /// Its choices.
    pub fn options(&self) -> &FitOptions {
        &self.options
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Its markers.
    pub fn markers(&self) -> &MarkerSet {
        &self.markers
    }

    /// For each frame a target for each marker of the model.
    pub(crate) fn targets(&self, recording: &MarkerRecording) -> Result<Vec<Targets>, FitError> {
        let numbers: Vec<Option<usize>> =
            self.markers.markers().iter().map(|m| recording.marker(&m.name).ok()).collect();
        if numbers.iter().all(Option::is_none) {
            let names: Vec<&str> = self.markers.markers().iter().map(|m| m.name.as_str()).collect();
            let (expected, found) = (names.join(", "), recording.names().join(", "));
            return Err(FitError::NoCommonMarker { expected, found });
        }
        let frame = |(i, points): (usize, &[Option<Vector3<f64>>])| {
            let weights: Vec<f64> = recording.weights(i).collect();
            let target = |k: usize| points[k].map(|point| Target { point, weight: weights[k] });
            numbers.iter().map(|k| target((*k)?)).collect()
        };
        let targets: Vec<Targets> = recording.frames().enumerate().map(frame).collect();
        expect_squarable("recording", targets.iter().flatten().flatten().flat_map(|y| y.point.iter()))?;
        Ok(targets)
    }
}
