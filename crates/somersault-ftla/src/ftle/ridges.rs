//! Ridges of a field on a grid of the plane.
//!
//! A point is on a ridge where the gradient of the field is orthogonal to the eigenvector of the smallest eigenvalue of its Hessian
//! matrix, and that eigenvalue is negative (the second-derivative ridge of Shadden, Lekien and Marsden, definition 2.1). With e that
//! eigenvector, ridges are the zeros of s = ∇σ·e. They are sought on the edges of the grid, e turned alike at both ends
//! of an edge (J. D. Furst and S. M. Pizer, *Marching ridges*, 2001), and joined through its cells.
//!
//! Gradient and Hessian matrix at the nodes are differences of fourth order, and cubic along an edge, so that a ridge which the grid
//! resolves is found to h⁴ for a spacing of h.

use nalgebra::Matrix2;
use somersault_core::argument::{ArgumentError, expect_finite, expect_length};
use std::collections::HashMap;

/// A grid of the plane: node (i, j) is at (x₀ + i hₓ, y₀ + j h_y).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// First node.
    pub origin: [f64; 2],
    /// hₓ and h_y, positive.
    pub spacing: [f64; 2],
    /// Nodes along x and y.
    pub count: [usize; 2],
}

/// What counts as a ridge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RidgeCriteria {
    /// Lowest value of the field on it.
    pub height: f64,
    /// Least −λ of the smallest eigenvalue λ of the Hessian matrix.
    pub curvature: f64,
    /// Least length.
    pub length: f64,
}

/// A ridge as a polyline.
#[derive(Debug, Clone, PartialEq)]
pub struct Ridge {
    /// Its points; the first is the last of one that is closed.
    pub points: Vec<[f64; 2]>,
    /// The field there.
    pub heights: Vec<f64>,
    /// −λ there.
    pub curvatures: Vec<f64>,
}

impl Ridge {
    /// Its length.
    pub fn length(&self) -> f64 {
        self.points.windows(2).map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1])).sum()
    }
}

/// What is known of the field at a place.
#[derive(Debug, Clone, Copy)]
struct Jet {
    value: f64,
    gradient: [f64; 2],
    /// ∂²/∂x², ∂²/∂x∂y, ∂²/∂y².
    hessian: [f64; 3],
}

impl Jet {
    fn is_finite(&self) -> bool {
        self.numbers().iter().all(|x| x.is_finite())
    }

    fn numbers(&self) -> [f64; 6] {
        let ([x, y], [xx, xy, yy]) = (self.gradient, self.hessian);
        [self.value, x, y, xx, xy, yy]
    }

    fn of([value, x, y, xx, xy, yy]: [f64; 6]) -> Self {
        Self { value, gradient: [x, y], hessian: [xx, xy, yy] }
    }

    /// The smallest eigenvalue of the Hessian matrix and its unit vector.
    fn across(&self) -> (f64, [f64; 2]) {
        let [xx, xy, yy] = self.hessian;
        let eigen = Matrix2::new(xx, xy, xy, yy).symmetric_eigen();
        let at = usize::from(eigen.eigenvalues[1] < eigen.eigenvalues[0]);
        (eigen.eigenvalues[at], [eigen.eigenvectors[(0, at)], eigen.eigenvectors[(1, at)]])
    }

    /// s = ∇σ·e with e turned to the side of `towards`, and e.
    fn slope(&self, towards: [f64; 2]) -> (f64, [f64; 2]) {
        let (_, [mut x, mut y]) = self.across();
        if x * towards[0] + y * towards[1] < 0.0 {
            (x, y) = (-x, -y);
        }
        (self.gradient[0] * x + self.gradient[1] * y, [x, y])
    }
}

/// Wider Gaussians leave nothing of a field.
const MOST_SMOOTHING: f64 = 100.0;

/// First and second differences of fourth order over five nodes, and of second order over the middle three of them.
const FIRST: [[f64; 5]; 2] =
    [[1.0 / 12.0, -2.0 / 3.0, 0.0, 2.0 / 3.0, -1.0 / 12.0], [0.0, -0.5, 0.0, 0.5, 0.0]];
const SECOND: [[f64; 5]; 2] =
    [[-1.0 / 12.0, 4.0 / 3.0, -2.5, 4.0 / 3.0, -1.0 / 12.0], [0.0, 1.0, -2.0, 1.0, 0.0]];

/// An edge of the grid: its first node, and whether it goes along x (0) or y (1).
type Edge = ([usize; 2], usize);

/// A place where a ridge crosses an edge.
struct Crossing {
    point: [f64; 2],
    height: f64,
    curvature: f64,
}

impl Grid {
    fn check(&self, values: &[f64]) -> Result<(), ArgumentError> {
        expect_finite("origin", &self.origin)?;
        for &found in &self.spacing {
            if !(found > 0.0 && found.is_finite()) {
                return Err(ArgumentError::OutOfRange {
                    argument: "spacing",
                    allowed: "positive and finite",
                    found,
                });
            }
        }
        expect_length("values", values.len(), self.count[0].saturating_mul(self.count[1]))
    }

    /// The ridges of a field whose `values` go along x first; NaN where it has none. Longest first.
    pub fn ridges(&self, values: &[f64], criteria: RidgeCriteria) -> Result<Vec<Ridge>, ArgumentError> {
        self.check(values)?;
        let RidgeCriteria { height, curvature, length } = criteria;
        for (argument, found) in [("height", height), ("curvature", curvature), ("length", length)] {
            if found.is_nan() {
                return Err(ArgumentError::OutOfRange { argument, allowed: "a number", found });
            }
        }
        let jets = self.jets(values);
        let mut crossings: Vec<Crossing> = Vec::new();
        let mut numbers: HashMap<Edge, usize> = HashMap::new();
        let [nx, ny] = self.count;
        for axis in 0..2 {
            for j in 0..ny.saturating_sub(axis) {
                for i in 0..nx.saturating_sub(1 - axis) {
                    let edge = ([i, j], axis);
                    let found = self.crossing(&jets, edge);
                    if let Some(found) = found
                        .filter(|at| at.height >= height && at.curvature >= curvature.max(f64::MIN_POSITIVE))
                    {
                        numbers.insert(edge, crossings.len());
                        crossings.push(found);
                    }
                }
            }
        }
        let mut ridges: Vec<Ridge> = chains(&self.links(&numbers, &crossings))
            .into_iter()
            .map(|chain| Ridge {
                points: chain.iter().map(|&at| crossings[at].point).collect(),
                heights: chain.iter().map(|&at| crossings[at].height).collect(),
                curvatures: chain.iter().map(|&at| crossings[at].curvature).collect(),
            })
            .filter(|ridge| ridge.length() >= length && ridge.length() > 0.0)
            .collect();
        ridges.sort_by(|a, b| b.length().total_cmp(&a.length()));
        Ok(ridges)
    }

    /// Means of neighbours with weights of a Gaussian, whose standard deviation is given in spacings: what has no value is left out.
    /// Ridges that are narrower than a few spacings come in pieces unless the field is smoothed over about one.
    pub fn smoothed(&self, values: &[f64], deviation: f64) -> Result<Vec<f64>, ArgumentError> {
        self.check(values)?;
        if !(0.0..=MOST_SMOOTHING).contains(&deviation) {
            let (argument, allowed) = ("smoothing", "from 0 to 100");
            return Err(ArgumentError::OutOfRange { argument, allowed, found: deviation });
        }
        if deviation == 0.0 {
            return Ok(values.to_vec());
        }
        let [nx, ny] = self.count;
        let reach = (4.0 * deviation).ceil() as usize;
        let weights: Vec<f64> = (0..=reach).map(|k| (-0.5 * (k as f64 / deviation).powi(2)).exp()).collect();
        let along = |values: &[f64], stride: usize, length: usize, at: usize, place: usize| {
            let (mut sum, mut total) = (0.0, 0.0);
            for other in place.saturating_sub(reach)..length.min(place + reach + 1) {
                let value = values[at - place * stride + other * stride];
                if value.is_finite() {
                    let weight = weights[other.abs_diff(place)];
                    (sum, total) = (sum + weight * value, total + weight);
                }
            }
            if values[at].is_finite() { sum / total } else { f64::NAN }
        };
        let rows: Vec<f64> = (0..nx * ny).map(|at| along(values, 1, nx, at, at % nx)).collect();
        Ok((0..nx * ny).map(|at| along(&rows, nx, ny, at, at / nx)).collect())
    }

    fn index(&self, [i, j]: [usize; 2]) -> usize {
        j * self.count[0] + i
    }

    /// What differences tell of every node, with five nodes along an axis where there are so many with a value, and three elsewhere.
    fn jets(&self, values: &[f64]) -> Vec<Jet> {
        let [nx, ny] = self.count;
        let node = |i: usize, j: usize, a: usize, b: usize| -> f64 {
            // a and b are offsets plus two
            match ((i + a).checked_sub(2), (j + b).checked_sub(2)) {
                (Some(i), Some(j)) if i < nx && j < ny => values[j * nx + i],
                _ => f64::NAN,
            }
        };
        let sum = |i: usize, j: usize, x: &[f64; 5], y: &[f64; 5]| -> f64 {
            let mut total = 0.0;
            for (b, y) in y.iter().enumerate().filter(|(_, y)| **y != 0.0) {
                for (a, x) in x.iter().enumerate().filter(|(_, x)| **x != 0.0) {
                    total += x * y * node(i, j, a, b);
                }
            }
            total
        };
        let here = [0.0, 0.0, 1.0, 0.0, 0.0];
        let [hx, hy] = self.spacing;
        let of = |i: usize, j: usize, k: usize| {
            let (first, second) = (&FIRST[k], &SECOND[k]);
            Jet {
                value: values[j * nx + i],
                gradient: [sum(i, j, first, &here) / hx, sum(i, j, &here, first) / hy],
                hessian: [
                    sum(i, j, second, &here) / (hx * hx),
                    sum(i, j, first, first) / (hx * hy),
                    sum(i, j, &here, second) / (hy * hy),
                ],
            }
        };
        let nodes = (0..ny).flat_map(|j| (0..nx).map(move |i| (i, j)));
        nodes
            .map(|(i, j)| {
                let fine = of(i, j, 0);
                if fine.is_finite() { fine } else { of(i, j, 1) }
            })
            .collect()
    }

    /// Where the slope across the ridge vanishes on an edge, if it does.
    fn crossing(&self, jets: &[Jet], (node, axis): Edge) -> Option<Crossing> {
        let along = |offset: isize| -> Option<&Jet> {
            let mut at = node;
            at[axis] = at[axis].checked_add_signed(offset).filter(|k| *k < self.count[axis])?;
            Some(&jets[self.index(at)]).filter(|jet| jet.is_finite())
        };
        let (first, second) = (along(0)?, along(1)?);
        let (before, after) = (along(-1), along(2));
        // on the edge at u of its length, by as many nodes in line with it as there are
        let at = |u: f64| -> Jet {
            let mut nodes: Vec<(f64, &Jet)> = vec![(0.0, first), (1.0, second)];
            nodes.extend(before.map(|jet| (-1.0, jet)));
            nodes.extend(after.map(|jet| (2.0, jet)));
            let mut numbers = [0.0; 6];
            for (k, (place, jet)) in nodes.iter().enumerate() {
                let others = nodes.iter().enumerate().filter(|(other, _)| *other != k);
                let weight: f64 = others.map(|(_, (other, _))| (u - other) / (place - other)).product();
                numbers.iter_mut().zip(jet.numbers()).for_each(|(sum, number)| *sum += weight * number);
            }
            Jet::of(numbers)
        };
        let (_, towards) = first.across();
        let (start, _) = first.slope(towards);
        let (end, other) = second.slope(towards);
        // e turns by a right angle where both eigenvalues meet: there is no side to compare
        if start * end > 0.0 || (start == 0.0 && end == 0.0) {
            return None;
        }
        if (towards[0] * other[0] + towards[1] * other[1]).abs() < 0.5 {
            return None;
        }
        let (mut low, mut high) = (0.0, 1.0);
        let mut side = towards;
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            let (slope, e) = at(middle).slope(side);
            side = e;
            if (slope > 0.0) == (start > 0.0) && slope != 0.0 && start != 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        let place = 0.5 * (low + high);
        let jet = at(place);
        // an end that belongs to two edges in line is the second one's
        if end == 0.0 {
            return None;
        }
        let mut point = [0, 1].map(|k| self.origin[k] + node[k] as f64 * self.spacing[k]);
        point[axis] += place * self.spacing[axis];
        let (eigenvalue, _) = jet.across();
        Some(Crossing { point, height: jet.value, curvature: -eigenvalue })
    }

    /// Pairs of crossings that a ridge joins through a cell.
    fn links(&self, numbers: &HashMap<Edge, usize>, crossings: &[Crossing]) -> Vec<Vec<usize>> {
        let mut links = vec![Vec::new(); crossings.len()];
        let gap = |a: usize, b: usize| {
            let ([ax, ay], [bx, by]) = (crossings[a].point, crossings[b].point);
            ((ax - bx) / self.spacing[0]).hypot((ay - by) / self.spacing[1])
        };
        let mut join = |a: usize, b: usize| {
            links[a].push(b);
            links[b].push(a);
        };
        let [nx, ny] = self.count;
        for j in 0..ny.saturating_sub(1) {
            for i in 0..nx.saturating_sub(1) {
                let edges: [Edge; 4] = [([i, j], 0), ([i, j + 1], 0), ([i, j], 1), ([i + 1, j], 1)];
                let at: Vec<usize> = edges.iter().filter_map(|edge| numbers.get(edge).copied()).collect();
                match at[..] {
                    [a, b] => join(a, b),
                    [a, b, c] => {
                        // the nearest two: the third ends here
                        let pairs = [(a, b), (a, c), (b, c)];
                        if let Some((a, b)) =
                            pairs.into_iter().min_by(|x, y| gap(x.0, x.1).total_cmp(&gap(y.0, y.1)))
                        {
                            join(a, b);
                        }
                    }
                    [a, b, c, d] => {
                        let ways = [[(a, b), (c, d)], [(a, c), (b, d)], [(a, d), (b, c)]];
                        let total =
                            |way: &[(usize, usize); 2]| gap(way[0].0, way[0].1) + gap(way[1].0, way[1].1);
                        if let Some(way) = ways.into_iter().min_by(|x, y| total(x).total_cmp(&total(y))) {
                            way.into_iter().for_each(|(a, b)| join(a, b));
                        }
                    }
                    // a ridge ends in the cell, which has four edges
                    [] | [_] | [_, _, _, _, _, ..] => {}
                }
            }
        }
        links
    }
}

/// Chains of what is linked to two others at most: open ones, then closed ones, whose first is their last too.
fn chains(links: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let mut seen = vec![false; links.len()];
    let mut found = Vec::new();
    let ends = (0..links.len()).filter(|&at| links[at].len() == 1);
    let all = 0..links.len();
    for start in ends.chain(all) {
        if seen[start] || links[start].is_empty() {
            continue;
        }
        let mut chain = vec![start];
        seen[start] = true;
        let mut at = start;
        while let Some(&next) = links[at].iter().find(|&&next| !seen[next]) {
            seen[next] = true;
            chain.push(next);
            at = next;
        }
        if chain.len() > 2 && links[at].contains(&start) {
            chain.push(start);
        }
        found.push(chain);
    }
    found
}
