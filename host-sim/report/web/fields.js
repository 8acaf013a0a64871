// A field over two axes in colour, with a readout under the pointer.
import { addTools, watchWidth } from "./charts.js";
import { numbers } from "./pack.js";
import { factor, onUnits, titled, written } from "./quantities.js";
import { colour, css, diverging, FONT, onTheme, viridis } from "./theme.js";

const MARGIN = { left: 70, right: 96, top: 10, bottom: 42 };

/** Edges of the cells around nodes: half way between them, and as far beyond the ends. */
function edges(nodes) {
  const middle = nodes.slice(1).map((x, k) => 0.5 * (x + nodes[k]));
  const first = nodes[0] - (middle[0] - nodes[0]);
  const last = nodes.at(-1) + (nodes.at(-1) - middle.at(-1));
  return [first, ...middle, last];
}

/** Round numbers within a range, at most so many. */
function ticks(low, high, most) {
  const raw = (high - low) / most;
  const ten = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * ten).find((s) => s >= raw);
  const all = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) all.push(k * step);
  return all;
}

/** Which of the values a scale ends before: the lowest, the highest, both or none. */
function clippedWords([below, above]) {
  return [below && "lowest", above && "highest"].filter(Boolean).join(" and the ");
}

/** A field in `place`. */
export function fieldMap(place, id, spec) {
  const canvas = document.createElement("canvas");
  canvas.className = "field";
  canvas.role = "img";
  canvas.ariaLabel = place.dataset.alt;
  const readout = document.createElement("p");
  readout.className = "readout";
  place.append(canvas, readout);
  let choice = null;
  let field = null;
  let note = "";

  function draw() {
    const width = Math.floor(place.clientWidth);
    if (!field || width < 100) return;
    const height = Math.round(Math.min(360, Math.max(240, 0.45 * width)));
    const ratio = devicePixelRatio;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    canvas.style.width = `${width}px`;
    canvas.style.height = `${height}px`;
    const ctx = canvas.getContext("2d");
    ctx.scale(ratio, ratio);
    ctx.font = FONT;
    const [w, h] = [width - MARGIN.left - MARGIN.right, height - MARGIN.top - MARGIN.bottom];
    const { x, y, z, low, high, clipped } = field;
    const coloured = low === -high ? diverging : viridis;
    // Rows are equally high: torque nodes crowd near zero, where most happens.
    const ex = edges(x);
    const px = (v) => MARGIN.left + ((v - ex[0]) / (ex.at(-1) - ex[0])) * w;
    const py = (row) => MARGIN.top + h - (row / y.length) * h;
    for (let row = 0; row < y.length; row++)
      for (let c = 0; c < x.length; c++) {
        const value = z[row * x.length + c];
        if (Number.isNaN(value)) continue;
        ctx.fillStyle = css(coloured((value - low) / (high - low)));
        const [left, right] = [px(ex[c]), px(ex[c + 1])];
        ctx.fillRect(left, py(row + 1), right - left + 0.5, h / y.length + 0.5);
      }
    ctx.fillStyle = colour("text");
    ctx.textAlign = "center";
    for (const t of ticks(ex[0], ex.at(-1), 6)) {
      ctx.fillText(String(Number(t.toPrecision(6))), px(t), MARGIN.top + h + 16);
    }
    ctx.fillText(titled(spec.x.label, spec.x.quantity), MARGIN.left + w / 2, MARGIN.top + h + 34);
    ctx.textAlign = "right";
    const level = (v) => String(Number(v.toPrecision(2))).replace("-", "−");
    const every = Math.ceil(y.length / (h / 18));
    for (let row = 0; row < y.length; row += every) {
      ctx.fillText(level(y[row]), MARGIN.left - 6, py(row + 0.5) + 4);
    }
    ctx.save();
    ctx.translate(13, MARGIN.top + h / 2);
    ctx.rotate(-Math.PI / 2);
    ctx.textAlign = "center";
    ctx.fillText(titled(spec.y.label, spec.y.quantity), 0, 0);
    ctx.restore();
    const bar = MARGIN.left + w + 14;
    for (let k = 0; k < h; k++) {
      ctx.fillStyle = css(coloured(1 - k / h));
      ctx.fillRect(bar, MARGIN.top + k, 12, 1.5);
    }
    ctx.fillStyle = colour("text");
    ctx.textAlign = "left";
    for (const share of [0, 0.5, 1]) {
      const value = low + share * (high - low);
      // The middle of a symmetric scale is zero but for rounding.
      const text = written(Math.abs(value) < 1e-6 * (high - low) ? 0 : value, spec.z.quantity, 3, false);
      const beyond = share === 0 && clipped[0] ? "≤ " : share === 1 && clipped[1] ? "≥ " : "";
      ctx.fillText(beyond + text, bar + 16, MARGIN.top + h * (1 - share) + (share === 1 ? 10 : share === 0 ? 0 : 4));
    }
    readout.textContent = `Colour: ${titled(spec.z.label, spec.z.quantity)}. Point at the map to read it.${note}`;
    place.dataset.drawn = choice;
  }

  canvas.addEventListener("pointermove", (event) => {
    if (!field) return;
    const box = canvas.getBoundingClientRect();
    const { x, y, z } = field;
    const ex = edges(x);
    const sx = (event.clientX - box.left - MARGIN.left) / (box.width - MARGIN.left - MARGIN.right);
    const sy = 1 - (event.clientY - box.top - MARGIN.top) / (box.height - MARGIN.top - MARGIN.bottom);
    if (sx < 0 || sx >= 1 || sy < 0 || sy >= 1) return;
    const at = ex[0] + sx * (ex.at(-1) - ex[0]);
    const c = Math.max(0, ex.findIndex((edge) => edge > at) - 1);
    const row = Math.floor(sy * y.length);
    const value = written(z[row * x.length + c], spec.z.quantity, 4);
    readout.textContent = `${spec.x.label} ${written(x[c], spec.x.quantity, 4)}, ${spec.y.label} ${written(y[row], spec.y.quantity, 4)}: ${value}`;
  });

  addTools(place, id, spec, async () => {
    const { x, y, z } = field;
    const names = [spec.y.label, spec.x.label, spec.z.label];
    const quantities = [spec.y.quantity, spec.x.quantity, spec.z.quantity];
    const at = (k, c) => [y[Math.floor(k / x.length)], x[k % x.length], z[k]][c];
    return { names, quantities, rows: z.length, columns: 3, at };
  });
  onUnits(draw);
  onTheme(draw);
  watchWidth(place, draw);
  return {
    async choose(next) {
      choice = next;
      if (!spec.charts.includes(next)) {
        field = null;
        canvas.hidden = true;
        readout.textContent = "Nothing to show here for this choice.";
        return;
      }
      canvas.hidden = false;
      const part = async (name) => Array.from((await numbers(`${next}/${id}/${name}`)).values);
      const [x, y, z] = await Promise.all(["x", "y", "z"].map(part));
      if (choice !== next) return;
      // A few cells that stand out do not take the colours of all others.
      const there = z.filter((v) => !Number.isNaN(v)).sort((a, b) => a - b);
      const beside = Math.floor(0.004 * there.length);
      let [low, high] = [there[beside], there[there.length - 1 - beside]];
      // What has a sign is as far from zero either way.
      if (low < 0 && high > 0) [low, high] = [-Math.max(-low, high), Math.max(-low, high)];
      if (high - low < 1e-12) high = low + 1;
      field = { x, y, z, low, high, clipped: [there[0] < low, there.at(-1) > high] };
      const ends = clippedWords(field.clipped);
      note = ends && ` The colours end before the ${ends}.`;
      draw();
      place.refreshTable?.();
    },
  };
}
