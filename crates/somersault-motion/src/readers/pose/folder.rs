//! A folder with a file for each frame.

use super::super::{LoadError, bytes_at, text};
use super::order::natural;
use super::text::parsed;
use std::path::Path;

/// The frames of a folder, one in each JSON file, as one object: under the names of the files, in the order of the numbers in them.
/// Fails if there are none.
pub fn frames_in(folder: impl AsRef<Path>) -> Result<Vec<u8>, LoadError> {
    let folder = folder.as_ref();
    let io = |error: std::io::Error| LoadError::Io { path: folder.to_owned(), reason: error.to_string() };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json")) {
            files.push((path.file_name().unwrap_or_default().to_string_lossy().into_owned(), path));
        }
    }
    files.sort_by_cached_key(|(name, path)| (natural(name), path.clone()));
    let mut all = Vec::new();
    for (name, path) in &files {
        let bytes = bytes_at(path)?;
        let wrong = |source| LoadError::Read { path: path.clone(), source };
        let frame = text(&bytes).map_err(wrong)?;
        parsed(frame, |text| serde_json::from_str::<serde::de::IgnoredAny>(text)).map_err(wrong)?;
        all.push(if all.is_empty() { b'{' } else { b',' });
        all.extend(serde_json::Value::from(name.as_str()).to_string().into_bytes());
        all.push(b':');
        all.extend(frame.as_bytes());
    }
    if all.is_empty() {
        return Err(LoadError::NoFrames { path: folder.to_owned() });
    }
    all.push(b'}');
    Ok(all)
}
