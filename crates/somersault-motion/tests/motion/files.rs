//! Files as other programs write them, made here.

/// A CMU-style BVH: y up, in some unit, other channel orders on other joints, an end site.
pub(crate) const BVH: &str = "HIERARCHY
ROOT Hips
{
\tOFFSET 0.00000 0.00000 0.00000
\tCHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
\tJOINT LeftUpLeg
\t{
\t\tOFFSET 1.36306 -1.79463 0.83929
\t\tCHANNELS 3 Zrotation Yrotation Xrotation
\t\tJOINT LeftLeg
\t\t{
\t\t\tOFFSET 2.44811 -6.72613 0.00000
\t\t\tCHANNELS 3 Xrotation Zrotation Yrotation
\t\t\tEnd Site
\t\t\t{
\t\t\t\tOFFSET 2.5 -7.1 0
\t\t\t}
\t\t}
\t}
\tJOINT Lower Back
\t{
\t\tOFFSET 0 0.1 -0.2
\t\tCHANNELS 4 Zrotation Yposition Xrotation Yrotation
\t}
}
MOTION
Frames: 2
Frame Time: .0083333
9.3722 17.8693 -17.3198 0 0 0 0 0 0 0 0 0 0 0.1 0 0
9.3722 17.8693 -17.3198 -2.0146 -8.2765 2.5 3 25 -10.125 30 5 -7 12 0.25 -4 1
";

/// OpenSim's layout, mm, the second marker missing in the second frame.
pub(crate) const TRC: &str = "PathFileType\t4\t(X/Y/Z)\tjump.trc
DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames
100.00\t100.00\t3\t2\tmm\t100.00\t1\t3
Frame#\tTime\thip\t\t\tknee\t\t
\t\tX1\tY1\tZ1\tX2\tY2\tZ2

1\t0.000\t10.5\t900.25\t-3\t1\t2\t3
2\t0.010\t10.6\t901\t-3\t\t\t
3\t0.020\t10.7\t902\t-3\t1\t2\t4
";

pub(crate) const CSV: &str = "# markers of a jump
time,hip_x,hip_y,hip_z,knee_x,knee_y,knee_z
0.00,0.1,0.2,0.9,0.01,-0.02,0.5
0.01,0.11,0.2,0.9,,,
0.02,0.12,0.2,0.9,0.03,-0.02,0.52
";

/// The order of bytes, and so the processor, of a C3D file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Bytes {
    Intel,
    Dec,
    Mips,
}

/// Three points in mm at 200 Hz, one of them missing in every second frame; a channel at 400 Hz in between.
pub(crate) struct C3d {
    pub(crate) bytes: Bytes,
    pub(crate) float: bool,
    pub(crate) n_frames: usize,
}

impl C3d {
    pub(crate) const LABELS: [&str; 3] = ["LHIP", "RHIP", "HEAD"];
    const ANALOG: usize = 2;
    const SCALE: f32 = 0.0625;

    /// In mm; what an integer times the scale and a float can both hold.
    pub(crate) fn coordinate(frame: usize, point: usize, axis: usize) -> f64 {
        (frame as f64 * 3.0 - point as f64 * 100.0 + axis as f64 * 7.0) * 0.0625
    }

    pub(crate) fn missing(frame: usize, point: usize) -> bool {
        point == 1 && frame % 2 == 1
    }

    fn word(&self, x: u16) -> [u8; 2] {
        if self.bytes == Bytes::Mips { x.to_be_bytes() } else { x.to_le_bytes() }
    }

    fn real(&self, x: f32) -> [u8; 4] {
        match self.bytes {
            Bytes::Intel => x.to_le_bytes(),
            Bytes::Mips => x.to_be_bytes(),
            Bytes::Dec => {
                let [a, b, c, d] = (x * 4.0).to_le_bytes();
                [c, d, a, b]
            }
        }
    }

    fn parameter(&self, out: &mut Vec<u8>, group: i8, name: &str, kind: i8, dimensions: &[u8], data: &[u8]) {
        out.extend([name.len() as u8, group as u8]);
        out.extend(name.as_bytes());
        out.extend(self.word((2 + 2 + dimensions.len() + data.len() + 1) as u16));
        out.extend([kind as u8, dimensions.len() as u8]);
        out.extend(dimensions);
        out.extend(data);
        out.push(0);
    }

    pub(crate) fn write(&self) -> Vec<u8> {
        let scale = if self.float { -Self::SCALE } else { Self::SCALE };
        let mut section = vec![1, 0x50, 2, [84, 85, 86][self.bytes as usize]];
        section.extend([5, -1_i8 as u8]);
        section.extend(b"POINT");
        section.extend(self.word(3));
        section.push(0);
        self.parameter(&mut section, 1, "USED", 2, &[], &self.word(3));
        self.parameter(&mut section, 1, "FRAMES", 2, &[], &self.word(self.n_frames as u16));
        self.parameter(&mut section, 1, "SCALE", 4, &[], &self.real(scale));
        self.parameter(&mut section, 1, "RATE", 4, &[], &self.real(200.0));
        self.parameter(&mut section, 1, "UNITS", -1, &[4], b"mm  ");
        let labels: String = Self::LABELS.iter().map(|l| format!("{l:<6}")).collect();
        self.parameter(&mut section, 1, "LABELS", -1, &[6, 3], labels.as_bytes());
        section.extend([6, -2_i8 as u8]);
        section.extend(b"ANALOG");
        section.extend(self.word(3));
        section.push(0);
        self.parameter(&mut section, 2, "USED", 2, &[], &self.word(1));
        self.parameter(&mut section, 2, "RATE", 4, &[], &self.real(400.0));
        section.extend([0, 0]);
        section.resize(1024, 0);

        let mut header = vec![2, 0x50];
        for word in [3, Self::ANALOG as u16, 1, self.n_frames as u16, 10] {
            header.extend(self.word(word));
        }
        header.extend(self.real(scale));
        header.extend(self.word(4));
        header.extend(self.word(Self::ANALOG as u16));
        header.extend(self.real(200.0));
        header.resize(512, 0);

        let mut file = [header, section].concat();
        for frame in 0..self.n_frames {
            for point in 0..3 {
                let missing = Self::missing(frame, point);
                for axis in 0..3 {
                    let x = if missing { 0.0 } else { Self::coordinate(frame, point, axis) };
                    if self.float {
                        file.extend(self.real(x as f32));
                    } else {
                        file.extend(self.word((x / f64::from(Self::SCALE)) as i16 as u16));
                    }
                }
                let residual: i16 = if missing { -1 } else { 0x0302 };
                if self.float {
                    file.extend(self.real(f32::from(residual)));
                } else {
                    file.extend(self.word(residual as u16));
                }
            }
            for _ in 0..Self::ANALOG {
                if self.float { file.extend(self.real(1.5)) } else { file.extend(self.word(77)) }
            }
        }
        file
    }
}

/// A motion in the format of DeepMimic, standing, with irregular white space.
pub(crate) fn joint_motion(n_frames: usize) -> String {
    let q = "1, 0, 0,\t\t0";
    let frame = format!("[0.05, 0, 0.9, 0, {q}, {q}, {q}, {q}, -0.5, {q}, {q}, 0.25, {q}, 0, {q}, {q}, 0]");
    format!("{{\n\"Loop\": \"wrap\",\n\"Frames\":\n[\n{}\n]\n}}", vec![frame; n_frames].join(",\n"))
}
