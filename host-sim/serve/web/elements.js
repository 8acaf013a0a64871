// Elements of the page, made of words and values: text is always text.
import { written } from "./quantities.js";

/** An element: `props` are attributes, `on` listeners by event, `text` its words; children are elements or words. */
export function el(tag, props = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (value === undefined || value === null || value === false) continue;
    if (name === "text") element.textContent = value;
    else if (name === "on")
      for (const [event, listener] of Object.entries(value)) element.addEventListener(event, listener);
    else if (name === "value" && tag !== "data") element.value = value;
    else if (name === "checked") element.checked = true;
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

export function button(text, listener, props = {}) {
  return el("button", { type: "button", text, on: { click: listener }, ...props });
}

/** A select; `options` are values or [value, words]. */
export function select(options, value, listener, props = {}) {
  const all = options.map((option) => {
    const [of, words] = Array.isArray(option) ? option : [option, option];
    return el("option", { value: of, text: words });
  });
  const made = el("select", { on: { change: () => listener(made.value) }, ...props }, ...all);
  made.value = value;
  return made;
}

/** A table; `head` are words, rows are words or elements, the first of each its heading. Columns of words stand to the left. */
export function table(caption, head, rows, props = {}) {
  const isWords = (k) =>
    rows.some((row) =>
      typeof row[k] !== "string" ? row[k] instanceof HTMLElement && row[k].tagName !== "DATA" : /^[a-z]/i.test(row[k]),
    );
  const kind = head.map((_, k) => (isWords(k) ? "words" : null));
  const cell = (content, k) => el(k ? "td" : "th", { class: kind[k], ...(k ? {} : { scope: "row" }) }, content ?? "–");
  const title = (words, k) => (words ? el("th", { scope: "col", class: kind[k], text: words }) : el("td"));
  return el(
    "div",
    { class: "table", tabindex: 0, role: "region", "aria-label": caption },
    el(
      "table",
      props,
      el("caption", {}, el("span", { text: caption })),
      el("thead", {}, el("tr", {}, ...head.map(title))),
      el("tbody", {}, ...rows.map((row) => el("tr", {}, ...row.map(cell)))),
    ),
  );
}

/** A section under a title. */
export function section(id, title, ...children) {
  return el("section", { id }, el("h2", { text: title }), ...children);
}

/** An error that follows the unit switch, from arcsec. */
export function errorOf(arcsec, digits = 3) {
  if (typeof arcsec !== "number") return "–";
  const text = written(arcsec, "error", digits);
  return el("data", { class: "error", value: String(arcsec), "data-digits": digits, text });
}

/** A number to significant digits. */
export function number(value, digits = 3) {
  if (typeof value !== "number" || !Number.isFinite(value)) return "–";
  if (value !== 0 && (Math.abs(value) >= 1e6 || Math.abs(value) < 1e-3)) return value.toExponential(digits - 1);
  const places = value === 0 ? 0 : Math.max(0, digits - 1 - Math.floor(Math.log10(Math.abs(value))));
  return value.toFixed(Math.min(6, places)).replace("-", "−");
}

/** Calls `work` once nothing has asked for it for so many milliseconds. */
export function calm(ms, work) {
  let waiting = 0;
  return (...args) => {
    clearTimeout(waiting);
    waiting = setTimeout(() => work(...args), ms);
  };
}

/** A command with a button that copies it. */
export function commandLine(command) {
  const copy = button(
    "Copy",
    async () => {
      await navigator.clipboard.writeText(command).catch(() => undefined);
      copy.textContent = "Copied";
      setTimeout(() => (copy.textContent = "Copy"), 1500);
    },
    { "aria-label": `Copy the command ${command.slice(0, 60)}` },
  );
  return el("p", { class: "command" }, el("code", { text: command }), " ", copy);
}
