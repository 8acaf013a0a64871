// Where everything stands at any generator angle: the other half of report/animation.rs.
//
// Sector j of either wheel at generator angle psi is at sample frames * (j - psi / pitch), whatever the turn.
import { numbers } from "./pack.js";

const ARCSEC = Math.PI / 648000;

/** Remainder that is never negative. */
export function modulo(x, n) {
  return x - n * Math.floor(x / n);
}

/** A wheel: undeformed first sector, and the course of displacement and stress over a wave. */
class Wheel {
  constructor(description, arrays, frames) {
    this.sectors = description.sectors;
    this.samples = description.samples;
    this.pitch = (2 * Math.PI) / this.sectors;
    this.frames = frames;
    this.nodes = arrays.nodes;
    this.nodeCount = arrays.nodes.length / 2;
    /** Node + nodeCount * (0 or 1: this sector or the next), eight to an element, corners first. */
    this.elements = arrays.elements.map(Math.round);
    this.outline = arrays.outline.map(Math.round);
    this.displacement = arrays.displacement;
    this.stress = arrays.stress;
  }

  /** The two samples between which a sector is, and how far along. */
  between(sector, count) {
    const s = modulo(this.frames * (sector - count), this.samples);
    const first = Math.floor(s) % this.samples;
    return [first, (first + 1) % this.samples, s - Math.floor(s)];
  }

  /** Displacement of a node of a sector in the frame of the sector, mm. */
  displaced(sector, node, count) {
    const [a, b, t] = this.between(sector, count);
    const x = 2 * node * this.samples;
    const y = x + this.samples;
    const d = this.displacement;
    return [d[x + a] + t * (d[x + b] - d[x + a]), d[y + a] + t * (d[y + b] - d[y + a])];
  }

  /** Position of a node, given as in `elements`, in the frame of the page. */
  position(sector, index, count, exaggeration, turn) {
    const node = index % this.nodeCount;
    const own = sector + (index >= this.nodeCount ? 1 : 0);
    const [dx, dy] = this.displaced(own, node, count);
    const x = this.nodes[2 * node] + exaggeration * dx;
    const y = this.nodes[2 * node + 1] + exaggeration * dy;
    return rotated([x, y], own * this.pitch + turn);
  }
}

export function rotated([x, y], angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return [c * x - s * y, s * x + c * y];
}

/** The drive with one generator. */
export class Motion {
  constructor(choice, description, arrays) {
    this.choice = choice;
    this.description = description;
    this.frames = description.frames;
    this.flexspline = new Wheel(description.flexspline, arrays.flexspline, this.frames);
    this.circularSpline = new Wheel(description.circular_spline, arrays.circularSpline, this.frames);
    this.pitch = this.flexspline.pitch;
    this.generator = arrays.generator;
    this.forces = arrays.forces;
    this.boreNode = this.nearest(description.bore_radius_mm, 0);
    this.largestForce = this.findLargestForce();
    let [reach, least] = [0, Infinity];
    for (let k = 0; k < this.circularSpline.nodeCount; k++) {
      const r = Math.hypot(this.circularSpline.nodes[2 * k], this.circularSpline.nodes[2 * k + 1]);
      reach = Math.max(reach, r);
      least = Math.min(least, r);
    }
    this.reach = reach;
    this.tipRadius = least;
  }

  /** Pitches that the generator has turned. */
  count(psi) {
    return psi / this.pitch;
  }

  /** Error of the output, arcsec. */
  error(psi) {
    const e = this.description.error_arcsec;
    const s = modulo(this.frames * this.count(psi), this.frames);
    const k = Math.floor(s) % this.frames;
    return e[k] + (s - Math.floor(s)) * (e[(k + 1) % this.frames] - e[k]);
  }

  /** Output angle, rad. */
  output(psi) {
    return psi / this.description.ratio + this.error(psi) * ARCSEC;
  }

  nearest(x, y) {
    let [best, distance] = [0, Infinity];
    const { nodes, nodeCount } = this.flexspline;
    for (let k = 0; k < nodeCount; k++) {
      const d = Math.hypot(nodes[2 * k] - x, nodes[2 * k + 1] - y);
      if (d < distance) [best, distance] = [k, d];
    }
    return best;
  }

  force(row, sample) {
    return this.forces[row * this.flexspline.samples + sample];
  }

  findLargestForce() {
    let largest = 0;
    for (let s = 0; s < this.flexspline.samples; s++)
      for (const row of [0, 4, 8]) largest = Math.max(largest, Math.hypot(this.force(row, s), this.force(row + 1, s)));
    return largest;
  }

  /** Forces on the tooth of a sector: { kind, force (N), point (mm) }, in the frame of the page. */
  forcesOn(sector, count, exaggeration) {
    const wheel = this.flexspline;
    const [a, b, t] = wheel.between(sector, count);
    const angle = sector * wheel.pitch;
    const all = [];
    const mix = (row) => this.force(row, a) + t * (this.force(row, b) - this.force(row, a));
    const shift = wheel.displaced(sector, this.boreNode, count).map((d) => (exaggeration - 1) * d);
    for (const row of [0, 4]) {
      const weights = [a, b].map((s, k) => (k ? t : 1 - t) * Math.hypot(this.force(row, s), this.force(row + 1, s)));
      const total = weights[0] + weights[1];
      if (total < 0.004 * this.largestForce) continue;
      const at = (r) => (weights[0] * this.force(r, a) + weights[1] * this.force(r, b)) / total;
      const point = [at(row + 2) + shift[0], at(row + 3) + shift[1]];
      all.push({ kind: "flank", force: rotated([mix(row), mix(row + 1)], angle), point: rotated(point, angle) });
    }
    const bore = [mix(8), mix(9)];
    if (Math.hypot(...bore) > 0.004 * this.largestForce) {
      const point = wheel.position(sector, this.boreNode, count, exaggeration, 0);
      all.push({ kind: "bore", force: rotated(bore, angle), point });
    }
    return all;
  }

  /** A point of the generator; where displacements are exaggerated it moves with the bore, the more the nearer it is. */
  generatorPoint([x, y], psi, exaggeration) {
    const [gx, gy] = rotated([x, y], psi);
    if (exaggeration === 1) return [gx, gy];
    const angle = Math.atan2(gy, gx);
    const sector = angle / this.pitch;
    const [dx, dy] = this.flexspline.displaced(sector, this.boreNode, this.count(psi));
    const weight = (Math.hypot(gx, gy) / this.description.bore_radius_mm) ** 6 * (exaggeration - 1);
    const [mx, my] = rotated([dx * weight, dy * weight], angle);
    return [gx + mx, gy + my];
  }
}

const motions = new Map();

/** The drive with the generator of this name, inflated when first asked for. */
export function motion(choice, description) {
  if (!motions.has(choice)) motions.set(choice, load(choice, description));
  return motions.get(choice);
}

async function load(choice, description) {
  const values = async (name) => (await numbers(`${choice}.${name}`)).values;
  const wheel = async (name) => {
    const parts = ["nodes", "elements", "outline", "displacement", "stress"];
    const arrays = await Promise.all(parts.map((part) => values(`${name}.${part}`)));
    return Object.fromEntries(parts.map((part, k) => [part, arrays[k]]));
  };
  const [flexspline, circularSpline, outline, forces] = await Promise.all([
    wheel("flexspline"),
    wheel("circular-spline"),
    numbers(`${choice}.generator`),
    values("forces"),
  ]);
  const [curves, points] = outline.shape;
  const generator = Array.from({ length: curves }, (_, c) =>
    Array.from({ length: points }, (_, k) => [
      ...outline.values.subarray(2 * (c * points + k), 2 * (c * points + k) + 2),
    ]),
  );
  return new Motion(choice, description, { flexspline, circularSpline, generator, forces });
}
