// The drive, to scale and in motion: both wheels in colour, over them generator, forces and marks; controls and keyboard.
import { onPointing, pointAt, watchWidth } from "./charts.js";
import { modulo, motion, rotated } from "./motion.js";
import { Painter, toScreen } from "./paint.js";
import { onUnits, written } from "./quantities.js";
import { colour, css, FONT, onTheme, strained } from "./theme.js";

const DEGREE = Math.PI / 180;
/** Teeth across the close view. */
const TEETH_SEEN = 9;
const SPEEDS = [
  ["slow", 0.03],
  ["normal", 0.15],
  ["fast", 1],
];

const CONTROLS = `
<div class="stage" tabindex="0" role="group">
  <canvas class="wheels" aria-hidden="true"></canvas><canvas class="over" role="img"></canvas>
</div>
<div class="legend"><span class="low"></span><canvas width="180" height="12" aria-hidden="true"></canvas><span class="high"></span>
  <span class="what"></span></div>
<div class="player">
  <button type="button" class="play" aria-pressed="false">Play</button>
  <label>Speed <select class="speed"></select></label>
  <label class="wide">Generator <input class="scrub" type="range" min="0" max="360" step="0.05" value="0"><output class="angle"></output></label>
  <label class="wide">Close view at <input class="look" type="range" min="-90" max="90" step="0.5" value="0"><output class="looking"></output></label>
  <label class="wide">Displacements × <input class="exaggeration" type="range" min="0" max="100" step="1" value="0"><output class="times"></output></label>
  <label><input class="forces" type="checkbox" checked> Forces</label>
  <label><input class="mesh" type="checkbox"> Mesh</label>
</div>
<p class="readout" aria-live="off"></p>
<p class="keys">Keys, with the picture in focus: <kbd>space</kbd> plays, <kbd>←</kbd> <kbd>→</kbd> turn by an eighth of a tooth pitch,
  <kbd>PgUp</kbd> <kbd>PgDn</kbd> by a pitch, <kbd>+</kbd> <kbd>−</kbd> scale displacements, <kbd>0</kbd> shows them as they are.</p>`;

/** Slider place 0 to 100 to factor 1 to 50, and back. */
const toFactor = (place) => 50 ** (place / 100);
const toPlace = (factor) => (100 * Math.log(factor)) / Math.log(50);

/** An angle in degrees, to half of one. */
const degreesOf = (angle) => `${(Math.round((2 * angle) / DEGREE) / 2).toFixed(1).replace("-", "−")}°`;

/** The viewer in `place`; returns { choose(choice) }. */
export function driveViewer(place, animations) {
  place.innerHTML = CONTROLS;
  const find = (name) => place.querySelector(name);
  const [stage, over] = [find(".stage"), find(".over")];
  over.ariaLabel = place.dataset.alt;
  stage.ariaLabel = "The drive in motion";
  const [play, speed, scrub, exaggeration] = [find(".play"), find(".speed"), find(".scrub"), find(".exaggeration")];
  const [forces, mesh] = [find(".forces"), find(".mesh")];
  for (const [name] of SPEEDS) speed.add(new Option(name, name));
  speed.value = "normal";

  const paint = new Painter(find(".wheels"));
  const wheels = find(".wheels");
  const ctx = over.getContext("2d");
  place.dataset.painter = "canvas";
  let drive = null;
  let psi = 0;
  let factor = 1;
  // Where the close view looks, from the major axis.
  let look = 0;
  let playing = false;
  let frames = 0;
  let asked = false;
  let ratio = 1;
  let size = [0, 0];

  function ask() {
    if (asked) return;
    asked = true;
    requestAnimationFrame((now) => {
      asked = false;
      draw(now);
    });
  }

  /** Two views: all of the drive, and the teeth at the major axis, which stays upright. */
  function views() {
    const [width, height] = size;
    const beside = width > height * 1.3;
    const whole = beside ? { left: 0, top: 0, width: height, height } : { left: 0, top: 0, width, height: width };
    whole.scale = (0.44 * Math.min(whole.width, whole.height)) / drive.reach;
    whole.centre = [0, 0];
    whole.turn = 0;
    const close = beside
      ? { left: whole.width, top: 0, width: width - whole.width, height }
      : { left: 0, top: whole.height, width, height: height - whole.height };
    close.scale = close.width / (TEETH_SEEN * drive.pitch * drive.tipRadius);
    close.turn = psi + look - Math.PI / 2;
    close.centre = [0, drive.tipRadius + (0.05 * close.height) / close.scale];
    return { whole, close };
  }

  /** Sectors of a wheel that the close view may show. */
  function near(wheel, turn) {
    const half = Math.ceil((0.5 * TEETH_SEEN * drive.pitch) / wheel.pitch) + 1;
    const middle = Math.round((psi + look - turn) / wheel.pitch);
    return { first: middle - half, count: 2 * half + 1 };
  }

  let before = 0;
  function draw(now = 0) {
    if (!drive || size[0] < 50) return;
    if (playing) {
      const step = Math.min(0.1, (now - before) / 1000);
      if (before) turnTo(psi + step * SPEEDS.find(([name]) => name === speed.value)[1], "play");
      before = now;
      ask();
    }
    const { whole, close } = views();
    const count = drive.frames * drive.count(psi);
    const turns = [0, drive.output(psi)];
    const line = colour("edge");
    // In play the plain canvas draws the whole drive every other frame: what it then lags is far below a pixel.
    const resting = playing && frames % 2 === 1;
    paint.begin(...size, resting ? close : null);
    [drive.flexspline, drive.circularSpline].forEach((wheel, k) => {
      // The exaggerated flexspline passes through the circular spline, which then steps back.
      const alpha = k === 1 && factor > 1.02 ? 0.35 : 1;
      const common = { frames: count, turn: turns[k], exaggeration: factor, alpha };
      if (!resting) paint.wheel(wheel, whole, { ...common, first: 0, count: wheel.sectors, fine: false });
      const seen = near(wheel, turns[k]);
      paint.wheel(wheel, close, { ...common, ...seen, fine: true, lines: line, mesh: mesh.checked && line });
    });
    drawOver(whole, close, turns[1]);
    place.dataset.frames = String(++frames);
    place.dataset.psi = psi.toFixed(6);
  }

  function drawOver(whole, close, output) {
    ctx.setTransform(1, 0, 0, 1, 0, 0);
    ctx.clearRect(0, 0, ...size);
    for (const view of [whole, close]) {
      ctx.save();
      ctx.beginPath();
      ctx.rect(view.left, view.top, view.width, view.height);
      ctx.clip();
      drawGenerator(view);
      if (view === whole) drawMarks(view, close, output);
      if (forces.checked) drawForces(view, view === close);
      ctx.restore();
    }
    ctx.font = FONT.replace("12px", `${12 * ratio}px`);
    ctx.fillStyle = colour("text");
    const label = (view, text) => {
      plate(view.left + 6 * ratio, view.top + 6 * ratio, ctx.measureText(text).width + 12 * ratio, 20 * ratio);
      ctx.fillText(text, view.left + 12 * ratio, view.top + 20 * ratio);
    };
    label(whole, "Whole drive");
    label(close, look ? `Teeth at ${degreesOf(look)} from the major axis` : "Teeth at the major axis");
    drawScale(close);
  }

  function path(view, points) {
    ctx.beginPath();
    points.forEach((point, k) => ctx[k ? "lineTo" : "moveTo"](...toScreen(view, point)));
  }

  function drawGenerator(view) {
    ctx.strokeStyle = colour("outline");
    ctx.fillStyle = colour("metal");
    ctx.lineWidth = 1.25 * ratio;
    for (const curve of drive.generator) {
      path(
        view,
        curve.map((point) => drive.generatorPoint(point, psi, factor)),
      );
      ctx.closePath();
      ctx.fill();
      ctx.stroke();
    }
  }

  /** Axes of the generator, tooth 0, space 0, and what the close view shows. */
  function drawMarks(view, close, output) {
    ctx.setLineDash([6 * ratio, 4 * ratio]);
    ctx.lineWidth = ratio;
    ctx.strokeStyle = colour("text");
    const r = drive.description.bore_radius_mm;
    path(view, [rotated([-r, 0], psi), rotated([r, 0], psi)]);
    ctx.stroke();
    ctx.setLineDash([]);
    const dot = (point, name) => {
      const [x, y] = toScreen(view, point);
      ctx.fillStyle = colour(name);
      ctx.beginPath();
      ctx.arc(x, y, 4.5 * ratio, 0, 2 * Math.PI);
      ctx.fill();
      ctx.strokeStyle = colour("card");
      ctx.stroke();
    };
    dot([drive.description.bore_radius_mm - 3, 0], "mark-flexspline");
    dot(rotated([drive.reach - 2, 0], output), "mark-output");
    const half = (TEETH_SEEN / 2) * drive.pitch * drive.tipRadius;
    const [low, high] = [-0.5, 0.5].map((k) => close.centre[1] + (k * close.height) / close.scale);
    const corners = [
      [-half, low],
      [half, low],
      [half, high],
      [-half, high],
    ];
    ctx.strokeStyle = colour("text");
    path(
      view,
      corners.map((corner) => rotated(corner, close.turn)),
    );
    ctx.closePath();
    ctx.stroke();
  }

  /** Arrows of one scale, by which all of them stay within the view. */
  function drawForces(view, isClose) {
    const { first, count } = isClose ? near(drive.flexspline, 0) : { first: 0, count: drive.flexspline.sectors };
    ctx.lineWidth = (isClose ? 2.25 : 1.25) * ratio;
    const right = view.left + view.width;
    const bottom = view.top + view.height;
    // Teeth at the edge of the close view are seen in part: their forces are left to the view beside it.
    const rim = isClose ? 0.08 * view.width : 0;
    const arrows = [];
    let longest = (isClose ? 0.26 : 0.16) * Math.min(view.width, view.height);
    for (let sector = first; sector < first + count; sector++) {
      for (const { kind, force, point } of drive.forcesOn(sector, drive.count(psi), factor)) {
        const [x, y] = toScreen(view, point);
        if (x < view.left + rim || x > right - rim || y < view.top || y > bottom) continue;
        const [fx, fy] = rotated(force, -view.turn);
        const share = Math.hypot(fx, fy) / drive.largestForce;
        if (share * longest < 2 * ratio) continue;
        const [ux, uy] = [fx / Math.hypot(fx, fy), -fy / Math.hypot(fx, fy)];
        const across = (ux > 0 ? x - view.left : right - x) / Math.abs(ux);
        const along = (uy > 0 ? y - view.top : bottom - y) / Math.abs(uy);
        longest = Math.min(longest, Math.min(across, along) / share);
        arrows.push({ kind, x, y, ux, uy, share });
      }
    }
    for (const { kind, x, y, ux, uy, share } of arrows) {
      const length = share * longest;
      ctx.strokeStyle = ctx.fillStyle = colour(kind === "flank" ? "force-flank" : "force-bore");
      ctx.beginPath();
      ctx.moveTo(x - ux * length, y - uy * length);
      ctx.lineTo(x, y);
      ctx.stroke();
      const head = Math.min(6 * ratio, 0.5 * length);
      ctx.beginPath();
      ctx.moveTo(x, y);
      ctx.lineTo(x - ux * head - uy * head * 0.5, y - uy * head + ux * head * 0.5);
      ctx.lineTo(x - ux * head + uy * head * 0.5, y - uy * head - ux * head * 0.5);
      ctx.fill();
    }
  }

  /** Ground for text over a picture. */
  function plate(left, top, width, height) {
    ctx.save();
    ctx.globalAlpha = 0.85;
    ctx.fillStyle = colour("card");
    ctx.fillRect(left, top, width, height);
    ctx.restore();
  }

  /** A length for comparison. */
  function drawScale(view) {
    const mm = [5, 2, 1, 0.5, 0.2].find((length) => length * view.scale < 0.3 * view.width) ?? 0.1;
    const [left, bottom] = [view.left + 14 * ratio, view.top + view.height - 14 * ratio];
    plate(left - 8 * ratio, bottom - 24 * ratio, Math.max(mm * view.scale, 40 * ratio) + 16 * ratio, 34 * ratio);
    ctx.strokeStyle = ctx.fillStyle = colour("text");
    ctx.lineWidth = 2 * ratio;
    ctx.beginPath();
    ctx.moveTo(left, bottom);
    ctx.lineTo(left + mm * view.scale, bottom);
    ctx.stroke();
    ctx.fillText(`${mm} mm`, left, bottom - 6 * ratio);
  }

  function write() {
    if (!drive) return;
    const degrees = modulo(psi / DEGREE, 360);
    scrub.value = degrees;
    find(".angle").textContent = `${degrees.toFixed(2)}°`;
    find(".looking").textContent = degreesOf(look);
    find(".times").textContent = factor < 9.95 ? factor.toFixed(1) : factor.toFixed(0);
    const { torque_n_m, temperature_c, peak_mpa } = drive.description;
    const output = written(modulo(drive.output(psi) / DEGREE, 360), "degree", 5);
    const largest = written(drive.largestForce, "force", 3);
    find(".readout").textContent =
      `Output at ${output}, error ${written(drive.error(psi), "error", 4)}; load ${written(torque_n_m, "torque", 3)}, ` +
      `${written(temperature_c, "temperature", 3)}. Longest arrow ${largest}.` +
      (factor > 1.02
        ? " Displacements are exaggerated: that wheels overlap is the picture's doing, not the drive's."
        : "");
    find(".low").textContent = "0";
    find(".high").textContent = written(peak_mpa, "stress", 3);
    find(".what").textContent = "von Mises stress, to the largest anywhere";
  }

  /** Turns the generator; the charts follow unless they asked. */
  function turnTo(angle, by) {
    psi = angle;
    write();
    if (by !== "chart") pointAt(modulo(psi, drive.pitch) / DEGREE);
    ask();
  }

  function setFactor(next) {
    factor = Math.min(50, Math.max(1, next));
    exaggeration.value = toPlace(factor);
    exaggeration.setAttribute("aria-valuetext", `${factor.toFixed(1)} times`);
    write();
    ask();
  }

  function setPlaying(on) {
    playing = on;
    before = 0;
    play.textContent = on ? "Pause" : "Play";
    play.setAttribute("aria-pressed", String(on));
    ask();
  }

  play.addEventListener("click", () => setPlaying(!playing));
  scrub.addEventListener("input", () => turnTo(Number(scrub.value) * DEGREE, "scrub"));
  exaggeration.addEventListener("input", () => setFactor(toFactor(Number(exaggeration.value))));
  find(".look").addEventListener("input", (event) => {
    look = Number(event.target.value) * DEGREE;
    write();
    ask();
  });
  // Pointing at the whole drive brings the close view there.
  stage.addEventListener("click", (event) => {
    if (!drive) return;
    const box = stage.getBoundingClientRect();
    const { whole } = views();
    const [x, y] = [(event.clientX - box.left) * ratio, (event.clientY - box.top) * ratio];
    if (x > whole.width || y > whole.height) return;
    const angle = Math.atan2(whole.height / 2 - y, x - whole.width / 2) - psi;
    // Both lobes are alike.
    look = (modulo(angle / DEGREE + 90, 180) - 90) * DEGREE;
    find(".look").value = look / DEGREE;
    write();
    ask();
  });
  for (const box of [forces, mesh]) box.addEventListener("change", ask);
  stage.addEventListener("keydown", (event) => {
    const step = drive?.pitch ?? 0;
    const keys = {
      " ": () => setPlaying(!playing),
      ArrowRight: () => turnTo(psi + step / 8),
      ArrowLeft: () => turnTo(psi - step / 8),
      PageDown: () => turnTo(psi + step),
      PageUp: () => turnTo(psi - step),
      Home: () => turnTo(0),
      "+": () => setFactor(factor * 1.25),
      "=": () => setFactor(factor * 1.25),
      "-": () => setFactor(factor / 1.25),
      0: () => setFactor(1),
    };
    if (!keys[event.key] || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    keys[event.key]();
  });
  onPointing((degrees) => {
    if (!drive) return;
    setPlaying(false);
    // Within the pitch at which the generator stands.
    turnTo(Math.floor(drive.count(psi) + 1e-9) * drive.pitch + degrees * DEGREE, "chart");
  });

  function resize() {
    ratio = Math.min(devicePixelRatio, 2);
    const width = stage.clientWidth;
    const height = Math.round(width > 620 ? 0.44 * width : 1.75 * width);
    size = [Math.round(width * ratio), Math.round(height * ratio)];
    stage.style.height = `${height}px`;
    for (const canvas of [wheels, over]) [canvas.width, canvas.height] = size;
    draw();
  }
  watchWidth(stage, resize);
  const bar = find(".legend canvas").getContext("2d");
  function drawBar() {
    const coloured = strained();
    for (let k = 0; k < 180; k++) {
      bar.fillStyle = css(coloured(k / 179));
      bar.fillRect(k, 0, 1, 12);
    }
  }
  onTheme(() => {
    paint.recolour();
    drawBar();
    draw();
  });
  onUnits(write);
  drawBar();

  return {
    async choose(choice) {
      const description = animations[choice];
      place.classList.toggle("empty", !description);
      if (!description) {
        drive = null;
        setPlaying(false);
        return;
      }
      const next = await motion(choice, description);
      drive = next;
      paint.load(drive);
      place.dataset.drawn = choice;
      write();
      resize();
      pointAt(modulo(psi, drive.pitch) / DEGREE);
    },
  };
}
