// The page: which bench is shown, by the address; what there is to begin with; the jobs at its foot.
import { sendFile, state } from "./api.js";
import { driveBench } from "./drive-bench.js";
import { button, el, section, select } from "./elements.js";
import { follow, progressOf, run, show, why } from "./jobs.js";
import { logBench } from "./log-bench.js";
import { setUnits } from "./quantities.js";
import { certificate, tableBench } from "./table-bench.js";

/** What every bench may use. */
const bench = {
  state: null,
  async refresh() {
    bench.state = await state();
    return bench.state;
  },
  complain,
  say,
  /** Files as they come from a reader, copied into the folder; their names there. */
  async take(files) {
    const names = [];
    for (const file of files) {
      if (file.size > bench.state.largest_file)
        throw new Error(`${file.name}: ${file.size} bytes; allowed: ${bench.state.largest_file}`);
      say(`copying ${file.name}`);
      names.push(await sendFile(file.name, file));
    }
    say("");
    await bench.refresh();
    return names;
  },
  dropZone,
};

function complain(error) {
  const problem = document.getElementById("problem");
  problem.textContent = error ? (error.message ?? String(error)) : "";
  problem.hidden = !error;
}

function say(text) {
  document.getElementById("said").textContent = text;
}

/** A place to drop files on, with a button for those who do not. */
function dropZone(words, listener, accept = "") {
  const input = el("input", { type: "file", multiple: true, accept, id: `drop-${words.replace(/\W+/g, "-")}` });
  const zone = el("div", { class: "drop" }, el("label", { for: input.id, text: `${words} ` }), input);
  const took = async (files) => {
    if (!files.length) return;
    try {
      complain(null);
      listener(await bench.take([...files]));
    } catch (error) {
      complain(error);
    }
  };
  input.addEventListener("change", () => took(input.files));
  zone.addEventListener("dragover", (event) => {
    event.preventDefault();
    zone.classList.add("over");
  });
  zone.addEventListener("dragleave", () => zone.classList.remove("over"));
  zone.addEventListener("drop", (event) => {
    event.preventDefault();
    zone.classList.remove("over");
    took(event.dataTransfer.files);
  });
  return zone;
}

const go = (hash) => {
  location.hash = hash;
};

/** Files of the folder whose names fit, the newest first. */
const named = (pattern) =>
  bench.state.files.filter((f) => pattern.test(f.name)).sort((a, b) => b.changed_s - a.changed_s);

/** What have you got? */
async function start(view) {
  await bench.refresh();
  const like = el("input", { type: "text", id: "like", value: "CSG-25-80", pattern: "[A-Za-z]+-[0-9]+-[0-9]+" });
  const wrong = el("p", { class: "wrong", role: "alert" });
  const progress = el("div", { role: "status" });
  async function make(work, file) {
    wrong.textContent = "";
    try {
      const job = await run({ work: "new", file, of: work }, (j) => progress.replaceChildren(progressOf(j)));
      progress.replaceChildren();
      if (job.state !== "done") throw new Error(why(job));
      await bench.refresh();
      go(`#drive?${new URLSearchParams({ drive: file })}`);
    } catch (error) {
      wrong.textContent = error.message;
    }
  }
  const free = (stem) => {
    const taken = new Set(bench.state.files.map((f) => f.name));
    for (let k = 1; ; k++) {
      const name = k === 1 ? `${stem}.toml` : `${stem}-${k}.toml`;
      if (!taken.has(name)) return name;
    }
  };
  const field = (id, words, value, step) => {
    const input = el("input", { type: "number", id, value, step, min: 0 });
    return [input, el("label", { for: id }, words, input)];
  };
  const [teeth, teethLabel] = field("teeth", "Teeth of the flexspline", "200", 2);
  const [module, moduleLabel] = field("module", "Module, mm", "0.3", "any");
  const files = (pattern, hash, words) => {
    const all = named(pattern).slice(0, 8);
    return all.length
      ? el(
          "div",
          {},
          el("h3", { text: words }),
          el("ul", {}, ...all.map((f) => el("li", {}, el("a", { href: hash(f.name), text: f.name })))),
        )
      : null;
  };
  const asked = (name, key, value) => `#${name}?${new URLSearchParams({ [key]: value })}`;
  view.append(
    el("h1", { text: "What have you got?" }),
    wrong,
    progress,
    el(
      "div",
      { class: "cards" },
      section(
        "start-paper",
        "A drive on paper",
        el("p", { text: "Give teeth and module: you get a complete drive whose teeth clear. Then change any field." }),
        el(
          "div",
          { class: "form" },
          teethLabel,
          moduleLabel,
          button(
            "Draw it",
            () => make({ numbers: { teeth: Number(teeth.value), module_mm: Number(module.value) } }, free("drive")),
            { class: "of-form" },
          ),
        ),
        el("p", {}, el("a", { href: "#drive", text: "Or begin with HHD-95, the drive of the paper" })),
        files(/^[^/]*\.toml$/, (name) => asked("drive", "drive", name), "In this folder"),
      ),
      section(
        "start-catalogue",
        "A drive from a catalogue",
        el("p", {
          text: "Series, size and ratio as Harmonic Drive names them. The data sheet is shown next to what is computed.",
        }),
        el(
          "div",
          { class: "form" },
          el("label", { for: "like" }, "Size", like),
          button(
            "Open it",
            () =>
              make(
                { like: like.value.trim() },
                free(
                  like.value
                    .trim()
                    .toLowerCase()
                    .replace(/[^a-z0-9-]/g, "") || "drive",
                ),
              ),
            { class: "of-form" },
          ),
        ),
      ),
      section(
        "start-log",
        "A log",
        el("p", {
          text: "What a joint or test bench recorded. You get what is wrong with the unit, and its correction table.",
        }),
        dropZone("Drop logs here, or choose them:", (names) =>
          go(`#log?${new URLSearchParams(names.map((n) => ["file", n]))}`),
        ),
        files(/^[^/]*\.(csv|log|txt|tsv|dat)$/i, (name) => asked("log", "file", name), "In this folder"),
      ),
      section(
        "start-table",
        "A table",
        el("p", {
          text: "A table image (.fxt), or samples of another program (.samples.csv). You get its residual on a log, and files for firmware.",
        }),
        dropZone("Drop a table or samples here:", (names) => go(asked("table", "table", names[0]))),
        files(/\.fxt$/, (name) => asked("table", "table", name), "In this folder"),
      ),
    ),
    el("h2", { text: "Results in this folder" }),
    results(),
  );
}

/** What commands wrote, from the bench or a terminal. */
function results() {
  const links = [];
  for (const { name } of named(/(^|\/)(calibration|diagnosis|summary|sweep)\.json$|\.fxt$/).slice(0, 40)) {
    const folder = name.includes("/") ? name.slice(0, name.lastIndexOf("/")) : "";
    const file = name.split("/").at(-1);
    const words = file.endsWith(".fxt")
      ? "a table"
      : {
          "calibration.json": "a calibration",
          "diagnosis.json": "a diagnosis",
          "summary.json": "a run",
          "sweep.json": "a sweep",
        }[file];
    const hash = file.endsWith(".fxt")
      ? `#table?${new URLSearchParams({ table: name })}`
      : file === "calibration.json"
        ? `#certificate?${new URLSearchParams({ of: folder || "." })}`
        : `#result?${new URLSearchParams({ of: folder || "." })}`;
    links.push(el("li", {}, el("a", { href: hash, text: name }), ` ${words}`));
  }
  return links.length ? el("ul", { class: "files" }, ...links) : el("p", { text: "None yet." });
}

/** A result by its report. */
async function result(view, asked) {
  const of = asked.get("of") ?? ".";
  const { wholeReport } = await import("./results.js");
  const whole = wholeReport(of === "." ? "" : of);
  view.append(el("h1", { text: `Result in ${of}` }), whole);
  whole.open = true;
}

const BENCHES = { start, drive: driveBench, log: logBench, table: tableBench, certificate, result };
let leave = () => undefined;
let shown = null;

async function route() {
  const [name, query] = location.hash.slice(1).split(/\?(.*)/s);
  const which = Object.hasOwn(BENCHES, name) ? name : "start";
  const asked = new URLSearchParams(query ?? "");
  // A bench that wrote its state into the address has nothing to do.
  if (shown === location.hash) return;
  shown = location.hash;
  leave();
  complain(null);
  const view = document.getElementById("view");
  view.replaceChildren();
  document.documentElement.dataset.bench = which;
  delete document.documentElement.dataset.ready;
  for (const link of document.querySelectorAll(".controls a")) {
    link.toggleAttribute("aria-current", link.hash === `#${which}`);
  }
  document.getElementById("where").textContent = {
    start: "bench",
    drive: "bench of a drive",
    log: "bench of a log",
    table: "bench of a table",
    certificate: "certificate of a unit",
    result: "a result",
  }[which];
  try {
    leave = (await BENCHES[which](view, asked, bench)) ?? (() => undefined);
  } catch (error) {
    leave = () => undefined;
    complain(error);
  }
  document.documentElement.dataset.ready = which;
}

/** Writes the state of a bench into the address, so that a link shows the same. */
bench.keep = (name, entries, isNew = false) => {
  const hash = `#${name}?${new URLSearchParams(entries)}`;
  if (hash === location.hash) return;
  shown = hash;
  history[isNew ? "pushState" : "replaceState"](null, "", hash);
};
bench.select = select;

async function begin() {
  document.documentElement.classList.add("scripted");
  const units = document.getElementById("units");
  units.addEventListener("change", () => setUnits(units.value));
  setUnits(units.value);
  await bench.refresh();
  document.getElementById("folder").textContent = bench.state.folder;
  let lost = false;
  follow((error) => {
    if (error) complain(`The server does not answer: ${error.message}`);
    else if (lost) complain(null);
    lost = Boolean(error);
  });
  show();
  // Enter in a field does what the button of its form does.
  addEventListener("keydown", (event) => {
    if (event.key === "Enter" && event.target instanceof HTMLInputElement)
      event.target.closest(".form")?.querySelector("button.of-form")?.click();
  });
  addEventListener("hashchange", route);
  addEventListener("popstate", route);
  await route();
}

begin().catch(complain);
