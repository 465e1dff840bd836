//! Recorded motions.

mod advice;
mod awards;
mod channels;
mod convention;
mod faults;
mod fit;
mod groups;
mod identification;
mod inertia;
mod judged;
mod keypoints;
mod markers;
mod matrix;
mod motion_fit;
mod pca;
mod phases;
mod readers;
mod reconstruction;
mod repair;
mod scaling;
mod scoring;
mod skeleton;
mod smoothing;
mod synthetic;
mod validation;
mod writers;

/// Recorded motions: read, fitted by a model, analysed and scored.
#[pyo3::pymodule(name = "motion", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    #[pymodule_export]
    use crate::motion::advice::{Advice, FlightAdvice, WhatIf, advise_flight, what_if};
    #[pymodule_export]
    use crate::motion::awards::{AwardTable, read_awards};
    #[pymodule_export]
    use crate::motion::channels::ChannelRecording;
    #[pymodule_export]
    use crate::motion::faults::{DiveFaults, SyntheticJudge};
    #[pymodule_export]
    use crate::motion::fit::{MarkerFit, MarkerSet};
    #[pymodule_export]
    use crate::motion::groups::{Band, GroupComparison, normalize_frames, somersaults};
    #[pymodule_export]
    use crate::motion::identification::{FlightReport, identify_flight};
    #[pymodule_export]
    use crate::motion::inertia::{InertiaEstimate, estimate_inertia};
    #[pymodule_export]
    use crate::motion::judged::{JudgedSet, read_judged};
    #[pymodule_export]
    use crate::motion::keypoints::KeypointRecording;
    #[pymodule_export]
    use crate::motion::markers::MarkerRecording;
    #[pymodule_export]
    use crate::motion::motion_fit::MotionFit;
    #[pymodule_export]
    use crate::motion::pca::{Pca, Projection, common_eigenpostures, eigenpostures_per_motion, project};
    #[pymodule_export]
    use crate::motion::phases::{FlightPhase, find_flight};
    #[pymodule_export]
    use crate::motion::readers::{
        read_bvh, read_c3d, read_c3d_channels, read_c3d_events, read_c3d_force_plates, read_csv, read_file,
        read_joint_motion, read_mot, read_pose, read_trc,
    };
    #[pymodule_export]
    use crate::motion::reconstruction::{ReconstructedFlight, reconstruct_flight};
    #[pymodule_export]
    use crate::motion::repair::Repair;
    #[pymodule_export]
    use crate::motion::scaling::{ScaledModel, scale_model};
    #[pymodule_export]
    use crate::motion::scoring::{Performance, Score, ScoringModel, ScoringOptions, panel_score};
    #[pymodule_export]
    use crate::motion::skeleton::{Skeleton, SkeletonJoint, SkeletonRecording};
    #[pymodule_export]
    use crate::motion::smoothing::{SmoothedMotion, smooth_motion};
    #[pymodule_export]
    use crate::motion::synthetic::{Perturbation, SyntheticDive, SyntheticFlight, SyntheticSet};
    #[pymodule_export]
    use crate::motion::validation::{Baseline, Correlation, Validation, pearson, spearman, validate};
    #[pymodule_export]
    use crate::motion::writers::{
        write_bvh, write_c3d, write_csv, write_glb, write_joint_motion, write_mot, write_trc,
    };
}
