// The connection to the server's events: a stream, or single snapshots where this browser has no connection left.
const POLL_MS = 700;
// A browser opens six connections to one server; pages and presses need some of them.
const STREAMS_PER_BROWSER = 3;
const { base: BASE, page: PAGE } = document.body.dataset; // the robot and the widgets that this page shows

// One of the browser's places for a stream, as a function that releases it; null if all are in use.
// Browsers without locks (a page without HTTPS that is not on localhost) are not limited.
async function acquirePlace() {
  if (!navigator.locks) return () => {};
  for (let place = 0; place < STREAMS_PER_BROWSER; place++) {
    const release = await new Promise((resolve) => {
      navigator.locks.request(`stream-${place}`, { ifAvailable: true }, (lock) =>
        lock ? new Promise((release) => resolve(release)) : resolve(null),
      );
    });
    if (release) return release;
  }
  return null;
}

// The events of a complete response. Only "\n" ends a line: a text may have other separators.
function parseEvents(text) {
  const fields = (block) => Object.fromEntries(block.split("\n").map((line) => line.split(/: (.*)/s)));
  return text.split("\n\n").map(fields).filter(({ event }) => event);
}

export class Connection {
  #names;
  #timeoutMs;
  #on;
  #stream = null;
  #timer = 0;
  #release = null;
  #turn = 0; // counts openings and closings: results of an earlier one are void
  openedAt = 0; // by performance.now()

  // `names` are those of the events; `on` has `streamed` and `polled`, which take (name, data, id, time of
  // the request, undefined for a stream), and `lost`. Requests end after `timeoutMs`.
  constructor(names, timeoutMs, on) {
    this.#names = names;
    this.#timeoutMs = timeoutMs;
    this.#on = on;
  }

  // Whether an event stream is open; else snapshots are requested one by one.
  get streams() {
    return this.#stream !== null;
  }

  open() {
    this.close();
    this.openedAt = performance.now();
    const turn = this.#turn;
    acquirePlace().then((release) => {
      if (turn !== this.#turn) return release?.();
      this.#release = release;
      if (release) this.#listen();
      else this.#poll();
    });
  }

  openLater() {
    this.close();
    this.#timer = setTimeout(() => this.open(), POLL_MS);
  }

  close() {
    this.#turn += 1;
    this.#stream?.close();
    this.#stream = null;
    clearTimeout(this.#timer);
    this.#timer = 0;
    this.#release?.();
    this.#release = null;
  }

  #listen() {
    this.#stream = new EventSource(`${BASE}/events?page=${PAGE}`);
    for (const name of this.#names) {
      this.#stream.addEventListener(name, ({ data, lastEventId }) => this.#on.streamed(name, JSON.parse(data), lastEventId));
    }
    // Permissions are events named by their interlocks too; the widgets' state is in `update`.
    this.#stream.onerror = () => {
      this.#on.lost();
      // The browser does not retry after a response that is no stream.
      if (this.#stream?.readyState === EventSource.CLOSED) this.openLater();
    };
  }

  async #poll() {
    const sentAt = performance.now();
    const turn = this.#turn;
    try {
      const signal = AbortSignal.timeout(this.#timeoutMs);
      const response = await fetch(`${BASE}/events?once=1&page=${PAGE}`, { cache: "no-store", signal });
      const events = parseEvents(await response.text());
      if (turn !== this.#turn) return;
      if (events[0]?.event !== "snapshot") throw new Error("no snapshot");
      for (const { event, data, id } of events) this.#on.polled(event, JSON.parse(data), id, sentAt);
    } catch {
      if (turn === this.#turn) this.#on.lost();
    }
    if (turn === this.#turn) this.#timer = setTimeout(() => this.open(), POLL_MS);
  }
}
