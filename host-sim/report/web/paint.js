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
    this.colourEnd = motion.description.colour_end_mpa;
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
    const level = BUCKETS / (4 * this.colourEnd);
    const add = (xa, ya, xb, yb, xc, yc, xd, yd, sum) => {
      const path = fills[Math.min(BUCKETS - 1, Math.floor(sum * level))];
      path.moveTo(xa, ya);
      path.lineTo(xb, yb);
      path.lineTo(xc, yc);
      path.lineTo(xd, yd);
    };
    for (let sector = first; sector < first + count; sector++) {
      this.place(wheel, view, sector, frames / wheel.frames, turn, exaggeration, fine, x, y, stress);
      for (let e = 0; e < elements.length; e += 8) {
        const n = elements.subarray(e, e + 8);
        if (!fine) {
          const [a, b, c, d] = n;
          const sum = stress[a] + stress[b] + stress[c] + stress[d];
          add(x[a], y[a], x[b], y[b], x[c], y[c], x[d], y[d], sum);
          continue;
        }
        // In quarters about the middle, which the shape functions of the element give.
        const middle = (v) =>
          0.5 * (v[n[4]] + v[n[5]] + v[n[6]] + v[n[7]]) - 0.25 * (v[n[0]] + v[n[1]] + v[n[2]] + v[n[3]]);
        const [mx, my, ms] = [middle(x), middle(y), Math.max(0, middle(stress))];
        for (let k = 0; k < 4; k++) {
          const [a, b, d] = [n[k], n[4 + k], n[4 + ((k + 3) % 4)]];
          add(x[a], y[a], x[b], y[b], mx, my, x[d], y[d], stress[a] + stress[b] + ms + stress[d]);
        }
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

/** A point of the page's frame in pixels of a view. */
export function toScreen(view, point) {
  const [x, y] = rotated(point, -view.turn);
  return [
    view.left + view.width / 2 + (x - view.centre[0]) * view.scale,
    view.top + view.height / 2 - (y - view.centre[1]) * view.scale,
  ];
}
