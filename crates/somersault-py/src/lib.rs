//! Python bindings of somersault.
//!
//! These files convert, validate and delegate. The classes of exceptions are in `somersault.errors`.
#![forbid(unsafe_code)]

mod contact;
mod core;
mod ftla;
mod integrators;
mod motion;
mod multibody;
mod ocp;

/// Motion of rigid bodies on R^3 x SO(3): what the package `somersault` is made of.
#[pyo3::pymodule]
mod _somersault {
    #[pymodule_export]
    use crate::contact::contacts::{Contact, SpherePair};
    #[pymodule_export]
    use crate::contact::laws::{
        CompliantLaw, CoulombFriction, HuntCrossley, RegularisedFriction, Resistance, damping_ratio,
        restitution,
    };
    #[pymodule_export]
    use crate::contact::sensitivity::{Sensitivities, differentiate};
    #[pymodule_export]
    use crate::contact::surface::{
        CylindricalSurface, HalfSpace, SphericalSurface, Surface, SurfaceFunction,
    };
    #[pymodule_export]
    use crate::contact::system::{
        ContactSystem, bouncing_ball, falling_box, rolling_disk, sliding_block, spinning_top, tippe_top,
    };
    #[pymodule_export]
    use crate::ftla::{
        Chain, ContinuationResult, Diagnosis, Extremal, Following, Matching, MatchingResult, Placement,
        PlacementResult, Spectrum, Splitting, Subspace, System, Transition, VariationalFlow, arm, cold_start,
        continue_through, cubic_regulator, diagnose, linear_regulator, py_follow, py_graded_times,
        rank_held_costates, shoot, slow_subspace, state_costate, travel_arm, tree,
    };
    #[pymodule_export]
    use crate::integrators::batch::integrate_batch;
    #[pymodule_export]
    use crate::integrators::bodies::{RigidBody, State};
    #[pymodule_export]
    use crate::integrators::event::Event;
    #[pymodule_export]
    use crate::integrators::exact::FreeBody;
    #[pymodule_export]
    use crate::integrators::forces::{Drag, Force, ForceModel, Gravitation, Gravity, Spring, Torque};
    #[pymodule_export]
    use crate::integrators::integrate::integrate;
    #[pymodule_export]
    use crate::integrators::methods::{MethodInfo, MethodTable, method, methods};
    #[pymodule_export]
    use crate::integrators::studies::{
        Convergence, EnergyStudy, Problem, StabilityRegion, WorkPrecision, convergence, energy_study, prisms,
        spectral_radii, stability_region, work_precision_study,
    };
    #[pymodule_export]
    use crate::integrators::trajectory::{DenseOutput, Solution, Trajectory};
    #[pymodule_export]
    use crate::motion::{
        Band, Baseline, Correlation, DiveFaults, GroupComparison, JudgedSet, MarkerFit, MarkerRecording,
        MarkerSet, MotionFit, Pca, Performance, Perturbation, Projection, Score, ScoringModel,
        ScoringOptions, Skeleton, SkeletonJoint, SkeletonRecording, SyntheticDive, SyntheticFlight,
        SyntheticJudge, SyntheticSet, Validation, common_eigenpostures, eigenpostures_per_motion,
        normalize_frames, pearson, project, read_bvh, read_c3d, read_csv, read_joint_motion, read_judged,
        read_trc, spearman, turns_about, validate, write_bvh, write_c3d, write_csv, write_joint_motion,
        write_trc,
    };
    #[pymodule_export]
    use crate::multibody::flight::integrate_flight;
    #[pymodule_export]
    use crate::multibody::link::Link;
    #[pymodule_export]
    use crate::multibody::model::Model;
    #[pymodule_export]
    use crate::multibody::models::{Diver, cart_pendulum, diver_planar, diver_spatial, two_link_arm};
    #[pymodule_export]
    use crate::multibody::motion::{TreeDenseOutput, TreeSolution, integrate_tree};
    #[pymodule_export]
    use crate::ocp::{
        CartPendulumProblem, CollocationOutcome, CollocationProblem, CollocationResult, Constraint, Cost,
        Dive, DiveSolution, DiveVerification, EigenpostureBase, LiteralDive, Motion, MotionProblem,
        MultiphaseProblem, MultiphaseResult, Phase, Report, SearchResult, SplineMotion, SwingUpVerification,
        Term, Verification, axis_direction, body_orientation, displacement, dive_107b, dive_5174d, entries,
        function, momentum, point_position,
    };

    /// The version of the package.
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
