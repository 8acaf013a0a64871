//! The laws of the play operator as a user meets it, through [`Table::forward`]: Madelung's rules, wiping-out,
//! congruency, rate independence, order, symmetry. The table is flat: an error of zero and a play of ±1e-4 rad, so what
//! is seen is the operator alone.

use std::sync::LazyLock;

use flexspline::{Direction, Drive, FixedMember, GeneratorAngle, GeneratorKind, PlayState, Table};
use flexspline_make::{Provenance, TableData, image_bytes, write_image};
use proptest::prelude::*;

/// Counts of the output in half the play: 1e-4 rad.
const HALF: i64 = 68_357;

static IMAGE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let data = TableData {
        drive: Drive::new(188, 190, FixedMember::Flexspline).unwrap(),
        torque_nodes_n_m: &[-20.0, 20.0],
        temperature_nodes_c: &[20.0],
        ripple_nodes: 0,
        mean_rad: &[0.0, 0.0],
        half_width_rad: &[1e-4, 1e-4],
        mean_ripple_rad: &[],
        half_width_ripple_rad: &[],
        generator_curve_rad: &[],
        material_curve_rad: &[],
        output_curve_rad: &[],
        projection_worst_rad: 0.0,
        projection_rms_rad: 0.0,
    };
    let provenance = Provenance {
        generator_kind: GeneratorKind::Cam,
        drive_hash: [0; 32],
        tool_version: "laws",
        mesh_level: "none",
        solver_residual: 0.0,
        torque_range_n_m: [-20.0, 20.0],
        temperature_range_c: [0.0, 40.0],
        error_limit_rad: 0.02,
    };
    let mut image = vec![0; image_bytes(2, 1, 0, [0; 3])];
    write_image(&data, &provenance, &mut image, |_| [0; 8]).unwrap();
    image
});

/// Where the output is after a path of nominal outputs, in counts; 95 counts of the generator are one of the output.
fn follow(state: &mut PlayState, path: impl IntoIterator<Item = i64>) -> i64 {
    let table = Table::check(&IMAGE).unwrap();
    let mut output = 0;
    for nominal in path {
        let found = table.forward(state, GeneratorAngle::from_counts(95 * nominal), 5.0, 20.0);
        output = found.output.counts();
    }
    output
}

fn known() -> PlayState {
    let mut state = PlayState::after_motion(Direction::Forward);
    follow(&mut state, [0]);
    state
}

/// Positions of a path of steps.
fn positions(from: i64, steps: &[i64]) -> Vec<i64> {
    steps
        .iter()
        .scan(from, |at, step| {
            *at += step;
            Some(*at)
        })
        .collect()
}

const FAR: std::ops::Range<i64> = -3 * HALF..3 * HALF;

#[test]
fn a_loop_has_the_corners_of_the_play() {
    let mut state = known();
    let corners = [(4, 3), (2, 3), (0, 1), (1, 1), (2, 1), (4, 3)];
    for (nominal, output) in corners {
        // The table keeps the half-width to a count.
        let away = follow(&mut state, [nominal * HALF]) - output * HALF;
        assert!(away.abs() <= 1, "{nominal}: {away}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Madelung's second and third rule, to any depth: inner loops close at their turning points, and beyond the
    /// turning point of the outermost the motion goes on as if they had not been.
    #[test]
    fn inner_loops_close_at_their_turning_points(
        before in prop::collection::vec(FAR, 0..5), stroke in 10..6 * HALF,
        shares in prop::collection::vec(1i64..100, 1..6), beyond in 0..4 * HALF, backward in any::<bool>(),
    ) {
        let sign = if backward { -1 } else { 1 };
        let mut state = known();
        let start: i64 = before.iter().sum();
        follow(&mut state, positions(0, &before));
        let top = start + sign * stroke;
        let at = follow(&mut state, [top]);
        let turning = state;
        let strokes: Vec<i64> = shares.iter().scan(
            stroke, |left, share| { *left = *left * share / 100; Some(*left) },
        ).collect();
        let inner = strokes.iter().enumerate();
        let inner: Vec<i64> = inner.map(|(i, s)| if i % 2 == 0 { -sign * s } else { sign * s }).collect();
        let out: Vec<i64> = inner.iter().rev().map(|step| -step).collect();
        let inside = positions(top, &inner);
        follow(&mut state, inside.iter().copied());
        let back = follow(&mut state, positions(*inside.last().unwrap(), &out));
        prop_assert_eq!((back, state), (at, turning));
        let mut straight = turning;
        prop_assert_eq!(follow(&mut state, [top + sign * beyond]), follow(&mut straight, [top + sign * beyond]));
    }

    /// Madelung's first rule: after a turn the way depends on the turning point and the memory there alone, not on how
    /// it was come to.
    #[test]
    fn what_follows_a_turn_depends_on_the_turn(
        histories in prop::array::uniform2(prop::collection::vec(FAR, 0..6)), after in prop::collection::vec(FAR, 1..8),
    ) {
        let mut ways = Vec::new();
        for history in &histories {
            let mut state = known();
            let end: i64 = history.iter().sum();
            follow(&mut state, positions(0, history));
            // To the same turning point, through the whole play.
            let low = end.min(0) - 20 * HALF;
            follow(&mut state, [low, 0]);
            let way: Vec<i64> = positions(0, &after).into_iter().map(|at| follow(&mut state, [at])).collect();
            ways.push(way);
        }
        prop_assert_eq!(&ways[0], &ways[1]);
    }

    /// Wiping-out: of what came before only extremes that were not exceeded since are remembered.
    #[test]
    fn a_larger_stroke_wipes_out_all_before(
        first in prop::collection::vec(FAR, 0..8), second in prop::collection::vec(FAR, 0..8),
    ) {
        let (mut one, mut other) = (known(), known());
        follow(&mut one, positions(0, &first));
        follow(&mut other, positions(0, &second));
        let beyond = first.iter().chain(&second).map(|step| step.abs()).sum::<i64>() + 3 * HALF;
        follow(&mut one, [beyond]);
        follow(&mut other, [beyond]);
        prop_assert_eq!(one, other);
    }

    /// Congruency: loops between the same extremes have the same shape; here they differ in height alone, by any
    /// history.
    #[test]
    fn loops_between_the_same_extremes_are_congruent(
        histories in prop::array::uniform2(prop::collection::vec(FAR, 0..8)), amplitude in 1..4 * HALF,
        part in 0i64..=100,
    ) {
        let rises = histories.map(|history| {
            let mut state = known();
            follow(&mut state, positions(0, &history));
            let low = follow(&mut state, [0, amplitude, 0]);
            follow(&mut state, [amplitude * part / 100]) - low
        });
        prop_assert_eq!(rises[0], rises[1]);
    }

    /// Rate independence: cutting the way into pieces changes nothing, nor does standing still.
    #[test]
    fn only_the_turning_points_matter(steps in prop::collection::vec(FAR, 1..20), pieces in 1i64..9) {
        let (mut coarse, mut fine) = (PlayState::unknown(), PlayState::unknown());
        follow(&mut coarse, [0]);
        follow(&mut fine, [0, 0]);
        let mut from = 0;
        for to in positions(0, &steps) {
            follow(&mut coarse, [to]);
            follow(&mut fine, (1..=pieces).map(|i| from + (to - from) * i / pieces).chain([to]));
            from = to;
        }
        prop_assert_eq!(coarse, fine);
    }

    /// Order: of two motions the one that is ahead all the way never has its output behind.
    #[test]
    fn what_is_ahead_stays_ahead(path in prop::collection::vec((-5 * HALF..5 * HALF, 0..5 * HALF), 1..20)) {
        let (mut behind, mut ahead) = (known(), known());
        for (at, lead) in path {
            prop_assert!(follow(&mut behind, [at]) <= follow(&mut ahead, [at + lead]));
        }
    }

    /// Symmetry: the mirrored motion has the mirrored output.
    #[test]
    fn mirrored_motion_has_mirrored_output(steps in prop::collection::vec(FAR, 1..20)) {
        let (mut one, mut mirrored) = (known(), PlayState::after_motion(Direction::Backward));
        follow(&mut mirrored, [0]);
        for at in positions(0, &steps) {
            prop_assert_eq!(follow(&mut one, [at]), -follow(&mut mirrored, [-at]));
        }
    }
}
