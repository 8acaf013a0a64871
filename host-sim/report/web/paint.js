// Both wheels in colour: by WebGL2, where every sector is one instance of the first and the vertex shader looks up where it
// stands, or, where there is no WebGL2, on a plain canvas.
import { rotated } from "./motion.js";
import { colour, css, strained } from "./theme.js";

const VERTEX = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
in vec2 a_position;
in ivec2 a_place;         // node, and sector beside that of the instance
uniform sampler2D u_field; // x, y: displacement, mm; z: stress, of the colour scale
uniform int u_first;
uniform float u_count;    // frames that the generator has turned
uniform float u_frames;
uniform int u_samples;
uniform float u_pitch;
uniform float u_turn;
uniform float u_exaggeration;
uniform vec4 u_view;      // cosine and sine of its turn, centre
uniform vec2 u_scale;
uniform bool u_between;   // interpolate between samples: not where a pixel is wider than what they differ by
out float v_stress;
void main() {
  int sector = u_first + gl_InstanceID + a_place.y;
  float samples = float(u_samples);
  float s = u_frames * float(sector) - u_count;
  s -= samples * floor(s / samples);
  int first = int(floor(s)) % u_samples;
  int second = (first + 1) % u_samples;
  vec4 field = texelFetch(u_field, ivec2(first, a_place.x), 0);
  if (u_between) field = mix(field, texelFetch(u_field, ivec2(second, a_place.x), 0), fract(s));
  vec2 x = a_position + u_exaggeration * field.xy;
  float angle = u_pitch * float(sector) + u_turn;
  x = vec2(cos(angle) * x.x - sin(angle) * x.y, sin(angle) * x.x + cos(angle) * x.y);
  x = vec2(u_view.x * x.x + u_view.y * x.y, u_view.x * x.y - u_view.y * x.x) - u_view.zw;
  gl_Position = vec4(x * u_scale, 0.0, 1.0);
  v_stress = field.z;
}`;

const FRAGMENT = `#version 300 es
precision mediump float;
in float v_stress;
uniform sampler2D u_map;
uniform vec4 u_plain;     // used where its alpha is above zero
uniform float u_alpha;
out vec4 colour;
void main() {
  vec4 c = u_plain.a > 0.0 ? u_plain : texture(u_map, vec2(v_stress, 0.5));
  colour = vec4(c.rgb * c.a, c.a) * u_alpha;
}`;

/** Corner triangles of an 8-node element; with its midsides, or as a plain quadrilateral. */
const FINE = [0, 4, 7, 4, 1, 5, 5, 2, 6, 6, 3, 7, 4, 5, 6, 4, 6, 7];
const COARSE = [0, 1, 2, 0, 2, 3];

/** Whether WebGL2 is drawn by the processor here. */
function isSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const about = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = about ? gl.getParameter(about.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

class WebGLPainter {
  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { alpha: true, antialias: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("no WebGL2");
    this.gl = gl;
    this.name = "WebGL2";
    this.program = this.link();
    this.at = (name) => gl.getUniformLocation(this.program, name);
    this.wheels = new Map();
    this.recolour();
  }

  /** Takes the colours of the theme. */
  recolour() {
    const { gl } = this;
    const map = new Uint8Array(256 * 4);
    const coloured = strained();
    for (let k = 0; k < 256; k++) map.set([...coloured(k / 255), 255], 4 * k);
    if (this.map) gl.deleteTexture(this.map);
    this.map = this.texture(gl.RGBA8, 256, 1, gl.RGBA, gl.UNSIGNED_BYTE, map, gl.LINEAR);
  }

  link() {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, source] of [
      [gl.VERTEX_SHADER, VERTEX],
      [gl.FRAGMENT_SHADER, FRAGMENT],
    ]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "a_position");
    gl.bindAttribLocation(program, 1, "a_place");
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    return program;
  }

  texture(inside, width, height, format, type, data, filter) {
    const { gl } = this;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, inside, width, height, 0, format, type, data);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, filter);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    return texture;
  }

  /** Uploads the drive, in place of the one before. */
  load(motion) {
    const { gl } = this;
    for (const { texture, buffers, arrays } of this.wheels.values()) {
      gl.deleteTexture(texture);
      buffers.forEach((b) => gl.deleteBuffer(b));
      gl.deleteVertexArray(arrays);
    }
    this.wheels.clear();
    for (const wheel of [motion.flexspline, motion.circularSpline]) {
      this.wheels.set(wheel, this.upload(wheel, motion.description.colour_end_mpa));
    }
  }

  upload(wheel, colourEnd) {
    const { gl } = this;
    const { samples, nodeCount } = wheel;
    const field = new Float32Array(4 * samples * nodeCount);
    for (let node = 0; node < nodeCount; node++)
      for (let s = 0; s < samples; s++) {
        const k = 4 * (node * samples + s);
        field[k] = wheel.displacement[2 * node * samples + s];
        field[k + 1] = wheel.displacement[(2 * node + 1) * samples + s];
        field[k + 2] = wheel.stress[node * samples + s] / colourEnd;
      }
    const texture = this.texture(gl.RGBA32F, samples, nodeCount, gl.RGBA, gl.FLOAT, field, gl.NEAREST);
    const used = [...new Set([...wheel.elements, ...wheel.outline])];
    const number = new Map(used.map((index, k) => [index, k]));
    const places = new Int32Array(used.flatMap((i) => [i % nodeCount, i >= nodeCount ? 1 : 0]));
    const positions = new Float32Array(
      used.flatMap((i) => [...wheel.nodes.subarray(2 * (i % nodeCount), 2 * (i % nodeCount) + 2)]),
    );
    const triangles = (pattern) => {
      const list = [];
      for (let e = 0; e < wheel.elements.length; e += 8)
        for (const corner of pattern) list.push(number.get(wheel.elements[e + corner]));
      return list;
    };
    const lines = [];
    for (let e = 0; e < wheel.outline.length; e += 3) {
      const [a, b, c] = [0, 1, 2].map((k) => number.get(wheel.outline[e + k]));
      lines.push(a, b, b, c);
    }
    const mesh = [];
    for (let e = 0; e < wheel.elements.length; e += 8)
      for (let k = 0; k < 4; k++) {
        const [a, b, c] = [k, 4 + k, (k + 1) % 4].map((n) => number.get(wheel.elements[e + n]));
        mesh.push(a, b, b, c);
      }
    const parts = {};
    const indices = [];
    for (const [name, list] of Object.entries({ fine: triangles(FINE), coarse: triangles(COARSE), lines, mesh })) {
      parts[name] = [indices.length, list.length];
      indices.push(...list);
    }
    const arrays = gl.createVertexArray();
    gl.bindVertexArray(arrays);
    const buffer = (target, data) => {
      const b = gl.createBuffer();
      gl.bindBuffer(target, b);
      gl.bufferData(target, data, gl.STATIC_DRAW);
      return b;
    };
    const buffers = [buffer(gl.ARRAY_BUFFER, positions)];
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    buffers.push(buffer(gl.ARRAY_BUFFER, places));
    gl.enableVertexAttribArray(1);
    gl.vertexAttribIPointer(1, 2, gl.INT, 0, 0);
    buffers.push(buffer(gl.ELEMENT_ARRAY_BUFFER, new Uint16Array(indices)));
    gl.bindVertexArray(null);
    return { texture, buffers, arrays, parts };
  }

  begin(width, height) {
    const { gl } = this;
    this.size = [width, height];
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.SCISSOR_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.useProgram(this.program);
  }

  /** Draws sectors of a wheel in a view; `what` is fill or lines. */
  wheel(wheel, view, { first, count, frames, turn, exaggeration, fine, alpha, lines, mesh }) {
    const { gl } = this;
    const { texture, arrays, parts } = this.wheels.get(wheel);
    const bottom = this.size[1] - view.top - view.height;
    gl.viewport(view.left, bottom, view.width, view.height);
    gl.scissor(view.left, bottom, view.width, view.height);
    gl.uniform1i(this.at("u_first"), first);
    gl.uniform1f(this.at("u_frames"), wheel.frames);
    // Kept small, so that single precision has room for the fraction.
    gl.uniform1f(this.at("u_count"), frames % wheel.samples);
    gl.uniform1i(this.at("u_samples"), wheel.samples);
    gl.uniform1f(this.at("u_pitch"), wheel.pitch);
    gl.uniform1f(this.at("u_turn"), turn % (2 * Math.PI));
    gl.uniform1f(this.at("u_exaggeration"), exaggeration);
    gl.uniform4f(this.at("u_view"), Math.cos(view.turn), Math.sin(view.turn), view.centre[0], view.centre[1]);
    gl.uniform2f(this.at("u_scale"), (2 * view.scale) / view.width, (2 * view.scale) / view.height);
    gl.uniform1f(this.at("u_alpha"), alpha);
    gl.uniform1i(this.at("u_between"), fine ? 1 : 0);
    gl.uniform1i(this.at("u_field"), 0);
    gl.uniform1i(this.at("u_map"), 1);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.map);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.bindVertexArray(arrays);
    const draw = (mode, part, plain) => {
      gl.uniform4f(this.at("u_plain"), ...plain);
      const [start, length] = parts[part];
      gl.drawElementsInstanced(mode, length, gl.UNSIGNED_SHORT, 2 * start, count);
    };
    draw(gl.TRIANGLES, fine ? "fine" : "coarse", [0, 0, 0, 0]);
    if (mesh) draw(gl.LINES, "mesh", [...mesh, 0.35]);
    if (lines) draw(gl.LINES, "lines", [...lines, 1]);
  }
}

/** Colours that the plain canvas sorts elements into. */
const BUCKETS = 40;

class CanvasPainter {
  constructor(canvas) {
    this.context = canvas.getContext("2d");
    this.name = "canvas";
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
      ctx.strokeStyle = css(lines.map((v) => Math.round(255 * v)));
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

/** A painter on this canvas: WebGL2 where a graphics card draws it. Where the processor does, a plain canvas is faster. */
export function painter(canvas) {
  try {
    if (!isSoftware()) return new WebGLPainter(canvas);
  } catch {
    // No WebGL2, or one that cannot do this; its canvas cannot be used for anything else.
    const plain = canvas.cloneNode();
    canvas.replaceWith(plain);
    return new CanvasPainter(plain);
  }
  return new CanvasPainter(canvas);
}

/** A colour of the style sheet as three numbers from 0 to 1. */
export function rgb(name) {
  const hex = colour(name).replace("#", "");
  return [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255);
}
