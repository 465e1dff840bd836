//! Whatever the bytes, the readers return: thousands of changed files, from a fixed seed, and so many times
//! more where `SOMERSAULT_HOSTILE` has a number.

use crate::files::{BVH, Bytes, C3d, CSV, TRC, joint_motion};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use somersault_motion::judged;
use somersault_motion::readers::{
    MarkerOptions, Place, ReadError, ReadOptions, bvh, c3d, csv, format_of_content, joint_motion, text, trc,
};
use somersault_motion::recording::{Convention, LengthUnit};
use somersault_multibody::models::Diver;

/// One to six changes: bytes flipped, cut out, doubled, or replaced by something a format has a meaning for.
fn change(rng: &mut ChaCha8Rng, file: &[u8], words: &[&[u8]]) -> Vec<u8> {
    let mut changed = file.to_vec();
    for _ in 0..rng.random_range(1..=6) {
        if changed.is_empty() {
            break;
        }
        let at = rng.random_range(0..changed.len());
        let end = (at + rng.random_range(1..=24)).min(changed.len());
        match rng.random_range(0..5) {
            0 => changed[at] = rng.next_u32() as u8,
            1 => changed[at] ^= 1 << rng.random_range(0..8),
            2 => drop(changed.drain(at..end)),
            3 => {
                let again = changed[at..end].to_vec();
                changed.splice(at..at, again);
            }
            _ => {
                let word = words[rng.random_range(0..words.len())];
                changed.splice(at..end, word.iter().copied());
            }
        }
    }
    changed
}

/// Reads many changes of a file. A panic names none of them, so the case is printed before.
fn survives<T>(
    seed: u64,
    cases: usize,
    file: &[u8],
    words: &[&[u8]],
    read: impl Fn(&[u8]) -> Result<T, ReadError>,
) {
    struct OnPanic(Vec<u8>);
    impl Drop for OnPanic {
        fn drop(&mut self) {
            if std::thread::panicking() {
                eprintln!("the failing case: {:?}", String::from_utf8_lossy(&self.0));
            }
        }
    }
    let times = std::env::var("SOMERSAULT_HOSTILE").map_or(1, |n| n.parse().expect("a number"));
    let cases = cases * times;
    assert!(read(file).is_ok(), "the file itself must be right");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut refused = 0;
    for _ in 0..cases {
        let case = OnPanic(change(&mut rng, file, words));
        refused += usize::from(read(&case.0).is_err());
    }
    // readers that repair refuse less
    assert!(
        refused > cases / 50 && refused < cases,
        "{refused} of {cases} refused: the changes miss the reader"
    );
}

const NUMBERS: [&[u8]; 8] = [b"nan", b"-1e308", b"1e999", b"99999999999999999999", b"-1", b"0", b"", b" "];

fn words(own: &[&'static [u8]]) -> Vec<&'static [u8]> {
    NUMBERS.iter().chain(own).copied().collect()
}

#[test]
fn changed_bvh_files_are_read_or_refused() {
    let words =
        words(&[b"{", b"}", b"CHANNELS", b"JOINT a", b"End Site", b"MOTION", b"Frames:", b"OFFSET 0 0 0\n"]);
    survives(1, 8000, BVH.as_bytes(), &words, |bytes| {
        let recording = bvh::read(text(bytes)?, &Convention::y_up_z_forward(LengthUnit::Centimetre))?;
        // large numbers may overflow to an error, but not to a panic
        let _ = recording.joint_centres();
        Ok(recording)
    });
}

#[test]
fn changed_trc_files_are_read_or_refused() {
    survives(
        2,
        8000,
        TRC.as_bytes(),
        &words(&[b"\t", b"\n", b"\t\t\t", b"NumFrames", b"mm", b"\r\n"]),
        |bytes| trc::read(text(bytes)?, &MarkerOptions::default()),
    );
}

#[test]
fn changed_csv_files_are_read_or_refused() {
    survives(3, 8000, CSV.as_bytes(), &words(&[b",", b"\n", b"\"", b"#", b",,,", b"_x"]), |bytes| {
        csv::read(text(bytes)?, &MarkerOptions::default())
    });
}

#[test]
fn changed_lists_are_read_or_refused() {
    let list = "# my club\nmotion,height,score,synthetic\n\na.csv,1.5,7.5,true\nsub/b.trc,1.25,6,false\n";
    let words = words(&[b",", b"\n", b"\"", b"#", b"/", b"..", b"score", b"true"]);
    survives(8, 8000, list.as_bytes(), &words, |bytes| judged::read(text(bytes)?));
}

#[test]
fn changed_joint_motions_are_read_or_refused() {
    let file = joint_motion(2);
    survives(
        4,
        8000,
        file.as_bytes(),
        &words(&[b"[", b"]", b"{", b",", b"\"Frames\":", b"1, 0, 0, 0"]),
        |bytes| {
            let recording = joint_motion::read(text(bytes)?, &Diver::spatial())?;
            let _ = recording.joint_centres();
            Ok(recording)
        },
    );
}

#[test]
fn changed_c3d_files_are_read_or_refused() {
    let words: [&[u8]; 7] =
        [&[0xff; 4], &[0; 8], &[0x7f, 0xff], &[0, 0, 0xc0, 0x7f], &[1], &[84], b"LABELS2"];
    for (seed, bytes) in [(5, Bytes::Intel), (6, Bytes::Dec), (7, Bytes::Mips)] {
        for float in [true, false] {
            let file = C3d { bytes, float, n_frames: 3 }.write();
            survives(seed, 4000, &file, &words, |bytes| c3d::read(bytes, &c3d::C3dOptions::default()));
        }
    }
}

/// Changed files of each dialect, read with repairs: an error, or a recording, of which each repair has a place in the file.
#[test]
fn changed_files_of_other_programs_are_repaired_or_refused() {
    let c3d_file = C3d { bytes: Bytes::Mips, float: true, n_frames: 3 }.write();
    let words = words(&[
        b"\t",
        b"\n",
        b",",
        b";",
        b"\"",
        b"endheader",
        b"X",
        b"inDegrees=yes",
        b"\xff\xfe",
        b"[",
        b"}",
        b"null",
        b"{\"x\":1,",
    ]);
    let options =
        ReadOptions { unit: Some(LengthUnit::Centimetre), rate: Some(100.0), ..ReadOptions::default() };
    let files = crate::dialects::files();
    let files = files.iter().map(|text| text.as_bytes()).chain([
        BVH.as_bytes(),
        TRC.as_bytes(),
        CSV.as_bytes(),
        &c3d_file,
    ]);
    for (seed, file) in files.enumerate() {
        let format = format_of_content(file).unwrap();
        survives(100 + seed as u64, 500, file, &words, |bytes| {
            let found = format.read(bytes, &options)?;
            for repair in &found.repairs {
                let end = 1 + bytes.len();
                assert!(
                    repair.count > 0 && matches!(repair.place, Place::Line(n) | Place::Byte(n) if n <= end)
                );
            }
            Ok(found)
        });
    }
}

#[test]
fn declared_numbers_cost_nothing() {
    let huge = BVH.replace("Frames: 2", "Frames: 18446744073709551615");
    let options = Convention::z_up(LengthUnit::Metre);
    assert!(matches!(bvh::read(&huge, &options), Err(ReadError::Misdeclared { found: 2, .. })));
    let huge = BVH.replace("CHANNELS 6", "CHANNELS 18446744073709551615");
    assert!(bvh::read(&huge, &options).is_err());
    let mut file = C3d { bytes: Bytes::Intel, float: false, n_frames: 3 }.write();
    let used = file.windows(4).position(|w| w == b"USED").unwrap() + 8;
    file[used..used + 2].copy_from_slice(&[0xff, 0xff]);
    file[2..4].copy_from_slice(&[0xff, 0xfe]);
    let found = c3d::read(&file, &c3d::C3dOptions::default());
    assert!(matches!(found, Err(ReadError::Misdeclared { found: 0, .. })), "{found:?}");
}

#[test]
fn nesting_costs_no_stack() {
    let depth = 50_000;
    let open: String =
        (0..depth).map(|i| format!("JOINT j{i} {{ OFFSET 0 0 1 CHANNELS 1 Xrotation\n")).collect();
    let text = format!(
        "HIERARCHY ROOT r {{ OFFSET 0 0 0 CHANNELS 1 Xrotation\n{open}{} }} MOTION Frames: 1 Frame Time: 1\n{}",
        "}".repeat(depth).replace('}', "} "),
        "0 ".repeat(depth + 1)
    );
    let recording = bvh::read(&text, &Convention::z_up(LengthUnit::Metre)).unwrap();
    let centres = recording.joint_centres().unwrap();
    assert_eq!(centres.frame(0).unwrap()[depth].unwrap().z, depth as f64);
    assert!(bvh::read(&text.replace("} ", ""), &Convention::z_up(LengthUnit::Metre)).is_err());
}
