// Reports in a real browser: node run.mjs DIR, where DIR holds node_modules, the reports and what report_fixtures wrote.
//
// Every check prints a line; the last lines are "test result: … N passed; N failed" and the exit code is 1 if any failed.
import { mkdirSync, readFileSync, statSync } from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { pathToFileURL } from "node:url";

const folder = path.resolve(process.argv[2]);
const need = createRequire(path.join(folder, "package.json"));
const { chromium } = need("playwright-core");
const axe = readFileSync(need.resolve("axe-core/axe.min.js"), "utf8");
const shots = path.join(folder, "screenshots");
mkdirSync(shots, { recursive: true });

const MOST_BYTES = 1_500_000;
/** Pixels of a page as it opens on a desktop, and from its top to where its picture begins. */
const MOST_HEIGHT = 5000;
const FIRST_SCREEN = 900;
/** The page opens in well below a second on an idle machine; the tests share theirs. */
const MOST_READY_MS = 8000;
/** 30 and more on an idle machine, by software. */
const LEAST_FRAMES_PER_S = 5;
const SMALLEST_FONT_PX = 12;
const PITCH = (2 * Math.PI) / 188;

let [passed, failed] = [0, 0];
async function check(name, body) {
  try {
    const note = await body();
    passed += 1;
    console.log(`ok    ${name}${note ? `: ${note}` : ""}`);
  } catch (error) {
    failed += 1;
    console.log(`FAIL  ${name}: ${error.message}`);
  }
}
function assert(condition, message) {
  if (!condition) throw new Error(message);
}
function near(found, expected, tolerance, what) {
  assert(Math.abs(found - expected) <= tolerance, `${what}: found ${found}, expected ${expected} within ${tolerance}`);
}

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: [
    ...["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking"],
    ...["--disable-component-update", "--disable-sync"],
    // All by software: the slowest that a reader may have.
    "--disable-gpu",
  ],
});

/** A report opened from its file; `noise` is whatever it said on the console or asked of the network. */
async function open(file, { width = 1440, dark = false, hash = "", script = true, before, ready = true } = {}) {
  const context = await browser.newContext({
    viewport: { width, height: 900 },
    colorScheme: dark ? "dark" : "light",
    javaScriptEnabled: script,
    isMobile: width < 600,
    hasTouch: width < 600,
    acceptDownloads: true,
  });
  const page = await context.newPage();
  const noise = [];
  page.on("console", (message) => {
    // The driver does not like that a test reads its pixels.
    if (message.text().includes("GPU stall due to ReadPixels")) return;
    if (["error", "warning"].includes(message.type())) noise.push(message.text());
  });
  page.on("pageerror", (error) => noise.push(String(error)));
  let requests = 0;
  page.on("request", (request) => {
    requests += 1;
    if (requests > 1) noise.push(`request: ${request.url().slice(0, 100)}`);
  });
  if (before) await page.addInitScript(before);
  const begun = Date.now();
  await page.goto(pathToFileURL(path.join(folder, file)).href + hash);
  if (script && ready) await page.waitForFunction(() => document.documentElement.dataset.ready);
  const readyMs = Date.now() - begun;
  // What a reader sees before anything is unfolded; then everything.
  const first = script && {
    height: await page.evaluate(() => document.documentElement.scrollHeight),
    picture: await page.evaluate(() => document.querySelector(".drawing")?.getBoundingClientRect().top ?? 0),
  };
  if (script) await page.evaluate(() => document.querySelectorAll("section details").forEach((e) => (e.open = true)));
  return {
    page,
    noise,
    first,
    readyMs,
    close: () => context.close(),
  };
}

/** How many colours a canvas shows, and a number that changes with the picture. */
const picture = (page, selector) =>
  page.locator(selector).evaluate((canvas) => {
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [canvas.width, canvas.height];
    const ctx = copy.getContext("2d");
    ctx.drawImage(canvas, 0, 0);
    const { data } = ctx.getImageData(0, 0, copy.width, copy.height);
    const colours = new Set();
    let sum = 0;
    for (let k = 0; k < data.length; k += 4) {
      const c = (data[k] << 24) | (data[k + 1] << 16) | (data[k + 2] << 8) | data[k + 3];
      colours.add(c);
      sum = (Math.imul(sum, 31) + c) | 0;
    }
    return { colours: colours.size, sum };
  });
const psi = (page) => page.locator(".drawing[data-painter]").evaluate((e) => Number(e.dataset.psi));
const settled = (page) => page.waitForTimeout(250);

// ---- Numbers

await check("packed numbers come back as they were", async () => {
  const source = readFileSync(new URL("../../host-sim/report/web/pack.js", import.meta.url), "utf8");
  const { unpack } = await import(`data:text/javascript,${encodeURIComponent(source)}`);
  const packs = JSON.parse(readFileSync(path.join(folder, "pack.json"), "utf8"));
  let count = 0;
  for (const { name, values, tolerance, ...packed } of packs) {
    const found = await unpack(packed);
    assert(found.length === values.length, `${name}: ${found.length} values instead of ${values.length}`);
    values.forEach((value, k) => {
      const expected = typeof value === "string" ? Number(value.replace("inf", "Infinity")) : value;
      const same =
        Object.is(found[k], expected) ||
        Math.abs(found[k] - expected) <= tolerance * (packed.kind === "f32" ? Math.abs(expected) : 1);
      assert(same, `${name}[${k}]: found ${found[k]}, expected ${expected}`);
    });
    count += values.length;
  }
  return `${packs.length} arrays, ${count} values`;
});

/** The drives of a report as its script has them, without a browser. */
async function motionsOf(file) {
  const web = (name) => readFileSync(new URL(`../../host-sim/report/web/${name}`, import.meta.url), "utf8");
  const linked = web("motion.js").replace(/^import .*;$/gm, "");
  const { unpack, Motion } = await import(`data:text/javascript,${encodeURIComponent(web("pack.js") + linked)}`);
  const html = readFileSync(path.join(folder, file), "utf8");
  const { animations } = JSON.parse(html.match(/id="flexspline-report">(.*?)<\/script>/s)[1]);
  const arrays = async (name) => {
    const [, kind, shape, scale, offset, text] = html.match(
      new RegExp(
        `data-name="${name}" data-kind="(.*?)" data-shape="(.*?)" data-scale="(.*?)" data-offset="(.*?)">(.*?)<`,
      ),
    );
    return { values: await unpack({ kind, scale: Number(scale), offset: Number(offset), text }), shape };
  };
  const wheel = async (name) => {
    const parts = ["nodes", "elements", "outline", "displacement", "stress"];
    const found = await Promise.all(parts.map(async (part) => [part, (await arrays(`${name}.${part}`)).values]));
    return Object.fromEntries(found);
  };
  return Promise.all(
    Object.entries(animations).map(async ([choice, description]) => {
      const [flexspline, circularSpline] = [
        await wheel(`${choice}.flexspline`),
        await wheel(`${choice}.circular-spline`),
      ];
      const forces = (await arrays(`${choice}.forces`)).values;
      return new Motion(choice, description, { flexspline, circularSpline, generator: [], forces });
    }),
  );
}

await check("the drive turns with its generator and carries its load, at any angle", async () => {
  let worst = 0;
  const motions = await motionsOf("tables/report.html");
  for (const motion of motions) {
    const { torque_n_m: torque, ratio } = motion.description;
    let leaning;
    for (const psi of [0, 0.3, 1.234, 2.9, 5, 17.7, -4.4]) {
      const name = `${motion.choice} at ${psi} rad`;
      const [count, wheel] = [motion.count(psi), motion.flexspline];
      // The second harmonic of the bore's displacement points along the major axis; the load leans it over, always alike.
      let [c, s, moment] = [0, 0, 0];
      for (let sector = 0; sector < wheel.sectors; sector++) {
        const [radial] = wheel.displaced(sector, motion.boreNode, count);
        c += radial * Math.cos(2 * sector * wheel.pitch);
        s += radial * Math.sin(2 * sector * wheel.pitch);
        for (const { kind, force, point } of motion.forcesOn(sector, count, 1)) {
          if (kind === "flank") moment += 1e-3 * (point[0] * force[1] - point[1] * force[0]);
        }
      }
      const beside = 0.5 * Math.sin(Math.atan2(s, c) - 2 * psi);
      near(beside, 0, 0.4, `${name}: major axis from the generator, rad`);
      leaning ??= beside;
      near(beside, leaning, 0.002, `${name}: the same, against generator angle 0`);
      // The drag is the rest; arrows too small to show are left out, and between frames a corner is cut.
      near(moment / torque, 1, 0.05, `${name}: moment of the flanks over the load`);
      near(motion.output(psi) - psi / ratio, 0, 0.003, `${name}: output from nominal, rad`);
      worst = Math.max(worst, Math.abs(moment / torque - 1));
    }
  }
  return `${motions.length} drives; the load is met to ${(100 * worst).toFixed(2)} %`;
});

// ---- Every report, at every size, in light and dark

for (const file of [
  "tables/report.html",
  "validate/report.html",
  "explained/report.html",
  "faults/report.html",
  "reproduce/report.html",
  "sweep/report.html",
  "simulate/report.html",
  "path/report.html",
  "hostile.html",
]) {
  const title = file.replace("/report.html", "");
  await check(`${title}: size`, () => {
    const { size } = statSync(path.join(folder, file));
    assert(size <= MOST_BYTES, `${size} bytes, at most ${MOST_BYTES}`);
    return `${Math.round(size / 1000)} kB`;
  });
  for (const [width, dark] of [
    [1440, false],
    [1440, true],
    [390, false],
    [390, true],
  ]) {
    const name = `${title} at ${width} px, ${dark ? "dark" : "light"}`;
    const { page, noise, first, readyMs, close } = await open(file, { width, dark });
    await check(`${name}: opens`, () => {
      assert(readyMs <= MOST_READY_MS, `${readyMs} ms until all is drawn, at most ${MOST_READY_MS}`);
      return `${readyMs} ms until all is drawn`;
    });
    await check(`${name}: the answer, figures and picture come first`, () => {
      const { height, picture } = first;
      assert(width < 1000 || (height <= MOST_HEIGHT && picture < FIRST_SCREEN), `${height} px, picture at ${picture}`);
      return `${height} px, picture at ${Math.round(picture)}`;
    });
    await settled(page);
    await check(`${name}: nothing wider than the page`, async () => {
      const [wide, has] = await page.evaluate(() => [
        document.documentElement.scrollWidth,
        document.documentElement.clientWidth,
      ]);
      assert(wide <= has, `${wide} px of content in ${has} px`);
    });
    await check(`${name}: text is large enough`, async () => {
      const smallest = await page.evaluate(() => {
        let least = Infinity;
        const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
        while (walk.nextNode()) {
          const element = walk.currentNode.parentElement;
          if (!walk.currentNode.data.trim() || !element.checkVisibility()) continue;
          least = Math.min(least, parseFloat(getComputedStyle(element).fontSize));
        }
        return least;
      });
      assert(smallest >= SMALLEST_FONT_PX, `${smallest} px`);
      return `${smallest} px at least`;
    });
    await check(`${name}: every figure is drawn`, async () => {
      const figures = await page.locator(".drawing:not(.empty) canvas:visible").count();
      assert(figures > 0, "no canvas");
      for (let k = 0; k < figures; k++) {
        const { colours } = await picture(page, `.drawing:not(.empty) canvas:visible >> nth=${k}`);
        assert(colours > 4, `canvas ${k} has ${colours} colours`);
      }
      return `${figures} canvases`;
    });
    await check(`${name}: axe finds nothing`, async () => {
      await page.evaluate(axe);
      const { violations } = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ["violations"] }));
      const told = violations.map(
        (v) => `${v.id} (${v.nodes.length}): ${v.nodes[0].target} ${v.nodes[0].failureSummary ?? ""}`,
      );
      assert(!told.length, told.join(" | "));
    });
    await check(`${name}: quiet, and no request`, () => assert(!noise.length, noise.join(" | ")));
    await page.screenshot({
      path: path.join(shots, `${title}-${width}-${dark ? "dark" : "light"}.png`),
      fullPage: true,
    });
    await close();
  }
}

// ---- The paper beside the model

await check("the page of reproduce answers, shows each generator and turns the drive along its error", async () => {
  const { page, noise, close } = await open("reproduce/report.html");
  const report = JSON.parse(await page.locator("#flexspline-report").textContent());
  const { counts, claims } = report.results.reproduce;
  const answer = await page.locator("h1").textContent();
  assert(
    answer.includes(`Of ${claims.length} claims`) && answer.includes(`paper ${counts.reproduced} are reproduced`),
    answer,
  );
  const verdicts = await page.locator("#claims tbody tr td:nth-child(3)").allTextContents();
  assert(verdicts.join() === claims.map((claim) => claim.verdict).join(), `verdicts ${verdicts}`);
  for (const choice of report.choices.map((c) => c.id)) {
    await page.locator(`input[name=choice][value=${choice}] + span`).click();
    await page.waitForFunction((id) => document.documentElement.dataset.ready === id, choice);
  }
  await page.locator("#ripple").scrollIntoViewIfNeeded();
  const box = await page.locator("#ripple .u-over").boundingBox();
  const before = await psi(page);
  await page.mouse.move(box.x + 0.5 * box.width, box.y + 0.5 * box.height);
  await settled(page);
  near((((await psi(page)) / PITCH) % 1) - 0.5, 0, 0.02, "pitches");
  assert((await psi(page)) !== before, "the generator stands");
  assert(!noise.length, noise.join(" | "));
  await close();
  return `${claims.length} claims`;
});

// ---- A run along a path

await check(
  "the page of a settled pitch answers, turns the drive along its error, and its numbers are those of the run",
  async () => {
    const { page, noise, close } = await open("simulate/report.html");
    const report = JSON.parse(await page.locator("#flexspline-report").textContent());
    const { wind_up_arcsec: windUp } = report.results.simulate;
    const number = (await page.locator(".number strong").textContent()).trim();
    assert(number === `${windUp.toFixed(1)}″`, `${number} instead of ${windUp}`);
    await page.locator("#units").selectOption("arcmin");
    const row = page.locator("#found tbody tr", { hasText: "Wind-up from mid-backlash" });
    near(parseFloat(await row.locator("td").first().textContent()), windUp / 60, 5e-4, "wind-up in the table, arcmin");
    await page.locator("#units").selectOption("arcsec");
    await page.locator("#ripple").scrollIntoViewIfNeeded();
    const box = await page.locator("#ripple .u-over").boundingBox();
    await page.mouse.move(box.x + 0.5 * box.width, box.y + 0.5 * box.height);
    await settled(page);
    near(((await psi(page)) / PITCH) % 1, 0.5, 0.02, "pitches");
    const rows = report.animations.cam.rows;
    const results = readFileSync(path.join(folder, "simulate/results.csv"), "utf8").trim().split("\n");
    // Three rows to a state that is shown.
    assert(3 * rows.length === results.length - 1, `${rows.length} states of ${results.length - 1} rows`);
    assert(!noise.length, noise.join(" | "));
    await close();
    return number;
  },
);

await check("the page of a path tells its ways apart, reads its map and prints", async () => {
  const { page, noise, close } = await open("path/report.html");
  for (const [figure, names] of [
    ["error", ["forward", "backward"]],
    ["torsion", ["torque growing", "torque falling", "torque growing (2)"]],
  ]) {
    await page.waitForSelector(`#${figure} .u-legend .u-marker`);
    const marks = await page.$$eval(`#${figure} .u-legend .u-series`, (all) =>
      all.slice(1).map((series) => {
        const { borderTopStyle, borderTopColor } = getComputedStyle(series.querySelector(".u-marker"));
        return [series.querySelector(".u-label").textContent, borderTopStyle, borderTopColor];
      }),
    );
    const found = marks.map(([name]) => name);
    assert(names.every((name, k) => found[k].startsWith(name)) && found.length === names.length, found.join(" | "));
    assert(marks[0][1] === "solid" && marks[1][1] === "dashed", JSON.stringify(marks));
    assert(new Set(marks.map((mark) => mark[2])).size === marks.length, "two ways have one colour");
  }
  const [download] = await Promise.all([
    page.waitForEvent("download"),
    page
      .locator("#map")
      .getByRole("button", { name: /as CSV/ })
      .click(),
  ]);
  const cells = readFileSync(await download.path(), "utf8")
    .trim()
    .split("\r\n")
    .slice(1);
  const forces = cells
    .map((line) => line.split(",")[2])
    .filter((cell) => cell !== "")
    .map(Number);
  // Flanks of both sides bear in turn, and what bears nothing has no colour.
  assert(forces.some((n) => n > 1) && forces.some((n) => n < -1), `${Math.min(...forces)} to ${Math.max(...forces)} N`);
  assert(forces.length < cells.length, "every tooth bears all the time");
  const pdf = await page.pdf({ format: "A4", path: path.join(shots, "path.pdf") });
  const pages = (pdf.toString("latin1").match(/\/Type\s*\/Page[^s]/g) ?? []).length;
  assert(pages >= 3 && pages <= 10, `${pages} pages`);
  assert(!noise.length, noise.join(" | "));
  await close();
  return `${forces.length} forces, ${pages} pages`;
});

// ---- The sleeve in three dimensions

await check(
  "the sleeve is shown deformed, by a factor that is told, turns, plays and stops, in light and dark",
  async () => {
    const grounds = [];
    for (const dark of [false, true]) {
      const { page, noise, close } = await open("sleeve/report.html", { dark });
      const report = JSON.parse(await page.locator("#flexspline-report").textContent());
      const { sleeve } = report.animations.cam;
      const stage = page.locator("#sleeve .stage");
      await stage.scrollIntoViewIfNeeded();
      const canvas = "#sleeve .stage canvas";
      assert((await picture(page, canvas)).colours > 100, "it is not drawn");
      // The amplitude that the FEM has of the wave is what stands on the page: a cam of w0 = 0.5 mm.
      const oval = sleeve.waves.find((wave) => wave.n === 2);
      near(Math.hypot(...oval.amplitudes_mm), 0.5, 0.03, "amplitude of the oval, mm");
      near(oval.amplitudes_mm[0] / Math.hypot(...oval.amplitudes_mm), 1, 0.01, "along the major axis");
      const middle = sleeve.stations_mm.indexOf(0);
      near(oval.outward[middle], 1, 1e-3, "outward in the middle of the rim");
      const drawing = page.locator("#sleeve .drawing");
      const state = async () => {
        const { angle, factor } = await drawing.evaluate((e) => ({ ...e.dataset }));
        return [Number(angle), Number(factor)];
      };
      const told = await page.locator("#sleeve .readout").textContent();
      assert(told.includes(`Displacements ${(await page.locator("#sleeve .times").textContent()).trim()} times`), told);
      assert(told.includes(`tilt by up to ${sleeve.tilt_mrad.toFixed(2)} mrad`) && told.includes("peak"), told);
      const [, factor] = await state();
      await stage.focus();
      let before = await picture(page, canvas);
      for (const key of ["ArrowLeft", "ArrowUp", "+", "PageUp"]) {
        await page.keyboard.press(key);
        await settled(page);
        const after = await picture(page, canvas);
        assert(after.sum !== before.sum, `${key} changes nothing`);
        before = after;
      }
      near((await state())[1] / factor, 1.25, 0.01, "plus");
      near((await state())[0], Math.PI / 24, 1e-3, "page up");
      await page.keyboard.press(" ");
      await settled(page);
      const [playing] = await state();
      await settled(page);
      assert((await state())[0] > playing, "it does not play");
      await page.locator("#sleeve .play").click();
      const [stopped] = await state();
      await settled(page);
      assert((await state())[0] === stopped, "it does not stop");
      grounds.push(
        await page
          .locator(canvas)
          .evaluate((e) => [...e.getContext("2d").getImageData(2, e.height - 2, 1, 1).data].join()),
      );
      await page.locator("#sleeve").screenshot({ path: path.join(shots, `sleeve-${dark ? "dark" : "light"}.png`) });
      await page.evaluate(axe);
      const { violations } = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ["violations"] }));
      assert(!violations.length, violations.map((v) => v.id).join());
      assert(!noise.length, noise.join(" | "));
      await close();
    }
    assert(grounds[0] !== grounds[1], `dark as light: ${grounds}`);
    const bytes = statSync(path.join(folder, "sleeve/report.html")).size;
    assert(bytes < MOST_BYTES, `${bytes} bytes`);
    return `${bytes} bytes`;
  },
);

// ---- Words and numbers

{
  const { page, close } = await open("hostile.html");
  await check("hostile text stays text", async () => {
    assert(!(await page.evaluate(() => globalThis.hacked)), "a script of the data ran");
    assert((await page.locator("img").count()) === 0, "an element of the data is on the page");
    assert((await page.title()).startsWith("</script></title>"), `title ${await page.title()}`);
    const heading = await page.locator("h1").textContent();
    assert(heading.includes("<script>window.hacked=1</script>&amp;'{{7*7}}<!--"), heading);
  });
  await check("the status is stamped and in the JSON", async () => {
    const json = JSON.parse(await page.locator("#flexspline-report").textContent());
    assert(json.status === "bound missed" && json.remarks.length === 1, JSON.stringify(json.status));
    const stamps = await page.locator(".stamp").allTextContents();
    assert(stamps.join() === "bound missed,data faults", `stamps ${stamps}`);
    assert(await page.locator(".remarks").isVisible(), "no remark");
  });
  await close();
}

const { page, noise, close } = await open("tables/report.html");

await check("a drive without a sleeve has no such figure", async () => {
  assert((await page.locator("#sleeve").count()) === 0, "it has one");
});

const report = JSON.parse(await page.locator("#flexspline-report").textContent());
const choices = report.choices.map((c) => c.id);

await check("the JSON block says what made the page", () => {
  assert(report.schema_version === 1 && report.report === "tables", "schema or report");
  assert(report.results.tables.length === choices.length, "one result to each table");
  for (const table of report.results.tables) {
    assert(/^[0-9a-f]{16}$/.test(table.table_id), `table_id ${table.table_id}`);
    assert(Object.values(report.provenance).includes(table.table_id), "table_id is not in the provenance");
    assert(table.fresh_fem_max_arcsec < 2, `${table.generator} misses FEM by ${table.fresh_fem_max_arcsec}`);
  }
  assert(report.provenance.Command.startsWith("flexspline tables"), report.provenance.Command);
  return `status ${report.status}`;
});

await check("the selector changes what is shown", async () => {
  const last = choices.at(-1);
  await page.locator(`input[name=choice][value=${last}] + span`).click();
  await page.waitForFunction((id) => document.documentElement.dataset.ready === id, last);
  const shown = await page.locator(".headline:visible").count();
  assert(shown === 1, `${shown} headlines`);
  const drawn = await page
    .locator(".drawing:not(.empty):has(canvas)")
    .evaluateAll((all) => all.map((e) => e.dataset.drawn));
  assert(
    drawn.every((d) => d === last),
    `drawn: ${drawn}`,
  );
});

await check("units change in text, charts and tables", async () => {
  const number = page.locator(".headline:visible .number data");
  const inArcsec = Number(await number.getAttribute("value"));
  const read = async () => Number((await number.textContent()).replace("−", "-").match(/-?[\d.]+/)[0]);
  const figure = page.locator("#wind-up");
  await figure.getByRole("button", { name: /as a table/ }).click();
  const cell = figure.locator(".numbers tbody tr:first-child td").nth(1);
  await cell.waitFor();
  const inTable = async () => Number((await cell.textContent()).replace("−", "-"));
  const title = () => figure.locator(".numbers thead th").nth(1).textContent();
  near(await read(), inArcsec, 0.02 * Math.abs(inArcsec), "arcsec");
  const before = [await inTable(), await picture(page, "#wind-up canvas")];
  await page.locator("#units").selectOption("urad");
  await settled(page);
  const factor = Math.PI / 0.648;
  near(await read(), inArcsec * factor, 0.02 * Math.abs(inArcsec * factor), "µrad");
  near(await inTable(), before[0] * factor, Math.abs(1e-3 * before[0] * factor), "table");
  assert((await title()).endsWith("µrad"), await title());
  const after = await picture(page, "#wind-up canvas");
  assert(after.sum !== before[1].sum, "the chart is as it was");
  await page.locator("#units").selectOption("arcsec");
  await settled(page);
});

await check("CSV holds every row", async () => {
  const [download] = await Promise.all([
    page.waitForEvent("download"),
    page.locator("#ripple").getByRole("button", { name: /CSV/ }).click(),
  ]);
  const text = readFileSync(await download.path(), "utf8");
  const lines = text.trim().split("\r\n");
  assert(lines[0].includes("arcsec") && lines[0].includes("forward"), lines[0]);
  assert(lines.length > 40, `${lines.length} lines`);
  assert(
    lines.slice(1).every((line) => line.split(",").every((c) => c === "" || Number.isFinite(Number(c)))),
    "not numbers",
  );
  return `${download.suggestedFilename()}, ${lines.length} lines`;
});

// ---- The drive

await check("the drive is drawn, wheels and what is over them", async () => {
  for (const canvas of ["canvas.wheels", "canvas.over"]) {
    const { colours } = await picture(page, canvas);
    assert(colours > 30, `${canvas}: ${colours} colours`);
  }
});

await check("scrubbing turns the generator, and the chart's cursor", async () => {
  const before = await picture(page, "canvas.wheels");
  await page.locator(".scrub").fill("12.35");
  await settled(page);
  near(await psi(page), (12.35 * Math.PI) / 180, 1e-6, "generator");
  assert((await picture(page, "canvas.wheels")).sum !== before.sum, "the picture is as it was");
  const cursor = Number(await page.locator("#ripple .uplot").getAttribute("data-cursor"));
  near(cursor, 12.35 % ((PITCH * 180) / Math.PI), 1e-3, "cursor");
});

await check("pointing along the error curve turns the generator", async () => {
  await page.locator("#ripple").scrollIntoViewIfNeeded();
  const box = await page.locator("#ripple .u-over").boundingBox();
  const pitches = Math.floor((await psi(page)) / PITCH + 1e-9);
  const found = [];
  for (const share of [0.3, 0.6]) {
    await page.mouse.move(box.x + share * box.width, box.y + 0.5 * box.height);
    await settled(page);
    found.push((await psi(page)) / PITCH - pitches);
  }
  near(found[0], 0.3, 0.01, "pitches");
  near(found[1], 0.6, 0.01, "pitches");
});

await check("keys turn, scale and play", async () => {
  const stage = page.locator(".stage");
  await stage.focus();
  const before = await psi(page);
  await page.keyboard.press("ArrowRight");
  await settled(page);
  near(await psi(page), before + PITCH / 8, 1e-5, "arrow");
  await page.keyboard.press("PageDown");
  await settled(page);
  near(await psi(page), before + (9 / 8) * PITCH, 1e-5, "page down");
  const shown = await picture(page, "canvas.wheels");
  await page.keyboard.press("+");
  await settled(page);
  assert((await page.locator(".times").textContent()) === "1.3", await page.locator(".times").textContent());
  assert((await picture(page, "canvas.wheels")).sum !== shown.sum, "the scaled picture is the same");
  await page.keyboard.press("0");
  await page.keyboard.press(" ");
  assert((await page.locator(".play").textContent()) === "Pause", "does not play");
  await page.keyboard.press(" ");
});

await check("displacements are scaled up to 50 times", async () => {
  const before = await picture(page, "canvas.wheels");
  await page.locator(".exaggeration").fill("100");
  await settled(page);
  assert((await page.locator(".times").textContent()) === "50", await page.locator(".times").textContent());
  assert((await picture(page, "canvas.wheels")).sum !== before.sum, "the picture is as it was");
  assert((await page.locator("#drive .readout").textContent()).includes("exaggerated"), "it does not say so");
  await page.locator(".exaggeration").fill("0");
});

await check("the close view goes where the whole drive is pointed at", async () => {
  const before = await picture(page, "canvas.wheels");
  const box = await page.locator(".stage").boundingBox();
  await page.locator(".scrub").fill("0");
  await page.locator(".stage").click({ position: { x: box.height * 0.78, y: box.height * 0.22 } });
  await settled(page);
  near(parseFloat(await page.locator(".looking").textContent()), 45, 1, "degrees from the major axis");
  assert((await picture(page, "canvas.wheels")).sum !== before.sum, "the picture is as it was");
  await page.locator(".look").fill("0");
});

await check("forces and mesh can be shown and hidden", async () => {
  for (const [box, canvas] of [
    [".forces", "canvas.over"],
    [".mesh", "canvas.wheels"],
  ]) {
    await settled(page);
    const before = await picture(page, canvas);
    await page.locator(box).click();
    await settled(page);
    assert((await picture(page, canvas)).sum !== before.sum, box);
    await page.locator(box).click();
  }
});

/** Frames drawn in a few seconds of play. */
async function framesPerSecond(page) {
  await page.locator(".stage").scrollIntoViewIfNeeded();
  await page.locator(".play").click();
  await page.waitForTimeout(500);
  const count = () => page.locator(".drawing[data-painter]").evaluate((e) => Number(e.dataset.frames));
  const [first, begun] = [await count(), Date.now()];
  await page.waitForTimeout(3000);
  const rate = ((await count()) - first) / ((Date.now() - begun) / 1000);
  await page.locator(".play").click();
  return rate;
}
await check("it plays", async () => {
  const before = await psi(page);
  const rate = await framesPerSecond(page);
  assert((await psi(page)) > before, "the generator stands");
  assert(rate >= LEAST_FRAMES_PER_S, `${rate.toFixed(1)} frames/s, at least ${LEAST_FRAMES_PER_S}`);
  return `${rate.toFixed(1)} frames/s by software, both views`;
});

await check("a tooth pitch on, the picture is the same, turned by a tooth", async () => {
  // The close view turns with the generator, so there it is the same to the pixel but for where a pixel is rounded.
  const close = () =>
    page.locator("canvas.wheels").evaluate((canvas) => {
      const left = canvas.height;
      const copy = document.createElement("canvas");
      [copy.width, copy.height] = [canvas.width - left, canvas.height];
      const ctx = copy.getContext("2d");
      ctx.drawImage(canvas, -left, 0);
      return Array.from(ctx.getImageData(0, 0, copy.width, copy.height).data.filter((_, k) => k % 4 === 1));
    });
  const at = async (pitches) => {
    await page.locator(".stage").focus();
    await page.keyboard.press("Home");
    for (let k = 0; k < pitches; k++) await page.keyboard.press("PageDown");
    for (let k = 0; k < 3; k++) await page.keyboard.press("ArrowRight");
    await settled(page);
    return close();
  };
  const [a, b] = [await at(0), await at(5)];
  const differ = a.filter((v, k) => Math.abs(v - b[k]) > 40).length / a.length;
  assert(differ < 0.005, `${(100 * differ).toFixed(2)} % of the pixels differ`);
  await page.keyboard.press("ArrowRight");
  await settled(page);
  const other = await close();
  const moved = a.filter((v, k) => Math.abs(v - other[k]) > 40).length / a.length;
  assert(moved > 4 * differ && moved > 0.002, `an eighth of a pitch moves ${(100 * moved).toFixed(2)} %`);
  return `${(100 * differ).toFixed(3)} % differ; after an eighth of a pitch ${(100 * moved).toFixed(2)} %`;
});

await check("prints", async () => {
  const pdf = await page.pdf({
    format: "A4",
    path: path.join(shots, "tables.pdf"),
  });
  const pages = (pdf.toString("latin1").match(/\/Type\s*\/Page[^s]/g) ?? []).length;
  assert(pages >= 3 && pages <= 14, `${pages} pages`);
  assert(pdf.length > 100_000, `${pdf.length} bytes`);
  return `${pages} pages, ${Math.round(pdf.length / 1000)} kB`;
});
await check("all this made no noise", () => assert(!noise.length, noise.join(" | ")));
await close();

await check("a link opens its generator at its figure", async () => {
  const choice = choices.at(-1);
  const opened = await open("tables/report.html", {
    hash: `#${choice}/sharing`,
  });
  await settled(opened.page);
  assert((await opened.page.evaluate(() => document.documentElement.dataset.chosen)) === choice, "other generator");
  const top = (await opened.page.locator("#sharing").boundingBox()).y;
  assert(top > -10 && top < 880, `figure at ${top} px`);
  await opened.close();
});

// ---- The page of a diagnosis

{
  const { page, noise, readyMs, close } = await open("explained/report.html");
  const report = JSON.parse(await page.locator("#flexspline-report").textContent());
  const { diagnosis } = report.results;
  await check("a diagnosis answers in one sentence and one number", async () => {
    const heading = await page.locator("h1").textContent();
    const number = await page.locator(".number strong").first().textContent();
    // What the table that is written gains.
    const { rms_nominal_tables_arcsec: before, rms_calibrated_table_arcsec: after } = diagnosis.compensation;
    const twoDigits = (v) => `${v.toFixed(Math.max(0, 1 - Math.floor(Math.log10(v))))}″`;
    const due = `${twoDigits(before)} → ${twoDigits(after)}`;
    assert(heading.startsWith("Explained by eccentricity of the output encoder ("), heading);
    assert(number.trim() === due, `${number} instead of ${due}`);
    const box = await page.locator(".number").boundingBox();
    assert(box.y + box.height < 900, "not on the first screen");
    return `${heading} ${number}, after ${readyMs} ms`;
  });
  await check("the selector takes the causes away from every figure of the picture", async () => {
    // Rms of the rows that are drawn, by the table of the figure.
    const figure = page.locator("#over-generator");
    await figure.getByRole("button", { name: /as a table/ }).click();
    const spread = async () => {
      await settled(page);
      const cells = await figure.locator(".numbers tbody tr td:not(:first-child)").allTextContents();
      const values = cells.map((cell) => Number(cell.replace("−", "-"))).filter(Number.isFinite);
      assert(values.length > 10, `${values.length} numbers in the table`);
      return Math.sqrt(values.reduce((sum, v) => sum + v * v, 0) / values.length);
    };
    const before = [await spread(), (await picture(page, "#map canvas")).sum];
    await page.locator("input[name=choice][value=extended] + span").click();
    await page.waitForFunction(() => document.documentElement.dataset.ready === "extended");
    const after = [await spread(), (await picture(page, "#map canvas")).sum];
    assert(after[0] < 0.5 * before[0], `rms ${before[0]} to ${after[0]}`);
    assert(after[1] !== before[1], "the map is as it was");
    const titles = await page.locator("figcaption .of-choice").allTextContents();
    assert(titles.some((t) => t === ", with the causes") && titles.some((t) => t === ""), titles.join("|"));
    return `rms of the rows shown ${before[0].toFixed(1)}″ to ${after[0].toFixed(1)}″`;
  });
  await check("what is the same for all choices stays, and its numbers can be had", async () => {
    const [download] = await Promise.all([
      page.waitForEvent("download"),
      page
        .locator("#over-time")
        .getByRole("button", { name: /as CSV/ })
        .click(),
    ]);
    const text = readFileSync(await download.path(), "utf8")
      .trim()
      .split("\r\n");
    assert(text[0].split(",").length >= 4, text[0]);
    assert(text.length > 500, `${text.length} lines`);
    // Between sessions the line breaks: a row without values.
    const broken = text.filter((line) => /^[^,]+(,)+$/.test(line)).length;
    const sessions = await page.locator("#data .table tbody tr").count();
    assert(broken === sessions - 1, `${broken} breaks for ${sessions} sessions`);
    return `${text.length - 1} rows`;
  });
  await check("a diagnosis prints", async () => {
    const pdf = await page.pdf({ format: "A4", path: path.join(shots, "diagnosis.pdf") });
    const pages = (pdf.toString("latin1").match(/\/Type\s*\/Page[^s]/g) ?? []).length;
    assert(pages >= 5 && pages <= 24, `${pages} pages`);
    return `${pages} pages`;
  });
  await check("a diagnosis makes no noise", () => assert(!noise.length, noise.join(" | ")));
  await close();
  const linked = await open("explained/report.html", { hash: "#recalibrated/over-torque" });
  await check("a link opens a level at a figure", async () => {
    await settled(linked.page);
    const chosen = await linked.page.evaluate(() => document.documentElement.dataset.chosen);
    const top = (await linked.page.locator("#over-torque").boundingBox()).y;
    assert(chosen === "recalibrated" && top > -10 && top < 880, `${chosen} at ${top} px`);
  });
  await linked.close();
  const faults = await open("faults/report.html");
  await check("faults of the data are stamped and in a table", async () => {
    const stamps = await faults.page.locator(".stamp").allTextContents();
    assert(stamps.includes("data faults"), stamps.join());
    assert((await faults.page.locator(".remarks li").count()) > 0, "no remark");
    const caption = faults.page.locator("#data caption", { hasText: "Faults of the data" });
    assert(await caption.isVisible(), "no table");
  });
  await faults.close();
  const still = await open("explained/report.html", { script: false });
  await check("a diagnosis reads without scripts", async () => {
    const heading = await still.page.locator("h1").textContent();
    assert(heading.startsWith("Explained by eccentricity of the output encoder ("), heading);
    assert(await still.page.locator("noscript p").first().isVisible(), "it does not say that figures need scripts");
    const tables = await still.page.locator("main table").count();
    assert(tables >= 5, `${tables} tables`);
    return `${tables} tables`;
  });
  await still.close();
}

// ---- Browsers that have less

await check("a legend tells marks apart", async () => {
  const { page, close } = await open("sweep/report.html");
  await page.waitForSelector("#trade .u-legend .u-marker");
  const marks = await page.$$eval("#trade .u-legend .u-marker", (all) =>
    all.map((mark) => {
      const { borderTopStyle, borderTopColor, backgroundColor } = getComputedStyle(mark);
      return [borderTopStyle, borderTopColor, backgroundColor].join(" ");
    }),
  );
  await close();
  const series = marks.slice(-3);
  assert(new Set(series).size === 3, series.join(" | "));
  assert(
    series.every((mark) => mark.startsWith("dotted")),
    series.join(" | "),
  );
});

await check("paper holds every generator", async () => {
  const { page, close } = await open("tables/report.html");
  const seen = () =>
    page.evaluate(() => ({
      headlines: [...document.querySelectorAll(".headline")].filter((e) => e.offsetParent).length,
      shown: [...document.querySelectorAll("[data-choice]")].filter((e) => e.offsetParent).length,
      named: getComputedStyle(document.querySelector(".headline"), "::before").content,
    }));
  const before = await seen();
  assert(before.headlines === 1, `on the screen ${JSON.stringify(before)}`);
  await page.emulateMedia({ media: "print" });
  await page.evaluate(() => dispatchEvent(new Event("beforeprint")));
  const paper = await seen();
  assert(paper.headlines === choices.length, `${paper.headlines} headlines on paper`);
  assert(paper.shown > before.shown, `${paper.shown} texts and tables on paper, ${before.shown} on the screen`);
  assert(paper.named.includes("roller"), `a headline is called ${paper.named}`);
  await page.evaluate(() => dispatchEvent(new Event("afterprint")));
  await page.emulateMedia({ media: "screen" });
  const after = await seen();
  await close();
  assert(after.headlines === 1 && after.shown === before.shown, `afterwards ${JSON.stringify(after)}`);
  return `${paper.shown} texts and tables`;
});

await check("metal without stress stands out from what is between teeth", async () => {
  const notes = [];
  for (const dark of [false, true]) {
    const { page, close } = await open("tables/report.html", { dark });
    const contrast = await page.evaluate(() => {
      const style = getComputedStyle(document.documentElement);
      const light = (name) => {
        const hex = style.getPropertyValue(name).trim();
        const [r, g, b] = [1, 3, 5]
          .map((k) => parseInt(hex.slice(k, k + 2), 16) / 255)
          .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
        return 0.2126 * r + 0.7152 * g + 0.0722 * b + 0.05;
      };
      const [a, b] = [light("--unstressed"), light("--card")];
      return Math.max(a, b) / Math.min(a, b);
    });
    // The ring at the top of the whole drive bears nothing: it is drawn in that colour.
    const shown = await page.evaluate(() => {
      const wheels = document.querySelector(".stage canvas");
      const copy = document.createElement("canvas");
      [copy.width, copy.height] = [wheels.width, wheels.height];
      const ctx = copy.getContext("2d");
      ctx.drawImage(wheels, 0, 0);
      const hex = getComputedStyle(document.documentElement).getPropertyValue("--unstressed").trim();
      const due = [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));
      const { data } = ctx.getImageData(0, 0, copy.width, copy.height);
      let near = 0;
      for (let k = 0; k < data.length; k += 4) {
        if (due.every((v, c) => Math.abs(v - data[k + c]) < 12) && data[k + 3] > 200) near += 1;
      }
      return (4 * near) / data.length;
    });
    await close();
    assert(contrast >= 3, `contrast ${contrast.toFixed(2)}`);
    assert(shown > 0.05, `${(100 * shown).toFixed(1)} % of the picture is bare metal`);
    notes.push(`${contrast.toFixed(1)} : 1`);
  }
  return notes.join(" light, ") + " dark";
});

await check("a phone shows whole captions and what a table leaves", async () => {
  const { page, close } = await open("tables/report.html", { width: 375 });
  const [caption, left] = await page.evaluate(() => {
    const box = document.querySelector("#comparison .table");
    const column = [...box.querySelectorAll("thead th")].find((th) => th.textContent.startsWith("Residual with table"));
    return [box.querySelector("caption span"), column].map((e) => e.getBoundingClientRect().right);
  });
  await close();
  assert(caption <= 375, `a caption ends at ${caption} px`);
  assert(left <= 375, `the column that matters ends at ${left} px`);
});

await check("without DecompressionStream it says so", async () => {
  const old = await open("tables/report.html", {
    before: () => delete globalThis.DecompressionStream,
    ready: false,
  });
  const words = await old.page.locator("#problem").textContent();
  assert(words.includes("Chrome 103") && (await old.page.locator("#problem").isVisible()), words);
  await old.close();
});

await check("without scripts there is all text", async () => {
  const still = await open("tables/report.html", { script: false });
  assert((await still.page.locator(".headline").count()) === choices.length, "headlines");
  const rows = await still.page.locator("#comparison tbody tr").count();
  assert(rows === choices.length, `${rows} rows of the comparison`);
  assert(await still.page.locator("noscript p").first().isVisible(), "it does not say that figures need scripts");
  await still.page.screenshot({
    path: path.join(shots, "noscript.png"),
  });
  await still.close();
  return `${rows} rows`;
});

await browser.close();
console.log(`\ntest result: ${failed ? "FAILED" : "ok"}. ${passed} passed; ${failed} failed`);
process.exit(failed ? 1 : 0);
