//! Lists of motions with scores.

use crate::files::{BVH, CSV, TRC};
use crate::synthetic::judged;
use somersault_motion::judged::{self as list, JudgedError, JudgedOptions, JudgedSet, load_set};
use somersault_motion::readers::{LoadError, Place, ReadError, awards};
use somersault_motion::scoring::{ScoringModel, ScoringOptions};
use somersault_motion::synthetic::SyntheticOptions;
use somersault_motion::writers::WriteError;
use std::fs;
use std::path::{Path, PathBuf};

const LIST: &str = "# my club
motion,height,score

a.csv,1.5,7.5
sub/b.trc,1.25,6
";

/// A folder that goes when the test ends.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("somersault-{name}-{}", std::process::id()));
        fs::create_dir_all(path.join("sub")).unwrap();
        Self(path)
    }

    fn put(&self, name: &str, content: &str) {
        fs::write(self.0.join(name), content).unwrap();
    }

    fn path(&self, name: &str) -> PathBuf {
        Path::new(&self.0).join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn a_list_is_read_with_its_features_and_lines() {
    let found = list::read(LIST).unwrap();
    assert_eq!(found.feature_names, ["height"]);
    assert_eq!((found.motions[0].score, &found.motions[0].features[..]), (7.5, &[1.5][..]));
    assert_eq!((found.motions[1].file.as_str(), found.motions[1].line), ("sub/b.trc", 5));
    assert!(found.motions.iter().all(|m| !m.synthetic));
    let text = list::write(&found).unwrap();
    assert!(!text.contains("SYNTHETIC"));
    let again = list::read(&text).unwrap();
    assert_eq!(again.motions[1].features, found.motions[1].features);
    let named = list::read("athlete,motion,score\nAnn,a.csv,7\nBea B.,b.csv,6\n").unwrap();
    assert_eq!(named.motions[1].athlete.as_deref(), Some("Bea B."));
    let again = list::read(&list::write(&named).unwrap()).unwrap();
    assert_eq!(again.motions[0].athlete, named.motions[0].athlete);
}

#[test]
fn a_wrong_list_is_named_with_its_line() {
    let line = |text: &str| match list::read(text) {
        Err(
            ReadError::Unexpected { place: Place::Line(line), .. }
            | ReadError::NonFinite { place: Place::Line(line), .. }
            | ReadError::Truncated { place: Place::Line(line), .. },
        ) => line,
        other => panic!("{other:?}"),
    };
    let change = |from: &str, to: &str| {
        assert!(LIST.contains(from));
        line(&LIST.replacen(from, to, 1))
    };
    assert_eq!(line(""), 1);
    assert_eq!(line("motion,score\n"), 1);
    assert_eq!(change("score", "points"), 2);
    assert_eq!(change("height", "score"), 2);
    assert_eq!(change("7.5", "good"), 4);
    assert_eq!(change("7.5", "nan"), 4);
    assert_eq!(change("1.5,", ""), 4);
    assert_eq!(change("sub/b.trc", "a.csv"), 5);
    for same in ["./a.csv", "x//a.csv", "x/./a.csv"] {
        let list = LIST.replace("a.csv", "x/a.csv").replace("sub/b.trc", same);
        let twice = list::read(&list).map(drop);
        assert!(
            matches!(twice, Err(ReadError::Unexpected { place: Place::Line(5), .. })),
            "{same}: {twice:?}"
        );
    }
    for path in ["/etc/passwd", "../b.trc", "sub/../../b.trc", "..\\b.trc", ""] {
        assert_eq!(change("sub/b.trc", path), 5, "{path}");
    }
    assert_eq!(line("motion,score,synthetic\na.csv,1,maybe\n"), 2);
    assert_eq!(line("motion,score,athlete\na.csv,1,Ann\nb.csv,1,\n"), 3);
}

#[test]
fn awards_are_read_as_tables_have_them() {
    // a panel of seven, whose columns are not in order; points by hand: 7.5 + 7.0 + 7.5 count
    let strict = "diver,J7,J1,J2,J3,J4,J5,J6,Dive No.,DD,Points\nAnn,7.5,7,8.5,6.5,7.5,8,7,107B,3.6,79.2\n";
    let table = awards::read(strict.as_bytes(), true).unwrap();
    let dive = &table.dives[0];
    assert_eq!(dive.awards, [7.0, 8.5, 6.5, 7.5, 8.0, 7.0, 7.5]);
    assert!((dive.panel.points - 79.2).abs() < 1e-12 && (dive.score() - 22.0 / 3.0).abs() < 1e-12);
    assert_eq!((dive.athlete.as_deref(), dive.dive.as_deref(), dive.line), (Some("Ann"), Some("107B"), 2));
    assert!(table.repairs.is_empty());
    // lists, a column that nobody needs, eleven judges of two divers, a panel of five, points that are another's
    let lists = "action_type,judge_scores,difficulty,dive_score,start_frame\n\
                 107B,\"[7.0, 8.0, 7.5, 6.0, 7.0]\",2.0,43.0,12\n\
                 5253B,\"[7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7]\",3.0,63.0,40\n\
                 \n\
                 205B,'7.5 8.0 7.5',2.0,46.0,80\n";
    let table = awards::read(lists.as_bytes(), false).unwrap();
    assert_eq!(table.dives.iter().map(|dive| dive.panel.points).collect::<Vec<_>>(), [43.0, 46.0]);
    let said: Vec<String> = table.repairs.iter().map(ToString::to_string).collect();
    assert_eq!(
        said,
        ["line 1: the column `start_frame` is left out", "line 3: dives of 11 judges are left out"]
    );
    let wrong = lists.replace("46.0", "45.0");
    let table = awards::read(wrong.as_bytes(), false).unwrap();
    assert_eq!((table.dives[1].stated, table.dives[1].panel.points), (Some(45.0), 46.0));
    assert_eq!(table.repairs.len(), 3);
    // semicolons, decimal commas, Latin-1, empty columns of a smaller panel
    let latin = b"Name;Tariff;E1;E2;E3;E4;E5\nJos\xe9;1,8;7;7,5;7;;\n";
    let table = awards::read(latin, false).unwrap();
    assert_eq!(table.dives[0].athlete.as_deref(), Some("José"));
    assert!((table.dives[0].panel.points - 21.5 * 1.8).abs() < 1e-12);

    let line = |text: &str, strict: bool| match awards::read(text.as_bytes(), strict) {
        Err(error) => (error.place(), error.to_string()),
        Ok(table) => panic!("{text}: {table:?}"),
    };
    for (text, strict, place) in [
        ("", false, 1),
        ("dd,j1,j2,j3\n", false, 1),
        ("j1,j2,j3\n7,7,7\n", false, 1),
        ("dd,score\n2,7\n", false, 1),
        ("dd,j1,judge 1,j2\n2,7,7,7\n", false, 1),
        ("dd,j1,j2,j3,awards\n2,7,7,7,7\n", false, 1),
        ("dd,j1,j2,j3\n2,7,7\n", false, 2),
        ("dd,j1,j2,j3\n2,7,7.2,7\n", false, 2),
        ("dd,j1,j2,j3\n0,7,7,7\n", false, 2),
        ("dd,j1,j2,j3\n2,7,seven,7\n", false, 2),
        ("dd,j1,j2,j3\n2,7,7,7\n2,7,7,\n", true, 3),
        ("dd,j1,j2,j3,points\n2,7,7,7,41\n", true, 2),
        ("dd,awards\n2,\"[7, 7, nan]\"\n", false, 2),
    ] {
        let (found, message) = line(text, strict);
        assert_eq!(found, Some(Place::Line(place)), "{text}: {message}");
    }
}

#[test]
fn motions_of_a_list_have_the_markers_of_the_first_without_gaps() {
    let folder = Folder::new("judged");
    folder.put("judged.csv", LIST);
    folder.put("a.csv", CSV);
    folder.put("sub/b.trc", TRC);
    let options = JudgedOptions::default();
    let load = |options: &JudgedOptions| load_set(folder.path("judged.csv"), options);
    let found = load(&options).unwrap();
    assert_eq!(found.scores(), [7.5, 6.0]);
    assert_eq!(found.features(), [("height".to_owned(), vec![1.5, 1.25])]);
    assert!(found.recordings.iter().all(|r| r.n_missing() == 0 && r.names() == ["hip", "knee"]));
    assert!(found.performances().unwrap().iter().all(|p| !p.is_synthetic()));

    let gap = load(&JudgedOptions { longest_gap: 0.015, ..options });
    assert!(
        matches!(&gap, Err(JudgedError::Gap { line: 4, frame: 1, marker, .. }) if marker == "knee"),
        "{gap:?}"
    );
    for longest_gap in [-1.0, f64::NAN, f64::INFINITY] {
        let found = load(&JudgedOptions { longest_gap, ..options });
        assert!(matches!(found, Err(JudgedError::LongestGap { .. })), "{longest_gap}: {found:?}");
    }
    assert!(matches!(load(&JudgedOptions { longest_gap: 0.0, ..options }), Err(JudgedError::Gap { .. })));
    folder.put("sub/b.trc", &TRC.replace("knee", "nose"));
    assert!(matches!(load(&options), Err(JudgedError::Recording { line: 5, .. })));
    folder.put("sub/b.trc", &TRC.replace("901", "9o1"));
    let Err(JudgedError::Motion { line: 5, source }) = load(&options) else { panic!() };
    assert!(matches!(
        source,
        LoadError::Read { source: ReadError::Unexpected { place: Place::Line(8), .. }, .. }
    ));
    folder.put("judged.csv", &LIST.replace("sub/b.trc", "c.trc"));
    assert!(matches!(load(&options), Err(JudgedError::Motion { line: 5, source: LoadError::Io { .. } })));
    folder.put("c.docx", "PK");
    folder.put("judged.csv", &LIST.replace("sub/b.trc", "c.docx"));
    assert!(matches!(load(&options), Err(JudgedError::UnknownFormat { line: 5, .. })));
    assert!(matches!(load_set(folder.path("none"), &options), Err(JudgedError::List(LoadError::Io { .. }))));
    // one file under two names
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(folder.path("a.csv"), folder.path("other.csv")).unwrap();
        folder.put("judged.csv", &LIST.replace("sub/b.trc", "other.csv"));
        let twice = load(&options);
        assert!(matches!(twice, Err(JudgedError::Twice { line: 5, before: 3 | 4, .. })), "{twice:?}");
    }
    // the joint centres of a skeleton have names of their own
    folder.put("judged.csv", "motion,score\nx.bvh,5\n");
    folder.put("x.bvh", BVH);
    assert_eq!(load(&options).unwrap().recordings[0].names()[0], "Hips");
}

#[test]
fn a_synthetic_set_comes_back_from_its_files_and_trains_the_same_model() {
    let folder = Folder::new("synthetic");
    let (set, _) = judged(&SyntheticOptions::of(12));
    let saved = set.judged_set();
    saved.save(&folder.0).unwrap();
    for entry in fs::read_dir(&folder.0).unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_file()) {
        assert!(fs::read_to_string(&entry).unwrap().starts_with("# SYNTHETIC"), "{entry:?}");
    }
    let found = load_set(folder.path("judged.csv"), &JudgedOptions::default()).unwrap();
    assert_eq!(found, saved);
    let [from_files, from_memory] =
        [(found.performances().unwrap(), found.scores()), (set.performances().unwrap(), set.scores)].map(
            |(motions, scores)| ScoringModel::train(&motions, &scores, &ScoringOptions::thesis()).unwrap(),
        );
    assert_eq!(from_files, from_memory);
    assert!(from_files.is_synthetic());
}

#[test]
fn a_set_that_could_not_be_read_again_is_not_written() {
    let folder = Folder::new("unwritten");
    let (set, _) = judged(&SyntheticOptions::of(4));
    let good = set.judged_set();
    let refused = |change: &dyn Fn(&mut JudgedSet)| {
        let mut set = good.clone();
        change(&mut set);
        let error = set.save(&folder.0).expect_err("a set that cannot be written");
        assert_eq!(fs::read_dir(&folder.0).unwrap().count(), 1, "only the folder of the test: {error}");
        error
    };
    for name in ["judged.csv", "Judged.CSV", "../a.csv", "/tmp/a.csv", "SYNTHETIC_0001.csv"] {
        let error = refused(&|set| set.list.motions[1].file = name.into());
        let is_named = matches!(&error, JudgedError::Write(WriteError::Name { name: n, .. }) if n == name);
        assert!(is_named || matches!(error, JudgedError::NotCsv { .. }), "{name}: {error}");
    }
    let error = refused(&|set| set.list.motions[2].file = "a.trc".into());
    assert!(matches!(error, JudgedError::NotCsv { .. }), "{error}");
    let error = refused(&|set| set.list.motions[2].score = f64::NAN);
    assert!(matches!(error, JudgedError::Write(WriteError::NonFinite { motion: 2, .. })), "{error}");
    let error = refused(&|set| set.list.motions[3].features.push(1.0));
    assert!(matches!(error, JudgedError::Write(WriteError::Features { motion: 3, .. })), "{error}");
    let error = refused(&|set| set.list.feature_names.push("score".into()));
    assert!(matches!(error, JudgedError::Write(WriteError::Name { .. })), "{error}");
    let error = refused(&|set| set.list.motions[1].athlete = Some("Ann".into()));
    assert!(matches!(error, JudgedError::Write(WriteError::Name { .. })), "{error}");
    let error = refused(&|set| drop(set.recordings.pop()));
    assert!(matches!(error, JudgedError::Write(WriteError::Recordings { found: 3, .. })), "{error}");
    good.save(&folder.0).unwrap();
}
