//! Every loop of the host ends: by its form, or by a bound that is listed here.
//!
//! The source of the host's crates is parsed. A loop whose form bounds it needs nothing: `for` over what is finite,
//! `while let` that takes from a queue or a reader, `while k < n` whose body always does `k += 1`. Every other `while`,
//! `loop`, `for` over an open range, endless iterator (`successors`, `repeat_with`, `cycle`, `(0..)` that nothing
//! finite is zipped with) and function that calls itself stands in [`BOUNDED`], with its bound: a constant that occurs
//! in the loop, or why each round leaves fewer. A loop that is not listed fails, and so does a line of the list whose
//! loop is gone.
//!
//! Not seen are functions that call themselves through others. Bodies of macros are not parsed: a loop in one fails.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};
use quote::ToTokens;
use syn::visit::{self, Visit};
use syn::{BinOp, Expr, Item, Lit, Stmt};

/// The host's crates.
const SOURCES: [&str; 15] = [
    "host-sim/src",
    "host-sim/base/src",
    "host-sim/algebra/src",
    "host-sim/mechanics/src",
    "host-sim/motion/src",
    "host-sim/design/src",
    "host-sim/identify/src",
    "host-sim/fly/src",
    "host-sim/export/src",
    "host-sim/report/src",
    "host-sim/serve/src",
    "host-sim/studies/pacana_2023/src",
    "host-sim/fmu/src",
    "host-sim/python/src",
];

/// What bounds a loop.
enum Bound {
    /// A constant in its head or body, of this name.
    Most(&'static str),
    /// Each round takes something away, or goes on along something finite.
    Shrinks(&'static str),
}
use Bound::{Most, Shrinks};

/// Loops that their form does not bound: file below `host-sim/`, function, how many there, bound.
const BOUNDED: &[(&str, &str, usize, Bound)] = &[
    (
        "base/src/progress.rs",
        "new",
        1,
        Shrinks("lines of work that goes on, one in ten seconds; it ends with the work, which drops the other end"),
    ),
    ("fmu/src/instance.rs", "ticked", 1, Shrinks("ticks that are due, at most MOST_TICKS by the check above")),
    ("fmu/src/resources.rs", "decoded", 1, Shrinks("the rest of the text")),
    ("mechanics/src/condense/dense.rs", "eliminate", 2, Shrinks("columns that are left, four or one at a time")),
    ("mechanics/src/drive/as_built.rs", "greatest_common_divisor", 1, Shrinks("the remainder of two whole numbers")),
    ("mechanics/src/drive/interference.rs", "scan", 1, Shrinks("places of a cycle, from stretch to stretch")),
    (
        "mechanics/src/motion.rs",
        "settle",
        1,
        Shrinks("pitches until MOST_PITCHES, where `settle_on` ends with an error"),
    ),
    ("mechanics/src/stepping/fast.rs", "low_rank", 1, Shrinks("columns that a matrix of this order lacks")),
    (
        "mechanics/src/stepping/newton.rs",
        "iterate",
        1,
        Shrinks("`max_iterations`, again for each of MOST_LAYOUTS layouts"),
    ),
    ("mechanics/src/stepping/slip.rs", "gmres", 1, Most("MOST_VECTORS")),
    ("base/src/toml_file.rs", "refuse_unknown_keys_in", 1, Shrinks("tables within a table of a file")),
    ("motion/src/legs.rs", "next", 1, Shrinks("legs of a flight; it ends where there is none")),
    ("serve/src/folder.rs", "collect", 1, Shrinks("how deep it still looks")),
    ("serve/src/jobs.rs", "next_of", 1, Shrinks("waits for a job, or for the server to end")),
    ("serve/src/jobs.rs", "run", 1, Shrinks("as long as a process runs, which whoever asked for it may end")),
    ("serve/src/jobs/process.rs", "kill", 1, Shrinks("the time of GRACE")),
    ("serve/src/jobs/process.rs", "ended", 1, Shrinks("the time of DRAIN")),
    ("serve/src/jobs/process.rs", "listen", 1, Shrinks("lines that a process says, until it has ended")),
    ("python/src/failure.rs", "with_arguments", 1, Shrinks("the rest of a message")),
    ("python/src/run.rs", "run", 1, Shrinks("as long as the work in the other thread lasts, or until it is stopped")),
    ("python/src/step.rs", "for_rows", 1, Shrinks("rows that are left")),
    ("identify/src/calibrate/choose.rs", "path", 1, Shrinks("parts that are not chosen")),
    ("identify/src/calibrate/choose.rs", "pruned", 1, Shrinks("parts from the place on")),
    (
        "identify/src/calibrate/mod.rs",
        "fit",
        2,
        Shrinks(
            "a second round without the play, which ends; coefficients of the play not yet held, PLAY_COEFFICIENTS",
        ),
    ),
    ("identify/src/calibrate/plan.rs", "plan", 1, Most("MOST_PASSES")),
    ("identify/src/calibrate/rows.rs", "settled", 1, Shrinks("rows of a session, 1 or more at a time")),
    ("src/cli/bundle.rs", "foreign", 1, Shrinks("folders within a folder")),
    ("src/cli/context.rs", "image_file", 1, Shrinks("bytes of an image that are not hashed")),
    ("src/cli/say.rs", "suggestions_styled", 1, Shrinks("the rest of a message")),
    ("fly/src/plant_map.rs", "plane", 1, Shrinks("pitches until MOST_PITCHES, where `settle_on` ends with an error")),
    (
        "identify/src/diagnosis/blurred.rs",
        "find",
        1,
        Shrinks("times from TIMES_S[0] to TIMES_S[1], each LONGER than the one before"),
    ),
    (
        "identify/src/diagnosis/flank_lag.rs",
        "flank_lag",
        1,
        Shrinks("lags up to LONGEST_S, each LONGER than the one before"),
    ),
    ("identify/src/diagnosis/held_out.rs", "proved", 1, Shrinks("terms: one is set aside")),
    ("identify/src/diagnosis/linear.rs", "products", 1, Most("BLOCK_ROWS")),
    ("identify/src/diagnosis/linear.rs", "with_simd", 1, Shrinks("columns that are left")),
    ("identify/src/diagnosis/prepare.rs", "noise", 1, Shrinks("hypotheses that were not judged: each is asked once")),
    ("identify/src/diagnosis/select.rs", "backward", 1, Shrinks("terms: one is dropped")),
    ("identify/src/diagnosis/verdict.rs", "told_apart", 1, Shrinks("named terms: one is set aside")),
    ("base/src/csv_rows.rs", "next_row", 1, Shrinks("lines of a file")),
    ("identify/src/measurement/faults/clock.rs", "standing", 1, Shrinks("rows, from one time to the next")),
    ("identify/src/measurement/faults/steps.rs", "find", 1, Shrinks("places of steps: the weakest is dropped")),
    ("identify/src/measurement/faults/steps.rs", "lasting", 2, Shrinks("steps: those that are taken back go")),
    ("identify/src/measurement/reader/layout.rs", "split", 1, Shrinks("bytes of a line")),
    ("identify/src/measurement/reader/mod.rs", "chunk", 1, Shrinks("changes of the order of columns in a file")),
    ("identify/src/measurement/reader/mod.rs", "find_rows", 2, Shrinks("bytes of a file, and lines with zero bytes")),
    ("identify/src/measurement/reader/text.rs", "of", 1, Shrinks("bytes of a file")),
    ("identify/src/measurement/unit.rs", "leading_number", 1, Shrinks("bytes that are left")),
    ("report/src/diagnosis_report/thin.rs", "stretches", 1, Shrinks("rows of a session, one or more at a time")),
    (
        "identify/src/residual/spectrum.rs",
        "order_spectrum",
        1,
        Shrinks("lines up to `most_peaks`: each round finds one or ends"),
    ),
    ("identify/src/residual/spectrum.rs", "remembering", 1, Shrinks("a lag that doubles up to a quarter of the rows")),
    ("design/src/simulate/mod.rs", "change_temperature", 1, Shrinks("halvings that are left, one fewer in each call")),
    (
        "design/src/simulate/mod.rs",
        "settle_and_turn",
        1,
        Shrinks("pitches until MOST_PITCHES, where `settle_on` ends with an error"),
    ),
    ("design/src/simulate/summary.rs", "stretches", 1, Shrinks("rows, from stretch to stretch")),
    ("design/src/sweep/run.rs", "take", 1, Shrinks("rows that wait for those before them")),
    ("design/src/sweep/run.rs", "rows_of", 1, Shrinks("records of a file")),
    ("identify/src/synthesize/data_fault.rs", "average", 1, Shrinks("rows before the one that is made")),
    ("design/src/tables/positions.rs", "places_that_tell_apart", 1, Shrinks("divisors up to the root of a number")),
    (
        "design/src/tables/sweep.rs",
        "sample",
        1,
        Shrinks("pitches until MOST_PITCHES, where `settle_on` ends with an error"),
    ),
    ("identify/src/turns_off.rs", "turns_off", 1, Shrinks("turns that were tried")),
    (
        "design/src/tables/torque_nodes.rs",
        "refined",
        1,
        Shrinks("torque nodes up to `most`: each round adds one or ends"),
    ),
    (
        "design/src/tables/validate.rs",
        "settle",
        1,
        Shrinks("pitches until MOST_PITCHES, where `settle_on` ends with an error"),
    ),
];

/// Methods that take from what they are called on.
fn takes(method: &str) -> bool {
    method.starts_with("next") || method.starts_with("pop")
}

/// Whether the value of an expression was taken from a queue or a reader.
fn is_taken(expr: &Expr) -> bool {
    match expr {
        Expr::MethodCall(call) => takes(&call.method.to_string()) || is_taken(&call.receiver),
        Expr::Try(tried) => is_taken(&tried.expr),
        Expr::Paren(paren) => is_taken(&paren.expr),
        _ => false,
    }
}

/// The names that a condition compares with `<` or `<=`, as `k` in `k < n && more`.
fn below(condition: &Expr) -> Vec<String> {
    match condition {
        Expr::Binary(binary) if matches!(binary.op, BinOp::And(_)) => {
            [below(&binary.left), below(&binary.right)].concat()
        }
        Expr::Binary(binary) if matches!(binary.op, BinOp::Lt(_) | BinOp::Le(_)) => {
            counted(&binary.left).into_iter().collect()
        }
        _ => Vec::new(),
    }
}

/// `k` of `k` or `k + 1`.
fn counted(expr: &Expr) -> Option<String> {
    match expr {
        Expr::Path(path) => path.path.get_ident().map(ToString::to_string),
        Expr::Binary(binary) if matches!(binary.op, BinOp::Add(_)) => counted(&binary.left),
        _ => None,
    }
}

/// Whether a statement of the body itself, which every round comes to, counts one of these up by a whole number.
fn counts_up(body: &syn::Block, names: &[String]) -> bool {
    let whole =
        |expr: &Expr| matches!(expr, Expr::Lit(lit) if matches!(&lit.lit, Lit::Int(n) if n.base10_digits() != "0"));
    let counts = |stmt: &Stmt| match stmt {
        Stmt::Expr(Expr::Binary(binary), _) => {
            matches!(binary.op, BinOp::AddAssign(_))
                && whole(&binary.right)
                && counted(&binary.left).is_some_and(|k| names.contains(&k))
        }
        _ => false,
    };
    body.stmts.iter().any(counts) && !has_word(body.to_token_stream(), &["continue"])
}

fn has_word(tokens: TokenStream, words: &[&str]) -> bool {
    tokens.into_iter().any(|token| match token {
        TokenTree::Ident(ident) => words.contains(&ident.to_string().as_str()),
        TokenTree::Group(group) => has_word(group.stream(), words),
        _ => false,
    })
}

/// A loop that its form does not bound.
struct Open {
    file: String,
    function: String,
    what: String,
    tokens: TokenStream,
}

struct Finder {
    file: String,
    function: Vec<String>,
    found: Vec<Open>,
}

impl Finder {
    fn open(&mut self, what: impl Into<String>, tokens: TokenStream) {
        let function = self.function.last().cloned().unwrap_or_default();
        self.found.push(Open { file: self.file.clone(), function, what: what.into(), tokens });
    }

    fn within(&mut self, name: &syn::Ident, method: bool, block: &syn::Block, go_on: impl FnOnce(&mut Self)) {
        self.function.push(name.to_string());
        let mut calls = Calls { name: name.to_string(), method, itself: false };
        calls.visit_block(block);
        if calls.itself {
            self.open(format!("fn {name} calls itself"), block.to_token_stream());
        }
        go_on(self);
        self.function.pop();
    }
}

/// Whether a function calls itself by its own name.
struct Calls {
    name: String,
    /// A method calls itself as one of `self` or `Self`; a function of the same name is another.
    method: bool,
    itself: bool,
}

impl<'a> Visit<'a> for Calls {
    fn visit_expr_call(&mut self, call: &'a syn::ExprCall) {
        if let Expr::Path(path) = &*call.func {
            let segments: Vec<String> = path.path.segments.iter().map(|segment| segment.ident.to_string()).collect();
            let by_name = segments.last() == Some(&self.name);
            let of_self = segments.len() > 1 && segments[segments.len() - 2] == "Self";
            self.itself |= by_name && if self.method { of_self } else { segments.len() == 1 };
        }
        visit::visit_expr_call(self, call);
    }

    fn visit_expr_method_call(&mut self, call: &'a syn::ExprMethodCall) {
        let of_self = matches!(&*call.receiver, Expr::Path(path) if path.path.is_ident("self"));
        self.itself |= self.method && of_self && call.method == self.name.as_str();
        visit::visit_expr_method_call(self, call);
    }

    // A function within has its own name.
    fn visit_item(&mut self, _: &'a Item) {}
}

/// Whether attributes say that this is for tests alone.
fn for_tests(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("test")
            || attribute.path().is_ident("cfg") && has_word(attribute.to_token_stream(), &["test"])
    })
}

fn is_open_range(expr: &Expr) -> bool {
    match expr {
        Expr::Range(range) => range.end.is_none() && range.start.is_some(),
        Expr::Paren(paren) => is_open_range(&paren.expr),
        _ => false,
    }
}

impl<'a> Visit<'a> for Finder {
    fn visit_item_mod(&mut self, module: &'a syn::ItemMod) {
        if !for_tests(&module.attrs) {
            visit::visit_item_mod(self, module);
        }
    }

    fn visit_item_fn(&mut self, function: &'a syn::ItemFn) {
        if !for_tests(&function.attrs) {
            self.within(&function.sig.ident, false, &function.block, |finder| visit::visit_item_fn(finder, function));
        }
    }

    fn visit_impl_item_fn(&mut self, function: &'a syn::ImplItemFn) {
        if !for_tests(&function.attrs) {
            self.within(&function.sig.ident, true, &function.block, |finder| {
                visit::visit_impl_item_fn(finder, function)
            });
        }
    }

    fn visit_expr_while(&mut self, held: &'a syn::ExprWhile) {
        let bounded = match &*held.cond {
            Expr::Let(taken) => is_taken(&taken.expr),
            condition => counts_up(&held.body, &below(condition)),
        };
        if !bounded {
            self.open(format!("while {}", held.cond.to_token_stream()), held.to_token_stream());
        }
        visit::visit_expr_while(self, held);
    }

    fn visit_expr_loop(&mut self, held: &'a syn::ExprLoop) {
        self.open("loop", held.to_token_stream());
        visit::visit_expr_loop(self, held);
    }

    fn visit_expr_for_loop(&mut self, held: &'a syn::ExprForLoop) {
        if is_open_range(&held.expr) {
            self.open("for over an open range", held.to_token_stream());
        }
        visit::visit_expr_for_loop(self, held);
    }

    fn visit_expr_method_call(&mut self, call: &'a syn::ExprMethodCall) {
        let method = call.method.to_string();
        // What is zipped with a finite one is finite.
        if is_open_range(&call.receiver) && method != "zip" || method == "cycle" && call.args.is_empty() {
            self.open(format!("endless .{method}()"), call.to_token_stream());
        }
        visit::visit_expr_method_call(self, call);
    }

    fn visit_expr_call(&mut self, call: &'a syn::ExprCall) {
        let endless = ["successors", "repeat_with", "repeat"];
        if let Expr::Path(path) = &*call.func
            && let Some(name) = path.path.segments.last().map(|segment| segment.ident.to_string())
            && endless.contains(&name.as_str())
        {
            self.open(format!("endless {name}()"), call.to_token_stream());
        }
        visit::visit_expr_call(self, call);
    }

    fn visit_macro(&mut self, called: &'a syn::Macro) {
        if has_word(called.tokens.clone(), &["while", "loop"]) {
            self.open("a loop in a macro", called.tokens.clone());
        }
    }
}

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            files(&path, found);
        } else if name.ends_with(".rs") && name != "tests.rs" {
            found.push(path);
        }
    }
}

fn open_loops(file: &str, source: &str) -> Vec<Open> {
    let parsed = syn::parse_file(source).unwrap_or_else(|error| panic!("{file}: {error}"));
    let mut finder = Finder { file: file.to_owned(), function: Vec::new(), found: Vec::new() };
    finder.visit_file(&parsed);
    finder.found
}

#[test]
fn every_loop_of_the_host_ends_by_its_form_or_by_a_bound_that_is_listed() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut paths = Vec::new();
    SOURCES.iter().for_each(|folder| files(&root.join(folder), &mut paths));
    assert!(paths.len() > 300, "found {} files", paths.len());
    let mut open: BTreeMap<(String, String), Vec<Open>> = BTreeMap::new();
    for path in paths {
        let file = path.strip_prefix(root.join("host-sim")).unwrap().to_str().unwrap().to_owned();
        for found in open_loops(&file, &fs::read_to_string(&path).unwrap()) {
            open.entry((found.file.clone(), found.function.clone())).or_default().push(found);
        }
    }
    let mut wrong = Vec::new();
    for (file, function, count, bound) in BOUNDED {
        let loops = open.remove(&((*file).to_owned(), (*function).to_owned())).unwrap_or_default();
        if loops.len() != *count {
            wrong.push(format!("{file}, {function}: listed {count}, found {}", loops.len()));
        }
        match bound {
            Most(constant) => wrong.extend(
                loops
                    .iter()
                    .filter(|found| !has_word(found.tokens.clone(), &[constant]))
                    .map(|found| format!("{file}, {function}: `{}` has no {constant}", found.what)),
            ),
            Shrinks(why) => assert!(why.len() > 10, "{file}, {function}: say why"),
        }
    }
    for ((file, function), loops) in open {
        for found in loops {
            wrong.push(format!("{file}, {function}: `{}` has no bound: give it one, and list it here", found.what));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn loops_without_a_bound_are_seen() {
    for (bounded, source) in [
        (true, "fn f(mut q: Vec<u8>) { while let Some(x) = q.pop() { drop(x); } }"),
        (true, "fn f(r: R) { while let Some(row) = r.next_row().map_err(refuse)? { g(row); } }"),
        (true, "fn f(n: usize) { let mut k = 0; while k + 1 < n && g(k) { k += 1; } }"),
        (true, "fn f(v: &[f64]) { for (k, x) in (1..).zip(v) {} }"),
        (false, "fn f(n: usize) { let mut k = 0; while k < n { if g(k) { k += 1; } } }"),
        (false, "fn f(n: usize) { let mut k = 0; while k < n { if g(k) { continue; } k += 1; } }"),
        (false, "fn f(mut x: f64) { while x < 1.0 { x += 0.1; } }"),
        (false, "fn f(mut x: f64) { while x > 0.999 * y { x *= 0.5; } }"),
        (false, "fn f() { while let Some(x) = search(y) { y = x; } }"),
        (false, "fn f() { loop { if g() { break; } } }"),
        (false, "fn f() { for k in 0.. { if g(k) { break; } } }"),
        (false, "fn f() { let k = (0..).find(|k| g(*k)); }"),
        (false, "fn f() { let x = std::iter::successors(Some(1.0), next).take_while(|x| *x < 9.0); }"),
        (false, "fn f(x: f64) -> f64 { if x < 1.0 { x } else { f(0.5 * x) } }"),
        (false, "impl S { fn f(&self) { self.f() } }"),
        (true, "impl S { fn f(&self) { self.inner.f() } }"),
        (true, "impl S { fn f(&self) { f(1) } }"),
        (false, "macro_rules! m { () => { loop {} } }"),
        (true, "#[cfg(test)] mod tests { fn f() { loop {} } }"),
    ] {
        assert_eq!(open_loops("f.rs", source).is_empty(), bounded, "{source}");
    }
}
