// The editor's server: its state by one event stream, edits one after the other, and the panes as fragments.

/** @typedef {(string | number)[]} Path */
/** @typedef {{ number: number, person: string, path: Path, tag: string }} OtherBrowser */
/**
 * @typedef {object} State
 * @property {number} revision
 * @property {number} drawn The number of the panel that pages are drawn from.
 * @property {number} live The number of the panel whose sessions run.
 * @property {boolean} saved
 * @property {boolean} new Whether the file has nothing yet but an empty page.
 * @property {string} status
 * @property {boolean} undo
 * @property {boolean} redo
 * @property {number} faults
 * @property {number} conflicts With the file on the disk.
 * @property {boolean} gone Whether the file was removed.
 * @property {boolean} recovered Whether there is work that was not saved.
 * @property {number} sending Counts what has changed in what is sent to a kiosk.
 * @property {string} warning
 * @property {OtherBrowser[]} others
 */
/** @typedef {{ op: string, path: Path, value?: unknown, toml?: string, to?: Path, id?: string, text?: string }} Edit */
/** @typedef {{ revision: number, drawn: number, select?: Path | null, message?: string, path?: Path }} Answer */

const REOPEN_MS = 1000;
const OK = 200;
const NOT_OK = 300;
const BEHIND = 409;
const SIGNED_OUT = 401;
const JSON_BODY = { "content-type": "application/json" };

export const browser = crypto.randomUUID();

/** @type {State} */
export let state = {
  revision: 0,
  drawn: 0,
  live: 0,
  saved: true,
  new: false,
  status: "",
  undo: false,
  redo: false,
  faults: 0,
  conflicts: 0,
  gone: false,
  recovered: false,
  warning: "",
  sending: 0,
  others: [],
};

/** @type {((now: State, before: State) => void)[]} */
const listeners = [];
/** @type {((text: string) => void)[]} */
const readers = [];

// Called after each change of the state.
/** @param {(now: State, before: State) => void} listener */
export function onState(listener) {
  listeners.push(listener);
}

// Called with each sentence for the person who edits; "" when it is over.
/** @param {(text: string) => void} reader */
export function onMessage(reader) {
  readers.push(reader);
}

/** @param {string} text */
export function say(text) {
  for (const reader of readers) reader(text);
}

/** @param {Partial<State>} news */
function update(news) {
  const before = state;
  state = { ...state, ...news };
  for (const listener of listeners) listener(state, before);
}

export function open() {
  const stream = new EventSource(`/events?browser=${browser}`);
  stream.addEventListener("state", (event) => {
    say("");
    update(JSON.parse(/** @type {MessageEvent} */ (event).data));
  });
  stream.onerror = () => {
    say(document.body.dataset.lost ?? "");
    if (stream.readyState !== EventSource.CLOSED) return;
    get("/state"); // a stream does not say why it was refused
    setTimeout(open, REOPEN_MS);
  };
}

// Who is signed out signs in again: the server answers with that page. Nothing is lost, the document is the server's.
/** @param {Response} response */
function checkSignedIn(response) {
  if (response.status === SIGNED_OUT) location.assign("/");
  return response;
}

// Edits are posted one after the other, each on what the one before made.
/** @type {Promise<unknown>} */
let last = Promise.resolve();

/** @template T @param {() => Promise<T>} task @returns {Promise<T>} */
function inTurn(task) {
  const done = last.then(task, task);
  last = done.catch(() => {});
  return done;
}

/** @param {string} path @param {BodyInit} body @param {Record<string, string>} [headers] */
async function send(path, body, headers = JSON_BODY) {
  let response;
  try {
    response = checkSignedIn(await fetch(path, { method: "POST", headers, body }));
  } catch {
    return { status: 0, answer: { message: document.body.dataset.lost ?? "" } };
  }
  const answer = response.status === 204 ? {} : await response.json();
  if ("revision" in answer) update(answer);
  return { status: response.status, answer };
}

/** @param {string} path @param {unknown} [body] @returns {Promise<Answer | null>} */
async function post(path, body = {}) {
  const { status, answer } = await send(path, JSON.stringify(body));
  const isDone = status >= OK && status < NOT_OK;
  say(isDone ? "" : (answer.message ?? answer.error ?? ""));
  return isDone ? answer : null;
}

// The same without a message for the whole page: who posts says why it was refused.
/** @param {string} path @param {() => BodyInit} body @param {Record<string, string>} [headers] */
function attempt(path, body, headers) {
  return inTurn(async () => {
    const { status, answer } = await send(path, body(), headers);
    const isDone = status >= OK && status < NOT_OK;
    if (isDone) say("");
    return { ok: isDone, behind: status === BEHIND, message: answer.message ?? answer.error ?? "" };
  });
}

/** @param {Edit[]} edits @param {string} label */
export function tryEdit(edits, label) {
  return attempt("/edits", () => JSON.stringify({ revision: state.revision, edits, label }));
}

// Stores a file beside the panel's, and names it at the key of the path.
/** @param {Path} path @param {File} file */
export function upload(path, file) {
  const query = new URLSearchParams({ path: JSON.stringify(path), name: file.name });
  return attempt(`/files?${query}`, () => file, { "content-type": "application/octet-stream" });
}

// Changes the document, as one step that can be undone; the server's answer, null if it was refused.
/** @param {Edit[]} edits @param {string} [label] */
export function edit(edits, label = "") {
  return inTurn(() => post("/edits", { revision: state.revision, edits, label }));
}

// Chooses what a conflict, or work that was not saved, becomes.
/** @param {"/resolve" | "/recovered"} path @param {Record<string, unknown>} choice */
export function postChoice(path, choice) {
  return inTurn(() => post(path, choice));
}

// Pastes a table by its text, after the table at `path` or at its end.
/** @param {Path} path @param {string} text */
export function pasteText(path, text) {
  return inTurn(() => post("/paste", { path, text }));
}

// Adds what the panes "Robot" and "Parts" offer, as one step.
/** @param {Record<string, unknown>} addition */
export function add(addition) {
  return inTurn(() => post("/add", { revision: state.revision, ...addition }));
}

// Starts the file, or a page; the answer has a `message` if it was refused.
/** @param {Record<string, unknown>} choice */
export function start(choice) {
  return inTurn(async () => (await send("/start", JSON.stringify({ ...choice, revision: state.revision }))).answer);
}

/** @param {"undo" | "redo" | "save"} name @param {Record<string, unknown>} [body] */
export function step(name, body) {
  return inTurn(() => post(`/${name}`, body));
}

// Compares with a kiosk, or sends to it. What comes of it is in the pane "send".
/** @param {"/send/compare" | "/send/take"} path @param {Record<string, unknown>} body */
export function sendTo(path, body) {
  return post(path, body);
}

/** @param {Path | null} path */
export function tellSelection(path) {
  fetch("/selection", { method: "POST", headers: JSON_BODY, body: JSON.stringify({ browser, path }) }).catch(() => {});
}

// What the server answers; null if it refuses or can't be reached.
/** @param {string} path */
export async function get(path) {
  const response = await fetch(path).catch(() => null);
  return response && checkSignedIn(response).ok ? response : null;
}

/** @param {string} name @param {Record<string, string>} query */
export async function part(name, query) {
  const response = await get(`/parts/${name}?${new URLSearchParams(query)}`);
  return response?.text() ?? null;
}
