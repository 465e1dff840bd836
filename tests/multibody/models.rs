//! Named models: the divers' sizes, their inertia in published postures, the plane inside space; the arm's
//! linearised optimal motion.

use nalgebra::{DMatrix, Matrix3, Quaternion, UnitQuaternion, Vector3};
use num_dual::Dual64;
use somersault::multibody::models::{
    BallJointedDiver, Diver, Posture, PostureError, SegmentScales, TwoLinkArm,
};
use somersault::multibody::{Data, DynamicsError, Model, ModelError, Split};
use somersault_testkit::trees::{self, Case, Random};

/// Mass, centre of mass and inertia about it, world axes, of a diver frozen in the configuration q with
/// the torso upright.
fn frozen(model: &Model, q: &[f64]) -> (f64, [f64; 3], Matrix3<f64>) {
    let mut data = Data::new(model);
    let positions = model.positions(&mut data, q).unwrap();
    let center = positions.center_of_mass();
    let mut inertia = Matrix3::zeros();
    for i in 0..model.n_bodies() {
        let about_origin = model.inertia(i).unwrap().seen_from(&positions.pose(i).unwrap());
        inertia += about_origin.rotational();
    }
    let mass = model.mass();
    let shift = Matrix3::from_diagonal_element(center.norm_squared()) - center * center.transpose();
    (mass, center.into(), inertia - shift * mass)
}

/// I_y of a diver of this size with the given joint angles, in the plane.
fn transverse(mass: f64, height: f64, joints: &[f64; 9]) -> f64 {
    let model = Diver { mass, height, ..Diver::planar() }.model().unwrap();
    let q: Vec<f64> = [0.0; 3].iter().chain(joints).copied().collect();
    frozen(&model, &q).2.m22
}

#[test]
fn the_divers_have_the_degrees_of_freedom_of_tables_3_1_and_3_2() {
    for (diver, dofs, bodies) in [(Diver::planar(), 12, 10), (Diver::spatial(), 27, 22)] {
        let model = diver.model().unwrap();
        assert_eq!(model.n_velocities(), dofs);
        assert_eq!(diver.dof_names().len(), dofs);
        assert_eq!(model.n_bodies(), bodies);
        let base = model.velocities_of(0).len();
        // joints with a name of their own move the body of that name, or one next to it
        for i in 1..bodies {
            assert_eq!(model.velocities_of(i), base + i - 1..base + i);
            let dof = diver.dof_names()[base + i - 1];
            let body = model.name(i).unwrap();
            let expected = [
                ("pelvis_twist", "waist"),
                ("pelvis_bend", "pelvis"),
                ("hip", "thigh"),
                ("knee", "shank"),
                ("ankle", "foot"),
                ("toes", "toes"),
                ("neck", "head"),
                ("shoulder", "upper_arm"),
                ("shoulder_flexion", "shoulder_flexion"),
                ("shoulder_abduction", "shoulder_abduction"),
                ("shoulder_rotation", "upper_arm"),
                ("elbow", "forearm"),
                ("wrist", "hand"),
            ];
            let bare = |name: &str| name.replace("right_", "").replace("left_", "");
            assert!(expected.contains(&(bare(dof).as_str(), bare(body).as_str())), "{dof} {body}");
            assert_eq!(dof.split('_').next() == Some("left"), body.split('_').next() == Some("left"));
        }
    }
}

#[test]
fn segment_masses_are_those_of_de_leva() {
    let model = Diver { mass: 100.0, ..Diver::spatial() }.model().unwrap();
    let mass = |name: &str| model.inertia(model.body(name).unwrap()).unwrap().mass();
    // de Leva 1996, Table 4, male, per cent
    let (head, upper_trunk, middle_trunk, lower_trunk) = (6.94, 15.96, 16.33, 11.17);
    let (upper_arm, forearm, hand, thigh, shank, foot) = (2.71, 1.62, 0.61, 14.16, 4.33, 1.37);
    assert!((mass("head") - head).abs() < 1e-10);
    assert!((mass("torso") - upper_trunk - middle_trunk).abs() < 1e-10);
    assert!((mass("pelvis") - lower_trunk).abs() < 1e-10);
    for side in ["right", "left"] {
        let limb = |part: &str| mass(&format!("{side}_{part}"));
        assert!((limb("upper_arm") - upper_arm).abs() < 1e-10);
        assert!((limb("forearm") - forearm).abs() < 1e-10);
        assert!((limb("hand") - hand).abs() < 1e-10);
        assert!((limb("thigh") - thigh).abs() < 1e-10);
        assert!((limb("shank") - shank).abs() < 1e-10);
        assert!((limb("foot") + limb("toes") - foot).abs() < 1e-10);
        assert!((limb("toes") / foot - 0.15).abs() < 1e-4);
    }
}

#[test]
fn mass_and_inertia_scale_with_the_body() {
    for base in [Diver::planar(), Diver::spatial()] {
        let large = Diver { mass: 91.0, height: 1.95, ..base };
        let (stretch, heavier) = (1.95 / 1.70, 91.0 / 65.0);
        let (small, large_model) = (base.model().unwrap(), large.model().unwrap());
        for posture in Posture::ALL {
            let Ok(q) = base.configuration(posture) else { continue };
            let (m, c, inertia) = frozen(&small, &q);
            let (m_, c_, inertia_) = frozen(&large_model, &q);
            assert!((m - 65.0).abs() < 1e-12 && (m_ - 91.0).abs() < 1e-12);
            for k in 0..3 {
                assert!((c_[k] - c[k] * stretch).abs() < 1e-14);
            }
            let expected = inertia * (heavier * stretch * stretch);
            assert!((inertia_ - expected).amax() < 1e-13 * expected.amax());
        }
    }
}

#[test]
fn scaled_models_are_those_of_stretched_bodies() {
    for Case { model, q, .. } in trees::cases(20) {
        let mut random = Random::new(q.len() as u64);
        let scales: Vec<Vector3<f64>> =
            (0..model.n_bodies()).map(|_| Vector3::from_fn(|_, _| random.within(0.5, 2.0))).collect();
        let scaled = model.scaled(&scales).unwrap();
        let (mut data, mut of_scaled) = (Data::new(&model), Data::new(&scaled));
        let (poses, found) =
            (model.positions(&mut data, &q).unwrap(), scaled.positions(&mut of_scaled, &q).unwrap());
        for i in 0..model.n_bodies() {
            let (pose, other) = (poses.pose(i).unwrap(), found.pose(i).unwrap());
            assert!((pose.rotation - other.rotation).amax() < 1e-12);
            // what the joint adds stays, what the parent has is stretched
            let Some(parent) = model.parent(i) else { continue };
            let (of_parent, above) = (poses.pose(parent).unwrap(), found.pose(parent).unwrap());
            let place = of_parent.rotation.tr_mul(&(pose.translation - of_parent.translation));
            let origin = model.links()[i].origin();
            let expected = above.point(&(place - origin + origin.component_mul(&scales[parent])));
            assert!((other.translation - expected).norm() < 1e-12);
        }
        for ((link, other), scale) in model.links().iter().zip(scaled.links()).zip(&scales) {
            // the mass as points at the ends of the axes of inertia
            let (body, stretched) = (link.mass_properties(), other.mass_properties());
            assert_eq!(body.mass, stretched.mass);
            assert!((stretched.center - body.center.component_mul(scale)).norm() < 1e-14);
            let second = Matrix3::from_diagonal_element(0.5 * body.inertia.trace()) - body.inertia;
            let of_points = second.symmetric_eigen();
            let mut expected = Matrix3::zeros();
            for (size, axis) in of_points.eigenvalues.iter().zip(of_points.eigenvectors.column_iter()) {
                let p = axis.component_mul(scale) * size.max(0.0).sqrt();
                expected += Matrix3::from_diagonal_element(p.norm_squared()) - p * p.transpose();
            }
            assert!((stretched.inertia - expected).amax() < 1e-12 * (1.0 + expected.amax()));
        }
    }
}

#[test]
fn segments_of_divers_have_sizes_of_their_own() {
    let scales = [("thigh", [1.1; 3]), ("torso", [1.0, 1.2, 0.9]), ("toes", [0.8; 3])];
    let segments = scales
        .iter()
        .try_fold(SegmentScales::default(), |all, (name, scale)| all.with(name, *scale))
        .unwrap();
    let (spatial, planar) = (Diver { segments, ..Diver::spatial() }, Diver { segments, ..Diver::planar() });
    let origin = |diver: Diver, name: &str| {
        let model = diver.model().unwrap();
        *model.links()[model.body(name).unwrap()].origin()
    };
    for side in ["right", "left"] {
        let [knee, shoulder] = ["shank", "shoulder_flexion"].map(|part| format!("{side}_{part}"));
        let usual = origin(Diver::spatial(), &knee);
        assert!((origin(spatial, &knee) - usual * 1.1).norm() < 1e-15);
        let usual = origin(Diver::spatial(), &shoulder).component_mul(&Vector3::new(1.0, 1.2, 0.9));
        assert!((origin(spatial, &shoulder) - usual).norm() < 1e-15);
    }
    assert!((origin(planar, "shank") - origin(Diver::planar(), "shank") * 1.1).norm() < 1e-15);
    // both have the same mass at the same height
    let [a, b] = [spatial, planar].map(|diver| {
        let model = diver.model().unwrap();
        let mut data = Data::new(&model);
        let standing = diver.configuration(Posture::B).unwrap();
        (model.mass(), model.positions(&mut data, &standing).unwrap().center_of_mass())
    });
    assert!((a.0 - b.0).abs() < 1e-12 && (a.1.xz() - b.1.xz()).norm() < 1e-12, "{a:?} {b:?}");
    assert_eq!((segments.of("right_toes"), segments.of("waist")), (Some([0.8; 3]), None));
    let unknown = SegmentScales::default().with("tail", [1.0; 3]).unwrap_err().to_string();
    assert!(unknown.starts_with("a segment of a diver must be one of torso, pelvis,"), "{unknown}");
    for bad in [0.0, f64::NAN, 1e3] {
        let segments = SegmentScales::default().with("hand", [1.0, bad, 1.0]).unwrap();
        let refused = Diver { segments, ..Diver::spatial() }.model();
        assert!(matches!(refused, Err(ModelError::Argument(_))), "{bad}");
    }
    let model = Diver::planar().model().unwrap();
    assert!(matches!(model.scaled(&[]), Err(ModelError::Argument(_))));
}

#[test]
fn the_diver_with_balls_is_that_with_hinges_where_these_turn() {
    let hinged = Diver { mass: 58.0, height: 1.62, ..Diver::spatial() };
    let balls = BallJointedDiver::new(hinged);
    for (diver, bodies, dofs) in [(balls, 17, 34), (balls.with_thorax(), 19, 36)] {
        let (hinges, balls) = (hinged.model().unwrap(), diver.model().unwrap());
        assert_eq!((balls.n_bodies(), balls.n_velocities()), (bodies, dofs));
        assert_eq!(diver.dof_names().unwrap().len(), dofs);
        assert!((balls.mass() - hinges.mass()).abs() < 1e-12);
        let (mut data, mut of_balls) = (Data::new(&hinges), Data::new(&balls));
        for posture in Posture::ALL {
            let (q, p) = (hinged.configuration(posture).unwrap(), diver.configuration(posture).unwrap());
            let (known, found) =
                (hinges.positions(&mut data, &q).unwrap(), balls.positions(&mut of_balls, &p).unwrap());
            // thorax and abdomen are given to 1 µm
            let slack = if diver.has_thorax { 1e-6 } else { 1e-13 };
            assert!((known.center_of_mass() - found.center_of_mass()).norm() < slack);
            for (i, link) in balls.links().iter().enumerate() {
                let Ok(body) = hinges.body(link.name()) else { continue };
                let (a, b) = (known.pose(body).unwrap(), found.pose(i).unwrap());
                assert!((a.translation - b.translation).norm() + (a.rotation - b.rotation).amax() < 1e-13);
            }
            // its angles are those of the hinges, and no others; where two axes of a shoulder coincide they are other ones
            for (name, angles) in diver.angles(&p).unwrap() {
                let angle = angles[0];
                let hinge = hinged.dof_names().iter().position(|known| *known == name);
                let expected = hinge.map_or(0.0, |k| q[k + 1]);
                let coincides = name.contains("shoulder") && [Posture::C, Posture::G].contains(&posture);
                assert!((angle - expected).abs() < 1e-9 || coincides, "{posture} {name}: {angle} {expected}");
            }
        }
    }
}

#[test]
fn thorax_and_abdomen_are_those_of_de_leva_and_together_the_torso() {
    let diver = BallJointedDiver::new(Diver::spatial()).with_thorax();
    let (model, rigid) = (diver.model().unwrap(), Diver::spatial().model().unwrap());
    // de Leva 1996, Table 4, male, for 1.741 m: lengths from cervicale to xiphion and on to omphalion, mm; mass, centre
    // from the upper end and radii of gyration about x, y and z over the length, per cent
    for (name, length, top, mass, centre, radii) in [
        ("torso", 242.1, 242.1 + 215.5, 15.96, 50.66, [50.5, 32.0, 46.5]),
        ("abdomen", 215.5, 0.0, 16.33, 45.02, [48.2, 38.3, 46.8]),
    ] {
        let body = model.links()[model.body(name).unwrap()].mass_properties();
        let metres = 1e-3 * 1.70 / 1.741;
        assert!((body.mass - 0.65 * mass).abs() < 1e-12, "{name}");
        let expected = Vector3::new(0.0, 0.0, (top - 0.01 * centre * length) * metres);
        assert!((body.center - expected).norm() < 1e-6, "{name}: {}", body.center);
        for (k, radius) in radii.into_iter().enumerate() {
            let moment = body.mass * (0.01 * radius * length * metres).powi(2);
            assert!((body.inertia[(k, k)] - moment).abs() < 1e-6, "{name}: {moment}");
        }
    }
    // together they have the mass and the inertia that the trunk has in one piece
    let (mut data, mut of_rigid) = (Data::new(&model), Data::new(&rigid));
    let root = |q: &[f64]| q[..7].to_vec();
    let (q, p) =
        (diver.configuration(Posture::A).unwrap(), Diver::spatial().configuration(Posture::A).unwrap());
    assert_eq!(root(&q), root(&p));
    let inertia = model.centroidal(&mut data, &q).unwrap().matrix.fixed_columns::<6>(0).into_owned();
    let whole = rigid.centroidal(&mut of_rigid, &p).unwrap().matrix.fixed_columns::<6>(0).into_owned();
    assert!((inertia - &whole).amax() < 1e-5 * whole.amax());
    // the abdomen bends forwards and leans as the waist does, and the waist makes up for it
    let turn = UnitQuaternion::new(-Vector3::y() * 0.3) * UnitQuaternion::new(Vector3::x() * -0.2);
    let mut bent = q.clone();
    bent[7..9].copy_from_slice(&[0.3, -0.2]);
    bent[9..13].copy_from_slice(turn.inverse().coords.as_slice());
    let positions = model.positions(&mut data, &bent).unwrap();
    let pose = positions.pose(model.body("pelvis").unwrap()).unwrap();
    let tip = Vector3::new(0.0, 0.0, 0.210425);
    assert!((pose.rotation - Matrix3::identity()).amax() < 1e-12);
    assert!((pose.translation - (tip - turn * tip)).norm() < 1e-6 && pose.translation.x > 0.05);
    let angles = diver.angles(&bent).unwrap();
    let angle = |name: &str| angles.iter().find(|(known, _)| known == name).unwrap().1[0];
    assert_eq!([angle("abdomen_bend"), angle("abdomen_lean")], [0.3, -0.2]);
    // of other divers the abdomen is a part of the torso
    let segments = SegmentScales::default().with("abdomen", [1.1; 3]).unwrap();
    let larger = |diver: Diver| Diver { segments, ..diver };
    for diver in [Diver::planar(), Diver::spatial()] {
        assert!(
            matches!(larger(diver).model(), Err(ModelError::UnknownSegment { name, .. }) if name == "abdomen")
        );
    }
    let balls = BallJointedDiver::new(larger(Diver::spatial()));
    assert!(matches!(balls.model(), Err(ModelError::UnknownSegment { .. })));
    let longer = balls.with_thorax().model().unwrap();
    let below = |model: &Model| model.links()[model.body("pelvis").unwrap()].origin().z;
    assert!((below(&longer) - 1.1 * below(&model)).abs() < 1e-14);
}

#[test]
fn angles_of_balls_make_their_rotations() {
    let diver = BallJointedDiver::new(Diver::spatial()).with_thorax();
    let model = diver.model().unwrap();
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let mut random = Random::new(8);
    for _ in 0..200 {
        let q = trees::random_configuration(&mut random, &model).unwrap();
        let angles = diver.angles(&q).unwrap();
        let angle = |name: &str| angles.iter().find(|(known, _)| known == name).unwrap().1[0];
        for (body, names, axes) in [
            ("pelvis", ["pelvis_twist", "pelvis_bend", "pelvis_lean"], [z, -y, x]),
            ("head", ["neck", "neck_lean", "neck_turn"], [y, x, z]),
            ("right_thigh", ["right_hip", "right_hip_abduction", "right_hip_rotation"], [-y, -x, z]),
            ("left_thigh", ["left_hip", "left_hip_abduction", "left_hip_rotation"], [-y, x, -z]),
        ] {
            let own = &q[model.positions_of(model.body(body).unwrap())];
            let turn = UnitQuaternion::new_normalize(Quaternion::new(own[3], own[0], own[1], own[2]));
            let made = names.iter().zip(axes).fold(UnitQuaternion::identity(), |made, (name, axis)| {
                made * UnitQuaternion::new(axis * angle(name))
            });
            assert!(made.angle_to(&turn) < 1e-7, "{body}");
        }
    }
    let two = [diver.configuration(Posture::A).unwrap(), diver.configuration(Posture::F).unwrap()].concat();
    let knees = diver.angles(&two).unwrap().into_iter().find(|(name, _)| name == "right_knee").unwrap().1;
    assert!(knees[0].abs() < 1e-12 && (knees[1] - 135_f64.to_radians()).abs() < 1e-12);
    for bad in [&two[..3], &two[1..]] {
        assert!(matches!(diver.angles(bad), Err(ModelError::Argument(_))));
    }
}

/// I_y in lb in s², weight in lb and height in inches of three living men, positions 1 (standing) and 2 (arms
/// overhead) of Table A.2.1 at <https://www.guwsmedical.info/body-dynamics/body-coordinate-system-table-a21.html>.
/// The page does not name its source, by its contents the appendix of A. Tözeren, *Human Body Dynamics*,
/// Springer 2000; that copy was not at hand.
const MEASURED: [([f64; 2], f64, f64); 3] =
    [([119.0, 159.0], 173.5, 72.2), ([81.9, 110.0], 147.3, 67.4), ([129.0, 172.0], 203.0, 73.3)];

/// I_y/(m h²) in layout (A, B), tuck (F) and closed pike (H) of the five people whose measurements come with `yeadon` 2.0.1
/// (Dembia, Moore and Hubbard, F1000Research 3:223, 2014), which computes Yeadon's model of stadium solids
/// (J. Biomechanics 23, 1990). Computed with that package: `PTsagittalFlexion`, `PJ1extension`,
/// `J1J2flexion`, `CA1extension` and `A1A2extension` set to our angles. Its head is fixed and its feet are in
/// line with the shanks. In the open pike (G) theirs are 0.0332 to 0.0373, ours is 0.0326.
const MODELLED: [(Posture, [f64; 5]); 4] = [
    (Posture::A, [0.07907, 0.06732, 0.07061, 0.07659, 0.06944]),
    (Posture::B, [0.06231, 0.05197, 0.05491, 0.05846, 0.05485]),
    (Posture::F, [0.01878, 0.01908, 0.01795, 0.02032, 0.01811]),
    (Posture::H, [0.02608, 0.02464, 0.02454, 0.02622, 0.02376]),
];

#[test]
fn inertias_in_layout_tuck_and_pike_are_in_the_range_of_published_models() {
    let model = Diver::spatial().model().unwrap();
    for (posture, ratios) in MODELLED {
        let mut q = Diver::spatial().configuration(posture).unwrap();
        let dof = |name: &str| {
            let names = Diver::spatial().dof_names();
            names.iter().position(|n| *n == name).unwrap() + 1
        };
        q[dof("neck")] = 0.0;
        for side in ["right", "left"] {
            q[dof(&format!("{side}_ankle"))] = std::f64::consts::FRAC_PI_2;
            q[dof(&format!("{side}_toes"))] = 0.0;
        }
        let ratio = frozen(&model, &q).2.m22 / (65.0 * 1.70 * 1.70);
        let low = ratios.into_iter().fold(f64::INFINITY, f64::min);
        let high = ratios.into_iter().fold(0.0, f64::max);
        assert!(low < ratio && ratio < high, "{posture}: {ratio:.5} not in {low} to {high}");
    }
}

#[test]
fn standing_inertias_are_in_the_range_of_measurements_and_models() {
    let attention = [0.0; 9];
    let mut overhead = attention;
    overhead[6] = std::f64::consts::PI;
    for (k, joints, modelled) in [(0, attention, MODELLED[1].1), (1, overhead, MODELLED[0].1)] {
        // the diver in the size of each of them, over what was found for them
        let mut ratios: Vec<f64> = MEASURED
            .iter()
            .map(|(inertias, pounds, inches)| {
                let (mass, height) = (pounds * 0.453_592_37, inches * 0.0254);
                let metric = inertias[k] * 4.448_221_615_260_5 * 0.0254;
                transverse(mass, height, &joints) / metric
            })
            .collect();
        // measured: standing men have 5 % to 17 % less, with arms overhead 3 % to 15 % less
        assert!(ratios.iter().all(|r| (1.0..1.18).contains(r)), "{ratios:?}");
        ratios.extend(modelled.iter().map(|ratio| transverse(1.0, 1.0, &joints) / ratio));
        assert!(ratios.iter().any(|r| *r < 1.0) && ratios.iter().any(|r| *r > 1.0), "{ratios:?}");
    }
}

#[test]
fn postures_lie_within_the_recorded_ranges() {
    for diver in [Diver::planar(), Diver::spatial()] {
        let model = diver.model().unwrap();
        for posture in Posture::ALL {
            let Ok(q) = diver.configuration(posture) else { continue };
            assert_eq!(q.len(), model.n_positions());
            for i in 1..model.n_bodies() {
                let [lower, upper] = model.limits(i).unwrap();
                let angle = q[model.positions_of(i).start];
                assert!((lower..=upper).contains(&angle), "{posture} {:?}", model.name(i));
            }
        }
    }
}

#[test]
fn limbs_go_where_their_angles_say() {
    let diver = Diver::spatial();
    let model = diver.model().unwrap();
    let mut data = Data::new(&model);
    let mut place = |posture: Posture, body: &str| {
        let q = diver.configuration(posture).unwrap();
        model.positions(&mut data, &q).unwrap().pose(model.body(body).unwrap()).unwrap().translation
    };
    let head = place(Posture::A, "head").z;
    for side in ["right", "left"] {
        let sign = if side == "left" { 1.0 } else { -1.0 };
        let hand = format!("{side}_hand");
        let foot = format!("{side}_foot");
        assert!(place(Posture::A, &hand).z > head + 0.3, "arms overhead");
        assert!(place(Posture::B, &hand).z < 0.0, "arms down");
        assert!(place(Posture::C, &hand).y * sign > 0.6, "arms sideways");
        assert!(place(Posture::F, &foot).x > 0.2, "feet in front in a tuck");
        assert!((place(Posture::F, &foot) - place(Posture::F, &hand)).norm() < 0.35, "hands at the shanks");
        assert!(place(Posture::H, &foot).z > 0.3, "legs up in a closed pike");
        assert!(place(Posture::H, &foot).x > 0.3, "and in front");
    }
    assert!(place(Posture::E, "left_hand").z > head && place(Posture::E, "right_hand").z < 0.0);
    assert!(place(Posture::D, "right_hand").z > head && place(Posture::D, "left_hand").z < 0.0);
    assert!(place(Posture::I, "left_hand").z > place(Posture::I, "right_hand").z);
    assert!(place(Posture::I, "right_hand").y > -0.1, "right arm across the chest");
}

#[test]
fn d_is_the_mirror_image_of_e() {
    let diver = Diver::spatial();
    let model = diver.model().unwrap();
    let of = |p| frozen(&model, &diver.configuration(p).unwrap());
    let (_, c, inertia) = of(Posture::D);
    let (_, c_, inertia_) = of(Posture::E);
    let mirror = Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, -1.0, 1.0));
    assert!((mirror * inertia * mirror - inertia_).amax() < 1e-14);
    assert!((c[1] + c_[1]).abs() < 1e-15 && (c[0] - c_[0]).abs() < 1e-15);
}

#[test]
fn the_planar_diver_has_the_mass_and_the_inertia_of_the_spatial_one() {
    let (planar, spatial) = (Diver::planar().model().unwrap(), Diver::spatial().model().unwrap());
    for posture in Posture::PLANAR {
        let (m, c, inertia) = frozen(&planar, &Diver::planar().configuration(posture).unwrap());
        let mut q = Diver::spatial().configuration(posture).unwrap();
        if posture == Posture::G {
            // in the plane the arms of the open pike are forward
            for shoulder in [18, 23] {
                q.swap(shoulder, shoulder + 1);
            }
        }
        let (m_, c_, inertia_) = frozen(&spatial, &q);
        assert!((m - m_).abs() < 1e-13);
        for k in 0..3 {
            assert!((c[k] - c_[k]).abs() < 1e-14, "{posture} {c:?} {c_:?}");
        }
        assert!((inertia - inertia_).amax() < 1e-13 * inertia.amax(), "{posture}");
    }
}

/// Where the spatial diver has the planar diver's joints: once or twice, counted from the first joint.
const PAIRED: [&[usize]; 9] =
    [&[1], &[2, 6], &[3, 7], &[4, 8], &[5, 9], &[10], &[11, 16], &[14, 19], &[15, 20]];

/// The spatial q, v or a of a planar one: joints copied to both sides.
fn spread(base: &[f64], joints: &[f64]) -> Vec<f64> {
    let mut out = base.to_vec();
    out.resize(base.len() + 21, 0.0);
    for (at, &x) in PAIRED.iter().zip(joints) {
        for &k in *at {
            out[base.len() + k] = x;
        }
    }
    out
}

#[test]
fn the_planar_diver_moves_as_the_spatial_one_does_in_its_plane() {
    let (planar, spatial) = (Diver::planar().model().unwrap(), Diver::spatial().model().unwrap());
    let (mut data, mut data_) = (Data::new(&planar), Data::new(&spatial));
    let lateral = ["waist", "right_shoulder_abduction", "left_shoulder_abduction", "right_upper_arm"];
    let held = Split::try_active(&spatial, &[&lateral[..], &["left_upper_arm"]].concat()).unwrap();
    let mut random = Random::new(12);
    for _ in 0..200 {
        let (q, v, a) = (random.numbers(12, 1.5), random.numbers(12, 3.0), random.numbers(12, 5.0));
        let (s, c) = (0.5 * q[2]).sin_cos();
        let q_ = spread(&[q[0], 0.0, q[1], 0.0, -s, 0.0, c], &q[3..]);
        let vector = |v: &[f64]| spread(&[v[0], 0.0, v[1], 0.0, -v[2], 0.0], &v[3..]);
        let (v_, a_) = (vector(&v), vector(&a));

        let torque = planar.inverse_dynamics(&mut data, &q, &v, &a, &[]).unwrap().to_vec();
        let torque_ = spatial.inverse_dynamics(&mut data_, &q_, &v_, &a_, &[]).unwrap().to_vec();
        let scale = torque.iter().fold(1.0, |m: f64, t| m.max(t.abs()));
        let close = |x: f64, y: f64| assert!((x - y).abs() < 1e-12 * scale, "{x} {y}");
        close(torque[0], torque_[0]);
        close(torque[1], torque_[2]);
        close(torque[2], -torque_[4]);
        for out_of_plane in [1, 3, 5, 6] {
            close(torque_[out_of_plane], 0.0);
        }
        for (at, &t) in PAIRED.iter().zip(&torque[3..]) {
            close(at.iter().map(|k| torque_[6 + k]).sum(), t);
        }

        // forward, with the lateral joints held
        let forces = random.numbers(12, 30.0);
        let mut half = forces.clone();
        for (at, force) in PAIRED.iter().zip(&mut half[3..]) {
            *force /= at.len() as f64;
        }
        let expected = vector(planar.forward_dynamics(&mut data, &q, &v, &forces, &[]).unwrap());
        let (mut found, mut forces_) = (vec![0.0; 27], vector(&half));
        spatial.hybrid_dynamics(&mut data_, &held, &q_, &v_, &mut found, &mut forces_, &[]).unwrap();
        let largest = expected.iter().fold(1.0, |m: f64, a| m.max(a.abs()));
        for (x, y) in found.iter().zip(&expected) {
            assert!((x - y).abs() < 1e-10 * largest, "{x} {y}");
        }
    }
}

#[test]
fn an_arm_straight_out_sideways_needs_its_shoulder_driven() {
    let diver = Diver::spatial();
    let model = diver.model().unwrap();
    let mut data = Data::new(&model);
    let q = diver.configuration(Posture::C).unwrap();
    let spectrum = |m: &DMatrix<f64>| m.symmetric_eigenvalues();
    let all = spectrum(model.mass_matrix(&mut data, &q).unwrap());
    assert!(all.min() < 1e-15 * all.max(), "{all}");
    // the same in any posture where the arms are elsewhere is regular
    let b = spectrum(model.mass_matrix(&mut data, &diver.configuration(Posture::B).unwrap()).unwrap());
    assert!(b.min() > 1e-6 * b.max(), "{b}");
    // π/2 is not exact, so that what is left of the inertia is rounding: refused all the same
    let refused = model.forward_dynamics(&mut data, &q, &[0.0; 27], &[1.0; 27], &[]);
    assert_eq!(refused, Err(DynamicsError::Singular { joint: "left_shoulder_flexion".into() }));

    let arms = ["right", "left"].map(|side| {
        ["shoulder_flexion", "shoulder_abduction", "upper_arm"].map(|part| format!("{side}_{part}"))
    });
    let names: Vec<&str> = arms.iter().flatten().map(String::as_str).collect();
    let split = Split::try_active(&model, &names).unwrap();
    let (rest, mut a, mut torque) = ([0.0; 27], [0.0; 27], [0.0; 27]);
    model.hybrid_dynamics(&mut data, &split, &q, &rest, &mut a, &mut torque, &[]).unwrap();
    // shoulders held, all else slack, in free fall: nothing moves against anything
    assert!((a[2] + 9.81).abs() < 1e-12);
    assert!(a[3..].iter().chain(&torque).all(|x| x.abs() < 1e-12), "{a:?} {torque:?}");
}

#[test]
fn postures_are_found_by_their_letters() {
    for posture in Posture::ALL {
        assert_eq!(posture.to_string().parse(), Ok(posture));
        let planar = Diver::planar().configuration(posture);
        if Posture::PLANAR.contains(&posture) {
            assert!(planar.is_ok());
        } else {
            assert_eq!(planar, Err(PostureError::NotPlanar { posture }));
        }
    }
    assert_eq!("J".parse::<Posture>(), Err(PostureError::UnknownName { name: "J".into() }));
}

#[test]
fn divers_of_impossible_size_are_refused() {
    for found in [0.0, -1.0, f64::INFINITY, f64::NAN] {
        for (diver, argument) in [
            (Diver { mass: found, ..Diver::planar() }, "mass"),
            (Diver { height: found, ..Diver::spatial() }, "height"),
        ] {
            let error = diver.model().unwrap_err();
            assert!(matches!(&error, ModelError::NotPositive { argument: a, .. } if *a == argument));
            assert!(error.to_string().contains(argument));
        }
    }
    let falling_apart = Diver { gravity: f64::NAN, ..Diver::planar() };
    assert!(matches!(falling_apart.model(), Err(ModelError::NonFinite { argument: "gravity", .. })));
}

/// θ̈₁ on an extremal of (8.7): u = −Γ⁻¹ M⁻¹ (λ₃, λ₄) minimises λᵀf + ½ uᵀΓu, with γ₁ = 1 and γ₂ = ½.
fn extremal_acceleration(arm: &Model<Dual64>, data: &mut Data<Dual64>, p: &[Dual64; 8]) -> Dual64 {
    let [t1, t2, w1, w2, _, _, l3, l4] = *p;
    let m = arm.mass_matrix(data, &[t1, t2]).unwrap();
    let determinant = m[(0, 0)] * m[(1, 1)] - m[(0, 1)] * m[(0, 1)];
    let u1 = (m[(0, 1)] * l4 - m[(1, 1)] * l3) / determinant;
    let u2 = (m[(0, 1)] * l3 - m[(0, 0)] * l4) / determinant * 2.0;
    arm.forward_dynamics(data, &[t1, t2], &[w1, w2], &[u1, u2], &[]).unwrap()[0]
}

#[test]
fn the_linearised_arm_has_the_eight_entries_of_appendix_f() {
    let arm = TwoLinkArm::default().model().unwrap().cast::<Dual64>();
    let mut data = Data::new(&arm);
    let mut random = Random::new(8);
    for _ in 0..1000 {
        let p: [f64; 8] = random.numbers(8, 3.0).try_into().unwrap();
        let [_, t2, w1, w2, _, _, l3, l4] = p;
        let (s, c) = t2.sin_cos();
        let (sin, cos) = (|k: f64| (k * t2).sin(), |k: f64| (k * t2).cos());
        let (w11, w22, w12) = (w1 * w1, w2 * w2, w1 * w2);
        // (F.54) to (F.61)
        let d32 = -(9330.0 * (w11 + w22) * c + 19872.0 * w1 * sin(2.0) - 3888.0 * w1 * sin(4.0)
            + 8_812_800.0 * l3 * sin(2.0)
            + 933_120.0 * l3 * sin(3.0)
            - 30_585_600.0 * l4 * sin(2.0)
            + 933_120.0 * l3 * sin(4.0)
            - 31_492_800.0 * l4 * sin(3.0)
            - 1_866_240.0 * l4 * sin(4.0)
            + 219_600.0 * w11 * cos(2.0)
            + 3645.0 * w11 * cos(3.0)
            - 37_260.0 * w11 * cos(4.0)
            + 3645.0 * w22 * cos(3.0)
            - 1215.0 * (w11 + w22) * cos(5.0)
            + 3_144_960.0 * l3 * s
            - 106_142_400.0 * l4 * s
            - 111_780.0 * w11
            + 18_660.0 * w12 * c
            + 7290.0 * w12 * cos(3.0)
            - 2430.0 * w12 * cos(5.0))
            / (20.0 * (9.0 * cos(2.0) - 23.0).powi(3));
        let bracket = 9.0 * c * c - 16.0;
        let printed = [
            0.0,
            d32,
            -3.0 * (10.0 * (w1 + w2) * s + 60.0 * w1 * c * s - 4.0) / (10.0 * bracket),
            s * (3.0 * w1 + 3.0 * w2) / (9.0 * s * s + 7.0),
            0.0,
            0.0,
            -(2592.0 * c * c + 864.0 * c + 108.0) / (bracket * bracket),
            (5184.0 * c * c + 29_160.0 * c + 4716.0) / (bracket * bracket),
        ];
        for (k, expected) in printed.into_iter().enumerate() {
            let mut direction = p.map(Dual64::from_re);
            direction[k].eps = 1.0;
            let found = extremal_acceleration(&arm, &mut data, &direction).eps;
            assert!(
                (found - expected).abs() < 1e-12 * (1.0 + expected.abs()),
                "d3{}: {found} {expected}",
                k + 1
            );
        }
    }
}
