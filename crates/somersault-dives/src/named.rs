//! The dives of the thesis.

use crate::{Channels, Clearance, Dive, DiveError, KeyFrame, Penalties, Range};
use somersault_multibody::models::{Diver, Posture};

impl Dive {
    /// 107B, the forward three and a half somersaults in pike position, in the plane (thesis 3.1): postures A and H,
    /// 1.7 s, ten coefficients, from the platform of 10 m.
    ///
    /// Of the coefficients the ends fix four: with the momentum there are 7 unknowns. `n_par: 19` gives the 16 parameters of the
    /// thesis, and the same dive but for sharper turns into the pike and out of it, for 60.16 instead of 66.56 kg m²/s;
    /// six more coefficients save 0.03 kg m²/s.
    ///
    /// The thesis gives neither lean nor penalties: here 10° and a = 1, b = 1 ms.
    pub fn forward_pike() -> Result<Self, DiveError> {
        let postures = [Posture::A, Posture::H];
        let angles = postures.iter().map(|p| Ok(p.planar()?.to_vec())).collect::<Result<_, DiveError>>()?;
        Ok(Self {
            diver: Diver::planar(),
            postures: angles,
            first: 0,
            last: 0,
            channels: Channels::Weights,
            windows: Vec::new(),
            square_out: 1.0,
            n_par: 10,
            somersaults: 3.5,
            twists: 0.0,
            lean: Range::fixed(10f64.to_radians()),
            entry_lean: 0.0,
            duration: Range::fixed(1.7),
            momentum: Range::new(0.0, 500.0),
            platform: 10.0,
            entry_distance: 2.0,
            penalties: Penalties { momentum: 1.0, rate: 1e-3, acceleration: 0.0 },
            clearance: None,
            n_steps: 60,
            n_pieces: 2,
        })
    }

    /// 5174D, the forward three and a half somersaults with two twists, free (thesis 3.2), in space: postures C, A,
    /// D, E and I, and H for the somersaults after the twists; 2 s, from the platform of 10 m into the water 2 m ahead.
    ///
    /// The order is that of a competition dive: a somersault in layout, throw, twists, square-out, pike, entry. D, E and I,
    /// the postures of throw and twists, have weights from 0.22 of the duration to the square-out at 0.7, H, the pike, from
    /// 0.64 on. The window has to begin late: the dive of least momentum throws at once. With 40 coefficients for each of
    /// five weights these windows leave 79 free parameters; with the twelve numbers of the start, in the thesis' count, 91
    /// where it has 92. Lean 10°, a = 1, b = 2 ms.
    pub fn forward_twisting() -> Self {
        let (all, twisting) = (Range::new(0.0, 1.0), Range::new(0.22, 0.7));
        let postures = [Posture::C, Posture::A, Posture::D, Posture::E, Posture::I, Posture::H];
        Self {
            diver: Diver::spatial(),
            postures: postures.iter().map(|p| p.spatial().to_vec()).collect(),
            first: 0,
            last: 1,
            channels: Channels::Weights,
            windows: vec![all, twisting, twisting, twisting, Range::new(0.64, 1.0)],
            square_out: 0.7,
            n_par: 40,
            somersaults: 3.5,
            twists: 2.0,
            lean: Range::fixed(10f64.to_radians()),
            entry_lean: 0.0,
            duration: Range::fixed(2.0),
            momentum: Range::new(0.0, 500.0),
            platform: 10.0,
            entry_distance: 2.0,
            penalties: Penalties { momentum: 1.0, rate: 2e-3, acceleration: 0.0 },
            clearance: Some(Clearance { distance: 0.005, n_times: 35 }),
            n_steps: 840,
            n_pieces: 1,
        }
    }

    /// Key frames for [`forward_pike`](Self::forward_pike): into the pike, and out of it late.
    pub fn pike_template() -> Vec<KeyFrame> {
        [(0.0, 0), (0.25, 1), (0.75, 1), (1.0, 0)]
            .map(|(fraction, posture)| KeyFrame { fraction, posture })
            .to_vec()
    }

    /// [`forward_twisting`](Self::forward_twisting) with other counts: its momentum has the sense of the somersaults, and
    /// where twists and somersaults have opposite signs its postures are the mirror images, so that the throw of
    /// [`twisting_template`](Self::twisting_template) tilts the body to the side that the twists need.
    pub fn twisting(somersaults: f64, twists: f64) -> Result<Self, DiveError> {
        let dive = Self { somersaults, twists, ..Self::forward_twisting() };
        let dive = if somersaults * twists < 0.0 { Self { twists, ..dive.mirrored()? } } else { dive };
        let Range { lower, upper } = dive.momentum;
        let momentum = if somersaults < 0.0 { Range::new(-upper, -lower) } else { dive.momentum };
        Ok(Self { momentum, ..dive })
    }

    /// Key frames for [`twisting`](Self::twisting) with these twists: somersault with arms sideways, throw, twists with arms
    /// overhead, square-out, pike, entry; without twists the arms stay sideways until the pike.
    ///
    /// The square-out of whole twists is the throw in reverse. After an odd number of half twists right and left have changed
    /// places in space, and the arms that undo the tilt move as the mirror image of that.
    pub fn twisting_template(twists: f64) -> Vec<KeyFrame> {
        let half_twists = (2.0 * twists).round();
        let undoing = if half_twists % 2.0 == 0.0 { 3 } else { 2 };
        let throw = [(0.26, 0), (0.34, 3), (0.4, 1), (0.52, 1), (0.58, undoing), (0.66, 0)];
        let start = [(0.0, 0)];
        let end = [(0.72, 0), (0.8, 5), (0.9, 5), (1.0, 1)];
        let throw = if half_twists == 0.0 { &[][..] } else { &throw };
        let frame = |(fraction, posture): &(f64, usize)| KeyFrame { fraction: *fraction, posture: *posture };
        start.iter().chain(throw).chain(&end).map(frame).collect()
    }
}
