//! Whatever the list, the reader returns; and what it accepts can be written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use somersault_motion::judged;

fuzz_target!(|text: &str| {
    let Ok(list) = judged::read(text) else { return };
    assert!(list.motions.iter().all(|m| m.features.len() == list.feature_names.len()));
    let Ok(written) = judged::write(&list) else { return };
    let again = judged::read(&written).expect("what was written");
    assert_eq!(again.motions.len(), list.motions.len());
});
