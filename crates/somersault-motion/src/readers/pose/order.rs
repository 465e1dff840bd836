//! The order of frames that have names, and the numbers in them.

/// A name with its numbers as such, so that frame 10 comes after frame 9.
pub(super) fn natural(name: &str) -> Vec<(String, u64)> {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let text = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let digits = rest[text..].find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len() - text);
        let number = rest[text..text + digits].parse().unwrap_or(u64::MAX);
        parts.push((rest[..text].to_owned(), number));
        rest = &rest[text + digits..];
    }
    parts
}

/// The numbers of frames in names that differ in one number only: `cam2_0001.png`, `cam2_0002.png`.
pub(super) fn numbers_in(names: &[&str]) -> Option<Vec<f64>> {
    let all: Vec<_> = names.iter().map(|name| natural(name)).collect();
    let first = all.first()?;
    let texts = |name: &[(String, u64)]| name.iter().map(|(text, _)| text.clone()).collect::<Vec<_>>();
    let same = texts(first);
    if all.iter().any(|name| texts(name) != same) {
        return None;
    }
    let mut differ = (0..first.len()).filter(|k| all.iter().any(|name| name[*k].1 != first[*k].1));
    match (differ.next(), differ.next()) {
        (Some(k), None) => Some(all.iter().map(|name| name[k].1 as f64).collect()),
        _ => None,
    }
}
