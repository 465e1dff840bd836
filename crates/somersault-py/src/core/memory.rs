//! Sizes, refused before memory is allocated: where an allocation fails, the process ends.

use crate::core::error::Error;

/// The bytes of as many numbers as the product of counts; the most there are where it overflows.
pub(crate) fn bytes_of_numbers(counts: &[usize]) -> usize {
    counts.iter().fold(size_of::<f64>(), |bytes, count| bytes.saturating_mul(*count))
}

/// Refuses what needs more bytes at once than the system gives; `what` says which arguments lead to them.
pub(crate) fn expect_room(what: &str, bytes: usize) -> Result<(), Error> {
    // given back at once: nothing of it has been touched
    match Vec::<u8>::new().try_reserve_exact(bytes) {
        Ok(()) => Ok(()),
        Err(_) => Err(too_large(what, bytes)),
    }
}

/// Zeros, as many as the product of counts.
pub(crate) fn zeros(what: &str, counts: &[usize]) -> Result<Vec<f64>, Error> {
    let bytes = bytes_of_numbers(counts);
    expect_room(what, bytes)?;
    // the system gives them as zeros, none of which is touched here
    Ok(vec![0.0; bytes / size_of::<f64>()])
}

/// A copy of numbers.
pub(crate) fn copied(what: &str, numbers: &[f64]) -> Result<Vec<f64>, Error> {
    let mut copy = Vec::new();
    let reserved = copy.try_reserve_exact(numbers.len());
    reserved.map_err(|_| too_large(what, bytes_of_numbers(&[numbers.len()])))?;
    copy.extend_from_slice(numbers);
    Ok(copy)
}

fn too_large(what: &str, bytes: usize) -> Error {
    Error::input(format!("{what} need {:.3} GB of memory, more than there is", bytes as f64 / 1e9))
}
