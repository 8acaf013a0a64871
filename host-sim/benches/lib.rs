//! Benchmarks of the simulator, in processor time: `increment` (an increment of each solver), `parts` (what an
//! increment is made of), `table` (a whole table) and `growth` (time against the size of the mesh).
//! `cargo bench --bench increment` runs one.
