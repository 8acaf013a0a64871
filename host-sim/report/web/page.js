// The page at work: what is chosen is shown; units, links, print.
import { EVERY, lineChart } from "./charts.js";
import { driveViewer } from "./drive.js";
import { fieldMap } from "./fields.js";
import { canInflate } from "./pack.js";
import { setUnits } from "./quantities.js";
import { sleeveViewer } from "./sleeve.js";

const report = JSON.parse(document.getElementById("flexspline-report").textContent);
const root = document.documentElement;

function complain(text) {
  const problem = document.getElementById("problem");
  problem.textContent = text;
  problem.hidden = false;
}

/** What the address asks for: #choice, #figure or #choice/figure. */
function asked() {
  const parts = decodeURIComponent(location.hash.slice(1)).split("/");
  const known = report.choices.map((c) => c.id);
  return { choice: parts.find((p) => known.includes(p)), anchor: parts.find((p) => p && !known.includes(p)) };
}

async function start() {
  root.classList.add("scripted");
  const views = [];
  for (const place of document.querySelectorAll(".drawing")) {
    const id = place.dataset.figure;
    const spec = report.figures[id];
    if (spec.kind === "drive") views.push(driveViewer(place, report.animations));
    if (spec.kind === "sleeve") views.push(sleeveViewer(place, report.animations));
    if (spec.kind === "svg") place.innerHTML = spec.svg;
    if (spec.kind === "lines") views.push(lineChart(place, id, spec));
    if (spec.kind === "field") views.push(fieldMap(place, id, spec));
  }

  async function choose(id) {
    const { name } = report.choices.find((c) => c.id === id);
    for (const element of document.querySelectorAll("[data-choice]")) element.hidden = element.dataset.choice !== id;
    if (report.choices.length > 1) {
      for (const element of document.querySelectorAll(".of-choice")) {
        const { charts } = report.figures[element.closest("figure").id];
        element.textContent = Object.hasOwn(charts ?? {}, EVERY) ? "" : `, ${name}`;
      }
      for (const link of document.querySelectorAll(".tools a")) {
        link.hash = `${id}/${link.closest("figure").id}`;
      }
      for (const input of document.querySelectorAll("input[name=choice]")) input.checked = input.value === id;
    }
    root.dataset.chosen = id;
    // Side by side: inflating is what takes time, and it does not take the page's.
    await Promise.all(views.map((view) => view.choose(id)));
    root.dataset.ready = id;
  }

  /** Paper holds the words and tables of every choice, each under its name; figures are those of the one that is shown. */
  function onPaper(printing) {
    for (const element of document.querySelectorAll("[data-choice]")) {
      element.hidden = !printing && element.dataset.choice !== root.dataset.chosen;
    }
  }

  function goTo(anchor) {
    const target = anchor && document.getElementById(anchor);
    if (!target) return;
    target.closest("details")?.setAttribute("open", "");
    target.scrollIntoView();
  }

  for (const input of document.querySelectorAll("input[name=choice]")) {
    input.addEventListener("change", () => choose(input.value));
  }
  const units = document.getElementById("units");
  units.addEventListener("change", () => setUnits(units.value));
  addEventListener("hashchange", async () => {
    const { choice, anchor } = asked();
    if (choice && choice !== root.dataset.chosen) await choose(choice);
    goTo(anchor);
  });

  if (report.choices.length > 1) {
    for (const element of document.querySelectorAll("[data-choice]")) {
      element.dataset.of = report.choices.find((c) => c.id === element.dataset.choice).name;
    }
    addEventListener("beforeprint", () => onPaper(true));
    addEventListener("afterprint", () => onPaper(false));
  }
  // A browser that remembers forms may come back with another unit than the text has.
  setUnits(units.value);
  const { choice, anchor } = asked();
  await choose(choice ?? report.choices[0].id);
  goTo(anchor);
}

if (canInflate()) {
  start().catch((error) => complain(`The figures could not be drawn: ${error.message}`));
} else {
  complain(
    "This browser cannot inflate the numbers of this page (DecompressionStream with deflate-raw): " +
      "Chrome 103, Firefox 113, Safari 16.4 and later can. Text and tables are complete.",
  );
}
