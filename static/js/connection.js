// The connection to the server: requests, its events by one EventSource, and the lamps of the links. A browser opens
// six connections to one server over HTTP/1.1, so a hidden page closes its own (source.js).
import { setText } from "./show.js";

const OPEN_LATER_MS = 700;
const { base: BASE, page: PAGE } = document.body.dataset; // the robot and the widgets that this page shows

// Posts JSON; given up after a time, by a timer, as some browsers have no `AbortSignal.timeout`.
export function post(url, body, timeoutMs, options) {
  const request = new AbortController();
  setTimeout(() => request.abort(), timeoutMs);
  return fetch(url, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
    signal: request.signal,
    ...options,
  });
}

export function newId() {
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

export class Connection {
  #names;
  #on;
  #stream = null;
  #timer = 0;
  openedAt = 0; // by performance.now()

  // `names` are those of the events; `on` has `event`, which takes (name, data as text, id), and `lost`.
  constructor(names, on) {
    this.#names = names;
    this.#on = on;
  }

  open() {
    this.close();
    this.openedAt = performance.now();
    const stream = new EventSource(`${BASE}/events?page=${PAGE}`);
    for (const name of this.#names) {
      stream.addEventListener(name, ({ data, lastEventId }) => this.#on.event(name, data, lastEventId));
    }
    stream.onerror = () => {
      this.#on.lost();
      // The browser does not retry after a response that is no stream.
      if (this.#stream?.readyState === EventSource.CLOSED) this.openLater();
    };
    this.#stream = stream;
  }

  openLater() {
    this.close();
    this.#timer = setTimeout(() => this.open(), OPEN_LATER_MS);
  }

  close() {
    this.#stream?.close();
    this.#stream = null;
    clearTimeout(this.#timer);
  }
}

export function showLink(lamps) {
  for (const [name, { since, ...lamp }] of Object.entries(lamps)) {
    showLamp(name, name === "server" ? lamp : { since, ...lamp }); // this page's own link to the server
  }
}

export function showLamp(name, lamp) {
  const light = document.querySelector(`[data-lamp="${name}"]`);
  const row = document.querySelector(`[data-link="${name}"]`);
  light.dataset.state = row.dataset.state = lamp.state;
  setText(light.querySelector("b"), lamp.text);
  for (const [key, text] of Object.entries(lamp)) setText(row.querySelector(`[data-text="${key}"]`), text);
}

// The link status of each robot, on its tab.
export function showRobots(robots) {
  for (const [id, lamp] of Object.entries(robots)) {
    const tab = document.querySelector(`[data-robot="${id}"]`);
    tab.dataset.state = lamp.state;
    setText(tab.querySelector("b"), lamp.text);
  }
}
