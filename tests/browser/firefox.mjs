// The bench in Firefox: node firefox.mjs DIR PROGRAM, where DIR holds node_modules and PROGRAM is flexspline.
//
// What Chromium tests at length here goes through once: the first page, a log to its verdict, a slider to both answers.
// The last line is "test result: … N passed; N failed" and the exit code is 1 if any failed.
import { spawn } from "node:child_process";
import { mkdirSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { fileURLToPath } from "node:url";

const folder = path.resolve(process.argv[2]);
const program = path.resolve(process.argv[3]);
const project = fileURLToPath(new URL("../..", import.meta.url));
const puppeteer = createRequire(path.join(folder, "package.json"))("puppeteer-core");
const bench = path.join(folder, "firefox-folder");
rmSync(bench, { recursive: true, force: true });
for (const one of [bench, path.join(folder, "screenshots")]) mkdirSync(one, { recursive: true });

const server = spawn(program, ["serve", bench], { stdio: ["ignore", "pipe", "inherit"] });
const address = await new Promise((resolve, reject) => {
  let said = "";
  server.stdout.on("data", (bytes) => {
    said += bytes;
    const found = /http:\S+/.exec(said)?.[0];
    if (found) resolve(found);
  });
  server.on("exit", (code) => reject(new Error(`the server ended with ${code}: ${said}`)));
});
const browser = await puppeteer.launch({
  browser: "firefox",
  executablePath: process.env.FIREFOX ?? "/usr/bin/firefox-esr",
  headless: true,
});
const page = await browser.newPage();
await page.setViewport({ width: 1440, height: 900 });
const noise = [];
page.on("console", (message) => {
  if (["error", "warn"].includes(message.type())) noise.push(message.text());
});
page.on("pageerror", (error) => noise.push(String(error)));

let [passed, failed] = [0, 0];
async function check(name, body) {
  try {
    const note = await body();
    const problem = await page.evaluate(() => document.getElementById("problem").textContent);
    if (problem || noise.length) throw new Error(`${problem} ${noise.join(" | ")}`);
    passed += 1;
    console.log(`ok    ${name}${note ? `: ${note}` : ""}`);
  } catch (error) {
    failed += 1;
    console.log(`FAIL  ${name}: ${error.message}`);
  }
}
/** What the page says under a name, once `fits` is true of it. */
async function until(name, after = 0) {
  const there = (of, more) => {
    const value = document.documentElement.dataset[of];
    return value && (!more || Number(value.split(" ")[0]) > more) ? value : false;
  };
  return (await page.waitForFunction(there, { timeout: 120_000 }, name, after)).jsonValue();
}

await check("the first page opens", async () => {
  await page.goto(address);
  await until("ready");
  const ways = await page.$$eval(".cards section h2", (titles) => titles.map((title) => title.textContent));
  if (ways.length !== 4) throw new Error(`${ways}`);
  return browser.version();
});

await check("a log dropped on it leads to a verdict and a table", async () => {
  const input = await page.$("#start-log input[type=file]");
  const begun = Date.now();
  await input.uploadFile(path.join(project, "examples/csf17_100/error_vs_input.csv"));
  await page.waitForSelector("#first-rows");
  for (const [field, value] of [
    ["#ratio", "100"],
    ["#backlash", "30"],
  ]) {
    await page.type(field, value);
    await page.keyboard.press("Enter");
  }
  const verdict = await until("verdict");
  if (!/^(not_understood|fault_found|nothing_found) \d+$/.test(verdict)) throw new Error(verdict);
  await page.waitForSelector("a[download='calibrated.fxt']");
  await page.waitForSelector("#residual canvas");
  return `dropped to verdict ${Date.now() - begun} ms`;
});

await check("a slider leads to teeth, to the coarse and to the standard answer", async () => {
  await page.goto(`${new URL(address).origin}/#drive?drive=HHD-95&g=cam&torque=20`);
  const before = await until("sheet");
  const drawn = await page.$eval(".sketch", (sketch) => sketch.dataset.drawn);
  await page.focus(".field:has(#f-generator-w0_mm) input[type=range]");
  await page.keyboard.press("ArrowRight");
  await page.waitForFunction((old) => document.querySelector(".sketch").dataset.drawn !== old, {}, drawn);
  const [, coarse] = (await until("coarse", Number(before))).split(" ");
  const [, standard] = (await until("standard", Number(before))).split(" ");
  await page.waitForFunction(() => document.querySelector("#stress .drawing")?.dataset.drawn);
  const rows = await page.$$eval("#pitch tbody tr", (all) => all.map((row) => row.textContent));
  if (!rows.some((row) => /Kinematic error.*\d/.test(row))) throw new Error(rows.join("; "));
  await page.screenshot({ path: path.join(folder, "screenshots/bench-firefox.png"), fullPage: true });
  return `FEM after the key: coarse ${coarse} ms, standard ${standard} ms`;
});

await browser.close();
server.removeAllListeners("exit");
server.kill("SIGINT");
console.log(`test result: ${failed ? "FAILED" : "ok"}. ${passed} passed; ${failed} failed`);
process.exit(failed ? 1 : 0);
