// The bench of a table, and the certificate of a calibrated unit.
import { fileJson, fileText } from "./api.js";
import { button, commandLine, el, errorOf, number, section, select, table } from "./elements.js";
import { progressOf, run, why } from "./jobs.js";
import { csvColumns, downloads, liveChart, readReport, wholeReport } from "./results.js";

const GENERATORS = ["cam", "double-disc", "four-roller", "two-roller"];
/** Points of a chart at most: a screen shows no more. */
const MOST_POINTS = 4000;
/** Points of an angle over a turn. */
const FINE = 720;
/** Amplitude below which an order is not named: a tenth of an arc-second, below what a table holds. */
const NAMED_ARCSEC = 0.1;
/** Orders of a spectrum that are shown. */
const ORDERS = 12;

/** What a table is: an image, and what was written beside it. */
export async function tableBench(view, asked, bench) {
  await bench.refresh();
  let name = asked.get("table") ?? "";
  const there = new Set(bench.state.files.map((f) => f.name));
  view.append(
    el("h1", { text: "A table" }),
    bench.dropZone("Drop a table (.fxt) or samples (.csv) here:", (names) => {
      location.hash = `#table?${new URLSearchParams({ table: names[0] })}`;
    }),
  );
  if (!there.has(name)) return undefined;
  if (!name.endsWith(".fxt")) {
    view.append(samples(name));
    return undefined;
  }
  const out = name.includes("/") ? name.slice(0, name.lastIndexOf("/")) : "";
  const stem = name
    .split("/")
    .at(-1)
    .replace(/\.fxt$/, "");
  const beside = (file) => (out ? `${out}/${file}` : file);
  const about = el("div");
  view.append(section("about", name, about));
  if (there.has(beside("calibration.json")) && stem === "calibrated") {
    about.append(
      el(
        "p",
        {},
        el("a", { href: `#certificate?${new URLSearchParams({ of: out || "." })}`, text: "Certificate of this unit" }),
      ),
    );
  }
  if (there.has(beside(`${stem}.json`))) {
    const info = await fileJson(beside(`${stem}.json`));
    const rows = Object.entries(info)
      .filter(([, value]) => ["string", "number"].includes(typeof value))
      .map(([key, value]) => [key.replaceAll("_", " "), typeof value === "number" ? number(value, 4) : value]);
    about.append(table("What was written beside it", ["", ""], rows));
  }
  about.append(
    downloads(out || ".", [
      [`${stem}.fxt`, "the image that firmware reads"],
      ...["h", "rs", "json"].filter((e) => there.has(beside(`${stem}.${e}`))).map((e) => [`${stem}.${e}`, "beside it"]),
    ]),
  );
  for (const link of about.querySelectorAll("a[download]")) link.href = link.getAttribute("href").replace("/./", "/");

  // ---- What it leaves of a log
  const logs = bench.state.files
    .filter(
      (f) =>
        /\.(csv|log|txt|tsv|dat)$/i.test(f.name) &&
        !/(samples|results|sweep|replay|plan|\d{4}-of-\d{4})\.csv$/.test(f.name),
    )
    .map((f) => f.name);
  const place = el("div", { role: "status" });
  const chart = liveChart("left", "Residual", "Measured error, and residual with the table, over the rows", "");
  chart.figure.hidden = true;
  const columns = el("input", { type: "text", id: "replay-columns", value: asked.get("columns") ?? "", size: 40 });
  const file = logs.length
    ? select(logs, logs.includes(asked.get("file")) ? asked.get("file") : logs[0], () => undefined, {
        id: "replay-file",
      })
    : null;
  const replay = async () => {
    try {
      // Without a mapping that somebody gave, that which `look` proposes.
      let map = columns.value.trim();
      if (!map) {
        const job = await run({ work: "look", files: [file.value] }, (j) => place.replaceChildren(progressOf(j)));
        if (job.state === "done") map = (await fileJson(`${job.out}/look.json`)).columns_option ?? "";
        columns.value = map;
      }
      const job = await run({ work: "replay", file: file.value, table: name, columns: map }, (j) =>
        place.replaceChildren(progressOf(j)),
      );
      if (job.state !== "done") {
        place.replaceChildren(el("p", { class: "wrong line", text: why(job) }), commandLine(job.command));
        return;
      }
      const rows = csvColumns(await fileText(`${job.out}/replay.csv`));
      place.replaceChildren(
        el("pre", { text: job.printed, tabindex: 0, role: "region", "aria-label": "What replay says" }),
        downloads(job.out, [
          ["replay.csv", "each row with what the table says"],
          ["summary.json", "the figures"],
        ]),
        commandLine(job.command),
      );
      const names = Object.keys(rows).filter((n) => n.endsWith("_arcsec"));
      const every = Math.ceil(rows[names[0]].length / MOST_POINTS);
      const thin = (all) => all.filter((_, k) => k % every === 0);
      const x = thin(rows[names[0]].map((_, k) => k));
      await chart.columns(
        { label: "Row", quantity: "count" },
        { label: "Error", quantity: "error" },
        names
          .slice(0, 4)
          .map((n, k) => ({ name: n.replace(/_arcsec$/, "").replaceAll("_", " "), mark: "dots", colour: k })),
        [x, ...names.slice(0, 4).map((n) => thin(rows[n]))],
      );
      chart.figure.hidden = false;
      document.documentElement.dataset.replayed = job.out;
    } catch (error) {
      place.replaceChildren(el("p", { class: "wrong line", text: error.message }));
    }
  };
  view.append(
    section(
      "replay",
      "Residual on a log",
      file
        ? el(
            "div",
            { class: "form" },
            el("label", {}, "Log", file),
            el("label", { for: "replay-columns" }, "Columns (empty: as they look)", columns),
            button("Replay", replay, { id: "replay-go" }),
          )
        : el("p", { text: "Drop a log above, then come back: there is none in this folder." }),
      place,
      chart.figure,
    ),
    firmware(name),
  );
  return undefined;
}

function firmware(name) {
  const place = el("div", { role: "status" });
  const go = button("Bundle for firmware", async () => {
    try {
      const job = await run({ work: "bundle", tables: name }, (j) => place.replaceChildren(progressOf(j)));
      place.replaceChildren(
        job.state === "done"
          ? downloads(job.out, [["flexspline.tar.gz", "table, reader in C99, build files"]])
          : el("p", { class: "wrong line", text: why(job) }),
        commandLine(job.command),
      );
    } catch (error) {
      place.replaceChildren(el("p", { class: "wrong line", text: error.message }));
    }
  });
  return section("firmware", "For firmware", el("div", { class: "form" }, go), place);
}

/** Samples of another program, to a table. */
function samples(name) {
  const place = el("div", { role: "status" });
  const generator = select(GENERATORS, GENERATORS.find((g) => name.includes(g)) ?? "cam", () => undefined, {
    id: "samples-generator",
  });
  const go = button(
    "Make the table",
    async () => {
      try {
        const job = await run(
          { work: "samples", file: name, drive: { drive: "HHD-95" }, generator: generator.value },
          (j) => place.replaceChildren(progressOf(j)),
        );
        if (job.state !== "done") {
          place.replaceChildren(el("p", { class: "wrong line", text: why(job) }), commandLine(job.command));
          return;
        }
        place.replaceChildren(
          downloads(job.out, [
            [`${generator.value}.fxt`, "the image that firmware reads"],
            [`${generator.value}.h`, "the same as a C header"],
            [`${generator.value}.json`, "how good it is"],
          ]),
          el(
            "p",
            {},
            el("a", {
              href: `#table?${new URLSearchParams({ table: `${job.out}/${generator.value}.fxt` })}`,
              text: "Open its bench",
            }),
          ),
          commandLine(job.command),
          wholeReport(job.out),
        );
        document.documentElement.dataset.made = job.out;
      } catch (error) {
        place.replaceChildren(el("p", { class: "wrong line", text: error.message }));
      }
    },
    { id: "samples-go" },
  );
  return section(
    "samples",
    name,
    el("p", {
      text: "Samples with generator_rad, torque_n_m, temperature_c, direction and output_rad, of the drive HHD-95.",
    }),
    el("div", { class: "form" }, el("label", {}, "Generator", generator), go),
    place,
  );
}

// ---- Certificate

/** A curve through nodes of one part, over `period` degrees, at equal places; linear between nodes. */
function curve(nodes, period, count) {
  const at = nodes.map((n) => [n.at, n.value_arcsec]).sort((a, b) => a[0] - b[0]);
  const all = [[at.at(-1)[0] - period, at.at(-1)[1]], ...at, [at[0][0] + period, at[0][1]]];
  return Array.from({ length: count }, (_, k) => {
    const x = (period * k) / count;
    const j = Math.max(
      1,
      all.findIndex(([to]) => to >= x),
    );
    const [[a, p], [b, q]] = [all[j - 1], all[j]];
    return b > a ? p + ((x - a) / (b - a)) * (q - p) : p;
  });
}

/** Amplitudes of the first orders of what repeats. */
function amplitudes(values) {
  return Array.from({ length: ORDERS }, (_, k) => {
    let [c, s] = [0, 0];
    values.forEach((v, j) => {
      const angle = (2 * Math.PI * (k + 1) * j) / values.length;
      c += v * Math.cos(angle);
      s += v * Math.sin(angle);
    });
    return (2 * Math.hypot(c, s)) / values.length;
  });
}

/** What an order of an angle usually is, as far as its number says it. */
function orderInWords(of, order, teeth) {
  if (of === "share_of_pitch_deg")
    return `tooth mesh, ${order === 1 ? teeth : `${order} × ${teeth}`} in a turn of the generator`;
  if (of === "output_deg")
    return { 1: "output encoder or axis off centre", 2: "output encoder tilted, or an oval" }[order] ?? "output";
  const two = { 1: "generator's encoder or bearing", 2: "two lobes: teeth off pitch, wheels out of round" }[order];
  return two ?? (order % 2 ? "generator's encoder" : "two lobes, a harmonic of them");
}

/** How often an angle of the nodes turns in a turn of the output. Two waves: teeth of a held flexspline, or of a held ring. */
function turnsOf(of, ratio) {
  const turns = Math.abs(ratio);
  if (of === "output_deg") return 1;
  if (of === "generator_against_output_deg") return Math.abs(ratio - 1);
  if (of === "share_of_pitch_deg") return turns * 2 * (ratio > 0 ? turns - 1 : turns);
  return turns;
}

/** The certificate of a calibrated unit, one page to print. */
export async function certificate(view, asked) {
  const of = asked.get("of") ?? ".";
  const file = (name) => (of === "." ? name : `${of}/${name}`);
  const c = await fileJson(file("calibration.json"));
  const report = await readReport(file("report.html")).catch(() => null);
  view.classList.add("certificate");
  // Parts over an angle that repeats: by the turn that they repeat over, degrees, and turns of it to one of the output.
  const parts = Map.groupBy(c.nodes, (n) => n.part);
  const cyclic = [...parts]
    .filter(([, nodes]) => /_deg$/.test(nodes[0].of) && nodes.length > 3)
    .map(([part, nodes]) => {
      const of = nodes[0].of;
      const ofOutput = of === "output_deg";
      const values = curve(nodes, 360, FINE);
      const perOutput = turnsOf(of, c.ratio);
      const slopes = values.map((v, k) => ((values[(k + 1) % FINE] - v) / (360 / FINE)) * perOutput);
      return {
        of,
        part: part.replaceAll("_", " "),
        angle: ofOutput ? "output" : of === "share_of_pitch_deg" ? "tooth pitch" : "generator",
        values,
        perOutput,
        steepest: Math.max(...slopes.map(Math.abs)),
        pp: Math.max(...values) - Math.min(...values),
        orders: amplitudes(values),
      };
    });
  // What a screen can show apart; a wave of the tooth pitch is a band about it.
  const shown = cyclic.filter((p) => p.perOutput <= MOST_POINTS / 8);
  const bands = cyclic.filter((p) => p.perOutput > MOST_POINTS / 8);
  const teeth = 2 * Math.abs(c.ratio > 0 ? c.ratio - 1 : c.ratio);
  const whole = liveChart(
    "whole",
    "Error that the table holds, over a whole turn of the output",
    "The sum of the parts of the table over a turn of the output, without load",
    `Without load: ${shown.map((p) => p.part).join(", ") || "no part repeats"}${bands.length ? "; within the dashed lines the tooth wave goes to and fro" : ""}.`,
  );
  const turn = liveChart(
    "turn",
    "Where it was recorded",
    "Measured error and residual with the table, over turns of the output",
    "Rows in steady motion, as measured and with the table.",
  );
  const spectrum = liveChart(
    "spectrum",
    "Spectrum by part",
    "Amplitude of each order of each part of the table",
    "Orders of the angle that each part repeats over.",
  );
  const steepest = cyclic.reduce((sum, p) => sum + p.steepest, 0);
  const atRate = el("output", { for: "rate" });
  const rate = el("input", { type: "number", id: "rate", min: 0, step: "any", value: asked.get("rate") ?? "1" });
  const told = () => (atRate.textContent = `${number(steepest * Number(rate.value))} ″/s`);
  rate.addEventListener("input", told);
  told();
  const largest = cyclic.flatMap((p) =>
    p.orders
      .map((amplitude, k) => ({ p, amplitude, order: k + 1 }))
      .sort((a, b) => b.amplitude - a.amplitude)
      .slice(0, 2)
      .filter(({ amplitude }) => amplitude >= NAMED_ARCSEC),
  );
  const late = c.readings.some((reading) => reading.name === "delay");
  view.append(
    el("h1", { text: "Certificate of a unit" }),
    el(
      "p",
      { class: "no-print" },
      button("Print", () => print()),
    ),
    table(
      "Measured error, and residual with the table",
      ["", "rms"],
      [
        [late ? "As measured less a reading delay" : "As measured", errorOf(c.held_out.rms_before_arcsec)],
        ["With the table, held out", errorOf(c.held_out.rms_after_arcsec)],
        ["Left by the core, all rows, reversals among them", errorOf(c.core.rms_after_arcsec)],
        ["Error with the table, 95 % interval", errorOf(c.half_width_arcsec)],
      ],
    ),
    table(
      "Parts of the table over an angle",
      ["Part", "Peak to peak", "Steepest slope, ″ for a degree of the output"],
      cyclic.map((p) => [p.part, errorOf(p.pp), number(p.steepest)]),
    ),
    table(
      "Largest orders, by part",
      ["Part", "Order", "Amplitude", "An order of"],
      largest.map(({ p, amplitude, order }) => [
        p.part,
        String(order),
        errorOf(amplitude),
        orderInWords(p.of, order, teeth),
      ]),
      { id: "orders-table" },
    ),
    el("p", {
      id: "steepest",
      text: `Steepest slope, all parts together at most: ${number(steepest)} ″ for a degree of the output.`,
    }),
    el(
      "p",
      { id: "slope-at-rate" },
      el("label", { for: "rate" }, "While the output turns at (°/s) ", rate),
      " the error changes by up to ",
      atRate,
      ".",
    ),
    whole.figure,
    el("div", { class: "two" }, turn.figure, spectrum.figure),
    el(
      "dl",
      {},
      ...[
        ["Table", c.table_id],
        ["Ratio", String(c.ratio)],
        ["Logs", c.files.join(", ")],
        ["Rows", String(c.rows)],
        ["Loads, N·m", c.torque_n_m.map((t) => number(t)).join(" to ")],
        ["Temperatures, °C", c.temperature_c.map((t) => number(t)).join(" to ")],
      ].map(([name, value]) => el("div", {}, el("dt", { text: name }), el("dd", { text: value }))),
    ),
    ...c.notes.map((note) => el("p", { class: "line", text: note })),
    el(
      "p",
      { class: "no-print" },
      "Drawn of ",
      el("code", { text: file("calibration.json") }),
      "; the command that makes it:",
    ),
    commandLine(c.command),
  );
  const turns = Array.from({ length: MOST_POINTS }, (_, k) => k / MOST_POINTS);
  whole.figure.hidden = !shown.length;
  if (shown.length) {
    const at = (p, output) => p.values[Math.floor(((output * p.perOutput) % 1) * FINE)];
    const sum = turns.map((output) => shown.reduce((all, p) => all + at(p, output), 0));
    const beyond = (of) => bands.reduce((all, p) => all + of(...p.values), 0);
    const [least, most] = [Math.min, Math.max].map((of) => sum.map((value) => value + beyond(of)));
    const band = [least, most].map((_, k) => ({
      name: `tooth wave, ${k ? "most" : "least"}`,
      mark: "dashed",
      colour: 1,
    }));
    await whole.columns(
      { label: "Output", quantity: "turn" },
      { label: "Error", quantity: "error" },
      [{ name: "held by the table", mark: "line", colour: 0 }, ...(bands.length ? band : [])],
      [turns, sum, ...(bands.length ? [least, most] : [])],
    );
  }
  if (report?.json.figures["over-output"]) await turn.of(report, "over-output", "every");
  else turn.figure.hidden = true;
  if (cyclic.length) {
    const orders = Array.from({ length: ORDERS }, (_, k) => k + 1);
    await spectrum.columns(
      { label: "Order", quantity: "whole" },
      { label: "Amplitude", quantity: "error" },
      cyclic.map((p, k) => ({ name: `${p.part}, ${p.angle}`, mark: "points", colour: k })),
      [orders, ...cyclic.map((p) => p.orders)],
    );
  } else spectrum.figure.hidden = true;
  return () => view.classList.remove("certificate");
}
