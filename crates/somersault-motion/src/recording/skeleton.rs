//! Trees of joints and how they turned over time.
//!
//! A joint has a place in its parent's axes, the offset, and turns against them: with R and p of the parent,
//! R_j = R R_rel and p_j = p + R (offset, or where the joint has moved to).

use super::rotations::expect_rotations;
use super::{
    CubicSpline, MarkerRecording, RecordingError, RotationCurve, expect_times, expect_unique, expect_within,
};
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::argument::{ArgumentError, expect_length};
use somersault_multibody::{Joint, Link, MassProperties, Model, ModelBuilder};

/// A joint of a skeleton.
#[derive(Debug, Clone, PartialEq)]
pub struct SkeletonJoint {
    /// Its name.
    pub name: String,
    /// Number of its parent, which comes before it; the first joint has none.
    pub parent: Option<usize>,
    /// Place in the axes of the parent, m; that of the root in the world.
    pub offset: Vector3<f64>,
    /// Whether it turns. Ends of segments do not.
    pub turns: bool,
    /// Whether it moves in its parent: each frame then has a place that stands for the offset.
    pub moves: bool,
}

/// Joints in such an order that parents come before their children.
#[derive(Debug, Clone, PartialEq)]
pub struct Skeleton {
    joints: Vec<SkeletonJoint>,
    n_turning: usize,
    n_moving: usize,
}

impl Skeleton {
    /// The skeleton of `joints`, the root first.
    pub fn try_new(joints: Vec<SkeletonJoint>) -> Result<Self, RecordingError> {
        if joints.is_empty() {
            return Err(RecordingError::Empty { argument: "joints" });
        }
        expect_unique(joints.iter().map(|j| j.name.as_str()))?;
        for (i, joint) in joints.iter().enumerate() {
            if joint.parent.map_or(i > 0, |p| p >= i) {
                return Err(RecordingError::Parent { joint: i });
            }
            if !joint.offset.iter().all(|x| x.is_finite()) {
                return Err(RecordingError::NonFinite { argument: "offset", frame: 0 });
            }
        }
        let n_turning = joints.iter().filter(|j| j.turns).count();
        let n_moving = joints.iter().filter(|j| j.moves).count();
        Ok(Self { joints, n_turning, n_moving })
    }

    /// The joints.
    pub fn joints(&self) -> &[SkeletonJoint] {
        &self.joints
    }

    /// Joints that turn: rotations in a frame.
    pub fn n_turning(&self) -> usize {
        self.n_turning
    }

    /// Joints that move in their parent: places in a frame.
    pub fn n_moving(&self) -> usize {
        self.n_moving
    }

    /// The same tree for the algorithms of `somersault-multibody`: the root floats, joints that turn are spherical,
    /// those that move free. A recording has no masses: `mass`, kg, is spread evenly over the joints that are not
    /// fixed, as points.
    pub fn model(&self, mass: f64) -> Result<Model, RecordingError> {
        if !(mass > 0.0 && mass.is_finite()) {
            return Err(ArgumentError::NotPositive { argument: "mass", found: mass }.into());
        }
        let movable = |i: usize| i == 0 || self.joints[i].turns || self.joints[i].moves;
        let share = mass / (0..self.joints.len()).filter(|&i| movable(i)).count() as f64;
        let mut builder = ModelBuilder::new();
        for (i, joint) in self.joints.iter().enumerate() {
            let (kind, at) = match (joint.moves || i == 0, joint.turns) {
                (true, _) => (Joint::Free, Vector3::zeros()),
                (false, true) => (Joint::Spherical, joint.offset),
                (false, false) => (Joint::Fixed, joint.offset),
            };
            let point = MassProperties::point(if movable(i) { share } else { 0.0 }, Vector3::zeros());
            let link = Link::root(joint.name.as_str(), kind, point).at(at);
            builder.add(match joint.parent {
                Some(parent) => link.carried_by(self.joints[parent].name.as_str()),
                None => link,
            })?;
        }
        Ok(builder.build()?)
    }
}

/// A skeleton and its poses, frame by frame.
#[derive(Debug, Clone, PartialEq)]
pub struct SkeletonRecording {
    skeleton: Skeleton,
    times: Vec<f64>,
    rotations: Vec<UnitQuaternion<f64>>,
    places: Vec<Vector3<f64>>,
}

impl SkeletonRecording {
    /// `rotations` has an entry for each frame and joint that turns, `places` one for each frame and joint
    /// that moves, frame by frame and in the order of the joints.
    pub fn try_new(
        skeleton: Skeleton,
        times: Vec<f64>,
        rotations: Vec<UnitQuaternion<f64>>,
        places: Vec<Vector3<f64>>,
    ) -> Result<Self, RecordingError> {
        expect_times(&times)?;
        expect_length("rotations", rotations.len(), skeleton.n_turning.saturating_mul(times.len()))?;
        expect_length("places", places.len(), skeleton.n_moving.saturating_mul(times.len()))?;
        expect_rotations(&rotations, skeleton.n_turning)?;
        if let Some(k) = places.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(RecordingError::NonFinite { argument: "places", frame: k / skeleton.n_moving });
        }
        Ok(Self { skeleton, times, rotations, places })
    }

    /// The skeleton.
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// Times of the frames, s.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Number of frames.
    pub fn n_frames(&self) -> usize {
        self.times.len()
    }

    /// Place and rotation of every joint against its parent in frame `i`, if there is such a frame.
    pub fn frame(&self, i: usize) -> Option<impl Iterator<Item = (Vector3<f64>, UnitQuaternion<f64>)>> {
        (i < self.n_frames()).then(|| {
            let mut rotations = self.rotations[i * self.skeleton.n_turning..].iter();
            let mut places = self.places[i * self.skeleton.n_moving..].iter();
            self.skeleton.joints.iter().map(move |joint| {
                let place = if joint.moves { places.next() } else { None };
                let rotation = if joint.turns { rotations.next() } else { None };
                (place.copied().unwrap_or(joint.offset), rotation.copied().unwrap_or_default())
            })
        })
    }

    /// The frames in turn, each as [`frame`](Self::frame) has it.
    pub fn frames(&self) -> impl Iterator<Item = impl Iterator<Item = (Vector3<f64>, UnitQuaternion<f64>)>> {
        (0..self.n_frames()).filter_map(|i| self.frame(i))
    }

    /// The frames in turn as configurations q of [`Skeleton::model`].
    pub fn configurations(&self) -> impl Iterator<Item = Vec<f64>> {
        self.frames().map(|frame| {
            let mut q = Vec::new();
            for (k, ((place, rotation), joint)) in frame.zip(&self.skeleton.joints).enumerate() {
                if k == 0 || joint.moves {
                    q.extend_from_slice(place.as_slice());
                }
                if k == 0 || joint.moves || joint.turns {
                    q.extend_from_slice(rotation.coords.as_slice());
                }
            }
            q
        })
    }

    /// Where all joints were: a marker for each, of its name. Forward kinematics, O(joints × frames); fails only
    /// where numbers overflow.
    pub fn joint_centres(&self) -> Result<MarkerRecording, RecordingError> {
        let mut points = Vec::with_capacity(self.n_frames() * self.skeleton.joints.len());
        let mut poses: Vec<(Vector3<f64>, UnitQuaternion<f64>)> = Vec::new();
        for frame in self.frames() {
            poses.clear();
            for ((place, rotation), joint) in frame.zip(&self.skeleton.joints) {
                let pose = match joint.parent.map(|p| poses[p]) {
                    Some((origin, axes)) => (origin + axes * place, axes * rotation),
                    None => (place, rotation),
                };
                points.push(Some(pose.0));
                poses.push(pose);
            }
        }
        let names = self.skeleton.joints.iter().map(|j| j.name.clone()).collect();
        MarkerRecording::try_new(names, self.times.clone(), points)
    }

    /// The same motion at other times: places by cubic splines, rotations by [`RotationCurve`].
    pub fn resample(&self, times: &[f64]) -> Result<Self, RecordingError> {
        expect_times(times)?;
        expect_within(&self.times, times)?;
        let (n_turning, n_moving) = (self.skeleton.n_turning, self.skeleton.n_moving);
        let mut rotations = vec![UnitQuaternion::identity(); times.len() * n_turning];
        let mut places = vec![Vector3::zeros(); times.len() * n_moving];
        for k in 0..n_turning {
            let through = self.rotations.iter().skip(k).step_by(n_turning).copied().collect();
            let curve = RotationCurve::try_new(self.times.clone(), through)?;
            times.iter().enumerate().for_each(|(i, &t)| rotations[i * n_turning + k] = curve.evaluate(t));
        }
        for k in 0..n_moving {
            let through = self.places.iter().skip(k).step_by(n_moving).copied().collect();
            let spline = CubicSpline::try_new(self.times.clone(), through)?;
            times.iter().enumerate().for_each(|(i, &t)| places[i * n_moving + k] = spline.evaluate(t));
        }
        Self::try_new(self.skeleton.clone(), times.to_vec(), rotations, places)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use somersault_multibody::Data;

    fn joint(name: &str, parent: Option<usize>, offset: [f64; 3], turns: bool, moves: bool) -> SkeletonJoint {
        SkeletonJoint { name: name.into(), parent, offset: offset.into(), turns, moves }
    }

    fn skeleton() -> Skeleton {
        Skeleton::try_new(vec![
            joint("hips", None, [0.0, 0.0, 1.0], true, true),
            joint("knee", Some(0), [0.0, 0.1, -0.4], true, false),
            joint("toes", Some(1), [0.1, 0.0, -0.4], false, false),
            joint("slider", Some(0), [0.0, 0.0, 0.3], true, true),
        ])
        .unwrap()
    }

    fn recording() -> SkeletonRecording {
        let times: Vec<f64> = (0..6).map(|i| 0.1 * f64::from(i)).collect();
        let turn = |t: f64, k: f64| UnitQuaternion::from_euler_angles(t * k, 0.3 * k, (2.0 * t).sin());
        let rotations = times.iter().flat_map(|&t| [turn(t, 1.0), turn(t, -2.0), turn(t, 0.4)]).collect();
        let places = times
            .iter()
            .flat_map(|&t| [Vector3::new(t, t * t, 1.0), Vector3::new(0.0, 0.0, 0.3 + t * t * t)])
            .collect();
        SkeletonRecording::try_new(skeleton(), times, rotations, places).unwrap()
    }

    #[test]
    fn joint_centres_are_where_the_model_has_its_bodies() {
        let recording = recording();
        let model = recording.skeleton().model(70.0).unwrap();
        assert!((model.mass() - 70.0).abs() < 1e-12);
        let centres = recording.joint_centres().unwrap();
        let mut data = Data::new(&model);
        for (i, q) in recording.configurations().enumerate() {
            let positions = model.positions(&mut data, &q).unwrap();
            for (k, centre) in centres.frame(i).unwrap().iter().enumerate() {
                let body = model.body(&centres.names()[k]).unwrap();
                let expected = positions.pose(body).unwrap().translation;
                assert!((centre.unwrap() - expected).norm() < 1e-14, "{k} in frame {i}");
            }
        }
    }

    #[test]
    fn resampling_meets_the_frames() {
        let recording = recording();
        let at: Vec<f64> = recording.times()[..5].iter().flat_map(|t| [*t, t + 0.03]).collect();
        let found = recording.resample(&at).unwrap();
        for i in 0..5 {
            for (a, b) in recording.frame(i).unwrap().zip(found.frame(2 * i).unwrap()) {
                assert!((a.0 - b.0).norm() < 1e-15 && a.1.angle_to(&b.1) < 1e-7);
            }
            // the places are cubics
            let t = at[2 * i + 1];
            let place = found.frame(2 * i + 1).unwrap().next().unwrap().0;
            assert!((place - Vector3::new(t, t * t, 1.0)).norm() < 1e-14);
        }
    }

    #[test]
    fn what_is_no_tree_is_refused() {
        assert_eq!(Skeleton::try_new(vec![]), Err(RecordingError::Empty { argument: "joints" }));
        let two = |parent| {
            Skeleton::try_new(vec![
                joint("a", None, [0.0; 3], true, true),
                joint("b", parent, [0.0; 3], true, false),
            ])
        };
        assert_eq!(two(None), Err(RecordingError::Parent { joint: 1 }));
        assert_eq!(two(Some(1)), Err(RecordingError::Parent { joint: 1 }));
        assert!(matches!(
            skeleton().model(-1.0),
            Err(RecordingError::Argument(ArgumentError::NotPositive { .. }))
        ));
        let found = SkeletonRecording::try_new(skeleton(), vec![0.0], vec![], vec![Vector3::zeros(); 2]);
        assert_eq!(
            found,
            Err(RecordingError::Argument(ArgumentError::Length {
                argument: "rotations",
                expected: 3,
                found: 0
            }))
        );
    }
}
