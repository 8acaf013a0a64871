// What values mean: their units, how they are written, and the switch of the angle units.

const ANGLES = {
  arcsec: { factor: 1, sign: "″", name: "arcsec" },
  arcmin: { factor: 1 / 60, sign: "′", name: "arcmin" },
  urad: { factor: Math.PI / 0.648, sign: " µrad", name: "µrad" },
};

/** Units of everything that is not a small angle. */
const PLAIN = {
  degree: "°",
  torque: "N·m",
  stress: "MPa",
  force: "N",
  temperature: "°C",
  count: "",
  whole: "",
  second: "s",
  turn: "turns",
  speed: "rad/s",
};

let angle = "arcsec";
const listeners = new Set();

/** Calls `listener` whenever the angle unit changes. */
export function onUnits(listener) {
  listeners.add(listener);
}

export function setUnits(name) {
  if (!ANGLES[name] || name === angle) return;
  angle = name;
  writeNumbers(document);
  for (const listener of listeners) listener();
}

/** Factor from what the page stores (arcsec for small angles) to what is shown. */
export function factor(quantity) {
  return quantity === "error" ? ANGLES[angle].factor : 1;
}

export function unit(quantity) {
  return quantity === "error" ? ANGLES[angle].name : PLAIN[quantity];
}

/** An axis title. */
export function titled(label, quantity) {
  const u = unit(quantity);
  return u ? `${label}, ${u}` : label;
}

/** A stored value as text; `digits` are significant ones. */
export function written(value, quantity, digits = 4, withUnit = true) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  const shown = value * factor(quantity);
  const size = Math.abs(shown);
  const decimals = size === 0 ? 0 : Math.max(0, Math.min(6, digits - 1 - Math.floor(Math.log10(size))));
  const text = shown.toFixed(decimals).replace("-", "−");
  if (!withUnit) return text;
  if (quantity === "error") return text + ANGLES[angle].sign;
  const u = PLAIN[quantity];
  return u === "°" || !u ? text + u : `${text} ${u}`;
}

/** Writes every number of the text in the units chosen. */
export function writeNumbers(root) {
  for (const element of root.querySelectorAll("data.error")) {
    element.textContent = written(Number(element.value), "error", Number(element.dataset.digits));
  }
}
