//! Output of CalculiX: tables of numbers under a line that says what they are, for which set and when.

/// One table of a `.dat` file.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// The set it was asked for.
    pub set: String,
    /// Total time; a step of ours lasts 1.
    pub time: f64,
    /// Rows: node, or element and integration point, then the values.
    pub rows: Vec<Vec<f64>>,
}

/// Reads the tables of a `.dat` file. A line that is neither heading nor numbers is an error that quotes it.
pub fn tables(text: &str) -> Result<Vec<Table>, String> {
    let mut tables: Vec<Table> = Vec::new();
    for (at, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let unreadable = || format!("line {}: found {line:?}, which is neither a heading nor numbers", at + 1);
        if let Some((_, rest)) = line.split_once(" for set ") {
            let (set, time) = rest.split_once(" and time ").ok_or_else(unreadable)?;
            let time = time.trim().parse().map_err(|_| unreadable())?;
            tables.push(Table { set: set.trim().to_owned(), time, rows: Vec::new() });
        } else {
            let row: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
            let table = tables.last_mut().ok_or_else(unreadable)?;
            table.rows.push(row.map_err(|_| unreadable())?);
        }
    }
    Ok(tables)
}

/// The rows of a set at the end of a step.
pub fn at_step<'t>(tables: &'t [Table], set: &str, step: usize) -> Option<&'t [Vec<f64>]> {
    let found = tables.iter().find(|table| table.set == set && (table.time - step as f64).abs() < 1e-6)?;
    Some(&found.rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLE: &str = "
 displacements (vx,vy,vz) for set OUTPUT and time  0.1000000E+01

     24841  1.701705E-04 -2.000000E-12  0.000000E+00

 stresses (elem, integ.pnt.,sxx,syy,szz,sxy,sxz,syz) for set BORE_ROW and time  0.2000000E+01

         9   1  5.617588E-01 -6.962324E+01 -2.073150E+01 -3.644788E+00  1.099748E-11 -8.929856E-14
";

    #[test]
    fn tables_are_found_by_set_and_step() {
        let tables = tables(SAMPLE).unwrap();
        assert_eq!(at_step(&tables, "OUTPUT", 1).unwrap(), [vec![24841.0, 1.701705e-4, -2e-12, 0.0]]);
        assert_eq!(at_step(&tables, "BORE_ROW", 2).unwrap()[0][..3], [9.0, 1.0, 0.5617588]);
        assert_eq!(at_step(&tables, "OUTPUT", 2), None);
    }

    #[test]
    fn what_is_not_a_number_is_named() {
        let error = tables(&SAMPLE.replace("1.701705E-04", "NaN-ish")).unwrap_err();
        assert!(error.contains("line 4") && error.contains("NaN-ish"), "{error}");
    }
}
