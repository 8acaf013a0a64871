//! The third dimension: a rim in its sleeve as solid elements of CalculiX, and as our shells.

use std::path::Path;
use std::process::Command;

use flexspline_mechanics::drive::Drive;
use flexspline_mechanics::sleeve::Flexspline3d;

use crate::Claims;
use crate::dat::at_step;
use crate::program::{Limits, calculix};

/// Largest relative difference of K2 of the band, and of its tilt. Found: 0.4 and 0.03 %; solids and shells were found
/// to agree to 1 % on bands before there was this deck.
const STIFFNESS: f64 = 0.01;
const TILT: f64 = 0.01;
/// Where a run stops being worth waiting for; it takes one second.
const LIMITS: Limits = Limits { cpu_s: 60.0, memory_mb: 2000.0 };

/// Drives with a cup, and with sleeves whose bottom the deck has.
const CASES: [(&str, &str); 2] = [("CUP-95", "sleeve.bottom=disc"), ("HHD-95-hermetic", "sleeve.bottom=disc")];

/// Both sleeves; what is to stand in the last line.
pub fn sleeves(ccx: &Path, flexspline: &Path, out: &Path, claims: &mut Claims) -> Result<String, String> {
    let mut lines = Vec::new();
    for (name, set) in CASES {
        let folder = out.join(format!("sleeve-{name}"));
        let drive =
            Drive::built_in(name).ok_or("a built-in drive")?.with_set(set).map_err(|error| error.to_string())?;
        let mut command = Command::new(flexspline);
        command.args(["export", "--format", "inp", "--generator", "cam", "--quiet", "--drive", name, "--set", set]);
        let made = command.arg("--out").arg(&folder).output().map_err(|error| error.to_string())?;
        if !made.status.success() {
            return Err(format!("export of {name}: {}", String::from_utf8_lossy(&made.stderr)));
        }
        let (used, tables) = calculix(ccx, &folder, "sleeve", LIMITS)?;
        let row = at_step(&tables, "BAND", 1).and_then(|rows| rows.first()).ok_or("no displacement of BAND")?;
        let (w, tilt) = (row[1], row[2]);

        let shells = Flexspline3d::of(&drive, false).map_err(|error| error.to_string())?.harmonic(2);
        // The force is what makes w0 by the shells.
        let stiffness = shells.k_band_n_per_mm * drive.generator.w0_mm / w;
        // z runs from the flange to the bottom; a tilt counts away from what holds the rim.
        let away = if drive.sleeve.has_flange() { 1.0 } else { -1.0 };
        let tilt = away * tilt / w;
        let (k_apart, tilt_apart) = (stiffness / shells.k_band_n_per_mm - 1.0, tilt / shells.tilt_rad_per_mm - 1.0);
        println!("== sleeve of {name}, {set}; CalculiX {:.1} s, {:.0} MB", used.cpu_s, used.memory_mb);
        println!(
            "  K2 of the band {stiffness:.1} and {:.1} N/mm, tilt {:.4} and {:.4} mrad/mm",
            shells.k_band_n_per_mm,
            1e3 * tilt,
            1e3 * shells.tilt_rad_per_mm
        );
        claims.check(&format!("K2 within {:.0} %", 100.0 * STIFFNESS), k_apart.abs() <= STIFFNESS);
        claims.check(&format!("tilt within {:.0} %", 100.0 * TILT), tilt_apart.abs() <= TILT);
        lines.push(format!(
            "sleeve of {name} in solids: K2 {:+.2} %, tilt {:+.2} %",
            100.0 * k_apart,
            100.0 * tilt_apart
        ));
    }
    Ok(lines.join(", "))
}
