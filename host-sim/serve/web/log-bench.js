// The bench of a log: what its columns are taken for, the residual, the verdict, each cause, and the table of the unit.
import { fileJson, fileText, sendFile } from "./api.js";
import { button, calm, commandLine, el, errorOf, number, section, select, table } from "./elements.js";
import { cancel, progressOf, run, why } from "./jobs.js";
import { downloads, liveChart, readReport, wholeReport } from "./results.js";

const ROLES = [
  ["time", "time"],
  ["generator", "generator angle"],
  ["output", "output angle"],
  ["error", "error of the output"],
  ["torque", "torque at the output"],
  ["temperature", "temperature"],
  ["orientation", "angle against gravity"],
  ["ignored", "not used"],
];
const ANGLES = ["rad", "deg", "turn", "arcmin", "arcsec", "mrad", "count"];
const UNITS = {
  time: ["s", "ms", "us", "ns", "min", "h", "iso"],
  generator: ANGLES,
  output: ANGLES,
  error: ANGLES,
  orientation: ANGLES,
  torque: ["N.m", "N.cm", "mN.m", "kN.m", "lbf.in", "lbf.ft", "A", "mA", "V"],
  temperature: ["C", "K", "F"],
};
/** Bytes of a log that its first rows are read of. */
const HEAD = 6000;
const ROWS_SHOWN = 6;
/** Rows whose verdict takes some seconds: 40 000 take 2.4 s on two idle cores, and 0.3 s more while a table is made. */
const SHORT_LOG = 100_000;
const SEPARATORS = { comma: /,/, semicolon: /;/, tab: /\t/, bar: /\|/, blanks: /\s+/, "comma and blank": /[,\s]+/ };
const CERTAIN = 0.75;
/** Sets of causes in the headline of a verdict are at least so probable. */
const WORTH_SAYING = 0.05;

/** Its role in a mapping. */
const roleOf = (column) => {
  if (!column.used) return "ignored";
  return column.role === "current" ? "torque" : ROLES.some(([name]) => name === column.role) ? column.role : "ignored";
};

/** A unit as a mapping takes it, apart: sign, unit, counts or gain. */
function apart(unit) {
  const [, sign, of, , counts, , gain] = /^(-?)([^/*]*)(\/([0-9.]+))?(\*(.*))?$/.exec(unit ?? "") ?? [];
  return { reversed: sign === "-", unit: of || "", counts: counts ?? "", gain: gain && gain !== "GAIN" ? gain : "" };
}

function together({ reversed, unit, counts, gain }) {
  const more = unit === "count" ? `/${counts}` : gain ? `*${gain}` : "";
  return `${reversed ? "-" : ""}${unit}${more}`;
}

export async function logBench(view, asked, bench) {
  await bench.refresh();
  const there = new Set(bench.state.files.map((f) => f.name));
  const now = {
    files: asked.getAll("file").filter((name) => there.has(name)),
    columns: asked.get("columns"),
    ratio: asked.get("ratio") ?? "",
    known: asked.get("known") ?? "ratio",
    stiffness: asked.get("stiffness") ?? "",
    backlash: asked.get("backlash") ?? "",
    drag: asked.get("drag") ?? "",
    teeth: asked.get("teeth") ?? "",
    without: new Set(asked.getAll("without")),
  };
  const entries = () => [
    ...now.files.map((name) => ["file", name]),
    ...(now.columns ? [["columns", now.columns]] : []),
    ...(now.ratio ? [["ratio", now.ratio]] : []),
    ["known", now.known],
    ...(now.known === "ratio"
      ? ["stiffness", "backlash", "drag", "teeth"].filter((key) => now[key]).map((key) => [key, now[key]])
      : []),
    ...[...now.without].map((cause) => ["without", cause]),
  ];
  const keep = () => bench.keep("log", entries());

  const place = (id) => el("div", { id });
  const [reading, unit, verdict, causes, calibrated] = ["reading", "unit", "verdict-place", "causes", "calibrated"].map(
    place,
  );
  const residual = liveChart("residual", "Residual over time", "Residual of each model over time", "");
  const over = liveChart(
    "residual-turn",
    "Residual over the generator angle",
    "The residual over the generator angle",
    "Residual with the causes found, where there are any.",
  );
  const orders = liveChart(
    "residual-orders",
    "Orders of the residual in a turn of the generator",
    "Amplitude of the residual at each order of the generator angle",
    "",
  );
  const compared = el("div", { id: "compared" });
  const both = liveChart(
    "both-logs",
    "Two logs",
    "Residual of two logs over the generator angle",
    "The residual of each over the generator angle, with the causes found in it, where there are any.",
  );
  both.figure.hidden = true;
  const added = liveChart("added", "What each cause adds", "The contribution of each cause over time", "");
  for (const { figure } of [residual, over, orders, added]) figure.hidden = true;
  view.append(
    el("h1", { text: "A log" }),
    bench.dropZone("Drop logs of one unit here, or choose them:", (names) => {
      if (!now.files.length) {
        // There is no more than this yet: the address has all of it made.
        now.files = names;
        location.hash = `#log?${new URLSearchParams(entries())}`;
        return;
      }
      now.files = names;
      now.columns = null;
      now.ratio = "";
      look();
    }),
  );
  if (!now.files.length) return undefined;
  view.append(
    section("columns-section", "How it is read", reading),
    section("unit-section", "What is known of the unit", unit),
    el(
      "div",
      { class: "two" },
      section("verdict", "What is wrong with it", verdict, residual.figure, added.figure),
      section("table-section", "Its table", calibrated),
    ),
    compared,
    both.figure,
    causes,
    el("div", { class: "two" }, over.figure, orders.figure),
  );

  let looked = null;
  let head = [];
  let round = 0;
  const running = new Set();
  /** What stands in the menus, by column. */
  let chosen = [];

  const mine = async (work, at, show) => {
    const job = await run(work, (j) => {
      if (at !== round) return;
      running.add(j.id);
      show(j);
    });
    running.delete(job.id);
    return at === round ? job : null;
  };

  async function look() {
    const at = ++round;
    forget();
    keep();
    reading.replaceChildren(el("p", { text: "Looking …" }));
    try {
      const job = await mine({ work: "look", files: now.files }, at, (j) => reading.replaceChildren(progressOf(j)));
      if (!job) return;
      if (job.state !== "done") throw new Error(why(job));
      looked = await fileJson(`${job.out}/look.json`);
      head = (await fileText(now.files[0], HEAD)).split(/\r\n|\r|\n/);
      const given = mapping(now.columns);
      chosen = looked.columns.map(
        (column, k) => given?.get(k) ?? { role: given ? "ignored" : roleOf(column), ...apart(column.unit) },
      );
      if (!now.ratio) now.ratio = looked.ratio_proposed ? String(looked.ratio_proposed) : "";
      // The proposal is kept word for word where nothing was changed.
      if (!now.columns) now.columns = looked.columns_option;
      showReading(job);
      await showUnit();
      await redo();
    } catch (error) {
      if (at === round) reading.replaceChildren(el("p", { class: "wrong line", text: error.message }));
    }
  }

  /** A mapping by column, from its words. */
  function mapping(columns) {
    if (!columns) return null;
    const all = new Map();
    for (const part of columns.split(",")) {
      const [, role, name, unitWords] = /^\s*([a-z]+)=(.*?)(?::([^:]*))?$/.exec(part) ?? [];
      const k = name?.startsWith("#") ? Number(name.slice(1)) - 1 : looked.columns.findIndex((c) => c.name === name);
      if (k >= 0 && k < looked.columns.length) all.set(k, { role, ...apart(unitWords) });
    }
    return all;
  }

  /** The menus as words. */
  function words() {
    const parts = chosen.map((c, k) => (c.role === "ignored" ? null : `${c.role}=#${k + 1}:${together(c)}`));
    return parts.filter(Boolean).join(",");
  }

  const mended = calm(120, () => {
    now.columns = words();
    keep();
    rows();
    redo();
  });

  const rowsPlace = el("div");
  function rows() {
    const split = SEPARATORS[looked.separator] ?? /,/;
    const lines = head
      .slice(looked.header_line ?? 0)
      .filter((line) => line.trim() && !line.startsWith("#"))
      .map((line) => line.replace(/^ +| +$/g, "").split(split));
    // Units and other words may stand between the names and the rows.
    const isRow = (line) => looked.columns.every((c, k) => !c.used || /^\W*\d/.test(line[k] ?? ""));
    const from = Math.max(0, lines.findIndex(isRow));
    const body = lines.slice(from, from + ROWS_SHOWN);
    const cell = (tag) => (text, k) =>
      el(tag, { class: `role-${chosen[k]?.role ?? "ignored"}`, ...(tag === "th" ? { scope: "col" } : {}) }, text);
    rowsPlace.replaceChildren(
      el(
        "div",
        { class: "table", tabindex: 0, role: "region", "aria-label": "First rows" },
        el(
          "table",
          { id: "first-rows" },
          el("caption", {}, el("span", { text: "First rows, each column under the colour of what it is taken for" })),
          el(
            "thead",
            {},
            el("tr", {}, ...looked.columns.map((c, k) => cell("th")(`${c.name} (${chosen[k].role})`, k))),
          ),
          el("tbody", {}, ...body.map((line) => el("tr", {}, ...line.slice(0, looked.columns.length).map(cell("td"))))),
        ),
      ),
    );
  }

  function showReading(job) {
    const menus = looked.columns.map((column, k) => {
      const name = `${column.name}`;
      const units = el("span", { class: "form" });
      const fill = () => {
        const c = chosen[k];
        const allowed = UNITS[c.role];
        units.replaceChildren();
        if (!allowed) return;
        if (!allowed.includes(c.unit)) c.unit = allowed[0];
        const extra = el("input", {
          type: "text",
          "aria-label": `${name}: ${c.unit === "count" ? "counts of a turn" : "N·m for each"}`,
          value: c.unit === "count" ? c.counts : c.gain,
          size: 8,
        });
        extra.addEventListener("change", () => {
          c[c.unit === "count" ? "counts" : "gain"] = extra.value.trim();
          mended();
        });
        units.append(
          select(
            allowed,
            c.unit,
            (value) => {
              c.unit = value;
              fill();
              mended();
            },
            { "aria-label": `Unit of ${name}` },
          ),
        );
        if (["count", "A", "mA", "V"].includes(c.unit)) units.append(extra);
        if (c.role !== "time") {
          const box = el("input", { type: "checkbox", checked: c.reversed });
          box.addEventListener("change", () => {
            c.reversed = box.checked;
            mended();
          });
          units.append(el("label", { class: "line" }, box, " reversed"));
        }
      };
      const role = select(
        ROLES,
        chosen[k].role,
        (value) => {
          // What it was taken for goes from the column that had it.
          if (value !== "ignored") {
            chosen.forEach((other, j) => {
              if (j !== k && other.role === value) other.role = "ignored";
            });
          }
          chosen[k].role = value;
          for (const again of menus) again.fill();
          mended();
        },
        { "aria-label": `What ${name} is` },
      );
      return {
        fill: () => {
          role.value = chosen[k].role;
          fill();
        },
        row: [
          name,
          role,
          units,
          `${number(column.least, 5)} to ${number(column.most, 5)}`,
          column.confidence >= CERTAIN ? "sure" : column.confidence > 0 ? "a guess" : "not known",
          column.why.join("; "),
        ],
      };
    });
    for (const menu of menus) menu.fill();
    rows();
    reading.replaceChildren(
      el("p", {
        text: `${looked.rows} rows, ${looked.sessions} session${looked.sessions === 1 ? "" : "s"}${looked.period_s ? `, a row in ${number(looked.period_s)} s` : ""}; between fields: ${looked.separator}.`,
      }),
      table(
        "What each column is taken for",
        ["Column", "It is", "Unit", "Range", "How sure", "Why"],
        menus.map((m) => m.row),
        { id: "columns-table" },
      ),
      ...looked.notes.map((note) => el("p", { class: "line", text: note })),
      rowsPlace,
      commandLine(job.command),
    );
  }

  // ---- What is known of the unit
  async function showUnit() {
    const models = bench.state.files
      .filter((f) => /^[^/]*nominal[^/]*\.toml$|^([^/]*\/)*drive-extended\.toml$/.test(f.name))
      .map((f) => `model:${f.name}`);
    const tables = [
      ...new Set(
        bench.state.files
          .filter((f) => /(^|\/)(cam|double-disc|four-roller|two-roller)\.fxt$/.test(f.name))
          .map((f) => `tables:${f.name.includes("/") ? f.name.slice(0, f.name.lastIndexOf("/")) : "."}`),
      ),
    ];
    const named = [
      ["ratio", "the figures here"],
      ...models.map((m) => [m, `the model ${m.slice(6)}`]),
      ...tables.map((t) => [t, `the tables in ${t.slice(7)}`]),
    ];
    if (!named.some(([name]) => name === now.known)) now.known = "ratio";
    const input = (id, words, key) => {
      const made = el("input", { type: "text", inputmode: "decimal", id, value: now[key], size: 9 });
      made.addEventListener("change", () => {
        now[key] = made.value.trim().replace(",", ".");
        keep();
        redo();
      });
      return el("label", { for: id }, words, made);
    };
    const numbers = el(
      "div",
      { class: "form" },
      input("ratio", "Ratio (negative: they turn opposite ways)", "ratio"),
      input("stiffness", "Stiffness of the catalogue, N·m/rad", "stiffness"),
      input("backlash", "Backlash, arcsec", "backlash"),
      input("drag", "Friction of the output, N·m, if known", "drag"),
      input("teeth", "Teeth of the flexspline, if known", "teeth"),
      el("small", {
        text: "Names of causes depend on stiffness (where a torque was recorded) and backlash; the table needs neither. A friction that is not given is fitted. With the number of teeth (ratio 100: 200) causes in the teeth are considered too.",
      }),
    );
    numbers.hidden = now.known !== "ratio";
    unit.replaceChildren(
      el(
        "div",
        { class: "form" },
        el(
          "label",
          {},
          "Known by",
          select(
            named,
            now.known,
            (value) => {
              now.known = value;
              numbers.hidden = value !== "ratio";
              keep();
              redo();
            },
            { id: "known" },
          ),
        ),
      ),
      numbers,
    );
  }

  /** The catalogue's figures that a verdict would have to guess. */
  const missing = () =>
    [
      ["stiffness", chosen.some((c) => c.role === "torque") && !Number(now.stiffness)],
      ["backlash", now.backlash === ""],
    ].filter(([, lacks]) => now.known === "ratio" && lacks);

  /** The model of the figures, a file of the folder as any other; without a torque no stiffness is read. */
  async function modelOfFigures() {
    const teeth = Number(now.teeth);
    let drive = `ratio = ${Number(now.ratio)}`;
    if (teeth) {
      const fixed = { [-teeth / 2]: "circular_spline", [teeth / 2 + 1]: "flexspline" }[Number(now.ratio)];
      if (!fixed)
        throw new Error(
          `${teeth} teeth make a ratio of ${-teeth / 2} with the circular spline fixed, or of ${teeth / 2 + 1} with the flexspline fixed; found ${now.ratio}. If only the sign differs, tick “reversed” at one of the angles above and change the sign of the ratio.`,
        );
      drive = `flexspline_teeth = ${teeth}\ncircular_spline_teeth = ${teeth + 2}\nfixed = "${fixed}"`;
    }
    const text = `# Written by the bench: a drive by its ratio or teeth and figures of its catalogue.
[drive]
${drive}
[nominal]
stiffness_n_m_per_rad = ${Number(now.stiffness) || 1e6}
backlash_arcsec = ${Number(now.backlash)}
${Number(now.drag) ? `friction_torque_n_m = ${Number(now.drag)}\n` : ""}`;
    return sendFile("nominal-bench.toml", new Blob([text]));
  }

  /** All below, done anew. */
  async function redo() {
    const at = ++round;
    for (const id of running) cancel(id);
    running.clear();
    document.documentElement.dataset.verdict = "";
    document.documentElement.dataset.compared = "";
    if (now.known === "ratio" && !Number(now.ratio)) {
      for (const to of [verdict, calibrated])
        to.replaceChildren(el("p", { text: "Say the ratio above: these rows do not tell it." }));
      document.getElementById("ratio").focus();
      return;
    }
    const reading = { columns: now.columns };
    const begun = performance.now();
    // The verdict is what one waits for: of a short log the table stands back for it, of a long one it is there long before.
    const failed = (to) => (error) => {
      if (at !== round) return;
      to.classList.remove("waits");
      to.replaceChildren(el("p", { class: "wrong line", text: error.message }));
    };
    calibrated.classList.add("waits");
    if (!calibrated.hasChildNodes()) calibrated.append(el("p", { text: "Made after the verdict." }));
    const lacks = missing().map(([name]) => name);
    if (lacks.length) {
      verdict.replaceChildren(
        el("p", { text: `Put in the ${lacks.join(" and ")} of the catalogue above: names of causes depend on it.` }),
      );
    }
    const judged = lacks.length ? undefined : diagnose(at, reading, begun).catch(failed(verdict));
    if (looked.rows <= SHORT_LOG) await judged;
    if (at !== round) return;
    await Promise.all([judged, calibrate(at, reading).catch(failed(calibrated))]);
    if (at === round && now.files.length > 1 && !lacks.length)
      await others(at, reading).catch((error) => bench.complain(error));
  }

  /** The verdict of every other log in turn, and two of them over one another. */
  async function others(at, reading) {
    const known = await knownForVerdict();
    const rows = new Map(now.files.map((name) => [name, [name, "waits", "–", "–", "–"]]));
    const reports = new Map();
    const names = () => [...reports.keys()];
    const pair = [0, 1];
    const overlay = async () => {
      const [a, b] = pair.map((k) => reports.get(names()[k]));
      if (a && b && a !== b)
        await both.pair(a, b, names(), pair, "over-generator", "extended", "recalibrated", "nominal");
    };
    const draw = () => {
      const menu = (k) =>
        select(
          names().map((name, j) => [String(j), name]),
          String(pair[k]),
          (chosen) => {
            pair[k] = Number(chosen);
            overlay();
          },
          { "aria-label": k ? "With the log" : "Compare the log" },
        );
      compared.replaceChildren(
        table("Every log", ["Log", "Verdict", "Causes", "rms before", "rms with the causes"], [...rows.values()], {
          id: "logs-table",
        }),
        ...(reports.size > 1 ? [el("div", { class: "form" }, "Compare ", menu(0), " with ", menu(1))] : []),
      );
    };
    draw();
    await Promise.all(
      now.files.map(async (file) => {
        const work = { work: "diagnose", file, ...reading, known, without: [...now.without] };
        const job = file === now.files[0] && firstJob ? firstJob : await mine(work, at, () => undefined);
        if (!job || at !== round) return;
        if (job.state !== "done") rows.set(file, [file, why(job), "–", "–", "–"]);
        else {
          const d = await fileJson(`${job.out}/diagnosis.json`);
          const found = d.causes.map((c) => c.name.replaceAll("_", " ")).join(", ");
          const { rms_before_arcsec: before, rms_after_arcsec: after } = d.residual;
          rows.set(file, [file, d.finding.replaceAll("_", " "), found || "none", errorOf(before), errorOf(after)]);
          reports.set(file, await readReport(`${job.out}/report.html`));
        }
        if (at === round) draw();
      }),
    );
    if (at !== round) return;
    await overlay();
    document.documentElement.dataset.compared = String(reports.size);
  }

  /** The table that was asked for last: figures that it does not need leave it, and its job, as they are. */
  let made = {};
  function forget() {
    if (made.id) cancel(made.id);
    made = {};
  }

  async function calibrate(at, reading) {
    const [kind, name] = now.known.split(/:(.*)/s);
    const known =
      kind === "model" && !name.endsWith("drive-extended.toml")
        ? { model: name }
        : kind === "tables"
          ? { tables: name }
          : Number(now.teeth) && !missing().length
            ? { model: await modelOfFigures() }
            : { ratio: Number(now.ratio) };
    const work = { work: "calibrate", files: now.files, ...reading, known };
    const asked = JSON.stringify(work);
    if (made.asked !== asked) {
      forget();
      const mineNow = { asked };
      mineNow.over = run(work, (j) => {
        mineNow.id = j.id;
        if (made === mineNow) calibrated.replaceChildren(progressOf(j));
      });
      made = mineNow;
    }
    const job = await made.over;
    if (at !== round) return;
    calibrated.classList.remove("waits");
    if (job.state !== "done") {
      forget();
      calibrated.replaceChildren(el("p", { class: "wrong line", text: why(job) }), commandLine(job.command));
      return;
    }
    const c = await fileJson(`${job.out}/calibration.json`);
    const late = c.readings.some((reading) => reading.name === "delay");
    const gain = 100 * (1 - c.held_out.rms_after_arcsec / c.held_out.rms_before_arcsec);
    calibrated.replaceChildren(
      el(
        "p",
        { class: "verdict" },
        errorOf(c.held_out.rms_before_arcsec),
        ` rms ${late ? "as measured less a reading delay" : "as measured"}, `,
        errorOf(c.held_out.rms_after_arcsec),
        ` with the table, held out: ${number(gain, 3)} % less.`,
      ),
      el(
        "p",
        {},
        "Error with the table: ±",
        errorOf(c.half_width_arcsec),
        " (95 % interval, over all its loads and angles).",
      ),
      table(
        "Parts of the table",
        ["Part", "Verdict", "Size", "Why"],
        c.parts.map((p) => [p.name.replaceAll("_", " "), p.kept ? "kept" : "refused", errorOf(p.size_arcsec), p.why]),
      ),
      downloads(job.out, [
        ["calibrated.fxt", "the table of this unit, for firmware"],
        ["calibrated.h", "the same as a C header"],
        ["calibrated.rs", "the same for Rust"],
        ["calibration.json", "how it was made, and how good it is"],
      ]),
      el(
        "p",
        {},
        el("a", {
          href: `#certificate?${new URLSearchParams({ of: job.out })}`,
          text: "Certificate of this unit, one page to print",
        }),
        " · ",
        el("a", {
          href: `#table?${new URLSearchParams([
            ["table", `${job.out}/calibrated.fxt`],
            ["file", now.files[0]],
            ["columns", now.columns ?? ""],
          ])}`,
          text: "Try it on a log",
        }),
      ),
      ...c.notes.map((note) => el("p", { class: "line", text: note })),
      commandLine(job.command),
      wholeReport(job.out),
    );
    document.documentElement.dataset.calibrated = job.out;
  }

  /** What the verdict is against. */
  async function knownForVerdict() {
    const [kind, name] = now.known.split(/:(.*)/s);
    if (kind === "model") return { model: name };
    return kind === "tables" ? { tables: name } : { model: await modelOfFigures() };
  }

  let firstJob = null;
  async function diagnose(at, reading, begun) {
    const known = await knownForVerdict();
    if (at !== round) return;
    firstJob = null;
    compared.replaceChildren();
    both.figure.hidden = true;
    const work = { work: "diagnose", file: now.files[0], ...reading, known, without: [...now.without] };
    const progress = el("div", { role: "status" });
    verdict.replaceChildren(progress);
    const job = await mine(work, at, (j) => progress.replaceChildren(progressOf(j)));
    if (!job) return;
    firstJob = job;
    if (job.state !== "done") {
      verdict.replaceChildren(el("p", { class: "wrong line", text: why(job) }), commandLine(job.command));
      causes.replaceChildren();
      return;
    }
    const [d, report] = await Promise.all([
      fileJson(`${job.out}/diagnosis.json`),
      readReport(`${job.out}/report.html`),
    ]);
    const said = {
      fault_found: "A fault is found",
      nothing_found: "Nothing is found: what there is lies within noise and what units of one type differ by",
      not_understood: "Not understood: there is something that no cause of the library explains",
      data_unusable: "These data say nothing of the unit",
    };
    const odds = d.posterior
      .filter(({ probability }) => probability >= WORTH_SAYING)
      .map(({ set, probability }) => {
        const names = set.map((name) => name.replaceAll("_", " ")).join(" and ") || "no cause of the library";
        return `${names} (${Math.round(100 * probability)} %)`;
      });
    verdict.replaceChildren(
      el("p", {
        class: "verdict",
        id: "verdict-words",
        text: `${said[d.finding] ?? d.verdict}${odds.length ? `: ${odds.join(", or ")}` : ""}.`,
      }),
      el(
        "p",
        {},
        "Residual, rms: ",
        errorOf(d.residual.rms_before_arcsec),
        " before, ",
        errorOf(d.residual.rms_after_arcsec),
        " with the causes; ",
        errorOf(d.residual.noise_floor_arcsec),
        " is noise.",
      ),
      ...(d.unexplained ?? []).map((u) =>
        el("p", {}, "Without a cause: ", u.looks_like.replaceAll("_", " "), ", ", errorOf(u.size_arcsec)),
      ),
      ...d.data_faults.map((f) =>
        el("p", { class: "line", text: `Fault of the data: ${f.what}. To change: ${f.advice}.` }),
      ),
      ...unsure(d.finding),
      ...(d.next_experiment ? [el("p", { class: "line", text: `To record next: ${d.next_experiment}` })] : []),
      ...(now.files.length > 1
        ? [
            el("p", {
              text: `Of ${now.files[0]}; the others stand below. The table takes all ${now.files.length} logs.`,
            }),
          ]
        : []),
      commandLine(job.command),
      wholeReport(job.out),
    );
    showCauses(d);
    await residual.of(report, "over-time", "every");
    await over.of(report, "over-generator", "extended", "recalibrated", "nominal");
    await orders.of(report, "orders-generator", "extended", "recalibrated", "nominal");
    await added.of(report, "added", "every");
    document.documentElement.dataset.verdict = `${d.finding} ${Math.round(performance.now() - begun)}`;
  }

  /** Columns that are guesses, where a wrong one would look like this verdict. */
  function unsure(finding) {
    const guesses = looked.columns.filter((c, k) => chosen[k].role !== "ignored" && c.used && c.confidence < CERTAIN);
    if (!["not_understood", "data_unusable"].includes(finding) || !guesses.length) return [];
    const names = guesses.map((c) => c.name).join(", ");
    return [
      el("p", {
        class: "line",
        text: `Check “How it is read” first: ${names} are guesses, and a wrong unit looks like this.`,
      }),
    ];
  }

  /** Every candidate: whether it is considered, what it adds, how far it came. */
  function showCauses(d) {
    const namedOnes = new Map(d.causes.map((c) => [c.name, c]));
    const last = new Map();
    for (const step of d.trace) if (step.cause) last.set(step.cause, [...(last.get(step.cause) ?? []), step]);
    for (const cause of now.without) if (!last.has(cause)) last.set(cause, []);
    const evidence = (steps) =>
      Math.max(
        ...steps.filter((s) => s.gate === "evidence" && typeof s.value === "number").map((s) => s.value),
        -Infinity,
      );
    const order = [...last.keys()].sort(
      (a, b) =>
        namedOnes.has(b) - namedOnes.has(a) || evidence(last.get(b)) - evidence(last.get(a)) || a.localeCompare(b),
    );
    const line = (name) => {
      const steps = last.get(name);
      const cause = namedOnes.get(name);
      const stopped = steps.findLast((s) => !s.passed);
      const best = evidence(steps);
      const box = el("input", { type: "checkbox", checked: !now.without.has(name), id: `cause-${name}` });
      box.addEventListener("change", () => {
        now.without[box.checked ? "delete" : "add"](name);
        keep();
        redo();
      });
      const sizes = cause
        ? Object.entries(cause.parameters)
            .map(([p, v]) => `${p} ${number(v.value)} ± ${number(v.std, 2)}`)
            .join(", ")
        : "";
      return [
        el("label", { class: "line" }, box, ` ${name.replaceAll("_", " ")}`),
        cause
          ? `named, ${Math.round(100 * cause.confidence)} %`
          : now.without.has(name)
            ? "not considered"
            : "not named",
        cause ? errorOf(cause.size_arcsec) : "–",
        Number.isFinite(best) ? number(best) : "–",
        cause
          ? [sizes, cause.look_alikes.length ? `looks like ${cause.look_alikes.join(", ").replaceAll("_", " ")}` : ""]
              .filter(Boolean)
              .join("; ")
          : stopped
            ? `${stopped.gate.replaceAll("_", " ")}${typeof stopped.value === "number" ? `: ${number(stopped.value)}${typeof stopped.limit === "number" ? `, asked for ${number(stopped.limit)}` : ""}` : ""}`
            : "",
      ];
    };
    causes.replaceChildren(
      el("h3", { text: "Every candidate cause" }),
      el("p", {
        text: `Untick what you know is not there: the diagnosis is then made without it.${d.trace.some((s) => s.gate === "needs_teeth") ? " “Needs teeth”: say the number of teeth above." : ""}`,
      }),
      table(
        "Candidate causes",
        ["Considered", "Verdict", "Contribution", "Evidence", "Sizes, or what it stopped at"],
        order.map(line),
        { id: "causes-table" },
      ),
    );
  }

  await look();
  return () => {
    round += 1;
    for (const id of running) cancel(id);
    forget();
  };
}
