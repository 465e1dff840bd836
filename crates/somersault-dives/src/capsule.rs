//! Capsules: segments of lines with a thickness, and the distance between two.
//!
//! The nearest points of two segments are not unique where these are parallel, and jump there. Constraints make them
//! unique by a term that prefers the middles,
//!
//! ```text
//! D² = min over 0 ≤ s, t ≤ 1 of |a(s) − b(t)|² + ε² ((s − ½)² + (t − ½)²),   ε = 2 cm
//! ```
//! D is differentiable wherever it is not zero, its gradient that at fixed s and t, and exceeds the distance by at
//! most ε²/(4 D). Second derivatives grow as 1/ε² where segments are parallel: with ε = 1 mm they were 10⁹ times those
//! of the rest of a dive. Dives are judged with ε = 0.

use nalgebra::Vector3;

/// A capsule fixed in a body.
#[derive(Debug, Clone, PartialEq)]
pub struct Capsule {
    /// Number of the body.
    pub body: usize,
    /// The two ends of its axis, in axes of the body, m.
    pub ends: [Vector3<f64>; 2],
    /// m.
    pub radius: f64,
}

/// Two points of two segments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestPoints {
    /// On the first segment.
    pub first: Vector3<f64>,
    /// On the second.
    pub second: Vector3<f64>,
    /// D, m.
    pub distance: f64,
}

/// ε of constraints, m.
pub(crate) const PREFERENCE: f64 = 2e-2;

/// The nearest points of two segments, given by their ends, and D for ε = `preference`; for 0 the distance.
pub fn nearest_points(a: &[Vector3<f64>; 2], b: &[Vector3<f64>; 2], preference: f64) -> NearestPoints {
    let (along_a, along_b, between) = (a[1] - a[0], b[1] - b[0], a[0] - b[0]);
    let weight = preference * preference;
    // D² = ½ aa s² + ab s t + ½ bb t² + fa s + fb t + …, up to a factor of two
    let (aa, bb) = (along_a.norm_squared() + weight, along_b.norm_squared() + weight);
    let ab = -along_a.dot(&along_b);
    let (fa, fb) = (along_a.dot(&between) - weight / 2.0, -along_b.dot(&between) - weight / 2.0);
    let value = |s: f64, t: f64| {
        let gap = between + along_a * s - along_b * t;
        gap.norm_squared() + weight * ((s - 0.5).powi(2) + (t - 0.5).powi(2))
    };
    let determinant = aa * bb - ab * ab;
    let (s, t) = ((ab * fb - bb * fa) / determinant, (ab * fa - aa * fb) / determinant);
    // convex: the least lies inside or on one of the four edges; a segment may be a point
    let least = |slope: f64, curvature: f64| {
        if curvature > 0.0 { (-slope / curvature).clamp(0.0, 1.0) } else { 0.5 }
    };
    let on_a = [0.0, 1.0].map(|s| (s, least(fb + ab * s, bb)));
    let on_b = [0.0, 1.0].map(|t| (least(fa + ab * t, aa), t));
    // between parallel segments the determinant is rounding, and so is a point inside: then an edge is as near
    let mut best = if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) { (s, t) } else { on_a[0] };
    for candidate in on_a.into_iter().chain(on_b) {
        if value(candidate.0, candidate.1) < value(best.0, best.1) {
            best = candidate;
        }
    }
    let (s, t) = best;
    NearestPoints { first: a[0] + along_a * s, second: b[0] + along_b * t, distance: value(s, t).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distance(a: [[f64; 3]; 2], b: [[f64; 3]; 2]) -> f64 {
        nearest_points(&a.map(Vector3::from), &b.map(Vector3::from), 0.0).distance
    }

    #[test]
    fn what_is_smooth_exceeds_the_distance_by_less_than_it_says() {
        let a = [Vector3::new(-0.2, 0.0, 0.0), Vector3::new(0.2, 0.0, 0.0)];
        for (turn, gap) in [(0.0, 0.1), (0.05, 0.16), (1.2, 0.2)] {
            let along = Vector3::new(f64::cos(turn), f64::sin(turn), 0.0) * 0.15;
            let middle = Vector3::new(0.1, 0.02, gap);
            let b = [middle - along, middle + along];
            let [exact, smooth] = [0.0, PREFERENCE].map(|e| nearest_points(&a, &b, e).distance);
            assert!(smooth >= exact && smooth - exact <= PREFERENCE.powi(2) / (4.0 * exact), "{turn} {gap}");
        }
    }

    #[test]
    fn distances_are_those_of_closed_form() {
        let x = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
        for (other, expected) in [
            ([[0.0, -1.0, 0.3], [0.0, 1.0, 0.3]], 0.3), // crossing at right angles
            ([[-1.0, 0.4, 0.0], [1.0, 0.4, 0.0]], 0.4), // parallel, side by side
            ([[1.5, 0.0, 0.0], [2.0, 0.0, 0.0]], 0.5),  // one behind the other
            ([[2.0, 1.0, 0.0], [3.0, 5.0, 0.0]], 2f64.sqrt()), // end to end
            ([[0.5, 0.2, 0.0], [0.5, 3.0, 0.0]], 0.2),  // end to inside
            ([[0.2, 0.0, 0.7], [0.2, 0.0, 0.7]], 0.7),  // a point
        ] {
            let found = distance(x, other);
            assert!((found - expected).abs() < 1e-15, "{found} {expected}");
            assert!((distance(other, x) - found).abs() < 1e-15);
        }
    }

    /// The determinant of parallel segments is rounding of either sign.
    #[test]
    fn parallel_segments_are_as_far_apart_as_their_lines() {
        let along = Vector3::new(0.3, -0.7, 0.2);
        let across = along.cross(&Vector3::new(0.1, 0.2, 0.9)).normalize();
        for k in 0..1000 {
            let turn = f64::from(k) * 0.37;
            let shift = along * (0.8 * turn.sin()) + across * (0.1 + 0.05 * turn.cos());
            let tilt = Vector3::new(turn.cos(), (3.0 * turn).sin(), turn.sin()) * 1e-9;
            let length = 0.5 + 0.4 * (5.0 * turn).sin();
            let a = [Vector3::new(0.1, 0.2, turn), Vector3::new(0.1, 0.2, turn) + along];
            let b = [a[0] + shift, a[0] + shift + (along + tilt) * length];
            let found = nearest_points(&a, &b, 0.0).distance;
            // the ranges along the common line, and the distance across
            let from = 0.8 * turn.sin();
            let gap = (from - 1.0).max(-(from + length)).max(0.0) * along.norm();
            let expected = gap.hypot(0.1 + 0.05 * turn.cos());
            assert!((found - expected).abs() < 1e-8, "{k}: {found} {expected}");
        }
    }

    #[test]
    fn the_gradient_is_that_at_fixed_points() {
        // nearly parallel, where nearest points move fast
        let a = [Vector3::new(-1.0, 0.0, 0.0), Vector3::new(1.0, 1e-4, 2e-4)];
        let b = [Vector3::new(-0.9, 0.3, 0.1), Vector3::new(1.2, 0.3, 0.1)];
        let found = nearest_points(&a, &b, PREFERENCE);
        let normal = (found.first - found.second) / found.distance;
        for axis in 0..3 {
            let mut shift = Vector3::zeros();
            shift[axis] = 1e-6;
            let at = |u: Vector3<f64>| nearest_points(&a.map(|p| p + u), &b, PREFERENCE).distance;
            let difference = (at(shift) - at(-shift)) / 2e-6;
            assert!((difference - normal[axis]).abs() < 1e-8, "{difference} {}", normal[axis]);
        }
    }
}
