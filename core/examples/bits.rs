//! A hash over every bit of 100 000 ticks with each table named, to compare with that of the target
//! (`tests/firmware/src/bin/bits.rs`).
//!
//! ```sh
//! cargo run --release -p flexspline --example bits -- out/cam.fxt out/two-roller.fxt
//! ```

#[path = "../../tests/firmware/src/trajectory.rs"]
mod trajectory;

fn main() -> std::io::Result<()> {
    for path in std::env::args().skip(1) {
        let image = std::fs::read(&path)?;
        let twin = image.clone();
        let name = std::path::Path::new(&path).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        println!("{name} {:016x}", trajectory::run([&image, &twin], &mut flexspline::Store::new(), 100_000));
    }
    Ok(())
}
