//! Recorded motions.

mod convention;
mod faults;
mod fit;
mod groups;
mod judged;
mod markers;
mod matrix;
mod motion_fit;
mod pca;
mod readers;
mod scoring;
mod skeleton;
mod synthetic;
mod validation;
mod writers;

pub(crate) use faults::{DiveFaults, SyntheticJudge};
pub(crate) use fit::{MarkerFit, MarkerSet};
pub(crate) use groups::{Band, GroupComparison, normalize_frames, turns_about};
pub(crate) use judged::{JudgedSet, read_judged};
pub(crate) use markers::MarkerRecording;
pub(crate) use motion_fit::MotionFit;
pub(crate) use pca::{Pca, Projection, common_eigenpostures, eigenpostures_per_motion, project};
pub(crate) use readers::{read_bvh, read_c3d, read_csv, read_file, read_joint_motion, read_trc};
pub(crate) use scoring::{Performance, Score, ScoringModel, ScoringOptions};
pub(crate) use skeleton::{Skeleton, SkeletonJoint, SkeletonRecording};
pub(crate) use synthetic::{Perturbation, SyntheticDive, SyntheticFlight, SyntheticSet};
pub(crate) use validation::{Baseline, Correlation, Validation, pearson, spearman, validate};
pub(crate) use writers::{write_bvh, write_c3d, write_csv, write_joint_motion, write_trc};
