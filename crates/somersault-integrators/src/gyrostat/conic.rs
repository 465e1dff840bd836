//! The path of the unit angular momentum of a gyrostat on the sphere: where a quadric meets it, by elliptic functions of time.
//!
//! The [module](super) has the formulas.

use nalgebra::Vector3;
use somersault_core::double_double::DoubleDouble;
use somersault_core::elliptic::{Parameter, QuarterPeriod, carlson_rf, jacobi};

/// A vector of three components in space and one in time.
type Event = [DoubleDouble; 4];

const ZERO: DoubleDouble = DoubleDouble { hi: 0.0, lo: 0.0 };

/// l(t) as a function of the turns of its period.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path {
    form: Form,
    /// Where t = 0 is, in turns.
    start: f64,
    /// Turns per unit of time, negative where time runs against the argument.
    pub(super) frequency: DoubleDouble,
    parameter: Parameter,
    /// 4K.
    period: f64,
    /// The vectors in the module's formulas of X.
    columns: Columns,
}

/// The vectors of X: those of the elliptic functions, and the two between which the third is chosen so that nothing cancels.
#[derive(Clone, Copy, Debug)]
struct Columns {
    functions: [[f64; 4]; 3],
    ends: [[f64; 4]; 2],
}

/// What the quadric is in the frame where it is simplest.
#[derive(Clone, Copy, Debug)]
enum Form {
    /// That of a free body, for k² ≤ ½: X = A cn + B sn + D (dn − 1) + C.
    Round,
    /// The same for k² > ½: X = A cn + D dn ± B (1 ∓ sn) + C±, with the sign of sn.
    Bent,
    /// That of a pendulum in libration, √(ρ⁄R_α), √(ρ⁄R_β), φ_α, π − φ_β and k k′.
    Pendulum { x: f64, y: f64, first: f64, last: f64, product: f64 },
}

impl Path {
    /// The path through `l` of l′ = l × (p l − b) with p diagonal, and of the quadric that it stays on; `None` where the frame in
    /// which the quadric is simplest does not exist in 30 digits, as on a separatrix.
    pub(super) fn new(p: [DoubleDouble; 3], b: [DoubleDouble; 3], l: [DoubleDouble; 3]) -> Option<Self> {
        let rate: [DoubleDouble; 3] = std::array::from_fn(|i| p[i] * l[i] - b[i]);
        let velocity = [0, 1, 2].map(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            l[j] * rate[k] - l[k] * rate[j]
        });
        let centre = (p[0] + p[1] + p[2]) / DoubleDouble::new(3.0);
        let p = p.map(|x| x - centre);
        let mut pencil = Pencil { p, b, l, turns: Vec::new() };
        pencil.turn_equal_axes();
        let frame = pencil.frame()?;
        let one = DoubleDouble::new(1.0);
        let at = frame.components(&[l[0], l[1], l[2], one]);
        let change = frame.components(&[velocity[0], velocity[1], velocity[2], ZERO]);
        frame.path(&at, &change)
    }

    /// The turns at time `t`, from −½ to ½.
    pub(super) fn turns(&self, t: f64) -> f64 {
        let turns = self.start + self.frequency.fraction_of_turns(t);
        turns - turns.round()
    }

    /// l after so many turns, and by how much its norm was off 1.
    pub(super) fn at(&self, turns: f64) -> (Vector3<f64>, f64) {
        let found = jacobi(turns * self.period, &self.parameter);
        let (sn, cn, dn) = (found.sn, found.cn, found.dn);
        let m = self.parameter.m();
        let weights = match self.form {
            Form::Round => ([cn, sn, -m * sn * sn / (1.0 + dn)], [1.0, 0.0]),
            Form::Bent => {
                let rest = -(cn * cn / (1.0 + sn.abs())).copysign(sn);
                ([cn, rest, dn], if sn < 0.0 { [0.0, 1.0] } else { [1.0, 0.0] })
            }
            Form::Pendulum { x, y, first, last, product } => {
                let (s2, d2, m1) = (sn * sn, dn * dn, self.parameter.m1());
                let root = (d2 * d2 + m * m1 * s2 * s2).sqrt();
                // 1 − m sn⁴ without cancellation
                let whole = m1 + m * cn * cn * (1.0 + s2);
                let double = (cn * cn - s2 * d2) / whole;
                // twice δ from φ_α on, or back from φ_β
                let (c, s) = if double < 0.0 {
                    let part = (2.0 * product * cn * cn / whole).atan2(m1 - m * double);
                    let (s, c) = (0.5 * (first + part)).sin_cos();
                    (c, s)
                } else {
                    let part = (2.0 * product * s2 * d2 / whole).atan2(m1 + m * double);
                    (0.5 * (last + part)).sin_cos()
                };
                ([x * sn * dn / root, y * cn / root, 0.0], [c, s])
            }
        };
        let Columns { functions, ends } = &self.columns;
        let event: [f64; 4] = std::array::from_fn(|i| {
            let along = |columns: &[[f64; 4]], weights: &[f64]| -> f64 {
                columns.iter().zip(weights).map(|(column, weight)| column[i] * weight).sum()
            };
            along(ends, &weights.1) + along(functions, &weights.0)
        });
        let space = Vector3::new(event[0], event[1], event[2]);
        let norm = space.norm();
        (space / norm, (norm / event[3] - 1.0).abs())
    }
}

/// p, b and l of a [`Path`], with the turns about axes that made some b zero.
struct Pencil {
    p: [DoubleDouble; 3],
    b: [DoubleDouble; 3],
    l: [DoubleDouble; 3],
    /// Planes, cosines and sines.
    turns: Vec<(usize, usize, DoubleDouble, DoubleDouble)>,
}

impl Pencil {
    /// Turns axes of equal p so that all but one of their b are zero, and takes what is far below rounding for zero.
    fn turn_equal_axes(&mut self) {
        let scale = self.scale();
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            if self.p[i] == self.p[j] && self.b[j] != ZERO {
                let norm = (self.b[i] * self.b[i] + self.b[j] * self.b[j]).sqrt();
                let (c, s) = (self.b[i] / norm, self.b[j] / norm);
                self.b[i] = norm;
                self.b[j] = ZERO;
                (self.l[i], self.l[j]) = (c * self.l[i] + s * self.l[j], c * self.l[j] - s * self.l[i]);
                self.turns.push((i, j, c, s));
            }
        }
        self.b = self.b.map(|x| if x.hi.abs() <= 1e-20 * scale { ZERO } else { x });
    }

    /// The largest number in the quadric.
    fn scale(&self) -> f64 {
        self.p.iter().chain(&self.b).fold(0.0, |most, x| x.hi.abs().max(most))
    }

    /// Whether the quadric couples axis i with time.
    fn is_coupled(&self, i: usize) -> bool {
        self.b[i] != ZERO
    }

    /// The eigenvalues and eigenvectors of the quadric.
    fn frame(&self) -> Option<Frame> {
        let mut real = Vec::with_capacity(4);
        let mut roots = Vec::with_capacity(4);
        let mut coupled: Vec<usize> = (0..3).filter(|i| self.is_coupled(*i)).collect();
        coupled.sort_unstable_by(|i, j| self.p[*i].hi.total_cmp(&self.p[*j].hi));
        let mut polynomial = self.polynomial();
        // between two of them there is a root, where the polynomial changes its sign
        for (n, pair) in coupled.windows(2).enumerate() {
            let rises = n % 2 == 1;
            let root =
                self.bisect(&polynomial_of(&self.polynomial()), (self.p[pair[0]], self.p[pair[1]]), rises);
            polynomial = divided(&polynomial, root);
            roots.push(root);
        }
        for i in (0..3).filter(|i| !self.is_coupled(*i)) {
            let mut axis = [ZERO; 4];
            axis[i] = DoubleDouble::new(1.0);
            real.push((self.p[i], axis));
        }
        let mut pair = None;
        if coupled.is_empty() {
            roots.push(-(polynomial[0] / polynomial[1]));
        } else {
            let middle = -(polynomial[1] / polynomial[2]).scale(0.5);
            let discriminant = middle * middle - polynomial[0] / polynomial[2];
            let root = discriminant.abs().sqrt();
            if discriminant.hi > 0.0 {
                roots.extend([middle - root, middle + root]);
            } else {
                pair = Some((middle, root));
            }
        }
        real.extend(roots.into_iter().map(|root| (root, self.vector(root))));
        let frame = match pair {
            None => Frame::of_real(real)?,
            Some((middle, rotation)) => {
                Frame::of_pair(real, middle, rotation, self.complex_vector(middle, rotation))?
            }
        };
        Some(frame.turned_back(&self.turns))
    }

    /// The polynomial in μ that vanishes at the eigenvalues, but those of axes that are not coupled: Σ (ω_i − μ l_i)² Π (p_j − μ)
    /// over the others j, coefficients from the lowest.
    fn polynomial(&self) -> [DoubleDouble; 5] {
        let mut sum = [ZERO; 5];
        for i in 0..3 {
            let mut term = [ZERO; 5];
            term[0] = DoubleDouble::new(1.0);
            let factor = if self.is_coupled(i) {
                let rate = self.p[i] * self.l[i] - self.b[i];
                [(rate, -self.l[i]), (rate, -self.l[i])]
            } else {
                [(self.p[i] * self.l[i], -self.l[i]), (self.l[i], ZERO)]
            };
            let others = (0..3)
                .filter(|j| *j != i && self.is_coupled(*j))
                .map(|j| (self.p[j], DoubleDouble::new(-1.0)));
            for (constant, slope) in factor.into_iter().chain(others) {
                term = times(&term, constant, slope);
            }
            for (sum, term) in sum.iter_mut().zip(term) {
                *sum = *sum + term;
            }
        }
        sum
    }

    /// The root between two bounds.
    fn bisect(
        &self,
        polynomial: &dyn Fn(DoubleDouble) -> DoubleDouble,
        (mut low, mut high): (DoubleDouble, DoubleDouble),
        rises: bool,
    ) -> DoubleDouble {
        for _ in 0..120 {
            let middle = (low + high).scale(0.5);
            if (polynomial(middle).hi > 0.0) == rises {
                high = middle;
            } else {
                low = middle;
            }
        }
        (low + high).scale(0.5)
    }

    /// The eigenvector of an eigenvalue: b_i ⁄ (p_i − μ) in space and 1 in time, up to a factor.
    fn vector(&self, root: DoubleDouble) -> Event {
        let mut vector = [ZERO; 4];
        let product = |skipped: usize| {
            (0..3)
                .filter(|j| *j != skipped && self.is_coupled(*j))
                .fold(DoubleDouble::new(1.0), |product, j| product * (self.p[j] - root))
        };
        for i in (0..3).filter(|i| self.is_coupled(*i)) {
            vector[i] = self.b[i] * product(i);
        }
        vector[3] = product(3);
        vector
    }

    /// The same for a complex eigenvalue, real and imaginary part.
    fn complex_vector(&self, middle: DoubleDouble, rotation: DoubleDouble) -> [Complex; 4] {
        let mut vector = [Complex::real(ZERO); 4];
        let product = |skipped: usize| {
            (0..3)
                .filter(|j| *j != skipped && self.is_coupled(*j))
                .fold(Complex::real(DoubleDouble::new(1.0)), |product, j| {
                    product.times(Complex { re: self.p[j] - middle, im: -rotation })
                })
        };
        for i in (0..3).filter(|i| self.is_coupled(*i)) {
            vector[i] = Complex::real(self.b[i]).times(product(i));
        }
        vector[3] = product(3);
        vector
    }
}

/// A polynomial times a constant and a slope.
fn times(polynomial: &[DoubleDouble; 5], constant: DoubleDouble, slope: DoubleDouble) -> [DoubleDouble; 5] {
    std::array::from_fn(|i| {
        let lower = if i == 0 { ZERO } else { polynomial[i - 1] * slope };
        polynomial[i] * constant + lower
    })
}

/// A polynomial divided by (μ − root), which divides it.
fn divided(polynomial: &[DoubleDouble; 5], root: DoubleDouble) -> [DoubleDouble; 5] {
    let mut quotient = [ZERO; 5];
    for i in (0..4).rev() {
        quotient[i] = polynomial[i + 1] + quotient[i + 1] * root;
    }
    quotient
}

/// A polynomial as a function.
fn polynomial_of(polynomial: &[DoubleDouble; 5]) -> impl Fn(DoubleDouble) -> DoubleDouble {
    let polynomial = *polynomial;
    move |x| polynomial.iter().rev().fold(ZERO, |sum, c| sum * x + *c)
}

#[derive(Clone, Copy, Debug)]
struct Complex {
    re: DoubleDouble,
    im: DoubleDouble,
}

impl Complex {
    fn real(re: DoubleDouble) -> Self {
        Self { re, im: ZERO }
    }

    fn times(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }

    fn over(self, other: Self) -> Self {
        let norm = other.re * other.re + other.im * other.im;
        let Self { re, im } = self.times(Self { re: other.re, im: -other.im });
        Self { re: re / norm, im: im / norm }
    }

    fn sqrt(self) -> Self {
        let norm = (self.re * self.re + self.im * self.im).sqrt();
        let larger = ((norm + self.re.abs()).scale(0.5)).sqrt();
        let smaller = self.im / larger.scale(2.0);
        if self.re.hi >= 0.0 {
            Self { re: larger, im: smaller }
        } else if self.im.hi >= 0.0 {
            Self { re: smaller, im: larger }
        } else {
            Self { re: -smaller, im: -larger }
        }
    }
}

/// The product of space less that of time.
fn product(a: &Event, b: &Event) -> DoubleDouble {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] - a[3] * b[3]
}

fn scaled(a: &Event, factor: DoubleDouble) -> Event {
    a.map(|x| x * factor)
}

fn sum(a: &Event, b: &Event) -> Event {
    std::array::from_fn(|i| a[i] + b[i])
}

/// A vector of space made orthogonal to others with the products ±1 with themselves, and of norm 1.
fn orthogonal(vector: &Event, others: &[(Event, f64)]) -> Option<Event> {
    let mut vector = *vector;
    // twice is enough
    for _ in 0..2 {
        for (other, square) in others {
            let along = product(&vector, other).scale(-square);
            vector = sum(&vector, &scaled(other, along));
        }
    }
    let square = product(&vector, &vector);
    (square.hi > 0.0).then(|| scaled(&vector, DoubleDouble::new(1.0) / square.sqrt()))
}

/// A frame of three axes of space and one of time, in which the quadric is simplest.
struct Frame {
    axes: [Event; 3],
    time: Event,
    kind: Kind,
}

enum Kind {
    /// Eigenvalues of the axes less that of time.
    Real([DoubleDouble; 3]),
    /// α, β ≤ α and ρ > 0.
    Pair { alpha: DoubleDouble, beta: DoubleDouble, rho: DoubleDouble },
}

impl Frame {
    fn of_real(real: Vec<(DoubleDouble, Event)>) -> Option<Self> {
        let is_time = |vector: &Event| product(vector, vector).hi < 0.0;
        let (time, space): (Vec<_>, Vec<_>) = real.into_iter().partition(|(_, vector)| is_time(vector));
        let ([(eigenvalue, time)], [first, second, third]) = (time.as_slice(), space.as_slice()) else {
            return None;
        };
        let norm = (-product(time, time)).sqrt();
        let sign = if time[3].hi < 0.0 { -1.0 } else { 1.0 };
        let time = scaled(time, DoubleDouble::new(sign) / norm);
        let a = orthogonal(&first.1, &[(time, -1.0)])?;
        let b = orthogonal(&second.1, &[(time, -1.0), (a, 1.0)])?;
        let c = orthogonal(&third.1, &[(time, -1.0), (a, 1.0), (b, 1.0)])?;
        let kind = Kind::Real([first.0, second.0, third.0].map(|x| x - *eigenvalue));
        Some(Self { axes: [a, b, c], time, kind })
    }

    fn of_pair(
        mut real: Vec<(DoubleDouble, Event)>,
        middle: DoubleDouble,
        rho: DoubleDouble,
        vector: [Complex; 4],
    ) -> Option<Self> {
        let square = |x: Complex| x.times(x);
        let [x, y, z, t] = vector.map(square);
        let norm = Complex { re: x.re + y.re + z.re - t.re, im: x.im + y.im + z.im - t.im };
        let root = Complex { re: norm.re.scale(0.5), im: norm.im.scale(0.5) }.sqrt();
        let mut vector = vector.map(|x| x.over(root));
        if vector[3].im.hi < 0.0 {
            vector = vector.map(|x| Complex { re: -x.re, im: -x.im });
        }
        let (z, time) = (vector.map(|x| x.re), vector.map(|x| x.im));
        real.sort_unstable_by(|a, b| b.0.hi.total_cmp(&a.0.hi));
        let [first, second] = real.as_slice() else { return None };
        let x = orthogonal(&first.1, &[(time, -1.0), (z, 1.0)])?;
        let y = orthogonal(&second.1, &[(time, -1.0), (z, 1.0), (x, 1.0)])?;
        let kind = Kind::Pair { alpha: first.0 - middle, beta: second.0 - middle, rho };
        Some(Self { axes: [x, y, z], time, kind })
    }

    /// The same in the axes before they were turned.
    fn turned_back(mut self, turns: &[(usize, usize, DoubleDouble, DoubleDouble)]) -> Self {
        for (i, j, c, s) in turns.iter().rev() {
            for axis in self.axes.iter_mut().chain([&mut self.time]) {
                (axis[*i], axis[*j]) = (*c * axis[*i] - *s * axis[*j], *s * axis[*i] + *c * axis[*j]);
            }
        }
        self
    }

    /// Components along the axes and time.
    fn components(&self, event: &Event) -> Event {
        let [a, b, c] = &self.axes;
        [product(a, event), product(b, event), product(c, event), -product(&self.time, event)]
    }

    /// The path through a point with the components `at`, which change by `change`.
    fn path(&self, at: &Event, change: &Event) -> Option<Path> {
        match self.kind {
            Kind::Real(gaps) => self.body(gaps, at, change),
            Kind::Pair { alpha, beta, rho } => self.pendulum(alpha, beta, rho, at, change),
        }
    }

    fn body(&self, gaps: [DoubleDouble; 3], at: &Event, change: &Event) -> Option<Path> {
        let mut order = [0, 1, 2];
        order.sort_unstable_by(|i, j| gaps[*i].hi.total_cmp(&gaps[*j].hi));
        let [low, b, high] = order;
        let (a, c) = if gaps[b].hi > 0.0 { (high, low) } else { (low, high) };
        let [da, db, dc] = [a, b, c].map(|i| gaps[i]);
        let (across, near) = (da - dc, db - dc);
        let m1 = db * across / (da * near);
        let m = dc * (db - da) / (da * near);
        let rate = (da * near).sqrt();
        let [ma, mb, mc] = [-(dc / across), -(dc / near), da / across].map(|x| x.sqrt());
        let (sine, cosine) = ((at[b] / mb).hi, (at[a] / ma).hi);
        let side = if at[c].hi < 0.0 { -1.0 } else { 1.0 };
        let tall = mc.scale(side);
        let [a_axis, b_axis, c_axis] = [(a, ma), (b, mb), (c, tall)].map(|(i, m)| scaled(&self.axes[i], m));
        let (form, ends) = if m1.hi < 0.5 {
            (Form::Bent, [1.0, -1.0].map(|sign| sum(&self.time, &b_axis.map(|x| x.scale(sign)))))
        } else {
            (Form::Round, [sum(&self.time, &c_axis), [ZERO; 4]])
        };
        let forwards = change[b] * at[a] - change[a] * at[b];
        let clock = Clock::new(m, m1, rate, forwards.hi)?;
        let start = clock.argument(sine, cosine) / clock.period;
        clock.path(form, start, [a_axis, b_axis, c_axis], ends)
    }

    fn pendulum(
        &self,
        alpha: DoubleDouble,
        beta: DoubleDouble,
        rho: DoubleDouble,
        at: &Event,
        change: &Event,
    ) -> Option<Path> {
        let square = rho * rho;
        let (first, second) = ((alpha * alpha + square).sqrt(), (beta * beta + square).sqrt());
        let both = first * second;
        let cosine = alpha * beta + square;
        let gap = alpha - beta;
        let rest = square * gap * gap / (both + cosine.abs());
        let (sum_part, rest_part) = ((both + cosine.abs()) / both.scale(2.0), rest / both.scale(2.0));
        let (m, m1) = if cosine.hi > 0.0 { (rest_part, sum_part) } else { (sum_part, rest_part) };
        let forwards = change[0] * at[1] - change[1] * at[0];
        let clock = Clock::new(m, m1, both.sqrt(), forwards.hi)?;
        // the sine and the cosine of half the amplitude of twice the argument
        let (x, y) = ((at[0] * first.sqrt()).hi, (at[1] * second.sqrt()).hi);
        let norm = x.hypot(y);
        let (x, y) = (x / norm, y / norm);
        let quarter = 0.25 * clock.period;
        let (sine, cosine) = (2.0 * x * y, y * y - x * x);
        let double = if cosine > 0.0 {
            let turned = if y > 0.0 { 0.0 } else { 4.0 * quarter * 1f64.copysign(x) };
            turned + clock.argument(sine, cosine)
        } else {
            2.0 * quarter * 1f64.copysign(x) + clock.argument(-sine, -cosine)
        };
        let half = DoubleDouble::new(0.5).sqrt();
        let [x_axis, y_axis, z_axis] = &self.axes;
        let minus = z_axis.map(|x| -x);
        let near = scaled(&sum(&self.time, &minus), half);
        let far = scaled(&sum(&self.time, z_axis), half);
        let angle = |r: DoubleDouble| rho.hi.atan2(r.hi);
        let form = Form::Pendulum {
            x: (rho / first).sqrt().hi,
            y: (rho / second).sqrt().hi,
            first: angle(alpha),
            last: angle(-beta),
            product: (m * m1).sqrt().hi,
        };
        let start = 0.5 * double / clock.period;
        clock.path(form, start, [*x_axis, *y_axis, [ZERO; 4]], [near, far])
    }
}

/// The argument of the elliptic functions as a function of time.
struct Clock {
    parameter: Parameter,
    period: f64,
    frequency: DoubleDouble,
}

impl Clock {
    /// `None` where there is no period.
    fn new(m: DoubleDouble, m1: DoubleDouble, rate: DoubleDouble, forwards: f64) -> Option<Self> {
        if !(m1.hi > 0.0 && rate.hi > 0.0 && m.hi.is_finite()) {
            return None;
        }
        let one = DoubleDouble::new(1.0);
        let period = QuarterPeriod::new(m1.sqrt(), one, one, one).first.scale(4.0);
        let frequency = (rate / period).scale(if forwards < 0.0 { -1.0 } else { 1.0 });
        let parameter = Parameter::new(m.hi.max(0.0), m1.hi);
        Some(Self { parameter, period: period.hi, frequency })
    }

    /// The argument whose amplitude has a sine and a cosine, up to a factor.
    fn argument(&self, sine: f64, cosine: f64) -> f64 {
        let norm = sine.hypot(cosine);
        let (sn, cn) = (sine / norm, cosine / norm);
        let u = sn * carlson_rf(cn * cn, cn * cn + self.parameter.m1() * sn * sn, 1.0);
        if cn < 0.0 { (0.5 * self.period).copysign(sn) - u } else { u }
    }

    fn path(self, form: Form, start: f64, functions: [Event; 3], ends: [Event; 2]) -> Option<Path> {
        let Self { parameter, period, frequency } = self;
        let rounded = |event: Event| event.map(|x| x.hi);
        let columns = Columns { functions: functions.map(rounded), ends: ends.map(rounded) };
        let mut numbers = columns.functions.iter().chain(&columns.ends).flatten();
        let is_finite = start.is_finite() && numbers.all(|x| x.is_finite());
        is_finite.then_some(Path { form, start, frequency, parameter, period, columns })
    }
}
