// The flexspline with its sleeve in three dimensions: harmonics of the rim, each with its shape along the axis, added up and drawn on a
// plain canvas, farthest patch first. The wave turns with the generator; pointer and keys turn the view.
import { watchWidth } from "./charts.js";
import { colour, css, FONT, onTheme, viridis } from "./theme.js";

/** Patches around. */
const AROUND = 96;
/** Turns of the generator a second while it plays. */
const SLEEVE_SPEED = 0.1;
/** What the largest displacement is drawn as, of the radius, to begin with. */
const SHOWN_AS = 0.16;
const TURN_KEY = Math.PI / 24;
/** Light from the upper left, in front. */
const LIGHT = [-0.4, 0.55, 0.73];

const SLEEVE_CONTROLS = `
<div class="stage" tabindex="0" role="group"><canvas role="img"></canvas></div>
<div class="legend"><span class="low"></span><canvas width="180" height="12" aria-hidden="true"></canvas><span class="high"></span>
  <span class="what">outward displacement, mm</span></div>
<div class="player">
  <button type="button" class="play" aria-pressed="false">Play</button>
  <label class="wide">Generator <input class="scrub" type="range" min="0" max="360" step="1" value="0"><output class="angle"></output></label>
  <label class="wide">Displacements × <input class="exaggeration" type="range" min="0" max="100" step="1"><output class="times"></output></label>
</div>
<p class="readout" aria-live="off"></p>
<p class="keys">Keys, with the picture in focus: <kbd>space</kbd> plays, arrows turn the view, <kbd>PgUp</kbd> <kbd>PgDn</kbd> turn the
  generator, <kbd>+</kbd> <kbd>−</kbd> scale displacements. Drag the picture to turn the view.</p>`;

/** Displacement of a place of the middle surface: [along the axis, around it, outward], mm; theta from the major axis. */
export function displacedAt(view, station, theta) {
  const sum = [0, 0, 0];
  for (const wave of view.waves) {
    const [a, b] = wave.amplitudes_mm;
    const [s, c] = [Math.sin(wave.n * theta), Math.cos(wave.n * theta)];
    sum[0] += wave.along[station] * (a * c + b * s);
    sum[1] += wave.around[station] * (a * s - b * c);
    sum[2] += wave.outward[station] * (a * c + b * s);
  }
  return sum;
}

/** The largest displacement anywhere, mm, and the range of the outward one. */
export function sleeveExtent(view) {
  let [most, low, high] = [0, 0, 0];
  for (let i = 0; i < view.stations_mm.length; i++)
    for (let k = 0; k < AROUND; k++) {
      const d = displacedAt(view, i, (2 * Math.PI * k) / AROUND);
      most = Math.max(most, Math.hypot(...d));
      low = Math.min(low, d[2]);
      high = Math.max(high, d[2]);
    }
  return { most, low, high };
}

/** The viewer in `place`; returns { choose(choice) }. */
export function sleeveViewer(place, animations) {
  place.innerHTML = SLEEVE_CONTROLS;
  const find = (name) => place.querySelector(name);
  const [stage, canvas, legend] = [find(".stage"), find(".stage canvas"), find(".legend canvas")];
  const [play, scrub, exaggeration, readout] = [find(".play"), find(".scrub"), find(".exaggeration"), find(".readout")];
  canvas.ariaLabel = place.dataset.alt;
  stage.ariaLabel = "The flexspline in three dimensions";
  const ctx = canvas.getContext("2d");
  let view = null;
  let extent = null;
  let psi = 0;
  let factor = 1;
  let [yaw, pitch] = [0.7, 0.35];
  let playing = false;
  let before = 0;
  let size = [0, 0];

  /** Slider place 0 to 100 to factor 1 to 2000, and back. */
  const toFactor = (at) => 2000 ** (at / 100);
  const toPlace = (times) => (100 * Math.log(times)) / Math.log(2000);

  function resize() {
    const width = stage.clientWidth;
    const height = Math.round(Math.min(520, 0.62 * width));
    stage.style.height = `${height}px`;
    canvas.width = width * devicePixelRatio;
    canvas.height = height * devicePixelRatio;
    size = [width, height];
    draw();
  }

  /** Places of all nodes in the view, millimetres: across, up, towards the eye. */
  function nodes() {
    const [sy, cy, sp, cp] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
    const middle = 0.5 * (view.stations_mm[0] + view.stations_mm.at(-1));
    return view.stations_mm.map((x, i) =>
      Array.from({ length: AROUND }, (_, k) => {
        const angle = (2 * Math.PI * k) / AROUND;
        const [u, v, w] = displacedAt(view, i, angle - psi);
        const r = view.radius_mm + factor * w;
        const turn = angle + (factor * v) / view.radius_mm;
        // The axis lies across the picture, the wheel stands upright on it.
        const [along, up, out] = [x - middle + factor * u, r * Math.sin(turn), r * Math.cos(turn)];
        const [across, deep] = [along * cy + out * sy, out * cy - along * sy];
        return { at: [across, up * cp - deep * sp, deep * cp + up * sp], w };
      }),
    );
  }

  function patches() {
    const all = nodes();
    const made = [];
    for (let i = 0; i + 1 < all.length; i++) {
      const x = 0.5 * (view.stations_mm[i] + view.stations_mm[i + 1]);
      const toothed = Math.abs(x) < view.half_face_mm;
      for (let k = 0; k < AROUND; k++) {
        const next = (k + 1) % AROUND;
        const corners = [all[i][k], all[i][next], all[i + 1][next], all[i + 1][k]];
        const [p, q, r] = [corners[0].at, corners[1].at, corners[3].at];
        const [a, b] = [q.map((c, j) => c - p[j]), r.map((c, j) => c - p[j])];
        const normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        const length = Math.hypot(...normal) || 1;
        const light = Math.abs(normal.reduce((sum, c, j) => sum + c * LIGHT[j], 0)) / length;
        made.push({
          corners,
          toothed,
          light,
          deep: corners.reduce((sum, c) => sum + c.at[2], 0),
          w: 0.25 * corners.reduce((sum, c) => sum + c.w, 0),
        });
      }
    }
    return made.sort((a, b) => a.deep - b.deep);
  }

  function draw() {
    if (!view || size[0] < 50) return;
    const [width, height] = size;
    const reach = Math.hypot(0.5 * (view.stations_mm.at(-1) - view.stations_mm[0]), view.radius_mm * 1.2);
    const scale = Math.min(0.48 * width, 0.48 * height * (width > 1.2 * height ? 1.35 : 1)) / reach;
    ctx.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
    ctx.fillStyle = colour("card");
    ctx.fillRect(0, 0, width, height);
    const span = extent.high - extent.low || 1;
    const line = colour("outline");
    for (const patch of patches()) {
      const tone = viridis((patch.w - extent.low) / span).map((c) => Math.round(c * (0.45 + 0.55 * patch.light)));
      ctx.beginPath();
      patch.corners.forEach(({ at: [x, y] }, k) => {
        const [px, py] = [0.5 * width + scale * x, 0.5 * height - scale * y];
        if (k) ctx.lineTo(px, py);
        else ctx.moveTo(px, py);
      });
      ctx.closePath();
      ctx.fillStyle = ctx.strokeStyle = css(tone);
      ctx.lineWidth = 0.6;
      ctx.fill();
      ctx.stroke();
      if (patch.toothed) {
        ctx.globalAlpha = 0.35;
        ctx.strokeStyle = line;
        ctx.stroke();
        ctx.globalAlpha = 1;
      }
    }
    drawFace(width, height);
    tell();
  }

  /** Load along the face of the flank that bears most, over its mean, in a corner of the picture. */
  function drawFace(width, height) {
    const load = view.load_over_mean;
    ctx.font = FONT;
    ctx.fillStyle = ctx.strokeStyle = colour("text");
    ctx.lineWidth = 1;
    ctx.fillText(`${view.ends[0]} on the left, ${view.ends[1]} on the right of the axis`, 12, 20);
    if (load.length < 2) return;
    const [w, h] = [Math.min(190, 0.3 * width), 70];
    const [left, base] = [width - w - 14, height - 22];
    const most = Math.max(...load);
    ctx.strokeRect(left, base - h, w, h);
    ctx.textAlign = "right";
    ctx.fillText(`load along the face: peak ${most.toFixed(1)} × mean`, left + w, base - h - 6);
    ctx.textAlign = "left";
    ctx.beginPath();
    ctx.moveTo(left, base);
    load.forEach((q, k) => ctx.lineTo(left + (w * k) / (load.length - 1), base - (h * q) / most));
    ctx.lineTo(left + w, base);
    ctx.closePath();
    ctx.globalAlpha = 0.35;
    ctx.fillStyle = colour("link");
    ctx.fill();
    ctx.globalAlpha = 1;
    ctx.stroke();
    ctx.setLineDash([4, 3]);
    ctx.beginPath();
    ctx.moveTo(left, base - h / most);
    ctx.lineTo(left + w, base - h / most);
    ctx.stroke();
    ctx.setLineDash([]);
  }

  function tell() {
    const share = view.load_over_mean.filter((q) => q > 0).length / Math.max(1, view.load_over_mean.length);
    const face = view.load_over_mean.length
      ? `; the flank that bears most does so on ${Math.round(100 * share)} % of its face, peak ${Math.max(...view.load_over_mean).toFixed(1)} times the mean`
      : "; the load along the face is taken as even";
    readout.textContent =
      `Displacements ${factor < 10 ? factor.toFixed(1) : Math.round(factor)} times as large as they are (largest: ${extent.most.toFixed(3)} mm). ` +
      `Teeth tilt by up to ${view.tilt_mrad.toFixed(2)} mrad and skew by ${view.skew_mrad.toFixed(2)} mrad${face}.`;
    find(".angle").textContent = `${Math.round((180 * psi) / Math.PI) % 360}°`;
    find(".times").textContent = factor < 10 ? factor.toFixed(1) : String(Math.round(factor));
    exaggeration.setAttribute("aria-valuetext", `${find(".times").textContent} times`);
    scrub.value = String(Math.round((180 * psi) / Math.PI) % 360);
    place.dataset.angle = psi.toFixed(4);
    place.dataset.factor = factor.toFixed(2);
  }

  function frame(now) {
    if (!playing) return;
    if (before) psi = (psi + (2 * Math.PI * SLEEVE_SPEED * Math.min(100, now - before)) / 1000) % (2 * Math.PI);
    before = now;
    draw();
    requestAnimationFrame(frame);
  }

  function setPlaying(on) {
    if (on === playing) return;
    playing = on;
    before = 0;
    play.textContent = on ? "Pause" : "Play";
    play.setAttribute("aria-pressed", String(on));
    if (on) requestAnimationFrame(frame);
  }

  function scaleTo(times) {
    factor = Math.min(2000, Math.max(1, times));
    exaggeration.value = String(toPlace(factor));
    draw();
  }

  function turnTo(angle) {
    psi = ((angle % (2 * Math.PI)) + 2 * Math.PI) % (2 * Math.PI);
    draw();
  }

  function look(around, up) {
    yaw += around;
    pitch = Math.min(1.5, Math.max(-1.5, pitch + up));
    draw();
  }

  function drawLegend() {
    const pen = legend.getContext("2d");
    for (let x = 0; x < legend.width; x++) {
      pen.fillStyle = css(viridis(x / (legend.width - 1)));
      pen.fillRect(x, 0, 1, legend.height);
    }
    find(".low").textContent = extent.low.toFixed(2).replace("-", "−");
    find(".high").textContent = extent.high.toFixed(2);
  }

  play.addEventListener("click", () => setPlaying(!playing));
  scrub.addEventListener("input", () => turnTo((Number(scrub.value) * Math.PI) / 180));
  exaggeration.addEventListener("input", () => scaleTo(toFactor(Number(exaggeration.value))));
  stage.addEventListener("keydown", (event) => {
    const keys = {
      " ": () => setPlaying(!playing),
      ArrowLeft: () => look(-TURN_KEY, 0),
      ArrowRight: () => look(TURN_KEY, 0),
      ArrowUp: () => look(0, TURN_KEY),
      ArrowDown: () => look(0, -TURN_KEY),
      PageUp: () => turnTo(psi + TURN_KEY),
      PageDown: () => turnTo(psi - TURN_KEY),
      "+": () => scaleTo(1.25 * factor),
      "-": () => scaleTo(factor / 1.25),
    };
    if (!keys[event.key] || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    keys[event.key]();
  });
  stage.addEventListener("pointermove", (event) => {
    if (event.buttons === 1) look(event.movementX / 150, event.movementY / 150);
  });
  // A finger that drags turns the picture, not the page.
  stage.style.touchAction = "none";
  watchWidth(stage, resize);
  onTheme(() => draw());

  return {
    choose(id) {
      view = animations[id]?.sleeve ?? null;
      place.classList.toggle("empty", !view);
      if (!view) {
        setPlaying(false);
        return;
      }
      extent = sleeveExtent(view);
      factor = Math.max(1, (SHOWN_AS * view.radius_mm) / (extent.most || 1));
      exaggeration.value = String(toPlace(factor));
      drawLegend();
      resize();
    },
  };
}
