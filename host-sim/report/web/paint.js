// Both wheels in colour, on a canvas.
import { rotated } from "./motion.js";
import { css, strained } from "./theme.js";

/** Colours that elements are sorted into. */
const BUCKETS = 40;

export class Painter {
  constructor(canvas) {
    this.context = canvas.getContext("2d");
    this.recolour();
  }

  /** Takes the colours of the theme. */
  recolour() {
    this.coloured = strained();
  }

  load(motion) {
    this.colourEnd = motion.description.peak_mpa;
    this.used = new Map();
  }

  /** Clears all, or one view alone. */
  begin(width, height, view) {
    const { left, top } = view ?? { left: 0, top: 0 };
    this.context.clearRect(left, top, view?.width ?? width, view?.height ?? height);
  }

  wheel(wheel, view, { first, count, frames, turn, exaggeration, fine, alpha, lines, mesh }) {
    const ctx = this.context;
    const fills = Array.from({ length: BUCKETS }, () => new Path2D());
    const edges = new Path2D();
    const { nodeCount, elements, outline } = wheel;
    // Places and stresses of a sector and of its neighbour, by index as in `elements`.
    const [x, y, stress] = [0, 1, 2].map(() => new Float32Array(2 * nodeCount));
    const level = BUCKETS / this.colourEnd;
    // Plain loops here: this runs for each element of each frame.
    const fill = (k) => fills[Math.min(BUCKETS - 1, Math.max(0, k))];
    const add = (k, polygon) => {
      if (!polygon.length) return;
      const path = fill(k);
      path.moveTo(polygon[0][0], polygon[0][1]);
      for (let place = 1; place < polygon.length; place++) path.lineTo(polygon[place][0], polygon[place][1]);
    };
    /** A triangle in bands of one colour: stress is linear within it. */
    const shade = (corners) => {
      const [a, b, c] = [corners[0][2], corners[1][2], corners[2][2]];
      const [low, high] = [Math.floor(Math.min(a, b, c)), Math.floor(Math.max(a, b, c))];
      for (let k = low; k <= high; k++) {
        const above = k > low ? cut(corners, k, 1) : corners;
        add(k, k < high ? cut(above, k + 1, -1) : above);
      }
    };
    for (let sector = first; sector < first + count; sector++) {
      this.place(wheel, view, sector, frames / wheel.frames, turn, exaggeration, fine, x, y, stress);
      for (let e = 0; e < elements.length; e += 8) {
        const n = elements.subarray(e, e + 8);
        if (!fine) {
          const [a, b, c, d] = [n[0], n[1], n[2], n[3]];
          const path = fill(Math.floor(0.25 * level * (stress[a] + stress[b] + stress[c] + stress[d])));
          path.moveTo(x[a], y[a]);
          path.lineTo(x[b], y[b]);
          path.lineTo(x[c], y[c]);
          path.lineTo(x[d], y[d]);
          continue;
        }
        // In triangles about the middle, which the shape functions of the element give.
        const middle = (v) =>
          0.5 * (v[n[4]] + v[n[5]] + v[n[6]] + v[n[7]]) - 0.25 * (v[n[0]] + v[n[1]] + v[n[2]] + v[n[3]]);
        const centre = [middle(x), middle(y), level * middle(stress)];
        const around = [0, 4, 1, 5, 2, 6, 3, 7].map((k) => [x[n[k]], y[n[k]], level * stress[n[k]]]);
        around.forEach((point, k) => shade([centre, point, around[(k + 1) % 8]]));
      }
      if (!lines) continue;
      for (let e = 0; e < outline.length; e += 3) {
        edges.moveTo(x[outline[e]], y[outline[e]]);
        edges.lineTo(x[outline[e + 1]], y[outline[e + 1]]);
        edges.lineTo(x[outline[e + 2]], y[outline[e + 2]]);
      }
    }
    ctx.save();
    ctx.beginPath();
    ctx.rect(view.left, view.top, view.width, view.height);
    ctx.clip();
    ctx.globalAlpha = alpha;
    fills.forEach((path, k) => {
      ctx.fillStyle = ctx.strokeStyle = css(this.coloured((k + 0.5) / BUCKETS));
      ctx.fill(path);
      // Without this the seams between elements shine through; in the small view nobody sees them.
      ctx.lineWidth = mesh ? 0.2 : 0.6;
      if (lines) ctx.stroke(path);
    });
    if (lines) {
      ctx.strokeStyle = lines;
      ctx.lineWidth = 1;
      ctx.stroke(edges);
    }
    ctx.restore();
  }

  /** Which nodes are drawn, by index as in `elements`. */
  nodes(wheel, fine) {
    const key = fine ? "fine" : "coarse";
    if (!this.used.has(wheel)) this.used.set(wheel, {});
    const kept = this.used.get(wheel);
    kept[key] ??= Uint16Array.from(new Set(wheel.elements.filter((_, k) => fine || k % 8 < 4)));
    return kept[key];
  }

  /** Nodes of a sector on the screen, and their stress: all, or the corners of its elements. */
  place(wheel, view, sector, pitches, turn, exaggeration, fine, x, y, stress) {
    const { nodes, nodeCount, samples, displacement } = wheel;
    const [left, top] = [view.left + view.width / 2, view.top + view.height / 2];
    for (const beside of [0, 1]) {
      const [a, b, t] = wheel.between(sector + beside, pitches);
      const angle = (sector + beside) * wheel.pitch + turn - view.turn;
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      for (const index of this.nodes(wheel, fine)) {
        if (index >= nodeCount !== (beside === 1)) continue;
        const node = index - beside * nodeCount;
        const [row, next] = [2 * node * samples, (2 * node + 1) * samples];
        const dx = displacement[row + a] + t * (displacement[row + b] - displacement[row + a]);
        const dy = displacement[next + a] + t * (displacement[next + b] - displacement[next + a]);
        const [px, py] = [nodes[2 * node] + exaggeration * dx, nodes[2 * node + 1] + exaggeration * dy];
        x[index] = left + (c * px - s * py - view.centre[0]) * view.scale;
        y[index] = top - (s * px + c * py - view.centre[1]) * view.scale;
        const from = wheel.stress[node * samples + a];
        stress[index] = from + t * (wheel.stress[node * samples + b] - from);
      }
    }
  }
}

/** What of a polygon has values of at least `level`, or with `sign` −1 of at most that. */
function cut(polygon, level, sign) {
  const kept = [];
  polygon.forEach((point, k) => {
    const next = polygon[(k + 1) % polygon.length];
    const [here, there] = [sign * (point[2] - level), sign * (next[2] - level)];
    if (here >= 0) kept.push(point);
    if (here * there < 0) kept.push(point.map((value, of) => value + (here / (here - there)) * (next[of] - value)));
  });
  return kept;
}

/** A point of the page's frame in pixels of a view. */
export function toScreen(view, point) {
  const [x, y] = rotated(point, -view.turn);
  return [
    view.left + view.width / 2 + (x - view.centre[0]) * view.scale,
    view.top + view.height / 2 - (y - view.centre[1]) * view.scale,
  ];
}
