// Colours for canvases, taken from the style sheet so that there is one place for them.

/** A colour of the style sheet by the name of its variable. */
export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

export const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', sans-serif";

/** Calls `listener` when the page turns dark or light, and when it goes to paper, which is light, and comes back. */
export function onTheme(listener) {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", listener);
  for (const name of ["beforeprint", "afterprint"]) {
    addEventListener(name, () => {
      document.documentElement.classList.toggle("printing", name === "beforeprint");
      listener();
    });
  }
}

/** Anchors of the map viridis, dark to light; equal steps look equal, to colour-blind eyes too. */
const VIRIDIS = ["440154", "472d7b", "3b528b", "2c728e", "21918c", "28ae80", "5ec962", "addc30", "fde725"];
/** Anchors of a map that is pale in the middle, blue below and red above (ColorBrewer's RdBu, safe for colour-blind eyes). */
const BLUE_RED = ["053061", "2166ac", "4393c3", "92c5de", "f7f7f7", "f4a582", "d6604d", "b2182b", "67001f"];
const bytes = (all) => all.map((hex) => [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16)));

/** Colour of a map with these anchors at 0 to 1, as three bytes. */
function between(anchors, x) {
  const place = Math.min(Math.max(x, 0), 1) * (anchors.length - 1);
  const k = Math.min(Math.floor(place), anchors.length - 2);
  return anchors[k].map((from, c) => Math.round(from + (anchors[k + 1][c] - from) * (place - k)));
}

const [SEQUENTIAL, DIVERGING] = [VIRIDIS, BLUE_RED].map(bytes);

/** For sizes. */
export const viridis = (x) => between(SEQUENTIAL, x);

/** Shares of a scale of stress between which bare metal turns into the map. Guesses: a ring that bears little is grey, the foot of a tooth is not. */
const BARE = [0.04, 0.16];

/** For stress on a wheel: what bears nothing is the metal of the style sheet and leaves the eye to the teeth. */
export function strained() {
  const [, ...metal] = /^#(..)(..)(..)$/.exec(colour("unstressed")).map((hex) => parseInt(hex, 16));
  return (x) => {
    const share = Math.min(Math.max((x - BARE[0]) / (BARE[1] - BARE[0]), 0), 1);
    return viridis(x).map((v, c) => Math.round(metal[c] + share * (v - metal[c])));
  };
}

/** For what has a sign: 0.5 is zero. */
export const diverging = (x) => between(DIVERGING, x);

export function css([r, g, b]) {
  return `rgb(${r} ${g} ${b})`;
}
