//! Variants of a drive: planned, computed on one machine or many, and reduced to answers.
//!
//! ```text
//! PATH=FROM..TO -> vary       -> plan: plan.csv, one variant a line, and plan.json, how variants are computed
//! TOL.toml      -> tolerance  -> draw, respond (kernels and responses by FEM) -> plan
//! plan          -> run        -> results/*.csv, a row for each variant and generator, appended in their order
//! results       -> reduce     -> judge: constraints, Pareto front; scatter, quantiles, rank correlations
//! ```
//!
//! Variants of `--vary` have their data sheets computed by contact FEM, drives drawn from tolerances the error over a
//! turn by kernels ([`crate::kernels`]). Nothing passes between shards, and nothing is kept outside files: any engine
//! may run them in any order, more than once, and kill them. Elementary functions of kernels are those of `libm`, so
//! that their figures have the same bits on every machine; figures of the FEM are the same on one kind of processor.

mod draw;
mod judge;
mod model;
mod plan;
mod reduce;
mod respond;
mod run;
mod tolerance;
mod vary;

pub use judge::{Constraint, ConstraintError, Judge, Sense};
pub use plan::{NUMBER, PlanError, PlanSettings, SweepProgress, VariantPlan};
pub use reduce::{FigureSpread, OfGenerator, RankCorrelation, ReducedSweep, reduce};
pub use run::{Ran, RunStatus, Shard, VariantRow, run};
pub use tolerance::{EXAMPLE, Tolerances};
pub use vary::{Vary, VaryError, is_error_of_making};

#[cfg(test)]
mod tests;
