//! Tolerances: thousands of drives drawn from what a drawing allows, on whatever can call a command with a number.
//!
//! ```text
//! TOL.toml -> tolerance -> plan: FEM of the drive as drawn (kernels, responses) -> plan.json, whose BLAKE3 is the plan's hash
//! plan, i  -> draw      -> drive i, a pure function of the plan's hash and i
//! drive i  -> model     -> its figures by kernels; of the first drives by FEM too (`by_fem`)
//! drives i, i + S, ...  -> shard: one Parquet file, written whole, with the plan's hash, its rows and a checksum inside
//! shards   -> reduce    -> quantiles, probabilities, Sobol indices, what to tighten first, the worst drives
//! ```
//!
//! Nothing passes between shards, and nothing is remembered outside their files: any engine may run them in any order,
//! more than once, and kill them. What it takes to evaluate a drive by kernels is in `plan.json`, and elementary
//! functions are those of `libm`, so that its figures have the same bits on every machine; those of the FEM are the
//! same on one kind of processor.

mod by_fem;
mod draw;
mod model;
mod plan;
mod reduce;
mod shard;
mod tolerance;
mod variance;

pub(crate) use draw::Drawn;
pub use flexspline_base::statistics::{Exceeded, Interval, Quantile};
pub use model::{FIGURES, Model, Parabola, Response};
pub use plan::{OfOne, Plan, PlanError, PlanProgress, PlanSettings, plan};
pub use reduce::{
    Campaign, Controlled, FemComparison, FigureShares, FigureSpread, JUDGED, OfGenerator, ReduceError, SHARED, Tail,
    Tightened, WorstDrive, reduce, worst_path,
};
pub use shard::{Became, Shard, ShardError, ShardState, look, run_shard};
pub use tolerance::{Distribution, EXAMPLE, Law, TeethError, Tolerance, ToleranceActs, Tolerances};

#[cfg(test)]
mod tests;
