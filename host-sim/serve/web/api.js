// What the server is asked. One that does not know this page says where the way in is.

async function ask(path, options = {}) {
  const answer = await fetch(path, { credentials: "same-origin", ...options });
  if (answer.ok) return answer;
  throw new Error((await answer.text()).trim() || `${answer.status} ${answer.statusText}`);
}

const sent = (value) => ({
  method: "POST",
  body: JSON.stringify(value),
  headers: { "content-type": "application/json" },
});

export const state = async () => (await ask("/api/state")).json();
export const jobsAfter = async (revision) => (await ask(`/api/jobs?after=${revision}`)).json();
export const addJob = async (work) => (await ask("/api/jobs", sent(work))).json();
export const cancelJob = async (id) => (await ask(`/api/jobs/${id}`, { method: "DELETE", keepalive: true })).json();
export const showDrive = async (drive, generator, gaps = false) =>
  (await ask("/api/drive", sent({ drive, generator, gaps }))).json();
export const fileText = async (name, head) => (await ask(`/files/${name}${head ? `?head=${head}` : ""}`)).text();
export const fileJson = async (name) => (await ask(`/files/${name}`)).json();

/** A name that the server takes: plain letters, nothing before the first of them. */
export function plainName(name) {
  const plain = name
    .normalize("NFKD")
    .replace(/[^A-Za-z0-9._-]+/g, "-")
    .replace(/^[^A-Za-z0-9]+/, "")
    .replace(/\.+$/, "");
  const ending = /\.[A-Za-z0-9]{1,8}$/.exec(plain)?.[0] ?? "";
  return (plain.slice(0, plain.length - ending.length).slice(0, 80) || "file") + ending;
}

/** Copies a file into the folder; returns the name that it has there. */
export async function sendFile(name, content) {
  const answer = await ask(`/api/files/${plainName(name)}`, { method: "PUT", body: content });
  return (await answer.json()).name;
}
