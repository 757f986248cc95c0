// Where the page's state comes from: the event stream, or snapshots one by one when this browser
// has no connection to spare. Whatever happens, `lost` is called within 2 s of the last sign of life.
const SILENCE_MS = 1750;
const CHECK_MS = 125;
const POLL_MS = 700;
// A connection that hangs is given up after this time: the next one may find the way.
const OPEN_AGAIN_MS = 3000;
// A browser opens six connections to one server; pages and presses need some of them.
const STREAMS_PER_BROWSER = 3;
const DRIFT_MS = 0.1; // by which two clocks may go apart from one beat to the next
const BASE = document.body.dataset.base; // of the robot that this page shows

// Those of an answer that came whole. Only "\n" ends a line: a text may have other separators.
function eventsIn(text) {
  const fields = (block) => Object.fromEntries(block.split("\n").map((line) => line.split(/: (.*)/s)));
  return text.split("\n\n").map(fields).filter(({ event }) => event);
}

export class Source {
  #on;
  #stream = null;
  #poll = 0;
  #giveBack = null;
  // The page is as old as its answer from the server, not as its script.
  #aliveAt = performance.getEntriesByType("navigation")[0]?.responseStart ?? 0;
  #openedAt = 0;
  #turn = 0; // counts openings and closings: what was asked for before the last one is void
  #fresh = true; // the page itself is a snapshot, until its time is up
  #whole = true;
  #seen = document.body.dataset.seen;
  // The server's own time is at least performance.now() plus this: what comes late makes it smaller,
  // so that the largest counts.
  #offset = Number(document.body.dataset.now) - this.#aliveAt;
  #synced = true; // false from a snapshot to the beat behind it, which begins anew

  // `handlers` has a function for each event, and `lost`.
  constructor(handlers) {
    this.#on = handlers;
  }

  // Whether all modules that this page needs are there.
  get whole() {
    return this.#whole;
  }

  // Whether there is an event stream, and not one snapshot after the other.
  get streams() {
    return this.#stream !== null;
  }

  // The id of the last event: what the operator has seen.
  get seen() {
    return this.#seen;
  }

  // The server's own time of an event here, in RFC 3339.
  timeOf(event) {
    return new Date(this.#offset + event.timeStamp).toISOString();
  }

  start() {
    document.addEventListener("visibilitychange", () => (document.hidden ? this.#rest() : this.#open()));
    addEventListener("pagehide", () => this.#rest());
    addEventListener("pageshow", (event) => event.persisted && this.#open());
    setTimeout(() => this.#watch(), CHECK_MS);
    if (document.hidden) this.#rest();
    else this.#open();
  }

  // A further module. Without it the page is not whole: it is locked, and to be loaded anew.
  load(name, use) {
    import(name).then(use, () => {
      this.#whole = false;
      this.#lose();
      this.#again();
    });
  }

  // For good: the page is about to go.
  stop() {
    this.#close();
    this.#on = Object.fromEntries(Object.keys(this.#on).map((name) => [name, () => {}]));
  }

  // A hidden page gives its stream back. It is locked when it shows again, until a fresh snapshot.
  #rest() {
    this.#close();
    this.#lose();
  }

  #open() {
    this.#close();
    this.#openedAt = performance.now();
    const turn = this.#turn;
    this.#take().then((slot) => {
      if (turn !== this.#turn) return slot?.();
      this.#giveBack = slot;
      if (slot) this.#listen();
      else this.#ask();
    });
  }

  #close() {
    this.#turn += 1;
    this.#stream?.close();
    this.#stream = null;
    clearTimeout(this.#poll);
    this.#poll = 0;
    this.#giveBack?.();
    this.#giveBack = null;
  }

  // One of the browser's few places for a stream, as a function that gives it back; null if all are
  // taken. Browsers keep locks from pages without HTTPS or localhost: those take no turns.
  async #take() {
    if (!navigator.locks) return () => {};
    for (let place = 0; place < STREAMS_PER_BROWSER; place++) {
      const slot = await new Promise((resolve) => {
        navigator.locks.request(`stream-${place}`, { ifAvailable: true }, (lock) =>
          lock ? new Promise((release) => resolve(release)) : resolve(null),
        );
      });
      if (slot) return slot;
    }
    return null;
  }

  #listen() {
    this.#stream = new EventSource(`${BASE}/events`);
    for (const name of Object.keys(this.#on)) {
      this.#stream.addEventListener(name, (event) => this.#streamed(name, event));
    }
    // Permissions come under the names of their interlocks too; the widgets' own state is in `update`.
    this.#stream.onerror = () => {
      this.#lose();
      if (this.#stream?.readyState === EventSource.CLOSED) this.#again();
    };
  }

  // The browser gave up for good (an answer that is no stream): it is asked to try again.
  #again() {
    this.#close();
    this.#poll = setTimeout(() => this.#open(), POLL_MS);
  }

  async #ask() {
    const asked = performance.now();
    const turn = this.#turn;
    try {
      const answer = await fetch(`${BASE}/events?once=1`, { cache: "no-store", signal: AbortSignal.timeout(SILENCE_MS) });
      const events = eventsIn(await answer.text());
      if (turn !== this.#turn) return;
      if (events[0]?.event !== "snapshot") throw new Error("no snapshot");
      for (const { event, data, id } of events) this.#got(event, JSON.parse(data), id, asked);
    } catch {
      if (turn === this.#turn) this.#lose();
    }
    if (turn === this.#turn) this.#poll = setTimeout(() => this.#open(), POLL_MS);
  }

  // What has waited on its way, in a buffer of whoever stood still, is not shown, and nothing after
  // it: a new stream begins with what is so now.
  #streamed(name, event) {
    const data = JSON.parse(event.data);
    const stamp = name === "beat" ? data.now : Infinity;
    if (!this.#late(stamp)) return this.#got(name, data, event.lastEventId);
    this.#lose();
    this.#open();
  }

  #late(stamp) {
    const now = performance.now();
    const silence = now - Math.max(this.#aliveAt, this.#openedAt);
    if (silence > (this.#fresh ? SILENCE_MS : OPEN_AGAIN_MS)) return true;
    return this.#synced && this.#offset + now - stamp > SILENCE_MS;
  }

  #got(name, data, id, at = performance.now()) {
    if (name === "snapshot") {
      this.#fresh = true;
      this.#synced = false;
    }
    if (!this.#fresh) return; // after a loss only a snapshot says what is so
    this.#aliveAt = at;
    if (name === "beat") this.#sync(data.now - performance.now());
    if (id) this.#seen = id;
    try {
      this.#on[name](data);
    } catch (error) {
      this.#lose(); // what can't be shown whole is not shown as if it were
      throw error;
    }
  }

  #sync(offset) {
    this.#offset = this.#synced ? Math.max(this.#offset - DRIFT_MS, offset) : offset;
    this.#synced = true;
  }

  // After a silence only a new stream brings a new snapshot, even if the old one speaks again.
  #watch() {
    const now = performance.now();
    const left = this.#aliveAt + SILENCE_MS - now;
    setTimeout(() => this.#watch(), left > 0 ? left : CHECK_MS);
    if (document.hidden || left > 0) return;
    const fresh = this.#fresh;
    this.#lose();
    if (fresh || now - this.#openedAt > OPEN_AGAIN_MS) this.#open();
  }

  #lose() {
    if (!this.#fresh) return;
    this.#fresh = false;
    this.#on.lost();
  }
}
