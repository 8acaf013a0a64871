//! What a campaign says of drives by kernels is what the FEM says of the same drives, figure by figure, where all of a
//! small campaign are computed by both.
//!
//! Reference: the FEM of drives with those deviations. Physics wrong if this fails: a sign, a phase, a wheel taken for
//! the other, or a load of the kernels that is not that of the campaign.

use flexspline_tests::command::Desk;

#[test]
fn drives_by_kernels_are_those_by_fem() {
    let desk = Desk::new();
    desk.write("teeth.toml", include_str!("../examples/campaign/teeth.toml"));
    desk.line("campaign plan teeth.toml --drives 8 --shards 2 --fem 8 --fem-places 5 --out small").done();
    desk.line("campaign run small --shard all").done();
    let reduced = desk.line("campaign reduce small --json").done().json();
    let fem = &reduced["generators"][0]["fem"];
    assert_eq!((fem["drives"].as_u64(), reduced["generators"][0]["fem_failed"].as_u64()), (Some(8), Some(0)));
    for figure in fem["figures"].as_array().unwrap() {
        println!("{figure}");
        let of = |name: &str| figure[name].as_f64().unwrap();
        assert!(of("correlation") > 0.99 && (of("slope") - 1.0).abs() < 0.05, "{figure}");
        assert!((of("kernels_mean") / figure["plain"]["value"].as_f64().unwrap() - 1.0).abs() < 0.02, "{figure}");
        // All drives are in both: the control has nothing to add.
        let [plain, controlled] = ["plain", "controlled"].map(|name| figure[name]["value"].as_f64().unwrap());
        assert!((plain - controlled).abs() < 1e-9, "{figure}");
    }
}
