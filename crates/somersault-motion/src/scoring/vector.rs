//! What a motion is to a judge that counts: its vector.

use super::ScoringError;
use crate::analysis::{Pca, expect_finite, normalize_frames};
use crate::recording::{MarkerRecording, expect_times, expect_unique};
use nalgebra::{DMatrix, RowDVector};
use somersault_core::argument::{expect_least, expect_length, expect_squarable};

/// What the numbers of a posture are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FeatureKind {
    /// Places of markers about their centre, m, z up: three numbers for each name. They turn with the body.
    Markers,
    /// One number for each name that does not depend on where the body faces, such as joint angles, rad.
    Coordinates,
}

impl std::fmt::Display for FeatureKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Markers => "markers",
            Self::Coordinates => "coordinates",
        })
    }
}

/// The numbers of a posture: what they are, and their names.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Features {
    /// What they are.
    pub kind: FeatureKind,
    /// Names of the markers or the coordinates, which differ.
    pub names: Vec<String>,
}

impl Features {
    /// Numbers of a posture for each name.
    pub(super) fn per_name(&self) -> usize {
        match self.kind {
            FeatureKind::Markers => 3,
            FeatureKind::Coordinates => 1,
        }
    }

    /// Numbers of a posture.
    pub fn n_numbers(&self) -> usize {
        self.names.len() * self.per_name()
    }
}

/// A motion to be scored, frame by frame: named numbers of its postures, and the path of the body in m, z up.
#[derive(Debug, Clone, PartialEq)]
pub struct Performance {
    times: Vec<f64>,
    features: Features,
    /// Places of markers in the world, or coordinates.
    values: DMatrix<f64>,
    path: DMatrix<f64>,
    synthetic: bool,
}

impl Performance {
    /// `postures` has a row for each frame and a column for each of the `names`: coordinates that do not depend on where
    /// the body faces, such as joint angles; `path` has the three coordinates of the body, m, z up.
    pub fn try_new(
        times: Vec<f64>,
        names: Vec<String>,
        postures: DMatrix<f64>,
        path: DMatrix<f64>,
    ) -> Result<Self, ScoringError> {
        expect_least("times", times.len(), 2)?;
        expect_length("rows of postures", postures.nrows(), times.len())?;
        expect_length("rows of path", path.nrows(), times.len())?;
        expect_length("columns of path", path.ncols(), 3)?;
        expect_least("columns of postures", postures.ncols(), 1)?;
        expect_length("names", names.len(), postures.ncols())?;
        expect_unique(names.iter().map(String::as_str))?;
        expect_times(&times)?;
        for (argument, rows) in [("postures", &postures), ("path", &path)] {
            expect_finite(argument, rows)?;
        }
        let features = Features { kind: FeatureKind::Coordinates, names };
        Ok(Self { times, features, values: postures, path, synthetic: false })
    }

    /// From markers without gaps: the path is their centre, postures are their places about it. The thesis
    /// leaves the path in the postures too; there it would be most of what their first components describe.
    pub fn from_markers(recording: &MarkerRecording) -> Result<Self, ScoringError> {
        let (n, m) = (recording.n_frames(), recording.n_markers());
        expect_least("times", n, 2)?;
        let mut values = DMatrix::zeros(n, 3 * m);
        for (i, frame) in recording.frames().enumerate() {
            expect_squarable("recording", frame.iter().flatten().flat_map(|p| p.iter()))?;
            for (k, point) in frame.iter().enumerate() {
                let gap = || ScoringError::Gap { marker: recording.names()[k].clone(), frame: i };
                let point = point.ok_or_else(gap)?;
                values.fixed_view_mut::<1, 3>(i, 3 * k).copy_from(&point.transpose());
            }
        }
        let features = Features { kind: FeatureKind::Markers, names: recording.names().to_vec() };
        let path = centres(&values);
        Ok(Self { times: recording.times().to_vec(), features, values, path, synthetic: false })
    }

    /// The same, labelled as synthetic; models and validations that use it carry the label on.
    pub fn labelled_synthetic(self) -> Self {
        Self { synthetic: true, ..self }
    }

    /// Whether it is labelled as synthetic.
    pub fn is_synthetic(&self) -> bool {
        self.synthetic
    }

    /// Times of the frames, s.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// What the numbers of its postures are.
    pub fn features(&self) -> &Features {
        &self.features
    }

    /// Coordinates, or places of markers in the world, m: a row for each frame.
    pub fn values(&self) -> &DMatrix<f64> {
        &self.values
    }

    /// Path of the body, m, a row for each frame; of markers their centre.
    pub fn path(&self) -> &DMatrix<f64> {
        &self.path
    }

    /// From the first to the last frame, s.
    pub fn duration(&self) -> f64 {
        self.times[self.times.len() - 1] - self.times[0]
    }

    /// Numbers in a posture.
    pub fn n_features(&self) -> usize {
        self.features.n_numbers()
    }

    /// With the features requested, found by name, at `n_frames` equal distances in time. What else it has is not used.
    pub(super) fn normalized(
        &self,
        features: &Features,
        n_frames: usize,
    ) -> Result<Normalized, ScoringError> {
        let (mut values, mut path) = (self.arranged(features)?, self.path.clone());
        if features.kind == FeatureKind::Markers {
            path = centres(&values);
            for (mut row, centre) in values.row_iter_mut().zip(path.row_iter()) {
                for mut point in (0..features.names.len()).map(|k| 3 * k) {
                    for x in centre.iter() {
                        row[point] -= x;
                        point += 1;
                    }
                }
            }
        }
        let start = path.row(0).into_owned();
        path.row_iter_mut().for_each(|mut row| row -= &start);
        let normalize = |all: &DMatrix<f64>| -> Result<DMatrix<f64>, ScoringError> {
            let mut out = DMatrix::zeros(n_frames, all.ncols());
            for (k, column) in all.column_iter().enumerate() {
                let column: Vec<f64> = column.iter().copied().collect();
                out.column_mut(k).copy_from_slice(&normalize_frames(&self.times, &column, n_frames)?);
            }
            Ok(out)
        };
        let (postures, path) = (normalize(&values)?, normalize(&path)?);
        Ok(Normalized { postures, path, duration: self.duration() })
    }

    /// The values of these features.
    fn arranged(&self, features: &Features) -> Result<DMatrix<f64>, ScoringError> {
        if features.kind != self.features.kind {
            return Err(ScoringError::Kind { expected: features.kind, found: self.features.kind });
        }
        let place = |name: &String| self.features.names.iter().position(|n| n == name);
        let missing: Vec<&str> =
            features.names.iter().filter(|n| place(n).is_none()).map(String::as_str).collect();
        if !missing.is_empty() {
            let (missing, found) = (missing.join(", "), self.features.names.join(", "));
            return Err(ScoringError::Names { missing, found });
        }
        let per_name = features.per_name();
        let mut arranged = DMatrix::zeros(self.values.nrows(), features.n_numbers());
        for (k, from) in features.names.iter().filter_map(place).enumerate() {
            let from = self.values.columns(from * per_name, per_name);
            arranged.columns_mut(k * per_name, per_name).copy_from(&from);
        }
        Ok(arranged)
    }
}

/// Centres of places, three columns each, row by row.
fn centres(places: &DMatrix<f64>) -> DMatrix<f64> {
    let n = places.ncols() / 3;
    let sum = |i: usize, axis: usize| (0..n).map(|k| places[(i, 3 * k + axis)]).sum::<f64>();
    DMatrix::from_fn(places.nrows(), 3, |i, axis| sum(i, axis) / n as f64)
}

/// A motion at a number of frames; its path begins at zero.
#[derive(Debug, Clone)]
pub(super) struct Normalized {
    pub(super) postures: DMatrix<f64>,
    pub(super) path: DMatrix<f64>,
    pub(super) duration: f64,
}

/// What goes into the vector of a motion.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct VectorOptions {
    /// Frames each motion is brought to.
    pub n_frames: usize,
    /// Eigenweights of each frame.
    pub n_eigenweights: usize,
    /// Whether the path of the body, from where it begins, is part of it.
    pub path: bool,
    /// Whether the duration is.
    pub duration: bool,
}

impl VectorOptions {
    /// The settings of the thesis (4.1.2): 60 frames, four eigenweights, body path.
    pub fn thesis() -> Self {
        Self { n_frames: 60, n_eigenweights: 4, path: true, duration: false }
    }

    /// Numbers in a vector.
    pub(super) fn length(&self) -> usize {
        let per_frame = self.n_eigenweights.saturating_add(if self.path { 3 } else { 0 });
        self.n_frames.saturating_mul(per_frame).saturating_add(usize::from(self.duration))
    }

    /// The vector of a motion whose eigenweights are those of `eigenpostures`, and the square of what these leave of its postures.
    pub(super) fn vector(
        &self,
        eigenpostures: &Pca,
        motion: &Normalized,
    ) -> Result<(RowDVector<f64>, f64), ScoringError> {
        let weights = eigenpostures.scores(&motion.postures)?;
        let mean = eigenpostures.mean().transpose();
        let total: f64 = motion.postures.row_iter().map(|row| (row - &mean).norm_squared()).sum();
        let rest = (total - weights.norm_squared()).max(0.0);
        let mut vector: Vec<f64> = weights.iter().copied().collect();
        if self.path {
            vector.extend(motion.path.iter());
        }
        if self.duration {
            vector.push(motion.duration);
        }
        Ok((RowDVector::from_vec(vector), rest))
    }
}
