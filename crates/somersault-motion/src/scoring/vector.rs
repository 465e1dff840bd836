//! What a motion is to a judge that counts: its vector.

use super::{ScoringError, expect_least, expect_length, expect_numbers};
use crate::analysis::{Pca, expect_finite, normalize_frames};
use crate::recording::{MarkerRecording, expect_times};
use nalgebra::{DMatrix, RowDVector};

/// A motion to be scored, frame by frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Performance {
    times: Vec<f64>,
    postures: DMatrix<f64>,
    path: DMatrix<f64>,
    synthetic: bool,
}

impl Performance {
    /// `postures` has a row for each frame, of joint angles or of places against the body; `path` has the three
    /// coordinates of the body.
    pub fn try_new(
        times: Vec<f64>,
        postures: DMatrix<f64>,
        path: DMatrix<f64>,
    ) -> Result<Self, ScoringError> {
        expect_least("times", times.len(), 2)?;
        expect_length("rows of postures", postures.nrows(), times.len())?;
        expect_length("rows of path", path.nrows(), times.len())?;
        expect_length("columns of path", path.ncols(), 3)?;
        expect_least("columns of postures", postures.ncols(), 1)?;
        expect_times(&times)?;
        for (argument, rows) in [("postures", &postures), ("path", &path)] {
            expect_finite(argument, rows)?;
        }
        Ok(Self { times, postures, path, synthetic: false })
    }

    /// From markers without gaps: the path is their centre, postures are their places about it. The thesis
    /// leaves the path in the postures too; there it would be most of what their first components describe.
    pub fn from_markers(recording: &MarkerRecording) -> Result<Self, ScoringError> {
        let (n, m) = (recording.n_frames(), recording.n_markers());
        let mut postures = DMatrix::zeros(n, 3 * m);
        let mut path = DMatrix::zeros(n, 3);
        for (i, frame) in recording.frames().enumerate() {
            let points: Vec<_> = frame.iter().flatten().collect();
            expect_numbers("recording", points.iter().flat_map(|p| p.iter()))?;
            if let Some(k) = frame.iter().position(Option::is_none) {
                return Err(ScoringError::Gap { marker: recording.names()[k].clone(), frame: i });
            }
            let centre = points.iter().copied().sum::<nalgebra::Vector3<f64>>() / m as f64;
            path.row_mut(i).copy_from(&centre.transpose());
            for (k, point) in points.iter().enumerate() {
                postures.fixed_view_mut::<1, 3>(i, 3 * k).copy_from(&(*point - centre).transpose());
            }
        }
        Self::try_new(recording.times().to_vec(), postures, path)
    }

    /// The same, labelled as made up; models and validations that use it carry the label on.
    pub fn labelled_synthetic(self) -> Self {
        Self { synthetic: true, ..self }
    }

    /// Whether it is labelled as made up.
    pub fn is_synthetic(&self) -> bool {
        self.synthetic
    }

    /// Times of the frames, s.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Postures, a row for each frame.
    pub fn postures(&self) -> &DMatrix<f64> {
        &self.postures
    }

    /// Path of the body, a row for each frame.
    pub fn path(&self) -> &DMatrix<f64> {
        &self.path
    }

    /// From the first to the last frame, s.
    pub fn duration(&self) -> f64 {
        self.times[self.times.len() - 1] - self.times[0]
    }

    /// Numbers in a posture.
    pub fn n_features(&self) -> usize {
        self.postures.ncols()
    }

    /// At `n_frames` equal distances in time.
    pub(super) fn normalized(&self, n_frames: usize) -> Result<Normalized, ScoringError> {
        let normalize = |all: &DMatrix<f64>| -> Result<DMatrix<f64>, ScoringError> {
            let mut out = DMatrix::zeros(n_frames, all.ncols());
            for (k, column) in all.column_iter().enumerate() {
                let column: Vec<f64> = column.iter().copied().collect();
                out.column_mut(k).copy_from_slice(&normalize_frames(&self.times, &column, n_frames)?);
            }
            Ok(out)
        };
        let (postures, path) = (normalize(&self.postures)?, normalize(&self.path)?);
        Ok(Normalized { postures, path, duration: self.duration() })
    }
}

/// A motion at a number of frames.
pub(super) struct Normalized {
    pub(super) postures: DMatrix<f64>,
    path: DMatrix<f64>,
    duration: f64,
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

    /// The vectors of motions, a row each, whose eigenweights are those of `eigenpostures`.
    pub(super) fn vectors(
        &self,
        eigenpostures: &Pca,
        motions: &[Normalized],
    ) -> Result<DMatrix<f64>, ScoringError> {
        let mut rows = Vec::with_capacity(motions.len());
        for motion in motions {
            let weights = eigenpostures.scores(&motion.postures)?;
            let mut vector: Vec<f64> = weights.iter().copied().collect();
            if self.path {
                for column in motion.path.column_iter() {
                    vector.extend(column.iter().map(|x| x - column[0]));
                }
            }
            if self.duration {
                vector.push(motion.duration);
            }
            rows.push(RowDVector::from_vec(vector));
        }
        Ok(DMatrix::from_rows(&rows))
    }
}
