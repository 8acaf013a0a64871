//! The drive that is flown: contact FEM sampled densely at points that made no table, with its own law of play.
//!
//! On frictionless flanks the drive is elastic: the error of the output depends on the phase within a tooth pitch and
//! on the torque `F` that the flanks carry, and jumps by the clearance where `F` changes sign. What the output rests on
//! besides is the Coulomb drag `d` of its bearing: it stays where it is as long as the drag can hold it,
//! ```text
//! E(phase, T − d) ≤ output − generator/ratio ≤ E(phase, T + d)
//! ```
//! and is carried along at the end that it reaches. Backlash, lost motion and the reversal come out of that; none of it
//! is told to the plant. In double precision and from other numbers than the tables: those hold the middle and the
//! half-width of the play over the load torque, this holds `E` over the flank torque.

/// Most numbers of one temperature.
pub const MOST: usize = 128 * 32;
/// Points of the interpolation over the phase.
const WIDTH: usize = 6;

/// Of which drive a map is, and how its numbers lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapHeader {
    /// Largest flank torque, N·m.
    pub largest_n_m: f64,
    /// Coulomb drag of the output, N·m.
    pub drag_n_m: f64,
    /// Teeth of the flexspline, which stands: periods of the ripple in one generator turn.
    pub teeth: f64,
    /// Generator over output.
    pub ratio: f64,
    /// The two temperatures, °C; between and beyond them the error is linear, because Young's modulus is.
    pub temperatures_c: [f64; 2],
    /// Phases within one flexspline pitch, at the middle of as many equal parts.
    pub phases: usize,
    /// Flank torques: of `n`, number `k` from 1 carries `(k/n)⁴` of the largest.
    pub nodes: usize,
}

/// What contact FEM says of a drive, at two temperatures.
#[derive(Clone, Copy, Debug)]
pub struct GearMap<'a> {
    /// Of which drive.
    pub header: MapHeader,
    /// Error of the output under positive flank torque at each temperature, rad: by flank torque, then phase.
    pub planes: [&'a [f64]; 2],
}

/// Reads a file of a map: a comment with `drag_n_m=`, `teeth=`, `ratio=`, a header, then for each of two temperatures
/// one line for each flank torque: temperature, flank torque, errors in arc-seconds by phase.
///
/// # Errors
/// The line, from 1, that is not so.
pub fn parse(text: &str, planes: &mut [[f64; MOST]; 2]) -> Result<MapHeader, usize> {
    let mut lines = text.lines();
    let first = lines.next().ok_or(1_usize)?;
    let named = |name: &str| {
        let words = first.split_whitespace().filter_map(|word| word.split_once('='));
        words.filter(|(key, _)| *key == name).find_map(|(_, number)| number.parse::<f64>().ok()).ok_or(1_usize)
    };
    let (drag_n_m, teeth, ratio) = (named("drag_n_m")?, named("teeth")?, named("ratio")?);
    let phases = lines.next().ok_or(2_usize)?.split(',').count().saturating_sub(2);
    let mut temperatures_c = [f64::NAN; 2];
    let (mut nodes, mut largest_n_m) = ([0_usize; 2], 0.0);
    for (k, line) in lines.enumerate() {
        let refused = k + 3;
        let mut fields = line.split(',').map(|field| field.parse::<f64>().map_err(|_| refused));
        let (temperature, torque) = (fields.next().ok_or(refused)??, fields.next().ok_or(refused)??);
        let warm = usize::from(nodes[0] > 0 && temperature != temperatures_c[0]);
        temperatures_c[warm] = temperature;
        for phase in 0..phases {
            let error = fields.next().ok_or(refused)??;
            *planes[warm].get_mut(nodes[warm] * phases + phase).ok_or(refused)? = error / super::score::ARCSEC_PER_RAD;
        }
        if fields.next().is_some() || torque <= 0.0 {
            return Err(refused);
        }
        nodes[warm] += 1;
        largest_n_m = torque;
    }
    let [cold, warm] = nodes;
    let known = temperatures_c[0] < temperatures_c[1] && cold == warm && cold >= 4 && (8..=32).contains(&phases);
    let header = MapHeader { largest_n_m, drag_n_m, teeth, ratio, temperatures_c, phases, nodes: cold };
    if known { Ok(header) } else { Err(3 + cold + warm) }
}

/// Flank torque of node `k` of `n`, from 0, as a share of the largest.
pub fn node_share(k: usize, n: usize) -> f64 {
    let part = (k + 1) as f64 / n as f64;
    part * part * part * part
}

/// A drive with its output resting somewhere.
#[derive(Clone, Debug)]
pub struct DenseGear<'a> {
    map: GearMap<'a>,
    /// The map at the temperature now; row 0 is `F = 0`.
    plane: [f64; MOST + 32],
    generator_rad: f64,
    error_rad: f64,
}

impl<'a> DenseGear<'a> {
    /// Unloaded at generator angle zero, in the middle of the clearance.
    pub fn new(map: GearMap<'a>, temperature_c: f64) -> Self {
        let mut gear = Self { map, plane: [0.0; MOST + 32], generator_rad: 0.0, error_rad: 0.0 };
        gear.set_temperature(temperature_c);
        gear
    }

    /// Another temperature, °C. To be called every now and then: it goes over all numbers.
    pub fn set_temperature(&mut self, temperature_c: f64) {
        let phases = self.map.header.phases;
        let [cold, warm] = self.map.header.temperatures_c;
        let share = (temperature_c - cold) / (warm - cold);
        let [first, second] = self.map.planes;
        for (to, (a, b)) in self.plane.iter_mut().skip(phases).zip(first.iter().zip(second)) {
            *to = a + share * (b - a);
        }
        // Where the load vanishes: the parabola through the first three nodes, which are evenly spaced in the fourth
        // root.
        for phase in 0..phases {
            let at = |row: usize| self.plane[row * phases + phase];
            self.plane[phase] = 3.0 * at(1) - 3.0 * at(2) + at(3);
        }
    }

    /// Error of the output with this flank torque at a generator angle, rad; exactly none on the flanks is the limit
    /// from the side of `sign`.
    pub fn elastic_error_rad(&self, generator_rad: f64, flank_n_m: f64, sign: f64) -> f64 {
        let (phases, nodes) = (self.map.header.phases, self.map.header.nodes);
        let turns = self.map.header.teeth * generator_rad * (1.0 / core::f64::consts::TAU);
        // A drive is its own mirror image.
        let phase = fraction(sign * turns) * phases as f64 - 0.5;
        let root = libm::sqrt(libm::sqrt((sign * flank_n_m).max(0.0) / self.map.header.largest_n_m)) * nodes as f64;
        let row = (root as usize).clamp(1, nodes - 2);
        let along = root - row as f64;
        let (below, above) = (along + 1.0, along - 1.0);
        let beyond = along - 2.0;
        let rows = [
            -along * above * beyond * (1.0 / 6.0),
            below * above * beyond * 0.5,
            -below * along * beyond * 0.5,
            below * along * above * (1.0 / 6.0),
        ];
        let first = libm::floor(phase);
        let columns = lagrange(phase - first);
        let first = first as isize - (WIDTH as isize / 2 - 1);
        let mut error = 0.0;
        for (k, row_weight) in rows.iter().enumerate() {
            let mut at_row = 0.0;
            for (j, weight) in columns.iter().enumerate() {
                let column = (first + j as isize).rem_euclid(phases as isize) as usize;
                at_row += weight * self.plane[(row + k - 1) * phases + column];
            }
            error += row_weight * at_row;
        }
        sign * error
    }

    /// Ends of the play at a generator angle under a load torque: error of the output moving forward and backward, rad.
    pub fn ends_rad(&self, generator_rad: f64, torque_n_m: f64) -> [f64; 2] {
        let drag = self.map.header.drag_n_m;
        // At the very edge the output still rests on the flank that it comes from.
        let behind = if torque_n_m - drag > 0.0 { 1.0 } else { -1.0 };
        let ahead = if torque_n_m + drag < 0.0 { -1.0 } else { 1.0 };
        [
            self.elastic_error_rad(generator_rad, torque_n_m - drag, behind),
            self.elastic_error_rad(generator_rad, torque_n_m + drag, ahead),
        ]
    }

    /// The generator goes to an angle under a load torque; the output angle then, rad.
    pub fn go(&mut self, generator_rad: f64, torque_n_m: f64) -> f64 {
        let [lowest, highest] = self.ends_rad(generator_rad, torque_n_m);
        let stays = self.error_rad - (generator_rad - self.generator_rad) / self.map.header.ratio;
        let below_highest = if stays > highest { highest } else { stays };
        self.error_rad = if below_highest < lowest { lowest } else { below_highest };
        self.generator_rad = generator_rad;
        generator_rad / self.map.header.ratio + self.error_rad
    }

    /// Error of the output now: output less generator over ratio, rad.
    pub fn error_rad(&self) -> f64 {
        self.error_rad
    }

    /// The map.
    pub fn map(&self) -> &GearMap<'a> {
        &self.map
    }
}

/// What is beyond the whole number below.
fn fraction(value: f64) -> f64 {
    value - libm::floor(value)
}

/// Weights of the six points −2 … 3 at a place between 0 and 1.
fn lagrange(x: f64) -> [f64; WIDTH] {
    let [a, b, c, d, e, f] = [x + 2.0, x + 1.0, x, x - 1.0, x - 2.0, x - 3.0];
    let (ab, ef) = (a * b, e * f);
    let (cd, abc, def) = (c * d, ab * c, d * ef);
    [
        b * cd * ef * (-1.0 / 120.0),
        a * cd * ef * (1.0 / 24.0),
        ab * def * (-1.0 / 12.0),
        abc * ef * (1.0 / 12.0),
        ab * cd * f * (-1.0 / 24.0),
        ab * cd * e * (1.0 / 120.0),
    ]
}
