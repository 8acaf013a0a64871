// Rigid teeth on the wave, to scale, while a slider moves: the whole drive, and the teeth at the major axis.
import { watchWidth } from "./charts.js";
import { el } from "./elements.js";
import { rotated } from "./motion.js";
import { colour, FONT, onTheme } from "./theme.js";

/** Teeth across the close view. */
const TEETH_SEEN = 9;

/** The material at an angle around the neutral layer: [x, y, direction of the normal], between two stations. */
function station(wave, angle) {
  const place = (((angle / (2 * Math.PI)) % 1) + 1) % 1;
  const at = place * wave.length;
  const k = Math.floor(at) % wave.length;
  const [a, b, t] = [wave[k], wave[(k + 1) % wave.length], at - Math.floor(at)];
  // The normal goes on from the last station to the first by a whole turn.
  const turn = b[2] < a[2] - Math.PI ? 2 * Math.PI : 0;
  return [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] + turn - a[2])];
}

/** The drawing; returns { element, draw(drawing) }. */
export function sketch() {
  const canvas = el("canvas", { role: "img", "aria-label": "Teeth of both wheels on the wave, undeformed by load" });
  const stage = el("div", { class: "sketch" }, canvas);
  const readout = el("p", { class: "readout" });
  const turn = el("input", { type: "range", min: 0, max: 180, step: 0.5, value: "0", id: "sketch-turn" });
  const element = el(
    "div",
    {},
    stage,
    el("p", { class: "player" }, el("label", { class: "wide", for: "sketch-turn" }, "Generator ", turn)),
    readout,
  );
  let drawing = null;

  function paint() {
    const width = stage.clientWidth;
    if (!drawing || width < 50) return;
    const ratio = Math.min(devicePixelRatio, 2);
    const height = Math.round(0.42 * width);
    [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    canvas.style.height = `${height}px`;
    const ctx = canvas.getContext("2d");
    ctx.scale(ratio, ratio);
    const {
      wave,
      teeth,
      tooth,
      space,
      generator,
      neutral_radius_mm: neutral,
      bore_radius_mm: bore,
      outer_radius_mm: outer,
    } = drawing;
    const psi = (Number(turn.value) * Math.PI) / 180;
    const output = (psi * (teeth[1] - teeth[0])) / teeth[1];
    const pitch = (2 * Math.PI) / teeth[0];
    const tip = Math.max(...tooth.map(([x]) => x));
    const size = height;
    const views = [
      {
        left: 0,
        top: 0,
        width: size,
        height: size,
        scale: (0.485 * size) / outer,
        centre: [0, 0],
        turn: 0,
        whole: true,
      },
      { left: size, top: 0, width: width - size, height },
    ];
    const close = views[1];
    Object.assign(close, {
      scale: close.width / (TEETH_SEEN * pitch * tip),
      centre: [0, tip],
      turn: psi - Math.PI / 2,
    });

    for (const view of views) {
      const screen = ([x, y]) => {
        const [u, v] = rotated([x, y], -view.turn);
        return [
          view.left + view.width / 2 + (u - view.centre[0]) * view.scale,
          view.top + view.height / 2 - (v - view.centre[1]) * view.scale,
        ];
      };
      const path = (points, closed) => {
        ctx.beginPath();
        points.forEach((point, k) => ctx[k ? "lineTo" : "moveTo"](...screen(point)));
        if (closed) ctx.closePath();
      };
      ctx.save();
      ctx.beginPath();
      ctx.rect(view.left, view.top, view.width, view.height);
      ctx.clip();
      ctx.lineWidth = view.whole ? 0.8 : 1.5;
      ctx.strokeStyle = colour("outline");
      ctx.fillStyle = colour("metal");
      // The generator turns by psi; what it pushes is the bore, which the neutral layer carries.
      for (const curve of generator) {
        path(
          curve.map((point) => rotated(point, psi)),
          true,
        );
        ctx.fill();
        ctx.stroke();
      }
      const half = Math.ceil(TEETH_SEEN / 2) + 2;
      const shown = (count, at) => {
        const middle = Math.round(at / ((2 * Math.PI) / count));
        return view.whole
          ? Array.from({ length: count }, (_, k) => k)
          : Array.from({ length: 2 * half + 1 }, (_, k) => middle - half + k);
      };
      const rim = shown(teeth[0], psi).flatMap((k) => {
        const [x, y, normal] = station(wave, k * pitch - psi);
        return tooth.map(([u, v]) => {
          const [a, b] = rotated([u - neutral, v], normal + psi);
          const [cx, cy] = rotated([x, y], psi);
          return [cx + a, cy + b];
        });
      });
      ctx.strokeStyle = colour("mark-flexspline");
      path(rim, view.whole);
      ctx.stroke();
      const inner = shown(teeth[0], psi).map((k) => {
        const [x, y, normal] = station(wave, k * pitch - psi);
        const [cx, cy] = rotated([x, y], psi);
        const [a, b] = rotated([bore - neutral, 0], normal + psi);
        return [cx + a, cy + b];
      });
      path(inner, view.whole);
      ctx.stroke();
      ctx.strokeStyle = colour("mark-output");
      const ring = shown(teeth[1], psi - output).flatMap((k) =>
        space.map((point) => rotated(point, (2 * Math.PI * k) / teeth[1] + output)),
      );
      path(ring, view.whole);
      ctx.stroke();
      if (view.whole) {
        ctx.beginPath();
        ctx.arc(...screen([0, 0]), outer * view.scale, 0, 2 * Math.PI);
        ctx.stroke();
      }
      ctx.restore();
      ctx.font = FONT;
      ctx.fillStyle = colour("text");
      ctx.fillText(
        view.whole ? "Whole drive" : "Teeth at the major axis, rigid, without load",
        view.left + 8,
        view.top + 16,
      );
    }
  }

  turn.addEventListener("input", paint);
  watchWidth(stage, paint);
  onTheme(paint);
  return {
    element,
    draw(next) {
      drawing = next;
      readout.textContent = !next.gaps
        ? "Rigid teeth."
        : typeof next.least_gap_um === "number"
          ? `Rigid teeth: least gap ${next.least_gap_um.toFixed(1).replace("-", "−")} µm, backlash ${next.backlash_arcsec.toFixed(1)}″ at the output.`
          : "Rigid teeth of these sizes never meet.";
      paint();
      stage.dataset.drawn = String(Number(stage.dataset.drawn ?? 0) + 1);
    },
  };
}
