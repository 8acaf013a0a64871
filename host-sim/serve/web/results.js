// Results as commands wrote them: the figures of a report in the page, tables of numbers, files to download.
import { fileText } from "./api.js";
import { lineChart } from "./charts.js";
import { driveViewer } from "./drive.js";
import { el } from "./elements.js";
import { provide, unpack } from "./pack.js";

/** A report that a command wrote: its JSON, and its packed numbers by name. Nothing else of it comes into this page. */
export async function readReport(name) {
  // Its style sheet is of no use here, and this page's policy would complain of it.
  const text = (await fileText(name)).replace(/<style>[\s\S]*?<\/style>/g, "");
  const parsed = new DOMParser().parseFromString(text, "text/html");
  const json = JSON.parse(parsed.getElementById("flexspline-report").textContent);
  const packed = new Map();
  for (const element of parsed.querySelectorAll("script.packed")) {
    const { name: of, kind, scale, offset, shape } = element.dataset;
    packed.set(of, { kind, scale: Number(scale), offset: Number(offset), shape, text: element.textContent });
  }
  return { name, json, packed };
}

async function unpacked({ shape, ...packed }) {
  return { values: await unpack(packed), shape: shape.split(",").map(Number) };
}

/** Numbers of a report under names of this page. */
function hand(report, from, to) {
  for (const [name, packed] of report.packed) {
    if (name === from || name.startsWith(`${from}/`) || name.startsWith(`${from}.`)) {
      provide(to + name.slice(from.length), unpacked(packed));
    }
  }
}

/** A numbered frame for a figure. */
function frame(id, title, alt, words) {
  const drawing = el("div", { class: "drawing", "data-figure": id, "data-alt": alt });
  const strong = el("strong", { text: title });
  const caption = el(
    "figcaption",
    {},
    strong,
    " ",
    el("span", { class: "words", text: words ?? "" }),
    el("span", { class: "tools" }),
  );
  return { figure: el("figure", { id }, drawing, caption), drawing, strong };
}

let numbered = 0;

/** A chart that is made once and shows one set of data after another. */
export function liveChart(id, title, alt, words) {
  const { figure, drawing, strong } = frame(id, title, alt, words);
  const chart = {
    number: ++numbered,
    kind: "lines",
    title,
    x: { label: "", quantity: "count" },
    y: { label: "", quantity: "count" },
    charts: {},
  };
  let view = null;
  let turn = 0;
  const put = (x, y, description, numbers) => {
    // The name before is not needed any more: what it holds is let go with it.
    const key = `${id}-${++turn % 2}`;
    Object.assign(chart, { x, y, charts: { [key]: description } });
    provide(`${key}/${id}`, numbers);
    view ??= lineChart(drawing, id, chart);
    return view.choose(key);
  };
  return {
    figure,
    title: (text) => (strong.textContent = text),
    /** Columns: x, then one for each series; NaN where there is nothing. */
    columns(x, y, series, columns, more = {}) {
      const rows = columns[0].length;
      const values = new Float32Array(columns.length * rows);
      columns.forEach((column, c) => values.set(column, c * rows));
      return put(x, y, { series, ...more }, Promise.resolve({ values, shape: [columns.length, rows] }));
    },
    /** The first line of the same figure of two reports, over one another: each at its own places. */
    async pair(a, b, names, of, figureName, ...choices) {
      const both = await Promise.all([a, b].map((report) => firstLine(report, figureName, choices)));
      figure.hidden = both.some((one) => !one);
      if (figure.hidden) return undefined;
      // A chart has its places in order.
      const rows = both.flatMap(({ x, y }, k) => Array.from(x, (at, j) => (k ? [at, NaN, y[j]] : [at, y[j], NaN])));
      rows.sort((one, other) => one[0] - other[0]);
      const series = both.map((one, k) => ({ ...one.line, name: names[of[k]], colour: k }));
      const { x, y } = both[0].spec;
      return this.columns(
        x,
        y,
        series,
        [0, 1, 2].map((column) => rows.map((row) => row[column])),
      );
    },
    /** A figure of lines of a report, as the first of these choices that it has shows it; hidden if there is none. */
    async of(report, name, ...choices) {
      const spec = report.json.figures[name];
      const key = choices.find((choice) => Object.hasOwn(spec?.charts ?? {}, choice));
      const numbers = key && report.packed.get(`${key}/${name}`);
      figure.hidden = !numbers || numbers.shape.endsWith(",0");
      if (figure.hidden) return undefined;
      return put(spec.x, spec.y, spec.charts[key], unpacked(numbers));
    },
  };
}

/** The first line of a figure of a report, as columns x and y, with its axes; nothing if it has none of these choices. */
async function firstLine(report, name, choices) {
  const spec = report.json.figures[name];
  const key = choices.find((choice) => Object.hasOwn(spec?.charts ?? {}, choice));
  const packed = key && report.packed.get(`${key}/${name}`);
  if (!packed) return null;
  const { values, shape } = await unpacked(packed);
  return {
    spec,
    line: spec.charts[key].series[0],
    x: values.slice(0, shape[1]),
    y: values.slice(shape[1], 2 * shape[1]),
  };
}

/** The drive in motion with its stress, made once; shows one report after another. */
export function liveDrive(id, title) {
  const { figure, drawing } = frame(id, title, "Both wheels to scale with their stress, generator and forces", "");
  const animations = {};
  let view = null;
  let turn = 0;
  return {
    figure,
    async of(report) {
      const choice = Object.keys(report.json.animations)[0];
      if (!choice) return;
      const key = `${id}-${++turn % 2}`;
      hand(report, choice, key);
      for (const name of Object.keys(animations)) delete animations[name];
      animations[key] = report.json.animations[choice];
      view ??= driveViewer(drawing, animations);
      await view.choose(key);
    },
  };
}

/** Files of a job to download, in words. */
export function downloads(out, files) {
  const link = ([name, words]) =>
    el(
      "li",
      {},
      el("a", { href: `/files/${out}/${name}?download`, download: name.split("/").at(-1), text: name }),
      ` ${words}`,
    );
  return el("ul", { class: "files" }, ...files.map(link));
}

/** The whole page that a command wrote, in a frame without rights, once it is asked for. */
export function wholeReport(out, name = "report.html") {
  const details = el("details", { class: "whole" }, el("summary", { text: "The whole report of the command" }));
  const address = `/files/${out}/${name}?page`;
  details.addEventListener("toggle", () => {
    if (!details.open || details.querySelector("iframe")) return;
    details.append(
      el("p", {}, el("a", { href: address, target: "_blank", rel: "noopener", text: "in a window of its own" })),
      el("iframe", { src: address, title: `Report of ${out}`, sandbox: "allow-scripts allow-downloads allow-modals" }),
    );
  });
  return details;
}

/** A CSV with names, as columns of numbers. */
export function csvColumns(text) {
  const [head, ...rows] = text
    .trim()
    .split(/\r?\n/)
    .filter((line) => !line.startsWith("#"));
  const names = head.split(",");
  const columns = Object.fromEntries(names.map((name) => [name, []]));
  for (const row of rows)
    row.split(",").forEach((cell, k) => columns[names[k]]?.push(cell === "" ? NaN : Number(cell)));
  return columns;
}
