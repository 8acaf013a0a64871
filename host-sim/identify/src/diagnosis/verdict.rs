//! The verdict: which of the causes found may be named, how sure that is, and what is left.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::base::HELD;
use super::candidate::{Label, Law, Per, standing_pitch_error};
use super::model::{Problem, Term, but};
use super::noise::Noise;
use super::report::{
    Cause, Compensation, Diagnosis, EvidenceBy, Finding, FittedFault, HeldOut, Hint, Parameter, Residual, SetOfCauses,
    Unexplained, Verdict,
};
use super::rows::rms;
use super::select::{self, Selected, Standing, standings};
use super::thresholds::selection::OUT_OF_TOLERANCE;
use super::thresholds::verdict::*;
use super::trace::{Gate, Judged, Stage, Trace, passed};
use super::uncertainty::{self, Known};
use super::{Search, Settings, experiment, held_out, remainder, rivals, with_speed};
use crate::causes::{CauseName, Kin, ParameterName};
use crate::measurement::{FaultName, whole_pitches};
use crate::nominal::{Nominal, OF_TWO_LOBES};
use flexspline_base::units::ARCSEC_PER_RAD;

/// The verdict over what a `search` has selected, with its causes and what is left over. Rivals are looked at on a
/// sample of the rows first, where there is one.
pub(super) fn conclude(
    search: &Search<'_>,
    selected: &Selected<'_>,
    sample: &rivals::OnSample<'_>,
    mut left_over: Vec<Unexplained>,
    settings: &Settings<'_>,
    mut trace: Trace,
) -> Diagnosis {
    let Search { problem, laws, .. } = search;
    let noise = problem.fineness.noise;
    let hidden_lines: Vec<Label> = search.fast.iter().map(|(label, _)| *label).collect();
    let standings = standings(problem, selected);
    for (k, term) in selected.terms.iter().enumerate() {
        let gates = select::earns(problem, selected, &standings, k, select::least_size(noise.white));
        trace.decided(Stage::Settled, term.law.label, None, gates);
    }
    // A zero that the bench sets in each session is told of the data: it is no discrepancy of the drive, with or
    // without a cause.
    let zeros = zeros_of_sessions(problem, selected);
    let of_the_bench =
        |term: &Term<'_>| term.law.is_of_the_data() && (!term.law.is_zero_of_sessions() || !zeros.is_empty());
    let given: Vec<Term<'_>> = selected.terms.iter().filter(|term| of_the_bench(term)).cloned().collect();
    let before = Selected::of(problem, given).map_or(Vec::new(), |given| remainder::left(problem, &given));
    let after = remainder::left(problem, selected);
    let floor = floor(problem, noise);
    let (rms_before, rms_after) = (problem.certain_rms(&before), problem.certain_rms(&after));
    let explainable = (rms_before * rms_before - floor * floor).max(0.0);
    let unexplained = (rms_after * rms_after - floor * floor).max(0.0);

    let known = known(problem, selected, noise);
    let unnamed = unnamed(selected, &standings, &left_over, &hidden_lines);
    let left_of_noise = rms_after / floor.max(1e-30);
    let named = understood(problem, selected, &standings, &known, &unnamed, [noise.white, left_of_noise], &mut trace);
    let held = held_out::evaluate(problem, &selected.terms);
    // What predicts sessions left out hardly better than the others do is a hint: it says nothing of the drive.
    let mut hints = Vec::new();
    let (named, too_little): (Vec<usize>, Vec<usize>) = named
        .into_iter()
        .partition(|k| held.gains_beside[*k].is_nan() || held.gains_beside[*k] >= LEAST_GAIN_OF_A_NAME);
    for k in &too_little {
        let (label, gain) = (selected.terms[*k].law.label, held.gains_beside[*k]);
        let gates = vec![Judged::above(Gate::LeftOut, gain, LEAST_GAIN_OF_A_NAME)];
        trace.decided(Stage::Verdict, label, None, gates);
        hints.extend(selected.terms[*k].law.cause().map(|name| Hint::of(name, gain)));
    }
    let only_hints = |k: usize| too_little.contains(&k) && held.gains_beside[k] >= 0.0;
    // A zero of each session hides nothing of what goes on within one. One that may be teeth that have skipped is not
    // understood with nothing else found.
    let zeros_alone =
        named.is_empty() && selected.terms.iter().any(|term| term.law.is_zero_of_sessions() && !of_the_bench(term));
    let strongest = named.iter().map(|k| standings[*k].size).fold(0.0, f64::max);
    left_over.retain(|l| l.size_arcsec > LEAST_LEFT_OF_STRONGEST * strongest);
    let without_name = |k: usize| !named.contains(&k) && !only_hints(k) && !selected.terms[k].law.is_of_the_data();
    let significant_left = !left_over.is_empty() || (0..selected.terms.len()).any(without_name) || zeros_alone;
    // What does not predict sessions it was not fitted to, better than the adapted model and than none, is no
    // explanation.
    let (before_out, after_out) = (held.total.rms_before_arcsec, held.total.rms_after_arcsec);
    let most = NO_WORSE * before_out.min(compensation(problem, after_out).rms_uncompensated_arcsec);
    let no_worse = Judged { passed: after_out <= most, ..Judged::below(Gate::NoWorse, after_out, most) };
    let verdict = match (named.is_empty(), significant_left) {
        (true, false) => Verdict::None,
        (true, true) => Verdict::Unknown,
        (false, _) if !no_worse.passed => Verdict::Unknown,
        (false, false) => Verdict::Explained,
        (false, true) => Verdict::PartlyExplained,
    };
    for k in &named {
        trace.decided(Stage::Verdict, selected.terms[*k].law.label, None, vec![no_worse]);
    }
    let all_is_told = verdict == Verdict::Explained && is_explained(problem, rms_after, floor, held.total);
    let (mut causes, mut effects) = (Vec::new(), Vec::new());
    let mut next_experiment = None;
    if verdict != Verdict::Unknown {
        let of_all: Vec<Vec<rivals::RefittedCause<'_>>> = named
            .par_iter()
            .with_max_len(1)
            .map(|k| rivals::rivals(search, sample, selected, (*k, standings[*k].size)))
            .collect();
        for (k, rivals) in named.iter().copied().zip(of_all) {
            let Some(name) = selected.terms[k].law.cause() else { continue };
            for rival in &rivals {
                trace.decided(Stage::Rival, name.into(), Some(rival.cause.into()), vec![rival.told_apart()]);
                trace.decided(Stage::Rival, rival.cause.into(), Some(name.into()), vec![rival.as_rival()]);
            }
            let at_limit = at_limit(search, selected, k);
            let others = rivals.iter().filter(|r| r.alike() && !at_limit.contains(&r.cause));
            let all = at_limit.iter().map(|cause| (*cause, 0.0)).chain(others.map(|r| (r.cause, r.misfit)));
            let misfits: Vec<(CauseName, f64)> = all.take(3).collect();
            let alike: Vec<CauseName> = misfits.iter().map(|(cause, _)| *cause).collect();
            let closest = rivals.first().map(|r| (r.cause, r.misfit));
            if !alike.is_empty() && next_experiment.is_none() {
                let named: Vec<&Law> = alike.iter().filter_map(|a| laws.iter().find(|law| law.is(*a))).collect();
                next_experiment = experiment::next(&problem.on, &selected.terms[k], selected.fit.of(k), &named, noise)
                    .map(|(text, apart)| {
                        format!("{text}; expected to tell them apart by {apart:.0} standard deviations")
                    });
            }
            let look_alike_outside = outside(k, name, &known[k], selected, problem, all_is_told);
            let shares = shares(name, &misfits, look_alike_outside.is_some(), closest, known[k].size_told);
            causes.push(Cause {
                name,
                confidence: shares[0].1,
                evidence: standings[k].evidence,
                evidence_by: evidence_by(problem, selected, k),
                parameters: known[k].parameters.clone(),
                held_out_gain: held.gains.get(k).copied().unwrap_or(0.0),
                size_arcsec: standings[k].size,
                look_alikes: alike_with_wheel(name, alike, &known[k], problem.on.nominal),
                look_alike_outside,
            });
            effects.push(shares);
        }
        // As the odds are shown; of equal ones the larger first.
        let odds = |cause: &Cause| (100.0 * cause.confidence).round();
        causes.sort_by(|a, b| odds(b).total_cmp(&odds(a)).then(b.size_arcsec.total_cmp(&a.size_arcsec)));
    }
    // Of a cause that was asked about and not named: what would tell it from the strongest that is.
    let not_named = |asked: &CauseName| causes.iter().all(|cause| cause.name != *asked);
    let experiment_for_asked = settings.asked.filter(not_named).and_then(|asked| {
        let k = selected.terms.iter().position(|term| causes.first().is_some_and(|first| term.law.is(first.name)))?;
        let law = laws.iter().find(|law| law.is(asked))?;
        Some(experiment::next(&problem.on, &selected.terms[k], selected.fit.of(k), &[law], noise)?.0)
    });
    let verdict = match verdict {
        Verdict::Explained | Verdict::PartlyExplained if causes.is_empty() => Verdict::Unknown,
        Verdict::Explained if !all_is_told => Verdict::PartlyExplained,
        other => other,
    };
    let once_in_a_turn = |cause: &Cause| {
        let k = (0..known.len()).find(|k| selected.terms[*k].law.is(cause.name))?;
        waves_per_generator_turn(cause.name, &known[k], problem.on.nominal)
    };
    let turned = || causes.iter().find_map(once_in_a_turn).map(experiment::turn_the_encoder);
    let anyhow = || (verdict != Verdict::None).then(|| experiment::anyhow(&problem.on, verdict == Verdict::Unknown));
    let next_experiment = next_experiment.or_else(turned).or_else(anyhow);
    // Nothing named, nothing extended: what has no name helps to see what is there, and predicts nothing for anybody.
    let mut held_out = held.total;
    if causes.is_empty() {
        held_out.rms_after_arcsec = held_out.rms_before_arcsec;
    }
    let mut unexplained_list: Vec<Unexplained> = (0..selected.terms.len())
        .filter(|k| !named.contains(k) || verdict == Verdict::Unknown)
        .filter(|k| !too_little.contains(k))
        .filter(|k| !of_the_bench(&selected.terms[*k]))
        .map(|k| Unexplained { looks_like: selected.terms[k].law.label.to_string(), size_arcsec: standings[k].size })
        .collect();
    unexplained_list.extend(left_over);
    for (line, words) in with_speed::words(problem, selected, &known, &hidden_lines) {
        unexplained_list.iter_mut().filter(|left| left.looks_like == line).for_each(|left| left.looks_like += &words);
    }
    Diagnosis {
        schema_version: 1,
        verdict,
        finding: Finding::of(verdict),
        causes,
        posterior: posterior(&effects),
        hints,
        residual: Residual {
            rms_before_arcsec: rms_before,
            rms_after_arcsec: rms_after,
            // A wander that is looked for before the causes may hold a part of them: noise is no more than what is
            // left.
            noise_floor_arcsec: floor.min(rms_after),
            unexplained_fraction: if explainable > 0.0 { (unexplained / explainable).min(1.0) } else { 0.0 },
            rows_averaged: problem.whitener.stride,
        },
        held_out,
        compensation: compensation(problem, held_out.rms_after_arcsec),
        unexplained: unexplained_list,
        recalibrated: recalibrated(problem, selected),
        noise_arcsec: [noise.white, noise.wander],
        wander_correlation_s: noise.correlation_s,
        next_experiment,
        experiment_for_asked,
        fitted_faults: fitted_faults(problem, selected),
        zeros,
        set_aside: None,
        trace,
    }
}

/// Causes of the same kind as term `k` whose parameter of the nominal model the fit holds at its limit: it takes their
/// place, and nobody can tell what of it is the term's.
pub(super) fn at_limit(search: &Search<'_>, selected: &Selected<'_>, k: usize) -> Vec<CauseName> {
    let is_held = |law: &&Law| {
        let change = select::tolerance(&search.problem, &selected.fit, law).and_then(|judged| judged.value);
        selected.terms[k].law.wrong.kin.share(law.wrong.kin) == 1.0
            && change.is_some_and(|stds| stds.abs() > OUT_OF_TOLERANCE)
            && selected.terms.iter().all(|term| term.law.label != law.label)
    };
    search.laws.iter().filter(is_held).filter_map(Law::cause).collect()
}

/// The zero of every session less that of the first, where the bench sets it anew: a law of it was chosen, or sessions
/// are known to have their own. None where from one session to the next it moves by whole tooth pitches: teeth may have
/// skipped.
fn zeros_of_sessions(problem: &Problem<'_>, selected: &Selected<'_>) -> Vec<Parameter> {
    let rows = problem.on.rows;
    let term = selected.terms.iter().position(|term| term.law.is_zero_of_sessions());
    if term.is_none() && rows.zeros.is_empty() {
        return Vec::new();
    }
    let coefficients = &selected.fit.solution.coefficients;
    let covariance = selected.fit.solution.covariance();
    let n = coefficients.len();
    let at_term = term.map(|k| selected.fit.starts[k]);
    let mut zeros: Vec<Parameter> = Vec::new();
    let (mut place, mut before) = (0, 0.0);
    for session in 0..rows.sessions.len() {
        // Those that are known to be own ones count from their session on, and float first among the base, after the
        // one zero of all.
        let known = (1..=rows.zeros.len()).filter(|j| rows.zeros[j - 1] <= session);
        let learnt = rows.used.get(session).copied().unwrap_or(false);
        let of_law = at_term.filter(|_| learnt).and_then(|at| {
            place += 1;
            (place > 1).then(|| at + place - 2)
        });
        let parts: Vec<usize> = known.chain(of_law).collect();
        let value = parts.iter().map(|i| coefficients[*i]).sum::<f64>();
        let of_row = |i: &usize| parts.iter().map(|j| covariance[i * n + j]).sum::<f64>();
        let variance: f64 = parts.iter().map(of_row).sum();
        let zero = Parameter { value, std: variance.max(0.0).sqrt() };
        let jump = of_law.map_or(0.0, |i| coefficients[i]) - before;
        before = of_law.map_or(before, |i| coefficients[i]);
        // Then teeth may have skipped while nobody recorded.
        let [jump_rad, std_rad] = [jump, zero.std].map(|arcsec| arcsec / ARCSEC_PER_RAD);
        let pitches = whole_pitches(jump_rad, &problem.on.nominal.gear(), BESIDE_PITCHES, INTERVAL * std_rad);
        if session > 0 && !rows.zeros.contains(&session) && pitches.is_some() {
            return Vec::new();
        }
        zeros.push(zero);
    }
    if is_another_one(&zeros) { zeros } else { Vec::new() }
}

/// Faults of the data that were chosen among the causes.
fn fitted_faults(problem: &Problem<'_>, selected: &Selected<'_>) -> Vec<FittedFault> {
    let covariance = selected.fit.solution.covariance();
    let of = |(k, term): (usize, &Term<'_>)| {
        let Label::Fault { name, session, since_s } = term.law.label else { return None };
        let at = selected.fit.starts[k];
        let (value, variance) =
            (selected.fit.of(k)[0], covariance[at * (selected.fit.solution.coefficients.len() + 1)]);
        // The column of a drift is a share of all the time.
        let per = if name == FaultName::Drift { 3600.0 / problem.on.scales.duration_s } else { 1.0 };
        let size = Parameter { value: value * per, std: variance.max(0.0).sqrt() * per };
        Some(FittedFault { name, session, since_s, size })
    };
    selected.terms.iter().enumerate().filter_map(of).collect()
}

/// Whether the zero of a session is known to be another one: what the laws leave may pass for one that is hardly there.
fn is_another_one(zeros: &[Parameter]) -> bool {
    zeros.iter().any(|zero| zero.value.abs() > SIZE_KNOWN * zero.std)
}

/// Whether causes explain the error: what is left is near the noise, and in sessions left out the model with them beats
/// the nominal one and none at all.
fn is_explained(problem: &Problem<'_>, rms_after: f64, floor: f64, held_out: HeldOut) -> bool {
    let compared = compensation(problem, held_out.rms_after_arcsec);
    let best_without = compared.without_causes_arcsec().min(held_out.rms_before_arcsec);
    rms_after <= NEAR_NOISE * floor && compared.rms_extended_tables_arcsec < best_without
}

/// What has no name, with its size, arcsec; its label where it has one. A zero that the bench sets in each session is
/// none of it.
fn unnamed(
    selected: &Selected<'_>,
    standings: &[Standing],
    left_over: &[Unexplained],
    hidden_lines: &[Label],
) -> Vec<(Option<Label>, f64)> {
    let terms = selected.terms.iter().zip(standings);
    let terms = terms
        .filter(|(term, _)| !term.law.named() && !term.law.is_of_the_data())
        .map(|(term, standing)| (Some(term.law.label), standing.size));
    let hidden = |called: &str| hidden_lines.iter().find(|line| line.to_string() == called).copied();
    terms.chain(left_over.iter().map(|left| (hidden(&left.looks_like), left.size_arcsec))).collect()
}

/// The largest line in time near a frequency, arcsec.
fn swinging_near(unnamed: &[(Option<Label>, f64)], frequency_hz: f64) -> f64 {
    let near = |label: &Option<Label>| match label {
        Some(Label::Line { per: Per::Second, order }) => (order - frequency_hz).abs() < SWINGS_NEAR * frequency_hz,
        _ => false,
    };
    unnamed.iter().filter(|(label, _)| near(label)).map(|(_, size)| *size).fold(0.0, f64::max)
}

/// Which terms are causes that may be named. Of what is left: the white noise, arcsec, and how much of noise it is.
fn understood(
    problem: &Problem<'_>,
    selected: &Selected<'_>,
    standings: &[Standing],
    known: &[Known],
    unnamed: &[(Option<Label>, f64)],
    [white, left_of_noise]: [f64; 2],
    trace: &mut Trace,
) -> Vec<usize> {
    let is_named = |k: &usize| selected.terms[*k].law.named();
    let sizes = || unnamed.iter().map(|(_, size)| *size);
    let (largest, together) = (sizes().fold(0.0, f64::max), sizes().fold(0.0, f64::hypot));
    let mut named = Vec::new();
    for k in (0..selected.terms.len()).filter(is_named) {
        let size = standings[k].size;
        let mut gates = vec![Judged::above(Gate::ToldFromZero, known[k].told_from_zero, TOLD_FROM_ZERO)];
        if largest > LARGE_BESIDE * size {
            gates.push(Judged::above(Gate::KnownWell, known[k].times_its_doubt, KNOWN_BESIDE));
        }
        if load_makes_it(selected.terms[k].law.cause(), problem) {
            let left = left_of_noise.hypot(together / white);
            gates.push(Judged::below(Gate::LoadKnown, left, NEAR_NOISE));
        }
        if let Some(frequency) = known[k].parameters.get(ParameterName::FrequencyHz.as_str()) {
            // What swings on at its own frequency, whatever the drive does, is driven by something else.
            let share = swinging_near(unnamed, frequency.value) / size;
            gates.push(Judged::below(Gate::NoLineBeside, share, LARGE_BESIDE));
        }
        gates.extend(growth_with_speed(problem, selected, &known[k], k));
        if passed(&gates) {
            named.push(k);
        }
        trace.decided(Stage::Understood, selected.terms[k].law.label, None, gates);
    }
    named
}

/// Whether a cause that is one line of the generator's angle is no larger in fast motion than in slow: what the motor's
/// torque shakes is. Lines of an encoder may fade where its reading is averaged, or scatters in time.
fn growth_with_speed(problem: &Problem<'_>, selected: &Selected<'_>, known: &Known, k: usize) -> Option<Judged> {
    let order = waves_per_generator_turn(selected.terms[k].law.cause()?, known, problem.on.nominal)?;
    let growth = with_speed::with_speed(problem, selected, Some(k), order)?.grows_by();
    Some(Judged::below(Gate::NoGrowthWithSpeed, growth, with_speed::NO_GROWTH))
}

/// Noise of an average, wander with it, arcsec.
fn floor(problem: &Problem<'_>, noise: Noise) -> f64 {
    let rows_of_an_average = problem.on.rows.count_used() as f64 / problem.data.len() as f64;
    (noise.white * rms(&problem.on.rows.loudness) / rows_of_an_average.sqrt()).hypot(noise.wander)
}

/// How well each term is known beside the others.
fn known(problem: &Problem<'_>, selected: &Selected<'_>, noise: Noise) -> Vec<Known> {
    let left = problem.certain_rms(&remainder::left(problem, selected));
    uncertainty::known(problem, selected, beyond_noise(left, floor(problem, noise)))
}

/// By what noise counts more where more is left than that (Birge 1932): the laws are not right to the noise then.
fn beyond_noise(rms_after: f64, floor: f64) -> f64 {
    let ratio = rms_after / floor.max(1e-30);
    if ratio > NOISE_KNOWN_TO { ratio } else { 1.0 }
}

/// What makes the same as a cause and is no cause of the library, or none that could be held against it, if there is
/// something.
fn outside(
    k: usize,
    name: CauseName,
    known: &Known,
    selected: &Selected<'_>,
    problem: &Problem<'_>,
    all_is_told: bool,
) -> Option<&'static str> {
    let nominal = problem.on.nominal;
    let law = selected.terms[k].law;
    let of_load = matches!(law.wrong.kin, Kin::Torque | Kin::Friction | Kin::Drag | Kin::Clearance | Kin::Motion);
    let standing = standing_pitch_error(nominal);
    let at_output = known.parameters.get(ParameterName::Encoder.as_str()).is_some_and(|encoder| encoder.value == 1.0);
    let is_subdivision = name == CauseName::EncoderSubdivision && at_output;
    let part_of_a_turn = is_subdivision && problem.on.output_span_rad() < std::f64::consts::TAU;
    let not_held_against_it = nominal.teeth.is_none()
        || name == CauseName::EncoderSubdivision
        || but(&selected.terms, k).any(|other| other.law.is(standing));
    let waves = waves_per_generator_turn(name, known, nominal);
    let once = matches!(name, CauseName::GeneratorEncoderEccentricity | CauseName::OutputEncoderEccentricity);
    let stated = |order: &f64| nominal.harmonics.iter().any(|of| of.order_per_generator_turn == *order);
    let harmonic = known.parameters.get(ParameterName::Harmonic.as_str()).map(|harmonic| harmonic.value);
    let order = waves.or(harmonic.filter(|_| name == standing));
    let of_two_lobes = order.is_some_and(|order| OF_TWO_LOBES.contains(&order) && !stated(&order));
    let reasons = [
        (load_makes_it(Some(name), problem), "a load that was not recorded"),
        (
            matches!(law.wrong.kin, Kin::Clearance | Kin::Drag) && nominal.teeth.is_none(),
            "friction of the output, which a ratio does not say",
        ),
        // While something is left, what the model takes for known of the load and the play may be wrong as well.
        (
            !all_is_told && (of_load || law.acts.meets_zones || law.acts.zones.is_some()),
            "drag, stiffness or play other than the model says",
        ),
        (name.spec().double_outside, "a shaft before the encoder that is bent or not aligned"),
        (part_of_a_turn, "a wheel before the encoder, which repeats within this part of a turn"),
        (of_two_lobes, "the waves of any strain wave gear, which the model does not state"),
        (
            (waves.is_some() || once) && nominal.teeth.is_none(),
            "the gear's own wheels, of which the teeth are not known, or a torque that goes with the angle",
        ),
        (waves.is_some() && (name == standing || not_held_against_it), "the torque of the motor"),
    ];
    reasons.into_iter().find(|(applies, _)| *applies).map(|(_, reason)| reason)
}

/// The look-alikes of a cause; of a subdivision of the generator's encoder the pitch error of the wheel that stands is
/// one always, though no law of its is tried.
fn alike_with_wheel(name: CauseName, mut alike: Vec<CauseName>, known: &Known, nominal: &Nominal) -> Vec<CauseName> {
    let standing = standing_pitch_error(nominal);
    let at_generator = waves_per_generator_turn(name, known, nominal).is_some();
    if name == CauseName::EncoderSubdivision && at_generator && nominal.teeth.is_some() && !alike.contains(&standing) {
        alike.push(standing);
    }
    alike
}

/// Waves in a turn of the generator of a cause that is nothing but such a line: an encoder's, or a higher harmonic of
/// the wheel that stands.
fn waves_per_generator_turn(name: CauseName, known: &Known, nominal: &Nominal) -> Option<f64> {
    let harmonic = || known.parameters.get(ParameterName::Harmonic.as_str()).map(|harmonic| harmonic.value);
    let of_standing_wheel = || harmonic().filter(|harmonic| name == standing_pitch_error(nominal) && *harmonic > 2.0);
    with_speed::order_of(name.into(), Some(known)).or_else(of_standing_wheel)
}

/// Whether a load that nobody recorded, a brake, a bearing, an arm, would make what a cause makes: an error that goes
/// with speed, direction or the output's angle.
fn load_makes_it(cause: Option<CauseName>, problem: &Problem<'_>) -> bool {
    !problem.on.rows.recorded.torque && cause.is_some_and(|cause| cause.spec().made_by_loads)
}

/// A cause of the library, or none, that one effect in the data may be of, and the probability of that.
type Share = (Option<CauseName>, f64);

/// What the effect that was found as `name` may be, that first: its look-alikes, whose misfits are higher by these, or
/// something outside the library; if there is neither, the closest rival. Where its size is distinguished from zero by
/// few standard deviations (`size_told`) there may be nothing.
fn shares(
    name: CauseName,
    alike: &[(CauseName, f64)],
    outside: bool,
    closest: Option<(CauseName, f64)>,
    size_told: f64,
) -> Vec<Share> {
    let odds = |misfit: f64| (-0.5 * misfit.clamp(0.0, 40.0)).exp();
    let mut shares: Vec<Share> = vec![(Some(name), 1.0)];
    shares.extend(alike.iter().map(|(cause, misfit)| (Some(*cause), odds(*misfit).max(LEAST_WEIGHT))));
    shares.extend(outside.then_some((None, 1.0)));
    let alone = shares.len() == 1;
    shares.extend(closest.filter(|_| alone).map(|(rival, misfit)| (Some(rival), odds(misfit))));
    let all: f64 = shares.iter().map(|(_, weight)| weight).sum();
    shares.iter_mut().for_each(|(_, weight)| *weight /= all);
    let sure = shares[0].1 - if alone { OF_NO_LAW } else { 0.0 };
    let sure = if size_told < SIZE_KNOWN { sure.min(MOST_OF_UNSURE) } else { sure };
    shares.push((None, shares[0].1 - sure));
    shares[0].1 = sure;
    shares
}

/// The sets of causes that effects may be of, each by itself, likeliest first; nothing without an effect.
fn posterior(effects: &[Vec<Share>]) -> Vec<SetOfCauses> {
    let mut sets: BTreeMap<Vec<CauseName>, f64> =
        (!effects.is_empty()).then(|| (Vec::new(), 1.0)).into_iter().collect();
    for effect in effects {
        let mut with = BTreeMap::new();
        for (set, probability) in &sets {
            for (cause, share) in effect.iter().filter(|(_, share)| *share > 0.0) {
                let mut set: Vec<CauseName> = set.iter().chain(cause).copied().collect();
                set.sort_unstable();
                set.dedup();
                *with.entry(set).or_insert(0.0) += probability * share;
            }
        }
        sets = with;
    }
    let mut sets: Vec<SetOfCauses> =
        sets.into_iter().map(|(set, probability)| SetOfCauses { set, probability }).collect();
    sets.retain(|of| of.probability >= LEAST_STATED);
    sets.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    sets
}

/// Where the evidence for term `k` comes from.
fn evidence_by(problem: &Problem<'_>, selected: &Selected<'_>, k: usize) -> EvidenceBy {
    let mut by = EvidenceBy::default();
    let Some(without) = selected.without(problem, k) else { return by };
    let white = |of: &Selected<'_>| problem.whitener.whiten_averaged(&remainder::left(problem, of));
    let (with, without, rows) = (white(selected), white(&without), problem.on.rows);
    for session in &problem.whitener.sessions {
        let mut of_session = 0.0;
        for j in session.clone() {
            let gain = 0.5 * problem.fineness.worth * (without[j].powi(2) - with[j].powi(2));
            let row = problem.whitener.groups[j].start;
            let third = 3.0 * rows.torque[row].abs() / problem.on.scales.load;
            let direction = if rows.direction[row] < 0.0 { "backward" } else { "forward" };
            *by.direction.entry(direction).or_default() += gain;
            *by.load.entry(["light", "middle", "heavy"][(third as usize).min(2)]).or_default() += gain;
            of_session += gain;
        }
        by.session.push(of_session);
    }
    by
}

fn compensation(problem: &Problem<'_>, rms_extended: f64) -> Compensation {
    let about_mean = |values: Vec<f64>| problem.certain_rms(&select::about_mean(problem, values));
    Compensation {
        rms_uncompensated_arcsec: about_mean(problem.whitener.average(&problem.on.rows.error)),
        rms_nominal_tables_arcsec: about_mean(problem.data.clone()),
        rms_calibrated_table_arcsec: None,
        rms_extended_tables_arcsec: rms_extended,
    }
}

fn recalibrated(problem: &Problem<'_>, selected: &Selected<'_>) -> BTreeMap<String, Parameter> {
    let n = selected.fit.priors.len();
    let mut named = BTreeMap::new();
    let covariance = selected.fit.solution.covariance();
    for (k, floating) in problem.on.base.floating.iter().enumerate().filter(|(_, floating)| floating.spread > HELD) {
        let name =
            if named.contains_key(&floating.name) { format!("{} {k}", floating.name) } else { floating.name.clone() };
        named.insert(
            name,
            Parameter { value: selected.fit.solution.coefficients[k], std: covariance[k * n + k].max(0.0).sqrt() },
        );
    }
    named
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zero_that_is_hardly_told_from_that_of_the_first_session_is_none() {
        let zeros = |values: [f64; 3]| values.map(|value| Parameter { value, std: 4.6 });
        assert!(!is_another_one(&zeros([0.0, -15.0, -15.5])));
        assert!(is_another_one(&zeros([0.0, -15.0, 130.0])));
    }

    #[test]
    fn a_zero_that_moves_by_whole_pitches_may_be_teeth_that_skipped() {
        let whole = |jump: f64, pitch: Option<f64>| {
            let tooth_pitch_rad = pitch.map(|pitch| pitch / ARCSEC_PER_RAD);
            let gear = crate::measurement::Gear { tooth_pitch_rad, ..crate::measurement::Gear::of_ratio(100.0) };
            whole_pitches(jump / ARCSEC_PER_RAD, &gear, BESIDE_PITCHES, INTERVAL * 2.0 / ARCSEC_PER_RAD).is_some()
        };
        assert!([6416.0, -12_810.0].iter().all(|jump| whole(*jump, Some(6416.2))));
        assert!(![0.4, 5900.0].iter().any(|jump| whole(*jump, Some(6416.2))) && !whole(300.0, None));
    }
    #[test]
    fn what_laws_leave_beyond_the_noise_widens_what_is_told_from_zero() {
        assert_eq!(beyond_noise(5.0, 4.5), 1.0);
        assert_eq!(beyond_noise(6.0, 4.0), 1.5);
    }

    #[test]
    fn a_line_in_time_near_a_resonance_is_counted_against_it_and_one_elsewhere_is_not() {
        let unnamed =
            [(1.33, 4.0), (50.0, 3.0)].map(|(order, size)| (Some(Label::Line { per: Per::Second, order }), size));
        assert_eq!(swinging_near(&unnamed, 1.37), 4.0);
        assert_eq!(swinging_near(&unnamed, 9.0), 0.0);
    }

    #[test]
    fn a_confidence_is_that_of_a_name_among_those_alike() {
        use CauseName::{RatioError, SensorLatency, Wear};
        let of = |alike: &[f64], outside: bool, closest: f64, told: f64| {
            let alike: Vec<_> = alike.iter().zip([RatioError, Wear]).map(|(misfit, cause)| (cause, *misfit)).collect();
            let shares = shares(SensorLatency, &alike, outside, Some((RatioError, closest)), told);
            near(shares.iter().map(|(_, share)| share).sum(), 1.0);
            shares[0].1
        };
        // Told no worse, or better: one of these.
        near(of(&[0.0], false, 0.0, 20.0), 0.5);
        near(of(&[-30.0, 0.0], false, -30.0, 20.0), 1.0 / 3.0);
        // Told worse, though no law is known so well.
        near(of(&[2.0], false, 2.0, 20.0), 1.0 / (1.0 + (-1.0_f64).exp()));
        near(of(&[900.0], false, 900.0, 20.0), 1.0 / (1.0 + LEAST_WEIGHT));
        // None alike.
        assert!((0.98..0.99).contains(&of(&[], false, 900.0, 20.0)));
        // A double that is no cause of the library; a size that is hardly known.
        near(of(&[], true, 900.0, 20.0), 0.5);
        near(of(&[], false, 900.0, 4.0), MOST_OF_UNSURE);
        near(of(&[0.0], false, 0.0, 4.0), 0.5);
    }

    #[test]
    fn a_posterior_is_of_sets_in_which_no_cause_is_twice() {
        use CauseName::{RatioError, SensorLatency, Wear};
        assert!(posterior(&[]).is_empty());
        let two = [vec![(Some(Wear), 0.6), (Some(RatioError), 0.4)], vec![(Some(RatioError), 0.9), (None, 0.1)]];
        let sets = posterior(&two);
        let of = |set: &[CauseName]| sets.iter().find(|of| of.set == set).map_or(0.0, |of| of.probability);
        let mut both = [Wear, RatioError];
        both.sort_unstable();
        near(of(&both), 0.54);
        near(of(&[RatioError]), 0.4 * 0.9 + 0.4 * 0.1);
        near(of(&[Wear]), 0.06);
        assert_eq!((sets[0].set.as_slice(), sets.len()), (&both[..], 3));
        near(of(&[SensorLatency]), 0.0);
    }

    fn near(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-9, "{a} for {b}");
    }
}
