// Curves and points over an axis, drawn by uPlot; each with its data as a table and as CSV.
/* global uPlot */
import { numbers } from "./pack.js";
import { factor, onUnits, titled, unit, written } from "./quantities.js";
import { colour, FONT, onTheme } from "./theme.js";

const LINE_COLOURS = 6;
/** Between the ticks of an axis of whole numbers. */
const WHOLE_STEPS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
/** Rows that the table view shows; the CSV has all. */
const TABLE_ROWS = 200;

/** Told of the generator angle (degrees from the beginning of a pitch) that a reader points at in a linked chart. */
const pointing = new Set();
export function onPointing(listener) {
  pointing.add(listener);
}

/** Linked charts that are on the page. */
const linkedCharts = new Set();
let following = false;

/** Puts the cursor of every linked chart at a generator angle, degrees from the beginning of a pitch. */
export function pointAt(degrees) {
  following = true;
  for (const chart of linkedCharts) {
    const left = chart.valToPos(degrees, "x");
    chart.setCursor({ left, top: chart.bbox.height / devicePixelRatio / 2 }, false);
    chart.root.dataset.cursor = degrees.toFixed(4);
    chart.writeLegend?.();
  }
  following = false;
}

function lineColour(k) {
  return colour(`line-${(k % LINE_COLOURS) + 1}`);
}

/** Vertical space that a plot takes. */
function plotHeight(width) {
  return Math.round(Math.min(360, Math.max(240, 0.45 * width)));
}

/** Named levels across a plot. */
function drawLimits(limits, scaleOf) {
  return (u) => {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.strokeStyle = ctx.fillStyle = colour("bad");
    ctx.lineWidth = devicePixelRatio;
    ctx.font = FONT.replace("12px", `${12 * devicePixelRatio}px`);
    ctx.textAlign = "left";
    ctx.textBaseline = "bottom";
    ctx.setLineDash([2 * devicePixelRatio, 3 * devicePixelRatio]);
    for (const { name, y } of limits) {
      const at = u.valToPos(y * scaleOf(), "y", true);
      if (at < bbox.top || at > bbox.top + bbox.height) continue;
      ctx.beginPath();
      ctx.moveTo(bbox.left, at);
      ctx.lineTo(bbox.left + bbox.width, at);
      ctx.stroke();
      ctx.fillText(name, bbox.left + 6 * devicePixelRatio, at - 2 * devicePixelRatio);
    }
    ctx.restore();
  };
}

/** Named places across a plot, each name a little lower than the one before, so that neighbours can be read. */
function drawUprights(uprights) {
  return (u) => {
    const { ctx, bbox } = u;
    const size = 12 * devicePixelRatio;
    ctx.save();
    ctx.strokeStyle = colour("soft");
    ctx.fillStyle = colour("text");
    ctx.lineWidth = devicePixelRatio;
    ctx.font = FONT.replace("12px", `${size}px`);
    ctx.textAlign = "left";
    ctx.textBaseline = "top";
    ctx.setLineDash([2 * devicePixelRatio, 3 * devicePixelRatio]);
    const ends = [];
    for (const { name, x } of uprights) {
      const at = u.valToPos(x, "x", true);
      if (at < bbox.left - 1 || at > bbox.left + bbox.width + 1) continue;
      ctx.beginPath();
      ctx.moveTo(at, bbox.top);
      ctx.lineTo(at, bbox.top + bbox.height);
      ctx.stroke();
      const width = ctx.measureText(name).width;
      const left = Math.max(bbox.left, Math.min(at + 0.3 * size, bbox.left + bbox.width - width - 0.3 * size));
      // The first row that is free there; with all of them full the line stands without its name.
      let row = 0;
      while (row < ends.length && ends[row] > left) row++;
      if (row > 5) continue;
      ends[row] = left + width + 0.5 * size;
      ctx.fillText(name, left, bbox.top + (0.2 + 1.15 * row) * size);
    }
    ctx.restore();
  };
}

/** Stands for every choice where a figure is the same for all of them. */
export const EVERY = "every";

/** Points of a series with nothing on either side, which no line shows. */
function alone(u, k) {
  const column = u.data[k];
  const there = (at) => column[at] !== null && column[at] !== undefined;
  return Array.from(column.keys()).filter((at) => there(at) && !there(at - 1) && !there(at + 1));
}

/** A chart in `place`; returns { choose(choice) } to show another choice. */
export function lineChart(place, id, spec) {
  const frame = document.createElement("div");
  frame.className = "plot";
  frame.role = "img";
  frame.ariaLabel = `${place.dataset.alt}. Its numbers: the button Table.`;
  place.append(frame);
  let chart = null;
  let choice = null;
  let shown = 0;
  const key = () => (Object.hasOwn(spec.charts, EVERY) ? EVERY : choice);

  async function draw() {
    const mine = ++shown;
    const description = spec.charts[key()];
    place.classList.toggle("empty", !description);
    if (!description) {
      chart?.destroy();
      linkedCharts.delete(chart);
      chart = null;
      frame.textContent = "Nothing to show here for this choice.";
      return;
    }
    const { values, shape } = await numbers(`${key()}/${id}`);
    const width = Math.floor(frame.clientWidth);
    if (mine !== shown || width < 50) return;
    const [columns, rows] = shape;
    const [fx, fy] = [factor(spec.x.quantity), factor(spec.y.quantity)];
    const data = Array.from({ length: columns }, (_, c) =>
      Array.from(values.subarray(c * rows, (c + 1) * rows), (v) => (Number.isNaN(v) ? null : v * (c ? fy : fx))),
    );
    chart?.destroy();
    linkedCharts.delete(chart);
    frame.textContent = "";
    const say = (u, v, quantity, f) => (v === null || v === undefined ? "–" : written(v / f, quantity, 5));
    const axis = (a, size) => ({
      label: titled(a.label, a.quantity),
      stroke: colour("text"),
      font: FONT,
      labelFont: FONT,
      labelSize: 20,
      size,
      grid: { stroke: colour("grid"), width: 1 },
      ticks: { stroke: colour("grid"), width: 1 },
      ...(a.quantity === "whole" ? { incrs: WHOLE_STEPS } : {}),
      values: (u, splits) => splits.map((v) => (v === null ? "" : String(Number(v.toPrecision(4))).replace("-", "−"))),
    });
    const series = description.series.map((s) => {
      const stroke = lineColour(s.colour);
      const points = s.mark === "points" || s.mark === "dots";
      const size = s.mark === "dots" ? 3 : 6;
      return {
        label: s.name,
        stroke,
        width: points ? 0 : 1.75,
        dash: s.mark === "dashed" ? [6, 4] : undefined,
        spanGaps: s.mark !== "broken",
        paths: points ? () => null : undefined,
        points: points
          ? { show: true, size, width: 0, fill: stroke, stroke }
          : { show: s.mark === "broken", size: 5, width: 0, fill: stroke, stroke, filter: alone },
        value: (u, v) => say(u, v, spec.y.quantity, fy),
      };
    });
    const options = {
      width,
      height: plotHeight(width),
      scales: {
        x: {
          time: false,
          ...(spec.x.stretched ? { distr: 4, asinh: spec.x.stretched, range: (u, low, high) => [low, high] } : {}),
        },
        y: {
          ...(spec.y.stretched ? { distr: 4, asinh: spec.y.stretched * fy } : {}),
          range: (u, low, high) => {
            const levels = (description.limits ?? []).map((l) => l.y * fy);
            return uPlot.rangeNum(Math.min(low, ...levels), Math.max(high, ...levels), 0.08, true);
          },
        },
      },
      axes: [
        axis(spec.x, 44),
        // As wide as the longest number wants.
        axis(spec.y, (u, texts) => Math.max(48, 20 + 7 * Math.max(0, ...(texts ?? []).map((t) => t.length)))),
      ],
      series: [{ label: spec.x.label, value: (u, v) => say(u, v, spec.x.quantity, fx) }, ...series],
      legend: {
        live: true,
        // A line is solid or dashed as it is drawn; what has points alone is filled.
        markers: {
          width: 3,
          stroke: (u, k) => series[k - 1]?.stroke,
          dash: (u, k) => (series[k - 1]?.dash ? "dashed" : series[k - 1]?.paths ? "dotted" : "solid"),
          fill: (u, k) =>
            series[k - 1]?.paths && series[k - 1].points.size > 3 ? series[k - 1].stroke : "transparent",
        },
      },
      cursor: { drag: { x: true, y: true, uni: 20 }, focus: { prox: 24 } },
      hooks: {
        draw: [
          drawLimits(description.limits ?? [], () => factor(spec.y.quantity)),
          drawUprights(description.uprights ?? []),
        ],
        setCursor: [],
      },
    };
    if (spec.x.linked) {
      options.hooks.setCursor.push((u) => {
        const { left } = u.cursor;
        if (following || left === null || left < 0) return;
        const degrees = u.posToVal(left, "x");
        for (const listener of pointing) listener(degrees);
      });
    }
    chart = new uPlot(options, data, frame);
    chart.root.setAttribute("aria-hidden", "true");
    if (spec.x.linked) linkedCharts.add(chart);
    place.dataset.drawn = choice;
  }

  addTools(place, id, spec, async () => {
    const description = spec.charts[key()];
    const { values, shape } = await numbers(`${key()}/${id}`);
    const [columns, rows] = shape;
    const names = [spec.x.label, ...description.series.map((s) => s.name)];
    const quantities = [spec.x.quantity, ...description.series.map(() => spec.y.quantity)];
    const at = (row, c) => values[c * rows + row];
    return { names, quantities, rows, columns, at };
  });
  const again = () => choice !== null && draw();
  onUnits(again);
  onTheme(again);
  watchWidth(frame, again);
  return {
    choose(next) {
      choice = next;
      place.refreshTable?.();
      return draw();
    },
  };
}

/** Calls `listener` when the width of an element changes, as it does when a section opens or a phone turns. */
export function watchWidth(element, listener) {
  let width = element.clientWidth;
  new ResizeObserver(() => {
    if (element.clientWidth === width) return;
    width = element.clientWidth;
    listener();
  }).observe(element);
}

/** "CSV" and "Table" beside the caption. `get` gives the data as columns. */
export function addTools(place, id, spec, get) {
  const tools = place.closest("figure").querySelector(".tools");
  const csv = document.createElement("button");
  csv.type = "button";
  csv.textContent = "CSV";
  csv.setAttribute("aria-label", `Numbers of figure ${spec.number} as CSV`);
  csv.addEventListener("click", async () => save(`${id}.csv`, asCsv(await get())));
  const show = document.createElement("button");
  show.type = "button";
  show.textContent = "Table";
  show.setAttribute("aria-label", `Numbers of figure ${spec.number} as a table`);
  show.setAttribute("aria-expanded", "false");
  const box = document.createElement("div");
  box.className = "table numbers";
  box.tabIndex = 0;
  box.role = "region";
  box.ariaLabel = `Numbers of figure ${spec.number}`;
  box.hidden = true;
  place.closest("figure").append(box);
  place.refreshTable = async () => {
    if (!box.hidden) box.replaceChildren(asTable(await get()));
  };
  show.addEventListener("click", () => {
    box.hidden = !box.hidden;
    show.setAttribute("aria-expanded", String(!box.hidden));
    place.refreshTable();
  });
  onUnits(() => place.refreshTable());
  tools.append(" ", csv, " ", show);
}

function heading(name, quantity) {
  const u = unit(quantity);
  return u ? `${name}, ${u}` : name;
}

function asCsv({ names, quantities, rows, columns, at }) {
  const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const lines = [names.map((n, c) => quoted(heading(n, quantities[c]))).join(",")];
  for (let row = 0; row < rows; row++) {
    const cells = Array.from({ length: columns }, (_, c) => {
      const v = at(row, c);
      return Number.isNaN(v) ? "" : String(Number((v * factor(quantities[c])).toPrecision(7)));
    });
    lines.push(cells.join(","));
  }
  return lines.join("\r\n") + "\r\n";
}

function asTable({ names, quantities, rows, columns, at }) {
  const table = document.createElement("table");
  const head = table.createTHead().insertRow();
  names.forEach((name, c) => {
    const cell = document.createElement("th");
    cell.scope = "col";
    cell.textContent = heading(name, quantities[c]);
    head.append(cell);
  });
  const body = table.createTBody();
  for (let row = 0; row < Math.min(rows, TABLE_ROWS); row++) {
    const line = body.insertRow();
    for (let c = 0; c < columns; c++) line.insertCell().textContent = written(at(row, c), quantities[c], 5, false);
  }
  if (rows > TABLE_ROWS) {
    const cell = body.insertRow().insertCell();
    cell.colSpan = columns;
    cell.textContent = `… ${rows - TABLE_ROWS} more rows in the CSV`;
  }
  return table;
}

/** Hands a file to the reader. */
function save(name, text) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
