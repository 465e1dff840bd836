//! Markers of a diver by the names that motion capture and pose estimation have for them.
//!
//! Each protocol is a table of names with places on the standing reference diver of 1.70 m, in metres: x forward, y outwards, z up, in axes of
//! a segment, whose origin is the joint nearer to the trunk. Places go with the height, and with the sizes of the segments.
//!
//! Joint centres, the top of the head, the notch of the breastbone and its tip are those of the diver's segments (P. de Leva, J. Biomech. 29 (1996)
//! 1223). The spines of the pelvis are by the regression of M. E. Harrington et al., J. Biomech. 40 (2007) 595, solved for them at a width of
//! 0.24 m and a depth of 0.145 m. Points of the face are means of men in C. C. Gordon et al., *1988 Anthropometric Survey of U.S. Army
//! Personnel*, to 5 mm. Markers on the skin are a centimetre off the bone. On a person all of them may be elsewhere by some 20 mm.

use super::{FitError, Marker, MarkerSet};
use nalgebra::Vector3;
use somersault_multibody::Data;
use somersault_multibody::models::{BallJointedDiver, Dimension, Diver};

/// Names that programs and laboratories give to markers, joint centres or key points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum MarkerProtocol {
    /// The 17 key points of COCO, which AlphaPose and MMPose write too.
    Coco,
    /// The 25 key points of OpenPose's model BODY_25.
    Body25,
    /// The 26 key points of HALPE.
    Halpe26,
    /// The 33 landmarks of MediaPipe.
    MediaPipe,
    /// The joints of SMPL and its relatives but those of spine and collar bones, which no diver has.
    Smpl,
    /// The key points of OpenCap and Pose2Sim in TRC files, and the anatomical markers that OpenCap's augmenter adds.
    OpenCap,
    /// Plug-in Gait of Vicon for the whole body, without the markers whose place on a segment is free (`THI`, `TIB`, `UPA`, `FRM`).
    PlugInGait,
}

/// A segment and a point in its axes.
type Place = (&'static str, [f64; 3]);
/// What stands before and after the name of a part on the right and on the left, and the places of the parts.
type Pairs = ([[&'static str; 2]; 2], &'static [(&'static str, Place)]);
/// A marker in the median plane, or of one side only with y to the left.
type Single = (&'static str, Place);

const NOSE: Place = ("head", [0.14, 0.0, 0.085]);
const EYE: Place = ("head", [0.1, 0.03, 0.12]);
const EAR: Place = ("head", [0.02, 0.075, 0.105]);
const HEAD_TOP: Place = ("head", [0.02, 0.0, 0.237]);
const MID_SHOULDER: Place = ("torso", [0.0, 0.0, 0.36109]);
const ACROMION: Place = ("torso", [0.0, 0.18, 0.41]);
const C7: Place = ("torso", [-0.06, 0.0, 0.447]);
const SHOULDER: Place = ("upper_arm", [0.0; 3]);
const ELBOW: Place = ("forearm", [0.0; 3]);
const OUTER_ELBOW: Place = ("upper_arm", [0.0, 0.04, -0.275]);
const INNER_ELBOW: Place = ("upper_arm", [0.0, -0.04, -0.275]);
const WRIST: Place = ("hand", [0.0; 3]);
const THUMB_WRIST: Place = ("forearm", [0.03, 0.0, -0.26]);
const SMALL_FINGER_WRIST: Place = ("forearm", [-0.03, 0.0, -0.26]);
const MID_HIP: Place = ("pelvis", [0.0, 0.0, -0.14227]);
const FRONT_SPINE: Place = ("pelvis", [0.055, 0.12, -0.06]);
const BACK_SPINE: Place = ("pelvis", [-0.1, 0.045, -0.05]);
const HIP: Place = ("thigh", [0.0; 3]);
const KNEE: Place = ("shank", [0.0; 3]);
const OUTER_KNEE: Place = ("thigh", [0.0, 0.055, -0.412]);
const INNER_KNEE: Place = ("thigh", [0.0, -0.055, -0.412]);
const ANKLE: Place = ("foot", [0.0; 3]);
const OUTER_ANKLE: Place = ("shank", [0.0, 0.04, -0.43]);
const INNER_ANKLE: Place = ("shank", [0.0, -0.04, -0.425]);
const HEEL: Place = ("foot", [-0.06, 0.0, -0.05]);
const FOREFOOT: Place = ("foot", [0.125, 0.0, -0.035]);
const OUTER_FOREFOOT: Place = ("foot", [0.09, 0.05, -0.055]);
const BALL: Place = ("toes", [0.0; 3]);
const BIG_TOE: Place = ("toes", [0.06, -0.025, 0.0]);
const SMALL_TOE: Place = ("toes", [0.025, 0.035, 0.0]);

const SNAKE: [[&str; 2]; 2] = [["right_", ""], ["left_", ""]];
const CAPITAL: [[&str; 2]; 2] = [["R", ""], ["L", ""]];

const LIMBS: [(&str, Place); 8] = [
    ("shoulder", SHOULDER),
    ("elbow", ELBOW),
    ("wrist", WRIST),
    ("hip", HIP),
    ("knee", KNEE),
    ("ankle", ANKLE),
    ("eye", EYE),
    ("ear", EAR),
];
const FEET: [(&str, Place); 3] = [("big_toe", BIG_TOE), ("small_toe", SMALL_TOE), ("heel", HEEL)];
const CAPITAL_LIMBS: [(&str, Place); 9] = [
    ("Shoulder", SHOULDER),
    ("Elbow", ELBOW),
    ("Wrist", WRIST),
    ("Hip", HIP),
    ("Knee", KNEE),
    ("Ankle", ANKLE),
    ("BigToe", BIG_TOE),
    ("SmallToe", SMALL_TOE),
    ("Heel", HEEL),
];
const MEDIAPIPE_REST: [(&str, Place); 7] = [
    ("eye_inner", ("head", [0.105, 0.015, 0.12])),
    ("eye_outer", ("head", [0.085, 0.05, 0.12])),
    ("pinky", ("hand", [-0.03, 0.0, -0.075])),
    ("index", ("hand", [0.025, 0.0, -0.085])),
    ("thumb", ("hand", [0.035, 0.0, -0.04])),
    ("heel", HEEL),
    ("foot_index", BIG_TOE),
];
const SMPL: [(&str, Place); 7] = [
    ("shoulder", SHOULDER),
    ("elbow", ELBOW),
    ("wrist", WRIST),
    ("hip", HIP),
    ("knee", KNEE),
    ("ankle", ANKLE),
    ("foot", BALL),
];
const OPENCAP_ANATOMICAL: [(&str, Place); 12] = [
    ("shoulder_study", ACROMION),
    ("lelbow_study", OUTER_ELBOW),
    ("melbow_study", INNER_ELBOW),
    ("lwrist_study", THUMB_WRIST),
    ("mwrist_study", SMALL_FINGER_WRIST),
    ("knee_study", OUTER_KNEE),
    ("mknee_study", INNER_KNEE),
    ("ankle_study", OUTER_ANKLE),
    ("mankle_study", INNER_ANKLE),
    ("calc_study", HEEL),
    ("toe_study", FOREFOOT),
    ("5meta_study", OUTER_FOREFOOT),
];
const PLUG_IN_GAIT: [(&str, Place); 13] = [
    ("FHD", ("head", [0.1, 0.06, 0.15])),
    ("BHD", ("head", [-0.07, 0.06, 0.15])),
    ("SHO", ACROMION),
    ("ELB", OUTER_ELBOW),
    ("WRA", THUMB_WRIST),
    ("WRB", SMALL_FINGER_WRIST),
    ("FIN", ("hand", [0.0, 0.015, -0.075])),
    ("ASI", FRONT_SPINE),
    ("PSI", BACK_SPINE),
    ("KNE", OUTER_KNEE),
    ("ANK", OUTER_ANKLE),
    ("HEE", HEEL),
    ("TOE", FOREFOOT),
];

impl MarkerProtocol {
    /// All there are, with their names.
    pub const ALL: [(Self, &'static str); 7] = [
        (Self::Coco, "coco"),
        (Self::Body25, "body_25"),
        (Self::Halpe26, "halpe_26"),
        (Self::MediaPipe, "mediapipe"),
        (Self::Smpl, "smpl"),
        (Self::OpenCap, "opencap"),
        (Self::PlugInGait, "plug_in_gait"),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::ALL.into_iter().find(|(protocol, _)| *protocol == self).map_or("", |(_, name)| name)
    }

    fn pairs(self) -> &'static [Pairs] {
        match self {
            Self::Coco => &[(SNAKE, &LIMBS)],
            Self::Body25 | Self::Halpe26 => &[(SNAKE, &LIMBS), (SNAKE, &FEET)],
            Self::MediaPipe => &[
                (SNAKE, &LIMBS),
                (SNAKE, &MEDIAPIPE_REST),
                ([["", "_right"], ["", "_left"]], &[("mouth", ("head", [0.11, 0.025, 0.055]))]),
            ],
            Self::Smpl => &[(SNAKE, &SMPL)],
            Self::OpenCap => &[
                (CAPITAL, &CAPITAL_LIMBS),
                (CAPITAL, &[("HJC_study", HIP)]),
                ([["r_", ""], ["L_", ""]], &OPENCAP_ANATOMICAL),
                ([["r.", ""], ["L.", ""]], &[("ASIS_study", FRONT_SPINE), ("PSIS_study", BACK_SPINE)]),
            ],
            Self::PlugInGait => &[(CAPITAL, &PLUG_IN_GAIT)],
        }
    }

    fn single(self) -> &'static [Single] {
        match self {
            Self::Coco | Self::MediaPipe => &[("nose", NOSE)],
            Self::Body25 => &[("nose", NOSE), ("neck", MID_SHOULDER), ("mid_hip", MID_HIP)],
            Self::Halpe26 => &[
                ("nose", NOSE),
                ("head", HEAD_TOP),
                ("neck", ("torso", [0.0, 0.0, 0.4])),
                ("mid_hip", MID_HIP),
            ],
            Self::Smpl => &[
                ("pelvis", ("pelvis", [0.0, 0.0, -0.06])),
                ("neck", ("torso", [-0.02, 0.0, 0.44])),
                ("head", ("head", [0.03, 0.0, 0.09])),
            ],
            Self::OpenCap => &[
                ("Neck", MID_SHOULDER),
                ("midHip", MID_HIP),
                ("Hip", MID_HIP),
                ("Head", HEAD_TOP),
                ("Nose", NOSE),
                ("C7_study", C7),
            ],
            Self::PlugInGait => &[
                ("C7", C7),
                ("T10", ("torso", [-0.1, 0.0, 0.17])),
                ("CLAV", ("torso", [0.06, 0.0, 0.377])),
                ("STRN", ("torso", [0.1, 0.0, 0.21])),
                ("RBAK", ("torso", [-0.1, -0.1, 0.28])),
            ],
        }
    }
}

impl std::str::FromStr for MarkerProtocol {
    type Err = FitError;

    /// From its name.
    fn from_str(name: &str) -> Result<Self, FitError> {
        let found = Self::ALL.into_iter().find(|(_, known)| *known == name);
        found.map(|(protocol, _)| protocol).ok_or_else(|| FitError::UnknownProtocol { name: name.to_owned() })
    }
}

impl MarkerSet {
    /// The markers of a protocol on a diver, whose model they are for. The planar diver has them in its plane, right and left at the same place.
    ///
    /// ```
    /// use somersault_motion::fit::{MarkerProtocol, MarkerSet};
    /// use somersault_multibody::models::Diver;
    ///
    /// let markers = MarkerSet::on_diver(&Diver::spatial(), MarkerProtocol::PlugInGait)?;
    /// assert_eq!(markers.markers().len(), 31);
    /// # Ok::<(), somersault_motion::fit::FitError>(())
    /// ```
    pub fn on_diver(diver: &Diver, protocol: MarkerProtocol) -> Result<Self, FitError> {
        let model = diver.model()?;
        let standing = Diver { dimension: Dimension::Spatial, ..*diver }.model()?;
        let stretch = diver.height / Diver::spatial().height;
        let (mut data, mut of_standing) = (Data::new(&model), Data::new(&standing));
        let poses = model.positions(&mut data, &model.neutral())?;
        let of_standing = standing.positions(&mut of_standing, &standing.neutral())?;
        let marker = |name: String, body: &str, [x, y, z]: [f64; 3]| -> Result<Marker, FitError> {
            let segment = Vector3::from(diver.segments.of(body).unwrap_or([1.0; 3]));
            let point = Vector3::new(x, y, z).component_mul(&segment) * stretch;
            let (body, point) = match diver.dimension {
                Dimension::Spatial => (model.body(body)?, point),
                Dimension::Planar => {
                    let place = of_standing.pose(standing.body(body)?)?.point(&point);
                    let body = model.body(one_of_pair(body))?;
                    let pose = poses.pose(body)?;
                    let point = pose.rotation.tr_mul(&(place - pose.translation));
                    (body, Vector3::new(point.x, point.y, 0.0))
                }
            };
            Ok(Marker { name, body, point, weight: 1.0 })
        };
        let mut markers = Vec::new();
        for (name, (body, point)) in protocol.single() {
            markers.push(marker((*name).to_owned(), body, *point)?);
        }
        for ([right, left], parts) in protocol.pairs() {
            for (part, (body, [x, y, z])) in *parts {
                for (side, [before, after], sign) in [("right", right, -1.0), ("left", left, 1.0)] {
                    let body =
                        if IN_PAIRS.contains(body) { format!("{side}_{body}") } else { (*body).to_owned() };
                    markers.push(marker(format!("{before}{part}{after}"), &body, [*x, sign * y, *z])?);
                }
            }
        }
        Self::try_new(&model, markers)
    }

    /// The same on a diver with ball joints, whose model they are for: where it has a thorax, all markers of the torso are on that.
    pub fn on_ball_jointed(diver: &BallJointedDiver, protocol: MarkerProtocol) -> Result<Self, FitError> {
        // no protocol has markers on an abdomen
        let segments = diver.size.segments.with("abdomen", [1.0; 3])?;
        let hinged = Diver { dimension: Dimension::Spatial, segments, ..diver.size };
        let (hinges, balls) = (hinged.model()?, diver.model()?);
        let moved = |marker: Marker| -> Result<Marker, FitError> {
            let body = balls.body(hinges.name(marker.body).unwrap_or_default())?;
            Ok(Marker { body, ..marker })
        };
        let markers = Self::on_diver(&hinged, protocol)?.markers.into_iter().map(moved);
        Self::try_new(&balls, markers.collect::<Result<_, _>>()?)
    }
}

/// Segments of limbs, of which the spatial diver has two.
const IN_PAIRS: [&str; 7] = ["thigh", "shank", "foot", "toes", "upper_arm", "forearm", "hand"];

/// The name that both of a pair have on the planar diver.
fn one_of_pair(body: &str) -> &str {
    body.trim_start_matches("right_").trim_start_matches("left_")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::readers::pose::names_of;
    use somersault_multibody::models::SegmentScales;
    use std::collections::BTreeMap;

    /// Where the markers of a standing diver are.
    fn standing(diver: &Diver, protocol: MarkerProtocol) -> BTreeMap<String, Vector3<f64>> {
        let (model, markers) = (diver.model().unwrap(), MarkerSet::on_diver(diver, protocol).unwrap());
        let mut data = Data::new(&model);
        let poses = model.positions(&mut data, &model.neutral()).unwrap();
        let place = |marker: &Marker| poses.pose(marker.body).unwrap().point(&marker.point);
        markers.markers().iter().map(|marker| (marker.name.clone(), place(marker))).collect()
    }

    /// The name of the marker on the other side; its own in the median plane.
    fn other_side(name: &str) -> String {
        let pairs = [("right", "left"), ("r_", "L_"), ("r.", "L."), ("R", "L")];
        let (from, to) = pairs
            .into_iter()
            .flat_map(|(right, left)| [(right, left), (left, right)])
            .find(|(from, _)| name.starts_with(from) || name.ends_with(&format!("_{from}")))
            .unwrap_or_default();
        if name.starts_with(from) { name.replacen(from, to, 1) } else { name.replace(from, to) }
    }

    #[test]
    fn protocols_are_symmetric_and_the_planar_diver_has_them_in_its_plane() {
        for (protocol, name) in MarkerProtocol::ALL {
            assert_eq!((name.parse(), protocol.name()), (Ok(protocol), name));
            let diver = Diver { height: 1.6, ..Diver::spatial() };
            let places = standing(&diver, protocol);
            let planar = standing(&Diver { dimension: Dimension::Planar, ..diver }, protocol);
            for (marker, place) in &places {
                let within = Vector3::new(place.x, 0.0, place.z);
                assert!((planar[marker] - within).norm() < 1e-12, "{name}: {marker}");
                if marker != "RBAK" {
                    let mirrored = places[&other_side(marker)];
                    let expected = Vector3::new(place.x, -place.y, place.z);
                    assert!((mirrored - expected).norm() < 1e-12, "{name}: {marker}");
                }
            }
            // from head to foot it is about the height, to which the lengths of the diver do not add up
            let heights = places.values().map(|place| place.z);
            let span = heights.clone().fold(f64::MIN, f64::max) - heights.fold(f64::MAX, f64::min);
            assert!((0.75..1.03).contains(&(span / diver.height)), "{name}: {span}");
        }
    }

    #[test]
    fn on_balls_markers_are_where_they_are_on_hinges() {
        let segments = SegmentScales::default()
            .with("thigh", [1.1; 3])
            .and_then(|segments| segments.with("torso", [1.05, 1.1, 0.95]))
            .unwrap();
        let diver = Diver { segments, ..Diver::spatial() };
        let balls = BallJointedDiver::new(diver);
        // the abdomen with the size of the torso
        let segments = segments.with("abdomen", [1.05, 1.1, 0.95]).unwrap();
        let with_thorax = BallJointedDiver::new(Diver { segments, ..diver }).with_thorax();
        for balls in [balls, with_thorax] {
            let model = balls.model().unwrap();
            let mut data = Data::new(&model);
            let poses = model.positions(&mut data, &model.neutral()).unwrap();
            for (protocol, name) in MarkerProtocol::ALL {
                let known = standing(&diver, protocol);
                for marker in MarkerSet::on_ball_jointed(&balls, protocol).unwrap().markers() {
                    let place = poses.pose(marker.body).unwrap().point(&marker.point);
                    assert!((place - known[&marker.name]).norm() < 1e-12, "{name}: {}", marker.name);
                }
            }
        }
    }

    #[test]
    fn key_points_have_the_names_that_the_reader_gives_them() {
        for (protocol, n) in [
            (MarkerProtocol::Coco, 17),
            (MarkerProtocol::Body25, 25),
            (MarkerProtocol::Halpe26, 26),
            (MarkerProtocol::MediaPipe, 33),
        ] {
            let markers = MarkerSet::on_diver(&Diver::planar(), protocol).unwrap();
            let mut found: Vec<&str> = markers.markers().iter().map(|marker| marker.name.as_str()).collect();
            let mut expected = names_of(n).unwrap().to_vec();
            found.sort_unstable();
            expected.sort_unstable();
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn what_is_no_protocol_and_no_marker_is_refused() {
        let found = "vicon".parse::<MarkerProtocol>().unwrap_err().to_string();
        assert!(
            found.starts_with("`protocol` must be one of coco, body_25,") && found.ends_with("found `vicon`")
        );
        let none = Diver { height: -1.0, ..Diver::planar() };
        assert!(matches!(MarkerSet::on_diver(&none, MarkerProtocol::Coco), Err(FitError::Diver(_))));
        let markers = MarkerSet::on_diver(&Diver::planar(), MarkerProtocol::Coco).unwrap();
        let up = Vector3::new(0.0, 0.01, 0.0);
        let moved = markers.moved([("nose", up)]).unwrap();
        assert_eq!(moved.markers()[0].point, markers.markers()[0].point + up);
        assert_eq!(markers.moved([("chin", up)]), Err(FitError::NoSuchMarker { name: "chin".into() }));
        assert!(matches!(markers.moved([("nose", up * f64::NAN)]), Err(FitError::Argument(_))));
    }
}
