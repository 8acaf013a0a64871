// The bench of a drive: fields as sliders, teeth while they move, a pitch of contact FEM when they rest.
import { fileJson, fileText, showDrive } from "./api.js";
import { button, calm, commandLine, el, errorOf, number, section, select, table } from "./elements.js";
import { cancel, over, progressOf, run, why } from "./jobs.js";
import { csvColumns, downloads, liveChart, liveDrive, readReport, wholeReport } from "./results.js";
import { sketch } from "./draw.js";

/** What is shown first, as the field calls it; the rest is folded. */
const MAIN = {
  "generator.w0_mm": "Radial displacement w₀ of the wave, mm",
  "flexspline.rim_thickness_mm": "Rim thickness, mm",
  "flexspline.width_mm": "Face width, mm",
  "flexspline.profile_shift": "Profile shift of the flexspline, modules",
  "circular_spline.profile_shift": "Profile shift of the circular spline, modules",
  "flanks.friction_coefficient": "Friction coefficient of the flanks",
};
/** How far a slider reaches around the value of the file, as a share of it: the ranges allowed are for every size of drive. A guess. */
const REACH = 0.2;
/** How far it reaches where the value is zero, in its unit. Guesses. */
const REACH_OF_ZERO = 0.2;
const STEPS = 200;
/** How long sliders rest before the FEM begins, ms. */
const REST_MS = 150;
const GENERATORS = ["two-roller", "four-roller", "double-disc", "cam"];
/** Variants that stand side by side at most: a chart has colours for so many. */
const MOST_PINNED = 3;
const UNITS = { um: "µm", deg: "°", mpa: "MPa", n_m: "N·m", k: "K", c: "°C" };
const ARCSEC = (180 / Math.PI) * 3600;

const shortly = (x) => String(Number(Number(x).toPrecision(5)));

export async function driveBench(view, asked, bench) {
  await bench.refresh();
  const drives = [
    ...bench.state.built_in,
    ...bench.state.files.filter((f) => /^[^/]+\.toml$/.test(f.name) && !/nominal/.test(f.name)).map((f) => f.name),
  ];
  const now = {
    drive: drives.includes(asked.get("drive")) ? asked.get("drive") : "HHD-95",
    sets: {},
    generators: asked.getAll("g").filter((g) => GENERATORS.includes(g)),
    torque: asked.has("torque") ? Number(asked.get("torque")) : 20,
  };
  if (!now.generators.length) now.generators = ["cam"];
  for (const set of asked.getAll("set")) {
    const [path, ...value] = set.split("=");
    now.sets[path] = value.join("=");
  }
  const request = (state = now) => ({ drive: state.drive, sets: { ...state.sets } });
  const entries = () => [
    ["drive", now.drive],
    ...Object.entries(now.sets).map(([path, value]) => ["set", `${path}=${value}`]),
    ...now.generators.map((g) => ["g", g]),
    ["torque", String(now.torque)],
  ];

  // ---- Undo: states before, as text
  const past = [];
  const undo = button("Undo", () => {
    const before = past.pop();
    if (before) Object.assign(now, JSON.parse(before));
    undo.disabled = !past.length;
    controls();
    changed();
  });
  undo.disabled = true;
  const remember = () => {
    const text = JSON.stringify(now);
    if (past.at(-1) === text) return;
    past.push(text);
    if (past.length > 100) past.shift();
    undo.disabled = false;
  };

  // ---- Frame
  const drawing = sketch();
  const loadWords = el("span", { text: "Load, N·m" });
  const form = el("div", { class: "form" });
  const main = el("div", { class: "fields", id: "main-fields" });
  const rest = el("div", {});
  const wrong = el("div", { role: "status" });
  const live = el("p", { class: "readout", role: "status", id: "live" });
  const commands = el("div");
  const chart = liveChart(
    "ripple",
    "Error over the generator angle",
    "Error of the output over one tooth pitch, less its mean, for each generator and variant",
    "One flexspline tooth pitch under the load, each line less its mean.",
  );
  const stress = liveDrive("stress", "Stress, forces and motion");
  const figures = el("div");
  const pinnedPlace = el("div");
  const makePlace = el("div");
  const brief = el("dl", { class: "brief" });
  // What a slider changes stays in sight next to the sliders.
  view.append(
    el("h1", { text: "A drive" }),
    el(
      "div",
      { class: "bench" },
      section("drawn", "Its teeth and what the FEM finds", drawing.element, live, brief),
      section("fields", "Its fields", form, wrong, main, rest),
    ),
    section("pitch", "A pitch of contact FEM", figures, chart.figure, pinnedPlace, stress.figure, commands),
    section("make", "Its tables", makePlace),
  );

  // ---- Fields
  let listed = [];
  const inputs = new Map();
  const original = new Map();

  function set(path, value) {
    if (value === original.get(path)) delete now.sets[path];
    else now.sets[path] = value;
    changed();
  }

  function fieldOf(field) {
    const id = `f-${field.path.replace(".", "-")}`;
    const value = now.sets[field.path] ?? field.value;
    const problem = el("p", { class: "wrong", id: `${id}-wrong` });
    const small = el("small", { id: `${id}-about`, text: field.meaning });
    if (field.range) small.append(`; allowed ${field.range[0]} to ${field.range[1]}`);
    const name =
      MAIN[field.path] ??
      field.path
        .split(".")
        .join(": ")
        .replace(/_(mm|um|rad|mrad|deg|mpa|n_m|k|c)$/, (_, unit) => `, ${UNITS[unit] ?? unit}`)
        .replaceAll("_", " ");
    const common = { "aria-describedby": `${id}-about ${id}-wrong` };
    const row = el("div", { class: "row" });
    if (field.kind === "word") {
      row.append(
        select(
          field.words,
          value,
          (chosen) => {
            remember();
            set(field.path, chosen);
          },
          { id, ...common },
        ),
      );
    } else if (field.kind === "list") {
      // The file's own list is not shown: one number for each tooth. What is written here stands in its place.
      const text = el("textarea", { id, rows: 2, placeholder: "as the drive's file has it", ...common });
      text.value = value ?? "";
      text.addEventListener("change", () => {
        remember();
        const list = text.value.trim().replace(/\s+/g, " ");
        set(field.path, list === "" ? original.get(field.path) : list.startsWith("[") ? list : `[${list}]`);
      });
      row.append(text);
    } else {
      const text = el("input", { type: "text", inputmode: "decimal", id, value, ...common });
      const [at, whole] = [Number(original.get(field.path)), field.kind === "count"];
      let slider = null;
      if (Number.isFinite(at) && field.range) {
        const reach = at === 0 ? REACH_OF_ZERO : REACH * Math.abs(at);
        const [low, high] = [Math.max(field.range[0], at - reach), Math.min(field.range[1], at + reach)];
        const step = whole ? 2 : (high - low) / STEPS;
        slider = el("input", {
          type: "range",
          min: low,
          max: high,
          step: whole ? 2 : "any",
          value: String(at),
          "aria-label": `${name}, slider`,
        });
        slider.value = value;
        small.append(`; slider ${shortly(low)} to ${shortly(high)}`);
        slider.addEventListener("pointerdown", remember);
        slider.addEventListener("keydown", (event) => {
          const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
          if (!by) return;
          event.preventDefault();
          remember();
          slider.value = String(Math.min(high, Math.max(low, Number(slider.value) + by * step)));
          slider.dispatchEvent(new Event("input"));
        });
        slider.addEventListener("input", () => {
          text.value = whole ? slider.value : shortly(slider.value);
          set(field.path, text.value);
        });
        slider.addEventListener("pointerup", released);
        row.append(slider);
      }
      text.addEventListener("change", () => {
        remember();
        if (slider) slider.value = text.value;
        set(field.path, text.value.trim().replace(",", "."));
      });
      row.append(text);
    }
    inputs.set(field.path, { control: row.lastChild, problem });
    return el("div", { class: "field" }, el("label", { for: id, text: name }), row, small, problem);
  }

  function controls() {
    inputs.clear();
    form.replaceChildren(
      el(
        "label",
        {},
        "Drive",
        select(
          drives,
          now.drive,
          (chosen) => {
            remember();
            now.drive = chosen;
            now.sets = {};
            fields();
          },
          { id: "drive-name" },
        ),
      ),
      el(
        "fieldset",
        { class: "form" },
        el("legend", { text: "Generators" }),
        ...GENERATORS.map((g) =>
          el(
            "label",
            { class: "line" },
            el("input", {
              type: "checkbox",
              checked: now.generators.includes(g),
              on: {
                change: (event) => {
                  remember();
                  now.generators = GENERATORS.filter((of) =>
                    of === g ? event.target.checked : now.generators.includes(of),
                  );
                  if (!now.generators.length) now.generators = [g];
                  event.target.checked = now.generators.includes(g);
                  changed();
                },
              },
            }),
            ` ${g}`,
          ),
        ),
      ),
      el(
        "label",
        {},
        loadWords,
        el("input", {
          type: "number",
          id: "torque",
          step: "any",
          value: String(now.torque),
          on: {
            change: (event) => {
              remember();
              now.torque = Number(event.target.value) || 0;
              changed();
            },
          },
        }),
      ),
      undo,
    );
    main.replaceChildren(...listed.filter((f) => f.path in MAIN).map(fieldOf));
    const groups = Map.groupBy(
      listed.filter((f) => !(f.path in MAIN)),
      (f) => f.path.split(".")[0],
    );
    rest.replaceChildren(
      ...[...groups].map(([name, all]) =>
        el(
          "details",
          {},
          el("summary", { text: `${name.replaceAll("_", " ")}: ${all.length} more` }),
          el("div", { class: "fields" }, ...all.map(fieldOf)),
        ),
      ),
    );
    for (const { path } of listed) {
      if (now.sets[path] !== undefined) inputs.get(path)?.control.closest("details")?.setAttribute("open", "");
    }
  }

  /** The fields of another drive. */
  async function fields() {
    [hasSheet, largestLoad] = [false, null];
    const shown = await showDrive({ drive: now.drive, sets: {} }, now.generators[0]);
    listed = shown.fields;
    original.clear();
    for (const field of listed) original.set(field.path, field.value);
    controls();
    await changed();
  }

  // ---- While one drags: drawing and mistakes
  let drawingNow = null;
  let wanted = false;
  let gaps = false;
  let whole = false;
  /** The load that is usual with the generator, N·m. */
  let rated = null;
  /** Draws what there is now; with the gaps of the teeth when sliders rest. */
  async function draw(atRest = false) {
    gaps = atRest;
    if (drawingNow) {
      wanted = true;
      return drawingNow;
    }
    drawingNow = (async () => {
      do {
        wanted = false;
        const shown = await showDrive(request(), now.generators[0], gaps);
        whole = shown.problems.length === 0;
        for (const { control, problem } of inputs.values()) {
          problem.textContent = "";
          control.removeAttribute("aria-invalid");
        }
        const others = [];
        for (const { field, what } of shown.problems) {
          const at = inputs.get(field);
          if (at) {
            at.problem.textContent = what;
            at.control.setAttribute("aria-invalid", "true");
          } else others.push(field ? `${field}: ${what}` : what);
        }
        wrong.replaceChildren(
          ...[...others, ...shown.cautions].map((words) => el("p", { class: "wrong", text: words })),
        );
        rated = shown.rated_torque_n_m ?? rated;
        loadWords.textContent = `Load, N·m (usual at most: ${number(rated)})`;
        if (shown.drawing) drawing.draw(shown.drawing);
      } while (wanted);
    })();
    try {
      await drawingNow;
    } catch (error) {
      whole = false;
      bench.complain(error);
    } finally {
      drawingNow = null;
    }
  }

  // ---- When one stops: FEM
  let round = 0;
  /** Whether the drive's file states the stiffness of a data sheet, as far as is known. */
  let hasSheet = false;
  /** The rated load of that data sheet, N·m. */
  let largestLoad = null;
  let pinned = [];
  const running = new Set();
  /** What was found of this drive, by generator. */
  let found = new Map();

  /** When something changed last, and whether the FEM has begun since. */
  let [changedAt, begunFor] = [0, 0];
  function begin() {
    if (begunFor === round) return;
    begunFor = round;
    compute().catch((error) => bench.complain(error));
  }
  const rested = calm(REST_MS, begin);
  /** A slider let go of need not rest: once its last value is set. */
  const released = () => setTimeout(begin);
  async function changed() {
    round += 1;
    changedAt = performance.now();
    live.textContent = "";
    for (const old of [figures, brief]) old.classList.add("waits");
    bench.keep("drive", entries());
    for (const id of running) cancel(id);
    running.clear();
    make();
    rested();
    await draw();
  }

  /** Notes a job of this round; one whose round is over when it is known is not wanted any more. */
  const wantedBy = (mine) => (j) => (mine === round ? running.add(j.id) : cancel(j.id));

  async function pitch(drive, g, torque, mesh, mine) {
    const begun = performance.now();
    const job = await run({ work: "simulate", drive, generator: g, torque_n_m: torque, mesh }, wantedBy(mine));
    running.delete(job.id);
    if (mine !== round) return null;
    if (job.state !== "done") throw new Error(why(job));
    const [summary, csv] = await Promise.all([fileJson(`${job.out}/summary.json`), fileText(`${job.out}/results.csv`)]);
    return { job, summary, rows: csvColumns(csv), mesh, waited_ms: performance.now() - begun };
  }

  async function sheet(drive, g, mine) {
    const job = await run({ work: "sheet", drive, generator: g }, wantedBy(mine));
    running.delete(job.id);
    if (mine !== round || job.state !== "done") return null;
    const columns = Object.entries(csvColumns(await fileText(`${job.out}/sweep.csv`)));
    return {
      job,
      figures: Object.fromEntries(columns.filter(([, [x]]) => Number.isFinite(x)).map(([name, [x]]) => [name, x])),
    };
  }

  async function compute() {
    const [mine, begun] = [round, changedAt];
    await drawingNow;
    if (mine !== round) return;
    // The gaps of the teeth are looked for while the FEM runs.
    const gapsSeen = draw(true);
    if (!whole) {
      live.textContent = "The FEM waits for a drive that is whole: see the fields marked above.";
      return gapsSeen;
    }
    const [drive, torque, generators] = [request(), now.torque, [...now.generators]];
    found = new Map(generators.map((g) => [g, {}]));
    // The coarse ones first, on all cores; the server's line says how many run at a time.
    for (const mesh of ["coarse", "standard"]) {
      const runs = generators.map((g) =>
        pitch(drive, g, torque, mesh, mine).catch((error) => ({ failed: error.message })),
      );
      for (const [k, run] of runs.entries()) {
        live.textContent = `${generators[k]}: contact FEM, ${mesh} mesh …`;
        const result = await run;
        if (!result || mine !== round) return;
        Object.assign(found.get(generators[k]), result);
        const sheetOf = result.summary?.data_sheet;
        // What a data sheet states was computed with the pitch: nothing of it is asked for again.
        if (sheetOf) found.get(generators[k]).sheet = { figures: { ...sheetOf.sheet, ...sheetOf.loads } };
        if (!hasSheet && sheetOf?.beside.some((b) => b.figure === "k1_n_m_per_rad")) {
          hasSheet = true;
          largestLoad = sheetOf.stated.rated_torque_n_m;
          if (document.getElementById("make-tables")) make();
        }
        await present(mine);
        if (mine !== round) return;
      }
      const ms = Math.round(performance.now() - begun);
      document.documentElement.dataset[mesh] = `${mine} ${ms}`;
      live.textContent = `${mesh} mesh, ${(ms / 1000).toFixed(1)} s`;
    }
    for (const g of generators.filter((name) => !found.get(name).sheet)) {
      live.textContent = `${g}: stiffness K1 to K3 …`;
      const of = await sheet(drive, g, mine);
      if (mine !== round) return;
      found.get(g).sheet = of;
      await present(mine);
    }
    live.textContent =
      "Standard mesh; stiffness on the coarse mesh, each K a secant between the loads T1, T2 and the largest.";
    document.documentElement.dataset.sheet = String(mine);
  }

  const FIGURES = [
    ["Kinematic error, peak to peak", (f) => errorOf(f.summary?.kinematic_error_pp_arcsec)],
    ["Backlash", (f) => errorOf(f.sheet?.figures.backlash_arcsec)],
    ["Wind-up under the load, clearance included", (f) => errorOf(f.summary?.wind_up_arcsec)],
    ["of it elastic", (f) => errorOf(f.summary?.wind_up_elastic_arcsec)],
    ["K1, N·m/rad", (f) => number(f.sheet?.figures.k1_n_m_per_rad, 4)],
    ["K2, N·m/rad", (f) => number(f.sheet?.figures.k2_n_m_per_rad, 4)],
    ["K3, N·m/rad", (f) => number(f.sheet?.figures.k3_n_m_per_rad, 4)],
    [
      "T1, T2 and largest load, N·m",
      (f) =>
        f.sheet?.figures.t1_n_m
          ? [f.sheet.figures.t1_n_m, f.sheet.figures.t2_n_m, f.sheet.figures.largest_n_m]
              .map((t) => number(t))
              .join(", ")
          : "–",
    ],
    ["Root fillets, MPa", (f) => number(f.summary?.root_fillet_mpa)],
    ["Bore, MPa", (f) => number(f.summary?.nodal_bore_mpa)],
    ["Flank pressure, MPa", (f) => number(f.summary?.peak_flank_pressure_mpa)],
    ["Mesh", (f) => f.mesh ?? (f.failed ? "failed" : "…")],
  ];

  /** What the catalogue states, in words. */
  const STATED = {
    k1_n_m_per_rad: "K1, N·m/rad",
    k2_n_m_per_rad: "K2, N·m/rad",
    k3_n_m_per_rad: "K3, N·m/rad",
    hysteresis_loss_arcmin: "Hysteresis loss, arcmin",
    lost_motion_arcmin: "Lost motion, arcmin",
    ratcheting_torque_n_m: "Ratcheting torque, N·m",
    starting_torque_n_m: "Starting torque, N·m",
    accuracy_arcmin: "Accuracy, arcmin",
  };
  /** Figures of the data sheet beside those computed; nothing of a drive that has none. */
  function dataSheet(name, { summary }) {
    const beside = summary?.data_sheet?.beside ?? [];
    if (!beside.length) return [];
    return [
      table(
        `${name}: the data sheet, and what is computed of the teeth alone`,
        ["Figure", "Stated", "Computed", "Computed / stated", "Why they differ"],
        beside.map((b) => [
          STATED[b.figure] ?? b.figure,
          number(b.stated, 4),
          number(b.computed, 4),
          number(b.ratio),
          [b.words, b.reason].filter(Boolean).join("; "),
        ]),
        { class: "data-sheet" },
      ),
      el("p", {}, "A table for a real unit takes the missing compliance from the data sheet: see “Its tables” below."),
    ];
  }

  let seenStress = "";
  async function present(mine) {
    if (mine !== round) return;
    for (const fresh of [figures, brief]) fresh.classList.remove("waits");
    const shown = [...pinned, ...[...found].map(([g, of]) => ({ name: g, of }))];
    const failed = shown.filter(({ of }) => of.failed);
    figures.replaceChildren(
      table(
        "What the FEM finds; pinned variants first",
        ["", ...shown.map(({ name }) => name)],
        FIGURES.map(([words, of]) => [words, ...shown.map((s) => of(s.of))]),
      ),
      ...[...found].flatMap(([g, of]) => dataSheet(g, of)),
      ...failed.map(({ name, of }) => el("p", { class: "wrong line", text: `${name}: ${of.failed}` })),
      button("Pin these to compare", pin, {
        disabled: pinned.length >= MOST_PINNED || !shown.some(({ of }) => of.summary),
      }),
    );
    const [one] = found.values();
    brief.replaceChildren(
      ...FIGURES.slice(0, 7).flatMap(([words, of]) => [el("dt", { text: words }), el("dd", {}, of(one))]),
    );
    const lines = shown.filter(({ of }) => of.rows);
    const first = [...found.values()].find((of) => of.job);
    // Pictures of another drive beside a failure would be taken for those of this one.
    [chart.figure.hidden, stress.figure.hidden] = [!lines.length, !first];
    if (lines.length) {
      // Over the pitch as the report has it: from where a generator at angle 0 stands.
      const curve = ({ of }) => {
        const [at, error] = [of.rows.generator_rad, of.rows.error_arcsec];
        const mean = error.reduce((a, b) => a + b, 0) / error.length;
        const pitch = ((at.at(-1) - at[0]) * at.length) / (at.length - 1);
        const place = (x) => Number((((((x / pitch) % 1) + 1 + 1e-9) % 1) * pitch * (180 / Math.PI)).toFixed(6));
        return at.map((x, k) => [place(x), error[k] - mean]);
      };
      const curves = lines.map(curve);
      const xs = [...new Set(curves.flat().map(([x]) => x))].sort((a, b) => a - b);
      const columns = curves.map((points) => {
        const at = new Map(points);
        return xs.map((x) => at.get(x) ?? NaN);
      });
      await chart.columns(
        { label: "Generator from the beginning of the pitch", quantity: "degree" },
        { label: "Error less its mean", quantity: "error" },
        lines.map(({ name, of }, k) => ({
          name: `${name}, ${of.mesh}`,
          mark: pinned.includes(lines[k]) ? "dashed" : "line",
          colour: k,
        })),
        [xs, ...columns],
      );
    }
    if (first && seenStress !== first.job.out) {
      seenStress = first.job.out;
      await stress.of(await readReport(`${first.job.out}/report.html`));
    }
    commands.replaceChildren(
      el("h3", { text: "The commands that make the same files" }),
      ...[...found.values()].flatMap((of) =>
        [of.job, of.sheet?.job].filter(Boolean).map((job) => commandLine(job.command)),
      ),
      ...(first ? [wholeReport(first.job.out)] : []),
    );
  }

  function pin() {
    const count = pinned.length + 1;
    for (const [g, of] of found) {
      if (of.summary && pinned.length < MOST_PINNED)
        pinned.push({ name: `${count}: ${g}`, of: { ...of }, state: JSON.stringify(now) });
    }
    pinnedPlace.replaceChildren(
      ...pinned.map((one, k) =>
        el(
          "p",
          {},
          `Pinned ${one.name}: ${
            Object.entries(JSON.parse(one.state).sets)
              .map(([p, v]) => `${p} = ${v}`)
              .join(", ") || "as its file has it"
          } `,
          button("Go back to it", () => {
            remember();
            Object.assign(now, JSON.parse(one.state));
            controls();
            changed();
          }),
          " ",
          button(
            "Let go",
            () => {
              pinned = pinned.filter((other) => other !== one);
              pinnedPlace.children[k]?.remove();
              present(round);
            },
            { "aria-label": `Let go of ${one.name}` },
          ),
        ),
      ),
    );
    present(round);
  }

  // ---- Tables
  let making = null;
  function make() {
    if (making) return;
    const of = now.generators[0];
    const choice = select(GENERATORS, of, () => undefined, { id: "table-generator" });
    const complete = el("input", { type: "checkbox", id: "complete", checked: hasSheet });
    const largest = el("input", { type: "number", id: "table-torque", step: "any", min: 0, placeholder: "as usual" });
    if (largestLoad) largest.value = largestLoad;
    const fineness = select(["coarse", "standard", "fine"], "standard", () => undefined, { id: "table-mesh" });
    const go = button(
      "Make the tables",
      async () => {
        const [drive, generator, mesh] = [request(), choice.value, fineness.value];
        const place = el("div", { role: "status" });
        makePlace.replaceChildren(place);
        try {
          const torque_n_m = largest.value === "" ? null : Number(largest.value);
          const work = { work: "tables", drive, generator, mesh, torque_n_m, complete: complete.checked };
          const job = await run(work, (j) => {
            making = j.id;
            place.replaceChildren(progressOf(j));
          });
          making = null;
          await made(job, drive, generator);
        } catch (error) {
          making = null;
          makePlace.replaceChildren(el("p", { class: "wrong line", text: error.message }), again());
        }
      },
      { id: "make-tables", class: "of-form" },
    );
    makePlace.replaceChildren(
      el("p", {
        text: "Sweeps by contact FEM over torque and temperature, a minute or two; the page may be closed meanwhile.",
      }),
      el(
        "p",
        {},
        "A table of the drawing corrects what the drawing has. A real unit has more, most of it its own: to point precisely, ",
        el("a", { href: "#log", text: "calibrate it by a log" }),
        ".",
      ),
      el(
        "div",
        { class: "form" },
        el("label", {}, "Generator", choice),
        el("label", {}, "Mesh", fineness),
        el("label", {}, "Largest load, N·m", largest),
        // A built-in drive has no file, and no sheet in it.
        ...(now.drive.endsWith(".toml")
          ? [el("label", { class: "line" }, complete, " take the missing compliance from the data sheet in its file")]
          : []),
        go,
      ),
    );
  }
  const again = () => button("Back", () => make());

  async function made(job, drive, generator) {
    if (job.state !== "done") {
      makePlace.replaceChildren(el("p", { class: "wrong line", text: why(job) }), commandLine(job.command), again());
      return;
    }
    const info = await fileJson(`${job.out}/${generator}.json`);
    const extra = el("div", { role: "status" });
    const also = async (work, then) => {
      const ended = await run(work, (j) => extra.replaceChildren(progressOf(j)));
      extra.replaceChildren(commandLine(ended.command));
      if (ended.state === "done") extra.prepend(then(ended));
      else extra.prepend(el("p", { class: "wrong line", text: why(ended) }));
    };
    makePlace.replaceChildren(
      el("p", { text: `Table ${info.table_id} of ${generator} is made.` }),
      ...(info.remarks ?? []).map((remark) => el("p", { class: "line", text: remark })),
      downloads(job.out, [
        [`${generator}.fxt`, "the image that firmware reads"],
        [`${generator}.h`, "the same as a C header"],
        [`${generator}.rs`, "the same for Rust"],
        [`${generator}.json`, "what made it, and how good it is"],
        [`${generator}.samples.csv`, "its samples"],
      ]),
      el(
        "div",
        { class: "form" },
        button("Bundle for firmware", () =>
          also({ work: "bundle", tables: job.out }, (ended) =>
            downloads(ended.out, [["flexspline.tar.gz", "table, reader in C99, build files"]]),
          ),
        ),
        button("Validate against fresh FEM", () =>
          also({ work: "validate", tables: job.out, drive, generator }, (ended) =>
            el("pre", { text: ended.printed, tabindex: 0, role: "region", "aria-label": "Validation" }),
          ),
        ),
        el("a", {
          href: `#table?${new URLSearchParams({ table: `${job.out}/${generator}.fxt` })}`,
          text: "Open its bench",
        }),
        again(),
      ),
      extra,
      commandLine(job.command),
      wholeReport(job.out),
    );
    makePlace.dataset.made = job.out;
  }

  /** A job that was begun before this page was opened. */
  async function resume() {
    const { jobs } = await import("./jobs.js");
    const wanted = JSON.stringify(request());
    const mine = [...jobs.values()]
      .filter(
        (j) =>
          j.work === "tables" &&
          j.asked.drive &&
          JSON.stringify({ drive: j.asked.drive.drive, sets: j.asked.drive.sets }) === wanted,
      )
      .sort((a, b) => b.id - a.id)[0];
    if (!mine || !["waiting", "running", "done"].includes(mine.state)) return;
    const place = el("div", { role: "status" });
    makePlace.replaceChildren(place);
    making = mine.id;
    const job = await over(mine.id, (j) => place.replaceChildren(progressOf(j)));
    making = null;
    await made(job, request(), mine.asked.generator);
  }

  await fields();
  setTimeout(() => resume().catch((error) => bench.complain(error)), 300);
  /** Nobody waits any more for what the sliders asked. */
  const gone = () => {
    round += 1;
    for (const id of running) cancel(id);
  };
  addEventListener("pagehide", gone);
  return () => {
    removeEventListener("pagehide", gone);
    gone();
  };
}
