//! Limits that decide a verdict, all in one place, each with where it comes from:
//!
//! - *Source*: from the literature, or by definition.
//! - *Chosen*: on made-up cases that the state before got wrong, of examinations that were over
//!   (`tests/exam/seeds.csv`). Later examinations, with cases that nobody had seen, have tested it.
//! - *Guess*: an order of magnitude from the first version on. The examinations have not spoken against it, and nobody
//!   has varied it.
//!
//! Constants of laws, of noise and of numerical methods stand where they are used.

/// Which terms are chosen: `select`.
pub(crate) mod selection {
    /// Evidence (natural logarithm of the ratio) below which nothing is named: "very strong" by Kass & Raftery
    /// (1995). *Source*.
    pub(crate) const LEAST_EVIDENCE: f64 = 6.0;
    /// A base parameter is out of tolerance when it is held at its limit. *Source*: by definition.
    pub(crate) const OUT_OF_TOLERANCE: f64 = crate::diagnosis::model::TOLERANCE - 0.05;
    /// What a term adds counts up to this many times what the nominal model, within its tolerance, cannot take over
    /// from it. *Chosen*.
    pub(crate) const TAKEN_OVER: f64 = 2.5;
    /// Least size of a contribution, arcsec. *Guess*.
    pub(crate) const LEAST_ARCSEC: f64 = 1.5;
    /// Least size in units of the white noise. *Guess*.
    pub(crate) const LEAST_OF_NOISE: f64 = 0.3;
    /// Least size of a cause, as a share of the least size of what has no name. *Chosen*.
    pub(crate) const LEAST_IF_CLEAR: f64 = 0.55;
    /// Least size of such a cause as a share of the strongest one. *Guess*.
    pub(crate) const LEAST_OF_STRONGEST: f64 = 0.1;
    /// Where much of a cause shows while the play is crossed, those rows count up to this many times what it adds
    /// elsewhere. *Chosen*.
    pub(crate) const IN_CROSSINGS: f64 = 3.0;
    /// Least size against what the laws of the other terms may be wrong by. *Chosen*, with the shares of kin, on
    /// families D, E, F and V (`docs/evidence/diagnosis.md`).
    pub(crate) const LEAST_OF_MISFIT: f64 = 2.0;
    /// Least size of a deviation without a name against what the laws of the other terms may be wrong by. *Chosen*.
    pub(crate) const LEAST_UNNAMED_OF_MISFIT: f64 = 1.5;
    /// Causes at most. *Source*: by definition.
    pub(crate) const MOST_CAUSES: usize = 3;
    /// Unnamed deviations at most. *Guess*.
    pub(crate) const MOST_UNNAMED: usize = 3;
    /// A law comes close that gains no less than this, refined, on a sample: what all rows would tell just so
    /// (evidence 6) tells a quarter of them next to nothing. *Guess*.
    pub(crate) const CLOSE_GAIN: f64 = -3.0;
    /// A law comes close to one that was chosen on a sample if its evidence is behind by no more than this. *Guess*.
    pub(crate) const CLOSE_BEHIND: f64 = 8.0;
    /// Evidence that a law has to gain at all, refined; and a base parameter to be named. *Chosen*.
    pub(crate) const LEAST_GAIN: f64 = 0.5;
    /// Evidence by which the second order and the subdivision of the generator's encoder have to be ahead of wheels,
    /// which make the same waves and leave traces of the flank and of other orders besides. *Guess*.
    pub(crate) const AFTER_WHEELS: f64 = 15.0;
    /// Evidence by which something unnamed has to be ahead of the best cause to be taken before it. *Guess*.
    pub(crate) const UNNAMED_AHEAD: f64 = 5.0;
}

/// What the data cannot tell apart: `rivals`.
pub(crate) mod rivals {
    /// Rise of the misfit up to which two causes are not told apart: five standard deviations. *Source*.
    pub(crate) const TOLD_APART: f64 = 25.0;
    /// Rise up to which a rival is not told apart from a base parameter out of its tolerance, for which the nominal
    /// model may stand in.
    /// *Chosen*.
    pub(crate) const OUT_OF_TOLERANCE_APART: f64 = 5.0;
    /// Up to this rise the other causes are refined anew beside a rival. *Chosen*.
    pub(crate) const SETTLED_BELOW: f64 = 400.0;
    /// A rival whose rise on a sample says less than this of all rows is refitted to all of them: twice
    /// [`SETTLED_BELOW`].
    /// *Guess*.
    pub(crate) const NEAR: f64 = 2.0 * SETTLED_BELOW;
    /// How much farther away a law may begin that a lead leads to. *Chosen*.
    pub(crate) const FARTHER: f64 = 10.0;
    /// Predictions closer than this, arcsec rms, are not told apart by any law known this well. *Guess*.
    pub(crate) const SAME_ARCSEC: f64 = 0.5;
    /// Nor are those closer than this share of the cause's size. *Guess*.
    pub(crate) const SAME_SHARE: f64 = 0.12;
}

/// Which of the causes found may be named.
pub mod verdict {
    /// Sessions left out are predicted no worse up to this: the least that counts is a small part of what noise
    /// leaves. *Chosen*.
    pub(crate) const NO_WORSE: f64 = 1.001;
    /// A cause takes at least this share of the rms that the others leave in sessions left out; below, it is a hint.
    /// *Chosen* on healthy drives of an examination kept apart: six of seven false names gained 0.3 to 3 %.
    pub(crate) const LEAST_GAIN_OF_A_NAME: f64 = 0.03;
    /// What is left as a free function counts if it is larger than this against the strongest cause. *Chosen*.
    pub(crate) const LEAST_LEFT_OF_STRONGEST: f64 = 0.25;
    /// The residual of an explained error is no more than this multiple of the noise, wander with it. *Source*: where
    /// abstention begins in the method that `docs/explanation/theory.md` describes.
    pub(crate) const NEAR_NOISE: f64 = 1.6;
    /// Something without a name is large beside a cause from this share of its size on: what is not understood may
    /// reach into it. *Chosen*.
    pub(crate) const LARGE_BESIDE: f64 = 0.7;
    /// A line in time is near the frequency of a resonance within this share of it: neighbours of a spring with this
    /// much more or less mass. *Guess*.
    pub(crate) const SWINGS_NEAR: f64 = 0.2;
    /// A zero that moves from one session to the next by whole tooth pitches, but for this share of one, may be teeth
    /// that have skipped. *Guess*.
    pub(crate) const BESIDE_PITCHES: f64 = 0.02;
    /// Standard deviations from a value to the ends of its interval of 95 %. *Source*.
    pub(crate) const INTERVAL: f64 = 1.96;
    /// The contribution of a cause is known well from this multiple of its uncertainty on: beside what has no name and
    /// is large, and where its columns trade its size among one another. *Chosen*.
    pub(crate) const KNOWN_BESIDE: f64 = 5.0;
    /// The size of a cause differs from zero from this number of its standard deviations on. *Chosen*: of 6 causes
    /// named below it at 99 % one was there.
    pub(crate) const TOLD_FROM_ZERO: f64 = 3.0;
    /// Noise is known to this factor: what is left within it is noise. *Guess*.
    pub(crate) const NOISE_KNOWN_TO: f64 = 1.25;
    /// The size of a cause is well known from this number of its standard deviations on … *Chosen*: of 183 causes named
    /// beyond it 177 were there.
    pub(crate) const SIZE_KNOWN: f64 = 5.0;
    /// … and below, a name is stated with no more than this. *Chosen*: of 21 between the two 16 were there, of 183
    /// beyond 177.
    pub(crate) const MOST_OF_UNSURE: f64 = 0.85;
    /// No law is known so well that this share is not left to what no law describes. *Guess*.
    pub(crate) const OF_NO_LAW: f64 = 0.01;
    /// Sets of causes that are less probable are not stated. *Source*: by definition, half of the last of four digits.
    pub(crate) const LEAST_STATED: f64 = 5e-5;
    /// What a look-alike that the data tell worse weighs against a cause, at least: it is alike as no law is known any
    /// better. *Chosen*: of 41 causes with such look-alikes 37 were there, of 25 with one that the data tell no worse
    /// 14.
    pub(crate) const LEAST_WEIGHT: f64 = 0.15;
}

/// What is left when the causes are in: `remainder`.
pub(crate) mod remainder {
    /// Below this a line in time is no different from wander, Hz. *Source*: by definition.
    pub(crate) const SLOWEST_LINE_HZ: f64 = 0.15;
    /// Evidence for a free function in what is left. *Guess*.
    pub(crate) const LEAST_EVIDENCE: f64 = 15.0;
    /// A wander beyond this, arcsec, is no noise of a sensor … *Chosen*.
    pub(crate) const MOST_WANDER_ARCSEC: f64 = 7.0;
    /// … where it is beyond this in units of the white noise, too. *Chosen*.
    pub(crate) const MOST_WANDER_OF_WHITE: f64 = 2.5;
    /// Innovations that are worth less than this are no noise: something moves in them that the wander cannot
    /// follow. *Chosen*.
    pub(crate) const LEAST_WORTH: f64 = 0.35;
}
