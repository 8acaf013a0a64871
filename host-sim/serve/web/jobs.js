// Jobs as the server has them: followed while the page is open, shown at its foot.
import { addJob, cancelJob, jobsAfter } from "./api.js";
import { button, commandLine, el } from "./elements.js";

/** Jobs by number. */
export const jobs = new Map();
const listeners = new Set();
let revision = 0;

const WORDS = {
  waiting: "waits",
  running: "runs",
  done: "done",
  failed: "failed",
  cancelled: "cancelled",
  interrupted: "interrupted",
};

export const isOver = (job) => !["waiting", "running"].includes(job.state);

/** Calls `listener(job)` for each job that changes, and says how to stop that. */
export function onJob(listener) {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

function take(job) {
  const before = jobs.get(job.id);
  if (before && JSON.stringify(before) === JSON.stringify(job)) return;
  jobs.set(job.id, job);
  for (const listener of listeners) listener(job);
}

/** Asks again and again what has changed; `lost` is told when the server does not answer, and null when it does. */
export async function follow(lost) {
  for (;;) {
    try {
      const seen = await jobsAfter(revision);
      revision = seen.revision;
      const there = new Set(seen.jobs.map((job) => job.id));
      for (const id of jobs.keys()) if (!there.has(id)) jobs.delete(id);
      seen.jobs.toReversed().forEach(take);
      lost(null);
      show();
    } catch (error) {
      revision = 0;
      lost(error);
      await new Promise((again) => setTimeout(again, 1000));
    }
  }
}

/** Puts work in its line; resolves when it is over, with the job. `seen` is told of it meanwhile. */
export async function run(work, seen = () => undefined) {
  const added = await addJob(work);
  take(added);
  seen(added);
  show();
  return over(added.id, seen);
}

/** Resolves with a job when it is over. */
export function over(id, seen = () => undefined) {
  return new Promise((resolve) => {
    const look = (job) => {
      if (job.id !== id) return;
      seen(job);
      if (isOver(job)) {
        stop();
        resolve(job);
      }
    };
    const stop = onJob(look);
    const now = jobs.get(id);
    if (now) look(now);
  });
}

/** Ends a job; nothing is wrong if it is over. */
export const cancel = (id) => cancelJob(id).catch(() => undefined);

/** Why a job has no result, in its own words. */
export function why(job) {
  const words = job.said.map((line) => line.replace(/^error: /, ""));
  return words.join("\n") || `${job.work}: ${WORDS[job.state]}`;
}

/** How far a job is, with a button that ends it. */
export function progressOf(job) {
  const { progress } = job;
  const bar = el("progress", { "aria-label": `Progress of ${job.work} ${job.id}` });
  if (progress?.of) {
    bar.max = progress.of;
    bar.value = progress.done;
  }
  const words = progress ? `${progress.done} of ${progress.of}, ${progress.note}` : WORDS[job.state];
  return el(
    "p",
    { class: "progress" },
    `${job.work}: `,
    bar,
    ` ${words} `,
    button("Cancel", () => cancel(job.id), { "aria-label": `Cancel ${job.work} ${job.id}` }),
  );
}

/** Open lines stay open while the list is drawn anew. */
const open = new Set();

/** The list at the foot of the page. */
export function show() {
  const place = document.getElementById("jobs");
  const all = [...jobs.values()].sort((a, b) => b.id - a.id).slice(0, 30);
  const focused = place.contains(document.activeElement) ? document.activeElement.id : null;
  place.replaceChildren(
    ...all.map((job) => {
      const title = `${job.work} ${job.id}: ${WORDS[job.state]}${job.wall_ms ? `, ${(job.wall_ms / 1000).toFixed(1)} s` : ""}`;
      const details = el(
        "details",
        { class: `job ${job.state}`, open: open.has(job.id) },
        el("summary", { text: title, id: `job-${job.id}` }),
        commandLine(job.command),
        ...job.said.map((line) => el("p", { class: "line", text: line })),
        job.printed
          ? el("pre", {
              text: job.printed,
              tabindex: 0,
              role: "region",
              "aria-label": `What ${job.work} ${job.id} printed`,
            })
          : null,
      );
      details.addEventListener("toggle", () => open[details.open ? "add" : "delete"](job.id));
      return el("div", {}, details, isOver(job) ? null : progressOf(job));
    }),
  );
  if (!all.length) place.append(el("p", { text: "None yet." }));
  if (focused) document.getElementById(focused)?.focus();
}
