// Numbers of the page: the other half of report/pack.rs.

/** Whether this browser can inflate what the page carries. */
export function canInflate() {
  try {
    new DecompressionStream("deflate-raw");
    return true;
  } catch {
    return false;
  }
}

/** Inflates base64 of raw deflate. No fetch: a page without network access has none. */
async function inflate(text) {
  const deflated = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([deflated]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Undoes planes, zigzag and differences: values of one packed array as Float32Array. */
export async function unpack({ kind, scale, offset, text }) {
  const bytes = await inflate(text);
  if (kind === "i16") {
    const count = bytes.length / 2;
    const values = new Float32Array(count);
    let now = 0;
    for (let i = 0; i < count; i++) {
      const z = bytes[i] | (bytes[count + i] << 8);
      now = ((now + ((z >> 1) ^ -(z & 1))) << 16) >> 16;
      values[i] = now * scale + offset;
    }
    return values;
  }
  if (kind === "f32") {
    const count = bytes.length / 4;
    const joined = new Uint8Array(bytes.length);
    for (let plane = 0; plane < 4; plane++)
      for (let i = 0; i < count; i++) joined[4 * i + plane] = bytes[plane * count + i];
    return new Float32Array(joined.buffer);
  }
  throw new Error(`packed array of kind "${kind}"`);
}

const inflated = new Map();

/** Gives a page numbers that do not stand in its source: a promise of { values, shape } under a name. */
export function provide(name, promise) {
  inflated.set(name, promise);
}

/** The packed array of this name: { values, shape }. Arrays are inflated when first asked for, and kept. */
export function numbers(name) {
  if (!inflated.has(name)) {
    const element = document.querySelector(`script.packed[data-name="${CSS.escape(name)}"]`);
    if (!element) return Promise.reject(new Error(`the page holds no numbers called "${name}"`));
    const { kind, scale, offset, shape } = element.dataset;
    const packed = { kind, scale: Number(scale), offset: Number(offset), text: element.textContent };
    inflated.set(
      name,
      unpack(packed).then((values) => ({ values, shape: shape.split(",").map(Number) })),
    );
  }
  return inflated.get(name);
}
