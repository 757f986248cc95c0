// Connects the event stream to the page: each event updates its section of the markup. Starts the page, and loads what it
// needs besides.
import { followEntries } from "./entries.js";
import { Presser } from "./press.js";
import {
  addHooks,
  attempt,
  equipKeys,
  find,
  lockWidget,
  measureKeys,
  needsPerson,
  setText,
  showAttributes,
} from "./show.js";
import { refuseGestures } from "./touches.js";

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

/** @implements {PageSource} */
class Source {
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

const AT_REST_MS = 4000; // after the first snapshot
/** @type {(data?: Data) => void} */
const noop = () => {};
// What is shown of a section that is the same on every page.
const COMMON = { link: showLink, notice: showNotice, state: showState, robots: showRobots };

class Screen {
  #data = pageGuard.page;
  #clock = find(document, "time#clock"); // shows the time of the last heartbeat
  #hasShown = false; // the first snapshot
  #reconnected = false; // a snapshot has arrived after a loss, and no heartbeat after it yet
  #widgets = new Map(
    [...document.querySelectorAll("[data-widget]:not([data-failed])")].map((root) => [root.dataset.widget ?? "", root]),
  );
  /** @type {Record<string, string[]>} */
  #groups = {}; // the widgets that usually change alike, by the name that later events have
  /** @type {string[]} */
  #atRest = []; // the kinds whose script comes when the page shows all else
  #source;
  #presser;
  #control = { show: noop, lost: noop, beat: noop }; // a page without the bar does not require control
  #alarms = { show: noop, control: noop, lost: noop }; // of a panel without alarms
  #recipes = { showRecipes: noop }; // of another page

  constructor() {
    /** @type {Handlers} */
    const shown = {
      ...COMMON,
      widgets: (changes) => this.#showWidgets(changes),
      control: (state) => {
        this.#control.show(state);
        this.#alarms.control(state.role);
      },
      alarms: (alarms) => this.#alarms.show(alarms),
      recipes: (revisions) => this.#recipes.showRecipes(revisions),
    };
    // The sections of a snapshot, by the server's table. Each is an event by itself when it changes.
    const sections = Object.fromEntries(this.#data.sections.map((name) => [name, shown[name]]));
    this.#source = new Source({
      snapshot: (all) => this.#showAll(all, sections),
      update: sections.widgets,
      // What changed in several widgets at once, such as the lock of an interlock.
      updates: ({ groups }) => {
        for (const { group, widgets, attributes } of groups)
          for (const id of widgets ?? this.#groups[group] ?? []) this.#showWidget(id, attributes);
      },
      ...sections,
      browser: noop, // this client's id: for programs
      beat: (now) => this.#beat(now),
      lost: () => this.#lockAll(),
    });
    this.#presser = new Presser(this.#widgets, this.#source, loadAsk);
  }

  async start() {
    const bar = document.querySelector("form#control");
    if (bar) this.#control = new (await import("./control.js")).Control(bar, (event) => this.#source.timeOf(event));
    this.#load();
    window.operatorPanel = { eventAgeMs: () => this.#source.ageMs }; // for the watcher of a kiosk's screen
    pageGuard.onFail = () => this.#source.stop();
    if (!pageGuard.isBroken) this.#source.start();
  }

  // What this page needs besides. The stream waits for what shows a part of a snapshot.
  #load() {
    const source = this.#source;
    if (document.querySelector("[data-step]"))
      source.load(import("./number-inputs.js"), ({ equipInputs }) => equipInputs());
    if (document.querySelector("[data-poll]")) import("./diagnostics.js").catch(pageGuard.fail);
    for (const kind of Object.keys(this.#data.kinds)) {
      // The server has drawn it, and nothing in it is pressed: its script waits for all that is.
      const waits = kind === "trend" && !document.querySelector(".trend-keys");
      if (waits) this.#atRest.push(kind);
      else this.#equip(kind);
    }
    if (document.querySelector(".alarm-line"))
      source.load(import("./alarm-line.js"), ({ AlarmLine }) => this.#followAlarms(new AlarmLine(source)));
    if (document.querySelector("a.user")) import("./session.js").catch(pageGuard.fail);
    if (document.querySelector("[data-recipes]"))
      source.load(import("./recipes.js"), (recipes) => (this.#recipes = recipes));
    equipKeys(() => import("./whole-text.js"));
    if (document.querySelector("template:is(#keypad, #keyboard)")) loadTouchEntry(this.#data.keyboard);
    if (this.#data.sounds) import("./sound.js").catch(pageGuard.fail);
    startFloor();
  }

  /** @param {import("./alarm-line.js").AlarmLine} line */
  #followAlarms(line) {
    const source = this.#source;
    this.#alarms = line;
    if (document.querySelector(".alarm-list ol.alarms"))
      source.load(import("./alarm-list.js"), ({ showRows }) => (line.showRows = showRows));
    if (document.querySelector("#alarm-sheet[popover]"))
      source.load(import("./alarm-sheet.js"), ({ equip }) => equip(source));
    if (document.querySelector("form.alarm-line[data-sound]"))
      source.load(import("./alarm-sound.js"), ({ update, lost }) => (line.sound = { update, lost }));
  }

  /** @param {string} kind */
  #equip(kind) {
    // A script of several kinds has the hooks of each under its name.
    /** @type {Promise<Hooks & Record<string, Hooks>>} */
    const script = import(`./kinds/${this.#data.kinds[kind]}.js`);
    this.#source.load(script, (module) => {
      const hooks = module[kind] ?? module;
      addHooks(kind, hooks);
      for (const root of document.querySelectorAll(`[data-kind="${kind}"]`))
        attempt(root, () => hooks.equip?.(root, this.#source));
    });
  }

  /** @param {Data} all @param {Handlers} sections */
  #showAll(all, sections) {
    if (all.revision !== this.#data.revision) {
      this.#lockAll();
      this.#source.stop();
      return pageGuard.reload(true);
    }
    this.#groups = all.groups ?? {};
    this.#reconnected = "cut" in document.body.dataset;
    delete document.body.dataset.cut;
    for (const [name, show] of Object.entries(sections)) show(all[name]);
    for (const kind of this.#atRest.splice(0)) setTimeout(() => this.#equip(kind), AT_REST_MS);
    if (!this.#hasShown) loadFonts().catch(noop);
    this.#hasShown = true;
  }

  /** @param {Record<string, Attributes>} changes */
  #showWidgets(changes) {
    for (const [id, attributes] of Object.entries(changes)) this.#showWidget(id, attributes);
  }

  /** @param {string} id @param {Attributes} attributes */
  #showWidget(id, attributes) {
    const root = this.#widgets.get(id);
    if (!root) return;
    attempt(root, () => showAttributes(root, attributes));
  }

  /** @param {Record<string, string>} now */
  #beat(now) {
    for (const name of ["clock", "day"]) setText(document.getElementById(name), now[name]);
    this.#clock.dateTime = now.at;
    if (this.#reconnected) setText(document.querySelector('[data-link="server"] [data-text="since"]'), now.clock);
    this.#reconnected = false;
    this.#control.beat();
  }

  // The connection to the server is lost: no permission is known any more.
  #lockAll() {
    this.#presser.close();
    document.body.dataset.cut = "";
    this.#control.lost();
    this.#alarms.lost();
    const { lostShort: text, locksAll: locks, lost, unknown } = this.#data.sentences;
    showState({ state: "lost", text });
    showLamp("server", { state: "bad", text, since: this.#clock.textContent, locks, reason: lost });
    for (const name of ["bridge", "node"]) {
      showLamp(name, { state: "wait", text: unknown, since: "", locks: "", reason: "" });
    }
    for (const tab of document.querySelectorAll("[data-robot]")) {
      tab.dataset.state = "wait";
      setText(tab.querySelector("b"), unknown);
    }
    for (const root of this.#widgets.values()) attempt(root, () => lockWidget(root, lost, unknown));
  }
}

// The shipped fonts, on the first page that a browser shows, after all that is pressed. From the next page on they come
// with the page, by the cookie. They are shown at once where nothing moves that acts or is entered.
const MOST_PX = 1; // that a button may move by rounding
const KEPT_S = 400 * 86_400; // as long as browsers keep a cookie

async function loadFonts() {
  const root = document.documentElement;
  if ("fonts" in root.dataset) return;
  const hasOwn = getComputedStyle(root).getPropertyValue("--own-fonts") !== "";
  const families = [...(hasOwn ? [] : ["IBM Plex Sans"]), ...(root.lang === "ja" ? ["Shipped JP"] : [])];
  const faces = [...document.fonts].filter(({ family }) => families.includes(family.replaceAll('"', "")));
  await Promise.all(faces.map((face) => face.load()));
  const path = new URL("../..", import.meta.url).pathname.replace(/(.)\/$/, "$1");
  if (pageGuard.page.embed === "")
    // biome-ignore lint/suspicious/noDocumentCookie: the Cookie Store API is missing without TLS, and in older browsers
    document.cookie = `kiosk_fonts=kept; path=${path}; max-age=${KEPT_S}; samesite=strict`;
  const buttons = [...document.querySelectorAll("[type=submit], .hold, input, select")];
  const places = () => buttons.map((button) => button.getBoundingClientRect());
  const before = places();
  root.dataset.fonts = "";
  const hasMoved = places().some(({ left, top, right, bottom }, i) => {
    const old = before[i];
    return [left - old.left, top - old.top, right - old.right, bottom - old.bottom].some(
      (px) => Math.abs(px) > MOST_PX,
    );
  });
  if (hasMoved) delete root.dataset.fonts;
  else measureKeys();
}

// The script of the question before a press of a widget: that of its confirmation by a person, if it needs one.
/** @param {HTMLElement} root @returns {Promise<import("./press.js").Ask>} */
async function loadAsk(root) {
  if (!needsPerson(root)) return (await import("./ask.js")).confirm;
  const { confirmByPerson } = await import("./confirm-person.js");
  return (asked, answered, button, inputs) =>
    void confirmByPerson(asked, inputs, (event, { confirmation }) => answered(event, { confirmation }), button);
}

// The keypad and the keyboard, where the screen is touched.
/** @param {string} keyboard */
function loadTouchEntry(keyboard) {
  const coarse = matchMedia("(pointer: coarse)");
  const open = () => void import("./entry/touch-entry.js").catch(pageGuard.fail);
  if (keyboard === "on" || coarse.matches) open();
  else coarse.addEventListener("change", open, { once: true });
}

// The page as a machine's screen: cleaning, dimming, and none of a browser's own gestures.
function startFloor() {
  refuseGestures();
  const afterMs = 1000 * (pageGuard.page.dimAfterS ?? 0);
  if (afterMs) import("./floor/dim.js").then(({ Dimming }) => new Dimming(afterMs)).catch(pageGuard.fail);
  // Loaded with the menu, and where the page was loaded again while it was cleaned.
  /** @type {Promise<import("./floor/clean.js").Cleaning | void> | null} */
  let cleaning = null;
  const begin = () => import("./floor/clean.js").then(({ Cleaning }) => new Cleaning()).catch(pageGuard.fail);
  const loaded = () => (cleaning ??= begin());
  if (pageGuard.recall("cleaning-until")) loaded();
  const menu = find(document, "#menu");
  menu.addEventListener("toggle", loaded, { once: true });
  menu.addEventListener("beforetoggle", followHeader, { once: true });
  const key = find(document, ".menu .clean");
  key.hidden = false;
  key.addEventListener("click", () => loaded().then((one) => one?.start()));
  document.documentElement.dataset.floor = ""; // all of this is in force
}

// What the header has no room for is in the menu, and follows the header there.
function followHeader() {
  const header = find(document, "header");
  const renew = () => {
    for (const copy of document.querySelectorAll(".menu [data-of]"))
      setText(copy, header.querySelector(copy.dataset.of ?? "")?.textContent ?? "");
  };
  new MutationObserver(renew).observe(header, { subtree: true, childList: true, characterData: true });
  renew();
}

/** @param {Record<string, Lamp>} lamps */
function showLink(lamps) {
  for (const [name, { since, ...lamp }] of Object.entries(lamps)) {
    showLamp(name, name === "server" ? lamp : { since, ...lamp }); // this page's own link to the server
  }
}

/** @param {string} name @param {Lamp} lamp */
function showLamp(name, lamp) {
  const light = find(document, `[data-lamp="${name}"]`);
  const row = find(document, `[data-link="${name}"]`);
  light.dataset.state = row.dataset.state = lamp.state;
  setText(light.querySelector("b"), lamp.text);
  for (const [key, text] of Object.entries(lamp)) setText(row.querySelector(`[data-text="${key}"]`), text);
}

// The link status of each robot, on its tab.
/** @param {Record<string, Lamp>} robots */
function showRobots(robots) {
  for (const [id, lamp] of Object.entries(robots)) {
    const tab = find(document, `[data-robot="${id}"]`);
    tab.dataset.state = lamp.state;
    setText(tab.querySelector("b"), lamp.text);
  }
}

/** @param {{ state: string, text: string }} lamp */
function showState({ state, text }) {
  const box = find(document, "#state");
  box.dataset.state = state;
  setText(box.querySelector("b"), text);
}

/** @param {Record<string, string>} notice */
function showNotice(notice) {
  for (const [id, text] of Object.entries(notice)) {
    const element = find(document, `#${id}`);
    setText(element, text);
    element.hidden = !text;
  }
}

followEntries(() => void import("./kept-entries.js").catch(() => {}));
new Screen().start();
