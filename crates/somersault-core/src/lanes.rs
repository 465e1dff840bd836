//! Several `f64` at once: one small trait, three implementations, and the choice among them.
//!
//! A [`Kernel`] written over [`Lanes`] is compiled three times: for AVX-512F (eight lanes), for AVX2
//! with FMA (four) and for plain `f64` (one lane, any processor). Every operation of the trait is
//! rounded once, as IEEE 754 prescribes, on each of them (the fused multiply–add included), so the
//! three give the same bits for the same sequence of operations. [`Packed`] has the operators of a number, for
//! formulas that are generic over [`Arithmetic`].
//!
//! A value of a type that implements [`Lanes`] is the proof that the processor has its instructions:
//! [`InstructionSet`] alone makes them, after asking the processor. All `unsafe` code of the crate
//! is in this file.

use crate::scalar::{Arithmetic, Lift};
use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// The most lanes there are.
pub const WIDEST: usize = 8;

/// Arithmetic on [`WIDTH`](Self::WIDTH) numbers at once.
pub trait Lanes: Copy + Debug + Send + Sync + 'static {
    /// The numbers.
    type Vector: Copy + Debug + Send + Sync + 'static;
    /// One truth value for each of them.
    type Mask: Copy;
    /// How many: a power of two up to [`WIDEST`].
    const WIDTH: usize;

    /// `x` in every lane.
    fn splat(self, x: f64) -> Self::Vector;
    /// The first entries, of at least as many as there are lanes.
    fn load(self, entries: &[f64]) -> Self::Vector;
    /// Writes what [`load`](Self::load) reads.
    fn store(self, x: Self::Vector, entries: &mut [f64]);
    /// `a + b`
    fn add(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a - b`
    fn sub(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a b`
    fn mul(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a / b`
    fn div(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a b + c`, rounded once.
    fn mul_add(self, a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector;
    /// `c - a b`, rounded once.
    fn neg_mul_add(self, a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector;
    /// `√a`
    fn sqrt(self, a: Self::Vector) -> Self::Vector;
    /// `a < b ? a : b`, hence `b` when either is not a number.
    fn min(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a > b ? a : b`, hence `b` when either is not a number.
    fn max(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a < b`, false when either is not a number.
    fn less(self, a: Self::Vector, b: Self::Vector) -> Self::Mask;
    /// Whether the mask holds in every lane.
    fn all(self, mask: Self::Mask) -> bool;
    /// `a` where the mask holds, `b` elsewhere.
    fn select(self, mask: Self::Mask, a: Self::Vector, b: Self::Vector) -> Self::Vector;
}

/// A number in each lane, with the operators of a scalar.
#[derive(Debug, Clone, Copy)]
pub struct Packed<L: Lanes> {
    lanes: L,
    vector: L::Vector,
}

impl<L: Lanes> Packed<L> {
    /// The first entries, of at least as many as there are lanes.
    #[inline(always)]
    pub fn load(lanes: L, entries: &[f64]) -> Self {
        Self { lanes, vector: lanes.load(entries) }
    }

    /// Writes what [`load`](Self::load) reads.
    #[inline(always)]
    pub fn store(self, entries: &mut [f64]) {
        self.lanes.store(self.vector, entries);
    }

    /// The numbers, and zeros after the last lane.
    #[inline(always)]
    fn numbers(self) -> [f64; WIDEST] {
        let mut numbers = [0.0; WIDEST];
        self.store(&mut numbers);
        numbers
    }

    #[inline(always)]
    fn with(self, vector: L::Vector) -> Self {
        Self { vector, ..self }
    }

    /// Each number times one factor.
    #[inline(always)]
    pub(crate) fn scaled(self, factor: f64) -> Self {
        self.with(self.lanes.mul(self.vector, self.lanes.splat(factor)))
    }

    /// The sum with `factor` times other numbers, rounded once.
    #[inline(always)]
    pub(crate) fn plus_scaled(self, other: Self, factor: f64) -> Self {
        self.with(self.lanes.mul_add(other.vector, self.lanes.splat(factor), self.vector))
    }
}

impl<L: Lanes> PartialEq for Packed<L> {
    fn eq(&self, other: &Self) -> bool {
        self.numbers() == other.numbers()
    }
}

impl<L: Lanes> Add for Packed<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(self.lanes.add(self.vector, other.vector))
    }
}

impl<L: Lanes> Sub for Packed<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(self.lanes.sub(self.vector, other.vector))
    }
}

impl<L: Lanes> Mul for Packed<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(self.lanes.mul(self.vector, other.vector))
    }
}

impl<L: Lanes> Div for Packed<L> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.with(self.lanes.div(self.vector, other.vector))
    }
}

impl<L: Lanes> Neg for Packed<L> {
    type Output = Self;
    /// −0 − x has the other sign of x, zeros included.
    #[inline(always)]
    fn neg(self) -> Self {
        self.with(self.lanes.sub(self.lanes.splat(-0.0), self.vector))
    }
}

impl<L: Lanes> AddAssign for Packed<L> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<L: Lanes> SubAssign for Packed<L> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<L: Lanes> Arithmetic for Packed<L> {
    /// Those of the standard library, so that a lane has the bits of a scalar.
    #[inline(always)]
    fn sine_and_cosine(self) -> (Self, Self) {
        let (mut sines, mut cosines) = (self.numbers(), [0.0; WIDEST]);
        for k in 0..L::WIDTH {
            (sines[k], cosines[k]) = sines[k].sin_cos();
        }
        (Self::load(self.lanes, &sines), Self::load(self.lanes, &cosines))
    }

    #[inline(always)]
    fn square_root(self) -> Self {
        self.with(self.lanes.sqrt(self.vector))
    }

    #[inline(always)]
    fn exceeds(self, bound: Self) -> bool {
        let l = self.lanes;
        let (above, finite) =
            (l.less(bound.vector, self.vector), l.less(self.vector, l.splat(f64::INFINITY)));
        l.all(above) && l.all(finite)
    }
}

impl<L: Lanes> Lift<f64> for Packed<L> {
    type Proof = L;

    #[inline(always)]
    fn lift(lanes: L, constant: f64) -> Self {
        Self { lanes, vector: lanes.splat(constant) }
    }
}

/// Work that can be done with any [`Lanes`].
///
/// `run` must be `#[inline(always)]`, as must everything it calls: only code inlined into the
/// functions below is compiled for the wider instructions.
pub trait Kernel {
    /// What it leaves.
    type Output;
    /// Does the work.
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

/// The vector instructions that a batch is computed with. All give the same bits.
///
/// ```
/// use somersault_core::lanes::InstructionSet;
/// assert!(InstructionSet::supported().any(|set| set == InstructionSet::detect()));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstructionSet(Set);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Set {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
}

impl InstructionSet {
    /// The widest instructions this processor has.
    pub fn detect() -> Self {
        Self::supported().last().unwrap_or(Self(Set::Portable))
    }

    /// All that this processor has, from the narrowest to the widest.
    pub fn supported() -> impl Iterator<Item = Self> {
        let portable = core::iter::once(Set::Portable);
        #[cfg(target_arch = "x86_64")]
        let sets = portable.chain(Avx2::detect().map(Set::Avx2)).chain(Avx512::detect().map(Set::Avx512));
        #[cfg(not(target_arch = "x86_64"))]
        let sets = portable;
        sets.map(Self)
    }

    /// `"portable"`, `"avx2"` or `"avx512"`.
    pub fn name(self) -> &'static str {
        match self.0 {
            Set::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Set::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Set::Avx512(_) => "avx512",
        }
    }

    /// Runs a kernel compiled for these instructions.
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            Set::Portable => kernel.run(Portable),
            // SAFETY: an `Avx2` exists only where `Avx2::detect` found AVX2 and FMA.
            #[cfg(target_arch = "x86_64")]
            Set::Avx2(lanes) => unsafe { x86::run_avx2(kernel, lanes) },
            // SAFETY: an `Avx512` exists only where `Avx512::detect` found AVX-512F.
            #[cfg(target_arch = "x86_64")]
            Set::Avx512(lanes) => unsafe { x86::run_avx512(kernel, lanes) },
        }
    }
}

/// Arithmetic on four numbers that may change places, as the components of a vector or of a quaternion do.
///
/// An operation is one instruction where the processor has AVX2 with FMA, and four operations elsewhere. Both give the same bits.
pub trait Quad: Copy {
    /// The four numbers.
    type Four: Copy;

    /// `x` four times.
    fn splat(self, x: f64) -> Self::Four;
    /// The entries.
    fn load(self, entries: &[f64; 4]) -> Self::Four;
    /// Writes what [`load`](Self::load) reads.
    fn store(self, a: Self::Four, entries: &mut [f64; 4]);
    /// `a + b`
    fn add(self, a: Self::Four, b: Self::Four) -> Self::Four;
    /// `a - b`
    fn sub(self, a: Self::Four, b: Self::Four) -> Self::Four;
    /// `a b`
    fn mul(self, a: Self::Four, b: Self::Four) -> Self::Four;
    /// `a b + c`, rounded once.
    fn mul_add(self, a: Self::Four, b: Self::Four, c: Self::Four) -> Self::Four;
    /// The numbers at four [`places`].
    fn permute<const PLACES: i32>(self, a: Self::Four) -> Self::Four;
}

/// Four places, from 0 to 3, for [`Quad::permute`]: two bits each, the first place in the lowest.
pub const fn places(places: [i32; 4]) -> i32 {
    places[0] | places[1] << 2 | places[2] << 4 | places[3] << 6
}

/// Work that can be done with any [`Quad`], by the rules for a [`Kernel`].
pub trait QuadKernel {
    /// What it leaves.
    type Output;
    /// Does the work.
    fn run<Q: Quad>(self, quad: Q) -> Self::Output;
}

/// Runs a kernel compiled for the instructions that this processor has.
///
/// ```
/// use somersault_core::lanes::{Quad, QuadKernel, places, run_on_quads};
/// struct Turned([f64; 4]);
/// impl QuadKernel for Turned {
///     type Output = [f64; 4];
///     #[inline(always)]
///     fn run<Q: Quad>(mut self, quad: Q) -> [f64; 4] {
///         let turned = quad.permute::<{ places([1, 2, 0, 3]) }>(quad.load(&self.0));
///         quad.store(turned, &mut self.0);
///         self.0
///     }
/// }
/// assert_eq!(run_on_quads(Turned([1.0, 2.0, 3.0, 4.0])), [2.0, 3.0, 1.0, 4.0]);
/// ```
pub fn run_on_quads<K: QuadKernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(lanes) = Avx2::detect() {
        // SAFETY: an `Avx2` exists only where `Avx2::detect` found AVX2 and FMA.
        return unsafe { x86::run_quad_avx2(kernel, lanes) };
    }
    kernel.run(PortableQuad)
}

/// Four numbers, on any processor.
#[derive(Clone, Copy, Debug)]
struct PortableQuad;

impl Quad for PortableQuad {
    type Four = [f64; 4];

    #[inline(always)]
    fn splat(self, x: f64) -> [f64; 4] {
        [x; 4]
    }
    #[inline(always)]
    fn load(self, entries: &[f64; 4]) -> [f64; 4] {
        *entries
    }
    #[inline(always)]
    fn store(self, a: [f64; 4], entries: &mut [f64; 4]) {
        *entries = a;
    }
    #[inline(always)]
    fn add(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        core::array::from_fn(|i| a[i] + b[i])
    }
    #[inline(always)]
    fn sub(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        core::array::from_fn(|i| a[i] - b[i])
    }
    #[inline(always)]
    fn mul(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        core::array::from_fn(|i| a[i] * b[i])
    }
    #[inline(always)]
    fn mul_add(self, a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
        core::array::from_fn(|i| a[i].mul_add(b[i], c[i]))
    }
    #[inline(always)]
    fn permute<const PLACES: i32>(self, a: [f64; 4]) -> [f64; 4] {
        core::array::from_fn(|i| a[(PLACES >> (2 * i) & 3) as usize])
    }
}

/// One lane, on any processor. Where the target has no fused multiply–add the standard library
/// emulates it: slow, but rounded once as everywhere.
#[derive(Clone, Copy, Debug)]
struct Portable;

impl Lanes for Portable {
    type Vector = f64;
    type Mask = bool;
    const WIDTH: usize = 1;

    #[inline(always)]
    fn splat(self, x: f64) -> f64 {
        x
    }
    #[inline(always)]
    fn load(self, entries: &[f64]) -> f64 {
        entries[0]
    }
    #[inline(always)]
    fn store(self, x: f64, entries: &mut [f64]) {
        entries[0] = x;
    }
    #[inline(always)]
    fn add(self, a: f64, b: f64) -> f64 {
        a + b
    }
    #[inline(always)]
    fn sub(self, a: f64, b: f64) -> f64 {
        a - b
    }
    #[inline(always)]
    fn mul(self, a: f64, b: f64) -> f64 {
        a * b
    }
    #[inline(always)]
    fn div(self, a: f64, b: f64) -> f64 {
        a / b
    }
    #[inline(always)]
    fn mul_add(self, a: f64, b: f64, c: f64) -> f64 {
        a.mul_add(b, c)
    }
    #[inline(always)]
    fn neg_mul_add(self, a: f64, b: f64, c: f64) -> f64 {
        (-a).mul_add(b, c)
    }
    #[inline(always)]
    fn sqrt(self, a: f64) -> f64 {
        a.sqrt()
    }
    #[inline(always)]
    fn min(self, a: f64, b: f64) -> f64 {
        if a < b { a } else { b }
    }
    #[inline(always)]
    fn max(self, a: f64, b: f64) -> f64 {
        if a > b { a } else { b }
    }
    #[inline(always)]
    fn less(self, a: f64, b: f64) -> bool {
        a < b
    }
    #[inline(always)]
    fn all(self, mask: bool) -> bool {
        mask
    }
    #[inline(always)]
    fn select(self, mask: bool, a: f64, b: f64) -> f64 {
        if mask { a } else { b }
    }
}

#[cfg(target_arch = "x86_64")]
use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Kernel, Lanes, Quad, QuadKernel};
    use core::arch::x86_64::*;

    /// Has the stack of the function that it is inlined into begin where vectors may begin.
    ///
    /// A kernel keeps vectors there that find no register. Without this they lie at multiples of 16 bytes, across two lines of the cache
    /// or not by what called the kernel, and the steps of free bodies took up to 1.9 times as long.
    #[inline(always)]
    fn align_stack() {
        #[repr(align(64))]
        struct Place {
            // of one byte, or of what a field alone needs, the compiler would keep less than this type asks for
            _line: [core::mem::MaybeUninit<u8>; 64],
        }
        core::hint::black_box(&Place { _line: [core::mem::MaybeUninit::uninit(); 64] });
    }

    /// Compiles a kernel for AVX2 with FMA, which the processor must have.
    #[target_feature(enable = "avx2,fma")]
    pub(super) fn run_avx2<K: Kernel>(kernel: K, lanes: Avx2) -> K::Output {
        align_stack();
        kernel.run(lanes)
    }

    /// The same for one that works on four numbers.
    #[target_feature(enable = "avx2,fma")]
    pub(super) fn run_quad_avx2<K: QuadKernel>(kernel: K, lanes: Avx2) -> K::Output {
        kernel.run(lanes)
    }

    /// Compiles a kernel for AVX-512F, which the processor must have.
    #[target_feature(enable = "avx512f")]
    pub(super) fn run_avx512<K: Kernel>(kernel: K, lanes: Avx512) -> K::Output {
        align_stack();
        kernel.run(lanes)
    }

    /// Implements [`Lanes`] for a proof of instructions by one intrinsic per operation; the last
    /// three differ in form.
    macro_rules! lanes {
        ($lanes:ident, $vector:ty, $mask:ty, $width:literal,
         splat $splat:ident, load $load:ident, store $store:ident, add $add:ident, sub $sub:ident, mul $mul:ident,
         div $div:ident, mul_add $mul_add:ident, neg_mul_add $neg_mul_add:ident, sqrt $sqrt:ident, min $min:ident,
         max $max:ident, less $less:expr, all $all:expr, select $select:expr) => {
            impl Lanes for $lanes {
                type Vector = $vector;
                type Mask = $mask;
                const WIDTH: usize = $width;

                #[inline(always)]
                fn splat(self, x: f64) -> $vector {
                    // SAFETY: `self` proves that the processor has the instruction.
                    unsafe { $splat(x) }
                }
                #[inline(always)]
                fn load(self, entries: &[f64]) -> $vector {
                    let entries = &entries[..$width];
                    // SAFETY: as in `splat`, and the slice has as many entries as are read.
                    unsafe { $load(entries.as_ptr()) }
                }
                #[inline(always)]
                fn store(self, x: $vector, entries: &mut [f64]) {
                    let entries = &mut entries[..$width];
                    // SAFETY: as in `splat`, and the slice has as many entries as are written.
                    unsafe { $store(entries.as_mut_ptr(), x) }
                }
                lanes!(@binary $vector, add $add, sub $sub, mul $mul, div $div, min $min, max $max);
                #[inline(always)]
                fn mul_add(self, a: $vector, b: $vector, c: $vector) -> $vector {
                    // SAFETY: as in `splat`.
                    unsafe { $mul_add(a, b, c) }
                }
                #[inline(always)]
                fn neg_mul_add(self, a: $vector, b: $vector, c: $vector) -> $vector {
                    // SAFETY: as in `splat`.
                    unsafe { $neg_mul_add(a, b, c) }
                }
                #[inline(always)]
                fn sqrt(self, a: $vector) -> $vector {
                    // SAFETY: as in `splat`.
                    unsafe { $sqrt(a) }
                }
                #[inline(always)]
                fn less(self, a: $vector, b: $vector) -> $mask {
                    // SAFETY: as in `splat`.
                    unsafe { $less(a, b) }
                }
                #[inline(always)]
                fn all(self, mask: $mask) -> bool {
                    $all(mask)
                }
                #[inline(always)]
                fn select(self, mask: $mask, a: $vector, b: $vector) -> $vector {
                    // SAFETY: as in `splat`.
                    unsafe { $select(mask, a, b) }
                }
            }
        };
        (@binary $vector:ty, $($name:ident $intrinsic:ident),*) => {
            $(
                #[inline(always)]
                fn $name(self, a: $vector, b: $vector) -> $vector {
                    // SAFETY: as in `splat`.
                    unsafe { $intrinsic(a, b) }
                }
            )*
        };
    }

    /// Four lanes: the proof that the processor has AVX2 and FMA.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub(super) struct Avx2(());

    impl Avx2 {
        pub(super) fn detect() -> Option<Self> {
            (is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")).then_some(Self(()))
        }
    }

    lanes!(
        Avx2, __m256d, __m256d, 4,
        splat _mm256_set1_pd, load _mm256_loadu_pd, store _mm256_storeu_pd, add _mm256_add_pd, sub _mm256_sub_pd,
        mul _mm256_mul_pd, div _mm256_div_pd, mul_add _mm256_fmadd_pd, neg_mul_add _mm256_fnmadd_pd,
        sqrt _mm256_sqrt_pd, min _mm256_min_pd, max _mm256_max_pd,
        less _mm256_cmp_pd::<_CMP_LT_OQ>,
        // SAFETY: the mask comes from `less`, whose `self` proves that the processor has the instruction.
        all |mask| unsafe { _mm256_movemask_pd(mask) == 0b1111 },
        select |mask, a, b| _mm256_blendv_pd(b, a, mask)
    );

    impl Quad for Avx2 {
        type Four = __m256d;

        #[inline(always)]
        fn splat(self, x: f64) -> __m256d {
            Lanes::splat(self, x)
        }
        #[inline(always)]
        fn load(self, entries: &[f64; 4]) -> __m256d {
            Lanes::load(self, entries)
        }
        #[inline(always)]
        fn store(self, a: __m256d, entries: &mut [f64; 4]) {
            Lanes::store(self, a, entries);
        }
        #[inline(always)]
        fn add(self, a: __m256d, b: __m256d) -> __m256d {
            Lanes::add(self, a, b)
        }
        #[inline(always)]
        fn sub(self, a: __m256d, b: __m256d) -> __m256d {
            Lanes::sub(self, a, b)
        }
        #[inline(always)]
        fn mul(self, a: __m256d, b: __m256d) -> __m256d {
            Lanes::mul(self, a, b)
        }
        #[inline(always)]
        fn mul_add(self, a: __m256d, b: __m256d, c: __m256d) -> __m256d {
            Lanes::mul_add(self, a, b, c)
        }
        #[inline(always)]
        fn permute<const PLACES: i32>(self, a: __m256d) -> __m256d {
            // SAFETY: `self` proves that the processor has the instruction.
            unsafe { _mm256_permute4x64_pd::<PLACES>(a) }
        }
    }

    /// Eight lanes: the proof that the processor has AVX-512F.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub(super) struct Avx512(());

    impl Avx512 {
        pub(super) fn detect() -> Option<Self> {
            is_x86_feature_detected!("avx512f").then_some(Self(()))
        }
    }

    lanes!(
        Avx512, __m512d, __mmask8, 8,
        splat _mm512_set1_pd, load _mm512_loadu_pd, store _mm512_storeu_pd, add _mm512_add_pd, sub _mm512_sub_pd,
        mul _mm512_mul_pd, div _mm512_div_pd, mul_add _mm512_fmadd_pd, neg_mul_add _mm512_fnmadd_pd,
        sqrt _mm512_sqrt_pd, min _mm512_min_pd, max _mm512_max_pd,
        less _mm512_cmp_pd_mask::<_CMP_LT_OQ>,
        all |mask| mask == 0xff,
        select |mask, a, b| _mm512_mask_blend_pd(mask, b, a)
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A long sum of products with permutations and differences, whose rounding shows the order and kind of each operation.
    struct Mixed([f64; 4]);

    impl QuadKernel for Mixed {
        type Output = [f64; 4];

        #[inline(always)]
        fn run<Q: Quad>(mut self, quad: Q) -> [f64; 4] {
            let mut a = quad.load(&self.0);
            let b = quad.splat(0.7);
            for _ in 0..1000 {
                let turned = quad.permute::<{ places([1, 2, 0, 3]) }>(a);
                let back = quad.permute::<{ places([3, 2, 1, 0]) }>(quad.mul(a, turned));
                a = quad.mul_add(b, turned, quad.sub(quad.mul(b, back), quad.mul(a, a)));
                a = quad.add(a, quad.splat(0.1));
            }
            quad.store(a, &mut self.0);
            self.0
        }
    }

    #[test]
    fn four_numbers_have_the_same_bits_on_every_processor() {
        let start = [0.3, -0.2, 0.1, 0.25];
        let portable = Mixed(start).run(PortableQuad);
        assert_eq!(run_on_quads(Mixed(start)).map(f64::to_bits), portable.map(f64::to_bits));
        assert!(portable.iter().all(|x| x.is_finite() && *x != 0.0));
    }
}
