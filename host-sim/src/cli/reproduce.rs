//! `flexspline reproduce`: the paper's protocol beside the paper's results.

use clap::Args;

use super::{Context, Failure};
use crate::mesh::MeshLevel;

/// The paper's protocol for all four generators, beside the paper's results
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline reproduce
  flexspline reproduce --quick --out quick")]
pub(super) struct Reproduce {
    /// Mesh of the standard runs
    #[arg(long, value_name = "LEVEL", default_value = "standard", value_parser = str::parse::<MeshLevel>)]
    mesh: MeshLevel,
    /// Coarse
    #[arg(long)]
    quick: bool,
}

impl Reproduce {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let drive = context.drive()?;
        let settings = crate::reproduce::ReproduceSettings { mesh: if self.quick { MeshLevel::Coarse } else { self.mesh }, quick: self.quick };
        let r = crate::reproduce::reproduce(&drive, settings, &|_, _, _| std::ops::ControlFlow::Continue(())).map_err(super::simulate::refused_or_failed)?;
        context.print(&r.record(&context.command), String::new)
    }
}
