// The source of the page's state: the server's events, by one EventSource. A browser opens six connections to one server
// over HTTP/1.1, so a hidden page closes its own. `lost` is called within 2 s of the last event.
const OPEN_LATER_MS = 700;
const SILENCE_MS = 1750;
const CHECK_MS = 125;
// A connection that does not respond is replaced after this time.
const REOPEN_MS = 3000;
const DRIFT_MS = 0.1; // how much two clocks may differ from one heartbeat to the next

class Connection {
  /** @type {string[]} */
  #names;
  /** @type {{ event(name: string, text: string, id: string): void, lost(): void }} */
  #on;
  /** @type {EventSource | null} */
  #stream = null;
  #timer = 0;
  openedAt = 0; // by performance.now()

  // `names` are those of the events; `on` has `event`, which takes (name, data as text, id), and `lost`.
  /** @param {string[]} names @param {{ event(name: string, text: string, id: string): void, lost(): void }} on */
  constructor(names, on) {
    this.#names = names;
    this.#on = on;
  }

  open() {
    this.close();
    this.openedAt = performance.now();
    const { base, page } = pageGuard.page;
    const stream = new EventSource(`${base}/events?page=${page}`);
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

export class Source {
  /** @type {Handlers} */
  #handlers;
  /** @type {Connection} */
  #connection;
  // The page is as old as the server's response, not as its script.
  #aliveAt = performance.getEntriesByType("navigation")[0]?.responseStart ?? 0;
  #fresh = true; // the page itself is a snapshot, for as long as any other
  #isStopped = false;
  /** @type {Promise<void>[]} */
  #loads = []; // of further modules
  #loading = 0; // those that are not there yet
  #seen = pageGuard.page.seen;
  // The server's time is at least performance.now() plus this. A delay makes a measured offset smaller, so
  // the largest counts.
  #offset = pageGuard.page.now - this.#aliveAt;
  #synced = true; // false from a snapshot to the heartbeat after it, which starts again

  // `handlers` has a function for each event, and `lost`.
  /** @param {Handlers} handlers */
  constructor(handlers) {
    this.#handlers = handlers;
    this.#connection = new Connection(Object.keys(handlers), {
      event: (name, text, id) => this.#receive(name, text, id),
      lost: () => this.#lose(),
    });
  }

  // The id of the last event: the view that the operator sees.
  get seen() {
    return this.#seen;
  }

  // How long ago the last event arrived.
  get ageMs() {
    return performance.now() - this.#aliveAt;
  }

  // The server's time of an event here, in RFC 3339.
  /** @param {Event} event */
  timeOf(event) {
    return new Date(this.#offset + event.timeStamp).toISOString();
  }

  start() {
    document.addEventListener("visibilitychange", () => (document.hidden ? this.#suspend() : this.#open()));
    addEventListener("pagehide", () => this.#suspend());
    addEventListener("pageshow", (event) => event.persisted && this.#open());
    setTimeout(() => this.#watch(), CHECK_MS);
    if (document.hidden) this.#suspend();
    else this.#open();
    Promise.all(this.#loads).then(pageGuard.started, pageGuard.fail);
  }

  // Loads a further module. The stream opens after that, since the module may show attributes of the snapshot.
  /** @template T @param {Promise<T>} module @param {(module: T) => void} use */
  load(module, use) {
    this.#loading += 1;
    const begin = module.then((loaded) => {
      use(loaded);
      this.#loading -= 1;
      if (!document.hidden) this.#open();
    });
    this.#loads.push(begin);
  }

  // For good: the page is locked, or about to reload.
  stop() {
    this.#isStopped = true;
    this.#connection.close();
    this.#handlers = Object.fromEntries(Object.keys(this.#handlers).map((name) => [name, () => {}]));
  }

  #open() {
    if (!this.#loading && !this.#isStopped) this.#connection.open();
  }

  // A hidden page releases its stream. When it shows again it is locked until a new snapshot.
  #suspend() {
    this.#connection.close();
    this.#lose();
  }

  // An event that was delayed in a buffer is not shown, nor any after it: a new stream starts with a snapshot.
  /** @param {string} name @param {string} text @param {string} id */
  #receive(name, text, id) {
    try {
      const data = JSON.parse(text);
      if (!this.#isLate(name === "beat" ? data.now : Infinity)) return this.#show(name, data, id);
      this.#lose();
      this.#open();
    } catch (error) {
      this.#lose(); // a page that is half updated is locked
      throw error;
    }
  }

  /** @param {number} stamp */
  #isLate(stamp) {
    const now = performance.now();
    const silence = now - Math.max(this.#aliveAt, this.#connection.openedAt);
    if (silence > (this.#fresh ? SILENCE_MS : REOPEN_MS)) return true;
    return this.#synced && this.#offset + now - stamp > SILENCE_MS;
  }

  /** @param {string} name @param {Data} data @param {string} id */
  #show(name, data, id) {
    if (name === "snapshot") {
      this.#fresh = true;
      this.#synced = false;
    }
    if (!this.#fresh) return; // after a loss only a snapshot is valid
    this.#aliveAt = performance.now();
    if (name === "beat") this.#sync(data.now - this.#aliveAt);
    if (id) this.#seen = id;
    this.#handlers[name](data);
  }

  /** @param {number} offset */
  #sync(offset) {
    this.#offset = this.#synced ? Math.max(this.#offset - DRIFT_MS, offset) : offset;
    this.#synced = true;
  }

  // After a silence only a new stream is valid, even if the old one continues.
  #watch() {
    const now = performance.now();
    const left = this.#aliveAt + SILENCE_MS - now;
    setTimeout(() => this.#watch(), left > 0 ? left : CHECK_MS);
    if (document.hidden || left > 0) return;
    const fresh = this.#fresh;
    this.#lose();
    if (fresh || now - this.#connection.openedAt > REOPEN_MS) this.#open();
  }

  #lose() {
    if (!this.#fresh) return;
    this.#fresh = false;
    this.#handlers.lost();
  }
}
